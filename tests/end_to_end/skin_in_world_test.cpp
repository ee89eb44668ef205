// Bodies with a modal skin in a World: what is drawn, held, pushed and read is one shape, and a hand that bends it
// feels what nonlinear finite elements say.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "constants.h"
#include "limber/dynamics/reconstruct.h"
#include "limber/engine/world.h"
#include "nonlinear_fem.h"
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

TEST(WorldWithSkins, NearlyStraightBodiesAreDrawnByTheirModes) {
  for (const bool held : {true, false}) {
    const auto model = bar({.held = held});
    std::vector<std::vector<float>> drawn;
    for (const bool skin : {true, false}) {
      World world(kWeightless);
      const BodyId id = world.add_body(model, {.modal_skin = skin});
      world.set_amplitudes(id, bent(*model, 0.5 * kDrawnStraight), zeros(*model));
      drawn.emplace_back(3 * static_cast<std::size_t>(model->render().vertices()));
      world.reconstruct(id, drawn.back(), {});
      if (!skin) continue;
      for (std::size_t t = 0; t < model->render().triangles.size(); ++t) {
        const SurfacePoint at{
            .surface = SurfacePoint::Surface::kRender, .triangle = static_cast<Index>(t), .weight = {1.0, 0.0, 0.0}};
        const auto v = static_cast<std::size_t>(model->render().triangles[t][0]);
        const Vec3 shown = Eigen::Map<const Vec3f>(drawn[0].data() + 3 * v).cast<double>();
        EXPECT_LT((shown - world.position(id, at)).norm(), kDrawnStraight * kDrawnStraight * kLength);
      }
    }
    EXPECT_EQ(drawn[0], drawn[1]);
  }
}

/// What a GPU makes of k weights and n handles: the vertices that the world draws, between two states.
TEST(WorldWithSkins, WeightsAndHandlesAreAllThatDrawingTakes) {
  const auto model = bar({.held = false});
  World world(kWeightless);
  const BodyId id = world.add_body(model, {.angular_velocity = {0.01, 0.02, -0.01}});
  world.set_amplitudes(id, bent(*model, 1.2), bent(*model, 0.1));
  world.step();
  constexpr double kBetween = 0.3;
  const ModalSkin& skin = *model->data().skin;
  const ModalSurface& surface = model->render();
  std::vector<float> drawn(3 * static_cast<std::size_t>(surface.vertices())),
      numbers(SkinPose::kNumbers * static_cast<std::size_t>(skin.handles)),
      weights(static_cast<std::size_t>(model->modes()));
  world.reconstruct(id, drawn, {}, kBetween);
  world.interpolated_handles(id, kBetween, numbers);
  world.interpolated_weights(id, kBetween, weights);
  const RigidTransform X = world.interpolated_pose(id, kBetween);
  const auto vector = [&](std::size_t at) { return Vec3(numbers[at], numbers[at + 1], numbers[at + 2]); };
  for (std::size_t v = 0; v < skin.render.size(); ++v) {
    const Vec3 r = surface.rest[v].cast<double>();
    Vec3 y = r, moved = Vec3::Zero();
    for (std::size_t m = 0; m < weights.size(); ++m)
      y += static_cast<double>(weights[m]) * model->data().mode_scales[m] *
           surface.basis.shape(static_cast<Index>(v), static_cast<Index>(m)).cast<double>();
    const auto over_handles = [&](auto&& act) {
      for (std::size_t i = 0; i < SkinInfluences::kMost; ++i)
        act(static_cast<double>(skin.render[v].weight[i]), SkinPose::kNumbers * skin.render[v].handle[i]);
    };
    over_handles([&](double beta, std::size_t h) { y -= beta * (vector(h + 15) + vector(h + 12).cross(r)); });
    over_handles([&](double beta, std::size_t h) {
      Mat3 turn;
      turn << vector(h).transpose(), vector(h + 3).transpose(), vector(h + 6).transpose();
      moved += beta * (turn * y + vector(h + 9));
    });
    const Vec3 shown = Eigen::Map<const Vec3f>(drawn.data() + 3 * v).cast<double>();
    EXPECT_LT((X * Vec3(y + moved) - shown).norm(), 1e-5 * kLength);
  }
}

/// A damped bar whose end is led along the places that nonlinear elements have under a load at it, a degree a step, and
/// held there: the hand's force and the shape.
TEST(WorldWithSkins, AHandMeetsTheForceOfNonlinearElements) {
  const auto model = bar({.damped = true});
  const TetMesh mesh = bar_mesh();
  const auto exact_body =
      limber::testing::skinned(mesh, nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; }), 20, 16);
  const std::vector<Index> end = nodes_where(mesh, [](const Vec3&x) { return x.x() > kLength - 1e-9; }),
                           middle = nodes_where(
                               mesh, [](const Vec3&x) { return (x - Vec3(kLength, 0.75, 0.5)).norm() < 1e-9; });
  ASSERT_EQ(middle.size(), 1u);
  const Vec3 to_body = exact_body->body->origin - model->data().origin_in_input;
  struct Bend {
    double degrees, shape, force;
  };
  for (const Bend& asked : {Bend{60.0, 0.006, 0.10}, Bend{90.0, 0.015, 0.15}, Bend{120.0, 0.027, 0.30}}) {
    SCOPED_TRACE(asked.degrees);
    const Vec3 direction = Eigen::AngleAxisd(0.5 * asked.degrees * kDegree, -Vec3::UnitY()) * Vec3::UnitZ();
    const auto path = bend_by_load(*exact_body, middle, end, direction, 10.0, asked.degrees * kDegree);
    ASSERT_FALSE(path.empty());
    World world(kWeightless);
    const BodyId id = world.add_body(model);
    const RigidTransform X = world.body(id).pose;
    const HandleId hand = world.add_handle(id, vertex_at(*model, {kLength, 0.75, 0.5}));
    int unsettled = 0;
    const auto place = [&](std::size_t i) {
      return Vec3(X * Vec3(path[i].places[static_cast<std::size_t>(middle[0])] + to_body));
    };
    for (std::size_t i = 1; i < path.size(); ++i)
      for (int s = 1; s <= 10; ++s) {
        world.set_handle_target(hand, {.position = place(i - 1) + 0.1 * s * (place(i) - place(i - 1))});
        world.step();
        unsettled += world.constraint_report().solved ? 0 : 1;
      }
    for (int s = 0; s < 240; ++s) world.step(), unsettled += world.constraint_report().solved ? 0 : 1;
    EXPECT_EQ(unsettled, 0);
    double farthest = 0.0;
    for (std::size_t v = 0; v < mesh.nodes.size(); ++v) {
      const SurfacePoint at = [&] {
        try {
          return vertex_at(*model, mesh.nodes[v]);
        } catch (const InvalidArgument&) {
          return SurfacePoint{.triangle = -1};  // within
        }
      }();
      if (at.triangle < 0) continue;
      farthest = std::max(farthest, (world.position(id, at) - X * Vec3(path.back().places[v] + to_body)).norm());
    }
    EXPECT_LE(farthest / kLength, asked.shape);
    EXPECT_NEAR(world.handle(hand).force.norm() / path.back().force, 1.0, asked.force);
  }
}

}  // namespace
}  // namespace limber::testing
