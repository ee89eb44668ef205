// The laws of the soak see what breaks them, and short runs of it keep them. All of it: `limber-benchmark soak`.
#include <gtest/gtest.h>

#include <limits>

#include "asked.h"
#include "soak_scene.h"

namespace limber::testing {
namespace {

constexpr int kSoakSteps = kSanitized ? 20 : 80;

/// A step in which one contact presses, a body is indented and a hand lifts, all as they should.
struct GoodStep {
  std::array<ContactEvent, 1> contacts{
      ContactEvent{.a = 0, .b = 1, .normal = Vec3::UnitZ(), .impulse = Vec3(0.3, 0.0, 1.0)}};
  std::array<SeenIndentation, 1> indentations{SeenIndentation{.body = 0, .largest = 5e-4, .compliance = 1e-5}};
  std::array<SeenHand, 1> hands{SeenHand{.force = Vec3(0.0, 0.0, 50.0), .work = 1.0, .max_force = 60.0}};
  SoakStep step{
      .length = 0.01, .friction = 0.5, .weight = 100.0, .energy_scale = 30.0, .energy_before = 7.0, .energy = 8.2};

  SoakShares shares() {
    step.contacts = contacts, step.indentations = indentations, step.hands = hands;
    return shares_of_laws(step);
  }
};

TEST(Soak, AGoodStepKeepsAllLaws) {
  for (const double share : GoodStep().shares().by_law) EXPECT_LE(share, 1.0);
}

TEST(Soak, EachLawSeesWhatBreaksIt) {
  GoodStep pulls, slides, pushes, indented, rises, broken;
  pulls.contacts[0].impulse = Vec3(0.0, 0.0, -1e-5);
  EXPECT_GT(pulls.shares()[SoakLaw::kPush], 1.0);
  slides.contacts[0].impulse = Vec3(0.3, 0.41, 1.0);  // 0.508 of the normal part
  EXPECT_GT(slides.shares()[SoakLaw::kCone], 1.0);
  pushes.hands[0].force.z() = -60.1;
  EXPECT_GT(pushes.shares()[SoakLaw::kHandForce], 1.0);
  indented.indentations[0].largest = 1.1e-3;  // 104 N make 1.04 mm at most
  EXPECT_GT(indented.shares()[SoakLaw::kIndentation], 1.0);
  rises.step.energy += 0.2;  // 1 J is the hand's, 0.3 J are left to it
  EXPECT_GT(rises.shares()[SoakLaw::kEnergy], 1.0);
  broken.contacts[0].impulse.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_GT(broken.shares()[SoakLaw::kFinite], 1.0);
}

/// A indentation without a force is one too many.
TEST(Soak, IndentationsNeedForces) {
  GoodStep step;
  step.contacts[0].a = 2;
  EXPECT_GT(step.shares()[SoakLaw::kIndentation], 1.0);
}

TEST(Soak, HandsTakeAndLetGoAndContactsOnlyPush) {
  SoakScene scene(bake_soak_bodies(), 1);
  std::size_t held = 0, free = 0, pressed = 0;
  for (int i = 0; i < kSoakSteps; ++i) {
    const SoakStep& step = scene.step();
    const SoakShares shares = shares_of_laws(step);
    for (const SoakLaw law : {SoakLaw::kFinite, SoakLaw::kPush, SoakLaw::kCone, SoakLaw::kHandForce})
      EXPECT_LE(shares[law], 1.0) << name(law) << " in step " << i;
    (step.hands.empty() ? free : held) += 1;
    pressed += step.contacts.size();
  }
  EXPECT_GT(free, 0u);
  EXPECT_GT(held, kSanitized ? 0u : 10u);
  EXPECT_GT(pressed, 0u);
}

}  // namespace
}  // namespace limber::testing
