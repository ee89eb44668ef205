#include <gtest/gtest.h>

#include <cmath>

#include "bar_model.h"
#include "contact_scene.h"

namespace limber::testing {
namespace {

/// What a bar does that comes at a wall at unit speed.
struct Rebound {
  double speed = 0.0;           // of the mass centre afterwards, away from the wall
  double contact_time = 0.0;    // from the touch to the end of the last step with a force
  double highest_energy = 0.0;  // at the end of any step, by that at first; indentations included
};

/// @param phase of the touch within a step: 0 at its start
Rebound strike(int modes, double step, const ContactOptions& options, double phase, bool residual = true) {
  GroundedIsland wall(bar_model(modes, residual), step, options, Vec3::UnitX(), Vec3::Zero());
  wall.add_body({{}, {0.5 * kBarLength + phase * step, 0.0, 0.0}}, {-1.0, 0.0, 0.0});
  Rebound seen;
  const double scale = wall.energy();
  int last = -1;
  for (int i = 0; i * step < 1.5 * kBarContactTime + phase * step; ++i) {
    wall.step();
    bool pressed = false;
    for (const ContactEvent& e : wall.contacts.events()) pressed = pressed || e.phase != ContactPhase::kEnded;
    if (pressed) last = i;
    seen.highest_energy = std::max(seen.highest_energy, wall.energy() / scale);
  }
  seen.contact_time = (last + 1 - phase) * step;
  seen.speed = wall.group.frame(0).velocity().x();
  return seen;
}

/// With θ = 1 each step takes ½ f A_r f from the frame: N equal impulses 2mv/N take 4/N of its energy.
TEST(Impact, ImpulsesAtTheStepsStartLoseFourNthsOfTheEnergy) {
  for (const double steps : {10.0, 20.0, 50.0}) {
    const Rebound r = strike(40, kBarContactTime / steps, {.friction = 0.0}, 0.0);
    EXPECT_NEAR(r.speed, std::sqrt(1.0 - 4.0 / steps), 0.03) << "T/" << steps;
  }
}

}  // namespace
}  // namespace limber::testing
