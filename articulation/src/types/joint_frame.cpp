#include "types/joint_frame.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>

#include "tuning.h"

namespace limber::internal {
namespace {

Vec3 mean(std::span<const Vec3> points) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

/// Principal axes of points, variance ascending.
Eigen::SelfAdjointEigenSolver<Mat3> principal_axes(std::span<const Vec3> points) {
  const Vec3 centre = mean(points);
  Mat3 covariance = Mat3::Zero();
  for (const Vec3& p : points) covariance += (p - centre) * (p - centre).transpose();
  return Eigen::SelfAdjointEigenSolver<Mat3>(covariance);
}

/// The sense in which the largest coordinate is positive.
Vec3 canonical_sense(const Vec3& v) {
  int largest = 0;
  v.cwiseAbs().maxCoeff(&largest);
  return v[largest] < 0.0 ? Vec3(-v) : v;
}

/// The middle of the points' extent along the axis, on it.
Vec3 middle_on_axis(const Vec3& axis, const Vec3& origin, std::span<const Vec3> points) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Vec3& p : points) {
    const double s = axis.dot(p - origin);
    low = std::min(low, s), high = std::max(high, s);
  }
  return origin + 0.5 * (low + high) * axis;
}

/// The outer principal axis whose variance stands further apart: a ring or a cap is round about it.
Vec3 axis_of_symmetry(const Eigen::SelfAdjointEigenSolver<Mat3>& principal) {
  const Vec3& v = principal.eigenvalues();
  return principal.eigenvectors().col(v[2] - v[1] > v[1] - v[0] ? 2 : 0);
}

/// Columns a, b′, a × b′, where b′ is the part of b across a.
Mat3 right_handed(const Vec3& a, const Vec3& b) {
  Vec3 across = b - a * a.dot(b);
  across = across.norm() > tuning().types.frames.frame_across ? Vec3(across.normalized()) : a.unitOrthogonal();
  Mat3 out;
  out << a, across, a.cross(across);
  return out;
}

}  // namespace

JointFrame joint_frame(JointType type, const Vec3& axis, const Vec3& origin, std::span<const Vec3> points) {
  const auto principal = principal_axes(points);
  const Vec3 widest = canonical_sense(principal.eigenvectors().col(2)),
             second = canonical_sense(principal.eigenvectors().col(1));
  if (type == JointType::kBall) return {origin, right_handed(canonical_sense(axis_of_symmetry(principal)), second)};
  if (type == JointType::kFixed) return {mean(points), right_handed(widest, second)};
  const Vec3 main = canonical_sense(axis);
  const Vec3 other = std::abs(main.dot(widest)) < tuning().types.frames.frame_aligned ? widest : second;
  if (type == JointType::kPlanar) {
    const Mat3 m = right_handed(main, other);  // z, x, y
    Mat3 axes;
    axes << m.col(1), m.col(2), m.col(0);
    return {mean(points), axes};
  }
  const Vec3 on_axis = type == JointType::kPrismatic ? mean(points) : origin;
  return {middle_on_axis(main, on_axis, points), right_handed(main, other)};
}

}  // namespace limber::internal
