// Bodies with a modal skin in a World: what is drawn, held, pushed and read is one shape, and a hand that bends it
// feels what nonlinear finite elements say.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "constants.h"
#include "limber/engine/world.h"
#include "skinned_bar.h"

namespace limber::testing {
namespace {

/// A point within a triangle near the end.
SurfacePoint point_on_the_end(const ModalModel& model) {
  SurfacePoint at = vertex_at(model, {kLength, 0.75, 1.0});
  at.weight = {0.5, 0.2, 0.3};
  return at;
}

TEST(WorldWithSkins, DrawsWhatItTellsOfPoints) {
  for (const bool held : {true, false}) {
    const auto model = bar({.held = held});
    World world(kWeightless);
    const RigidTransform X{quaternion_from_rotation_vector({0.3, -0.2, 0.5}), {1.0, 2.0, 3.0}};
    const BodyId id = world.add_body(model, {.pose = X});
    world.set_amplitudes(id, bent(*model, 1.5), zeros(*model));
    std::vector<float> positions(3 * static_cast<std::size_t>(model->render().vertices()));
    world.reconstruct(id, positions, {});
    double farthest = 0.0;
    for (Index t = 0; t < static_cast<Index>(model->render().triangles.size()); ++t)
      for (std::size_t c = 0; c < 3; ++c) {
        SurfacePoint at{.surface = SurfacePoint::Surface::kRender, .triangle = t, .weight = {0.0, 0.0, 0.0}};
        at.weight[c] = 1.0;
        const auto v = static_cast<std::size_t>(model->render().triangles[static_cast<std::size_t>(t)][c]);
        const Vec3 drawn = Eigen::Map<const Vec3f>(positions.data() + 3 * v).cast<double>();
        EXPECT_LT((drawn - world.position(id, at)).norm(), 1e-5 * kLength);
        const Vec3 by_modes = X * deformed_point(*model, at, world.body(id).amplitudes);
        farthest = std::max(farthest, (drawn - by_modes).norm());
      }
    EXPECT_GT(farthest, 0.1 * kLength);  // the modes alone are far off
  }
}

TEST(WorldWithSkins, VelocitiesAreThoseOfThePlaces) {
  const auto model = bar({.held = false});
  World world(kWeightless);
  const BodyId id = world.add_body(model, {.angular_velocity = {0.01, 0.02, -0.01}});
  const std::vector<double> z = bent(*model, 1.2);
  std::vector<double> rates = bent(*model, 0.1);
  std::reverse(rates.begin(), rates.end());
  world.set_amplitudes(id, z, rates);
  const SurfacePoint at = point_on_the_end(*model);
  const Vec3 v = world.velocity(id, at);
  constexpr double kShort = 1e-4;
  const auto place = [&](double t) {
    std::vector<double> there = z;
    for (std::size_t i = 0; i < z.size(); ++i) there[i] += t * rates[i];
    World other(kWeightless);
    const BodyId twin =
        other.add_body(model, {.pose = {quaternion_from_rotation_vector(t * Vec3(0.01, 0.02, -0.01)), {}}});
    other.set_amplitudes(twin, there, zeros(*model));
    return other.position(twin, at);
  };
  EXPECT_LT((v - (place(kShort) - place(-kShort)) / (2.0 * kShort)).norm(), 1e-7 * v.norm());
}

/// Work of a small blow on a bent body is what its points' velocity and the blow make: ΔE = j·(v + v')/2.
TEST(WorldWithSkins, ImpulsesGiveTheEnergyThatTheyWork) {
  for (const bool held : {true, false}) {
    const auto model = bar({.held = held});
    World world(kWeightless);
    const BodyId id = world.add_body(model);
    world.set_amplitudes(id, bent(*model, 1.5), bent(*model, 0.02));
    const SurfacePoint at = point_on_the_end(*model);
    const double before = world.energy(id).total();
    const Vec3 v = world.velocity(id, at), j(3.0, -20.0, 50.0);
    world.apply_impulse(id, at, j);
    const double work = 0.5 * j.dot(v + world.velocity(id, at));
    EXPECT_NEAR(world.energy(id).total() - before, work, 1e-10 * std::abs(work));
  }
}

std::uint64_t hash_of_a_pull(const std::shared_ptr<const ModalModel>& model, bool skin) {
  World world({.step = kPeriod / 60.0});
  const BodyId id = world.add_body(model, {.modal_skin = skin});
  const SurfacePoint end = vertex_at(*model, {kLength, 0.75, 1.0});
  const HandleId hand = world.add_handle(id, end);
  const Vec3 start = world.position(id, end);
  for (int i = 0; i < 20; ++i) {
    world.set_handle_target(hand, {.position = start + i * Vec3(-0.02, 0.0, 0.1)});
    world.apply_force(id, vertex_at(*model, {5.0, 0.75, 1.0}), {0.0, 10.0, 0.0});
    world.step();
  }
  return world.state_hash();
}

TEST(WorldWithSkins, WithoutItsSkinABodyMovesToTheBitAsOneThatHasNone) {
  const auto with = bar(), without = bar({.skin = false});
  EXPECT_EQ(hash_of_a_pull(with, false), hash_of_a_pull(without, true));
  EXPECT_NE(hash_of_a_pull(with, false), hash_of_a_pull(with, true));
}

}  // namespace
}  // namespace limber::testing
