// Queries through a world: on bodies as a step left them, with places that loads and handles take.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "grounded_world.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::GroundedWorld;
using testing::sample_model;
using testing::share;

/// Half a second after a blow the body is elsewhere, turned and bent; the place that a ray meets is where it says.
TEST(Queries, ARayMeetsABodyWhereAStepLeftIt) {
  World world({.step = 1.0 / 120.0, .gravity = Vec3::Zero()});
  const BodyId body = world.add_body(sample_model({.modes = 6}));
  world.apply_impulse(body, {.triangle = 2}, {0.2, 0.6, 0.4});
  const Vec3 far(0.3, 3.0, 0.2);
  for (int i = 0; i < 60; ++i) {
    world.step();
    const Vec3 middle = world.body(body).pose.p;
    const auto hit = world.cast_ray({middle + far, -2.0 * far});
    ASSERT_TRUE(hit && hit->at);
    EXPECT_EQ(hit->body, body);
    EXPECT_LE((world.position(body, *hit->at) - hit->position).norm(), 1e-6);  // shapes are single precision
    const auto near = world.nearest_point(hit->position + 1e-3 * hit->normal, 0.01);
    ASSERT_TRUE(near);
    EXPECT_NEAR(near->distance, 1e-3, 1e-6);
  }
}

/// A blow at the place that a ray has met gives the momentum and the spin of a blow there.
TEST(Queries, APlaceTakesImpulsesAndHandles) {
  World world({.gravity = Vec3::Zero()});
  const auto ball = share(Sphere{0.5});
  const BodyId body = world.add_rigid(ball, 1000.0, {.pose = {.p = {0, 0, 2}}, .user_data = 3});
  const auto hit = world.cast_ray({{-3, 0, 2.3}, {6, 0, 0}});
  ASSERT_TRUE(hit && hit->at);
  EXPECT_EQ(hit->user_data, 3u);
  EXPECT_NEAR(hit->position.x(), -0.4, 1e-12);  // √(0.5² − 0.3²)
  const Vec3 blow(100.0, 0, 0), about = world.body(body).pose.p;
  world.apply_impulse(body, *hit->at, blow);
  world.step();
  const double round = 0.01;  // the loaded surface is of flat parts
  EXPECT_LE((world.linear_momentum(body) - blow).norm(), 1e-9);
  EXPECT_LE((world.angular_momentum(body) - (hit->position - about).cross(blow)).norm(), round * 0.5 * blow.norm());
  const HandleId hand = world.add_handle(body, *hit->at);
  EXPECT_TRUE(world.contains(hand));
}

TEST(Queries, TheyFollowWhatIsAddedMovedBentRemovedAndRestored) {
  GroundedWorld g;
  const BodyId box = g.world.add_rigid(share(Box{}), 500.0, {.pose = {.p = {0, 0, 3}}});
  const Ray down{{0.1, 0.2, 10}, {0, 0, -20}};
  const auto met = [&] { return g.world.cast_ray(down); };
  EXPECT_NEAR(met()->position.z(), 3.5, 1e-12);
  std::vector<std::byte> state;
  g.world.save_state(state);
  g.step(20);
  EXPECT_NEAR(met()->position.z(), g.world.body(box).pose.p.z() + 0.5, 1e-9);
  g.world.restore_state(state);
  EXPECT_NEAR(met()->position.z(), 3.5, 1e-12);
  g.world.set_pose(box, {.p = {0, 0, 5}});
  EXPECT_NEAR(met()->position.z(), 5.5, 1e-12);
  g.world.remove_body(box);
  EXPECT_EQ(met()->body, g.ground);
  EXPECT_FALSE(met()->at);
  EXPECT_NEAR(met()->normal.z(), 1.0, 1e-15);
  const BodyId bends = g.world.add_body(sample_model({.modes = 2}), {.pose = {.p = {0, 0, 1}}});
  const double before = met()->position.z();
  g.world.set_amplitudes(bends, std::vector<double>{0.1, 0.1}, std::vector<double>{0, 0});
  EXPECT_NE(met()->position.z(), before);
  // The id of a body that a restored state does not know goes to another one.
  g.world.save_state(state);
  const BodyId first = g.world.add_rigid(share(Box{}), 500.0, {.pose = {.p = {0, 0, 8}}});
  EXPECT_NEAR(met()->position.z(), 8.5, 1e-12);
  g.world.restore_state(state);
  const BodyId second = g.world.add_rigid(share(Sphere{0.25}), 500.0, {.pose = {.p = {0.1, 0.2, 8}}});
  EXPECT_EQ(first, second);
  EXPECT_NEAR(met()->position.z(), 8.25, 1e-12);
}

TEST(Queries, LayersAndCallbacksChoose) {
  World world;
  const auto box = share(Box{});
  const BodyId high = world.add_rigid(box, 500.0, {.pose = {.p = {0, 0, 4}}, .filter = {.layers = 2}});
  const BodyId low = world.add_rigid(box, 500.0, {.pose = {.p = {0, 0, 2}}, .filter = {.layers = 4}});
  world.add_rigid(box, 500.0, {.pose = {.p = {0, 0, 6}}, .filter = {.layers = 0}});  // in none
  const Ray down{{0, 0, 10}, {0, 0, -20}};
  EXPECT_EQ(world.cast_ray(down)->body, high);
  EXPECT_EQ(world.cast_ray(down, {.mask = 4})->body, low);
  EXPECT_EQ(world.cast_ray(down, {.accepts = [&](BodyId id) { return id == low; }})->body, low);
  std::vector<BodyHit> hits;
  world.cast_ray(down, hits);
  ASSERT_EQ(hits.size(), 2u);
  EXPECT_LT(hits[0].fraction, hits[1].fraction);
  std::vector<BodyId> found;
  world.find_overlaps(Box{{1, 1, 0.6}}, {.p = {0, 0, 3}}, found);
  EXPECT_EQ(found, (std::vector<BodyId>{high, low}));
  const auto cast = world.cast_shape(Sphere{0.5}, {.p = {0, 0, 10}}, {0, 0, -20});
  ASSERT_TRUE(cast);
  EXPECT_EQ(cast->body, high);
  EXPECT_NEAR(cast->distance, 5.0, 1e-6);
}

}  // namespace
}  // namespace limber
