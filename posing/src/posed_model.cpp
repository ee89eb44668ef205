#include "limber/posing/posed_model.h"

#include <algorithm>
#include <cmath>

#include "limber/internal/strict_json.h"

namespace limber {
namespace {

/// An interval counted from q, which is in it but for round-off.
Interval from(const Interval& limit, double q) { return {std::min(limit.low - q, 0.0), std::max(limit.high - q, 0.0)}; }

bool limited(const JointLimits& limits) {
  return std::isfinite(limits.cone) ||
         std::any_of(limits.euler.begin(), limits.euler.end(), [](const Interval& i) { return !i.open(); });
}

JointLimits limits_from(const JointSpec& joint, const std::vector<double>& q) {
  JointLimits out = joint.limits;
  switch (joint.type) {
    case JointType::kRevolute:
      out.rotation = from(out.rotation, q[0]);
      break;
    case JointType::kCylindrical:
      out.rotation = from(out.rotation, q[0]);
      out.translation[0] = from(out.translation[0], q[1]);
      break;
    case JointType::kPrismatic:
      out.translation[0] = from(out.translation[0], q[0]);
      break;
    case JointType::kPlanar:
      out.rotation = from(out.rotation, q[0]);
      for (std::size_t k = 0; k < 2; ++k) out.translation[k] = from(out.translation[k], q[k + 1]);
      break;
    case JointType::kBall:
    case JointType::kFixed:
      break;
  }
  return out;
}

}  // namespace

JointedModel posed_model(const PosingSession& session, Warnings& warnings) {
  JointedModel out = session.model();
  session.reconstruct(out.surface.vertices);
  for (std::size_t j = 0; j < out.joints.size(); ++j) {
    ModelJoint& joint = out.joints[j];
    const PosedJoint at = session.joint(static_cast<Index>(j));
    joint.influence.reset();
    joint.joint.frame = at.frame;
    joint.joint.limits = limits_from(joint.joint, at.coordinates);
    constexpr double kTurned = 1e-9;  // rad
    if (joint.joint.type != JointType::kBall || !limited(joint.joint.limits) || at.turn < kTurned) continue;
    joint.joint.limits = {};
    const auto name = [&](Index part) { return internal::in_quotes(out.parts[static_cast<std::size_t>(part)].name); };
    warnings.push_back("the ball joint of " + name(joint.a) + " and " + name(joint.b) +
                       " has turned: its limits are left open");
  }
  return out;
}

JointsFile joints_file(const JointedModel& model) {
  JointsFile out;
  for (const ModelPart& part : model.parts) {
    ComponentRecord& record = out.components.emplace_back(ComponentRecord{part.name, {}});
    for (const Index t : part.triangles)
      if (!record.faces.empty() && record.faces.back().first + record.faces.back().count == t)
        ++record.faces.back().count;
      else
        record.faces.push_back({t, 1});
  }
  for (const ModelJoint& joint : model.joints)
    out.joints.push_back({.a = joint.a, .b = joint.b, .joint = joint.joint, .reasons = {"As posed."}});
  return out;
}

}  // namespace limber
