// A bar on two supports, from bake through contact to rest, against K u = f of all its nodes.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "constants.h"
#include "dense_fem.h"
#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber {
namespace {

using testing::kGravity;

const Material kRubber{.youngs_modulus = 2e7, .poisson_ratio = 0.3, .density = 1000.0};
const Vec3 kBeam{0.6, 0.05, 0.05};
constexpr int kCells = 12, kInset = 1;  // along the bar; cells from its ends to the supports

TetMesh beam() { return testing::tet_box(kCells, 1, 1, kBeam); }

/// Nodes of the lower face a number of cells from the left end.
std::vector<Index> lower_nodes(int cell) {
  const double x = kBeam.x() * cell / kCells;
  return testing::nodes_where(beam(), [x](const Vec3& n) { return std::abs(n.x() - x) < 1e-9 && n.z() < 1e-9; });
}

/// How far the middle of the lower face is below where it rests, from the whole model: four nodes held upwards, nothing
/// sideways but what fixes the bar in its place.
double sag_of_whole_model() {
  auto [K, M] = testing::dense_model(beam(), std::array{kRubber}, true);
  Eigen::VectorXd load = Eigen::VectorXd::Zero(K.rows());
  for (Eigen::Index i = 2; i < load.size(); i += 3) load -= kGravity * M.col(i);
  const auto hold = [&](Index node, int axis) {
    const Eigen::Index i = 3 * static_cast<Eigen::Index>(node) + axis;
    K.row(i).setZero();
    K.col(i).setZero();
    K(i, i) = 1.0;
    load[i] = 0.0;
  };
  const std::vector<Index> left = lower_nodes(kInset), right = lower_nodes(kCells - kInset);
  for (const std::vector<Index>* nodes : {&left, &right})
    for (const Index n : *nodes) hold(n, 2);
  hold(left[0], 0), hold(left[0], 1), hold(right[0], 1);
  const Eigen::VectorXd u = K.llt().solve(load);
  return -u[3 * static_cast<Eigen::Index>(lower_nodes(kCells / 2)[0]) + 2];
}

/// The same from the world: the bar on two thin rods, at rest.
double sag_of_world(int modes, bool residual) {
  BakeOptions o;
  o.materials = {{"*", kRubber}};
  o.analysis.modes = o.limits.max_modes = modes;
  o.residual.surface = true;
  o.damping = RayleighDamping::from_ratio(0.3, 30.0, 300.0);
  Warnings warnings;
  const TetMesh mesh = beam();
  const auto model = bake({.name = "bar", .mesh = mesh}, o, warnings).asset.bodies[0];
  ContactFinder finder;
  World world;
  world.set_contact_source(&finder,
                           {.solver = ContactSolver::kExact, .friction = 0.0, .residual_compliance = residual});
  constexpr double kRadius = 0.01;
  const Vec3 origin = model->data().origin_in_input;
  const Quaternion across = quaternion_from_rotation_vector({0.5 * EIGEN_PI, 0.0, 0.0});  // from z to y
  for (const int cell : {kInset, kCells - kInset}) {
    const Vec3 below(kBeam.x() * cell / kCells, 0.5 * kBeam.y(), -kRadius);
    world.add_static(std::make_shared<Shape>(Capsule{.radius = kRadius, .half_length = kBeam.y()}),
                     {across, below - origin});
  }
  const BodyId id = world.add_body(model);
  // Nothing holds it sideways, and a bar that has turned on its supports sags more, so that it goes on turning: its sag
  // is that of the straight one once it has come to rest and before it has turned.
  for (int i = 0; i < 100; ++i) world.step();
  EXPECT_LT(std::abs(world.body(id).velocity.z()), 1e-5);  // nothing holds it sideways
  // The node in the middle, as a point of the surface.
  const Vec3 middle = mesh.nodes[static_cast<std::size_t>(lower_nodes(kCells / 2)[0])] - origin;
  const ModalSurface& surface = model->collision();
  for (std::size_t t = 0; t < surface.triangles.size(); ++t)
    for (std::size_t c = 0; c < 3; ++c)
      if ((surface.rest[static_cast<std::size_t>(surface.triangles[t][c])].cast<double>() - middle).norm() < 1e-6) {
        SurfacePoint at{.surface = SurfacePoint::Surface::kCollision, .triangle = static_cast<Index>(t)};
        at.weight = {0.0, 0.0, 0.0};
        at.weight[c] = 1.0;
        return middle.z() - world.position(id, at).z();
      }
  return 0.0;
}

TEST(Sag, OfABarOnTwoSupportsIsThatOfTheWholeModel) {
  const double whole = sag_of_whole_model();
  ASSERT_GT(whole, 5e-4 * kBeam.x());
  for (const int modes : {20, 40}) {
    EXPECT_NEAR(sag_of_world(modes, true), whole, 0.01 * whole) << modes;
    EXPECT_NEAR(sag_of_world(modes, false), whole, 0.05 * whole) << modes;
  }
}

}  // namespace
}  // namespace limber
