#include "limber/articulation/range_of_motion.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "constants.h"
#include "counted_progress.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "number_text.h"
#include "ranges/free_motion_of_bodies.h"
#include "tuning.h"

namespace limber {
namespace {

using internal::degrees_text;
using internal::kInfinity;
using internal::number_text;
using internal::OrbitBody;
using internal::some_of;
using internal::tuning;
using Kind = MotionPath::Kind;

// Sides ---------------------------------------------------------------------------------------------------------------

/// The joints as a graph whose nodes are groups of components that fixed joints hold together.
class JointGraph {
 public:
  /// @param except a joint that holds nothing together
  JointGraph(Index components, const std::vector<DetectedJoint>& joints, std::optional<std::size_t> except = {});

  JointSides sides(const DetectedJoint& joint) const;

 private:
  /// Per group: whether joints lead there from `start` without passing through `avoided`.
  std::vector<bool> reached(Index start, Index avoided) const;

  std::vector<Index> group_;                    ///< per component, the group's first
  std::vector<std::vector<Index>> neighbours_;  ///< per group
};

JointGraph::JointGraph(Index components, const std::vector<DetectedJoint>& joints, std::optional<std::size_t> except)
    : neighbours_(static_cast<std::size_t>(components)) {
  for (const DetectedJoint& j : joints)
    if (std::min(j.a, j.b) < 0 || std::max(j.a, j.b) >= components || j.a == j.b)
      throw InvalidArgument("joint_sides: a joint of components " + std::to_string(j.a) + " and " +
                            std::to_string(j.b) + ", expected two of " + std::to_string(components));
  DisjointSets groups(static_cast<std::size_t>(components));
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (j != except && joints[j].joint.type == JointType::kFixed) groups.join(joints[j].a, joints[j].b);
  for (Index c = 0; c < components; ++c) group_.push_back(groups.root(c));
  for (const DetectedJoint& j : joints) {
    const Index a = groups.root(j.a), b = groups.root(j.b);
    neighbours_[static_cast<std::size_t>(a)].push_back(b);
    neighbours_[static_cast<std::size_t>(b)].push_back(a);
  }
}

std::vector<bool> JointGraph::reached(Index start, Index avoided) const {
  std::vector<bool> seen(neighbours_.size(), false);
  std::vector<Index> open{start};
  seen[static_cast<std::size_t>(start)] = true;
  while (!open.empty()) {
    const Index here = open.back();
    open.pop_back();
    for (const Index next : neighbours_[static_cast<std::size_t>(here)])
      if (next != avoided && !seen[static_cast<std::size_t>(next)]) {
        seen[static_cast<std::size_t>(next)] = true;
        open.push_back(next);
      }
  }
  return seen;
}

JointSides JointGraph::sides(const DetectedJoint& joint) const {
  const Index a = group_[static_cast<std::size_t>(joint.a)], b = group_[static_cast<std::size_t>(joint.b)];
  JointSides sides;
  if (a == b) {  // held by fixed joints besides
    sides.moving = {joint.b};
    sides.fixed = {joint.a};
    return sides;
  }
  const std::vector<bool> with_a = reached(a, b), with_b = reached(b, a);
  for (std::size_t c = 0; c < group_.size(); ++c) {
    const auto g = static_cast<std::size_t>(group_[c]);
    (!with_b[g] ? sides.fixed : with_a[g] ? sides.left_out : sides.moving).push_back(static_cast<Index>(c));
  }
  return sides;
}

// Paths ---------------------------------------------------------------------------------------------------------------

Vec3 axis_of(const JointSpec& joint, int axis) { return joint.frame.axes.col(axis); }

MotionPath rotation(const JointSpec& joint, const Vec3& axis) {
  return {.kind = Kind::kRotation, .origin = joint.frame.origin, .axis = axis.normalized()};
}

MotionPath translation(const JointSpec& joint, int axis) {
  return {.kind = Kind::kTranslation, .origin = joint.frame.origin, .axis = axis_of(joint, axis).normalized()};
}

struct NamedPath {
  std::string freedom;
  MotionPath path;
  Interval* limit;  ///< of the joint in work
};

std::vector<NamedPath> paths_of(JointSpec& joint) {
  static const char* const kAxes[] = {"x", "y", "z"};
  const auto turn = [&](int axis, Interval& limit) {
    return NamedPath{std::string("rotation about ") + kAxes[axis], rotation(joint, axis_of(joint, axis)), &limit};
  };
  const auto slide = [&](int axis, Interval& limit) {
    return NamedPath{std::string("translation along ") + kAxes[axis], translation(joint, axis), &limit};
  };
  JointLimits& limits = joint.limits;
  switch (joint.type) {
    case JointType::kBall:
      return {turn(0, limits.euler[0]), turn(1, limits.euler[1]), turn(2, limits.euler[2])};
    case JointType::kRevolute:
      return {turn(0, limits.rotation)};
    case JointType::kPrismatic:
      return {slide(0, limits.translation[0])};
    case JointType::kPlanar:
      return {slide(0, limits.translation[0]), slide(1, limits.translation[1]), turn(2, limits.rotation)};
    case JointType::kCylindrical:
      if (joint.pitch == 0.0) return {turn(0, limits.rotation), slide(0, limits.translation[0])};
      return {{"screwing about x",
               {.kind = Kind::kScrew, .origin = joint.frame.origin, .axis = axis_of(joint, 0), .pitch = joint.pitch},
               &limits.rotation}};
    case JointType::kFixed:
      break;
  }
  return {};
}

// Trying --------------------------------------------------------------------------------------------------------------

/// All components, ready for any path.
std::vector<OrbitBody> bodies_of(const Assembly& assembly) {
  std::vector<OrbitBody> out;
  for (const Component& c : assembly.components) out.push_back(internal::orbit_body({&c.surface, c.closed, c.caps}));
  return out;
}

/// One joint of an assembly with its two sides, ready to be moved along paths.
class Trial {
 public:
  Trial(const Assembly& assembly, std::span<const OrbitBody> bodies, const DetectedJoint& j, JointSides sides,
        double crease)
      : sides_(std::move(sides)), moving_(some_of(bodies, sides_.moving)), fixed_(some_of(bodies, sides_.fixed)) {
    const Component &a = component(assembly, j.a), &b = component(assembly, j.b);
    size_ = std::min(a.diagonal, b.diagonal);
    sagitta_ = std::max(sagitta_near(j, a, crease), sagitta_near(j, b, crease));
    if (j.joint.type == JointType::kBall) sagitta_ *= 2.0;  // facets of a sphere bend in two directions
  }

  double size() const { return size_; }  ///< the smaller diagonal of the two components

  FreeMotion along(const MotionPath& path, FreeMotionOptions options) const {
    // Tolerances belong to the two parts that are joined, not to all that hangs on them.
    if (options.tolerance == 0.0) options.tolerance = tuning().ranges.limits.tolerance * size_;
    if (options.largest_overlap == 0.0) options.largest_overlap = tuning().ranges.limits.largest_overlap * size_;
    FreeMotion m = internal::free_motion(moving_, fixed_, path, options, sagitta_);
    for (MotionStop* stop : {&m.low, &m.high})
      if (stop->body >= 0) stop->body = sides_.fixed[static_cast<std::size_t>(stop->body)];
    return m;
  }

 private:
  static const Component& component(const Assembly& assembly, Index i) {
    return assembly.components[static_cast<std::size_t>(i)];
  }
  static double sagitta_near(const DetectedJoint& joint, const Component& part, double crease) {
    Vec3 low = Vec3::Constant(kInfinity), high = -low;
    for (const Vec3& p : joint.contact_points) low = low.cwiseMin(p), high = high.cwiseMax(p);
    if (joint.contact_points.empty()) return 0.0;
    const Vec3 margin = Vec3::Constant(tuning().ranges.limits.contact_margin * (high - low).norm() + joint.gap);
    return facet_sagitta(part.surface, low - margin, high + margin, crease);
  }

  JointSides sides_;
  std::vector<OrbitBody> moving_, fixed_;
  double size_ = 0.0, sagitta_ = 0.0;
};

/// How many paths are tried for a joint, at most.
std::size_t path_count(JointSpec joint, const RangeOptions& options) {
  const std::size_t swings = joint.type == JointType::kBall ? static_cast<std::size_t>(options.cone_directions) +
                                                                  2 * tuning().ranges.limits.cone_refinements
                                                            : 0;
  return paths_of(joint).size() + swings;
}

/// The least swing of the x axis over all directions. Swings by an angle about cos ψ y + sin ψ z.
double cone_of(const Trial& trial, const JointSpec& joint, const RangeOptions& options,
               const std::function<void()>& path_done) {
  FreeMotionOptions motion = options.motion;
  motion.reachable_only = true;
  const auto swing = [&](double psi) {
    const Vec3 axis = std::cos(psi) * axis_of(joint, 1) + std::sin(psi) * axis_of(joint, 2);
    const double high = trial.along(rotation(joint, axis), motion).reachable.high;
    path_done();
    return high;
  };
  const double step = 2.0 * std::numbers::pi / options.cone_directions;
  double least = kInfinity, at = 0.0;
  for (int i = 0; i < options.cone_directions; ++i)
    if (const double angle = swing(i * step); angle < least) least = angle, at = i * step;
  if (least == kInfinity) return least;
  double d = 0.5 * step;
  for (std::size_t i = 0; i < tuning().ranges.limits.cone_refinements; ++i, d *= 0.5)
    for (const double psi : {at - d, at + d})
      if (const double angle = swing(psi); angle < least) least = angle, at = psi;
  return std::min(least, std::numbers::pi);
}

// Sentences -----------------------------------------------------------------------------------------------------------

bool is_angle(const std::string& freedom) { return freedom.starts_with("rotation") || freedom.starts_with("screw"); }

std::string value_text(double value, bool angle) { return angle ? degrees_text(value) : number_text(value); }

std::string stop_text(const Assembly& assembly, const MotionStop& stop) {
  return "\"" + assembly.components[static_cast<std::size_t>(stop.body)].name + "\" at " +
         internal::point_text(stop.point);
}

std::string range_sentence(const Assembly& assembly, const FreedomRange& range) {
  const FreeMotion& m = range.motion;
  const bool angle = is_angle(range.freedom);
  if (m.reachable.open())
    return range.freedom + ": nothing stops it" + (range.freedom.starts_with("rotation") ? ", full turns." : ".");
  std::string text = range.freedom + ": ";
  text += m.low.body < 0 ? "open below"
                         : "from " + value_text(m.reachable.low, angle) + ", stopped by " + stop_text(assembly, m.low);
  text += m.high.body < 0
              ? "; open above"
              : "; to " + value_text(m.reachable.high, angle) + ", stopped by " + stop_text(assembly, m.high);
  for (const Interval& other : m.others)
    text += "; free again from " + value_text(other.low, angle) + " to " + value_text(other.high, angle);
  return text + ".";
}

double width(const Interval& interval) { return interval.high - interval.low; }

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

void RangeOptions::validate() const {
  motion.validate();
  if (!(min_rotation >= 0.0) || !(min_translation >= 0.0))
    throw InvalidArgument("RangeOptions: min_rotation is " + std::to_string(min_rotation) + " and min_translation " +
                          std::to_string(min_translation) + ", expected numbers >= 0");
  if (cone_directions < 4 || cone_directions > 360)
    throw InvalidArgument("RangeOptions: cone_directions is " + std::to_string(cone_directions) +
                          ", expected 4 to 360");
}

JointSides joint_sides(Index components, const std::vector<DetectedJoint>& joints, std::size_t joint) {
  if (joint >= joints.size())
    throw InvalidArgument("joint_sides: joint " + std::to_string(joint) + " of " + std::to_string(joints.size()));
  return JointGraph(components, joints, joint).sides(joints[joint]);
}

JointSpec without_narrow_freedoms(JointSpec joint, double min_rotation, double min_translation,
                                  std::vector<std::string>& reasons) {
  const auto narrow_turn = [&](const Interval& i) { return width(i) < min_rotation; };
  const auto narrow_slide = [&](const Interval& i) { return width(i) < min_translation; };
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
        return becomes(fixed_of(joint), "It turns by " + degrees_text(width(l.rotation)) + " only");
      break;
    case JointType::kPrismatic:
      if (narrow_slide(l.translation[0]))
        return becomes(fixed_of(joint), "It slides by " + number_text(width(l.translation[0])) + " only");
      break;
    case JointType::kCylindrical: {
      if (joint.pitch != 0.0) {
        if (narrow_turn(l.rotation))
          return becomes(fixed_of(joint), "It screws by " + degrees_text(width(l.rotation)) + " only");
        break;
      }
      const bool turns = !narrow_turn(l.rotation), slides = !narrow_slide(l.translation[0]);
      if (!turns && !slides) return becomes(fixed_of(joint), "It neither turns nor slides");
      if (!slides)
        return becomes(one_freedom(joint, JointType::kRevolute, 0, l.rotation),
                       "It slides by " + number_text(width(l.translation[0])) + " only");
      if (!turns)
        return becomes(one_freedom(joint, JointType::kPrismatic, 0, l.translation[0]),
                       "It turns by " + degrees_text(width(l.rotation)) + " only");
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

namespace {

RangeOfMotion range_of(const Assembly& assembly, std::span<const OrbitBody> bodies, const JointGraph& graph,
                       const DetectedJoint& joint, const RangeOptions& options,
                       const std::function<void()>& path_done) {
  RangeOfMotion out{.joint = joint.joint, .freedoms = {}, .reasons = {}};
  out.joint.limits = {};
  if (out.joint.type == JointType::kFixed) return out;
  const Trial trial(assembly, bodies, joint, graph.sides(joint), options.motion.crease_angle);
  for (const NamedPath& p : paths_of(out.joint)) {
    out.freedoms.push_back({p.freedom, trial.along(p.path, options.motion)});
    path_done();
    *p.limit = out.freedoms.back().motion.reachable;
    out.reasons.push_back(range_sentence(assembly, out.freedoms.back()));
  }
  if (out.joint.type == JointType::kBall) {
    out.joint.limits.cone = cone_of(trial, out.joint, options, path_done);
    out.reasons.push_back("swing of x: " +
                          (out.joint.limits.cone < kInfinity
                               ? "at least " + degrees_text(out.joint.limits.cone) + " in every direction."
                               : std::string("nothing stops it.")));
  }
  if (out.joint.type == JointType::kCylindrical && out.joint.pitch != 0.0) {
    const Interval turn = out.joint.limits.rotation;
    const auto [low, high] = std::minmax({out.joint.pitch * turn.low, out.joint.pitch * turn.high});
    out.joint.limits.translation[0] = {low, high};
  }
  if (std::any_of(out.freedoms.begin(), out.freedoms.end(), [](const FreedomRange& f) { return f.motion.overlapping; }))
    out.reasons.push_back("The parts overlap as read by more than " +
                          number_text(out.freedoms.front().motion.tolerance) + ": such places count as no stop.");
  out.joint =
      without_narrow_freedoms(out.joint, options.min_rotation, options.min_translation * trial.size(), out.reasons);
  return out;
}

}  // namespace

RangeOfMotion range_of_motion(const Assembly& assembly, const std::vector<DetectedJoint>& joints, std::size_t joint,
                              const RangeOptions& options) {
  options.validate();
  const JointGraph graph(static_cast<Index>(assembly.components.size()), joints);
  if (joint >= joints.size())
    throw InvalidArgument("range_of_motion: joint " + std::to_string(joint) + " of " + std::to_string(joints.size()));
  return range_of(assembly, bodies_of(assembly), graph, joints[joint], options, [] {});
}

std::vector<RangeOfMotion> ranges_of_motion(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                                            const RangeOptions& options, Jobs& jobs) {
  options.validate();
  const std::vector<OrbitBody> bodies = bodies_of(assembly);
  const JointGraph graph(static_cast<Index>(assembly.components.size()), joints);
  std::vector<RangeOfMotion> out(joints.size());
  std::size_t paths = 0;
  for (const DetectedJoint& j : joints) paths += path_count(j.joint, options);
  internal::CountedProgress progress(paths, options.progress);
  jobs.parallel_for(joints.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j)
      out[j] = range_of(assembly, bodies, graph, joints[j], options, [&] { progress.done(); });
  });
  return out;
}

}  // namespace limber
