#include "true_joints.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "limber/core/error.h"

namespace limber::assemblies {
namespace {

using Freedom = TrueRange::Freedom;

constexpr double kSameAxis = 0.999;  // cosine

/// The range of a freedom along or about an axis, in that axis' sense.
std::optional<Interval> known(const TrueJoint& joint, Freedom freedom, const Vec3& axis) {
  for (const TrueRange& r : joint.ranges)
    if (const double along = r.along.dot(axis); r.freedom == freedom && std::abs(along) > kSameAxis)
      return along > 0.0 ? r.range : Interval{-r.range.high, -r.range.low};
  return std::nullopt;
}

std::optional<double> known_cone(const TrueJoint& joint) {
  for (const TrueRange& r : joint.ranges)
    if (r.freedom == Freedom::kCone) return r.range.high;
  return std::nullopt;
}

/// The truth's axis where the type has it. A plate's x is the direction it is known to slide in, if any.
JointFrame frame_of(const TrueJoint& joint) {
  const bool planar = joint.type == JointType::kPlanar;
  Vec3 x = joint.axis.unitOrthogonal();
  for (const TrueRange& r : joint.ranges)
    if (planar && r.freedom == Freedom::kTranslation) {
      x = r.along;
      break;
    }
  JointFrame frame{.origin = joint.origin};
  if (planar)
    frame.axes << x, joint.axis.cross(x), joint.axis;
  else
    frame.axes << joint.axis, x, joint.axis.cross(x);
  return frame;
}

/// Nothing unless all freedoms are known.
std::optional<JointLimits> limits_of(const TrueJoint& joint, const JointFrame& frame) {
  JointLimits out;
  bool all_known = true;
  const auto take = [&](Freedom freedom, int axis, Interval& into) {
    const auto range = known(joint, freedom, frame.axes.col(axis));
    all_known = all_known && range.has_value();
    into = range.value_or(Interval{});
  };
  switch (joint.type) {
    case JointType::kFixed:
      break;
    case JointType::kRevolute:
      take(Freedom::kRotation, 0, out.rotation);
      break;
    case JointType::kPrismatic:
      take(Freedom::kTranslation, 0, out.translation[0]);
      break;
    case JointType::kCylindrical:
      take(Freedom::kRotation, 0, out.rotation);
      if (joint.pitch == 0.0) {
        take(Freedom::kTranslation, 0, out.translation[0]);
      } else {
        const auto [low, high] = std::minmax({joint.pitch * out.rotation.low, joint.pitch * out.rotation.high});
        out.translation[0] = {low, high};
      }
      break;
    case JointType::kPlanar:
      take(Freedom::kRotation, 2, out.rotation);
      take(Freedom::kTranslation, 0, out.translation[0]);
      take(Freedom::kTranslation, 1, out.translation[1]);
      break;
    case JointType::kBall: {
      const auto cone = known_cone(joint);
      if (!cone) return std::nullopt;
      out.cone = *cone;
      take(Freedom::kRotation, 0, out.euler[0]);
      out.euler[1] = out.euler[2] = {-*cone, *cone};
    }
  }
  return all_known ? std::optional(out) : std::nullopt;
}

Index number_of(const MadeAssembly& made, const std::string& part) {
  const auto& groups = made.surface.groups;
  const auto found = std::find_if(groups.begin(), groups.end(), [&](const SurfaceGroup& g) { return g.name == part; });
  if (found == groups.end()) throw InvalidArgument("true_joints: there is no part \"" + part + "\"");
  return static_cast<Index>(found - groups.begin());
}

}  // namespace

JointsFile true_joints(const MadeAssembly& made) {
  JointsFile out;
  for (const SurfaceGroup& g : made.surface.groups) out.components.push_back({g.name, {{g.first, g.count}}});
  for (const TrueJoint& truth : made.joints) {
    JointRecord& joint = out.joints.emplace_back();
    joint.a = number_of(made, truth.a);
    joint.b = number_of(made, truth.b);
    joint.joint = {.type = truth.type, .frame = frame_of(truth), .pitch = truth.pitch};
    const auto limits = limits_of(truth, joint.joint.frame);
    joint.limits_known = limits.has_value();
    joint.joint.limits = limits.value_or(JointLimits{});
    joint.reasons.push_back(limits ? "As drawn." : "As drawn; how far it goes no short formula tells.");
  }
  return out;
}

}  // namespace limber::assemblies
