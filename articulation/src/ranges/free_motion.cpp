#include "limber/articulation/free_motion.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "constants.h"
#include "limber/core/error.h"
#include "ranges/encounters.h"
#include "ranges/free_motion_of_bodies.h"
#include "ranges/motion_search.h"
#include "tuning.h"

namespace limber {
namespace {

using internal::kPi;
using internal::OrbitBody;
using internal::PathFrame;
using internal::Tolerances;
using internal::tuning;

double diagonal(std::span<const OrbitBody> bodies) {
  Eigen::AlignedBox3d box;
  for (const OrbitBody& b : bodies) box.extend(b.box);
  return box.isEmpty() ? 0.0 : box.diagonal().norm();
}

void validate(std::span<const MotionBody> bodies, const char* which) {
  if (bodies.empty()) throw InvalidArgument(std::string("free_motion: there is no ") + which + " body");
  for (const MotionBody& b : bodies)
    if (b.surface == nullptr) throw InvalidArgument(std::string("free_motion: a ") + which + " surface is null");
}

void validate(const MotionPath& path) {
  constexpr double kUnit = 1e-6;  // six digits, as files have them, are a unit vector
  if (!path.origin.allFinite() || !(std::abs(path.axis.norm() - 1.0) <= kUnit))
    throw InvalidArgument("free_motion: the path's axis has length " + std::to_string(path.axis.norm()) +
                          ", expected 1, and a finite origin");
  if (path.kind == MotionPath::Kind::kScrew && (!std::isfinite(path.pitch) || path.pitch == 0.0))
    throw InvalidArgument("free_motion: a screw needs a pitch that is not 0");
}

}  // namespace

void FreeMotionOptions::validate() const {
  if (!(tolerance >= 0.0) || !(largest_overlap >= 0.0))
    throw InvalidArgument("FreeMotionOptions: tolerance is " + std::to_string(tolerance) + " and largest_overlap " +
                          std::to_string(largest_overlap) + ", expected numbers >= 0");
  if (!(crease_angle >= 0.0 && crease_angle <= kPi))
    throw InvalidArgument("FreeMotionOptions: crease_angle is " + std::to_string(crease_angle) + ", expected 0 to pi");
  if (!(within.low <= 0.0 && within.high >= 0.0))
    throw InvalidArgument("FreeMotionOptions: within is " + std::to_string(within.low) + " to " +
                          std::to_string(within.high) + ", expected an interval that 0 belongs to");
}

namespace {

/// True if an interval lies within [low, high], 0 in it; @param period of the path, or 0
bool lies_within(const Interval& i, double low, double high, double period) {
  for (const double turned : {0.0, period, -period})
    if (i.low + turned >= low && i.high + turned <= high) return true;
  return false;
}

/// Bodies beyond the nearest ones cannot change where the motion ends: they are looked at alone, and more of them
/// only if it does not end among them.
FreeMotion motion_among_nearest(const PathFrame& frame, std::span<const OrbitBody> moving,
                                std::span<const OrbitBody> fixed, const Tolerances& t,
                                const FreeMotionOptions& options) {
  const internal::Encounters encounters(frame, moving, fixed, t.largest_overlap + t.nudge);
  for (std::size_t pairs = tuning().ranges.limits.nearest_pairs;; pairs *= tuning().ranges.limits.pairs_growth) {
    const auto near = encounters.nearest(pairs);
    FreeMotion m = internal::search_motion(frame, internal::some_of(moving, near.moving),
                                           internal::some_of(fixed, near.fixed), t, options);
    if (std::max(m.reachable.low, options.within.low) < near.low ||
        std::min(m.reachable.high, options.within.high) > near.high)
      continue;
    for (MotionStop* stop : {&m.low, &m.high})
      if (stop->body >= 0) stop->body = near.fixed[static_cast<std::size_t>(stop->body)];
    const double period = frame.kind() == MotionPath::Kind::kRotation ? 2.0 * kPi : 0.0;
    std::erase_if(m.others, [&](const Interval& i) { return !lies_within(i, near.low, near.high, period); });
    return m;
  }
}

}  // namespace

namespace internal {

FreeMotion free_motion(std::span<const OrbitBody> moving, std::span<const OrbitBody> fixed, const MotionPath& path,
                       const FreeMotionOptions& options, double sagitta) {
  const double size = std::min(diagonal(moving), diagonal(fixed));
  const auto given = [](double value, double otherwise) { return value > 0.0 ? value : otherwise; };
  const double least = given(options.tolerance, tuning().ranges.limits.tolerance * size);
  const double overlap = given(options.largest_overlap, tuning().ranges.limits.largest_overlap * size);
  const Tolerances t{.across = least,
                     .facets = sagitta,
                     .largest_overlap = std::max(overlap, least + sagitta),
                     .nudge = tuning().ranges.limits.nudge * least};
  return motion_among_nearest(PathFrame(path), moving, fixed, t, options);
}

}  // namespace internal

FreeMotion free_motion(std::span<const MotionBody> moving, std::span<const MotionBody> fixed, const MotionPath& path,
                       const FreeMotionOptions& options, double sagitta) {
  options.validate();
  validate(moving, "moving");
  validate(fixed, "fixed");
  validate(path);
  const auto ready = [](std::span<const MotionBody> bodies) {
    std::vector<OrbitBody> out;
    for (const MotionBody& body : bodies) out.push_back(internal::orbit_body(body));
    return out;
  };
  return internal::free_motion(ready(moving), ready(fixed), path, options, sagitta);
}

double facet_sagitta(const SurfaceMesh& surface, const Vec3& low, const Vec3& high, double crease) {
  struct Bend {
    Vec3 normal;
    double width;
  };
  const auto within = [&](const Vec3& p) {
    return (p.array() >= low.array()).all() && (p.array() <= high.array()).all();
  };
  double largest = 0.0;
  std::map<std::pair<Index, Index>, Bend> open;
  for (const Triangle& t : surface.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [a, b] = std::minmax(t[i], t[(i + 1) % 3]);
      const Vec3 &pa = surface.vertices[a], &pb = surface.vertices[b], &pc = surface.vertices[t[(i + 2) % 3]];
      if (!within(pa) && !within(pb)) continue;
      const Vec3 area =
          (surface.vertices[t[1]] - surface.vertices[t[0]]).cross(surface.vertices[t[2]] - surface.vertices[t[0]]);
      const double length = (pb - pa).norm();
      if (!(length > 0.0) || !(area.norm() > 0.0)) continue;
      const Bend bend{area.normalized(), (pc - pa).cross(pb - pa).norm() / length};
      const auto [entry, fresh] = open.try_emplace({a, b}, bend);
      if (fresh) continue;
      const double angle =
          std::atan2(entry->second.normal.cross(bend.normal).norm(), entry->second.normal.dot(bend.normal));
      if (angle < crease)
        largest = std::max(largest, 0.5 * std::max(entry->second.width, bend.width) * std::tan(0.25 * angle));
    }
  return largest;
}

}  // namespace limber
