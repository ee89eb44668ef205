#include "manifold/time_of_impact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "limber/collision/closest_features.h"
#include "tuning.h"

namespace limber::internal {
namespace {

/// Round-off of a pose and of what is done with it, in ε of its coordinates.
constexpr double kMotionRoundOff = 32.0 * std::numeric_limits<double>::epsilon();
/// The same of what the kernels do, in single precision.
constexpr double kSlabRoundOff = 32.0 * static_cast<double>(std::numeric_limits<float>::epsilon());

/// From where on in a stretch a gap g₀ at its start, g₁ at its end and bent as much may be closed.
double part_to_close(double gap, double gap_then, double bend) {
  if (!(gap > 0.0)) return 0.0;
  const double closing = gap - gap_then + bend, square = closing * closing - 4.0 * bend * gap;
  if (square < 0.0) return 2.0;
  const double sum = closing + std::sqrt(square);
  return sum > 0.0 ? 2.0 * gap / sum : 2.0;
}

/// From the nearest point of y to that of x; zero where they intersect.
Vec3 nearest(const std::array<Vec3, 3>& x, std::size_t x_count, const std::array<Vec3, 3>& y, std::size_t y_count) {
  if (x_count < y_count) return -nearest(y, y_count, x, x_count);
  const auto difference = [](const ClosestPoints& c) -> Vec3 { return c.a.point - c.b.point; };
  if (x_count == 1) return x[0] - y[0];
  if (x_count == 2 && y_count == 1) return closest_on_segment(y[0], {x[0], x[1]}).point - y[0];
  if (x_count == 2) return difference(closest_points(SegmentPoints{x[0], x[1]}, SegmentPoints{y[0], y[1]}));
  if (y_count == 1) return closest_on_triangle(y[0], x).point - y[0];
  const ClosestOrCrossing c = y_count == 2 ? closest_points(SegmentPoints{y[0], y[1]}, x) : closest_points(x, y);
  if (c.intersecting) return Vec3::Zero();
  return y_count == 2 ? Vec3(-difference(c)) : difference(c);
}

}  // namespace

ImpactTime TimeOfImpact::find(const MovingBody& a, const MovingBody& b, double length, double margin) {
  using Status = ImpactTime::Status;
  margin = std::max(margin, start(a, b, length));
  const ImpactTuning& tuning = collision_tuning().impact;
  double t = 0.0, until = length;
  bool apart = false;  // at the start, by more than the margin: from then on half of it is kept
  for (int n = 1; n <= tuning.most_advancements; ++n) {
    const double ahead = until - t;
    double safe = 0.0;
    const Seen seen = advancement(apart ? tuning.kept_gap * margin : margin, margin, safe);
    if (seen == Seen::kTouching) return {t == 0.0 ? Status::kTouching : Status::kImpact, t, n};
    const bool first = !apart, short_way = safe < tuning.good_advancement * ahead;
    apart = apart || seen == Seen::kClear;
    if (seen == Seen::kTooMuch || (short_way && stretch_.offset > 0.0)) {  // a nearer look bounds it more sharply
      until = t + std::clamp(tuning.look_again * safe, tuning.look_nearer * ahead, 0.5 * ahead);
      look_ahead(t, until);
      continue;
    }
    if (first && short_way) continue;
    t += safe;
    if (t >= length) return {Status::kNone, length, n};
    until = std::min(length, t + tuning.look_farther * safe);
    go_to(t, until);
  }
  return {Status::kResting, t, tuning.most_advancements};
}

ImpactTime TimeOfImpact::find(const MovingBody& a, const MovingBody& b, double length, double margin, double least) {
  constexpr double kNearer = 0.5, kSmallestMargin = std::numeric_limits<double>::min();
  ImpactTime time = find(a, b, length, margin);
  while (time.status == ImpactTime::Status::kTouching && kNearer * margin >= std::max(least, kSmallestMargin))
    time = find(a, b, length, margin *= kNearer);
  return time;
}

// -- One stretch ------------------------------------------------------------------------------------------------------

/// @return round-off of the pair's geometry, m
double TimeOfImpact::start(const MovingBody& a, const MovingBody& b, double length) {
  a_.start(a);
  b_.start(b);
  thickness_ = a_.thickness() + b_.thickness();
  last_.reset();
  look_ahead(0.0, length);
  return kMotionRoundOff * (a_.position(0).norm() + b_.position(0).norm() + a_.arm() + b_.arm());
}

void TimeOfImpact::go_to(double t, double until) {
  a_.go_to(t);
  b_.go_to(t);
  look_ahead(t, until);
}

void TimeOfImpact::look_ahead(double t, double until) {
  Stretch& s = stretch_;
  s.duration = until - t;
  a_.look_ahead(until);
  b_.look_ahead(until);
  for (const int end : {0, 1}) s.apart[static_cast<std::size_t>(end)] = a_.position(end) - b_.position(end);
  const ChordError one = a_.error(), other = b_.error();
  s.offset = one.offset + other.offset;
  s.doubt = 0.25 * (one.bend + other.bend) + s.offset;
  choose_directions();
  s.round_off = kSlabRoundOff * (s.apart[0].cwiseAbs().sum() + s.apart[1].cwiseAbs().sum() + a_.arm() + b_.arm());
}

/// Axes of both bodies and what lies between them, the way of one as the other sees it, and directions across it, along
/// which they do not come nearer.
void TimeOfImpact::choose_directions() {
  const std::array<Vec3, 2>& apart = stretch_.apart;
  std::array<Vec3, kDirections> n;
  const Mat3 &A = a_.rotation(0), &B = b_.rotation(0);
  for (int axis = 0; axis < 3; ++axis) n[static_cast<std::size_t>(axis)] = A.col(axis);
  for (int axis = 0; axis < 3; ++axis) n[static_cast<std::size_t>(axis) + 3] = B.col(axis);
  const Vec3 way = apart[1] - apart[0];
  const Vec3 along = way.squaredNorm() > 0.0 ? Vec3(way.normalized()) : Vec3(Vec3::UnitX());
  const Vec3 u = along.unitOrthogonal(), v = along.cross(u);
  const double half = std::sqrt(0.5), third = std::sqrt(1.0 / 3.0);
  n[6] = along, n[7] = u, n[8] = v, n[9] = half * (u + v), n[10] = half * (u - v);
  n[11] = third * (along + u + v), n[12] = third * (along - u + v), n[13] = third * (along + u - v);
  n[14] = third * (along - u - v);
  n[15] = apart[0].squaredNorm() > 0.0 ? Vec3(apart[0].normalized()) : along;
  for (std::size_t end = 0; end < 2; ++end)
    for (std::size_t i = 0; i < kDirections; ++i)
      stretch_.way.between[end][i] = static_cast<float>(n[i].dot(apart[end]));
  a_.set_directions(n);
  b_.set_directions(n);
}

// -- One look ---------------------------------------------------------------------------------------------------------

/// The earliest time from now, at most the stretch, at which a gap may be down to `kept`. Touching: one is down to
/// `margin` now. Too much: more than a few parts come near only as the stretch is long.
TimeOfImpact::Seen TimeOfImpact::advancement(double kept, double margin, double& time) {
  look_ = {.kept = kept, .margin = margin, .nearest = std::numeric_limits<double>::infinity()};
  Seen seen =
      last_ ? visit(a_.points(last_->m, last_->i), b_.points(last_->n, last_->j), bend_of(*last_)) : Seen::kClear;
  if (seen == Seen::kClear) seen = walk();
  time = std::min(look_.best, look_.pruned) * stretch_.duration;
  return seen;
}

TimeOfImpact::Seen TimeOfImpact::walk() {
  const ImpactTuning& tuning = collision_tuning().impact;
  std::array<Entry, 2 * CollisionSurface::kMaxDepth + 4> stack;
  std::size_t size = 0;
  stack[size++] = entry(0, 0);
  while (size > 0) {
    const Entry e = stack[--size];
    if (pruned(e.part)) continue;
    if (a_.leaf(e.m) && b_.leaf(e.n)) {
      if (const Seen seen = visit(e.m, e.n); seen != Seen::kClear) return seen;
      if (look_.visits > tuning.visits_of_a_look && stretch_.doubt > tuning.fine_doubt * look_.nearest)
        return Seen::kTooMuch;
      continue;
    }
    const bool descend_a = b_.leaf(e.n) || (!a_.leaf(e.m) && a_.weight(e.m) >= b_.weight(e.n));
    Entry near = descend_a ? entry(a_.child(e.m), e.n) : entry(e.m, b_.child(e.n));
    Entry far = descend_a ? entry(a_.child(e.m) + 1, e.n) : entry(e.m, b_.child(e.n) + 1);
    if (far.part < near.part) std::swap(near, far);
    stack[size++] = far;
    stack[size++] = near;
  }
  return Seen::kClear;
}

/// What comes hardly earlier than the best is left for the next look, so that many that come together cost little.
bool TimeOfImpact::pruned(double part) {
  if (part < collision_tuning().impact.worth_a_look * look_.best) return false;
  look_.pruned = std::min(look_.pruned, part);
  return true;
}

double TimeOfImpact::earliest(const PlacedPart& one, const PlacedPart& other) const {
  const double kept = thickness_ + look_.kept + stretch_.offset + stretch_.round_off;
  const double bend = static_cast<double>(one.bend) + static_cast<double>(other.bend);
  return static_cast<double>(
      earliest_in_stretch(one.slab, other.slab, stretch_.way, static_cast<float>(kept), static_cast<float>(bend)));
}

double TimeOfImpact::bend_of(const ItemPair& pair) {
  return static_cast<double>(a_.item(pair.m, pair.i).bend) + static_cast<double>(b_.item(pair.n, pair.j).bend);
}

/// All pairs of items of two leaves.
TimeOfImpact::Seen TimeOfImpact::visit(Index m, Index n) {
  for (Index i = 0; i < a_.weight(m); ++i) {
    const PlacedPart& one = a_.item(m, i);
    for (Index j = 0; j < b_.weight(n); ++j) {
      const PlacedPart& other = b_.item(n, j);
      if (pruned(earliest(one, other))) continue;
      const double before = look_.best, bend = static_cast<double>(one.bend) + static_cast<double>(other.bend);
      if (visit(a_.points(m, i), b_.points(n, j), bend) == Seen::kTouching) return Seen::kTouching;
      if (look_.best < before) last_ = {m, n, i, j};
    }
  }
  return Seen::kClear;
}

/// Along the line of the nearest points: convex items stay apart as long as their corners do.
TimeOfImpact::Seen TimeOfImpact::visit(const MovingSide::Item& one, const MovingSide::Item& other, double bend) {
  ++look_.visits;
  std::array<std::array<Vec3, 3>, 2> x, y;  // from the origin of b, world axes
  for (std::size_t end = 0; end < 2; ++end) {
    const int e = static_cast<int>(end);
    for (std::size_t i = 0; i < one.count; ++i) x[end][i] = stretch_.apart[end] + a_.rotation(e) * one.point[end][i];
    for (std::size_t j = 0; j < other.count; ++j) y[end][j] = b_.rotation(e) * other.point[end][j];
  }
  const Vec3 between = nearest(x[0], one.count, y[0], other.count);
  const double distance = between.norm();
  if (distance - thickness_ <= look_.margin) return Seen::kTouching;
  look_.nearest = std::min(look_.nearest, distance - thickness_);
  const Vec3 direction = between / distance;
  const double less = thickness_ + look_.kept + stretch_.offset;
  for (std::size_t i = 0; i < one.count; ++i)
    for (std::size_t j = 0; j < other.count; ++j)
      look_.best = std::min(look_.best, part_to_close(direction.dot(x[0][i] - y[0][j]) - less,
                                                      direction.dot(x[1][i] - y[1][j]) - less, bend));
  return Seen::kClear;
}

}  // namespace limber::internal
