#include "limber/mesh/winding_number.h"

#include <cmath>
#include <numbers>

namespace limber {

double winding_number(const SurfaceMesh& surface, const Vec3& p) {
  double half_angles = 0.0;
  for (const Triangle& t : surface.triangles) {
    const Vec3 a = surface.vertices[t[0]] - p, b = surface.vertices[t[1]] - p, c = surface.vertices[t[2]] - p;
    const double x = a.norm(), y = b.norm(), z = c.norm();
    half_angles += std::atan2(a.dot(b.cross(c)), x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y);
  }
  return half_angles / (2.0 * std::numbers::pi);
}

}  // namespace limber
