#include "joint_scores.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>

#include "limber/articulation/range_of_motion.h"

namespace limber::assemblies {
namespace {

constexpr int kNone = 6;

void measure(const TrueJoint& truth, const JointSpec& found, double diagonal, JointScore& score) {
  const bool axial = found.type != JointType::kBall && found.type != JointType::kFixed;
  const Vec3 axis = found.frame.axes.col(found.type == JointType::kPlanar ? 2 : 0);
  if (axial)
    score.axis_error =
        std::atan2(axis.cross(truth.axis).norm(), std::abs(axis.dot(truth.axis))) * 180.0 / std::numbers::pi;
  const Vec3 off = found.frame.origin - truth.origin;
  double distance = 0.0;
  if (found.type == JointType::kBall) distance = off.norm();
  if (found.type == JointType::kRevolute || found.type == JointType::kCylindrical)
    distance = (off - truth.axis * truth.axis.dot(off)).norm();
  if (found.type == JointType::kPlanar) distance = std::abs(truth.axis.dot(off));
  score.origin_error = distance / diagonal;
  if (truth.pitch != 0.0) score.pitch_error = std::abs(found.pitch / truth.pitch - 1.0);
  score.pitch_right = std::abs(found.pitch - truth.pitch) <= 0.02 * std::abs(truth.pitch);
}

const std::string& name_of(const Assembly& assembly, Index component) {
  return assembly.components[static_cast<std::size_t>(component)].name;
}

Interval reversed(const Interval& i) { return {-i.high, -i.low}; }

/// What was found for a freedom, in the truth's own sense of direction; nothing where the joint has no such axis.
std::optional<Interval> found_range(const TrueRange& truth, const JointSpec& found, bool b_moves) {
  constexpr double kSameAxis = 0.999;  // cosine
  const bool planar = found.type == JointType::kPlanar;
  const auto in_sense = [&](const Interval& range, int axis) -> std::optional<Interval> {
    const double along = found.frame.axes.col(axis).dot(truth.along);
    if (std::abs(along) < kSameAxis) return std::nullopt;
    return (along > 0.0) == b_moves ? range : reversed(range);
  };
  const JointLimits& limits = found.limits;
  switch (truth.freedom) {
    case TrueRange::Freedom::kCone:
      return Interval{0.0, limits.cone};
    case TrueRange::Freedom::kRotation:
      if (found.type == JointType::kBall) return in_sense(limits.euler[0], 0);
      return in_sense(limits.rotation, planar ? 2 : 0);
    case TrueRange::Freedom::kTranslation:
      for (int axis = 0; axis < (planar ? 2 : 1); ++axis)
        if (const auto range = in_sense(limits.translation[static_cast<std::size_t>(axis)], axis)) return range;
  }
  return std::nullopt;
}

RangeScore compared(const TrueRange& truth, const std::optional<Interval>& found, double diagonal) {
  static const char* const kFreedoms[] = {"rotation", "translation", "cone"};
  RangeScore out;
  out.freedom = kFreedoms[static_cast<int>(truth.freedom)];
  out.angle = truth.freedom != TrueRange::Freedom::kTranslation;
  if (!found) {
    out.same_type = false;
    out.found = "no such axis";
    return out;
  }
  const double unit = out.angle ? std::numbers::pi / 180.0 : 1e-3 * diagonal;
  for (const auto& [expected, got] : {std::pair(truth.range.low, found->low), {truth.range.high, found->high}}) {
    out.ends_match = out.ends_match && std::isfinite(expected) == std::isfinite(got);
    if (std::isfinite(expected) && std::isfinite(got)) out.error = std::max(out.error, std::abs(got - expected) / unit);
  }
  char text[128];
  std::snprintf(text, sizeof text, "%.3f to %.3f where %.3f to %.3f is right%s", found->low / unit, found->high / unit,
                truth.range.low / unit, truth.range.high / unit, out.angle ? " (degrees)" : " (thousandths)");
  out.found = text;
  return out;
}

}  // namespace

Assembly taken_apart(const MadeAssembly& made) {
  return find_components(made.surface, {.rule = made.compound ? ComponentRule::kGroups : ComponentRule::kConnectivity});
}

std::vector<RangeScore> scored_ranges(const MadeAssembly& made, const DetectionOptions& options, Jobs& jobs,
                                      const RangeOptions& range_options) {
  const Assembly assembly = taken_apart(made);
  return scored_ranges(made, assembly, detect_joints(assembly, options, jobs), jobs, range_options);
}

std::vector<RangeScore> scored_ranges(const MadeAssembly& made, const Assembly& assembly,
                                      const std::vector<DetectedJoint>& joints, Jobs& jobs,
                                      const RangeOptions& range_options) {
  const auto ranges = ranges_of_motion(assembly, joints, range_options, jobs);
  std::vector<RangeScore> out;
  for (const TrueJoint& truth : made.joints)
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const std::string &a = name_of(assembly, joints[i].a), &b = name_of(assembly, joints[i].b);
      if (std::minmax(a, b) != std::minmax(truth.a, truth.b) || joints[i].joint.type != truth.type) continue;
      for (const TrueRange& range : truth.ranges) {
        const JointSpec& found = ranges[i].joint;
        const bool same_type = found.type == truth.type;
        RangeScore score =
            compared(range, same_type ? found_range(range, found, b == truth.b) : std::nullopt, made.diagonal);
        score.joint = truth.a + " - " + truth.b;
        score.type = static_cast<int>(truth.type);
        if (!same_type) score.found = "became " + std::string(to_string(found.type));
        out.push_back(score);
      }
    }
  return out;
}

Change change_of_joints(const MadeAssembly& still, const MadeAssembly& moved, const Mat3& rotation,
                        const DetectionOptions& options, Jobs& jobs) {
  const Assembly before = taken_apart(still), after = taken_apart(moved);
  const auto joints = detect_joints(before, options, jobs), others = detect_joints(after, options, jobs);
  const auto names = [](const Assembly& assembly, const DetectedJoint& j) {
    const std::string &a = name_of(assembly, j.a), &b = name_of(assembly, j.b);
    return std::pair<std::string, std::string>(std::min(a, b), std::max(a, b));
  };
  Change out;
  for (const DetectedJoint& j : joints) {
    ++out.joints;
    const auto same = std::find_if(others.begin(), others.end(), [&](const DetectedJoint& o) {
      return names(after, o) == names(before, j) && o.joint.type == j.joint.type;
    });
    if (same == others.end()) ++out.types;
    if (same == others.end() || j.joint.type == JointType::kBall || j.joint.type == JointType::kFixed) continue;
    const int column = j.joint.type == JointType::kPlanar ? 2 : 0;
    const Vec3 axis = rotation * j.joint.frame.axes.col(column), other = same->joint.frame.axes.col(column);
    const double turned = std::atan2(axis.cross(other).norm(), std::abs(axis.dot(other))) * 180.0 / std::numbers::pi;
    if (turned > Change::kMostTurn) ++out.turned;
    if (turned <= out.axis) continue;
    out.axis = turned;
    out.worst = name_of(before, j.a) + " - " + name_of(before, j.b);
  }
  return out;
}

Score scored(const MadeAssembly& made, const DetectionOptions& options, Jobs& jobs) {
  const Assembly assembly = taken_apart(made);
  const auto found = detect_joints(assembly, options, jobs);
  std::vector<char> matched(found.size(), 0);
  Score out;
  for (const TrueJoint& truth : made.joints) {
    JointScore score;
    score.name = truth.a + " - " + truth.b;
    score.truth = static_cast<int>(truth.type);
    score.found = kNone;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto pair = std::minmax(name_of(assembly, found[i].a), name_of(assembly, found[i].b));
      if (pair != std::minmax(truth.a, truth.b)) continue;
      matched[i] = 1;
      score.found = static_cast<int>(found[i].joint.type);
      score.confidence = found[i].confidence;
      score.reason = found[i].reasons.back();
      if (score.found == score.truth) measure(truth, found[i].joint, made.diagonal, score);
    }
    out.joints.push_back(score);
  }
  for (std::size_t i = 0; i < found.size(); ++i)
    if (!matched[i])
      out.extra.push_back(name_of(assembly, found[i].a) + " - " + name_of(assembly, found[i].b) + " " +
                          std::string(to_string(found[i].joint.type)) + "; " + found[i].reasons.front() + "; " +
                          found[i].reasons.back());
  return out;
}

namespace {

/// All combinations, each with shafts and holes aligned and turned by half a segment.
template <class Change>
std::vector<Variant> of(std::initializer_list<int> segments, std::initializer_list<double> clearances,
                        Change&& change) {
  std::vector<Variant> out;
  for (const int n : segments)
    for (const double c : clearances)
      for (const double phase : {0.0, 0.5}) {
        Variant v{.segments = n, .clearance = c, .phase = phase};
        change(v);
        out.push_back(v);
      }
  return out;
}

}  // namespace

std::vector<VariantClass> range_variant_classes() {
  const auto same = [](Variant&) {};
  const auto turned = [](double scale) {
    return [scale](Variant& v) {
      v.swapped = v.shuffled = true;
      v.scale = scale;
      v.rotation = Eigen::AngleAxisd(2.1, Vec3(0.3, -0.8, 0.5).normalized()).toRotationMatrix();
      v.translation = scale * Vec3(3, 6, -3);
    };
  };
  const auto noisy = [&](double jitter) {
    return of({32}, {0.0, 0.005, 0.02}, [&](Variant& v) { v.jitter = jitter; });
  };
  return {{"32, 64 segments, gap 0", of({32, 64}, {0.0}, same)},
          {"32, 64 segments, gap 0.5 %", of({32, 64}, {0.005}, same)},
          {"32, 64 segments, gap 2 %", of({32, 64}, {0.02}, same)},
          {"32, 64 segments, overlap 0.5 %", of({32, 64}, {-0.005}, same)},
          {"16 segments, gap 0 to 2 %", of({16}, {0.0, 0.005, 0.02}, same)},
          {"16 segments, overlap 0.5 %", of({16}, {-0.005}, same)},
          {"8 segments, without balls", of({8}, {0.0, 0.005, 0.02, -0.005}, same), 1.0, false},
          {"0.03 % jitter", noisy(0.0003)},
          {"0.1 % jitter", noisy(0.001)},
          {"rotated, scaled by 1e-3, shuffled", of({32}, {0.0, 0.005}, turned(1e-3))},
          {"rotated, scaled by 1e3, shuffled", of({32}, {0.0, 0.005}, turned(1e3))}};
}

std::vector<VariantClass> variant_classes() {
  const auto same = [](Variant&) {};
  std::vector<VariantClass> out;
  out.push_back({"32-64 segments, gap 0, 0.5 %", of({32, 48, 64}, {0.0, 0.005}, same)});
  out.push_back({"32-64 segments, gap 2 %", of({32, 64}, {0.02}, same), 1.0});
  out.push_back({"32-64 segments, overlap 0.5, 1 %", of({32, 64}, {-0.005, -0.01}, same), 1.0});
  out.push_back({"16, 24 segments", of({16, 24}, {0.0, 0.005, 0.02, -0.005}, same), 1.0});
  out.push_back({"8 segments, without balls", of({8}, {0.0, 0.005, 0.02, -0.005}, same), 1.0, false});
  for (const double jitter : {0.0003, 0.001}) {
    std::vector<Variant> noisy;
    for (const unsigned seed : {1u, 2u, 3u})
      for (Variant v : of({32}, {0.0, 0.005, 0.02}, [&](Variant& x) { x.jitter = jitter, x.seed = seed; }))
        noisy.push_back(v);
    out.push_back({jitter < 0.0005 ? "0.03 % jitter" : "0.1 % jitter", noisy, 2.0});
  }
  out.push_back({"soup", of({32}, {0.0, 0.005, 0.02}, [](Variant& v) { v.soup = true; })});
  out.push_back({"open shells", of({32}, {0.0, 0.005, 0.02}, [](Variant& v) { v.open = true; })});
  std::vector<Variant> moved;
  const Vec3 axis = Vec3(0.3, -0.8, 0.5).normalized();
  for (const double scale : {1e-3, 1.0, 1e3})
    for (const double angle : {0.7, 2.1})
      moved.push_back({.segments = 32,
                       .clearance = 0.005,
                       .swapped = angle > 1.0,
                       .shuffled = angle > 1.0,
                       .scale = scale,
                       .rotation = Eigen::AngleAxisd(angle, axis).toRotationMatrix(),
                       .translation = 3.0 * scale * Vec3(1, 2, -1)});
  out.push_back({"rotated, scaled, shuffled", moved});
  return out;
}

}  // namespace limber::assemblies
