#include "types/motion_space.h"

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <numeric>

#include "limber/core/cross_matrix.h"
#include "tuning.h"

namespace limber::internal {
namespace {

/// Weights that fall with the square root of how much area has a similar normal: a wide plate does not drown the small
/// peg under it. The floor keeps normals that are nothing but noise from counting for much.
std::vector<double> balanced_weights(const std::vector<WeightedPoint>& points) {
  const TypesTuning& t = tuning().types;
  const std::size_t stride = 1 + points.size() / t.weights.similar_compared;
  const std::size_t count = (points.size() + stride - 1) / stride;
  // By coordinate, so that several are compared at once.
  std::array<std::vector<double>, 3> normals;
  std::vector<double> areas;
  double compared = 0.0;
  for (std::size_t j = 0; j < points.size(); j += stride) {
    for (std::size_t k = 0; k < 3; ++k) normals[k].push_back(points[j].normal[static_cast<Index>(k)]);
    areas.push_back(points[j].weight);
    compared += points[j].weight;
  }
  std::vector<double> weights, alike(count);
  weights.reserve(points.size());
  double similar = 0.0;
  Vec3 last = Vec3::Zero();
  for (const WeightedPoint& p : points) {
    if (p.normal == last) {  // on one flat face
      weights.push_back(p.weight / similar);
      continue;
    }
    last = p.normal;
    const double x = p.normal.x(), y = p.normal.y(), z = p.normal.z();
    for (std::size_t j = 0; j < count; ++j)
      alike[j] = x * normals[0][j] + y * normals[1][j] + z * normals[2][j] > t.weights.similar ? areas[j] : 0.0;
    similar = std::sqrt(t.weights.similar_floor * compared + std::reduce(alike.begin(), alike.end()));
    weights.push_back(p.weight / similar);
  }
  return weights;
}

/// Eigenvalues, ascending, and eigenvectors of a symmetric matrix.
MotionSpace::Spectrum symmetric_spectrum(const SmallMatrix& A) {
  const Eigen::SelfAdjointEigenSolver<SmallMatrix> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace

Motion rotation_about(const Vec3& axis, const Vec3& through) {
  Motion out;
  out << axis, through.cross(axis);
  return out;
}

Motion translation_along(const Vec3& direction) {
  Motion out;
  out << Vec3::Zero(), direction;
  return out;
}

MotionSpace::MotionSpace(const std::vector<ContactRegion>& regions) {
  double area = 0.0;
  for (const ContactRegion& region : regions)
    for (const auto* side : {&region.on_a, &region.on_b})
      for (const ContactSample& s : *side) {
        points_.push_back({s.point, s.normal, s.facet_point, s.facet_normal, s.area});
        middles_.push_back(0.5 * (s.point + s.facing_point));
        centre_ += s.area * s.point;
        spread_ += s.area * s.normal.cross(s.facing_normal).squaredNorm();
        area += s.area;
      }
  centre_ /= area;
  spread_ /= area;
  double radius = 0.0;
  for (const WeightedPoint& p : points_) radius += p.weight * (p.point - centre_).squaredNorm();
  scale_ = std::sqrt(radius / area);
  for (WeightedPoint& p : points_)
    for (Vec3* x : {&p.point, &p.facet_point}) *x = (*x - centre_) / scale_;

  const auto weights = balanced_weights(points_);
  C_.setZero();
  M_.setZero();
  normal_covariance_.setZero();
  double total = 0.0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    WeightedPoint& p = points_[i];
    p.weight = weights[i];
    Motion c;
    c << p.point.cross(p.normal), p.normal;
    C_ += p.weight * c * c.transpose();
    Eigen::Matrix<double, 3, 6> G;
    G << -cross_matrix(p.point), Mat3::Identity();
    M_ += p.weight * G.transpose() * G;
    normal_covariance_ += p.weight * p.normal * p.normal.transpose();
    total += p.weight;
  }
  C_ /= total;
  M_ /= total;
  normal_covariance_ /= total;
}

MotionSpace::Spectrum MotionSpace::spectrum(const Motions& basis) const {
  constexpr double kDefinite = 1e-12;  // above round-off: keeps M definite for samples on a line
  const Eigen::Matrix<double, 6, 6> M = M_ + kDefinite * Eigen::Matrix<double, 6, 6>::Identity();
  // In coordinates in which M is 1.
  const auto [masses, axes] = symmetric_spectrum(basis.transpose() * M * basis);
  const SmallMatrix unit = axes * masses.cwiseSqrt().cwiseInverse().asDiagonal();
  const Motions motions = basis * unit;
  const auto [mu, vectors] = symmetric_spectrum(motions.transpose() * C_ * motions);
  return {mu.cwiseMax(0.0), unit * vectors};
}

MotionSpace::Spectrum MotionSpace::spectrum_of_C() const { return symmetric_spectrum(C_); }

Motions MotionSpace::complement(const Motions& basis) const {
  // Reflections that turn M · basis into its upper triangle: the last columns of their product are orthogonal to it.
  Motions rest = M_ * basis;
  Eigen::Matrix<double, 6, 6> Q = Eigen::Matrix<double, 6, 6>::Identity();
  Motion room;
  for (Eigen::Index j = 0; j < basis.cols(); ++j) {
    SmallVector essential(5 - j);
    double factor = 0.0, length = 0.0;
    rest.col(j).tail(6 - j).makeHouseholder(essential, factor, length);
    rest.bottomRightCorner(6 - j, basis.cols() - j).applyHouseholderOnTheLeft(essential, factor, room.data());
    Q.rightCols(6 - j).applyHouseholderOnTheRight(essential, factor, room.data());
  }
  return Q.rightCols(6 - basis.cols());
}

}  // namespace limber::internal
