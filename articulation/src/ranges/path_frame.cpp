#include "ranges/path_frame.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "constants.h"

namespace limber::internal {
namespace {

using Kind = MotionPath::Kind;

/// Distance of the origin from a segment in the plane.
double distance_to_segment(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d d = b - a;
  const double length2 = d.squaredNorm();
  const double s = length2 > 0.0 ? std::clamp(-a.dot(d) / length2, 0.0, 1.0) : 0.0;
  return (a + s * d).norm();
}

}  // namespace

double least_radius(const Vec3& a, const Vec3& b, const Vec3& c) {
  const std::array<Eigen::Vector2d, 3> p{a.tail<2>(), b.tail<2>(), c.tail<2>()};
  std::array<double, 3> side{};
  for (std::size_t i = 0; i < 3; ++i) side[i] = p[i].x() * p[(i + 1) % 3].y() - p[i].y() * p[(i + 1) % 3].x();
  const auto [low, high] = std::minmax_element(side.begin(), side.end());
  if (*low >= 0.0 || *high <= 0.0) return 0.0;
  double least = distance_to_segment(p[0], p[1]);
  least = std::min(least, distance_to_segment(p[1], p[2]));
  return std::min(least, distance_to_segment(p[2], p[0]));
}

double wrapped(double angle) {
  while (angle > kPi) angle -= 2.0 * kPi;
  while (angle <= -kPi) angle += 2.0 * kPi;
  return angle;
}

PathFrame::PathFrame(const MotionPath& path) : kind_(path.kind), pitch_(path.pitch), origin_(path.origin) {
  Index least = 0;
  path.axis.cwiseAbs().minCoeff(&least);
  const Vec3 y = path.axis.cross(Vec3::Unit(least)).normalized();
  axes_.col(0) = path.axis;
  axes_.col(1) = y;
  axes_.col(2) = path.axis.cross(y);
}

Vec3 PathFrame::moved(const Vec3& p, double t) const {
  if (kind_ == Kind::kTranslation) return {p.x() + t, p.y(), p.z()};
  const double c = std::cos(t), s = std::sin(t);
  return {kind_ == Kind::kScrew ? p.x() + pitch_ * t : p.x(), c * p.y() - s * p.z(), s * p.y() + c * p.z()};
}

Orbit PathFrame::orbit_of(const Vec3& p) const {
  if (kind_ == Kind::kTranslation) return {{p.y(), p.z()}, p.x()};
  return {{p.tail<2>().norm(), p.x()}, std::atan2(p.z(), p.y())};
}

// Helices of one radius differ in x − pitch θ, which is the same after a turn.
double PathFrame::start_of_helix(const Orbit& orbit) const {
  const double turn = 2.0 * kPi * std::abs(pitch_), s = orbit.plane[1] - pitch_ * orbit.phase;
  return s - turn * std::floor(s / turn);
}

OrbitBox PathFrame::box_of(const Orbit& orbit) const {
  OrbitBox box;
  box.add(orbit.plane[0], kind_ == Kind::kScrew ? start_of_helix(orbit) : orbit.plane[1]);
  return box;
}

OrbitBox PathFrame::plane_point(const Vec3& p) const {
  OrbitBox box;
  if (kind_ == Kind::kTranslation)
    box.add(p.y(), p.z());
  else
    box.add(p.tail<2>().norm(), p.x());
  return box;
}

OrbitBox PathFrame::box_of(std::span<const Vec3, 3> corners) const {
  OrbitBox box;
  for (const Vec3& c : corners) box.add(plane_point(c));
  if (kind_ != Kind::kTranslation) box.low[0] = least_radius(corners[0], corners[1], corners[2]);
  return box;
}

double PathFrame::speed(const Orbit& orbit) const {
  switch (kind_) {
    case Kind::kRotation:
      return orbit.plane[0];
    case Kind::kScrew:
      return std::hypot(orbit.plane[0], pitch_);
    case Kind::kTranslation:
      break;
  }
  return 1.0;
}

Vec3 PathFrame::velocity(const Vec3& p) const {
  if (kind_ == Kind::kTranslation) return Vec3::UnitX();
  return {kind_ == Kind::kScrew ? pitch_ : 0.0, -p.z(), p.y()};
}

Vec3 PathFrame::direction(const Vec3& p) const {
  const Vec3 v = velocity(p);
  const double speed = v.norm();
  return speed > 0.0 ? Vec3(v / speed) : v;
}

std::pair<Vec3, Vec3> PathFrame::box_of(const Eigen::AlignedBox3d& box) const {
  return {to_path(box.center()), axes_.transpose().cwiseAbs() * (0.5 * box.sizes())};
}

OrbitBox PathFrame::box_around(const Eigen::AlignedBox3d& box) const {
  OrbitBox out;
  if (box.isEmpty()) return out;
  const auto [centre, half] = box_of(box);
  if (kind_ == Kind::kTranslation) {
    for (const double side : {-1.0, 1.0}) out.add(centre.y() + side * half.y(), centre.z() + side * half.z());
    return out;
  }
  const double middle = centre.tail<2>().norm(), around = half.tail<2>().norm();
  for (const double side : {-1.0, 1.0})
    out.add(std::max(middle + side * around, 0.0), kind_ == Kind::kScrew ? side * 1e300 : centre.x() + side * half.x());
  return out;
}

}  // namespace limber::internal
