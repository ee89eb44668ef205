#include "ranges/motion_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "constants.h"
#include "ranges/orbit_index.h"
#include "ranges/orbit_samples.h"
#include "ranges/spans.h"
#include "tuning.h"

namespace limber::internal {
namespace {

/// Up to AgainstTuning::slope any surface is a stop; beyond it, those that are one-sided are, such as a screw's collar,
/// and all others slide.
bool stands(double slope, bool one_sided) { return slope <= tuning().ranges.against.slope || one_sided; }
/// Slope of the surface where a piece begins or ends; ∞ where it slides.
double slope_of_end(const OrbitPiece& p, bool low) {
  const double slope = low ? p.slope_low : p.slope_high;
  return stands(slope, low ? p.one_sided_low : p.one_sided_high) ? slope : kInfinity;
}

/// One side: its triangles in reach of the other, and points on them.
struct Side {
  Side(const PathFrame& frame, std::span<const OrbitBody> bodies, std::vector<OrbitFace> faces, int samples)
      : index(frame, bodies, faces), surface(bodies, std::move(faces), samples) {}
  OrbitIndex index;
  SampledSurface surface;
};

/// A blocked piece and the point that told of it.
struct Witness {
  OrbitPiece piece{};
  SurfaceSample point{};
  bool moving = true;  ///< whose point
};

/// All blocked positions along one path, by (1) of the header.
class Search {
 public:
  Search(const PathFrame& frame, const Side& moving, const Side& fixed, const Tolerances& tolerances,
         bool reachable_only)
      : frame_(frame), moving_(moving), fixed_(fixed), tolerances_(tolerances), reachable_only_(reachable_only) {}

  FreeMotion run() {
    find_raw();
    settle_tolerance();
    // Facets on facets as read come to lie corner on facet.
    tolerances_.across = std::min(tolerances_.across + tolerances_.facets, tolerances_.largest_overlap);
    collect();
    refine();
    return result();
  }

 private:
  /// The pieces of each point's own orbit, as raw_pieces() gives them.
  struct RawPieces {
    std::vector<OrbitPiece> pieces;
    std::vector<std::size_t> first;  ///< per point, and the end
    std::span<const OrbitPiece> of(std::size_t point) const {
      return std::span(pieces).subspan(first[point], first[point + 1] - first[point]);
    }
  };

  void find_raw();
  void settle_tolerance();
  /// A point of one side.
  struct PointOf {
    std::size_t number = 0;
    bool moving = true;
  };
  std::vector<PointOf> longest_first() const;
  void collect();
  bool adds(const OrbitPiece& piece) const;
  void add(const Witness& witness);
  bool touches_start(const OrbitPiece& piece, const SurfaceSample& at) const {
    return piece.sheet != 0 && std::abs(piece.low) * speed(at) <= tolerances_.across;
  }
  void refine();
  FreeMotion result() const;

  /// The faces that orbits within a distance of this one can meet.
  void gather(const Orbit& orbit, bool moving, double around, std::vector<Index>& near) const;
  /// @param near what gather() found around it
  void raw_pieces(const Orbit& orbit, bool moving, const std::vector<Index>& near, std::vector<OrbitPiece>& out) const;
  void raw_pieces(const Orbit& orbit, bool moving, std::vector<OrbitPiece>& out) const;
  /// @param pieces as raw_pieces() gave them for this point's orbit; what is wide of them stays
  void keep_wide(const SurfaceSample& at, bool moving, std::vector<OrbitPiece>& pieces) const;
  void keep_blocked(const SurfaceSample& at, bool moving, std::vector<OrbitPiece>& pieces) const;
  void clip_at_start(std::vector<OrbitPiece>& pieces, double speed) const;
  bool holds_start(const OrbitPiece& piece, double speed) const;
  template <class PiecesOf>
  Witness downhill(Witness start, bool low, const Span& gap, double finest, PiecesOf&& pieces_of) const;
  Witness first_blocked(const Witness& seed, bool low, const Span& gap) const;
  Witness first_touching(const Witness& blocked, bool low, const Span& gap) const;
  /// Slope of the surface at a point, as in OrbitPiece; ∞ where it slides.
  double slope_at(const SurfaceSample& at, bool moving) const;
  void refine_end(Span& span, bool low, const Span& gap, std::size_t seeds, Witness& end);
  MotionStop stop_of(const Witness& witness) const;
  double speed(const SurfaceSample& at) const { return frame_.speed(frame_.orbit_of(at.p)); }
  const SampledSurface& surface(bool moving) const { return (moving ? moving_ : fixed_).surface; }
  const RawPieces& raw(bool moving) const { return moving ? raw_moving_ : raw_fixed_; }

  const PathFrame& frame_;
  const Side& moving_;
  const Side& fixed_;
  Tolerances tolerances_;
  bool reachable_only_;
  bool overlapping_ = false;
  RawPieces raw_moving_, raw_fixed_;
  /// The direction that freed the last point often frees the next; the answer does not depend on where one begins.
  mutable std::size_t first_across_ = 0;
  std::vector<Witness> witnesses_;
  Span sheet_below_{-kInfinity, -kInfinity}, sheet_above_{kInfinity, kInfinity};  ///< the nearest sheets that block
  Spans blocked_;                                                                 ///< B
  std::vector<std::pair<Witness, Witness>> ends_;  ///< what blocks at the low and high end of each span of B
};

void Search::gather(const Orbit& orbit, bool moving, double around, std::vector<Index>& near) const {
  (moving ? fixed_ : moving_).index.gather(orbit, around + tolerances_.nudge, near);
}

void Search::raw_pieces(const Orbit& orbit, bool moving, std::vector<OrbitPiece>& out) const {
  thread_local std::vector<Index> near;
  gather(orbit, moving, 0.0, near);
  raw_pieces(orbit, moving, near, out);
}

// A moving point meets the fixed side at t; a fixed point meets the moving side as if that stood still, at −t.
void Search::raw_pieces(const Orbit& orbit, bool moving, const std::vector<Index>& near,
                        std::vector<OrbitPiece>& out) const {
  (moving ? fixed_ : moving_).index.pieces(orbit, tolerances_.nudge, near, out);
  if (moving) return;
  for (OrbitPiece& p : out)
    p = {-p.high, -p.low, p.body, -p.sheet, p.slope_high, p.slope_low, p.one_sided_high, p.one_sided_low};
  std::reverse(out.begin(), out.end());
}

void Search::find_raw() {
  std::vector<OrbitPiece> pieces;
  for (const bool moving : {true, false}) {
    RawPieces& raw = moving ? raw_moving_ : raw_fixed_;
    raw.first = {0};
    for (const SurfaceSample& at : surface(moving).points()) {
      raw_pieces(frame_.orbit_of(at.p), moving, pieces);
      raw.pieces.insert(raw.pieces.end(), pieces.begin(), pieces.end());
      raw.first.push_back(raw.pieces.size());
    }
  }
}

/// Pieces made longer by `by` on both sides, as a set.
Spans dilated(const std::vector<OrbitPiece>& pieces, double by) {
  Spans spans;
  for (const OrbitPiece& p : pieces) spans.push_back({p.low - by, p.high + by});
  normalise(spans);
  return spans;
}

/// The parts of `pieces` that the set `wide` confirms, which is dilated by the steepest slope times δ. An orbit beside
/// this one meets a sloping stop later: where the slope explains the difference, the stop begins where this orbit meets
/// it.
/// @param delta δ as a length of t
void keep_confirmed(std::vector<OrbitPiece>& pieces, const Spans& wide, double delta) {
  const double margin = tuning().ranges.against.slope_margin, by = tuning().ranges.against.slope * delta;
  const auto explains = [&](double slope, double later) {
    return slope < kInfinity && later <= margin * slope * delta + (margin - 1.0) * delta;
  };
  std::vector<OrbitPiece> kept;
  for (const OrbitPiece& p : pieces)
    for (const Span& s : wide) {
      if (s.high < p.low - by || s.low > p.high + by) continue;
      Span core{s.low + by, s.high - by};
      if (core.low > core.high) {
        // The slope of a stop may explain it, near that stop; what slides there passes beside it.
        core.low = core.high = 0.5 * (core.low + core.high);
        if (!explains(slope_of_end(p, true), core.low - p.low) && !explains(slope_of_end(p, false), p.high - core.high))
          continue;
      }
      if (core.low < p.low || explains(slope_of_end(p, true), core.low - p.low)) core.low = p.low;
      if (core.high > p.high || explains(slope_of_end(p, false), p.high - core.high)) core.high = p.high;
      if (core.low > core.high) continue;
      kept.push_back(p);
      kept.back().low = core.low, kept.back().high = core.high;
    }
  pieces = std::move(kept);
}

// Overlap wider than δ: orbits moved by δ in eight directions across meet the other side as well.
void Search::keep_wide(const SurfaceSample& at, bool moving, std::vector<OrbitPiece>& pieces) const {
  constexpr double kDiagonal = std::numbers::sqrt2 / 2.0;
  constexpr std::array<std::array<double, 2>, 8> kAcross{{{1, 0},
                                                          {-1, 0},
                                                          {0, 1},
                                                          {0, -1},
                                                          {kDiagonal, kDiagonal},
                                                          {-kDiagonal, -kDiagonal},
                                                          {kDiagonal, -kDiagonal},
                                                          {-kDiagonal, kDiagonal}}};
  const Orbit orbit = frame_.orbit_of(at.p);
  const double v = frame_.speed(orbit), delta = tolerances_.across;
  if (pieces.empty()) return;
  // So near to the axis that δ is a good part of a turn, nothing can be told.
  const double by = tuning().ranges.against.slope * delta / v;
  if (frame_.kind() != MotionPath::Kind::kTranslation && !(by < tuning().ranges.against.near_axis))
    return pieces.clear();
  Spans wide = dilated(pieces, by);
  thread_local std::vector<Index> near;
  gather(orbit, moving, delta, near);
  thread_local std::vector<OrbitPiece> beside;
  for (std::size_t k = 0; k < kAcross.size(); ++k) {
    const std::size_t which = (k + first_across_) % kAcross.size();
    Orbit moved = orbit;
    for (std::size_t i = 0; i < 2; ++i) moved.plane[i] += delta * kAcross[which][i];
    raw_pieces(moved, moving, near, beside);
    wide = intersection(wide, dilated(beside, by));
    if (!wide.empty()) continue;
    first_across_ = which;
    return pieces.clear();
  }
  keep_confirmed(pieces, wide, delta / v);
}

bool Search::holds_start(const OrbitPiece& piece, double v) const {
  return piece.sheet == 0 && std::min(-piece.low, piece.high) * v > tolerances_.across;
}

// Surfaces that touch as read, or overlap by less than δ along the motion, block the way in and not the way out.
void Search::clip_at_start(std::vector<OrbitPiece>& pieces, double v) const {
  constexpr double kInstant = 1e-12;  // rad or length: above round-off
  for (OrbitPiece& p : pieces) {
    if (p.sheet != 0 && std::abs(p.low) * v <= tolerances_.across) {
      p.low = p.sheet > 0 ? std::max(p.low, 0.0) : std::min(p.low, 0.0) - kInstant;
      p.high = p.low + kInstant;
    } else if (p.low < 0.0 && p.high > 0.0) {
      (-p.low < p.high ? p.low : p.high) = 0.0;
    }
  }
}

void Search::keep_blocked(const SurfaceSample& at, bool moving, std::vector<OrbitPiece>& pieces) const {
  const double v = speed(at);
  keep_wide(at, moving, pieces);
  // Sheets that slide on each other cross at grazing angles.
  std::erase_if(pieces, [&](const OrbitPiece& p) {
    return holds_start(p, v) || (p.sheet != 0 && slope_of_end(p, true) == kInfinity);
  });
  clip_at_start(pieces, v);
}

// Overlap as read is a matter of drawing, not of motion: δ grows until none is left that is wider, as far as it may.
// An overlap that is wide at one δ is wide at all smaller ones, so each point is asked at the δ that those before it
// left.
void Search::settle_tolerance() {
  if (tolerances_.across >= tolerances_.largest_overlap) return;
  std::vector<OrbitPiece> pieces;
  const auto is_deep = [&](std::span<const OrbitPiece> among, const SurfaceSample& at) {
    const double v = speed(at);
    return std::any_of(among.begin(), among.end(), [&](const OrbitPiece& p) { return holds_start(p, v); });
  };
  for (const bool moving : {true, false}) {
    const auto& points = surface(moving).points();
    for (std::size_t i = 0; i < points.size() && !overlapping_; ++i)
      while (!overlapping_ && is_deep(raw(moving).of(i), points[i])) {
        pieces.assign(raw(moving).of(i).begin(), raw(moving).of(i).end());
        keep_wide(points[i], moving, pieces);
        if (!is_deep(pieces, points[i])) break;
        overlapping_ = tolerances_.across >= tolerances_.largest_overlap;
        tolerances_.across =
            std::min(tuning().ranges.against.overlap_growth * tolerances_.across, tolerances_.largest_overlap);
      }
  }
}

// Behind a sheet nothing is looked for: of sheets, only the nearest on either side of 0 matter.
bool Search::adds(const OrbitPiece& p) const {
  if (p.sheet == 0) return !covers(blocked_, p.low, p.high);
  return p.low >= 0.0 ? p.low < sheet_above_.low : p.high > sheet_below_.high;
}

void Search::add(const Witness& witness) {
  const OrbitPiece& p = witness.piece;
  witnesses_.push_back(witness);
  if (p.sheet != 0) {
    (p.low >= 0.0 ? sheet_above_ : sheet_below_) = {p.low, p.high};
    return;
  }
  add_apart_at_0(blocked_, {p.low, p.high});
}

// Points whose orbits meet most come first: what they tell covers most of what the others could.
std::vector<Search::PointOf> Search::longest_first() const {
  std::vector<std::pair<double, PointOf>> all;
  for (const bool moving : {true, false})
    for (std::size_t i = 0; i < surface(moving).points().size(); ++i) {
      double longest = -1.0;
      for (const OrbitPiece& p : raw(moving).of(i)) longest = std::max(longest, p.high - p.low);
      if (longest >= 0.0) all.push_back({longest, {i, moving}});
    }
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<PointOf> out;
  out.reserve(all.size());
  for (const auto& [longest, point] : all) out.push_back(point);
  return out;
}

void Search::collect() {
  std::vector<OrbitPiece> pieces;
  for (const auto& [i, moving] : longest_first()) {
    const SurfaceSample& at = surface(moving).points()[i];
    const auto own = raw(moving).of(i);
    // Blocked pieces are parts of the raw ones: what is known to be blocked needs no closer look.
    if (std::none_of(own.begin(), own.end(), [&](const OrbitPiece& p) { return adds(p) || touches_start(p, at); }))
      continue;
    pieces.assign(own.begin(), own.end());
    keep_blocked(at, moving, pieces);
    for (const OrbitPiece& p : pieces)
      if (adds(p)) add({p, at, moving});
  }
  for (const Span& sheet : {sheet_below_, sheet_above_})
    if (std::isfinite(sheet.low)) add_apart_at_0(blocked_, sheet);
}

// Over the surface downhill: the point whose orbit is blocked first, by a pattern of steps that halve where none helps.
template <class PiecesOf>
Witness Search::downhill(Witness best, bool low, const Span& gap, double finest, PiecesOf&& pieces_of) const {
  const RangesTuning& t = tuning().ranges;
  const int directions = static_cast<int>(t.points.directions), most_steps = static_cast<int>(t.points.most_steps);
  const SampledSurface& over = surface(best.moving);
  std::vector<OrbitPiece> pieces;
  double step = over.spacing();
  int steps = 0;
  for (int level = 0; step > finest && steps < most_steps; ++level) {
    const auto& c = over.faces()[static_cast<std::size_t>(best.point.face)].corners;
    const Vec3 e = (c[1] - c[0]).stableNormalized(), n = e.cross(c[2] - c[0]).stableNormalized(), f = n.cross(e);
    bool better = false;
    for (int k = 0; k < directions && !better; ++k, ++steps) {
      const double angle = t.points.pattern_turn * level + 2.0 * kPi * k / directions;
      const SurfaceSample next =
          over.walk(best.point, best.point.p + step * (std::cos(angle) * e + std::sin(angle) * f));
      const auto improves = [&](const OrbitPiece& p) {
        return low ? p.low < best.piece.low && p.high > gap.low : p.high > best.piece.high && p.low < gap.high;
      };
      pieces_of(next, improves, pieces);
      for (const OrbitPiece& p : pieces)
        if (improves(p) && (low ? p.low > gap.low : p.high < gap.high)) {
          best = {p, next, best.moving};
          better = true;
        }
    }
    if (!better) step *= 0.5;
  }
  return best;
}

Witness Search::first_blocked(const Witness& seed, bool low, const Span& gap) const {
  const double finest = tuning().ranges.points.finest_blocked * tolerances_.across;
  return downhill(seed, low, gap, finest,
                  [&](const SurfaceSample& next, auto&& improves, std::vector<OrbitPiece>& out) {
                    raw_pieces(frame_.orbit_of(next.p), seed.moving, out);
                    if (std::none_of(out.begin(), out.end(), improves)) return out.clear();
                    keep_blocked(next, seed.moving, out);
                  });
}

// A blocked point has the other body all around it, to a distance δ. Surfaces of the same overlap may meet it
// before: the surface within δ of the point, where both surfaces stand against the motion rather than along it.
Witness Search::first_touching(const Witness& blocked, bool low, const Span& gap) const {
  const double finest = tuning().ranges.points.finest_touching * tolerances_.least, delta = tolerances_.across;
  const Orbit centre = frame_.orbit_of(blocked.point.p);
  // How much earlier two surfaces explain; a blocked point may lie on one that slides.
  const double own = slope_at(blocked.point, blocked.moving), met = slope_of_end(blocked.piece, low);
  const auto explained = [](double slope) {
    const double steepest = tuning().ranges.against.slope;
    return slope < kInfinity ? std::max(slope, steepest) : steepest;
  };
  const double earlier = (explained(own) + explained(met)) * delta / frame_.speed(centre);
  const double from = blocked.piece.low - earlier, to = blocked.piece.high + earlier;
  return downhill(blocked, low, gap, finest, [&](const SurfaceSample& next, auto&&, std::vector<OrbitPiece>& out) {
    const Orbit orbit = frame_.orbit_of(next.p);
    out.clear();
    if (std::hypot(orbit.plane[0] - centre.plane[0], orbit.plane[1] - centre.plane[1]) > delta) return;
    if (slope_at(next, blocked.moving) == kInfinity) return;
    raw_pieces(orbit, blocked.moving, out);
    std::erase_if(out, [&](const OrbitPiece& p) {
      return slope_of_end(p, low) == kInfinity || (low ? p.low < from : p.high > to);
    });
  });
}

double Search::slope_at(const SurfaceSample& at, bool moving) const {
  const OrbitFace& face = surface(moving).faces()[static_cast<std::size_t>(at.face)];
  const double slope = slope_of(face.normal.dot(frame_.direction(at.p)));
  return !face.narrow && stands(slope, face.one_sided) ? slope : kInfinity;
}

void Search::refine_end(Span& span, bool low, const Span& gap, std::size_t most_seeds, Witness& end) {
  std::vector<Witness> seeds;
  for (const Witness& w : witnesses_)
    if (w.piece.low >= span.low && w.piece.high <= span.high) seeds.push_back(w);
  const auto first = [&](const Witness& a, const Witness& b) {
    return low ? a.piece.low < b.piece.low : a.piece.high > b.piece.high;
  };
  std::stable_sort(seeds.begin(), seeds.end(), first);
  if (seeds.size() > most_seeds) seeds.resize(most_seeds);
  if (seeds.empty()) return;
  end = seeds.front();
  for (const Witness& seed : seeds)
    if (const Witness found = first_touching(first_blocked(seed, low, gap), low, gap); first(found, end)) end = found;
  (low ? span.low : span.high) = low ? end.piece.low : end.piece.high;
}

void Search::refine() {
  const RangesTuning& t = tuning().ranges;
  const std::size_t count = blocked_.size();
  const bool nearest_only = reachable_only_ || count > t.points.most_followed;
  ends_.resize(count);
  // Spans on either side of 0; on a circle they may lie at the other end of the list.
  const auto above = static_cast<std::size_t>(
      std::find_if(blocked_.begin(), blocked_.end(), [](const Span& s) { return s.low >= 0.0; }) - blocked_.begin());
  for (std::size_t i = 0; i < count; ++i) {
    const Span whole = blocked_[i];
    double before = i > 0 ? blocked_[i - 1].high : -kInfinity, after = i + 1 < count ? blocked_[i + 1].low : kInfinity;
    (whole.low >= 0.0 ? before : after) = whole.low >= 0.0 ? std::max(before, 0.0) : std::min(after, 0.0);
    Span low = whole, high = whole;
    const bool ends_above = i == above % count, ends_below = i == (above + count - 1) % count;
    const auto seeds = [&](bool reachable) { return reachable ? t.points.seeds : t.points.seeds_behind; };
    if (ends_above || !nearest_only) refine_end(low, true, {before, whole.high}, seeds(ends_above), ends_[i].first);
    if (ends_below || !nearest_only) refine_end(high, false, {whole.low, after}, seeds(ends_below), ends_[i].second);
    blocked_[i] = {low.low, high.high};
  }
}

MotionStop Search::stop_of(const Witness& w) const {
  const auto& face = surface(w.moving).faces()[static_cast<std::size_t>(w.point.face)];
  return {w.moving ? w.piece.body : face.body, frame_.from_path(w.point.p)};
}

FreeMotion Search::result() const {
  FreeMotion out;
  out.tolerance = tolerances_.across;
  out.overlapping = overlapping_;
  const std::size_t count = blocked_.size();
  if (count == 0) return out;
  const bool circle = frame_.kind() == MotionPath::Kind::kRotation;
  // Free gaps between blocked spans; on a circle the last leads to the first.
  for (std::size_t i = circle ? 1 : 0; i <= count; ++i) {
    const std::size_t after = i < count ? i : 0;
    Interval gap{i > 0 ? blocked_[i - 1].high : -kInfinity, i < count ? blocked_[i].low : kInfinity};
    if (circle && i == count) gap.high = blocked_[0].low + 2.0 * kPi;
    if (!(gap.low < gap.high) && gap.low != 0.0) continue;
    const bool turned = circle && i == count && gap.low > 0.0;  // 0 may lie at the end that was moved by a turn
    if (turned && gap.high >= 2.0 * kPi) gap = {gap.low - 2.0 * kPi, gap.high - 2.0 * kPi};
    if (gap.low > 0.0 || gap.high < 0.0) {
      out.others.push_back(gap);
      continue;
    }
    out.reachable = gap;
    if (i > 0) out.low = stop_of(ends_[i - 1].second);
    if (circle || i < count) out.high = stop_of(ends_[after].first);
  }
  return out;
}

}  // namespace

FreeMotion search_motion(const PathFrame& frame, std::span<const OrbitBody> moving, std::span<const OrbitBody> fixed,
                         const Tolerances& t, const FreeMotionOptions& options) {
  auto [moving_faces, fixed_faces] =
      faces_that_meet(frame, moving, fixed, t.largest_overlap + t.nudge, options.crease_angle);
  const double width = std::min(t.across + t.facets, t.largest_overlap);
  const double slope = tuning().ranges.against.slope;
  mark_narrow(frame, slope, width, options.crease_angle, moving_faces);
  mark_narrow(frame, slope, width, options.crease_angle, fixed_faces);
  const Side moving_side(frame, moving, std::move(moving_faces), options.samples);
  const Side fixed_side(frame, fixed, std::move(fixed_faces), options.samples);
  return Search(frame, moving_side, fixed_side, t, options.reachable_only).run();
}

}  // namespace limber::internal
