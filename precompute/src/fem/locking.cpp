#include "fem/locking.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {

double dilatation_share(const TetMesh& mesh, std::span<const Material> materials, std::span<const double> shape,
                        double eigenvalue) {
  double twice_energy = 0.0;
  const auto u = [&](Index node) { return Vec3(Eigen::Map<const Vec3>(shape.data() + 3 * node)); };
  for (std::size_t e = 0; e < mesh.tets.size(); ++e) {
    const Tet& t = mesh.tets[e];
    Mat3 edges, moved;
    for (int a = 0; a < 3; ++a) {
      edges.col(a) = mesh.nodes[t[a + 1]] - mesh.nodes[t[0]];
      moved.col(a) = u(t[a + 1]) - u(t[0]);
    }
    const Material& m = materials[mesh.tet_region[e]];
    const double bulk = m.youngs_modulus / (3.0 * (1.0 - 2.0 * m.poisson_ratio));
    const double dilatation = (moved * edges.inverse()).trace();
    twice_energy += bulk * dilatation * dilatation * edges.determinant() / 6.0;
  }
  return twice_energy / eigenvalue;
}

double locking_error(double share, double poisson_ratio) {
  const double excess = std::clamp(share - (1.0 - 2.0 * poisson_ratio) / 3.0, 0.0, 1.0 - 1e-6);
  return 1.0 / std::sqrt(1.0 - excess) - 1.0;
}

}  // namespace limber::internal
