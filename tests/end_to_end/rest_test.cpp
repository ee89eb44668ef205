// Baked bodies that come to rest, from bake through contact to sleep.
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <vector>

#include "grounded_world.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

#if defined(__SANITIZE_ADDRESS__)
constexpr int kBoxes = 3, kRestSteps = 10;  // the sanitizers take twenty times as long
#else
constexpr int kBoxes = 5, kRestSteps = 30;
#endif

std::shared_ptr<const ModalModel> rubber_box(const Vec3& size, const std::array<int, 3>& cells, int modes,
                                             bool residual) {
  BakeOptions o;
  o.materials = {{"*", Material{.youngs_modulus = 5e6, .poisson_ratio = 0.4, .density = 1100.0}}};
  o.analysis.modes = o.limits.max_modes = modes;
  o.residual.surface = residual;
  o.damping = RayleighDamping::from_ratio(0.03, 50.0, 500.0);
  Warnings warnings;
  return bake({.name = "box", .mesh = tet_box(cells[0], cells[1], cells[2], size)}, o, warnings).asset.bodies[0];
}

/// All of their weight goes through contacts between bodies that bend: no step may be left unsettled, since what one
/// leaves overlapping the others have to push out.
TEST(Rest, RubberBoxesLaidUponEachOtherStand) {
  constexpr double kHeight = 0.2, kGap = 1e-4, kShift = 1e-3;  // m; each of the gaps closes
  constexpr double kRise = 1e-6;
  GroundedWorld scene;
  const auto model = rubber_box({0.4, 0.3, kHeight}, {3, 2, 2}, 12, false);
  std::vector<BodyId> boxes;
  for (int i = 0; i < kBoxes; ++i)
    boxes.push_back(scene.world.add_body(
        model,
        {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}),
                  {0.012 * (i % 2), 0.01 * (i % 3), depth_below_origin(*model) + i * kHeight + (i + 1) * kGap}}}));
  const Vec3 top = scene.world.body(boxes.back()).pose.p;
  int unsettled = 0;
  double before = total_energy(scene.world, boxes), rise = 0.0;
  for (int i = 0; i < kRestSteps; ++i) {
    scene.step(1);
    unsettled += scene.world.constraint_report().solved ? 0 : 1;
    const double now = total_energy(scene.world, boxes);
    rise = std::max(rise, now - before);
    before = now;
  }
  EXPECT_EQ(unsettled, 0);
  EXPECT_LT(rise, kRise * kBoxes * model->data().mass * kGravity * 0.4);
  // Under their weight the boxes become shorter: σ = ρ g h at the bottom, E h/2 of it over all of the height.
  const double height = kBoxes * kHeight, shorter = 0.5 * 1100.0 * kGravity * height * height / 5e6;
  EXPECT_LT((scene.world.body(boxes.back()).pose.p - top).norm(), kBoxes * kGap + 2.0 * shorter + kShift);
}

TEST(Rest, ARubberBlockDroppedOnACornerFallsAsleep) {
  for (const bool residual : {false, true})
    for (const ImpactModel impact : {ImpactModel::kAbsorbed, ImpactModel::kHeld}) {
      SCOPED_TRACE(::testing::Message() << "residual " << residual << ", held " << (impact == ImpactModel::kHeld));
      GroundedWorld scene({.friction = 0.6, .impact = impact}, {.sleep = {.enabled = true}});
      const BodyId block =
          scene.world.add_body(rubber_box({0.3, 0.1, 0.1}, {6, 2, 2}, 20, residual),
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
