#include "limber/core/quaternion.h"

#include <Eigen/Geometry>

namespace limber {

Quaternion quaternion_from_rotation_vector(const Vec3& r) {
  const double angle = r.norm();
  const double half = 0.5 * angle;
  // sin(a/2)/a has the series 1/2 − a²/48 + …; below 1e-4 two terms are exact to round-off.
  const double s = angle < 1e-4 ? 0.5 - angle * angle / 48.0 : std::sin(half) / angle;
  return {std::cos(half), s * r.x(), s * r.y(), s * r.z()};
}

Vec3 rotation_vector(const Quaternion& q) {
  const Vec3 v = q.w < 0.0 ? Vec3(-q.vector()) : q.vector();
  const double sine = v.norm();
  if (sine == 0.0) return Vec3::Zero();
  return 2.0 * std::atan2(sine, std::abs(q.w)) / sine * v;
}

Mat3 to_matrix(const Quaternion& q) {
  return Eigen::Quaternion<double, Eigen::DontAlign>(q.w, q.x, q.y, q.z).toRotationMatrix();
}

Quaternion quaternion_from_matrix(const Mat3& R) {
  const Eigen::Quaternion<double, Eigen::DontAlign> q(R);
  const double s = q.w() < 0.0 ? -1.0 : 1.0;
  return normalized({s * q.w(), s * q.x(), s * q.y(), s * q.z()});
}

Quaternion slerp(const Quaternion& a, const Quaternion& b, double s) {
  // Near coincidence acos loses half the digits; a normalised chord is then exact to round-off.
  const double dot = a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z;
  const double sign = dot < 0.0 ? -1.0 : 1.0;
  const double cosine = std::min(1.0, std::abs(dot));
  double from = 1.0 - s, to = s;
  if (cosine < 1.0 - 1e-10) {
    const double angle = std::acos(cosine);
    from = std::sin((1.0 - s) * angle) / std::sin(angle);
    to = std::sin(s * angle) / std::sin(angle);
  }
  to *= sign;
  return normalized({from * a.w + to * b.w, from * a.x + to * b.x, from * a.y + to * b.y, from * a.z + to * b.z});
}

}  // namespace limber
