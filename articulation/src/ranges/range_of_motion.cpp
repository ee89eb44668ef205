#include "limber/articulation/range_of_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <optional>

#include "constants.h"
#include "counted_progress.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "number_text.h"
#include "ranges/coupled_motion.h"
#include "ranges/free_motion_of_bodies.h"
#include "ranges/path_frame.h"
#include "tuning.h"

namespace limber {
namespace {

using internal::degrees_text;
using internal::kInfinity;
using internal::number_text;
using internal::OrbitBody;
using internal::PathFrame;
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

constexpr int kQuarters = 4;  // of the swings' directions: about y and z and against them

/// How many paths are tried for a joint, at most.
std::size_t path_count(JointSpec joint, const RangeOptions& options) {
  const std::size_t swings =
      joint.type == JointType::kBall
          ? static_cast<std::size_t>(options.cone_directions - std::gcd(options.cone_directions, kQuarters)) +
                2 * tuning().ranges.limits.cone_refinements
          : 0;
  return paths_of(joint).size() + swings;
}

/// The least swing of the x axis over all directions. Swings by an angle about cos ψ y + sin ψ z, those of the joint's
/// limits about y and z among them. Stops beyond the least so far do not matter.
double cone_of(const Trial& trial, const JointSpec& joint, const RangeOptions& options,
               const std::function<void()>& path_done) {
  FreeMotionOptions motion = options.motion;
  motion.reachable_only = true;
  double least = kInfinity, at = 0.0;
  const auto swing = [&](double psi) {
    const Vec3 axis = std::cos(psi) * axis_of(joint, 1) + std::sin(psi) * axis_of(joint, 2);
    motion.within = {0.0, least};
    if (const double high = trial.along(rotation(joint, axis), motion).reachable.high; high < least)
      least = high, at = psi;
    path_done();
  };
  const auto& euler = joint.limits.euler;
  const std::array<double, kQuarters> known{euler[1].high, euler[2].high, -euler[1].low, -euler[2].low};
  for (std::size_t i = 0; i < known.size(); ++i)
    if (known[i] < least) least = known[i], at = 0.5 * std::numbers::pi * static_cast<double>(i);
  const double step = 2.0 * std::numbers::pi / options.cone_directions;
  for (int i = 0; i < options.cone_directions; ++i)
    if (kQuarters * i % options.cone_directions != 0) swing(i * step);
  if (least == kInfinity) return least;
  double d = 0.5 * step;
  for (std::size_t i = 0; i < tuning().ranges.limits.cone_refinements; ++i, d *= 0.5)
    for (const double psi : {at - d, at + d}) swing(psi);
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

/// The simplest fraction of an interval without 0: the first that the Stern-Brocot tree has within it.
std::pair<int, int> simplest_fraction(const Interval& within) {
  if (within.high < 0.0) {
    const auto [over, under] = simplest_fraction({-within.high, -within.low});
    return {-over, under};
  }
  std::array<int, 2> low{0, 1}, high{1, 0};
  for (;;) {
    const std::array<int, 2> middle{low[0] + high[0], low[1] + high[1]};
    const double value = static_cast<double>(middle[0]) / middle[1];
    if (value >= within.low && value <= within.high) return {middle[0], middle[1]};
    (value < within.low ? low : high) = middle;
  }
}

std::string coupling_sentence(const Assembly& assembly, const DetectedJoint& other, const std::string& freedom,
                              const JointCoupling& c) {
  const auto name = [&](Index i) { return "\"" + assembly.components[static_cast<std::size_t>(i)].name + "\""; };
  return freedom + ": coupled with joint " + std::to_string(c.second.joint) + ", " + name(other.a) + " - " +
         name(other.b) +
         (c.even ? ", which goes " + ratio_text(c) + " times as far." : ", whose speed changes on the way.");
}

/// A freedom with one that goes along.
JointCoupling coupling_of(const std::vector<RangeOfMotion>& ranges, std::size_t joint, std::size_t freedom,
                          const CoupledFreedom& other) {
  const FreedomRange &first = ranges[joint].freedoms[freedom], &second = ranges[other.joint].freedoms[other.freedom];
  Interval ratio = other.ratio;
  for (const CoupledFreedom& back : second.coupled) {
    if (back.joint != joint || back.freedom != freedom || back.ratio.low * back.ratio.high <= 0.0) continue;
    ratio = {std::max(ratio.low, 1.0 / back.ratio.high), std::min(ratio.high, 1.0 / back.ratio.low)};
  }
  JointCoupling out{{joint, is_angle(first.freedom)}, {other.joint, is_angle(second.freedom)}};
  out.even = ratio.low <= ratio.high && ratio.low * ratio.high > 0.0 && ratio.bounded();
  if (!out.even) {
    out.ratio = other.as_read;
  } else if (out.first.turns && out.second.turns) {
    const auto [over, under] = simplest_fraction(ratio);
    out.ratio = static_cast<double>(over) / under;
  } else {
    out.ratio = 0.5 * (ratio.low + ratio.high);
  }
  return out;
}

}  // namespace

std::string ratio_text(const JointCoupling& c) {
  std::string text = number_text(c.ratio, 4);
  if (!c.first.turns || !c.second.turns || c.ratio == 0.0) return text;
  constexpr double kRoundOff = 1e-12;
  const auto [low, high] = std::minmax({c.ratio * (1.0 - kRoundOff), c.ratio * (1.0 + kRoundOff)});
  const auto [over, under] = simplest_fraction({low, high});
  return text + " (" + std::to_string(over) + "/" + std::to_string(under) + ")";
}

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

namespace {

/// All joints of an assembly, to be tried.
struct Task {
  const Assembly& assembly;
  const std::vector<DetectedJoint>& joints;
  const RangeOptions& options;
  std::vector<OrbitBody> bodies = bodies_of(assembly);
  JointGraph graph{static_cast<Index>(assembly.components.size()), joints};

  Trial trial(std::size_t joint, JointSides sides) const {
    return {assembly, bodies, joints[joint], std::move(sides), options.motion.crease_angle};
  }
  JointSides sides(std::size_t joint) const { return graph.sides(joints[joint]); }
};

/// The freedoms of a joint as they are while all other joints stand at 0.
RangeOfMotion tried(const Task& task, std::size_t joint, const std::function<void()>& path_done) {
  RangeOfMotion out{.joint = task.joints[joint].joint, .freedoms = {}, .reasons = {}};
  out.joint.limits = {};
  if (out.joint.type == JointType::kFixed) return out;
  const Trial trial = task.trial(joint, task.sides(joint));
  for (const NamedPath& p : paths_of(out.joint)) {
    out.freedoms.push_back({p.freedom, trial.along(p.path, task.options.motion), {}});
    path_done();
    *p.limit = out.freedoms.back().motion.reachable;
  }
  if (out.joint.type == JointType::kBall) out.joint.limits.cone = cone_of(trial, out.joint, task.options, path_done);
  return out;
}

// Coupled freedoms ----------------------------------------------------------------------------------------------------

/// Freedoms that stop each other within a little play.
class Couplings {
 public:
  /// @param tried per joint
  Couplings(const Task& task, const std::vector<RangeOfMotion>& tried) : task_(task), tried_(tried) {}

  /// Follows the freedoms of a joint that others engage. @param range as tried
  void couple(std::size_t joint, RangeOfMotion& range) const {
    for (std::size_t f = 0; f < range.freedoms.size(); ++f) {
      const Freedom first{joint, f};
      const std::vector<Freedom> partners = partners_of(first);
      if (partners.empty()) continue;
      const FreeMotion own = without(first, partners);
      FreedomRange& freedom = range.freedoms[f];
      Interval reachable = own.reachable;
      for (const Freedom& second : partners) {
        const internal::CoupledMotion m = internal::coupled_motion(
            part(first, second, own.reachable), part(second, first, without(second, partners_of(second)).reachable),
            task_.options.motion);
        if (!m.engaged) continue;
        freedom.coupled.push_back({second.joint, second.freedom, m.ratio, m.as_read});
        reachable = {std::max(reachable.low, m.reachable.low), std::min(reachable.high, m.reachable.high)};
      }
      if (freedom.coupled.empty()) continue;
      freedom.motion.others.clear();
      if (reachable.low == own.reachable.low) freedom.motion.low = own.low;
      if (reachable.high == own.reachable.high) freedom.motion.high = own.high;
      freedom.motion.reachable = *paths_of(range.joint)[f].limit = reachable;
    }
  }

 private:
  struct Freedom {
    std::size_t joint, freedom;
  };
  MotionPath path(const Freedom& f) const {
    JointSpec joint = task_.joints[f.joint].joint;
    return paths_of(joint)[f.freedom].path;
  }
  double size(std::size_t joint) const {
    const auto diagonal = [&](Index c) { return task_.assembly.components[static_cast<std::size_t>(c)].diagonal; };
    return std::min(diagonal(task_.joints[joint].a), diagonal(task_.joints[joint].b));
  }
  /// True if a motion ends both ways within the play of parts that engage.
  bool is_play(const Freedom& f, const FreeMotion& m) const {
    if (m.low.body < 0 || m.high.body < 0) return false;
    const PathFrame frame(path(f));
    const double speed = frame.velocity(frame.to_path(m.high.point)).norm();
    return speed * m.reachable.width() <= tuning().ranges.engaged.play * size(f.joint);
  }
  bool may_engage(const Freedom& f) const {
    const JointType type = task_.joints[f.joint].joint.type;
    return type != JointType::kBall && type != JointType::kPlanar &&
           is_play(f, tried_[f.joint].freedoms[f.freedom].motion);
  }
  /// What a joint moves that another joint does not hold, with the joint's path for it.
  std::optional<std::pair<std::vector<Index>, MotionPath>> branch(const Freedom& of, const Freedom& other) const;
  internal::EngagedPart part(const Freedom& of, const Freedom& other, const Interval& limits) const {
    auto [which, path] = *branch(of, other);
    return {some_of(task_.bodies, which), path, limits};
  }
  std::vector<Freedom> partners_of(const Freedom& first) const;
  FreeMotion without(const Freedom& f, const std::vector<Freedom>& partners) const;

  const Task& task_;
  const std::vector<RangeOfMotion>& tried_;
};

std::optional<std::pair<std::vector<Index>, MotionPath>> Couplings::branch(const Freedom& of,
                                                                           const Freedom& other) const {
  const JointSides sides = task_.sides(of.joint);
  const DetectedJoint& o = task_.joints[other.joint];
  const auto has = [&](const std::vector<Index>& side) {
    return std::ranges::binary_search(side, o.a) && std::ranges::binary_search(side, o.b);
  };
  MotionPath along = path(of);
  if (has(sides.fixed)) return std::pair(sides.moving, along);
  if (!has(sides.moving)) return {};
  along.axis = -along.axis;  // it is the other side that moves, the other way
  return std::pair(sides.fixed, along);
}

std::vector<Couplings::Freedom> Couplings::partners_of(const Freedom& first) const {
  std::vector<Freedom> out;
  if (!may_engage(first)) return out;
  const auto box_of = [](const internal::EngagedPart& part) {
    Eigen::AlignedBox3d box;
    for (const OrbitBody& body : part.bodies) box.extend(body.box);
    return box;
  };
  for (std::size_t j = 0; j < tried_.size(); ++j)
    for (std::size_t f = 0; f < tried_[j].freedoms.size(); ++f) {
      const Freedom second{j, f};
      if (j == first.joint || !may_engage(second) || !branch(first, second) || !branch(second, first)) continue;
      const internal::EngagedPart a = part(first, second, {}), b = part(second, first, {});
      if (!box_of(a).intersects(box_of(b))) continue;
      const auto alone = internal::stopped_both_ways(a, b, task_.options.motion);
      if (alone && is_play(first, *alone)) out.push_back(second);
    }
  return out;
}

/// A freedom's motion while what engages it is away.
FreeMotion Couplings::without(const Freedom& f, const std::vector<Freedom>& partners) const {
  JointSides sides = task_.sides(f.joint);
  for (const Freedom& partner : partners) {
    const std::vector<Index> away = branch(partner, f)->first;
    for (auto* side : {&sides.moving, &sides.fixed})
      std::erase_if(*side, [&](Index c) { return std::ranges::binary_search(away, c); });
  }
  return task_.trial(f.joint, std::move(sides)).along(path(f), task_.options.motion);
}

// Telling -------------------------------------------------------------------------------------------------------------

/// Adds the reasons, and takes out freedoms that are too narrow.
void tell(const Task& task, std::size_t joint, std::vector<RangeOfMotion>& ranges) {
  RangeOfMotion& range = ranges[joint];
  if (range.joint.type == JointType::kFixed) return;
  for (std::size_t f = 0; f < range.freedoms.size(); ++f) {
    const FreedomRange& freedom = range.freedoms[f];
    range.reasons.push_back(range_sentence(task.assembly, freedom));
    for (const CoupledFreedom& c : freedom.coupled)
      range.reasons.push_back(
          coupling_sentence(task.assembly, task.joints[c.joint], freedom.freedom, coupling_of(ranges, joint, f, c)));
  }
  if (range.joint.type == JointType::kBall)
    range.reasons.push_back("swing of x: " +
                            (range.joint.limits.cone < kInfinity
                                 ? "at least " + degrees_text(range.joint.limits.cone) + " in every direction."
                                 : std::string("nothing stops it.")));
  if (range.joint.type == JointType::kCylindrical && range.joint.pitch != 0.0) {
    const Interval turn = range.joint.limits.rotation;
    const auto [low, high] = std::minmax({range.joint.pitch * turn.low, range.joint.pitch * turn.high});
    range.joint.limits.translation[0] = {low, high};
  }
  const auto overlaps = [](const FreedomRange& f) { return f.motion.overlapping; };
  if (std::any_of(range.freedoms.begin(), range.freedoms.end(), overlaps))
    range.reasons.push_back("The parts overlap as read by more than " +
                            number_text(range.freedoms.front().motion.tolerance) + ": such places count as no stop.");
  const RangeOptions& o = task.options;
  range.joint = without_narrow_freedoms(range.joint, o.min_rotation,
                                        o.min_translation * task.trial(joint, task.sides(joint)).size(), range.reasons);
}

}  // namespace

RangeOfMotion range_of_motion(const Assembly& assembly, const std::vector<DetectedJoint>& joints, std::size_t joint,
                              const RangeOptions& options) {
  options.validate();
  if (joint >= joints.size())
    throw InvalidArgument("range_of_motion: joint " + std::to_string(joint) + " of " + std::to_string(joints.size()));
  return ranges_of_motion(assembly, joints, options).at(joint);
}

std::vector<RangeOfMotion> ranges_of_motion(const Assembly& assembly, const std::vector<DetectedJoint>& joints,
                                            const RangeOptions& options, Jobs& jobs) {
  options.validate();
  const Task task{assembly, joints, options};
  std::vector<RangeOfMotion> alone(joints.size());
  std::size_t paths = 0;
  for (const DetectedJoint& j : joints) paths += path_count(j.joint, options);
  internal::CountedProgress progress(paths, options.progress);
  jobs.parallel_for(joints.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) alone[j] = tried(task, j, [&] { progress.done(); });
  });
  std::vector<RangeOfMotion> out = alone;
  const Couplings couplings(task, alone);
  jobs.parallel_for(joints.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) couplings.couple(j, out[j]);
  });
  for (std::size_t j = 0; j < joints.size(); ++j) tell(task, j, out);
  return out;
}

std::vector<JointCoupling> joint_couplings(const std::vector<RangeOfMotion>& ranges) {
  std::vector<JointCoupling> out;
  for (std::size_t j = 0; j < ranges.size(); ++j)
    for (std::size_t f = 0; f < ranges[j].freedoms.size(); ++f)
      for (const CoupledFreedom& c : ranges[j].freedoms[f].coupled) {
        const JointCoupling coupling = coupling_of(ranges, j, f, c);
        const bool kept =
            has_axis(ranges[j].joint, coupling.first.turns) && has_axis(ranges[c.joint].joint, coupling.second.turns);
        if (j < c.joint && kept) out.push_back(coupling);
      }
  return out;
}

}  // namespace limber
