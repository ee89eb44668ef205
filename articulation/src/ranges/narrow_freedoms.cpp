#include <algorithm>

#include "limber/articulation/range_of_motion.h"
#include "number_text.h"

namespace limber {
namespace {

using internal::degrees_text;
using internal::number_text;

/// The joint's frame with the axis of this number as x; the frame stays right-handed.
JointFrame with_x(const JointFrame& frame, int axis) {
  JointFrame out{.origin = frame.origin, .axes = frame.axes};
  for (int i = 0; i < 3; ++i) out.axes.col(i) = frame.axes.col((i + axis) % 3);
  return out;
}

JointSpec one_freedom(const JointSpec& joint, JointType type, int axis, const Interval& limit) {
  JointSpec out{.type = type, .frame = with_x(joint.frame, axis)};
  (type == JointType::kRevolute ? out.limits.rotation : out.limits.translation[0]) = limit;
  return out;
}

JointSpec fixed_of(const JointSpec& joint) { return {.type = JointType::kFixed, .frame = joint.frame}; }

}  // namespace

JointSpec without_narrow_freedoms(JointSpec joint, double min_rotation, double min_translation,
                                  std::vector<std::string>& reasons) {
  const auto narrow_turn = [&](const Interval& i) { return i.width() < min_rotation; };
  const auto narrow_slide = [&](const Interval& i) { return i.width() < min_translation; };
  const auto becomes = [&](JointSpec other, const std::string& why) {
    reasons.push_back(why + ": the " + std::string(to_string(joint.type)) + " joint is " +
                      std::string(to_string(other.type)) + ".");
    return other;
  };
  const JointLimits& l = joint.limits;
  switch (joint.type) {
    case JointType::kFixed:
      break;
    case JointType::kRevolute:
      if (narrow_turn(l.rotation))
        return becomes(fixed_of(joint), "It turns by " + degrees_text(l.rotation.width()) + " only");
      break;
    case JointType::kPrismatic:
      if (narrow_slide(l.translation[0]))
        return becomes(fixed_of(joint), "It slides by " + number_text(l.translation[0].width()) + " only");
      break;
    case JointType::kCylindrical: {
      if (joint.pitch != 0.0) {
        if (narrow_turn(l.rotation))
          return becomes(fixed_of(joint), "It screws by " + degrees_text(l.rotation.width()) + " only");
        break;
      }
      const bool turns = !narrow_turn(l.rotation), slides = !narrow_slide(l.translation[0]);
      if (!turns && !slides) return becomes(fixed_of(joint), "It neither turns nor slides");
      if (!slides)
        return becomes(one_freedom(joint, JointType::kRevolute, 0, l.rotation),
                       "It slides by " + number_text(l.translation[0].width()) + " only");
      if (!turns)
        return becomes(one_freedom(joint, JointType::kPrismatic, 0, l.translation[0]),
                       "It turns by " + degrees_text(l.rotation.width()) + " only");
      break;
    }
    case JointType::kPlanar: {
      const bool x = !narrow_slide(l.translation[0]), y = !narrow_slide(l.translation[1]),
                 turns = !narrow_turn(l.rotation);
      if (!x && !y && !turns) return becomes(fixed_of(joint), "It neither slides nor turns");
      if (!x && !y) return becomes(one_freedom(joint, JointType::kRevolute, 2, l.rotation), "It does not slide");
      if (!turns && x != y)
        return becomes(one_freedom(joint, JointType::kPrismatic, x ? 0 : 1, l.translation[x ? 0 : 1]),
                       "It slides one way only");
      break;
    }
    case JointType::kBall: {
      const auto free =
          std::count_if(l.euler.begin(), l.euler.end(), [&](const Interval& i) { return !narrow_turn(i); });
      if (free == 0) return becomes(fixed_of(joint), "It does not turn");
      if (free > 1) break;
      for (int axis = 0; axis < 3; ++axis)
        if (const Interval& turn = l.euler[static_cast<std::size_t>(axis)]; !narrow_turn(turn))
          return becomes(one_freedom(joint, JointType::kRevolute, axis, turn), "It turns about one axis only");
    }
  }
  return joint;
}

}  // namespace limber
