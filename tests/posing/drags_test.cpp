// What holds in every frame of every drag: joints, limits, rigid parts, what is pinned; and what a pose must not depend
// on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "asked.h"
#include "limber/core/error.h"
#include "posed_models.h"

namespace limber {
namespace {

using namespace testing;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kJoint = 1e-6;                // of the size, rad
constexpr double kLimitAngle = 0.1 * kDegree;  // how far beyond a limit a frame may be
constexpr double kLimitLength = 1e-3;          // of the size

/// Small steps stay on their branch (PosingOptions::starts).
const PosingOptions kFollow{.starts = 0};

/// The first part stays; parts between the first and the last are soft if asked; the last is held by its furthest
/// point.
struct Dragged {
  explicit Dragged(const std::string& name, bool soft = false, double cell = 0.0)
      : session(soft ? assembly_model(name) : rigid_assembly(name), kFollow),
        size(size_of(session.model())),
        last(static_cast<Index>(session.model().parts.size()) - 1) {
    session.set_pinned(0, true);
    if (soft)
      for (Index p = 1; p < last; ++p) session.set_part(p, {.cells = Subdivision::kUniform, .cell_size = cell});
    const Vec3 base = furthest_point(session.model(), 0, Vec3::Zero());
    grip = furthest_point(session.model(), last, base);
    handle = session.add_handle(last, grip);
  }

  /// Nothing stays but by what the test adds.
  explicit Dragged(JointedModel model)
      : session(std::move(model), kFollow),
        size(size_of(session.model())),
        last(static_cast<Index>(session.model().parts.size()) - 1) {
    grip = furthest_point(session.model(), last, furthest_point(session.model(), 0, Vec3(10, 0, 0)));
    handle = session.add_handle(last, grip);
  }

  PoseResult drag_to(const Vec3& target) {
    session.move_handle(handle, target);
    return session.solve();
  }

  PosingSession session;
  double size;
  Index last;
  Vec3 grip;
  PoseHandle handle{};
};

double beyond(const Interval& limit, double q) { return std::max({limit.low - q, q - limit.high, 0.0}); }

/// Joints hold, limits are not passed, rigid parts are rigid, nothing flips.
void expect_whole(const Dragged& d, const PoseResult& r) {
  EXPECT_NE(r.status, PoseResult::Status::kInfeasible);
  EXPECT_LE(r.energy, r.initial_energy * (1.0 + 1e-12));
  for (std::size_t j = 0; j < d.session.model().joints.size(); ++j) {
    const PosedJoint at = d.session.joint(static_cast<Index>(j));
    const JointSpec& spec = d.session.model().joints[j].joint;
    EXPECT_LT(at.error, kJoint) << j;
    if (spec.type == JointType::kBall) {
      EXPECT_LT(at.coordinates[0], spec.limits.cone + kLimitAngle) << j;
    }
    if (spec.type == JointType::kRevolute || spec.type == JointType::kCylindrical || spec.type == JointType::kPlanar) {
      EXPECT_LT(beyond(spec.limits.rotation, at.coordinates[0]), kLimitAngle) << j;
    }
    if (spec.type == JointType::kPrismatic) {
      EXPECT_LT(beyond(spec.limits.translation[0], at.coordinates[0]), kLimitLength * d.size) << j;
    }
    if (spec.type == JointType::kCylindrical || spec.type == JointType::kPlanar) {
      EXPECT_LT(beyond(spec.limits.translation[0], at.coordinates[1]), kLimitLength * d.size) << j;
    }
  }
  for (const PosedCell& c : d.session.cells()) {
    ASSERT_TRUE(c.place.allFinite());
    EXPECT_NEAR(c.rotation.determinant(), 1.0, 1e-12);
    EXPECT_LT((c.rotation.transpose() * c.rotation - Mat3::Identity()).norm(), 1e-12);
  }
}

/// Distances between some vertices of a part.
std::vector<double> shape_of(const Dragged& d, Index part, const std::vector<Vec3>& vertices) {
  std::vector<double> out;
  const auto& triangles = d.session.model().parts[static_cast<std::size_t>(part)].triangles;
  const auto vertex = [&](std::size_t i) {
    return vertices[static_cast<std::size_t>(
        d.session.model().surface.triangles[static_cast<std::size_t>(triangles[i])][0])];
  };
  for (std::size_t i = 1; i < triangles.size(); i += 7) out.push_back((vertex(i) - vertex(i / 2)).norm());
  return out;
}

class EveryAssembly : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryAssembly, HoldsTogetherHoweverItIsPulled) {
  Dragged d(GetParam());
  const std::vector<Vec3> rest = vertices_of(d.session);
  for (const double far : {0.1, 0.5, 2.0, 10.0, 0.0})
    for (const Vec3& way : {Vec3(0.3, 0.5, -0.8), Vec3(-0.7, 0.6, 0.4)}) {
      const PoseResult r = d.drag_to(d.grip + far * d.size * way);
      expect_whole(d, r);
      if (far == 0.0) {
        EXPECT_LT(r.handle_error, 1e-6 * d.size) << "back where it was";
      }
      const std::vector<Vec3> now = vertices_of(d.session);
      for (Index p = 0; p <= d.last; ++p) {
        const auto before = shape_of(d, p, rest), after = shape_of(d, p, now);
        for (std::size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(after[i], before[i], 1e-8 * d.size) << "part " << p;
      }
      for (const Index t : d.session.model().parts[0].triangles) {
        const auto v = static_cast<std::size_t>(d.session.model().surface.triangles[static_cast<std::size_t>(t)][0]);
        EXPECT_LT((now[v] - rest[v]).norm(), 1e-9 * d.size);
      }
    }
}

INSTANTIATE_TEST_SUITE_P(Drawn, EveryAssembly,
                         ::testing::Values("lamp", "chair", "brush arm", "humanoid", "dog", "scissors", "drawer",
                                           "hitch", "door", "sliding plate", "screw", "telescope", "gimbal",
                                           "drop link", "caster", "cardan"),
                         [](const auto& test) {
                           std::string name = test.param;
                           std::erase(name, ' ');
                           return name;
                         });

TEST(Drags, ALampReachesWhatItCanReachInFewIterations) {
  Dragged d("lamp");
  for (int i = 1; i <= 5; ++i) {
    const PoseResult r = d.drag_to(d.grip + 0.02 * i * d.size * Vec3(0.3, 0.5, -0.8));
    EXPECT_EQ(r.status, PoseResult::Status::kConverged);
    EXPECT_LE(r.iterations, 20);
    EXPECT_LT(r.handle_error, 1e-9 * d.size);
    EXPECT_LT(r.joint_error, 1e-9);
  }
}

TEST(Drags, ASoftLampReachesItTooAndItsLimitsHold) {
  Dragged d("lamp", true, 0.03);
  for (int i = 1; i <= 3; ++i) {
    const PoseResult r = d.drag_to(d.grip + 0.1 * i * d.size * Vec3(0.3, 0.5, -0.8));
    EXPECT_EQ(r.status, PoseResult::Status::kConverged);
    expect_whole(d, r);
  }
  expect_whole(d, d.drag_to(d.grip + 10.0 * d.size * Vec3::UnitZ()));
  const PoseResult back = d.drag_to(d.grip);
  expect_whole(d, back);
  EXPECT_LT(back.handle_error, 1e-6 * d.size);
}

// Pulled out as far as it goes, the piston's crank and rod are in line: no force on the piston turns the crank. What
// brings it back is the crank.
TEST(Drags, AtItsDeadCentreASliderCrankIsMovedByItsCrank) {
  Dragged d("piston");
  for (const double far : {0.1, 0.5, 10.0}) expect_whole(d, d.drag_to(d.grip + far * d.size * Vec3(-0.7, 0.6, 0.4)));
  d.session.remove_handle(d.handle);
  const Index crank = d.session.model().part_named("crank");
  d.grip = furthest_point(d.session.model(), crank, Vec3(-1, -2, -3));
  d.handle = d.session.add_handle(crank, d.grip);
  const PoseResult r = d.drag_to(d.grip);
  expect_whole(d, r);
  EXPECT_LT(r.handle_error, 1e-6 * d.size);
}

TEST(Drags, AHandleOutOfReachSettles) {
  Dragged d("lamp");
  const Vec3 far = d.grip + 5.0 * d.size * Vec3(1, 0, 0.2);
  for (int i = 0; i < 3; ++i) d.drag_to(far);
  const std::vector<Vec3> before = vertices_of(d.session);
  d.drag_to(far);
  EXPECT_LT(largest_distance(before, vertices_of(d.session)), 1e-4 * d.size);
}

// Stretched by a handle that it cannot reach, at joints' limits. Further calls find next to nothing.
TEST(Drags, ASoftBodyPulledOutOfReachSettles) {
  for (const double cell : {0.03, 0.05})
    for (const double far : {2.0, 10.0}) {
      Dragged d("lamp", true, cell);
      const PoseResult first = d.drag_to(d.grip + far * d.size * Vec3(0.3, 0.5, -0.8));
      EXPECT_EQ(first.status, PoseResult::Status::kConverged) << cell << " " << far;
      expect_whole(d, first);
      double energy = first.energy;
      for (int i = 0; i < 3; ++i) {
        const PoseResult next = d.session.solve();
        EXPECT_EQ(next.status, PoseResult::Status::kConverged);
        EXPECT_LE(next.iterations, 20);
        energy = next.energy;
      }
      EXPECT_LT(first.energy - energy, 2e-5 * energy) << cell << " " << far;
    }
}

JointSpec ball_at(const Vec3& origin, double cone) {
  JointSpec out;
  out.type = JointType::kBall;
  out.frame.origin = origin;
  out.limits.cone = cone;
  return out;
}

/// [X09]'s snake: beads that touch nothing, joined by balls that the user has placed.
JointedModel snake() {
  JointedModel model = rigid_assembly("snake");
  const auto middle = [&](std::size_t part) {
    Eigen::AlignedBox3d box;
    for (const Index t : model.parts[part].triangles)
      for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
        box.extend(model.surface.vertices[static_cast<std::size_t>(v)]);
    return Vec3(box.center());
  };
  model.joints.clear();
  for (std::size_t i = 0; i + 1 < model.parts.size(); ++i) {
    const JointSpec joint = ball_at(0.5 * (middle(i) + middle(i + 1)), 0.6);
    model.joints.push_back({static_cast<Index>(i), static_cast<Index>(i + 1), joint, {}});
  }
  return model;
}

/// A bar cut in two by a joint, its parts one piece of material.
JointedModel bar_with_a_virtual_joint() {
  JointedModel model = single_part(bar_surface(1.0, 0.16, 24));
  model.parts = {{"lower", {}}, {"upper", {}}};
  for (std::size_t t = 0; t < model.surface.triangles.size(); ++t) {
    double x = 0.0;
    for (const Index v : model.surface.triangles[t]) x += model.surface.vertices[static_cast<std::size_t>(v)].x() / 3.0;
    model.parts[x < 0.5 ? 0 : 1].triangles.push_back(static_cast<Index>(t));
  }
  model.joints.push_back({0, 1, ball_at(Vec3(0.5, 0, 0), 0.8), {}});
  return model;
}

/// Once round in small steps, out of reach and in again, then ten sizes away at once, and back.
void expect_whole_on_a_long_drag(Dragged& d) {
  const int steps = all_or_tenth(60);
  for (int i = 0; i <= steps; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / steps, far = 0.6 * (1.0 - std::cos(angle));
    expect_whole(d, d.drag_to(d.grip + far * d.size * Vec3(-0.4, std::cos(2.0 * angle), std::sin(2.0 * angle))));
  }
  expect_whole(d, d.drag_to(d.grip + 10.0 * d.size * Vec3(-0.5, 0.8, 0.3)));
  const PoseResult back = d.drag_to(d.grip);
  expect_whole(d, back);
  EXPECT_LT(back.handle_error, 1e-6 * d.size) << "back where it was";
}

TEST(Drags, ASnakeHoldsTogetherHoweverLongItIsDragged) {
  Dragged d(snake());
  d.session.set_pinned(0, true);
  expect_whole_on_a_long_drag(d);
}

TEST(Drags, ASoftBodyWithAVirtualJointDoesToo) {
  Dragged d(bar_with_a_virtual_joint());
  for (const Index p : {0, 1}) d.session.set_part(p, {.cells = Subdivision::kUniform, .cell_size = 0.055});
  for (const Vec3& way : {Vec3(-9, 1, 1), Vec3(-9, -1, 1), Vec3(-9, 1, -1), Vec3(-9, -1, -1)})
    d.session.add_handle(0, furthest_point(d.session.model(), 0, -way));
  expect_whole_on_a_long_drag(d);
}

TEST(Drags, WhatAPinnedPartSeparatesFromTheHandlesStays) {
  Dragged d("humanoid");  // the torso is pinned: other limbs hang on it
  const std::vector<Vec3> rest = vertices_of(d.session);
  d.drag_to(d.grip + 0.2 * d.size * Vec3(0.5, -0.5, 0.5));
  const std::vector<Vec3> now = vertices_of(d.session);
  std::vector<bool> may_move(d.session.model().parts.size(), false);
  may_move[static_cast<std::size_t>(d.last)] = true;
  for (bool more = true; more;) {
    more = false;
    for (const ModelJoint& j : d.session.model().joints)
      for (const auto& [a, b] : {std::pair(j.a, j.b), std::pair(j.b, j.a)})
        if (may_move[static_cast<std::size_t>(a)] && b != 0 && !may_move[static_cast<std::size_t>(b)])
          more = may_move[static_cast<std::size_t>(b)] = true;
  }
  EXPECT_GT(largest_distance(rest, now), 0.01 * d.size);
  for (std::size_t p = 0; p < may_move.size(); ++p) {
    if (may_move[p]) continue;
    for (const Index t : d.session.model().parts[p].triangles)
      for (const Index v : d.session.model().surface.triangles[static_cast<std::size_t>(t)])
        EXPECT_LT((now[static_cast<std::size_t>(v)] - rest[static_cast<std::size_t>(v)]).norm(), 1e-9 * d.size);
  }
}

TEST(Drags, ARigidMotionOfAllHandlesIsReproduced) {
  for (const bool soft : {false, true}) {
    PosingSession session(assembly_model("lamp"), {.tolerance = 1e-12});
    const double size = size_of(session.model());
    if (soft) session.set_part(2, {.cells = Subdivision::kUniform, .cell_size = 0.04});
    std::vector<std::pair<PoseHandle, Vec3>> handles;
    for (Index part = 0; part < 5; ++part)
      for (const Vec3& from : {Vec3(1, 2, 3), Vec3(-3, 1, 0), Vec3(0, -5, 1)}) {
        const Vec3 grip = furthest_point(session.model(), part, from);
        handles.emplace_back(session.add_handle(part, grip), grip);
      }
    const std::vector<Vec3> rest = vertices_of(session);
    const RigidTransform X{quaternion_from_rotation_vector({0.5, 1.5, -2.0}), size * Vec3(3, -1, 2)};
    for (const auto& [id, grip] : handles) session.move_handle(id, X * grip);
    EXPECT_EQ(session.solve().status, PoseResult::Status::kConverged);
    for (const PosedCell& c : session.cells())
      EXPECT_LT((c.place - X * c.rest.centre).norm(), 1e-10 * size) << (soft ? "soft" : "rigid");
  }
}

TEST(Drags, ThePoseDoesNotDependOnTheOrderOfParts) {
  const auto dragged = [](bool swapped) {
    PosingSession session(assembly_model("lamp", swapped), {.tolerance = 1e-11});
    const Index base = session.model().part_named("base"), shade = session.model().part_named("shade");
    session.set_pinned(base, true);
    session.set_part(session.model().part_named("arm 1"), {.cells = Subdivision::kUniform, .cell_size = 0.04});
    const Vec3 grip = furthest_point(session.model(), shade, Vec3(-1, -2, -3));
    session.move_handle(session.add_handle(shade, grip), grip + Vec3(0.02, 0.05, -0.04));
    EXPECT_EQ(session.solve().status, PoseResult::Status::kConverged);
    std::vector<std::pair<std::array<double, 3>, Vec3>> cells;
    for (const PosedCell& c : session.cells())
      cells.push_back({{std::round(1e9 * c.rest.centre.x()), std::round(1e9 * c.rest.centre.y()),
                        std::round(1e9 * c.rest.centre.z())},
                       c.place});
    std::sort(cells.begin(), cells.end(), [](const auto& p, const auto& q) { return p.first < q.first; });
    return cells;
  };
  const auto one = dragged(false), other = dragged(true);
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_LT((one[i].second - other[i].second).norm(), 1e-8);
}

TEST(Drags, TheSameDragGivesTheSameBits) {
  const auto dragged = [] {
    Dragged d("lamp", true, 0.05);
    d.drag_to(d.grip + 0.3 * d.size * Vec3(0.3, 0.5, -0.8));
    return vertices_of(d.session);
  };
  EXPECT_EQ(dragged(), dragged());
}

}  // namespace
}  // namespace limber
