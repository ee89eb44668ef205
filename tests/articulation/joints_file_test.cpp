// The joints file: what is written comes back, what is wrong is told in one line, what a user edited stays.
#include "limber/articulation/joints_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <numbers>

#include "constants.h"
#include "limber/core/error.h"
#include "parts.h"

namespace limber {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using testing::kInfinity;

JointSpec spec_of(JointType type) {
  JointSpec joint{.type = type};
  joint.frame.origin = {0.1, -2.0 / 3.0, 1e-17};
  joint.frame.axes = to_matrix(quaternion_from_rotation_vector({0.3, -1.2, 0.7}));
  return joint;
}

/// One joint of every type, with limits of every kind.
JointsFile everything() {
  JointsFile file;
  for (Index i = 0; i < 8; ++i)
    file.components.push_back({"part \"" + std::to_string(i) + "\" é", {{10 * i, 4}, {10 * i + 5, 5}}});
  const auto add = [&](JointType type, auto&& change) {
    JointRecord j{.a = 0, .b = static_cast<Index>(file.joints.size() + 1), .joint = spec_of(type)};
    change(j);
    file.joints.push_back(j);
  };
  add(JointType::kBall, [](JointRecord& j) {
    j.joint.limits.cone = 0.7;
    j.joint.limits.euler = {Interval{}, Interval{-0.3, 1.0 / 3.0}, Interval{-kInfinity, 1}};
  });
  add(JointType::kRevolute, [](JointRecord& j) {
    j.joint.limits.rotation = {-std::numbers::pi, kInfinity};
    j.alternatives = {{spec_of(JointType::kPlanar), 0.25, "A plate lies on a plate."}};
    j.reasons = {"One.", "Two \\ lines\nare one."};
    j.confidence = 0.625;
  });
  add(JointType::kCylindrical, [](JointRecord& j) { j.joint.pitch = -0.001; });
  add(JointType::kPrismatic, [](JointRecord& j) { j.joint.limits.translation[0] = {0.0, 0.0}; });
  add(JointType::kPlanar, [](JointRecord& j) { j.joint.limits.translation[1] = {-1.0, 2.0}; });
  add(JointType::kFixed, [](JointRecord&) {});
  add(JointType::kRevolute, [](JointRecord& j) { j.limits_known = false; });
  return file;
}

TEST(JointsFile, WhatIsWrittenIsReadBackToTheBit) {
  const JointsFile file = everything();
  const std::string text = joints_text(file);
  const JointsFile back = parse_joints(text, "\"x.json\"");
  ASSERT_EQ(back.joints.size(), file.joints.size());
  for (std::size_t j = 0; j < file.joints.size(); ++j) {
    EXPECT_EQ(back.joints[j].joint.type, file.joints[j].joint.type);
    EXPECT_EQ(back.joints[j].joint.frame.origin, file.joints[j].joint.frame.origin);
    EXPECT_EQ(back.joints[j].joint.frame.axes, file.joints[j].joint.frame.axes) << j;
    EXPECT_EQ(back.joints[j].joint.limits, file.joints[j].joint.limits) << j;
    EXPECT_EQ(back.joints[j].joint.pitch, file.joints[j].joint.pitch);
    EXPECT_EQ(back.joints[j].limits_known, file.joints[j].limits_known);
    EXPECT_EQ(back.joints[j].reasons, file.joints[j].reasons);
  }
  EXPECT_EQ(back.components[3].faces, file.components[3].faces);
  EXPECT_EQ(joints_text(back), text);
}

TEST(JointsFile, HasTheMembersThatOtherProgramsExpect) {
  const auto json = nlohmann::json::parse(joints_text(everything()));
  const auto& joints = json.at("joints");
  EXPECT_EQ(json.at("components").at(1).at("faces"), nlohmann::json::parse("[[10,4],[15,5]]"));
  EXPECT_TRUE(joints.at(0).at("axis").is_null());
  EXPECT_EQ(joints.at(0).at("limits").at("cone"), 0.7);
  EXPECT_TRUE(joints.at(0).at("limits").at("euler").at(2).at(0).is_null());
  EXPECT_EQ(joints.at(1).at("limits").at("rotation").at(0), -std::numbers::pi);
  EXPECT_TRUE(joints.at(1).at("limits").at("rotation").at(1).is_null());
  EXPECT_TRUE(joints.at(2).at("limits").is_null());
  EXPECT_EQ(joints.at(2).at("pitch"), -0.001);
  EXPECT_EQ(joints.at(4).at("limits").at("translation").size(), 2u);
  // Row after row; the axis is the first column, of a planar joint the third.
  const Mat3 axes = everything().joints[0].joint.frame.axes;
  EXPECT_EQ(joints.at(1).at("frame").at(1), axes(0, 1));
  EXPECT_EQ(joints.at(1).at("axis").at(2), axes(2, 0));
  EXPECT_EQ(joints.at(4).at("axis").at(0), axes(0, 2));
}

/// A small file that is right, and what is wrong with variants of it.
constexpr const char* kSmall =
    R"({"components": [{"name": "base", "faces": [[0, 12]]}, {"name": "lid", "faces": [[12, 12]]}],
 "joints": [{"a": 0, "b": 1, "type": "revolute", "origin": [0, 0, 1], "axis": [0, 0, 2], "limits": {"rotation": [0, 1.5]}}]})";

std::string changed(const std::string& what, const std::string& by) {
  std::string text = kSmall;
  const auto at = text.find(what);
  if (at == std::string::npos) std::abort();
  return text.replace(at, what.size(), by);
}

TEST(JointsFile, AnAxisIsEnoughAndWinsOverTheFrame) {
  const JointSpec joint = parse_joints(kSmall, "x").joints[0].joint;
  EXPECT_EQ(joint.frame.axes.col(0), Vec3::UnitZ());
  EXPECT_NO_THROW(joint.validate());
  const std::string both =
      changed("\"axis\": [0, 0, 2]", "\"axis\": [-1, 0, 0], \"frame\": [1, 0, 0, 0, 1, 0, 0, 0, 1]");
  const JointSpec turned = parse_joints(both, "x").joints[0].joint;
  EXPECT_EQ(turned.frame.axes.col(0), -Vec3::UnitX());
  EXPECT_NO_THROW(turned.validate());
}

TEST(JointsFile, WhatIsWrongIsToldInOneLineWithItsPlace) {
  const std::vector<std::array<std::string, 3>> wrong{
      {"\"revolute\"", "\"hinge\"", "joints[0].type: is \"hinge\""},
      {"[0, 1.5]", "[2, 1.5]", "limits.rotation: is [2,1.5]"},
      {"[0, 1.5]", "[0]", "limits.rotation: is [0]"},
      {"[0, 1.5]", "[0, \"far\"]", "limits.rotation[1]: is \"far\""},
      {"{\"rotation\": [0, 1.5]}", "{\"cone\": 1}", "a revolute joint has no such limit"},
      {"[0, 0, 2]", "[0, 0, 0]", "joints[0].axis: is [0, 0, 0]"},
      {"[0, 0, 2]", "null", "joints[0].axis"},
      {"\"b\": 1", "\"b\": 2", "joints[0].b: is 2"},
      {"\"b\": 1", "\"b\": 0", "another component"},
      {"\"axis\": [0, 0, 2]", "\"axes\": [0, 0, 2]", "\"axis\" is missing"},
      {"\"b\": 1", "\"b\": 1, \"pitch\": 0.1", "has no pitch"},
      {"\"b\": 1", "\"b\": 1, \"confidence\": 2", "confidence: is 2"},
      {"\"b\": 1", "\"b\": 1, \"frame\": [1, 0, 0, 0, 1, 0, 0, 0, -1]", "frame: its columns"},
      {"\"b\": 1", "\"b\": 1, \"colour\": 1", "\"colour\" is unknown"},
      {"[[12, 12]]", "[[11, 12]]", "face 11 belongs to \"base\" and to \"lid\""},
      {"[[12, 12]]", "[[12, 0]]", "faces[0]: is [12,0]"},
      {"[[12, 12]]", "[[12, 3000000000]]", "faces[0]"},
      {"[[12, 12]]", "[]", "at least one range"},
      {"\"lid\"", "\"base\"", "\"base\" stands twice"},
      {"\"lid\"", "\"\"", "components[1].name"},
      {"\"joints\": [", "\"joints\": [5, ", "joints[0]: is 5"},
      {"\"joints\"", "\"joint\"", "\"joints\" is missing"},
      {"}]}", "}]", "not valid JSON"},
  };
  for (const auto& [what, by, message] : wrong) {
    try {
      parse_joints(changed(what, by), "\"lamp.json\"");
      ADD_FAILURE() << by << " was accepted";
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), ::testing::StartsWith("\"lamp.json\"")) << by;
      EXPECT_THAT(e.what(), HasSubstr(message));
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  }
}

TEST(JointsFile, AFrameThatIsNoneIsNotWritten) {
  JointsFile file = everything();
  file.joints[1].joint.frame.axes *= 2.0;
  EXPECT_THROW(joints_text(file), InvalidArgument);
}

Assembly three_boxes() {
  Assembly assembly;
  for (Index i = 0; i < 3; ++i)
    assembly.components.push_back({.name = "part " + std::to_string(i + 1),
                                   .faces = {{12 * i, 12}},
                                   .triangles = {},
                                   .surface = shapes::box({2.0 * i, 0, 0}, {2.0 * i + 1, 1, 1})});
  return assembly;
}

DetectedJoint detected(Index a, Index b, JointType type) {
  DetectedJoint j;
  j.a = a, j.b = b;
  j.joint.type = type;
  j.confidence = 0.5;
  return j;
}

TEST(KeptFile, MergedAndRenamedPartsAreFoundAgain) {
  JointsFile kept;
  kept.components = {{"base", {{0, 12}, {24, 12}}}, {"part 2", {{12, 12}}}};
  const ComponentOptions options = kept_components(three_boxes(), kept, "\"k\"");
  EXPECT_THAT(options.merge, ElementsAre(ElementsAre("part 1", "part 3")));
  EXPECT_THAT(options.rename, ElementsAre(std::pair<std::string, std::string>("part 1", "base")));
}

TEST(KeptFile, APartThatIsSplitOrNotThereIsRefused) {
  JointsFile kept;
  kept.components = {{"half", {{0, 6}}}, {"other half", {{6, 6}}}};
  EXPECT_THROW(kept_components(three_boxes(), kept, "\"k\""), InputError);
  kept.components = {{"half", {{0, 6}}}};
  EXPECT_THROW(kept_components(three_boxes(), kept, "\"k\""), InputError);
  kept.components = {{"ghost", {{100, 6}}}};
  EXPECT_THROW(kept_components(three_boxes(), kept, "\"k\""), InputError);
}

TEST(KeptFile, EditedJointsStayDroppedOnesStayAwayNewOnesCome) {
  const Assembly assembly = three_boxes();
  JointsFile kept;
  kept.components = {{"part 2", {{12, 12}}}, {"part 1", {{0, 12}}}};  // another order than the model's
  JointRecord edited{.a = 1, .b = 0, .joint = spec_of(JointType::kPrismatic)};
  edited.joint.limits.translation[0] = {-1, 2};
  kept.joints = {edited};
  std::vector<DetectedJoint> joints{detected(0, 1, JointType::kRevolute), detected(1, 2, JointType::kBall)};
  EXPECT_THAT(keep_joints(assembly, kept, "\"k\"", joints), ElementsAre(true, false));
  ASSERT_EQ(joints.size(), 2u);
  EXPECT_EQ(joints[0].joint.type, JointType::kPrismatic);
  EXPECT_EQ(joints[0].joint.limits.translation[0], (Interval{-1, 2}));
  EXPECT_EQ(joints[0].a, 0);
  EXPECT_EQ(joints[0].confidence, 0.5);
  EXPECT_THAT(joints[0].reasons.back(), HasSubstr("says prismatic; found was revolute"));
  EXPECT_EQ(joints[1].joint.type, JointType::kBall);

  kept.components.push_back({"part 3", {{24, 12}}});
  kept.joints[0].limits_known = false;
  joints = {detected(0, 1, JointType::kRevolute), detected(1, 2, JointType::kBall)};
  EXPECT_THAT(keep_joints(assembly, kept, "\"k\"", joints), ElementsAre(false));

  joints.clear();
  EXPECT_EQ(keep_joints(assembly, kept, "\"k\"", joints).size(), 1u);
  EXPECT_THAT(joints[0].reasons, ElementsAre(HasSubstr("Added")));

  kept.components[0].name = "nobody";
  EXPECT_THROW(keep_joints(assembly, kept, "\"k\"", joints), InputError);
}

}  // namespace
}  // namespace limber
