#include "limber/sound/radiation.h"

#include <cmath>
#include <numbers>
#include <string>

#include "limber/core/error.h"

namespace limber {
namespace {

/// S of one mode and triangle: the exact integral of the square of a linear function.
double squared_normal_motion(const SoundModes& modes, Index mode, const Triangle& t, const Vec3& normal, double area) {
  const auto f = [&](Index vertex) { return modes.shape(mode, vertex).cast<double>().dot(normal); };
  const double a = f(t[0]), b = f(t[1]), c = f(t[2]), sum = a + b + c;
  return area / 12.0 * (a * a + b * b + c * c + sum * sum);
}

void require_fit(const SoundModes& modes, std::span<const Vec3f> rest, std::span<const Triangle> triangles) {
  if (static_cast<Index>(rest.size()) != modes.vertices)
    throw InvalidArgument("monopole_gains: " + std::to_string(rest.size()) + " vertices, expected " +
                          std::to_string(modes.vertices) + ", as the modes have");
  for (const Triangle& t : triangles)
    for (const Index v : t)
      if (v < 0 || v >= modes.vertices)
        throw InvalidArgument("monopole_gains: a triangle names vertex " + std::to_string(v) + " of " +
                              std::to_string(modes.vertices));
}

}  // namespace

std::vector<double> monopole_gains(const SoundModes& modes, std::span<const Vec3f> rest,
                                   std::span<const Triangle> triangles, const Air& air) {
  require_fit(modes, rest, triangles);
  if (!(air.density > 0.0 && air.speed > 0.0))
    throw InvalidArgument("monopole_gains: the air's density and speed of sound must be above 0");
  std::vector<double> S(static_cast<std::size_t>(modes.modes()), 0.0);
  double A = 0.0;
  for (const Triangle& t : triangles) {
    const Vec3 a = rest[t[0]].cast<double>(), b = rest[t[1]].cast<double>(), c = rest[t[2]].cast<double>();
    const Vec3 cross = (b - a).cross(c - a);
    const double area = 0.5 * cross.norm();
    if (!(area > 0.0)) continue;  // moves no air
    A += area;
    for (Index k = 0; k < modes.modes(); ++k) S[k] += squared_normal_motion(modes, k, t, cross / (2.0 * area), area);
  }
  if (!(A > 0.0)) throw InvalidArgument("monopole_gains: the surface has no area");
  constexpr double kSphere = 4.0 * std::numbers::pi;
  for (Index k = 0; k < modes.modes(); ++k) {
    const double ka_squared = modes.eigenvalues[k] / (air.speed * air.speed) * A / kSphere;
    S[k] = air.density * air.speed * std::sqrt(ka_squared / (1.0 + ka_squared) * S[k] / kSphere);
  }
  return S;
}

std::vector<double> point_velocity_gains(const SoundModes& modes, Index vertex, const Vec3& direction) {
  if (vertex < 0 || vertex >= modes.vertices)
    throw InvalidArgument("point_velocity_gains: vertex is " + std::to_string(vertex) + ", expected 0 to " +
                          std::to_string(modes.vertices - 1));
  std::vector<double> gains;
  for (Index k = 0; k < modes.modes(); ++k) gains.push_back(modes.shape(k, vertex).cast<double>().dot(direction));
  return gains;
}

}  // namespace limber
