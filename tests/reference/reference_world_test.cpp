// Two integrators, one motion; orders in Δt; closed forms of bars, beams and plates.
#include "reference_world.h"

#include <gtest/gtest.h>

#include <cmath>

#include "closed_forms.h"
#include "constants.h"
#include "dense_fem.h"
#include "dense_modes.h"
#include "tet_box.h"

namespace limber {
namespace {

using namespace limber::testing;

const Material kGum{.youngs_modulus = 1e6, .poisson_ratio = 0.3, .density = 1000.0};
const Material kThin{.youngs_modulus = 1e7, .poisson_ratio = 0.0, .density = 1000.0};  // waves at 100 m/s

std::vector<Index> clamp(const TetMesh& mesh) {
  return nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; });
}

/// A clamped bar whose nodes start with a velocity across that grows along it.
struct Swinging {
  TetMesh mesh = tet_box(6, 2, 2, {0.3, 0.1, 0.1});
  std::shared_ptr<const NodalElasticity> body;
  NodeVectors v;
  Swinging(ElasticLaw law, double speed)
      : body(std::make_shared<NodalElasticity>(mesh, kGum, law, clamp(mesh))), v(NodeVectors::Zero(body->nodes(), 3)) {
    for (Eigen::Index i = 0; i < v.rows(); ++i) v(i, 2) = speed * std::pow(body->rest()(i, 0) / 0.3, 2);
  }
  NodeVectors by_differences(double seconds, double step) const {
    ReferenceWorld world({.bodies = {{body, body->rest(), v}}});
    world.advance(seconds, step);
    return world.places(0);
  }
  NodeVectors by_midpoint(double seconds, int steps) const {
    MidpointBody moving(body, body->rest(), v);
    for (int i = 0; i < steps; ++i) moving.step(seconds / steps, NodeVectors::Zero(v.rows(), 3));
    return moving.places();
  }
};

class MovingByLaw : public ::testing::TestWithParam<ElasticLaw> {};
INSTANTIATE_TEST_SUITE_P(Laws, MovingByLaw,
                         ::testing::Values(ElasticLaw::kLinear, ElasticLaw::kStVenantKirchhoff,
                                           ElasticLaw::kNeoHookean));

TEST_P(MovingByLaw, TwoIntegratorsOfSecondOrderAgree) {
  const Swinging bar(GetParam(), 2.0);
  constexpr double kSeconds = 0.04;
  const double stable = stable_step(*bar.body);
  const NodeVectors fine = bar.by_differences(kSeconds, stable / 16.0);
  const double moved = (fine - bar.body->rest()).norm();
  ASSERT_GT((fine - bar.body->rest()).cwiseAbs().maxCoeff(), 0.03);
  const auto error = [&](const NodeVectors& x) { return (x - fine).norm() / moved; };
  const double coarse = error(bar.by_differences(kSeconds, stable / 2.0));
  EXPECT_NEAR(coarse / error(bar.by_differences(kSeconds, stable / 4.0)), 4.0, 1.0);
  EXPECT_LT(coarse, 2e-3);
  const double of_40 = error(bar.by_midpoint(kSeconds, 40)), of_160 = error(bar.by_midpoint(kSeconds, 160));
  EXPECT_LT(of_160, 0.2 * of_40);
  EXPECT_LT(of_160, 0.02);
}

TEST(ReferenceWorld, LinearBodiesMoveAsTheSumOfAllTheirModes) {
  const Swinging bar(ElasticLaw::kLinear, 0.1);
  const DenseModel dense = dense_model(bar.mesh, std::span(&kGum, 1), false);
  std::vector<Eigen::Index> free;
  for (Eigen::Index v = 0; v < bar.body->nodes(); ++v)
    for (Eigen::Index i = 0; i < 3 && bar.body->is_fixed()[static_cast<std::size_t>(v)] == 0; ++i)
      free.push_back(3 * v + i);
  const DenseModes modes = dense_modes(dense.K(free, free), dense.M(free, free));
  const Eigen::VectorXd rates = modes.W.transpose() * (dense.M(free, free) * Eigen::VectorXd(numbers_of(bar.v)(free)));
  constexpr double kSeconds = 0.5;
  const Eigen::ArrayXd omega = modes.lambda.array().sqrt();
  const Eigen::VectorXd u = modes.W * (rates.array() * (omega * kSeconds).sin() / omega).matrix();
  const NodeVectors moved = bar.by_differences(kSeconds, stable_step(*bar.body) / 32.0) - bar.body->rest();
  EXPECT_LE((numbers_of(moved)(free) - u).norm(), 2e-4 * u.norm());
  EXPECT_NEAR(stable_step(*bar.body), 2.0 / omega.maxCoeff(), 0.01 * 2.0 / omega.maxCoeff());
}

TEST_P(MovingByLaw, FreeMotionKeepsEnergyAndMomentum) {
  const TetMesh mesh = tet_box(6, 2, 2, {0.3, 0.1, 0.1});
  const auto body = std::make_shared<NodalElasticity>(mesh, kGum, GetParam());
  NodeVectors v = NodeVectors::Zero(body->nodes(), 3);
  const Vec3 spin(2.0, 10.0, -5.0);
  for (Eigen::Index i = 0; i < v.rows(); ++i) {
    v.row(i) = spin.cross(Vec3(body->rest().row(i))).transpose();
    v(i, 2) += 0.5 * std::cos(10.0 * body->rest()(i, 0));
  }
  ReferenceWorld world({.bodies = {{body, body->rest(), v}}});
  const double step = stable_step(*body) / 8.0;
  world.advance(step, step);
  const double energy = world.energy();
  const Vec3 momentum = world.momentum();
  world.advance(0.3, step);
  EXPECT_NEAR(world.energy(), energy, 2e-3 * energy);  // O((ωΔt)²), and no drift:
  world.advance(0.6, step);
  EXPECT_NEAR(world.energy(), energy, 2e-3 * energy);
  EXPECT_LE((world.momentum() - momentum).norm(), 1e-11 * momentum.norm());
}

TEST(ReferenceWorld, SpinningBarStretches) {
  const TetMesh mesh = tet_box(16, 1, 1, {1.0, 0.05, 0.05});
  for (const ElasticLaw law : {ElasticLaw::kLinear, ElasticLaw::kStVenantKirchhoff}) {
    const auto body = std::make_shared<NodalElasticity>(mesh, kThin, law);
    constexpr double kSpin = 6.0;
    NodeVectors v(body->nodes(), 3);
    for (Eigen::Index i = 0; i < v.rows(); ++i)
      v.row(i) = (kSpin * Vec3::UnitZ().cross(Vec3(body->rest().row(i)) - Vec3(0.5, 0.025, 0.025))).transpose();
    ReferenceWorld world({.bodies = {{body, body->rest(), v}}});
    const double step = stable_step(*body) / 4.0, period = 1.0 / ringing_bar_hz(1, 1.0, 1e7, 1000.0);
    double sum = 0.0;
    constexpr int kSamples = 200;  // over ten periods of the first stretching mode: about its mean
    for (int i = 0; i < kSamples; ++i) {
      world.advance(10.0 * period / kSamples, step);
      sum += (world.places(0).row(16) - world.places(0).row(0)).norm() - 1.0;
    }
    const double exact = 2.0 * spinning_bar_stretch(1.0, 1e7, 1000.0, kSpin);
    EXPECT_NEAR(sum / kSamples, exact, 0.03 * exact);
  }
}

TEST(ReferenceWorld, BarOnAWallStaysForTwoTransitsAndLeavesAsFastAsItCame) {
  const TetMesh mesh = tet_box(2, 2, 60, {0.05, 0.05, 1.0});
  const auto body = std::make_shared<NodalElasticity>(mesh, kThin, ElasticLaw::kLinear);
  NodeVectors v = NodeVectors::Zero(body->nodes(), 3);
  v.col(2).setConstant(-0.1);
  ReferenceWorld world({.bodies = {{body, body->rest(), v, Wall{}}}});
  const double stay = bar_contact_time(1.0, 1e7, 1000.0);
  world.advance(1.5 * stay, stable_step(*body) / 2.0);
  const double mass = body->node_masses().sum();
  double impulse = 0.0;
  for (const auto& step : world.wall_impulses()) impulse += step.impulse;
  EXPECT_NEAR(impulse, 2.0 * 0.1 * mass, 0.02 * 0.2 * mass);
  EXPECT_NEAR(world.wall_impulses().back().time - world.wall_impulses().front().time, stay, 0.05 * stay);
  EXPECT_NEAR(world.momentum().z(), 0.1 * mass, 0.02 * 0.1 * mass);
}

TEST(ReferenceWorld, BodiesHangTogetherAndFollowWhatLeadsThem) {
  const TetMesh mesh = tet_box(2, 1, 1, {0.2, 0.1, 0.1});
  const auto held = std::make_shared<NodalElasticity>(mesh, kGum, ElasticLaw::kLinear, clamp(mesh));
  const auto free = std::make_shared<NodalElasticity>(mesh, kGum, ElasticLaw::kLinear);
  const auto at_rest = NodeVectors::Zero(held->nodes(), 3);
  const Index end = 2, begin = 0, corner = 11;
  NodeVectors beyond = free->rest();
  beyond.col(0).array() += 0.2;
  const auto way = [](double t) { return Vec3(0.0, 0.02 * t, 0.05 * t * t); };
  ReferenceWorld world({.bodies = {{held, held->rest(), at_rest}, {free, beyond, at_rest}},
                        .gravity = kDown,
                        .led = {{1, corner, 0.0, 1.0, way}},
                        .ties = {{0, end, 1, begin}}});
  const Vec3 from = beyond.row(corner).transpose();
  world.advance(0.3, stable_step(*held) / 2.0);
  EXPECT_LE((world.places(0).row(end) - world.places(1).row(begin)).norm(), 1e-11);
  EXPECT_LE((world.places(1).row(corner).transpose() - from - way(0.3)).norm(), 1e-11);
}

/// A thin plate of cells of 0.05 m, one through its thickness.
constexpr double kThickness = 0.02, kCell = 0.05;
TetMesh plate(int along, int across) { return tet_box(along, across, 1, {kCell * along, kCell * across, kThickness}); }

/// Its stiffness in bending, by which one layer of linear tets is far too stiff: of a clamped strip, w = P L³/(3 D b).
double plate_stiffness() {
  const int along = 16, across = 4;
  const TetMesh mesh = plate(along, across);
  const NodalElasticity body(mesh, kThin, ElasticLaw::kLinear, clamp(mesh));
  const double length = kCell * along, width = kCell * across;
  const auto tip = nodes_where(mesh, [&](const Vec3& x) { return x.x() > length - 1e-9; });
  NodeVectors load = NodeVectors::Zero(body.nodes(), 3);
  for (const Index n : tip) load(n, 2) = 1.0 / static_cast<double>(tip.size());
  const NodeVectors u = equilibrium(body, body.rest(), load) - body.rest();
  return std::pow(length, 3) / (3.0 * width * load.cwiseProduct(u).sum());
}

TEST(ReferenceWorld, StruckPlateGoesAndStays) {
  const TetMesh mesh = plate(32, 32);
  const auto body = std::make_shared<NodalElasticity>(mesh, kThin, ElasticLaw::kLinear);
  const Vec3 middle(0.8, 0.8, 0.0);
  const auto struck =
      nodes_where(mesh, [&](const Vec3& x) { return (x - middle).head<2>().cwiseAbs().maxCoeff() < 0.06; });
  double mass = 0.0;
  for (const Index n : struck) mass += body->node_masses()[n];
  constexpr double kBlow = 0.5;
  NodeVectors v = NodeVectors::Zero(body->nodes(), 3);
  for (const Index n : struck) v(n, 2) = kBlow / mass;
  ReferenceWorld world({.bodies = {{body, body->rest(), v}}});
  const double factor = plate_stiffness() / (kThin.youngs_modulus * std::pow(kThickness, 3) / 12.0);
  // What was struck, with half a cell around it: a square of three cells.
  const double s = 3.0 * kCell / std::sqrt(12.0);
  for (int i = 1; i <= 6; ++i) {  // until waves come back from the edges
    world.advance(0.002, 0.8 * stable_step(*body));
    double mean = 0.0;
    for (const Index n : struck) mean += world.places(0)(n, 2) - body->rest()(n, 2);
    const double exact = struck_plate_displacement(kBlow, kThickness, factor * kThin.youngs_modulus, 0.0, kThin.density,
                                                   s, world.time());
    EXPECT_NEAR(mean / static_cast<double>(struck.size()), exact, 0.05 * exact);
  }
}

}  // namespace
}  // namespace limber
