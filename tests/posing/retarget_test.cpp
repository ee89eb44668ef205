// Recorded motion onto models: where points ride, how a skeleton is laid onto a model, what is refused.
#include "limber/posing/retarget.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "limber/core/error.h"
#include "posed_models.h"

namespace limber {
namespace {

using ::testing::HasSubstr;

/// A trunk, an arm to the left and one to the right, each of one joint; y is up. Ten frames a second.
MotionClip clip_of(const std::vector<std::vector<RigidTransform>>& poses) {
  MotionClip out;
  out.joints = {{"hips", -1, {}}, {"left", 0, {{}, Vec3(10, 20, 0)}}, {"right", 0, {{}, Vec3(-10, 20, 0)}}};
  out.poses = poses;
  for (std::size_t f = 0; f < poses.size(); ++f) out.times.push_back(0.1 * static_cast<double>(f));
  return out;
}

std::vector<RigidTransform> at_rest(const RigidTransform& by) {
  return {by, by * RigidTransform{{}, Vec3(10, 20, 0)}, by * RigidTransform{{}, Vec3(-10, 20, 0)}};
}

/// A model of the same proportions, a hundredth as large, with z up, somewhere else.
const RigidTransform kLaid{quaternion_from_rotation_vector({0.5 * M_PI, 0, 0}), Vec3(3, 4, 5)};
Vec3 on_model(const Vec3& x) { return kLaid * Vec3(0.01 * x); }

MappingFile mapping_of() {
  MappingFile out;
  out.points = {
      {"hips", "a", on_model({0, 0, 0})}, {"left", "b", on_model({10, 20, 0})}, {"right", "c", on_model({-10, 20, 0})}};
  out.frame_rate = 10.0;
  return out;
}

TEST(Retarget, AtRestPointsAreWhereTheyAre) {
  const HandlesFile h = retarget(clip_of({at_rest({})}), mapping_of(), "m");
  ASSERT_EQ(h.frames.size(), 1u);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LT((h.frames[0].targets[i].second - mapping_of().points[i].point).norm(), 1e-12);
}

TEST(Retarget, AMotionOfAllIsThatOfTheModel) {
  const RigidTransform motion{quaternion_from_rotation_vector({0.3, -1.0, 0.2}), Vec3(5, -7, 11)};
  MappingFile m = mapping_of();
  const HandlesFile travels = retarget(clip_of({at_rest({}), at_rest(motion)}), m, "m");
  m.travels = false;
  const HandlesFile stays = retarget(clip_of({at_rest({}), at_rest(motion)}), m, "m");
  const std::vector<Vec3> rest{{0, 0, 0}, {10, 20, 0}, {-10, 20, 0}};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_LT((travels.frames[1].targets[i].second - on_model(motion * rest[i])).norm(), 1e-12);
    EXPECT_LT((stays.frames[1].targets[i].second - on_model(motion.q * rest[i])).norm(), 1e-12);
  }
}

TEST(Retarget, APointRidesOnItsJointWhereverTheModelHasIt) {
  MappingFile m = mapping_of();
  // Both arms reach further out than the clip's, alike, so that the skeleton lies as before but larger.
  const Vec3 further(5, 0, 0);
  m.points[1].point = on_model(Vec3(10, 20, 0) + further), m.points[2].point = on_model(Vec3(-10, 20, 0) - further);
  std::vector<RigidTransform> turned = at_rest({});
  const Quaternion turn = quaternion_from_rotation_vector({0, 0, 0.5 * M_PI});
  turned[1].q = turn * turned[1].q;  // the left joint turns in place
  const HandlesFile h = retarget(clip_of({at_rest({}), turned}), m, "m");
  EXPECT_LT((h.frames[1].targets[2].second - m.points[2].point).norm(), 1e-12);
  // The point moves on a circle about its joint: by √2 of its distance from it, across.
  const Vec3 moved = h.frames[1].targets[1].second - m.points[1].point;
  const Vec3 in_clip = kLaid.q.conjugate() * moved;
  EXPECT_NEAR(in_clip.z(), 0.0, 1e-12);
  EXPECT_GT(moved.norm(), 0.01);
}

TEST(Retarget, BetweenFramesItGoesTheShortestWay) {
  MappingFile m = mapping_of();
  m.frame_rate = 20.0;
  const RigidTransform turned{quaternion_from_rotation_vector({0, 0, 1.0}), Vec3::Zero()};
  const HandlesFile h = retarget(clip_of({at_rest({}), at_rest(turned)}), m, "m");
  ASSERT_EQ(h.frames.size(), 3u);
  EXPECT_NEAR(h.frames[1].time, 0.05, 1e-15);
  EXPECT_LT((h.frames[1].targets[0].second - m.points[0].point).norm(), 1e-12);
}

TEST(Retarget, ADollFollowsAsFarAsItsJointsLetIt) {
  // The humanoid's own joints turned: targets are what it can reach, so it reaches them.
  JointedModel model = testing::rigid_assembly("humanoid");
  for (ModelJoint& j : model.joints) j.joint.limits = {};
  PosingSession session(model);
  const double size = testing::size_of(model);
  MotionClip clip;
  MappingFile m;
  m.frame_rate = 10.0;
  const auto add = [&](const std::string& part, const Vec3& point) {
    clip.joints.push_back({part, clip.joints.empty() ? -1 : 0, {{}, point}});
    m.points.push_back({part, part, point});
  };
  for (const ModelPart& part : model.parts)
    add(part.name, testing::furthest_point(model, model.part_named(part.name), Vec3(0, 0, 1)));
  const Vec3 shoulder(-0.17, 0.0, 1.36);
  for (int f = 0; f < 5; ++f) {
    std::vector<RigidTransform> pose;
    const RigidTransform raised{quaternion_from_rotation_vector({0, 0.2 * f, 0}), Vec3::Zero()};
    for (const MotionClip::Joint& j : clip.joints) {
      const bool arm = j.name == "left arm" || j.name == "left forearm";
      pose.push_back(arm ? RigidTransform{{}, shoulder} * raised * RigidTransform{{}, -shoulder} * j.rest : j.rest);
    }
    clip.times.push_back(0.1 * f);
    clip.poses.push_back(pose);
  }
  const HandlesFile h = retarget(clip, m, "m");
  const auto ids = apply_handles(h, "m", session);
  for (const HandlesFile::Frame& frame : h.frames) {
    for (const auto& [i, target] : frame.targets) session.move_handle(ids[i], target);
    const PoseResult r = session.solve();
    EXPECT_EQ(r.status, PoseResult::Status::kConverged);
    EXPECT_LT(r.handle_error, 1e-6 * size);
    EXPECT_LT(r.joint_error, 1e-9);
  }
}

std::string message_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(Retarget, WhatDoesNotFitIsRefusedInOneLine) {
  const MotionClip clip = clip_of({at_rest({})});
  MappingFile m = mapping_of();
  m.points[1].joint = "lefd";
  EXPECT_THAT(message_of([&] { retarget(clip, m, "m"); }), HasSubstr("the nearest is \"left\""));
  m = mapping_of();
  for (auto& p : m.points) p.joint = "hips";
  EXPECT_THAT(message_of([&] { retarget(clip, m, "m"); }), HasSubstr("on one line"));
  m = mapping_of();
  m.begin = 1.0;
  EXPECT_THAT(message_of([&] { retarget(clip, m, "m"); }), HasSubstr("begin"));
}

TEST(MappingFile, SaysWhereItIsWrong) {
  const auto parse = [](const std::string& text) { return message_of([&] { parse_mapping(text, "m.json"); }); };
  const std::string p = R"({"joint": "a", "part": "b", "point": [0, 0, 0]})", three = p + "," + p + "," + p;
  EXPECT_EQ(parse(R"({"points": [)" + three + "]}"), "");
  EXPECT_THAT(parse(R"({"points": [)" + p + "]}"), HasSubstr("three or more"));
  EXPECT_THAT(parse(R"({"points": [)" + three + R"(], "frame_rate": 0})"), HasSubstr("frame_rate"));
  EXPECT_THAT(parse(R"({"points": [)" + three + R"(], "begin": -1})"), HasSubstr("begin"));
  EXPECT_THAT(parse(R"({"points": [)" + three + R"(], "begin": 2, "end": 1})"), HasSubstr("end"));
  EXPECT_THAT(parse(R"({"points": [)" + three + R"(], "travel": true})"), HasSubstr("travels"));
  EXPECT_THAT(parse(R"({"points": [{"joint": "a", "part": "b"}]})"), HasSubstr("point"));
}

}  // namespace
}  // namespace limber
