#include "limber/articulation/detect_joints.h"
#include "asked.h"

#include <gtest/gtest.h>

#include <numbers>

#include "assemblies.h"
#include "grouped_parts.h"
#include "joint_scores.h"
#include "limber/core/error.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "shells.h"

namespace limber {
namespace {

using assemblies::MadeAssembly;
using assemblies::make;
using assemblies::taken_apart;
using assemblies::Variant;

/// Under sanitizers one assembly for each way in which joints are read.
std::vector<std::string> all_names() {
  if (testing::kSanitized) return {"brush arm", "drawer", "sliding plate", "screw", "drop link"};
  auto names = assemblies::tuning_names();
  const auto& more = assemblies::held_out_names();
  names.insert(names.end(), more.begin(), more.end());
  return names;
}

/// Fewer samples than by default: quick, and harder.
DetectionOptions quick() {
  DetectionOptions out;
  out.contact.samples = 1500;
  return out;
}

std::vector<DetectedJoint> joints_of(const MadeAssembly& made) {
  TbbJobs jobs;
  return detect_joints(taken_apart(made), quick(), jobs);
}

struct Share {
  int all = 0, right = 0, extra = 0;
  double axis = 0.0, origin = 0.0;  ///< worst of those read right
  std::string wrong;
};

/// What docs/joints.md says of a class of variants: every joint is right, none is found where there is none, and the
/// worst errors are as told there. Those are rounded to the nearest, so half a unit of their last digit is allowed.
struct Claim {
  double axis = 0.02, axis_digit = 0.01;      ///< degrees
  double origin = 4e-5, origin_digit = 1e-5;  ///< of the diagonal
};

void expect_claimed(const Share& share, const Claim& claim, const std::string& where) {
  EXPECT_EQ(share.right, share.all) << where << ": " << share.wrong;
  EXPECT_EQ(share.extra, 0) << where << ": " << share.wrong;
  EXPECT_LT(share.axis, claim.axis + 0.5 * claim.axis_digit) << where;
  EXPECT_LT(share.origin, claim.origin + 0.5 * claim.origin_digit) << where;
}

/// With the options that docs/joints.md is about: the defaults.
Share share_right(const std::vector<std::string>& names, const Variant& variant, bool with_balls = true) {
  Share out;
  TbbJobs jobs;
  for (const std::string& name : names) {
    const auto score = assemblies::scored(make(name, variant), {}, jobs);
    for (const auto& joint : score.joints) {
      if (!with_balls && joint.truth == static_cast<int>(JointType::kBall)) continue;
      ++out.all;
      if (joint.right()) {
        ++out.right;
        out.axis = std::max(out.axis, joint.axis_error);
        out.origin = std::max(out.origin, joint.origin_error);
      } else {
        out.wrong += name + ": " + joint.name + "; ";
      }
    }
    for (const auto& extra : score.extra) out.wrong += name + ": " + extra + "; ";
    out.extra += static_cast<int>(score.extra.size());
  }
  return out;
}

// The drawings themselves: what else would the truth be worth?
TEST(Assemblies, EveryShellIsClosedAndLooksOutward) {
  for (const std::string& name : all_names()) {
    const Assembly assembly = find_components(make(name, {.segments = 8, .clearance = 0.005}).surface);
    for (const Component& c : assembly.components) {
      EXPECT_TRUE(c.closed) << name << ": " << c.name;
      EXPECT_GT(enclosed_volume(c.surface), 0.0) << name << ": " << c.name;
    }
  }
}

TEST(DetectJoints, AllTypesAreRightAt32Segments) {
  for (const double clearance : testing::all_or_first<double>({0.005, 0.0}))
    expect_claimed(share_right(all_names(), {.segments = 32, .clearance = clearance}), {},
                   "gap " + std::to_string(clearance));
}

TEST(DetectJoints, WideBearingsAndOverlappingPartsAreReadToo) {
  for (const double clearance : testing::all_or_first<double>({-0.005, 0.02, -0.01}))
    expect_claimed(share_right(all_names(), {.segments = 32, .clearance = clearance}), {.origin = 5e-5},
                   "gap " + std::to_string(clearance));
}

TEST(DetectJoints, CoarseMeshesAreReadByTheirNormals) {
  for (const double clearance : testing::all_or_first<double>({0.02, 0.0, 0.005, -0.005}))
    expect_claimed(share_right(all_names(), {.segments = 16, .clearance = clearance}),
                   {.axis = 0.05, .origin = 2e-4, .origin_digit = 1e-4}, "16, gap " + std::to_string(clearance));
  for (const double clearance : testing::all_or_first<double>({0.0, 0.005}))
    expect_claimed(share_right(all_names(), {.segments = 8, .clearance = clearance}, false),
                   {.axis = 0.07, .origin = 2e-4, .origin_digit = 1e-4}, "8, gap " + std::to_string(clearance));
}

// All but those that docs/joints.md names: parts whose bearings are a few jitters wide.
TEST(DetectJoints, NoiseOfAThousandthOfEachPartIsBorne) {
  auto names = all_names();
  std::erase_if(names, [](const std::string& name) { return name == "door" || name == "scissors" || name == "chair"; });
  for (const double clearance : testing::all_or_first<double>({0.0, 0.005}))
    expect_claimed(share_right(names, {.segments = 32, .clearance = clearance, .jitter = 1e-3}),
                   {.axis = 0.92, .origin = 5e-4, .origin_digit = 1e-4}, "gap " + std::to_string(clearance));
}

TEST(DetectJoints, NoiseOfThreeTenThousandthsOfEachPartLosesNoJoint) {
  expect_claimed(share_right(all_names(), {.segments = 32, .clearance = 0.005, .jitter = 3e-4}),
                 {.axis = 0.42, .origin = 1e-4, .origin_digit = 1e-4}, "jitter");
}

TEST(DetectJoints, SoupAndOpenShellsAreReadLikeSolids) {
  expect_claimed(share_right(all_names(), {.soup = true}), {.origin = 5e-5}, "soup");
  expect_claimed(share_right(all_names(), {.clearance = 0.005, .open = true}), {.origin = 5e-5}, "open");
}

TEST(DetectJoints, BeadsThatTouchAtAPointMakeNoJoint) {
  for (const int segments : testing::all_or_first<int>({16, 8, 32, 64}))
    EXPECT_TRUE(joints_of(make("snake", {.segments = segments})).empty());
}

// Against the same parts as they stood before, not against the truth: what a method adds of its own. The wheel of the
// dovetail turns on a short shaft with a cone at its end, which tells its axis from few and coarse facets.
TEST(DetectJoints, PoseScaleAndOrderChangeNoTypeAndNoAxis) {
  TbbJobs jobs;
  for (const std::string name : {"brush arm", "stack", "piston", "dovetail"})
    for (const int segments : testing::all_or_first<int>({16, 32}))
      for (const double scale : testing::all_or_first<double>({1e-3, 1e3})) {
        const Variant still{.segments = segments, .clearance = 0.005};
        Variant moved = still;
        moved.rotation = Eigen::AngleAxisd(1.1, Vec3(1, -2, 0.5).normalized()).toRotationMatrix();
        moved.shuffled = moved.swapped = true;
        moved.scale = scale;
        moved.translation = scale * Vec3(5, -3, 2);
        const assemblies::Change change =
            assemblies::change_of_joints(make(name, still), make(name, moved), moved.rotation, quick(), jobs);
        EXPECT_GT(change.joints, 0) << name;
        EXPECT_EQ(change.types, 0) << name;
        EXPECT_LT(change.axis, 0.05) << name << segments << ", " << change.worst;
      }
}

// What is symmetric is sampled symmetrically: a shaft in its sleeve has its samples' middle on its axis to round-off,
// though no facet is sampled finely.
TEST(ContactRegions, SamplesOfARoundContactBalanceAboutItsAxis) {
  for (const double angle : {0.0, 1.1}) {
    const Mat3 R = Eigen::AngleAxisd(angle, Vec3(1, -2, 0.5).normalized()).toRotationMatrix();
    GroupedSurface input;
    append_group(assemblies::lathe({{1.01, -1}, {2, -1}, {2, 1}, {1.4, 1}}, 12).placed(R, Vec3::Zero()), "sleeve",
                 input);
    append_group(assemblies::lathe({{0, -2}, {1, -1}, {1.39, 1}, {0, 1}}, 12).placed(R, Vec3::Zero()), "shaft", input);
    const auto regions = find_contact_regions(find_components(input), {.samples = 500});
    ASSERT_EQ(regions.size(), 1u);
    for (const auto* side : {&regions[0].on_a, &regions[0].on_b}) {
      ASSERT_GT(side->size(), 100u);
      Vec3 sum = Vec3::Zero();
      double area = 0.0;
      for (const ContactSample& s : *side) sum += s.area * (R.transpose() * s.point), area += s.area;
      EXPECT_LT((sum / area).head<2>().norm(), 1e-9) << angle;
    }
  }
}

// Interpolated normals of a coarse cone lean by degrees, to both sides alike: over a whole turn nothing is left of it.
TEST(DetectJoints, ACoarseWheelOnAConeTurnsAboutItsTrueAxis) {
  for (const int segments : testing::all_or_first<int>({8, 16, 32}))
    for (const double clearance : {0.0, 0.005, 0.02}) {
      const Share share = share_right({"dovetail"}, {.segments = segments, .clearance = clearance});
      EXPECT_EQ(share.right, share.all) << share.wrong;
      EXPECT_LT(share.axis, 0.02) << segments << ", " << clearance;
    }
}

/// Adds a part that is one or more shells.
void add_part(const std::string& name, const std::vector<assemblies::Shell>& shells, GroupedSurface& input) {
  const auto before = static_cast<Index>(input.surface.triangles.size());
  for (const assemblies::Shell& shell : shells) {
    const auto offset = static_cast<Index>(input.surface.vertices.size());
    input.surface.vertices.insert(input.surface.vertices.end(), shell.vertices.begin(), shell.vertices.end());
    for (const Triangle& t : shell.triangles) {
      input.face_of.push_back(static_cast<Index>(input.face_of.size()));
      input.surface.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    }
  }
  input.groups.push_back({name, "", before, static_cast<Index>(input.surface.triangles.size()) - before});
}

TEST(DetectJoints, AShaftDrawnThroughASolidBlockTurnsAndSlides) {
  GroupedSurface input;
  add_part("block", {assemblies::box({-1, -1, -0.5}, {1, 1, 0.5})}, input);
  add_part("shaft", {assemblies::lathe({{0, -2}, {0.2, -2}, {0.2, 2}, {0, 2}}, 32)}, input);
  const auto joints = detect_joints(find_components(input));
  ASSERT_EQ(joints.size(), 1u);
  EXPECT_EQ(joints[0].joint.type, JointType::kCylindrical);
  EXPECT_GT(std::abs(joints[0].joint.frame.axes(2, 0)), 1.0 - 1e-9);
}

// Their faces in one plane look opposite ways, side by side; only across an edge would they slide.
TEST(DetectJoints, BoxesThatShareAnEdgeOrACornerDoNotFaceEachOther) {
  for (const Vec3& place : {Vec3(1, 1, 0), Vec3(1, 1, 0.3), Vec3(1, 1, 1), Vec3(1, 1.001, 0)}) {
    GroupedSurface input;
    add_part("a", {assemblies::box(Vec3::Zero(), Vec3::Ones())}, input);
    add_part("b", {assemblies::box(place, place + Vec3::Ones())}, input);
    EXPECT_TRUE(detect_joints(find_components(input), quick()).empty()) << place.transpose();
  }
}

// A bearing with a clearance of 2 % of its diameter, and beside it a block that all but touches the flange's back.
TEST(DetectJoints, AStrayTouchHidesNoWiderBearing) {
  for (const double stray : {0.0, 0.002, 0.01}) {
    GroupedSurface input;
    const double back = 2.6;
    add_part("housing",
             {assemblies::lathe({{1.04, -2}, {1.8, -2}, {1.8, 2}, {1.04, 2}}, 32, 0.5),
              assemblies::box({-0.3, -0.3, back + stray}, {0.3, 0.3, 3})},
             input);
    add_part(
        "shaft",
        {assemblies::lathe(
            {{0, -back}, {1.5, -back}, {1.5, -2.04}, {1, -2.04}, {1, 2.04}, {1.5, 2.04}, {1.5, back}, {0, back}}, 32)},
        input);
    const auto joints = detect_joints(find_components(input, {.rule = ComponentRule::kGroups}), quick());
    ASSERT_EQ(joints.size(), 1u) << stray;
    EXPECT_EQ(joints[0].joint.type, JointType::kRevolute) << stray;
    EXPECT_GT(std::abs(joints[0].joint.frame.axes(2, 0)), 1.0 - 1e-6);
  }
}

// A whole turn brings facets onto facets, however few: what is left is how the samples lie on them.
TEST(DetectJoints, ThreadsKeepTheirPitchAndHand) {
  for (const std::string name : {"screw", "spindle"})
    for (const int segments : testing::all_or_first<int>({8, 16, 32}))
      for (const double clearance : {0.0, 0.005, 0.02}) {
        const auto score = [&] {
          TbbJobs jobs;
          return assemblies::scored(make(name, {.segments = segments, .clearance = clearance}), quick(), jobs);
        }();
        ASSERT_EQ(score.joints.size(), 1u);
        EXPECT_EQ(score.joints[0].found, score.joints[0].truth) << name << segments << clearance;
        EXPECT_LT(score.joints[0].pitch_error, 2e-3) << name << segments << clearance;
      }
}

// One assembly for each kind of stop: arm at posts, head and handle of a bolt, neck in a ring, collar on
// a foot, rod at a piston, slab at a frame.
TEST(DetectJoints, RangesOfMotionAreThoseOfTheDrawing) {
  TbbJobs jobs;
  for (const std::string name : {"gate", "latch", "drop link", "chair", "piston", "door"})
    for (const auto& range : assemblies::scored_ranges(make(name, {.clearance = 0.005}), quick(), jobs))
      EXPECT_TRUE(range.right()) << name << ", " << range.joint << ", " << range.freedom << ": " << range.found;
}

// Facets that come to lie corner on facet overlap by more than as read, and a ring drawn smaller than its ball overlaps
// it all around: neither may stop the ball, nor let its neck run into the ring.
TEST(DetectJoints, ANeckStopsAtItsRingHoweverRoughTheBallIsDrawn) {
  TbbJobs jobs;
  for (const Variant& rough :
       testing::all_or_first<Variant>({{.segments = 16, .clearance = 0.0}, {.segments = 32, .clearance = -0.005}}))
    for (const auto& range : assemblies::scored_ranges(make("drop link", rough), quick(), jobs))
      EXPECT_TRUE(range.right()) << rough.segments << ", " << range.joint << ", " << range.freedom << ": "
                                 << range.found;
}

TEST(DetectJoints, ThreeHingesOfOneDoorAreOneRevoluteJoint) {
  const auto joints = joints_of(make("door", {.clearance = 0.005}));
  ASSERT_EQ(joints.size(), 1u);
  EXPECT_EQ(joints[0].joint.type, JointType::kRevolute);
  EXPECT_NO_THROW(joints[0].joint.validate());
  EXPECT_GT(joints[0].influence.half_extents.maxCoeff(), 0.7);  // from the lowest hinge to the highest
}

TEST(DetectJoints, AnyThreadCountGivesTheSameBits) {
  const Assembly assembly = taken_apart(make("brush arm", {.clearance = 0.005}));
  TbbJobs jobs(2);
  const auto one = detect_joints(assembly, quick()), two = detect_joints(assembly, quick(), jobs);
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].joint.frame.origin, two[i].joint.frame.origin);
    EXPECT_EQ(one[i].joint.frame.axes, two[i].joint.frame.axes);
    EXPECT_EQ(one[i].confidence, two[i].confidence);
  }
}

TEST(DetectJoints, ProgressRisesToOneAndWrongOptionsAreRefused) {
  const Assembly assembly = taken_apart(make("welded pair"));
  std::vector<double> told;
  DetectionOptions options = quick();
  options.progress = [&](double part, std::string_view) { told.push_back(part); };
  detect_joints(assembly, options);
  EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));
  EXPECT_EQ(told.back(), 1.0);
  options.contact.samples = 1;
  EXPECT_THROW(detect_joints(assembly, options), InvalidArgument);
}

// A slider crank of three hinges and a round piston: counting says −1, but it turns.
TEST(Kinematics, ASliderCrankHasOneLoopAndOneMotion) {
  const MadeAssembly made = make("piston", {.clearance = 0.005});
  const Kinematics all = overall_kinematics(taken_apart(made), joints_of(made));
  EXPECT_EQ(all.loops, 1);
  EXPECT_EQ(all.groups, 1);
  EXPECT_EQ(all.kutzbach, -1);
  EXPECT_EQ(all.mobility, 1);
}

TEST(Kinematics, OpenChainsHaveTheSumOfTheirFreedoms) {
  const MadeAssembly made = make("brush arm", {.clearance = 0.005});
  const Kinematics all = overall_kinematics(taken_apart(made), joints_of(made));
  EXPECT_EQ(all.loops, 0);
  EXPECT_EQ(all.mobility, 0 + 1 + 1 + 2 + 3 + 3);
  EXPECT_EQ(all.kutzbach, all.mobility);
}

}  // namespace
}  // namespace limber
