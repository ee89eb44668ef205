// What theory says of limber's errors, beside finite elements of all nodes.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "closed_forms.h"
#include "constants.h"
#include "dense_modes.h"
#include "error_scenes.h"
#include "limber/core/error.h"
#include "limber/engine/world.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber {
namespace {

using namespace limber::testing;

const Material kBlockRubber{.youngs_modulus = 1e6, .poisson_ratio = 0.3, .density = 1000.0};
constexpr Eigen::Index kPokedNode = 60;  // on the block's top

struct FreeBlock {
  TetMesh mesh = tet_box(4, 4, 2, {0.2, 0.2, 0.1});
  NodalElasticity body{mesh, kBlockRubber, ElasticLaw::kLinear};

  std::shared_ptr<const ModalModel> baked(int modes, ResidualOptions residual) const {
    BakeOptions options;
    options.materials = {{"*", kBlockRubber}};
    options.analysis.modes = options.limits.max_modes = modes;
    options.analysis.mass = MassKind::kConsistent;
    options.residual = std::move(residual);
    Warnings warnings;
    return bake({.name = "block", .mesh = mesh}, options, warnings).asset.bodies[0];
  }
  /// What all nodes give way by under unit forces at a node, in the inertia of the body: Σ w wᵀ/λ over every elastic
  /// mode.
  Mat3 compliance(Eigen::Index node) const {
    Eigen::MatrixXd M = Eigen::MatrixXd::Zero(3 * body.nodes(), 3 * body.nodes());
    for (int axis = 0; axis < 3; ++axis)
      M(Eigen::seqN(axis, body.nodes(), 3), Eigen::seqN(axis, body.nodes(), 3)) = Eigen::MatrixXd(body.mass());
    const DenseModes all = dense_modes(body.stiffness(body.rest()), M);
    Mat3 sum = Mat3::Zero();
    for (Eigen::Index i = 6; i < M.rows(); ++i) {
      const Vec3 w = all.W.block<3, 1>(3 * node, i);
      sum += w * w.transpose() / all.lambda[i];
    }
    return sum;
  }
};

Index vertex_of(const ModalModel& model, const Vec3& at) {
  const auto& rest = model.collision().rest;
  const auto found = std::find_if(rest.begin(), rest.end(), [&](const Vec3f& x) {
    return (x.cast<double>() + model.data().origin_in_input - at).norm() < 1e-5;
  });
  return static_cast<Index>(found - rest.begin());
}

Mat3 shown_compliance(const ModalModel& model, Index vertex) {
  Mat3 sum = Mat3::Zero();
  for (Index i = 0; i < model.modes(); ++i) {
    const Vec3 u = model.collision().basis.shape(vertex, i).cast<double>();
    sum += u * u.transpose() / model.data().eigenvalues[static_cast<std::size_t>(i)];
  }
  return sum;
}

TEST(ErrorOrders, FortyModesAndTheirResidualAnswerAPokeAsAllNodesDo) {
  const FreeBlock block;
  const Mat3 exact = block.compliance(kPokedNode);
  const Vec3 at = block.mesh.nodes[static_cast<std::size_t>(kPokedNode)];
  const auto alone = block.baked(40, {});
  const auto with = block.baked(40, {.nodes = {NodesByIndex{{static_cast<Index>(kPokedNode)}}}});
  const double shown = shown_compliance(*alone, vertex_of(*alone, at)).trace() / exact.trace();
  EXPECT_GT(shown, 0.25);
  EXPECT_LT(shown, 0.75);
  EXPECT_LE((shown_compliance(*with, vertex_of(*with, at)) - exact).norm(), 1e-4 * exact.norm());
}

TEST(ErrorOrders, TheAssetTellsWhatItsModesCapture) {
  const FreeBlock block;
  const Vec3 at = block.mesh.nodes[static_cast<std::size_t>(kPokedNode)];
  const double exact = block.compliance(kPokedNode).trace();
  double before = 0.0;
  for (const int modes : {5, 20, 80}) {
    const auto model = block.baked(modes, {.surface = true});
    const Index vertex = vertex_of(*model, at);
    const double told = model->captured_shares()[static_cast<std::size_t>(vertex)];
    EXPECT_NEAR(told, shown_compliance(*model, vertex).trace() / exact, 1e-4);
    // The same is stored of a node that loads are foreseen at, beside the modes that make up for it.
    const auto made_up = block.baked(modes, {.nodes = {NodesByIndex{{static_cast<Index>(kPokedNode)}}}});
    ASSERT_EQ(made_up->data().captured.size(), 1u);
    EXPECT_NEAR(made_up->data().captured[0].share, told, 1e-6);
    EXPECT_LE((made_up->data().captured[0].at + made_up->data().origin_in_input - at).norm(), 1e-12);
    EXPECT_GT(told, before);
    before = told;
  }
  EXPECT_THROW(block.baked(5, {})->captured_shares(), InvalidArgument);
}

TEST(ErrorOrders, FreeMotionHasNoErrorOfTheStep) {
  const auto model = FreeBlock().baked(20, {});
  const double seconds = 1.0;
  std::vector<double> z(static_cast<std::size_t>(model->modes())), rates(z.size(), 0.0);
  for (std::size_t i = 0; i < z.size(); ++i) z[i] = 1e-3 / std::sqrt(model->data().eigenvalues[i]);
  for (const int steps : {1, 7, 60, 1000}) {
    World world({.step = seconds / steps});
    const BodyId id = world.add_body(model);
    world.set_amplitudes(id, z, rates);
    for (int n = 0; n < steps; ++n) world.step();
    for (std::size_t i = 0; i < z.size(); ++i) {
      const double omega = std::sqrt(model->data().eigenvalues[i]), size = omega * z[i];
      const double off = std::hypot(omega * (world.body(id).amplitudes[i] - z[i] * std::cos(omega * seconds)),
                                    world.body(id).rates[i] + size * std::sin(omega * seconds));
      EXPECT_LE(off, size * (1e-12 + 4.0 * kEpsilon * omega * seconds)) << steps << " steps, mode " << i;
    }
  }
}

TEST(ErrorOrders, TruncationFallsWithTheModes) {
  const ErrorScene& poke = error_scene("poke");
  const PlayedScene exact = play_reference(poke, ElasticLaw::kLinear, 1);
  SceneBakery bakery;
  double before = 1.0;
  for (const int modes : {1, 5, 20, 80}) {
    const double error = scene_error(poke, play(poke, {.modes = modes, .residual = false}, bakery), exact).motion.mean;
    EXPECT_LT(error, before);
    before = error;
  }
  EXPECT_LT(before, 0.005);
}

/// Of a free bar without Poisson's effect whose shape stretches it, f = c/(2L) exactly.
TEST(ErrorOrders, LinearTetsAreOffByTheSquareOfTheirSize) {
  const double length = 1.0, exact = ringing_bar_hz(1, length, 1e6, 1000.0);
  std::vector<double> size, off;
  for (const int cells : {4, 8, 16}) {
    const TetMesh mesh = tet_box(cells, 1, 1, {length, 0.05, 0.05});
    BakeOptions options;
    options.materials = {{"*", {.youngs_modulus = 1e6, .poisson_ratio = 0.0, .density = 1000.0}}};
    options.analysis.modes = options.limits.max_modes = 20;
    options.analysis.mass = MassKind::kConsistent;
    Warnings warnings;
    const auto bar = bake({.name = "bar", .mesh = mesh}, options, warnings).asset.bodies[0];
    double nearest = 1.0;  // of all modes
    for (Index m = 0; m < bar->modes(); ++m) nearest = std::min(nearest, std::abs(bar->frequency_hz(m) / exact - 1.0));
    size.push_back(length / cells), off.push_back(nearest);
  }
  EXPECT_NEAR(log_slope(size, off), 2.0, 0.1);
  EXPECT_LT(off.back(), 2e-3);
}

/// Two bars that meet end on, by the exact solver: impacts lose less the shorter the step, of order 0.8.
TEST(ErrorOrders, ContactErrorsFallWithTheStep) {
  const ErrorScene& collide = error_scene("collide");
  const PlayedScene exact = play_reference(collide, ElasticLaw::kLinear, 1);
  SceneBakery bakery;
  std::vector<double> steps, off;
  for (const double rate : {60.0, 240.0, 960.0}) {
    steps.push_back(1.0 / rate);
    off.push_back(scene_error(collide, play(collide, {.step = 1.0 / rate}, bakery), exact).motion.mean);
  }
  EXPECT_GT(log_slope(steps, off), 0.7);
}

/// What the frame leaves out of a bar that spins and is not struck: its stretch, by which the inertia grows by
/// 0.8 ρω²a²/E of itself, a = L/2, and the turning slows by as much.
TEST(ErrorOrders, ASpinningBarIsOffByTheStretchThatTheFrameLeavesOut) {
  ErrorScene spin = error_scene("spin");
  spin.forces.clear();
  ErrorBody& bar = spin.bodies[0];
  bar.size = {0.4, 0.04, 0.04}, bar.cells = {16, 2, 2}, bar.material.poisson_ratio = 0.0;
  spin.tip = bar.size;
  SceneBakery bakery;
  const PlayedScene exact = play_reference(spin, ElasticLaw::kLinear, 1);
  const MotionError error = scene_error(spin, play(spin, {.modes = 20}, bakery), exact).motion;
  const double omega = 12.0, half = 0.2, slower = 0.8 * 1000.0 * omega * omega * half * half / 1e6;
  const double radius = 0.5 * error.peak;  // opposite after half a turn
  EXPECT_NEAR(error.mean * error.peak, radius * slower * omega * spin.duration / std::sqrt(3.0),
              0.1 * error.mean * error.peak);
}

/// The same bar struck off its axis, with inertial coupling: Coriolis forces keep its shape, and its inertia grows.
TEST(ErrorOrders, InertialCouplingFollowsABarThatSpinsAndIsStruck) {
  const ErrorScene &whirl = error_scene("whirl"), &spin = error_scene("spin");
  const PlayedScene exact = play_reference(whirl, ElasticLaw::kLinear, 1);
  SceneBakery bakery;
  const PlayedScene seen = play(whirl, {}, bakery);
  const MotionError error = scene_error(whirl, seen, exact).motion;
  EXPECT_LT(error.mean, 0.02);
  EXPECT_LT(error.shape_mean, 0.1);
  EXPECT_LT(std::max(seen.energy_rise, seen.energy_loss), 1e-4);
  const MotionError alone = scene_error(spin, play(spin, {}, bakery), exact).motion;
  EXPECT_GT(alone.mean, 10.0 * error.mean);
  EXPECT_GT(alone.shape_mean, 5.0 * error.shape_mean);
}

}  // namespace
}  // namespace limber
