// Bodies pressed flat against others, with the contacts that are kept by default and with all of them, against K u = f
// of all their nodes: contacts that stand for a region yield as the region does, on coarse meshes and on fine ones.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <array>
#include <cmath>

#include "box_stack.h"
#include "constants.h"
#include "dense_fem.h"
#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber {
namespace {

using testing::BoxStack;
using testing::kGravity;
using testing::WholeStack;

const Material kSoftRubber{.youngs_modulus = 5e6, .poisson_ratio = 0.4, .density = 1100.0};

constexpr double kOff = 0.05;  // what sinks, of the whole model's

using Cells = std::array<int, 3>;

struct Solid {
  Vec3 size;
  Cells cells;
  int modes;
  double damping_ratio = 1.0;

  TetMesh mesh() const { return testing::tet_box(cells[0], cells[1], cells[2], size); }
  std::shared_ptr<const ModalModel> baked() const {
    BakeOptions o;
    o.materials = {{"*", kSoftRubber}};
    o.analysis.modes = o.limits.max_modes = modes;
    o.analysis.mass = MassKind::kConsistent;
    o.residual.surface = true;
    o.damping = RayleighDamping::from_ratio(damping_ratio, 30.0, 300.0);
    Warnings warnings;
    return bake({.name = "solid", .mesh = mesh()}, o, warnings).asset.bodies[0];
  }
};

/// What a block does between the ground and a punch, or under its own weight.
struct Pressed {
  double sunk = 0.0;   // its centre of mass, m
  double force = 0.0;  // on the punch, N
};

/// A rigid block that is let into the top by so much.
struct Punch {
  Vec3 half_extents = Vec3::Zero();
  double depth = 0.0;
  bool over(const Vec3& p, const Vec3& size) const {
    return depth > 0.0 && p.z() > size.z() - 1e-9 && std::abs(p.x() - 0.5 * size.x()) < half_extents.x() &&
           std::abs(p.y() - 0.5 * size.y()) < half_extents.y();
  }
};

/// All nodes below on the ground, those of the top under the punch let in by its depth; no friction.
Pressed whole_model(const Solid& solid, const Punch& punch) {
  const TetMesh mesh = solid.mesh();
  const auto rows = static_cast<Eigen::Index>(3 * mesh.nodes.size());
  std::vector<Eigen::Triplet<double>> stiffness;
  Eigen::VectorXd mass = Eigen::VectorXd::Zero(rows), u = Eigen::VectorXd::Zero(rows);  // mass along z
  const auto material_of = [](std::size_t) -> const Material& { return kSoftRubber; };
  testing::for_each_element(mesh, false, material_of, [&](const Tet& t, const auto& K, const auto& M) {
    for (int i = 0; i < 12; ++i)
      for (int j = 0; j < 12; ++j) stiffness.emplace_back(3 * t[i / 3] + i % 3, 3 * t[j / 3] + j % 3, K(i, j));
    for (int i = 0; i < 4; ++i) mass[3 * t[i] + 2] += M.row(i).sum();
  });
  Eigen::SparseMatrix<double> K(rows, rows);
  K.setFromTriplets(stiffness.begin(), stiffness.end());

  std::vector<char> held(static_cast<std::size_t>(rows), 0);
  std::vector<Index> under;
  for (Index n = 0; n < static_cast<Index>(mesh.nodes.size()); ++n) {
    const Vec3& p = mesh.nodes[static_cast<std::size_t>(n)];
    const auto dof = static_cast<std::size_t>(3 * n);
    if (p.z() < 1e-9) held[dof + 2] = 1;
    if (p.norm() < 1e-9) held[dof] = held[dof + 1] = 1;
    if ((p - Vec3(solid.size.x(), 0.0, 0.0)).norm() < 1e-9) held[dof + 1] = 1;
    if (!punch.over(p, solid.size)) continue;
    under.push_back(n);
    held[dof + 2] = 1;
    u[3 * n + 2] = -punch.depth;
  }
  Eigen::VectorXd load = -kGravity * mass - K * u;
  Eigen::SparseMatrix<double> free = K;
  const auto is_held = [&](Eigen::Index i) { return held[static_cast<std::size_t>(i)] != 0; };
  free.prune([&](Eigen::Index i, Eigen::Index j, double) { return i == j || (!is_held(i) && !is_held(j)); });
  for (Eigen::Index i = 0; i < rows; ++i) load[i] = is_held(i) ? 0.0 : load[i];
  u += Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(free).solve(load);
  const Eigen::VectorXd forces = K * u + kGravity * mass;
  Pressed pressed{.sunk = -mass.dot(u) / mass.sum()};
  for (const Index n : under) pressed.force -= forces[3 * n + 2];
  return pressed;
}

struct Rest {
  Pressed pressed;
  double speed = 0.0;
};

Rest at_rest(const Solid& solid, const std::shared_ptr<const ModalModel>& model, const Punch& punch) {
  ContactFinder finder;
  World world;
  world.set_contact_source(&finder, {.solver = ContactSolver::kExact, .friction = 0.0});
  world.add_static(std::make_shared<Shape>(HalfSpace{}));
  const Vec3 origin = model->data().origin_in_input, middle = 0.5 * solid.size;
  const BodyId id = world.add_body(model, {.pose = {{}, origin}});
  BodyId block{};
  if (punch.depth > 0.0)
    block = world.add_static(std::make_shared<Shape>(Box{punch.half_extents}),
                             {{}, {middle.x(), middle.y(), solid.size.z() + punch.half_extents.z() - punch.depth}});
  for (int i = 0; i < 90; ++i) world.step();
  Rest rest{.pressed = {.sunk = origin.z() - world.body(id).pose.p.z()},
            .speed = std::abs(world.body(id).velocity.z())};
  for (const ContactEvent& e : world.contact_events()) {
    const auto at = static_cast<Index>(block.index);
    if (punch.depth > 0.0 && (e.a == at || e.b == at))
      rest.pressed.force += std::abs(e.impulse.z()) / world.options().step;
  }
  return rest;
}

/// @param punch_part of the solid's sides; 0: none
void expect_compliance_of_whole_model(const Solid& solid, double punch_part = 0.0) {
  constexpr double kDepth = 1e-4, kBeyond = 1e-3;  // the outline is this far beyond the nodes under it
  const Punch punch{
      .half_extents = {0.5 * punch_part * solid.size.x() + kBeyond, 0.5 * punch_part * solid.size.y() + kBeyond, 0.02},
      .depth = punch_part > 0.0 ? kDepth : 0.0};
  const auto model = solid.baked();
  const Pressed whole = whole_model(solid, punch);
  const Rest rest = at_rest(solid, model, punch);
  EXPECT_LT(rest.speed, 1e-7);
  EXPECT_NEAR(rest.pressed.sunk / whole.sunk, 1.0, kOff);
  if (punch_part > 0.0) {
    EXPECT_NEAR(rest.pressed.force / whole.force, 1.0, kOff);
  }
}

class Refined : public ::testing::TestWithParam<int> {};

TEST_P(Refined, BlockSinksAsTheWholeModel) {
  const int n = GetParam();
  expect_compliance_of_whole_model({.size = {0.4, 0.3, 0.2}, .cells = {4 * n, 3 * n, 2 * n}, .modes = 20});
}

TEST_P(Refined, BarOnItsEndSinksAsTheWholeModel) {
  const int n = GetParam();
  expect_compliance_of_whole_model({.size = {0.1, 0.1, 0.5}, .cells = {2 * n, 2 * n, 10 * n}, .modes = 20});
}

TEST_P(Refined, BlockUnderAFlatPunchSinksAsTheWholeModel) {
  const int n = GetParam();
  expect_compliance_of_whole_model({.size = {0.4, 0.4, 0.2}, .cells = {4 * n, 4 * n, 2 * n}, .modes = 20}, 0.5);
}

/// How far the highest box of a stack has come down at rest.
double stack_sunk(const BoxStack& stack, double friction, int steps) {
  constexpr double kGap = 1e-5;
  const Solid solid{.size = stack.size, .cells = stack.cells, .modes = 12};
  const auto model = solid.baked();
  ContactFinder finder;
  World world;
  world.set_contact_source(&finder, {.solver = ContactSolver::kExact, .friction = friction});
  world.add_static(std::make_shared<Shape>(HalfSpace{}));
  const Vec3 centre = model->data().origin_in_input - Vec3(0.5 * solid.size.x(), 0.5 * solid.size.y(), 0.0);
  BodyId top{};
  double height = 0.0;
  for (int i = 0; i < stack.boxes; ++i) {
    const Quaternion q = quaternion_from_rotation_vector({0.0, 0.0, stack.angle(i)});
    const Vec3 place = stack.foot(i) + q * centre;
    height = place.z();
    top = world.add_body(model, {.pose = {q, place + i * kGap * Vec3::UnitZ()}});
  }
  for (int i = 0; i < steps; ++i) world.step();
  return height - world.body(top).pose.p.z();
}

TEST(RegionCompliance, AStackWhoseFacesStickSinksAsAllOfItsNodesDo) {
  constexpr double kOffStack = 0.02;
  const BoxStack stack{.material = kSoftRubber};
  const double whole = WholeStack(stack).sunk(true).back();
  EXPECT_NEAR(stack_sunk(stack, 5.0, 150), whole, kOffStack * whole);
}

/// Boxes widen as they are pressed: where friction lets some of that happen, they come down farther.
TEST(RegionCompliance, TenBoxesWithFrictionSinkByMoreThanWhereTheyStickAndLessThanWhereTheySlide) {
  const BoxStack stack{.boxes = 10, .material = kSoftRubber};
  const WholeStack whole(stack);
  const double sunk = stack_sunk(stack, 0.5, 240);
  EXPECT_GT(sunk, whole.sunk(true).back());
  EXPECT_LT(sunk, whole.sunk(false).back());
}

INSTANTIATE_TEST_SUITE_P(RegionCompliance, Refined, ::testing::Values(1, 2, 3));

}  // namespace
}  // namespace limber
