/// @file motion_space.h
/// Rigid motions of a contact and how much each slips. Private to the articulation module.
///
/// Coordinates are the contact's own: about its centroid, in units of its RMS radius, so that the 6 × 6 matrices are
/// well scaled. A motion ξ = (ω, v) moves p with ω × p + v.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "limber/articulation/contact_region.h"
#include "limber/core/types.h"

namespace limber::internal {

using Motion = Eigen::Matrix<double, 6, 1>;
/// A few motions, one a column. That there are at most six lets Eigen do without its kernels for large matrices, which
/// take most of a minute to compile.
using Motions = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>;
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6, 1>;

struct WeightedPoint {
  Vec3 point, normal;
  Vec3 facet_point, facet_normal;  ///< as drawn
  double weight;
};

/// C and M of slippage.h (1) over a contact's samples.
class MotionSpace {
 public:
  explicit MotionSpace(const std::vector<ContactRegion>& regions);

  const std::vector<WeightedPoint>& points() const { return points_; }
  /// Midway between each sample and what it faces, in the input's coordinates.
  const std::vector<Vec3>& middles() const { return middles_; }
  const Eigen::Matrix<double, 6, 6>& C() const { return C_; }
  const Eigen::Matrix<double, 6, 6>& M() const { return M_; }
  /// Σ w n nᵀ / Σ w
  const Mat3& normal_covariance() const { return normal_covariance_; }
  double spread() const { return spread_; }

  Vec3 to_input(const Vec3& p) const { return centre_ + scale_ * p; }
  double scale() const { return scale_; }

  /// μ of the motions in a subspace, ascending, and the motions in the subspace's coordinates (columns).
  struct Spectrum {
    SmallVector mu;
    SmallMatrix vectors;
  };
  Spectrum spectrum(const Motions& basis) const;
  /// The same of all motions.
  Spectrum spectrum() const { return spectrum(Motions::Identity(6, 6)); }
  /// The motions that are M-orthogonal to a subspace of independent motions.
  Motions complement(const Motions& basis) const;
  /// Eigenvalues of C, ascending, and its eigenvectors: [X09]'s, who take M = 1.
  Spectrum spectrum_of_C() const;

 private:
  std::vector<WeightedPoint> points_;
  std::vector<Vec3> middles_;
  Vec3 centre_ = Vec3::Zero();
  double scale_ = 1.0, spread_ = 0.0;
  Eigen::Matrix<double, 6, 6> C_, M_;
  Mat3 normal_covariance_;
};

Motion rotation_about(const Vec3& axis, const Vec3& through);
Motion translation_along(const Vec3& direction);

}  // namespace limber::internal
