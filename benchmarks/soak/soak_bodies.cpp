#include "soak_bodies.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>

#include "limber/mesh/tet_mesh.h"
#include "limber/precompute/bake.h"
#include "limber/scene/scene_model.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

constexpr int kModes = 12;

std::shared_ptr<const ModalModel> bake_box(const std::array<int, 3>& cells, const Vec3& size, double youngs_modulus) {
  BakeOptions options;
  options.materials = {{"*", {.youngs_modulus = youngs_modulus, .poisson_ratio = 0.4, .density = 1000.0}}};
  options.analysis.modes = options.limits.max_modes = kModes;
  options.damping = RayleighDamping::from_ratio(0.03, 50.0, 500.0);
  options.residual.surface = true;
  Warnings warnings;
  TetMesh mesh = tet_box(cells[0], cells[1], cells[2], size);
  return bake({.name = "body", .mesh = std::move(mesh)}, options, warnings).asset.bodies.front();
}

}  // namespace

SoakBodies bake_soak_bodies() {
  SoakBodies bodies{.box = bake_box({3, 3, 3}, Vec3::Constant(0.3), 1e7),
                    .bar = bake_box({6, 2, 2}, {0.5, 0.12, 0.12}, 1e7),
                    .rigid = {}};
  bodies.rigid = reduce_model(*bodies.box, {});
  return bodies;
}

double largest_compliance(const ModalModel& model) {
  if (!model.data().residual_compliance) return 0.0;
  const ResidualCompliance& compliance = *model.data().residual_compliance;
  double largest = 0.0;
  for (Index v = 0; v < compliance.vertices(); ++v)
    largest = std::max(
        largest, Eigen::SelfAdjointEigenSolver<Mat3>(compliance.block(v, v), Eigen::EigenvaluesOnly).eigenvalues()(2));
  return largest;
}

}  // namespace limber::testing
