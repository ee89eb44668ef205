// Bake → asset → world with every mode kept, against M ü + D u̇ + K u = f of all nodes, solved by the matrix
// exponential: another assembly, no modes, no oscillators.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <unsupported/Eigen/MatrixFunctions>

#include "dense_fem.h"
#include "limber/engine/world.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber {
namespace {

// The asset stores shapes in single precision; a displacement is a sum of 36 to 48 of them, of which some cancel.
constexpr double kFloat = 64 * 6e-8;
const Material kJelly{.youngs_modulus = 2e4, .poisson_ratio = 0.4, .density = 1000.0};
const Vec3 kSize{0.3, 0.1, 0.1};

TetMesh bar() { return testing::tet_box(3, 1, 1, kSize); }

/// The whole model on its free nodes, damped by a₁K + a₂M.
class WholeModel {
 public:
  WholeModel(const TetMesh& mesh, std::span<const Index> fixed, const RayleighDamping& damping) {
    std::vector<char> held(mesh.nodes.size(), 0);
    for (const Index n : fixed) held[n] = 1;
    for (std::size_t n = 0; n < mesh.nodes.size(); ++n)
      for (Eigen::Index axis = 0; axis < 3 && !held[n]; ++axis)
        free_.push_back(3 * static_cast<Eigen::Index>(n) + axis);
    const auto dense = testing::dense_model(mesh, std::array{kJelly}, true);
    K = dense.K(free_, free_);
    M = dense.M(free_, free_);
    const Eigen::MatrixXd D = damping.stiffness_proportional * K + damping.mass_proportional * M;
    const Eigen::Index n = K.rows();
    flow_ = Eigen::MatrixXd::Zero(2 * n, 2 * n);
    flow_.topRightCorner(n, n).setIdentity();
    flow_.bottomLeftCorner(n, n) = -M.ldlt().solve(K);
    flow_.bottomRightCorner(n, n) = -M.ldlt().solve(D);
  }

  Eigen::VectorXd load(Index node, const Vec3& f) const {
    Eigen::VectorXd all = Eigen::VectorXd::Zero(K.rows());
    for (std::size_t i = 0; i < free_.size(); ++i)
      if (free_[i] / 3 == node) all[static_cast<Eigen::Index>(i)] = f[free_[i] % 3];
    return all;
  }

  /// M times a uniform acceleration.
  Eigen::VectorXd inertia(const Vec3& acceleration) const {
    Eigen::VectorXd a(K.rows());
    for (std::size_t i = 0; i < free_.size(); ++i) a[static_cast<Eigen::Index>(i)] = acceleration[free_[i] % 3];
    return M * a;
  }

  /// Displacements at time t after rest, with an impulse at 0 and a force held from 0 on.
  Eigen::VectorXd after(double t, const Eigen::VectorXd& impulse, const Eigen::VectorXd& force) const {
    const Eigen::Index n = K.rows();
    // A body that floats has no static answer, so forces are for held ones.
    const Eigen::VectorXd at_rest = force.isZero() ? Eigen::VectorXd::Zero(n).eval() : K.ldlt().solve(force).eval();
    Eigen::VectorXd state(2 * n);
    state << -at_rest, M.ldlt().solve(impulse);
    const Eigen::VectorXd moved = (flow_ * t).exp() * state;
    return moved.head(n) + at_rest;
  }

  /// Of the free nodes, written to all nodes.
  Eigen::VectorXd at_all_nodes(const Eigen::VectorXd& u, std::size_t nodes) const {
    Eigen::VectorXd all = Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(nodes));
    for (std::size_t i = 0; i < free_.size(); ++i) all[free_[i]] = u[static_cast<Eigen::Index>(i)];
    return all;
  }

  Eigen::MatrixXd K, M;

 private:
  std::vector<Eigen::Index> free_;
  Eigen::MatrixXd flow_;
};

/// A world with one baked bar, all modes kept, and the same bar as a whole model. All its nodes lie on the surface, so
/// vertex i of the asset is node i.
struct Pair {
  TetMesh mesh = bar();
  WholeModel whole;
  World world;
  BodyId body;
  Vec3 origin = Vec3::Zero();

  Pair(const std::vector<Index>& fixed, const RayleighDamping& damping, const Vec3& gravity, double step)
      : whole(mesh, fixed, damping), world({.step = step, .gravity = gravity}) {
    BakeOptions options;
    options.materials = {{"*", kJelly}};
    if (!fixed.empty()) options.fixed = {NodesByIndex{fixed}};
    options.damping = damping;
    options.analysis.modes = options.limits.max_modes = 1000;
    Warnings warnings;
    const BakeResult baked = bake({.name = "bar", .mesh = mesh}, options, warnings);
    const auto model = asset_from_bytes(asset_bytes(baked.asset), "bar").bodies[0];
    origin = model->data().origin_in_input;
    body = world.add_body(model, {.pose = {.p = origin}});
  }

  /// The surface point that is a node.
  SurfacePoint at(Index node) const {
    const auto& triangles = world.model(body).render().triangles;
    for (std::size_t t = 0; t < triangles.size(); ++t)
      for (int corner = 0; corner < 3; ++corner)
        if (triangles[t][corner] == node) {
          SurfacePoint point{.triangle = static_cast<Index>(t), .weight = {0.0, 0.0, 0.0}};
          point.weight[corner] = 1.0;
          return point;
        }
    return {};
  }

  /// Largest difference of any node's displacement seen from the frame, relative to the largest displacement.
  double difference(const Eigen::VectorXd& expected_free) const {
    const Eigen::VectorXd expected = whole.at_all_nodes(expected_free, mesh.nodes.size());
    const RigidTransform X_BW = world.body(body).pose.inverse();
    double worst = 0.0;
    for (Index node = 0; node < static_cast<Index>(mesh.nodes.size()); ++node) {
      const Vec3 rest = world.model(body).render().rest[node].cast<double>();
      const Vec3 displacement = X_BW * world.position(body, at(node)) - rest;
      worst = std::max(worst, (displacement - expected.segment<3>(3 * node)).norm());
    }
    return worst / expected.cwiseAbs().maxCoeff();
  }
};

std::vector<Index> wall() {
  return testing::nodes_where(bar(), [](const Vec3& x) { return x.x() == 0.0; });
}
constexpr Index kTip = 3;  // the corner at (0.3, 0, 0)

TEST(WholeModel, ClampedBarStruckAtItsTipMovesAsTheWholeModelDoes) {
  Pair p(wall(), {}, Vec3::Zero(), 0.01);
  const Vec3 impulse{0.001, 0.02, -0.03};
  p.world.apply_impulse(p.body, p.at(kTip), impulse);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(p.whole.K.rows());
  for (int step = 1; step <= 40; ++step) {
    p.world.step();
    EXPECT_LT(p.difference(p.whole.after(0.01 * step, p.whole.load(kTip, impulse), none)), kFloat) << step;
  }
}

TEST(WholeModel, HeldForceAndDampingActAsInTheWholeModelWhateverTheStep) {
  const RayleighDamping damping{.stiffness_proportional = 0.004, .mass_proportional = 0.6};
  const Vec3 force{0.0, 0.0, -0.4};
  for (const double step : {0.003, 0.05, 0.3}) {  // s; the fastest mode turns more than ten times in the longest
    Pair p(wall(), damping, Vec3::Zero(), step);
    for (int i = 1; i <= 4; ++i) {
      p.world.apply_force(p.body, p.at(kTip), force);
      p.world.step();
      const Eigen::VectorXd none = Eigen::VectorXd::Zero(p.whole.K.rows());
      EXPECT_LT(p.difference(p.whole.after(step * i, none, p.whole.load(kTip, force))), kFloat) << step;
    }
  }
}

TEST(WholeModel, GravitySagsAClampedBarByKInverseMG) {
  const Vec3 g{0.0, 0.0, -9.81};
  Pair p(wall(), RayleighDamping::from_ratio(0.3, 1.0, 10.0), g, 0.05);
  for (int i = 0; i < 1200; ++i) p.world.step();
  EXPECT_LT(p.difference(p.whole.K.ldlt().solve(p.whole.inertia(g))), kFloat);
}

TEST(WholeModel, AnAcceleratedWallShakesTheBarByItsInertia) {
  const double step = 0.01;
  const Vec3 a{0.5, -1.0, 2.0};
  Pair p(wall(), {}, Vec3::Zero(), step);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(p.whole.K.rows());
  for (int i = 1; i <= 20; ++i) {
    const double t = step * i;
    p.world.set_kinematic_frame(p.body,
                                {.pose = {.p = p.origin + 0.5 * a * t * t}, .velocity = a * t, .acceleration = a});
    p.world.step();
    EXPECT_LT(p.difference(p.whole.after(t, none, -p.whole.inertia(a))), kFloat) << i;
  }
}

TEST(WholeModel, FreeBarPulledApartRingsAsTheWholeModelDoes) {
  // Two opposite impulses along the line between their points carry neither momentum nor spin: the frame rests.
  Pair p({}, {}, Vec3::Zero(), 0.02);
  const Vec3 along = (p.mesh.nodes[kTip] - p.mesh.nodes[0]).normalized();
  const Vec3 impulse = 0.02 * along;
  p.world.apply_impulse(p.body, p.at(kTip), impulse);
  p.world.apply_impulse(p.body, p.at(0), -impulse);
  const Eigen::VectorXd j = p.whole.load(kTip, impulse) + p.whole.load(0, -impulse);
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(p.whole.K.rows());
  for (int step = 1; step <= 25; ++step) {
    p.world.step();
    EXPECT_LT(p.difference(p.whole.after(0.02 * step, j, none)), kFloat) << step;
  }
}

}  // namespace
}  // namespace limber
