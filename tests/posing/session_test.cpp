// The session: editing while it is posed, undo, what is refused; the skin.
#include "limber/posing/posing_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "limber/core/error.h"
#include "limber/posing/posed_model.h"
#include "posed_models.h"

namespace limber {
namespace {

using namespace testing;

class Lamp : public ::testing::Test {
 protected:
  Lamp() {
    session_.set_pinned(part("base"), true);
    handle_ = session_.add_handle(part("shade"), tip_);
  }
  Index part(const std::string& name) const { return session_.model().part_named(name); }
  PoseResult drag(const Vec3& by) {
    session_.move_handle(handle_, tip_ + by);
    return session_.solve();
  }

  PosingSession session_{assembly_model("lamp")};
  double size_ = size_of(session_.model());
  Vec3 tip_ = furthest_point(session_.model(), session_.model().part_named("shade"), Vec3(-1, -2, -3));
  PoseHandle handle_{};
};

TEST_F(Lamp, StandsAtRestUntilItIsPulled) {
  EXPECT_LT(largest_distance(vertices_of(session_), session_.model().surface.vertices), 1e-15 * size_);
  const PoseResult r = session_.solve();
  EXPECT_EQ(r.status, PoseResult::Status::kConverged);
  EXPECT_EQ(r.iterations, 1);
  EXPECT_LT(largest_distance(vertices_of(session_), session_.model().surface.vertices), 1e-9 * size_);
}

TEST_F(Lamp, APartThatBecomesSoftKeepsItsPlaceAndBackAgain) {
  drag({0.03, 0.05, -0.06});
  const auto before = vertices_of(session_);
  session_.set_part(part("arm 1"), {.cells = Subdivision::kUniform, .cell_size = 0.03});
  EXPECT_LT(largest_distance(before, vertices_of(session_)), 1e-6 * size_);  // the skin is in single precision now
  EXPECT_LT(session_.solve().energy, 1e-16);
  session_.set_part(part("arm 1"), {});
  EXPECT_LT(largest_distance(before, vertices_of(session_)), 1e-6 * size_);
}

TEST_F(Lamp, AModelWithOtherNamesKeepsItsPose) {
  drag({0.03, 0.05, -0.06});
  const auto before = vertices_of(session_);
  JointedModel model = session_.model();
  std::vector<Index> was(model.parts.size());
  std::iota(was.begin(), was.end(), Index{0});
  model.parts[static_cast<std::size_t>(part("shade"))].name = "hood";
  session_.set_model(model, was);
  EXPECT_LT(largest_distance(before, vertices_of(session_)), 1e-14 * size_);
  EXPECT_TRUE(session_.pinned(part("base")) && session_.contains(handle_));
  EXPECT_EQ(session_.solve().status, PoseResult::Status::kConverged);
  EXPECT_LT(largest_distance(before, vertices_of(session_)), 1e-6 * size_);
  EXPECT_THROW(session_.set_model(model, std::span(was).first(1)), InvalidArgument);
  was.back() = 99;
  EXPECT_THROW(session_.set_model(model, was), InvalidArgument);
  model.parts.front().name = "hood";
  EXPECT_THROW(session_.set_model(model, was), InvalidArgument);
  EXPECT_TRUE(session_.undo());
  EXPECT_NO_THROW(part("shade"));
}

TEST_F(Lamp, AJointThatBecomesFixedTurnsNoMore) {
  Index joint = 0;
  while (session_.model().joints[static_cast<std::size_t>(joint)].b != part("shade")) ++joint;
  const JointSpec before = session_.model().joints[static_cast<std::size_t>(joint)].joint;
  JointSpec fixed = before;
  fixed.type = JointType::kFixed;
  fixed.limits = {};
  session_.set_joint(joint, fixed);
  drag({0.03, 0.05, -0.06});
  const auto cells = session_.cells();
  const auto turn_of = [&](Index p) {
    return std::find_if(cells.begin(), cells.end(), [&](const PosedCell& c) { return c.part == p; })->rotation;
  };
  EXPECT_LT((turn_of(part("shade")) - turn_of(session_.model().joints[static_cast<std::size_t>(joint)].a)).norm(),
            1e-12);
  session_.set_joint(joint, before);
  const auto pose = vertices_of(session_);
  EXPECT_LT(session_.solve().energy, 1e-12);
  EXPECT_LT(session_.joint(joint).error, 1e-9);
  EXPECT_LT(largest_distance(pose, vertices_of(session_)), 0.2 * size_);
}

TEST_F(Lamp, LimitsThatAreNarrowedAreMetByTheNextPose) {
  drag({0.05, 0.05, -0.1});
  for (Index j = 0; j < 4; ++j) {
    JointSpec spec = session_.model().joints[static_cast<std::size_t>(j)].joint;
    if (spec.type != JointType::kRevolute) continue;
    spec.limits.rotation = {-0.02, 0.02};
    session_.set_joint(j, spec);
  }
  EXPECT_NE(session_.solve().status, PoseResult::Status::kInfeasible);
  for (Index j = 0; j < 4; ++j)
    if (session_.model().joints[static_cast<std::size_t>(j)].joint.type == JointType::kRevolute) {
      EXPECT_LT(std::abs(session_.joint(j).coordinates[0]), 0.02 + 1e-9);
    }
}

TEST_F(Lamp, UndoTakesBackOneChangeAtATime) {
  const auto rest = vertices_of(session_);
  for (int i = 1; i <= 5; ++i) drag(0.01 * i * Vec3(1, 1, -1));
  const auto dragged = vertices_of(session_);
  session_.set_part(part("arm 1"), {.cells = Subdivision::kUniform, .cell_size = 0.03});
  session_.solve();
  ASSERT_TRUE(session_.undo());  // the soft arm
  EXPECT_EQ(session_.part_options(part("arm 1")).cells, Subdivision::kRigid);
  EXPECT_EQ(vertices_of(session_), dragged);
  ASSERT_TRUE(session_.undo());  // the whole drag
  EXPECT_EQ(vertices_of(session_), rest);
  ASSERT_TRUE(session_.undo());  // the handle
  EXPECT_THROW(session_.move_handle(handle_, tip_), InvalidArgument);
  ASSERT_TRUE(session_.undo());  // the pin
  EXPECT_FALSE(session_.undo());
}

TEST_F(Lamp, ContradictionsAreToldAndLeaveThePose) {
  drag({0.02, 0.02, -0.02});
  const auto before = vertices_of(session_);
  session_.set_pinned(part("shade"), true);
  JointSpec spec = session_.model().joints[0].joint;
  spec.frame.origin += Vec3(0, 0, 0.05);
  for (Index p = 0; p < 5; ++p) session_.set_pinned(p, true);
  for (Index j = 0; j < 4; ++j) {
    JointSpec limited = session_.model().joints[static_cast<std::size_t>(j)].joint;
    limited.limits.rotation = {1.0, 1.1};
    if (limited.type == JointType::kRevolute) session_.set_joint(j, limited);
  }
  EXPECT_EQ(session_.solve().status, PoseResult::Status::kInfeasible);
  EXPECT_EQ(vertices_of(session_), before);
}

TEST_F(Lamp, WhatIsNotThereIsRefusedAndChangesNothing) {
  EXPECT_THROW(session_.add_handle(7, tip_), InvalidArgument);
  EXPECT_THROW(session_.add_handle(part("shade"), Vec3(9, 9, 9)), InvalidArgument);
  EXPECT_THROW(session_.add_handle(part("shade"), Vec3(0, 0, std::nan(""))), InvalidArgument);
  EXPECT_THROW(session_.move_handle(handle_, Vec3(0, INFINITY, 0)), InvalidArgument);
  EXPECT_THROW(session_.move_handle({99}, tip_), InvalidArgument);
  EXPECT_THROW(session_.set_pinned(-1, true), InvalidArgument);
  EXPECT_THROW(session_.set_part(0, {.stiffness = 0.0}), InvalidArgument);
  EXPECT_THROW(session_.set_joint(4, {}), InvalidArgument);
  EXPECT_THROW((void)session_.model().part_named("shades"), InvalidArgument);
  std::vector<Vec3> few(3);
  EXPECT_THROW(session_.reconstruct(few), InvalidArgument);
  ASSERT_TRUE(session_.undo());
  ASSERT_TRUE(session_.undo());
  EXPECT_FALSE(session_.undo());  // the pin and the handle were all
}

// The same machine, told from another pose: the same places are reached, and the same limits.
TEST(PosedModel, GoesOnFromWhereItStands) {
  for (const char* name : {"lamp", "drawer", "screw", "telescope", "sliding plate", "door"}) {
    JointedModel model = rigid_assembly(name);
    const auto last = static_cast<Index>(model.parts.size()) - 1;
    const double size = size_of(model);
    PosingSession first(model);
    first.set_pinned(0, true);
    const Vec3 grip = furthest_point(model, last, furthest_point(model, 0, Vec3::Zero()));
    const PoseHandle hand = first.add_handle(last, grip);
    first.move_handle(hand, grip + 0.05 * size * Vec3(0.3, 0.5, -0.8));
    const PoseResult found = first.solve();  // only the lamp's hand can go where it is led
    ASSERT_EQ(found.status,
              found.handle_error < 1e-6 * size ? PoseResult::Status::kConverged : PoseResult::Status::kLocalMinimum)
        << name;

    Warnings warnings;
    const JointedModel posed = posed_model(first, warnings);
    EXPECT_LT(largest_distance(posed.surface.vertices, vertices_of(first)), 1e-15);
    PosingSession second(posed);
    second.set_pinned(0, true);
    const PoseHandle again = second.add_handle(last, first.handle_point(hand));
    const Vec3 far = grip + 3.0 * size * Vec3(-0.2, 0.4, 0.5);
    first.move_handle(hand, far);
    second.move_handle(again, far);
    first.solve();
    second.solve();
    for (std::size_t j = 0; j < posed.joints.size(); ++j) {
      const PosedJoint p = second.joint(static_cast<Index>(j));
      EXPECT_LT(p.error, 1e-9) << name;
      const Interval& limit = posed.joints[j].joint.limits.translation[0];
      if (posed.joints[j].joint.type == JointType::kPrismatic) {
        EXPECT_LT(std::max(limit.low - p.coordinates[0], p.coordinates[0] - limit.high), 1e-9);
        // In the model's first frame it has gone as far as the first session's.
        EXPECT_NEAR((p.frame.origin - first.joint(static_cast<Index>(j)).frame.origin).norm(), 0.0, 1e-6 * size)
            << name;
      }
    }
    const JointsFile file = joints_file(posed);
    EXPECT_EQ(joints_text(parse_joints(joints_text(file), name)), joints_text(file));
    GroupedSurface surface;
    surface.surface = posed.surface;
    surface.face_of.resize(posed.surface.triangles.size());
    std::iota(surface.face_of.begin(), surface.face_of.end(), 0);
    const JointedModel read = jointed_model(surface, file, name);
    for (std::size_t p = 0; p < read.parts.size(); ++p) EXPECT_EQ(read.parts[p].triangles, posed.parts[p].triangles);
  }
}

TEST(PosedModel, ABallThatHasTurnedSaysThatItsLimitsAreLeftOpen) {
  PosingSession session(rigid_assembly("lamp"));
  const Index shade = session.model().part_named("shade");
  session.set_pinned(0, true);
  for (std::size_t j = 0; j < session.model().joints.size(); ++j) {
    JointSpec spec = session.model().joints[j].joint;
    if (spec.type == JointType::kBall) spec.limits.cone = 1.0, session.set_joint(static_cast<Index>(j), spec);
  }
  const Vec3 tip = furthest_point(session.model(), shade, Vec3(-1, -2, -3));
  const PoseHandle hand = session.add_handle(shade, tip);
  Warnings none, some;
  posed_model(session, none);
  EXPECT_TRUE(none.empty());
  session.move_handle(hand, tip + Vec3(0.02, 0.04, 0.01));
  session.solve();
  const JointedModel posed = posed_model(session, some);
  EXPECT_EQ(some.size(), 1u);
  for (const ModelJoint& joint : posed.joints)
    if (joint.joint.type == JointType::kBall) {
      EXPECT_EQ(joint.joint.limits, JointLimits{});
    }
}

TEST(Skin, NothingBleedsAcrossAJoint) {
  PosingSession session(assembly_model("lamp"));
  const Index arm = session.model().part_named("arm 1");
  for (Index p = 0; p < 5; ++p)
    if (p != arm) session.set_pinned(p, true);
  const auto rest = vertices_of(session);
  session.set_part(arm, {.cells = Subdivision::kUniform, .cell_size = 0.02});
  const auto soft = vertices_of(session);
  for (Index p = 0; p < 5; ++p)
    for (const Index t : session.model().parts[static_cast<std::size_t>(p)].triangles)
      for (const Index v : session.model().surface.triangles[static_cast<std::size_t>(t)])
        if (p != arm) {
          EXPECT_EQ(soft[static_cast<std::size_t>(v)], rest[static_cast<std::size_t>(v)]);
        }
}

TEST(Skin, ABarBentToACircleKeepsItsSections) {
  PosingSession session(single_part(bar_surface(8.0, 1.0, 16)));
  session.set_part(0, {.cells = Subdivision::kUniform, .cell_size = 0.5});
  for (const double y : {-0.5, 0.5}) {
    for (const double z : {-0.5, 0.5}) session.add_handle(0, {0.0, y, z});
    for (const double z : {-0.5, 0.5}) {
      // The end turned by 1 rad about z, where a bar that bends to a circle of radius 8 has it.
      const double sine = std::sin(1.0), cosine = std::cos(1.0);
      session.move_handle(session.add_handle(0, {8.0, y, z}), Vec3((8.0 - y) * sine, 8.0 - (8.0 - y) * cosine, z));
    }
  }
  EXPECT_EQ(session.solve().status, PoseResult::Status::kConverged);
  const auto now = vertices_of(session);
  for (std::size_t i = 0; i < now.size(); i += 4) {
    EXPECT_NEAR((now[i] - now[i + 1]).norm(), 1.0, 0.05);  // a side of its section
    const Vec3 middle = 0.25 * (now[i] + now[i + 1] + now[i + 2] + now[i + 3]);
    EXPECT_NEAR((middle - Vec3(0, 8, 0)).norm(), 8.0, 0.1);
  }
}

TEST(Skin, NormalsAreUnitAndOutward) {
  PosingSession session(single_part(shapes::sphere(Vec3::Zero(), 1.0, 2)));
  std::vector<Vec3> p(session.model().surface.vertices.size()), n(p.size());
  session.reconstruct(p, n);
  for (std::size_t i = 0; i < p.size(); ++i) EXPECT_GT(n[i].dot(p[i].normalized()), 0.99);
}

}  // namespace
}  // namespace limber
