#include "fem/mass_properties.h"

namespace limber::internal {

MassProperties mass_properties(const TetMesh& mesh, std::span<const Material> materials) {
  MassProperties p;
  const Vec3 base = mesh.nodes[mesh.tets[0][0]];  // moments about a far origin would cancel
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const double volume = signed_volume(mesh, static_cast<Index>(t));
    const double mass = materials[mesh.tet_region[t]].density * volume;
    Vec3 sum = Vec3::Zero();
    Mat3 outer = Mat3::Zero();
    for (const Index n : mesh.tets[t]) {
      const Vec3 x = mesh.nodes[n] - base;
      sum += x;
      outer += x * x.transpose();
    }
    p.volume += volume;
    p.mass += mass;
    first += mass / 4.0 * sum;
    second += mass / 20.0 * (outer + sum * sum.transpose());  // ∫ρ x xᵀ dV of a linear tet
  }
  const Vec3 c = first / p.mass;
  const Mat3 about_center = second - p.mass * (c * c.transpose());
  p.center = base + c;
  p.inertia = about_center.trace() * Mat3::Identity() - about_center;
  return p;
}

}  // namespace limber::internal
