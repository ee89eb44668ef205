// World::energy against sums over the nodes of the mesh (energy_meter.h): where the two agree, and how far they differ.
#include "energy_meter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "constants.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

// Shapes are kept in single precision: of a sum of products of two of them, relative to the whole.
constexpr double kFloat = 16 * 6e-8;
const Material kMeteredRubber{.youngs_modulus = 1e6, .poisson_ratio = 0.4, .density = 1000.0};
constexpr int kModes = 20;

struct MeteredBar {
  TetMesh mesh = tet_box(4, 2, 2, {0.3, 0.1, 0.08});
  std::shared_ptr<const ModalModel> model;
  World world{{.step = kFrame}};
  BodyId body;

  explicit MeteredBar(const BodyPlacement& placement) {
    BakeOptions o;
    o.materials = {{"*", kMeteredRubber}};
    o.analysis.modes = o.limits.max_modes = kModes;
    o.analysis.mass = MassKind::kConsistent;
    o.volume_block = true;
    Warnings warnings;
    model = bake({.name = "bar", .mesh = mesh}, o, warnings).asset.bodies[0];
    body = world.add_body(model, placement);
  }
  EnergyMeter meter() const { return EnergyMeter(mesh, kMeteredRubber, model); }
  /// Displacements of all modes, of `size` times the bar's thickness, and rates of some metres a second.
  void deform(double size, double speed) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    std::vector<double> z, rates;
    const double root_mass = std::sqrt(model->data().mass);
    for (int i = 0; i < kModes; ++i) {
      z.push_back(0.08 * size * root_mass * unit(random));
      rates.push_back(speed * root_mass * unit(random));
    }
    world.set_amplitudes(body, z, rates);
  }
};

BodyPlacement moving(const Vec3& spin) {
  return {.pose = {quaternion_from_rotation_vector({0.4, -0.7, 0.2}), {0.3, -0.2, 0.7}},
          .velocity = {1.0, -2.0, 0.5},
          .angular_velocity = spin};
}
const Vec3 kSpin{3.0, -5.0, 4.0};

TEST(EnergyMeter, ModalElasticEnergyIsTheStrainEnergyOfTheMesh) {
  MeteredBar bar(moving(kSpin));
  for (const double size : {1e-3, 0.1, 1.0}) {
    bar.deform(size, 1.0);
    const double strain = bar.meter().read(bar.world.body(bar.body), kDown).strain;
    EXPECT_GT(strain, 0.0);
    EXPECT_NEAR(bar.world.energy(bar.body).elastic, strain, kFloat * strain) << size;
  }
}

TEST(EnergyMeter, PotentialEnergyIsThatOfTheNodesWhateverTheBend) {
  MeteredBar bar(moving(kSpin));
  bar.deform(0.3, 1.0);
  const double nodes = bar.meter().read(bar.world.body(bar.body), kDown).potential;
  EXPECT_NEAR(bar.world.energy(bar.body).potential, nodes, kFloat * std::abs(nodes));
}

TEST(EnergyMeter, KineticEnergyIsThatOfTheNodesWithoutSpinOrWithoutDisplacement) {
  for (const bool spins : {false, true}) {
    MeteredBar bar(moving(spins ? kSpin : Vec3(Vec3::Zero())));
    bar.deform(spins ? 0.0 : 0.3, 2.0);
    const NodeEnergy nodes = bar.meter().read(bar.world.body(bar.body), kDown);
    const BodyEnergy world = bar.world.energy(bar.body);
    EXPECT_EQ(nodes.spin_bound, 0.0);
    EXPECT_NEAR(world.kinetic_rigid + world.kinetic_modal, nodes.kinetic, kFloat * nodes.kinetic) << spins;
  }
}

/// With both, the difference is of first order in the displacement and stays within its bound, which is not an idle
/// one.
TEST(EnergyMeter, KineticEnergyOfASpinningBentBodyDiffersByItsChangeOfInertia) {
  MeteredBar bar(moving(kSpin));
  const EnergyMeter meter = bar.meter();
  const auto difference = [&](double size, double speed) {
    bar.deform(size, speed);
    const NodeEnergy nodes = meter.read(bar.world.body(bar.body), kDown);
    const BodyEnergy world = bar.world.energy(bar.body);
    const double d = nodes.kinetic - world.kinetic_rigid - world.kinetic_modal;
    EXPECT_LE(std::abs(d), nodes.spin_bound + kFloat * nodes.kinetic);
    EXPECT_GE(std::abs(d), 0.01 * nodes.spin_bound);
    return d;
  };
  const double whole = difference(0.02, 0.0), half = difference(0.01, 0.0);
  EXPECT_NEAR(half / whole, 0.5, 0.05);
  difference(0.3, 2.0);
}

/// What the world keeps in free flight, the nodes keep but for the change of inertia.
TEST(EnergyMeter, InFreeFlightTheNodesKeepTheirEnergyWithinTheSpinBound) {
  MeteredBar bar(moving(kSpin));
  bar.deform(0.05, 0.3);
  const EnergyMeter meter = bar.meter();
  const NodeEnergy first = meter.read(bar.world.body(bar.body), kDown);
  const double scale = first.kinetic + first.strain, start = bar.world.energy(bar.body).total();
  double farthest = 0.0;
  for (int i = 0; i < 120; ++i) {
    bar.world.step();
    const NodeEnergy nodes = meter.read(bar.world.body(bar.body), kDown);
    EXPECT_NEAR(bar.world.energy(bar.body).total(), start, 1e-12 * scale);
    EXPECT_LE(std::abs(nodes.total() - first.total()), nodes.spin_bound + first.spin_bound + kFloat * scale);
    farthest = std::max(farthest, std::abs(nodes.total() - first.total()));
  }
  RecordProperty("farthest_of_scale", std::to_string(farthest / scale));
  EXPECT_GT(farthest, kFloat * scale) << "there is nothing to see here";
}

}  // namespace
}  // namespace limber::testing
