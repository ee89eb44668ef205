// Baked bodies that come to rest, from bake through contact to sleep.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "asked.h"
#include "energy_meter.h"
#include "grounded_world.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

constexpr int kBoxes = kSanitized ? 3 : 5, kRestSteps = kSanitized ? 10 : 240;

const Material kBoxRubber{.youngs_modulus = 5e6, .poisson_ratio = 0.4, .density = 1100.0};

struct RubberBox {
  Vec3 size{0.3, 0.1, 0.1};
  std::array<int, 3> cells{6, 2, 2};
  int modes = 20;
  bool residual = false;
  MassKind mass = MassKind::kLumped;
};
TetMesh mesh_of(const RubberBox& box) { return tet_box(box.cells[0], box.cells[1], box.cells[2], box.size); }

std::shared_ptr<const ModalModel> bake_box(const RubberBox& box) {
  BakeOptions o;
  o.materials = {{"*", kBoxRubber}};
  o.analysis.modes = o.limits.max_modes = box.modes;
  o.analysis.mass = box.mass;
  o.volume_block = true;
  o.residual.surface = box.residual;
  o.damping = RayleighDamping::from_ratio(0.03, 50.0, 500.0);
  Warnings warnings;
  return bake({.name = "box", .mesh = mesh_of(box)}, o, warnings).asset.bodies[0];
}

/// Boxes laid upon each other, with their energies by both meters: without recovery, which is work done on them.
struct Tower : GroundedWorld {
  static constexpr double kHeight = 0.2, kGap = 1e-4;  // m; each of the gaps closes
  static inline const RubberBox kBox{
      .size = {0.4, 0.3, kHeight}, .cells = {3, 2, 2}, .modes = 12, .mass = MassKind::kConsistent};

  Tower()
      : GroundedWorld(exactly({.recovery_speed = 0.0})),
        model(bake_box(kBox)),
        meter(mesh_of(kBox), kBoxRubber, model) {
    for (int i = 0; i < kBoxes; ++i)
      boxes.push_back(world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}),
                                                      {0.012 * (i % 2), 0.01 * (i % 3),
                                                       depth_below_origin(*model) + i * kHeight + (i + 1) * kGap}}}));
  }
  double node_energy() const {
    double sum = 0.0;
    for (const BodyId id : boxes) sum += meter.read(world.body(id), world.options().gravity).total();
    return sum;
  }
  std::vector<Vec3> places() const {
    std::vector<Vec3> at;
    for (const BodyId id : boxes) at.push_back(world.body(id).pose.p);
    return at;
  }

  std::shared_ptr<const ModalModel> model;
  EnergyMeter meter;
  std::vector<BodyId> boxes;
};

/// All of their weight goes through contacts between bodies that bend: no step may fail, since what one
/// leaves overlapping the others have to push out.
TEST(Rest, RubberBoxesLaidUponEachOtherStand) {
  constexpr double kRise = 1e-6, kNodeRiseGuard = 3e-6, kShift = 1e-3,
                   kDrift = 1e-5;  // of the scale; m; m in the last second
  Tower tower;
  const double scale = kBoxes * tower.model->data().mass * kGravity * 0.4;
  const std::vector<Vec3> first = tower.places();
  std::vector<Vec3> late;
  constexpr int kMeeting = 2;  // steps
  IslandStatusCounts statuses;
  int limits = 0;
  double before = total_energy(tower.world, tower.boxes), rise = 0.0;
  const double nodes_first = tower.node_energy();
  double nodes_before = nodes_first, node_rise = 0.0, node_total = 0.0;
  for (int i = 0; i < kRestSteps; ++i) {
    if (i == std::max(0, kRestSteps - 60)) late = tower.places();
    tower.step(1);
    statuses.add(tower.world.constraint_report().statuses);
    if (i >= kMeeting) limits += tower.world.constraint_report().statuses[IslandStatus::kLimit];
    const double now = total_energy(tower.world, tower.boxes), nodes_now = tower.node_energy();
    rise = std::max(rise, now - before), node_rise = std::max(node_rise, nodes_now - nodes_before);
    node_total = std::max(node_total, nodes_now - nodes_first);
    before = now, nodes_before = nodes_now;
  }
  EXPECT_EQ(statuses[IslandStatus::kFailed], 0);
  EXPECT_EQ(limits, 0);  // but as they meet
  EXPECT_LT(rise, kRise * scale);
  // By the nodes, too, there is never more than at first. In a step there may be: modes above the step's Nyquist rate
  // have static answers, whose strain World::energy counts apart. 1.4e-6 is measured; a regression guard.
  EXPECT_LT(node_total, kRise * scale);
  EXPECT_LT(node_rise, kNodeRiseGuard * scale);
  // Under their weight the boxes become shorter: σ = ρ g h at the bottom, E h/2 of it over all of the height.
  const double height = kBoxes * Tower::kHeight, shorter = 0.5 * 1100.0 * kGravity * height * height / 5e6;
  const std::vector<Vec3> last = tower.places();
  EXPECT_LT((last.back() - first.back()).norm(), kBoxes * Tower::kGap + 2.0 * shorter + kShift);
  if (kRestSteps < 120) return;  // they have not come to rest yet
  for (std::size_t i = 0; i < last.size(); ++i) EXPECT_LT((last[i] - late[i]).norm(), kDrift) << "box " << i;
}

TEST(Rest, ARubberBlockDroppedOnACornerFallsAsleep) {
  for (const bool residual : {false, true}) {
    SCOPED_TRACE(::testing::Message() << "residual " << residual);
    GroundedWorld scene(exactly({.friction = 0.6}), {.sleep = {.enabled = true}});
    const BodyId block =
        scene.world.add_body(bake_box({.residual = residual}),
                             {.pose = {quaternion_from_rotation_vector({0.5, 0.6, 0.0}), {0.0, 0.0, 0.8}}});
    scene.step(300);
    EXPECT_TRUE(scene.world.is_asleep(block));
    const Vec3 place = scene.world.body(block).pose.p;
    scene.step(60);
    EXPECT_EQ(scene.world.body(block).pose.p, place);
  }
}

}  // namespace
}  // namespace limber::testing
