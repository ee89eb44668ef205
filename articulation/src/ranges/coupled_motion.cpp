#include "ranges/coupled_motion.h"

#include <algorithm>
#include <cmath>

#include "constants.h"
#include "ranges/free_motion_of_bodies.h"
#include "ranges/path_frame.h"
#include "tuning.h"

namespace limber::internal {
namespace {

using Kind = MotionPath::Kind;

double middle(const Interval& i) { return 0.5 * (i.low + i.high); }

/// Bodies moved along their path.
struct Posed {
  Posed(const EngagedPart& part, double t) {
    const PathFrame frame(part.path);
    surfaces.reserve(part.bodies.size());
    for (const OrbitBody& body : part.bodies) {
      surfaces.push_back(*body.surface);
      for (Vec3& p : surfaces.back().vertices) p = frame.from_path(frame.moved(frame.to_path(p), t));
      bodies.push_back(orbit_body({&surfaces.back(), body.closed, body.caps}));
    }
  }
  std::vector<SurfaceMesh> surfaces;
  std::vector<OrbitBody> bodies;
};

class Engagement {
 public:
  Engagement(const EngagedPart& first, const EngagedPart& second, const FreeMotionOptions& options)
      : first_(first), second_(second), options_(options) {
    options_.reachable_only = true;
    options_.within = {};
  }

  CoupledMotion follow() {
    const std::optional<Interval> play = second_at(0.0, 0.0);
    if (!play || !play->bounded() || !(play->width() > 0.0)) return {};
    const FreeMotion own = free_motion(first_.bodies, Posed(second_, middle(*play)).bodies, first_.path, options_, 0.0);
    if (own.overlapping || !own.reachable.bounded()) return {};
    out_.engaged = true;
    options_.largest_overlap = own.tolerance;  // on the way parts overlap by no more than as drawn
    start_ = middle(*play);
    out_.as_read = slope_within(0.5 * std::min(own.reachable.high, -own.reachable.low));
    out_.reachable.high = march(1.0, own.reachable.high, first_.limits.high);
    out_.reachable.low = -march(-1.0, -own.reachable.low, -first_.limits.low);
    return out_;
  }

 private:
  /// Where the first stands at q, the free interval of the second around `at`; none if they overlap there.
  /// @param near as far its ends are looked for first
  std::optional<Interval> second_at(double q, double at, double near = kInfinity) const {
    const Posed moving(second_, at), standing(first_, q);
    FreeMotionOptions options = options_;
    options.within = {-near, near};
    FreeMotion m = free_motion(moving.bodies, standing.bodies, second_.path, options, 0.0);
    if (m.reachable.low < -near || m.reachable.high > near)
      m = free_motion(moving.bodies, standing.bodies, second_.path, options_, 0.0);
    if (m.overlapping || !(m.reachable.low < 0.0 && m.reachable.high > 0.0)) return {};
    return Interval{at + m.reachable.low, at + m.reachable.high};
  }

  /// Of the second's middle while the first goes from −q to q. @param q within its play: the second is free there
  double slope_within(double q) const {
    const std::optional<Interval> low = second_at(-q, start_), high = second_at(q, start_);
    return low && high && q > 0.0 ? (middle(*high) - middle(*low)) / (2.0 * q) : 0.0;
  }

  /// The longest step of the first that turns neither part by more than a part of a turn.
  double longest(double slope) const {
    const double turn = tuning().ranges.engaged.longest_turn;
    double out = kInfinity;
    if (first_.path.kind != Kind::kTranslation) out = turn;
    if (second_.path.kind != Kind::kTranslation && slope != 0.0) out = std::min(out, turn / std::abs(slope));
    return out;
  }

  /// How far the first goes in one sense, ≥ 0. @param play how far it goes alone. @param limit of its own
  double march(double sense, double play, double limit) {
    const auto& tuned = tuning().ranges.engaged;
    const bool turns = first_.path.kind == Kind::kRotation;
    double done = 0.0, place = start_, slope = 0.0, step = 0.5 * play;
    const double least = tuned.least_step * step;
    double near = kInfinity;
    while (done < limit && !(turns && done >= 2.0 * kPi)) {
      const double h = std::min({step, longest(slope), limit - done}), foreseen = place + slope * sense * h;
      const std::optional<Interval> at = second_at(sense * (done + h), foreseen, near);
      if (at && !at->bounded()) return limit;  // apart
      const double miss = at ? std::abs(middle(*at) - foreseen) / at->width() : kInfinity;
      if (!(miss < tuned.most_miss)) {
        step = 0.5 * h;
        if (!(step > least)) return done;
        continue;
      }
      done += h;
      slope = (middle(*at) - place) / (sense * h);
      place = middle(*at), near = at->width();
      keep_ratios(sense * done, *at);
      if (miss < tuned.small_miss) step = 2.0 * h;
      if (place < second_.limits.low || place > second_.limits.high)
        return done - (place - std::clamp(place, second_.limits.low, second_.limits.high)) / (sense * slope);
    }
    return done < limit ? kInfinity : limit;
  }

  /// Keeps the ratios that lead from the middle of the play into an interval.
  void keep_ratios(double q, const Interval& at) {
    const auto [low, high] = std::minmax({(at.low - start_) / q, (at.high - start_) / q});
    out_.ratio = {std::max(out_.ratio.low, low), std::min(out_.ratio.high, high)};
  }

  const EngagedPart &first_, &second_;
  FreeMotionOptions options_;
  CoupledMotion out_;
  double start_ = 0.0;  ///< of the second: the middle of its play as drawn
};

}  // namespace

std::optional<FreeMotion> stopped_both_ways(const EngagedPart& moving, const EngagedPart& standing,
                                            const FreeMotionOptions& options) {
  FreeMotionOptions reachable = options;
  reachable.reachable_only = true;
  FreeMotion m = free_motion(moving.bodies, standing.bodies, moving.path, reachable, 0.0);
  if (m.overlapping || !m.reachable.bounded()) return {};
  return m;
}

CoupledMotion coupled_motion(const EngagedPart& first, const EngagedPart& second, const FreeMotionOptions& options) {
  return Engagement(first, second, options).follow();
}

}  // namespace limber::internal
