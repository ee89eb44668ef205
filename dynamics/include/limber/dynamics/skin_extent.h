/// @file limber/dynamics/skin_extent.h
/// Bound on the motion of a surface that bends by a modal skin while its amplitudes change, as SurfaceExtent is for
/// surfaces that bend by their modes alone.
///
///   x = p_h + R_h (y − r_h) of each handle h of a vertex, y = r + Ũ z;   |∂_i x| ≤ |t'_hi + Ω_hi × R_h c| + |Ω_hi| ρ + |Ũ_i| now,
///   |∂_ij x| ≤ Σ_l [3/2 |Θ_li||Θ_lj||a_lh + D_lh z| + |Θ_li||D_lhj| + |Θ_lj||D_lhi|]
///              + 3/2 |Θ_hi||Θ_hj||y − r_h| + |Θ_hi||Ũ_j| + |Θ_hj||Ũ_i|
/// c and ρ a ball about the vertices of the handle. A vertex moves by at most the most of its handles, as weights are
/// no less than 0 and sum to 1. The present rates of free bodies are those in their frame; the second derivatives of
/// Eckart's rotation follow from how firmly its condition holds the frame, axis by axis. Derivation:
/// docs/derivations/modal-skin.md.
#pragma once

#include <span>
#include <vector>

#include "limber/dynamics/surface_point.h"
#include "limber/model/skin_pose.h"

namespace limber {

/// Extent of the collision surface of one model. Immutable.
class SkinExtent {
 public:
  /// @pre the model has a skin, and outlives this
  explicit SkinExtent(const ModalModel& model);

  /// Bounds over all amplitudes ζ with |ζ_i − z_i| ≤ change_i.
  /// @param pose at z, differentiated. @param change ≥ 0
  /// @param shape out: no vertex moves by more than Σ shape_i change_i. @param scratch 3 k numbers
  /// @return no vertex is farther from the body origin now, m
  double find(const SkinPose& pose, std::span<const double> z, std::span<const double> change, std::span<double> shape,
              std::span<double> scratch) const;

 private:
  /// The vertices that hang on a handle.
  struct Ball {
    Vec3 center = Vec3::Zero();  // of the rest shape
    double radius = 0.0;         // about it
    double reach = 0.0;          // about the handle
    bool used = false;
  };
  void find_curvature(Index h, std::span<const double> z, std::span<const double> change, std::span<double> out,
                      std::span<double> sums) const;
  double farthest(const SkinPose& pose, double flexed) const;
  double farthest_over_turns(const SkinPose& pose, double flexed) const;
  void keep_in_frame(const SkinPose& pose, double flexed, double far, std::span<const double> change,
                     std::span<const double> scratch, std::span<double> shape) const;

  const ModalSkin* skin_;
  std::size_t k_ = 0;
  std::vector<Ball> balls_;             // by handle
  std::vector<double> turns_, shifts_;  // |Θ_hi|; |D_lhi|
  std::vector<double> flexing_;         // the largest |Ũ_i|
  // For free bodies, with C = Σ m r rᵀ/m and J = (tr C) 1 − C: √C, 1/√J, √(least of J).
  Mat3 root_moment_ = Mat3::Zero(), turned_ = Mat3::Zero();
  double thinnest_ = 0.0;
};

}  // namespace limber
