// Restitution of rigid bodies in game contact.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "pile.h"

namespace limber::testing {
namespace {

constexpr double kRadius = 0.05;
constexpr double kDensity = 1000.0;
const WorldOptions kFine{.step = 1.0 / 240.0};
const ContactOptions kGameContact{.solver = ContactSolver::kGame};

std::shared_ptr<const Shape> ball() { return share(Sphere{.radius = kRadius}); }

/// The tops of a ball's flights, m above where it touches the ground, down to `least`.
std::vector<double> tops(World& world, BodyId id, double least) {
  std::vector<double> found;
  double before = world.body(id).pose.p.z(), rate = 0.0;
  for (int i = 0; i < 20'000 && (found.empty() || found.back() > least); ++i) {
    world.step();
    const double z = world.body(id).pose.p.z();
    if (rate > 0.0 && z <= before) found.push_back(before - kRadius);
    rate = z - before, before = z;
  }
  return found;
}

// A ball with more modes than bundles take, whose shape is rigid, has its rows by itself.
TEST(Rebound, EachHeightIsESquaredOfTheLast) {
  for (const int modes : {0, 40})
    for (const double e : {0.3, 0.5, 0.8, 0.95}) {
      GroundedWorld scene(kGameContact, kFine);
      const BodyId id = scene.world.add_body(
          sample_model({.modes = modes}), {.pose = {{}, {0.0, 0.0, 1.0 + kRadius}}, .restitution = e, .shape = ball()});
      double last = 1.0;
      const std::vector<double> heights = tops(scene.world, id, 0.02);
      EXPECT_GE(heights.size(), 2u) << e;
      for (const double height : heights) {
        EXPECT_NEAR(height / last, e * e, 0.01 * e * e) << e << ' ' << last << ' ' << modes;
        last = height;
      }
    }
}

TEST(Rebound, OfOneKeepsTheEnergy) {
  GroundedWorld scene(kGameContact, kFine);
  const BodyId id =
      scene.world.add_rigid(ball(), kDensity, {.pose = {{}, {0.0, 0.0, 0.2 + kRadius}}, .restitution = 1.0});
  std::vector<double> heights = tops(scene.world, id, 0.2 * 0.99);
  ASSERT_GT(heights.size(), 50u);
  for (std::size_t i = 0; i < 50; ++i) EXPECT_NEAR(heights[i], 0.2, 0.002) << i;
}

TEST(Rebound, LeavesWhatRestsAlone) {
  const auto speeds = [](double e) {
    GroundedWorld scene(kGameContact);
    std::vector<double> found;
    std::vector<BodyId> bodies;
    for (int i = 0; i < 5; ++i)
      bodies.push_back(scene.world.add_rigid(share(Box{.half_extents = {0.1, 0.1, 0.1}}), kDensity,
                                             {.pose = {{}, {0.0, 0.0, 0.1 + 0.2 * i}}, .restitution = e}));
    for (int i = 0; i < 240; ++i) {
      scene.step(1);
      double fastest = 0.0;
      for (const BodyId body : bodies) fastest = std::max(fastest, scene.world.body(body).velocity.norm());
      found.push_back(fastest);
    }
    return found;
  };
  // A stack bends and sways a little whatever e is.
  const std::vector<double> without = speeds(0.0), with = speeds(0.9);
  EXPECT_LT(*std::ranges::max_element(with), 1e-2);
  EXPECT_LT(with.back(), 1e-4);
  EXPECT_LT(with.back(), 2.0 * without.back());
}

/// A box that rests without restitution beside a ball that has some: it lies as it does beside one that has none, to
/// the bit.
TEST(Rebound, LeavesContactsOfOthersAlone) {
  const auto box_beside = [](double e) {
    GroundedWorld g(kGameContact, kFine);
    g.world.add_rigid(ball(), kDensity, {.pose = {.p = {0, 0, kRadius}}, .restitution = e});
    const BodyId box = g.world.add_rigid(share(Box{{0.5, 0.5, 0.5}}), 700.0, {.pose = {.p = {3, 0, 0.5}}});
    g.step(60);
    return g.world.body(box);
  };
  const BodyView with = box_beside(0.7), without = box_beside(0.0);
  EXPECT_LT(with.velocity.norm() + with.angular_velocity.norm(), 1e-7);
  EXPECT_EQ(with.velocity, without.velocity);
  EXPECT_EQ(with.pose.p, without.pose.p);
}

TEST(Rebound, EndsInRest) {
  GroundedWorld scene(kGameContact, kFine);
  const BodyId id = scene.world.add_rigid(ball(), kDensity, {.pose = {{}, {0.0, 0.0, 0.5}}, .restitution = 0.5});
  scene.step(2 * 240);  // 0.3 s of fall, and (1 + e)/(1 − e) times as long
  const Vec3 place = scene.world.body(id).pose.p;
  for (int i = 0; i < 240; ++i) {
    scene.step(1);
    ASSERT_LT(scene.world.body(id).velocity.norm(), 1e-6) << i;
  }
  EXPECT_LT((scene.world.body(id).pose.p - place).norm(), 1e-6);
}

TEST(Rebound, OfTwoBallsIsByTheLargerOfBoth) {
  for (const auto& [a, b] : {std::pair{0.8, 0.2}, std::pair{0.0, 0.8}, std::pair{0.0, 0.0}}) {
    GroundedWorld scene(kGameContact, {.step = 1.0 / 240.0, .gravity = Vec3::Zero()});
    const BodyId left = scene.world.add_rigid(
        ball(), kDensity, {.pose = {{}, {-0.3, 0.0, 1.0}}, .velocity = {2.0, 0.0, 0.0}, .restitution = a});
    const BodyId right =
        scene.world.add_rigid(ball(), 3.0 * kDensity, {.pose = {{}, {0.0, 0.0, 1.0}}, .restitution = b});
    scene.step(120);
    const double e = std::max(a, b), mean = 0.5, u = scene.world.body(left).velocity.x(),
                 v = scene.world.body(right).velocity.x();
    EXPECT_NEAR(v - u, 2.0 * e, 0.01);
    EXPECT_NEAR((u + 3.0 * v) / 4.0, mean, 1e-5);
  }
}

TEST(Rebound, FromWhatIsLedIsByItsOwnSpeed) {
  GroundedWorld scene(kGameContact, {.step = 1.0 / 240.0, .gravity = Vec3::Zero()});
  scene.world.add_kinematic(share(Box{.half_extents = {0.5, 0.5, 0.1}}),
                            {.pose = {{}, {0.0, 0.0, 1.0}}, .velocity = {0.0, 0.0, 2.0}});
  const BodyId id = scene.world.add_rigid(ball(), kDensity, {.pose = {{}, {0.0, 0.0, 1.4}}, .restitution = 0.5});
  scene.step(120);
  EXPECT_NEAR(scene.world.body(id).velocity.z(), (1.0 + 0.5) * 2.0, 0.01);
}

TEST(Rebound, OfABoxThatLandsFlatTurnsItLittle) {
  GroundedWorld scene(kGameContact, kFine);
  const BodyId id = scene.world.add_rigid(share(Box{.half_extents = {0.1, 0.08, 0.05}}), kDensity,
                                          {.pose = {{}, {0.0, 0.0, 0.55}}, .restitution = 0.6});
  double top = 0.0;
  bool rises = false;
  for (int i = 0; i < 200; ++i) {
    scene.step(1);
    rises = rises || scene.world.body(id).velocity.z() > 0.0;
    if (rises) top = std::max(top, scene.world.body(id).pose.p.z() - 0.05);
  }
  EXPECT_NEAR(top, 0.5 * 0.36, 0.02 * 0.5 * 0.36);
}

/// Energy is missing while contacts have it, for some substeps each.
TEST(Rebound, NoFallOfManyGainsEnergy) {
  constexpr std::size_t kLast = 10;  // steps
  for (const double e : {0.5, 1.0}) {
    GroundedWorld scene(kGameContact);
    std::vector<BodyId> bodies;
    for (int i = 0; i < 40; ++i) {
      const auto shape = i % 2 == 0 ? ball() : share(Box{.half_extents = {0.06, 0.05, 0.03}});
      const Quaternion turn = quaternion_from_rotation_vector({0.3 * i, 0.7 * i, 0.1 * i});
      bodies.push_back(scene.world.add_rigid(
          shape, kDensity,
          {.pose = {turn, {0.12 * (i % 4), 0.12 * (i / 4 % 4), 0.3 + 0.2 * (i / 16)}}, .restitution = e}));
    }
    std::vector<double> energies(kLast, total_energy(scene.world, bodies));
    for (int i = 0; i < 240; ++i) {
      scene.step(1);
      const double most = *std::max_element(energies.end() - kLast, energies.end());
      energies.push_back(total_energy(scene.world, bodies));
      ASSERT_LT(energies.back() - most, 1e-3 * energies.front()) << e << ' ' << i;
    }
  }
}

TEST(Rebound, GoesOnFromASnapshotToTheBit) {
  GroundedWorld scene(kGameContact);
  const BodyId id = scene.world.add_rigid(ball(), kDensity, {.pose = {{}, {0.0, 0.0, 0.1}}, .restitution = 0.9});
  for (int i = 0; i < 60; ++i) {
    std::vector<std::byte> state;
    scene.world.save_state(state);
    scene.step(3);
    const Vec3 place = scene.world.body(id).pose.p;
    scene.world.restore_state(state);
    scene.step(3);
    ASSERT_EQ(scene.world.body(id).pose.p, place) << i;
    scene.world.restore_state(state);
    scene.step(1);
  }
}

TEST(Rebound, OfWhatBendsIsByItsModes) {
  const auto fall = [](double e) {
    GroundedWorld scene(kGameContact);
    const BodyId id =
        scene.world.add_body(sample_model({.modes = 6}), {.pose = {{}, {0.0, 0.0, 2.0}}, .restitution = e});
    scene.step(120);
    return scene.world.body(id).pose.p;
  };
  EXPECT_EQ(fall(0.0), fall(1.0));
}

TEST(Rebound, IsRefusedBeyondOneAndWithoutGameContact) {
  GroundedWorld scene(kGameContact), exact(exactly());
  for (const double e : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(scene.world.add_rigid(ball(), kDensity, {.restitution = e}), InvalidArgument) << e;
  EXPECT_THROW(exact.world.add_rigid(ball(), kDensity, {.restitution = 0.5}), InvalidArgument);
  scene.world.add_rigid(ball(), kDensity, {.restitution = 0.5});
  EXPECT_THROW(scene.world.set_contact_source(scene.finder.get(), exactly()), InvalidArgument);
}

}  // namespace
}  // namespace limber::testing
