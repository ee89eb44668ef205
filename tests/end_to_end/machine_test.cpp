// A machine of steel and rubber links, held at one end and loaded at the other, against K u = f of all nodes of both.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "dense_fem.h"
#include "limber/core/cross_matrix.h"
#include "limber/machine/machine.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber {
namespace {

const Material kLinkSteel{.youngs_modulus = 2e11, .poisson_ratio = 0.3, .density = 7850.0};
const Material kLinkRubber{.youngs_modulus = 5e6, .poisson_ratio = 0.45, .density = 1100.0};

constexpr double kLength = 0.2, kWidth = 0.02, kRadius = 0.016;

/// A bar along x that begins at x.
TetMesh link_at(double x) {
  TetMesh mesh = testing::tet_box(10, 2, 2, {kLength, kWidth, kWidth});
  for (Vec3& p : mesh.nodes) p += Vec3(x, -0.5 * kWidth, -0.5 * kWidth);
  return mesh;
}

/// Nodes of the surface within reach of a joint.
std::vector<Index> patch_of(const TetMesh& mesh, const Vec3& origin) {
  std::vector<Index> patch;
  double low = 1e9, high = -1e9;
  for (const Vec3& p : mesh.nodes) low = std::min(low, p.x()), high = std::max(high, p.x());
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) {
    const Vec3& p = mesh.nodes[n];
    const bool outside =
        std::max(std::abs(p.y()), std::abs(p.z())) > 0.5 * kWidth - 1e-9 || std::min(p.x() - low, high - p.x()) < 1e-9;
    if (outside && (p - origin).norm() <= kRadius) patch.push_back(static_cast<Index>(n));
  }
  return patch;
}

/// What the frame of a joint at `origin` moves and turns by: 6 rows over the nodes' displacements. Means over the area
/// of the facets between the patch's nodes, of x = Σ φ_i x_i and u = Σ φ_j u_j, by ∫ φ_i φ_j = (1 + δ_ij) A/12.
Eigen::MatrixXd frame_rows(const TetMesh& mesh, const Vec3& origin) {
  const std::vector<Index> patch = patch_of(mesh, origin);
  const auto outside = [&](Index n) { return std::ranges::find(patch, n) == patch.end(); };
  const auto n = static_cast<Eigen::Index>(mesh.nodes.size());
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(n, n);
  const BoundarySurface boundary = boundary_surface(mesh);
  for (Triangle t : boundary.surface.triangles) {
    for (Index& corner : t) corner = boundary.node_of[static_cast<std::size_t>(corner)];
    if (outside(t[0]) || outside(t[1]) || outside(t[2])) continue;
    const auto at = [&](int c) { return mesh.nodes[static_cast<std::size_t>(t[static_cast<std::size_t>(c)])]; };
    const double area = 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
    for (const Index i : t)
      for (const Index j : t) products(i, j) += (i == j ? 2.0 : 1.0) * area / 12.0;
  }
  products /= products.sum();
  const Eigen::VectorXd weight = products.rowwise().sum();
  Vec3 mean = Vec3::Zero();
  for (const Index i : patch) mean += weight[i] * mesh.nodes[static_cast<std::size_t>(i)];
  const auto arm = [&](Index i) { return cross_matrix(mesh.nodes[static_cast<std::size_t>(i)] - mean); };
  Mat3 inertia = Mat3::Zero();
  for (const Index i : patch)
    for (const Index j : patch) inertia -= products(i, j) * arm(i) * arm(j);
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(6, 3 * n);
  for (const Index j : patch) {
    Mat3 moment = Mat3::Zero();
    for (const Index i : patch) moment += products(i, j) * arm(i);
    const Mat3 turn = inertia.inverse() * moment;
    rows.block<3, 3>(3, 3 * j) = turn;
    rows.block<3, 3>(0, 3 * j) = weight[j] * Mat3::Identity() - cross_matrix(origin - mean) * turn;
  }
  return rows;
}

/// Nodes of the far end, which the load is spread over.
std::vector<Index> tip_of(const TetMesh& mesh, double x) {
  std::vector<Index> tip;
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n)
    if (mesh.nodes[n].x() > x - 1e-9) tip.push_back(static_cast<Index>(n));
  return tip;
}

struct Links {
  TetMesh steel = link_at(0.0), rubber = link_at(kLength);
  Vec3 wall{0, 0, 0}, hinge{kLength, 0, 0};

  /// How far the tip goes under a force: all nodes of both, tied to the wall and to each other as the joints tie them.
  double whole_model(const Vec3& force) const {
    const auto n_steel = static_cast<Eigen::Index>(3 * steel.nodes.size());
    const auto n = n_steel + static_cast<Eigen::Index>(3 * rubber.nodes.size());
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n + 12, n + 12);
    add_stiffness(steel, kLinkSteel, 0, A);
    add_stiffness(rubber, kLinkRubber, n_steel, A);
    Eigen::MatrixXd ties = Eigen::MatrixXd::Zero(12, n);
    ties.topLeftCorner(6, n_steel) = frame_rows(steel, wall);
    ties.bottomLeftCorner(6, n_steel) = frame_rows(steel, hinge);
    ties.bottomRightCorner(6, n - n_steel) = -frame_rows(rubber, hinge);
    const double scale = 1e6;  // so that all rows are of one size
    A.bottomLeftCorner(12, n) = scale * ties;
    A.topRightCorner(n, 12) = scale * ties.transpose();
    Eigen::VectorXd load = Eigen::VectorXd::Zero(n + 12);
    const std::vector<Index> tip = tip_of(rubber, 2.0 * kLength);
    for (const Index v : tip) load.segment<3>(n_steel + 3 * v) = force / static_cast<double>(tip.size());
    const Eigen::VectorXd u = Eigen::FullPivLU<Eigen::MatrixXd>(A).solve(load);
    double moved = 0.0;
    for (const Index v : tip) moved += u.segment<3>(n_steel + 3 * v).dot(force.normalized());
    return moved / static_cast<double>(tip.size());
  }

  static void add_stiffness(const TetMesh& mesh, const Material& material, Eigen::Index first, Eigen::MatrixXd& A) {
    const auto material_of = [&](std::size_t) -> const Material& { return material; };
    testing::for_each_element(mesh, false, material_of, [&](const Tet& t, const auto& K, const auto&) {
      for (int i = 0; i < 12; ++i)
        for (int j = 0; j < 12; ++j) A(first + 3 * t[i / 3] + i % 3, first + 3 * t[j / 3] + j % 3) += K(i, j);
    });
  }
};

std::shared_ptr<const ModalModel> baked_link(const TetMesh& mesh, const char* name, const Material& material,
                                             std::vector<AttachmentPatch> patches) {
  BakeOptions o;
  o.materials = {{"*", material}};
  o.analysis.modes = o.limits.max_modes = 6;
  o.damping = RayleighDamping::from_ratio(1.0, 5.0, 50.0);
  o.residual.patches = std::move(patches);
  Warnings warnings;
  return bake({.name = name, .mesh = mesh}, o, warnings).asset.bodies[0];
}

double tip_in_world(const Links& links, bool joint_modes, const Vec3& force) {
  const auto patches = [&](std::vector<AttachmentPatch> all) {
    return joint_modes ? all : std::vector<AttachmentPatch>{};
  };
  const AttachmentPatch at_wall{links.wall, kRadius}, at_hinge{links.hinge, kRadius};
  Asset asset{.bodies = {baked_link(links.steel, "steel", kLinkSteel, patches({at_wall, at_hinge})),
                         baked_link(links.rubber, "rubber", kLinkRubber, patches({at_hinge}))}};
  asset.joints = {
      {.b = 0, .spec = {.type = JointType::kFixed, .frame = {.origin = links.wall}}, .patch_radius = kRadius},
      {.a = 0, .b = 1, .spec = {.type = JointType::kFixed, .frame = {.origin = links.hinge}}, .patch_radius = kRadius}};
  World world({.step = 0.02, .gravity = Vec3::Zero()});
  const Machine machine = add_machine(world, asset);
  const ModalModel& model = *asset.bodies[1];
  std::vector<SurfacePoint> tip;
  const double end = 2.0 * kLength - model.data().origin_in_input.x();
  std::vector<bool> seen(model.collision().rest.size(), false);
  for (std::size_t t = 0; t < model.collision().triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto v = static_cast<std::size_t>(model.collision().triangles[t][k]);
      if (seen[v] || model.collision().rest[v].x() < end - 1e-6) continue;
      seen[v] = true;
      SurfacePoint at{
          .surface = SurfacePoint::Surface::kCollision, .triangle = static_cast<Index>(t), .weight = {0, 0, 0}};
      at.weight[k] = 1.0;
      tip.push_back(at);
    }
  const auto mean = [&] {
    double sum = 0.0;
    for (const SurfacePoint& at : tip) sum += world.position(machine.bodies[1], at).dot(force.normalized());
    return sum / static_cast<double>(tip.size());
  };
  const double before = mean();
  for (int step = 0; step < 600; ++step) {
    for (const SurfacePoint& at : tip)
      world.apply_force(machine.bodies[1], at, force / static_cast<double>(tip.size()));
    world.step();
  }
  return mean() - before;
}

/// Small loads: the tip goes some hundredths of a link's width. (Along the links six modes, which all bend, give 0.89.)
TEST(MachineOfLinks, BendsAsTheWholeModelDoes) {
  const Links links;
  const Vec3 across(0, 0, -1e-4);
  const double whole = links.whole_model(across);
  EXPECT_GT(whole, 1e-6);
  EXPECT_NEAR(tip_in_world(links, true, across) / whole, 1.0, 0.02);
  EXPECT_LT(tip_in_world(links, false, across) / whole, 0.98)
      << "without the modes of its joints it is too stiff, or this shows nothing";
}

/// Three links on a hinge that a motor turns stand out as a rod does, whose end is longer by tan(k)/k − 1, k² = ρ ω²
/// L²/E. By the joints' forces alone: within a part the modes do not feel the turning.
TEST(MachineOfLinks, StandsOutWhereItTurns) {
  constexpr int kLinks = 3;
  constexpr double kSpeed = 6.0, kReach = kLinks * kLength;
  const double ends = 0.75 * kWidth;
  const auto model = baked_link(link_at(0.0), "rubber", kLinkRubber, {{{0, 0, 0}, ends}, {{kLength, 0, 0}, ends}});
  const Vec3 middle = model->data().origin_in_input;
  World world({.step = 0.005, .gravity = Vec3::Zero()});
  world.set_contact_source(nullptr, {.solver = ContactSolver::kExact});
  JointSpec spec{.type = JointType::kRevolute};
  spec.frame.axes << Vec3::UnitZ(), Vec3::UnitX(), Vec3::UnitY();
  BodyId last{};
  JointId hinge{};
  for (int i = 0; i < kLinks; ++i) {
    const Vec3 start(i * kLength, 0.0, 0.0), origin = start + middle, turning(0.0, 0.0, kSpeed);
    const BodyId next =
        world.add_body(model, {.pose = {{}, origin}, .velocity = turning.cross(origin), .angular_velocity = turning});
    spec.frame.origin = start;
    const JointId joint = world.add_joint(last, next, spec, {.radius = ends}, {.radius = ends});
    if (i == 0) hinge = joint;
    last = next, spec = {};
  }
  world.set_joint_actuation(hinge, 0, {.motor_velocity = kSpeed, .motor_max_force = 1e6});
  for (int step = 0; step < 120; ++step) {
    world.step();
    EXPECT_TRUE(world.constraint_report().solved) << step;
  }
  const SurfacePoint tip = *world.nearest_point(world.body(last).pose * Vec3(kLength, 0.0, 0.0), 1.0)->at;
  const double k = kSpeed * kReach * std::sqrt(kLinkRubber.density / kLinkRubber.youngs_modulus),
               law = std::tan(k) / k - 1.0;
  EXPECT_NEAR((world.position(last, tip).norm() / kReach - 1.0) / law, 1.0, 0.1);
}

}  // namespace
}  // namespace limber
