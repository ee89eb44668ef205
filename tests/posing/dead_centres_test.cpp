// Handles that can be reached are reached, from poses where no first derivative says which way: arms that are straight
// or folded upon themselves, and cranks at their dead centres.
#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>
#include <numbers>
#include <random>

#include "posed_models.h"
#include "solver/pose_starts.h"

namespace limber {
namespace {

using namespace testing;

constexpr double kPi = std::numbers::pi, kWidth = 0.1;

int trials(int usual) {
  const char* asked = std::getenv("LIMBER_TRIALS");
  return asked != nullptr ? std::atoi(asked) : usual;
}

double between(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

void add_part(JointedModel& model, const std::string& name, const SurfaceMesh& part) {
  const auto first = static_cast<Index>(model.surface.vertices.size());
  model.surface.vertices.insert(model.surface.vertices.end(), part.vertices.begin(), part.vertices.end());
  model.parts.push_back({name, {}});
  for (const Triangle& t : part.triangles) {
    model.parts.back().triangles.push_back(static_cast<Index>(model.surface.triangles.size()));
    model.surface.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
}

SurfaceMesh link_box(double from, double to, double y) {
  return shapes::box({std::min(from, to), y - kWidth / 2, -kWidth / 2},
                     {std::max(from, to), y + kWidth / 2, kWidth / 2});
}

/// A joint at a point whose x axis is `axis`.
JointSpec joint_at(JointType type, const Vec3& origin, const Vec3& axis) {
  JointSpec out{.type = type, .frame = {.origin = origin}};
  const Vec3 x = axis.normalized(), y = x.unitOrthogonal();
  out.frame.axes << x, y, x.cross(y);
  return out;
}

/// A handle of a model, and where joints that are moved forward take its point.
struct Reach {
  JointedModel model{};
  Index part = 0;
  Vec3 grip = Vec3::Zero(), target = Vec3::Zero();
};

/// The motion of b that one coordinate (a ball: a turn) makes, from rest.
RigidTransform motion_of(const JointSpec& joint, const Vec3& coordinate) {
  const Vec3 turn = joint.frame.axes * coordinate;
  const Quaternion q = quaternion_from_rotation_vector(turn);
  return {q, joint.frame.origin - q * joint.frame.origin};
}

/// An arm of links along x, each of which may lie back upon the one before.
Reach random_arm(std::mt19937& random, bool folded, bool limits) {
  Reach out;
  const int links = 2 + static_cast<int>(random() % 5);
  add_part(out.model, "base", link_box(-0.5, 0.0, 0.0));
  double x = 0.0;
  RigidTransform motion;
  for (int i = 0; i < links; ++i) {
    const double length = between(random, 0.5, 1.5), to = x + (folded && i % 2 == 1 ? -length : length);
    const bool ball = random() % 3 == 0;
    const double angle = between(random, 0.0, kPi);
    JointSpec joint = joint_at(ball ? JointType::kBall : JointType::kRevolute, {x, folded ? i * kWidth : 0.0, 0.0},
                               {0.0, std::cos(angle), std::sin(angle)});
    Vec3 coordinate(between(random, -2.5, 2.5), 0.0, 0.0);
    if (ball) coordinate = {0.0, between(random, -1.2, 1.2), between(random, -1.2, 1.2)};
    if (limits && !ball) {
      joint.limits.rotation = {between(random, -2.6, -0.3), between(random, 0.3, 2.6)};
      coordinate.x() = between(random, joint.limits.rotation.low, joint.limits.rotation.high);
    }
    add_part(out.model, "link " + std::to_string(i), link_box(x, to, folded ? i * kWidth : 0.0));
    out.model.joints.push_back({i, i + 1, joint, {}});
    motion = motion * motion_of(joint, coordinate);
    x = to, out.part = i + 1;
    out.grip = {to, folded ? i * kWidth : 0.0, 0.0};
  }
  out.target = motion * out.grip;
  return out;
}

/// A crank, a rod and a slider in line; the slider is pulled to where the crank would take it.
Reach random_slider_crank(std::mt19937& random) {
  Reach out;
  const double r = between(random, 0.3, 1.0), l = r * between(random, 1.2, 3.0), turn = between(random, -kPi, kPi);
  const bool inward = random() % 2 == 0;  // the dead centre at which the crank lies back upon the rod
  const double crank = inward ? -r : r, slider = crank + l;
  add_part(out.model, "base", link_box(-0.5, -0.4, 0.0));
  add_part(out.model, "crank", link_box(0.0, crank, 0.0));
  add_part(out.model, "rod", link_box(crank, slider, kWidth));
  add_part(out.model, "slider", link_box(slider, slider + 0.3, 0.0));
  out.model.joints = {{0, 1, joint_at(JointType::kRevolute, Vec3::Zero(), Vec3::UnitZ()), {}},
                      {1, 2, joint_at(JointType::kRevolute, {crank, 0, 0}, Vec3::UnitZ()), {}},
                      {2, 3, joint_at(JointType::kRevolute, {slider, 0, 0}, Vec3::UnitZ()), {}},
                      {0, 3, joint_at(JointType::kPrismatic, {slider, 0, 0}, Vec3::UnitX()), {}}};
  out.part = 3, out.grip = {slider, 0, 0};
  const double across = r * std::sin(turn);
  out.target = {r * std::cos(turn) + std::sqrt(l * l - across * across), 0, 0};
  return out;
}

/// The drawn lamp, its shade pulled to where its joints would take it.
Reach random_lamp(std::mt19937& random) {
  static const JointedModel lamp = rigid_assembly("lamp");
  Reach out{.model = lamp, .part = lamp.part_named("shade")};
  out.grip = furthest_point(out.model, out.part, Vec3(-1, -2, -3));
  std::vector<RigidTransform> motions(lamp.parts.size());
  std::vector<bool> placed(lamp.parts.size(), false);
  placed[static_cast<std::size_t>(lamp.part_named("base"))] = true;
  for (std::size_t round = 0; round < lamp.joints.size(); ++round)
    for (const ModelJoint& j : lamp.joints) {
      const auto a = static_cast<std::size_t>(j.a), b = static_cast<std::size_t>(j.b);
      if (placed[a] == placed[b]) continue;
      const Interval range = j.joint.limits.rotation;
      const Vec3 coordinate(between(random, std::max(range.low, -kPi), std::min(range.high, kPi)), 0.0, 0.0);
      if (placed[a]) motions[b] = motions[a] * motion_of(j.joint, coordinate);
      if (placed[b]) motions[a] = motions[b] * motion_of(j.joint, -coordinate);
      placed[a] = placed[b] = true;
    }
  out.target = motions[static_cast<std::size_t>(out.part)] * out.grip;
  return out;
}

/// How many handles are met, from poses at rest, and how the others end.
struct Tally {
  int met = 0;
  std::map<PoseResult::Status, int> missed{};
  int minima() const {
    return missed.contains(PoseResult::Status::kLocalMinimum) ? missed.at(PoseResult::Status::kLocalMinimum) : 0;
  }
};

Tally play(const char* name, const std::function<Reach(std::mt19937&)>& make) {
  Tally out;
  std::mt19937 random(1);
  for (int i = 0; i < trials(60); ++i) {
    const Reach reach = make(random);
    PosingSession session(reach.model);
    session.set_pinned(reach.model.part_named("base"), true);
    session.move_handle(session.add_handle(reach.part, reach.grip), reach.target);
    const PoseResult r = session.solve();
    EXPECT_LT(r.joint_error, 1e-9);
    EXPECT_LE(r.limit_violation, 1e-9);
    if (r.handle_error < 1e-6 * size_of(reach.model)) {
      ++out.met;
      EXPECT_EQ(r.status, PoseResult::Status::kConverged);
    } else {
      ++out.missed[r.status];
    }
  }
  ::testing::Test::RecordProperty(std::string(name) + "_met", out.met);
  for (const auto& [status, count] : out.missed)
    ::testing::Test::RecordProperty(std::string(name) + "_" + std::string(to_string(status)), count);
  return out;
}

/// All handles are met or told as local minima, of which there are no more than a share.
void expect_met(const char* name, double least, const std::function<Reach(std::mt19937&)>& make) {
  const Tally t = play(name, make);
  EXPECT_EQ(t.met + t.minima(), trials(60)) << name;
  EXPECT_GE(t.met, least * trials(60)) << name;
}

TEST(DeadCentres, CranksLeaveThemWhenTheirSlidersArePulled) { expect_met("cranks", 1.0, random_slider_crank); }

TEST(DeadCentres, ArmsThatAreStraightOrFoldedReachOrSaySo) {
  for (const bool folded : {false, true})
    for (const bool limits : {false, true})
      expect_met(folded ? (limits ? "folded_limited" : "folded") : (limits ? "straight_limited" : "straight"), 0.999,
                 [&](std::mt19937& random) { return random_arm(random, folded, limits); });
}

TEST(DeadCentres, TheLampReachesOrSaysSo) { expect_met("lamp", 0.999, random_lamp); }

// The hand of a straight arm is pushed towards its shoulder. Every link lies along the push, and nothing turns one.
TEST(DeadCentres, AStraightArmThatIsPushedAlongItselfBuckles) {
  JointedModel arm;
  add_part(arm, "base", link_box(-0.5, 0.0, 0.0));
  for (int i = 0; i < 2; ++i) {
    add_part(arm, "link " + std::to_string(i), link_box(i, i + 1.0, 0.0));
    arm.joints.push_back({i, i + 1, joint_at(JointType::kRevolute, {double(i), 0, 0}, Vec3::UnitZ()), {}});
  }
  std::array<Vec3, 2> elbows;
  for (Vec3& elbow : elbows) {
    PosingSession session(arm);
    session.set_pinned(0, true);
    session.move_handle(session.add_handle(2, {2, 0, 0}), {1.2, 0, 0});
    const PoseResult r = session.solve();
    EXPECT_EQ(r.status, PoseResult::Status::kConverged);
    EXPECT_LT(r.handle_error, 1e-8);
    elbow = *session.motion(1) * Vec3(1, 0, 0);
    EXPECT_NEAR(elbow.x(), 0.6, 1e-8);
    EXPECT_NEAR(std::abs(elbow.y()), 0.8, 1e-8);
  }
  EXPECT_EQ(elbows[0], elbows[1]) << "the same side in every run";
}

// Other starts are poses of the mechanism, all different.
TEST(DeadCentres, StartsHoldJointsAndLimits) {
  using namespace internal;
  std::mt19937 random(5);
  for (int i = 0; i < 20; ++i) {
    const JointedModel model = random_arm(random, i % 2 == 0, true).model;
    std::vector<bool> pinned(model.parts.size(), false);
    pinned[0] = true;
    const PoseStructure structure =
        build_structure(model, std::vector<PartOptions>(model.parts.size()), pinned, StrainWeights::kVolume);
    const Pose rest{rest_poses(structure), std::vector<double>(structure.joints.size(), 0.0)};
    const PoseStarts starts(structure);
    Vec3 before = rest.bodies.back().p;
    for (int n = 1; n <= 50; ++n) {
      const Pose at = starts.start(rest, n);
      const Feasibility f = feasibility(structure, at);
      EXPECT_LT(f.joints, 1e-12);
      EXPECT_LT(f.limits, 1e-12);
      EXPECT_EQ(at.bodies.front().p, rest.bodies.front().p) << "the base is pinned";
      EXPECT_GT((at.bodies.back().p - before).norm(), 1e-3);
      before = at.bodies.back().p;
    }
  }
}

TEST(DeadCentres, AHandOutOfReachIsToldAndTheArmIsStraight) {
  std::mt19937 random(3);
  Reach reach = random_arm(random, true, false);
  reach.target = {50, 20, 10};
  PosingSession session(reach.model);
  session.set_pinned(0, true);
  session.move_handle(session.add_handle(reach.part, reach.grip), reach.target);
  EXPECT_EQ(session.solve().status, PoseResult::Status::kLocalMinimum);
}

/// Iterations of the first frame of a drag that begins beyond reach, and of all that follow.
std::pair<int, int> iterations_beyond_reach(const Reach& reach, int starts) {
  PosingSession session(reach.model, {.starts = starts});
  session.set_pinned(0, true);
  const PoseHandle hand = session.add_handle(reach.part, reach.grip);
  std::pair<int, int> out;
  for (int i = 0; i < 15; ++i) {
    session.move_handle(hand, {50 + 0.1 * i, 20, 10});
    const PoseResult r = session.solve();
    EXPECT_EQ(r.status, PoseResult::Status::kLocalMinimum);
    (i == 0 ? out.first : out.second) += r.iterations;
  }
  return out;
}

// The hand of an arm fifty lengths away cannot be met a tenth of a length further on either.
TEST(DeadCentres, ADragBeyondReachTriesOtherStartsOnce) {
  std::mt19937 random(3);
  const Reach reach = random_arm(random, true, false);
  const auto [first, others] = iterations_beyond_reach(reach, 16);
  const auto [first_alone, others_alone] = iterations_beyond_reach(reach, 0);
  EXPECT_GT(first, 3 * first_alone);
  EXPECT_LT(others, 2 * others_alone);
}

TEST(DeadCentres, ArmsReachFromWhereTheyWerePulledInVain) {
  std::mt19937 random(1);
  int met = 0;
  const int arms = trials(15);
  for (int i = 0; i < arms; ++i) {
    const Reach reach = random_arm(random, i % 2 == 0, true);
    PosingSession session(reach.model);
    session.set_pinned(0, true);
    const PoseHandle hand = session.add_handle(reach.part, reach.grip);
    for (const Vec3& target : {Vec3(50, 20, 10), reach.target}) {
      session.move_handle(hand, target);
      const PoseResult r = session.solve();
      if (target == reach.target) met += r.handle_error < 1e-6 * size_of(reach.model);
    }
  }
  EXPECT_GE(met, 0.999 * arms);
}

}  // namespace
}  // namespace limber
