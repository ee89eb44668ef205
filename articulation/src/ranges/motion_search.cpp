#include "ranges/motion_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "constants.h"
#include "limber/core/disjoint_sets.h"
#include "limber/mesh/corner_tree.h"
#include "limber/mesh/winding_number.h"
#include "ranges/sliding_places.h"
#include "ranges/spans.h"
#include "ranges/triangle_crossings.h"
#include "tuning.h"

namespace limber::internal {
namespace {

constexpr double kNoGap = 1e-9;  // rad or length: what two crossings leave between them by round-off

/// The faces of one side that can stop a motion.
struct Side {
  /// @param along per face of `all`: see SlidingPlaces
  Side(const SlidingPlaces& places, const std::vector<char>& along, const std::vector<OrbitFace>& all) {
    std::vector<OrbitBox> boxes;
    for (std::size_t f = 0; f < all.size(); ++f) {
      if (all[f].cap || all[f].normal.isZero() || places.holds(all[f])) continue;
      faces.push_back(all[f]);
      meeting.emplace_back(all[f]);
      around.emplace_back();
      for (const Vec3& p : all[f].corners) around.back().extend(p);
      runs_along.push_back(along[f]);
      boxes.push_back(all[f].box);
    }
    tree.emplace(boxes);
  }
  std::vector<OrbitFace> faces;
  std::vector<MeetingFace> meeting;
  std::vector<Eigen::AlignedBox3d> around;  ///< as drawn, path coordinates
  std::vector<char> runs_along;
  std::optional<OrbitBoxTree> tree;
};

/// Positions at which a pair of triangles crosses.
struct Block {
  double low = 0.0, high = 0.0;
  double speed = 0.0;            ///< length per unit of t
  TriangleCrossing first, last;  ///< of those that follow each other without a break
  Index body = 0;
  bool sheet = false;
};

/// The ends and the middle of what two triangles share halfway of a crossing.
std::array<Vec3, 3> points_of(const TriangleCrossing& c) {
  return {c.at_middle[0], c.at_middle[1], 0.5 * (c.at_middle[0] + c.at_middle[1])};
}

/// Calls use(t from, t to) for the parts of a path on which a moving face may meet a fixed one.
template <class Use>
void windows(const PathFrame& frame, const OrbitFace& moving, const OrbitFace& fixed, Use&& use) {
  if (frame.kind() != MotionPath::Kind::kScrew) return use(Interval{});
  const auto along = [](const OrbitFace& f) {
    return std::minmax({f.corners[0].x(), f.corners[1].x(), f.corners[2].x()});
  };
  const auto [m_low, m_high] = along(moving);
  const auto [f_low, f_high] = along(fixed);
  const auto [low, high] = std::minmax({(f_low - m_high) / frame.pitch(), (f_high - m_low) / frame.pitch()});
  const double half = std::min(moving.sector.half + fixed.sector.half, kPi), turn = 2.0 * kPi;
  const double apart = fixed.sector.bearing - moving.sector.bearing;
  for (double k = std::ceil((low - half - apart) / turn); apart + turn * k - half <= high; ++k) {
    const double middle = apart + turn * k;
    use(Interval{std::max(low, middle - half), std::min(high, middle + half)});
  }
}

/// A vertex of each connected piece of a surface.
std::vector<Vec3> one_of_each_shell(const SurfaceMesh& surface) {
  DisjointSets shells(surface.vertices.size());
  for (const Triangle& t : surface.triangles) shells.join(t[0], t[1]), shells.join(t[0], t[2]);
  std::vector<Index> roots;
  for (const Triangle& t : surface.triangles) roots.push_back(shells.root(t[0]));
  std::sort(roots.begin(), roots.end());
  roots.erase(std::unique(roots.begin(), roots.end()), roots.end());
  std::vector<Vec3> out;
  for (const Index v : roots) out.push_back(surface.vertices[static_cast<std::size_t>(v)]);
  return out;
}

bool holds_point(const OrbitBody& body, const Vec3& p) {
  constexpr double kInside = 0.5;
  if (!body.closed || !body.box.contains(p)) return false;
  SurfaceMesh whole = *body.surface;
  whole.triangles.insert(whole.triangles.end(), body.caps.begin(), body.caps.end());
  return std::abs(winding_number(whole, p)) > kInside;
}

/// Places in the lists of moving and fixed faces.
using FacePairs = std::vector<std::pair<std::size_t, std::size_t>>;

/// Pairs of faces that cross as drawn.
FacePairs crossing_as_drawn(const std::vector<OrbitFace>& moving_faces, const std::vector<OrbitFace>& fixed_faces) {
  const auto bounds = [](const OrbitFace& f) { return !f.cap && !f.normal.isZero(); };
  std::vector<CornerTree<3>::Corners> corners;
  for (const OrbitFace& f : fixed_faces) corners.push_back(f.corners);
  FacePairs out;
  if (corners.empty()) return out;
  CornerTree<3> tree;
  tree.build(corners);
  std::array<Vec3, 2> segment;
  for (std::size_t m = 0; m < moving_faces.size(); ++m) {
    if (!bounds(moving_faces[m])) continue;
    Eigen::AlignedBox3d box;
    for (const Vec3& p : moving_faces[m].corners) box.extend(p);
    tree.any_leaf([&](std::size_t node) { return tree.box(node).intersects(box); },
                  [&](Index first, Index end) {
                    for (const Index e : tree.elements(first, end)) {
                      const auto f = static_cast<std::size_t>(e);
                      if (bounds(fixed_faces[f]) && cross_as_drawn(moving_faces[m], fixed_faces[f], segment))
                        out.emplace_back(m, f);
                    }
                    return false;
                  });
  }
  return out;
}

/// All blocked positions along one path.
class Search {
 public:
  Search(const PathFrame& frame, std::span<const OrbitBody> moving, std::span<const OrbitBody> fixed,
         const Tolerances& tolerances, const FreeMotionOptions& options)
      : frame_(frame),
        moving_(moving),
        fixed_(fixed),
        tolerances_(tolerances),
        options_(options),
        all_pairs_(!options.reachable_only),
        triangles_(frame, tolerances.nudge) {}

  FreeMotion run(const std::vector<OrbitFace>& moving_faces, const std::vector<OrbitFace>& fixed_faces) {
    const auto places_within = [&](double across) {
      return SlidingPlaces(frame_, moving_faces, fixed_faces, across, tolerances_.nudge, options_.crease_angle);
    };
    // Overlap as drawn is a matter of drawing, not of motion: δ grows until it slides, as far as δ may. What slides
    // within δ slides within all that are larger, so that the number of steps is found by halving.
    double overlap = tolerances_.across;
    const auto grow_until_slide = [&](const std::vector<Vec3>& points) {
      if (points.empty()) return;
      const auto slide = [&](double across) {
        const SlidingPlaces places = places_within(across);
        return std::all_of(points.begin(), points.end(), [&](const Vec3& p) { return places.holds(p); });
      };
      const auto grown = [&, from = overlap](int steps) {
        return std::min(from * std::pow(tuning().ranges.against.overlap_growth, steps), tolerances_.largest_overlap);
      };
      int most = 0;
      while (grown(most) < tolerances_.largest_overlap) ++most;
      for (int least = 0; least < most;)
        if (const int middle = (least + most) / 2; slide(grown(middle)))
          most = middle;
        else
          least = middle + 1;
      overlap = grown(most);
    };
    if (const FacePairs crossing = crossing_as_drawn(moving_faces, fixed_faces); !crossing.empty())
      grow_until_slide(overlaps_as_drawn(places_within(overlap), moving_faces, fixed_faces, crossing));
    for (;;) {
      tolerances_.across = std::min(overlap + tolerances_.facets, tolerances_.largest_overlap);
      const SlidingPlaces places = places_within(tolerances_.across);
      blocks_.clear(), overlapping_ = false, between_stops_ = options_.within;
      find_blocks(places, Side(places, places.moving_along(), moving_faces),
                  Side(places, places.fixed_along(), fixed_faces));
      for (;;) {
        const auto [below, above] = blocked();
        const std::vector<Vec3> buried = take_buried(places, below, above);
        overlapping_ = overlapping_ || !buried.empty();
        if (buried.empty()) return result(places, below, above);
        if (tolerances_.across < tolerances_.largest_overlap)
          grow_until_slide(buried);
        else if (all_pairs_)
          continue;
        all_pairs_ = true;  // what lies beyond these may end the motion
        break;
      }
    }
  }

 private:
  bool circle() const { return frame_.kind() == MotionPath::Kind::kRotation; }
  template <class Use>
  void pairs(const Side& moving, const Side& fixed, Use&& use) const;
  struct FaceOf {
    const OrbitFace& face;
    const MeetingFace& meeting;
  };
  const std::vector<Block>& blocks_of(const SlidingPlaces& places, const FaceOf& moving, const FaceOf& fixed);
  std::vector<Vec3> overlaps_as_drawn(const SlidingPlaces& places, const std::vector<OrbitFace>& moving_faces,
                                      const std::vector<OrbitFace>& fixed_faces, const FacePairs& crossing);
  void find_blocks(const SlidingPlaces& places, const Side& moving, const Side& fixed);
  std::vector<Vec3> take_buried(const SlidingPlaces& places, const Spans& below, const Spans& above);
  bool inside_as_drawn(std::span<const OrbitBody> bodies, const Vec3& p) const;
  std::vector<Vec3> buried_points(const SlidingPlaces& places, const TriangleCrossing& crossing) const;
  bool deep(const Block& b) const;
  void join(Index body, bool sheet);
  bool meet_beyond(const Interval& stops, const Side& moving, std::size_t m, const Side& fixed, std::size_t f) const;
  std::pair<Spans, Spans> blocked() const;
  void hide_behind_sheets(Spans& below, Spans& above) const;
  void add_split(double low, double high, Spans& below, Spans& above) const;
  bool leaves(const Span& span, bool rising) const;
  bool contained(const SlidingPlaces& places, double t) const;
  MotionStop stop_at(double t, bool rising) const;
  FreeMotion result(const SlidingPlaces& places, const Spans& below, const Spans& above) const;

  const PathFrame& frame_;
  std::span<const OrbitBody> moving_, fixed_;
  Tolerances tolerances_;
  const FreeMotionOptions& options_;
  bool all_pairs_;  ///< those beyond the nearest stops, too
  TriangleCrossings triangles_;
  std::vector<TriangleCrossing> crossings_;  ///< of one pair
  std::vector<Block> pair_;                  ///< of the same
  std::vector<Block> blocks_;
  bool overlapping_ = false;  ///< something overlaps as drawn that does not slide
  Interval between_stops_;    ///< those found so far, apart from what crosses as drawn
};

// Calls use(place in moving, place in fixed) for all pairs of faces that may meet.
template <class Use>
void Search::pairs(const Side& moving, const Side& fixed, Use&& use) const {
  const double turn = frame_.kind() == MotionPath::Kind::kScrew ? 2.0 * kPi * std::abs(frame_.pitch()) : 0.0;
  for (std::size_t m = 0; m < moving.faces.size(); ++m) {
    const auto meet = [&](Index place) {
      const auto f = static_cast<std::size_t>(fixed.tree->order()[static_cast<std::size_t>(place)]);
      if (!moving.runs_along[m] || !fixed.runs_along[f]) use(m, f);
      return false;
    };
    OrbitBox box = moving.faces[m].box;
    fixed.tree->any_overlapping(box, meet);
    if (turn == 0.0) continue;
    for (const double turned : {turn, -2.0 * turn}) {
      box.low[1] += turned, box.high[1] += turned;
      fixed.tree->any_overlapping(box, meet);
    }
  }
}

// What a pair of faces blocks outside of the places where they slide.
const std::vector<Block>& Search::blocks_of(const SlidingPlaces& places, const FaceOf& moving, const FaceOf& fixed) {
  crossings_.clear();
  windows(frame_, moving.face, fixed.face,
          [&](const Interval& window) { triangles_.find(moving.meeting, fixed.meeting, window, crossings_); });
  std::erase_if(crossings_, [&](const TriangleCrossing& c) {
    const std::array<Vec3, 3> points = points_of(c);
    return std::all_of(points.begin(), points.end(), [&](const Vec3& p) { return places.holds(p); });
  });
  const bool sheet = !moving_[static_cast<std::size_t>(moving.face.body)].closed ||
                     !fixed_[static_cast<std::size_t>(fixed.face.body)].closed;
  join(fixed.face.body, sheet);
  return pair_;
}

// Places where faces cross as drawn, deeper than the tolerance whichever way they move.
std::vector<Vec3> Search::overlaps_as_drawn(const SlidingPlaces& places, const std::vector<OrbitFace>& moving_faces,
                                            const std::vector<OrbitFace>& fixed_faces, const FacePairs& crossing) {
  std::vector<Vec3> out;
  for (const auto& [m, f] : crossing) {
    const OrbitFace &moving = moving_faces[m], &fixed = fixed_faces[f];
    if (places.moving_along()[m] && places.fixed_along()[f]) continue;
    const std::vector<Block>& blocks = blocks_of(places, {moving, MeetingFace(moving)}, {fixed, MeetingFace(fixed)});
    std::array<Vec3, 2> segment;
    if (std::any_of(blocks.begin(), blocks.end(), [&](const Block& b) { return deep(b); }) &&
        cross_as_drawn(moving, fixed, segment))
      out.insert(out.end(), segment.begin(), segment.end());
  }
  return out;
}

void Search::find_blocks(const SlidingPlaces& places, const Side& moving, const Side& fixed) {
  pairs(moving, fixed, [&](std::size_t m, std::size_t f) {
    if (meet_beyond(all_pairs_ ? options_.within : between_stops_, moving, m, fixed, f)) return;
    for (const Block& b : blocks_of(places, {moving.faces[m], moving.meeting[m]}, {fixed.faces[f], fixed.meeting[f]})) {
      if (deep(b)) {
        overlapping_ = true;
        continue;
      }
      blocks_.push_back(b);
      for (const double turned : {0.0, circle() ? 2.0 * kPi : 0.0, circle() ? -2.0 * kPi : 0.0}) {
        const double low = b.low + turned, high = b.high + turned;
        if (low > 0.0) between_stops_.high = std::min(between_stops_.high, low);
        if (high < 0.0) between_stops_.low = std::max(between_stops_.low, high);
      }
    }
  });
}

// True if two faces come together only where a stop is known, or nobody asks.
bool Search::meet_beyond(const Interval& stops, const Side& moving, std::size_t m, const Side& fixed,
                         std::size_t f) const {
  if (!circle()) return false;
  if (const double furthest = std::max(-stops.low, stops.high); furthest < kPi) {
    const double chord = 2.0 * std::sin(0.5 * furthest) * moving.faces[m].box.high[0];
    if (moving.around[m].squaredExteriorDistance(fixed.around[f]) > chord * chord) return true;
  }
  const OrbitSector &of_m = moving.faces[m].sector, &of_f = fixed.faces[f].sector;
  const double half = of_m.half + of_f.half;
  if (half >= kPi) return false;
  const double middle = wrapped(of_f.bearing - of_m.bearing);
  for (const double t : {middle - 2.0 * kPi, middle, middle + 2.0 * kPi})
    if (t + half >= stops.low && t - half <= stops.high) return false;
  return true;
}

// The crossings of a pair as blocks: those that follow each other without a break are one.
void Search::join(Index body, bool sheet) {
  pair_.clear();
  for (const TriangleCrossing& c : crossings_) {
    if (!pair_.empty() && c.low - pair_.back().high <= kNoGap) {
      pair_.back().high = c.high, pair_.back().last = c;
      continue;
    }
    const double speed = frame_.velocity(0.5 * (c.at_middle[0] + c.at_middle[1])).norm();
    pair_.push_back({c.low, c.high, speed, c, c, body, sheet});
  }
  if (!circle()) return;
  const double turn = 2.0 * kPi;
  if (pair_.size() > 1 && pair_.front().low + turn - pair_.back().high <= kNoGap) {
    pair_.front().low = pair_.back().low - turn, pair_.front().first = pair_.back().first;
    pair_.pop_back();
  }
  for (Block& b : pair_)
    if (b.low < turn && b.high > turn) b.low -= turn, b.high -= turn;
}

// What crosses as drawn, deeper than the tolerance whichever way it moves, is a matter of drawing.
bool Search::deep(const Block& b) const {
  return b.low < 0.0 && b.high > 0.0 && std::min(-b.low, b.high) * b.speed > tolerances_.across;
}

// True if a body holds a place as drawn, and so far to either side along the motion as the tolerance says.
bool Search::inside_as_drawn(std::span<const OrbitBody> bodies, const Vec3& p) const {
  const double speed = frame_.velocity(p).norm();
  if (!(speed > 0.0)) return false;
  const double t = tolerances_.across / speed;
  return std::any_of(bodies.begin(), bodies.end(), [&](const OrbitBody& body) {
    return holds_point(body, frame_.from_path(p)) && holds_point(body, frame_.from_path(frame_.moved(p, t))) &&
           holds_point(body, frame_.from_path(frame_.moved(p, -t)));
  });
}

// Points of a crossing that one of the bodies has within the other as drawn: it does not enter there, it leaves.
std::vector<Vec3> Search::buried_points(const SlidingPlaces& places, const TriangleCrossing& c) const {
  std::vector<Vec3> out;
  for (const Vec3& p : points_of(c))
    if (!places.holds(p) &&
        (inside_as_drawn(fixed_, frame_.moved(p, -0.5 * (c.low + c.high))) || inside_as_drawn(moving_, p)))
      out.push_back(p);
  return out;
}

// Blocks at either end of the reachable interval that are overlap as drawn are taken out. @return points of theirs
std::vector<Vec3> Search::take_buried(const SlidingPlaces& places, const Spans& below, const Spans& above) {
  std::vector<Vec3> out;
  const auto buried = [&](const Block& b, double end, bool rising) {
    const double turned =
        circle() ? std::remainder((rising ? b.low : b.high) - end, 2.0 * kPi) : (rising ? b.low : b.high) - end;
    if (end == 0.0 || std::abs(turned) > kNoGap) return false;
    const std::vector<Vec3> points = buried_points(places, rising ? b.first : b.last);
    out.insert(out.end(), points.begin(), points.end());
    return !points.empty();
  };
  if (!above.empty()) std::erase_if(blocks_, [&](const Block& b) { return buried(b, above.front().low, true); });
  if (!below.empty()) std::erase_if(blocks_, [&](const Block& b) { return buried(b, below.back().high, false); });
  return out;
}

// Into what lies below 0 and above; a circle is cut at ±π.
void Search::add_split(double low, double high, Spans& below, Spans& above) const {
  const auto put = [&](double from, double to) {
    if (from < 0.0) below.push_back({from, std::min(to, 0.0)});
    if (to > 0.0) above.push_back({std::max(from, 0.0), to});
  };
  if (!circle()) return put(low, high);
  for (const double turned : {-2.0 * kPi, 0.0, 2.0 * kPi})
    if (const double from = std::max(low + turned, -kPi), to = std::min(high + turned, kPi); from < to) put(from, to);
}

// Surfaces that touch or overlap by less than δ as drawn do not block the way out.
bool Search::leaves(const Span& span, bool rising) const {
  if ((rising ? span.low : span.high) != 0.0) return false;
  return std::none_of(blocks_.begin(), blocks_.end(), [&](const Block& b) {
    if (b.high < span.low || b.low > span.high) return false;
    return (rising ? b.high : -b.low) * b.speed > tolerances_.across;
  });
}

std::pair<Spans, Spans> Search::blocked() const {
  Spans below, above;
  for (const Block& b : blocks_) add_split(b.low, b.high, below, above);
  normalise(below, kNoGap);
  normalise(above, kNoGap);
  if (!above.empty() && leaves(above.front(), true)) above.erase(above.begin());
  if (!below.empty() && leaves(below.back(), false)) below.pop_back();
  hide_behind_sheets(below, above);
  return {below, above};
}

// Nobody knows which side of a sheet is inside: behind the nearest one on either side of 0 nothing is told.
void Search::hide_behind_sheets(Spans& below, Spans& above) const {
  const double turn = 2.0 * kPi;
  double low = kInfinity, high = -kInfinity;
  for (const Block& b : blocks_) {
    if (!b.sheet || (b.low <= 0.0 && b.high >= 0.0)) continue;
    if (b.low > 0.0 || circle()) low = std::min(low, b.low > 0.0 ? b.low : b.low + turn);
    if (b.high < 0.0 || circle()) high = std::max(high, b.high < 0.0 ? b.high : b.high - turn);
  }
  if (circle() && low < kInfinity) add_split(low, high + turn, below, above);
  if (!circle() && low < kInfinity) above.push_back({low, kInfinity});
  if (!circle() && high > -kInfinity) below.push_back({-kInfinity, high});
  normalise(below, kNoGap);
  normalise(above, kNoGap);
}

// No surface crosses another, but a body may lie inside another one.
bool Search::contained(const SlidingPlaces& places, double t) const {
  const auto any_inside = [&](std::span<const OrbitBody> of, std::span<const OrbitBody> in, double by) {
    for (const OrbitBody& body : of)
      for (const Vec3& vertex : one_of_each_shell(*body.surface)) {
        const Vec3 p = frame_.to_path(vertex);
        if (places.holds(p)) continue;
        const Vec3 moved = frame_.from_path(frame_.moved(p, by));
        if (std::any_of(in.begin(), in.end(), [&](const OrbitBody& b) { return holds_point(b, moved); })) return true;
      }
    return false;
  };
  return any_inside(moving_, fixed_, t) || any_inside(fixed_, moving_, -t);
}

MotionStop Search::stop_at(double t, bool rising) const {
  const double turn = circle() ? 2.0 * kPi : 0.0;
  for (const Block& b : blocks_)
    for (const double turned : {0.0, turn, -turn}) {
      const double low = b.low + turned, high = b.high + turned, end = rising ? low : high;
      const bool begins_here = std::abs(end - t) <= kNoGap, from_start = t == 0.0 && low <= 0.0 && high >= 0.0;
      if (!begins_here && !from_start) continue;
      const Vec3& met = rising ? b.first.first : b.last.last;
      return {b.body, frame_.from_path(frame_.moved(met, -(rising ? b.low : b.high)))};
    }
  return {};
}

FreeMotion Search::result(const SlidingPlaces& places, const Spans& below, const Spans& above) const {
  FreeMotion out;
  out.tolerance = tolerances_.across;
  out.overlapping = overlapping_;
  if (below.empty() && above.empty()) return out;
  Spans gaps;  // other than that around 0
  for (const Spans* spans : {&below, &above})
    for (std::size_t i = 1; i < spans->size(); ++i) gaps.push_back({(*spans)[i - 1].high, (*spans)[i].low});
  const double turn = 2.0 * kPi;
  if (!circle()) {
    if (!below.empty()) gaps.push_back({-kInfinity, below.front().low});
    if (!above.empty()) gaps.push_back({above.back().high, kInfinity});
    out.reachable = {below.empty() ? -kInfinity : below.back().high, above.empty() ? kInfinity : above.front().low};
  } else {
    // Around the circle: from the last block of one side to the first of the other.
    if (!below.empty() && !above.empty()) {
      gaps.push_back({above.back().high, below.front().low + turn});
      out.reachable = {below.back().high, above.front().low};
    } else if (above.empty()) {
      out.reachable = {below.back().high, below.front().low + turn};
    } else {
      out.reachable = {above.back().high - turn, above.front().low};
    }
  }
  if (std::isfinite(out.reachable.low)) out.low = stop_at(out.reachable.low, false);
  if (std::isfinite(out.reachable.high)) out.high = stop_at(out.reachable.high, true);
  if (options_.reachable_only) return out;
  for (const Span& gap : gaps) {
    if (!(gap.high - gap.low > kNoGap)) continue;
    const bool bounded = std::isfinite(gap.low) && std::isfinite(gap.high);
    if (bounded && contained(places, 0.5 * (gap.low + gap.high))) continue;
    out.others.push_back({gap.low, gap.high});
  }
  std::sort(out.others.begin(), out.others.end(), [](const Interval& a, const Interval& b) { return a.low < b.low; });
  return out;
}

}  // namespace

FreeMotion search_motion(const PathFrame& frame, std::span<const OrbitBody> moving, std::span<const OrbitBody> fixed,
                         const Tolerances& t, const FreeMotionOptions& options) {
  const auto [moving_faces, fixed_faces] =
      faces_that_meet(frame, moving, fixed, t.largest_overlap + t.nudge, options.crease_angle);
  return Search(frame, moving, fixed, t, options).run(moving_faces, fixed_faces);
}

}  // namespace limber::internal
