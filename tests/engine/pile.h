// Mixed bodies dropped into a pit: boxes, capsules, balls and boxes that bend.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "asked.h"
#include "grounded_world.h"

namespace limber::testing {

inline constexpr double kPileSize = 0.3;                // of its bodies, m
inline constexpr int kPileBoxes = kSanitized ? 9 : 18;  // of a test's pile

/// A pit with sloping sides, so that what rolls comes to rest, and bodies above it in layers of nine.
struct Pile : GroundedWorld {
  /// @param bend every tenth body is a box of this many modes; none where it is negative
  /// @param rolls whether there are balls and capsules, which take long to come to rest
  explicit Pile(int count, int bend, bool rolls = true, const ContactOptions& options = {},
                const WorldOptions& world_options = {}, Jobs& jobs = serial_jobs())
      : GroundedWorld(options, world_options, jobs) {
    for (int side = 0; side < 4; ++side) {
      const Quaternion tilt = quaternion_from_rotation_vector({0.0, kSlope, 0.0});
      const Quaternion turn = quaternion_from_rotation_vector({0.0, 0.0, 0.5 * std::numbers::pi * side});
      world.add_static(std::make_shared<Shape>(HalfSpace{}), {turn * tilt, turn * Vec3(-kHalfWidth, 0.0, 0.0)});
    }
    const Vec3 half = Vec3(0.5, 0.4, 0.3) * kPileSize;
    const auto box = sample_model({.modes = 0, .half_extent = half});
    const auto even = sample_model({.modes = 0, .half_extent = Vec3::Constant(0.3 * kPileSize)});
    const auto bent = sample_model({.modes = std::max(bend, 0), .lowest_hz = 60.0, .decay = 12.0, .half_extent = half});
    const auto ball = std::make_shared<const Shape>(Sphere{.radius = 0.4 * kPileSize});
    const auto capsule =
        std::make_shared<const Shape>(Capsule{.radius = 0.25 * kPileSize, .half_length = 0.3 * kPileSize});
    const auto brick = std::make_shared<const Shape>(Box{.half_extents = half});
    for (int i = 0; i < count; ++i) {
      const int layer = i / 9, place = i % 9;
      const Vec3 at((place % 3 - 1) * 1.3 * kPileSize + 0.02 * std::sin(3.0 * i),
                    (place / 3 - 1) * 1.3 * kPileSize + 0.02 * std::cos(5.0 * i), (0.8 + 1.3 * layer) * kPileSize);
      BodyPlacement placement{
          .pose = {quaternion_from_rotation_vector({0.3 * std::sin(i), 0.2 * std::cos(i), 0.5 * i}), at}};
      const bool bends = bend >= 0 && i % 10 == 9, round = rolls && i % 3 != 0;
      if (!bends) placement.shape = !round ? brick : i % 3 == 1 ? ball : capsule;
      bodies.push_back(world.add_body(bends ? bent : round ? even : box, placement));
    }
    world.set_contact_veto([this](const ContactPoint& contact) {
      deepest = std::min(deepest, contact.gap);
      ++contacts;
      return true;
    });
  }

  /// One step. Leaves the deepest gap at its start in `deepest`, and the number of contacts.
  void step_once() {
    deepest = 0.0, contacts = 0;
    world.step();
  }

  static constexpr double kSlope = 0.6, kHalfWidth = 3.0 * kPileSize;  // of the sides, from the ground
  std::vector<BodyId> bodies;
  double deepest = 0.0;
  int contacts = 0;
};

}  // namespace limber::testing
