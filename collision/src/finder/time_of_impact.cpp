#include "limber/collision/time_of_impact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "finder/moving_side.h"
#include "finder/world_bounds.h"
#include "limber/collision/closest_features.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/deformed_surface.h"
#include "limber/collision/narrow_phase.h"
#include "limber/core/error.h"
#include "tuning.h"

namespace limber {

using internal::box_about;
using internal::ChordError;
using internal::MovingSide;
using internal::PlacedPart;

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

/// Two sides over one stretch.
class Pair {
 public:
  MovingSide a, b;  // b may be a plane, a may not

  /// @return round-off of the pair's geometry, m
  double start(const MovingBody& first, const MovingBody& second, double step) {
    const bool swap = first.geometry && std::holds_alternative<HalfSpace>(first.geometry->shape());
    a.start(swap ? second : first);
    b.start(swap ? first : second);
    last_.reset();
    look_ahead(0.0, step);
    return kMotionRoundOff * (a.position(0).norm() + b.position(0).norm() + a.arm() + b.arm());
  }

  void go_to(double t, double until) {
    a.go_to(t);
    b.go_to(t);
    look_ahead(t, until);
  }

  void look_ahead(double t, double until) {
    duration_ = until - t;
    a.look_ahead(until);
    b.look_ahead(until);
    for (const int end : {0, 1}) apart_[static_cast<std::size_t>(end)] = a.position(end) - b.position(end);
    thickness_ = a.thickness() + b.thickness();
    falling_ = 0.5 * duration_ * duration_ * (a.linear_acceleration() - b.linear_acceleration());
    const ChordError one = a.error(), other = b.plane() ? plane_error() : b.error();
    plane_bend_ = b.plane() ? other.bend : 0.0;
    offset_ = one.offset + other.offset;
    doubt_ = 0.25 * (one.bend + other.bend) + offset_;
    if (b.plane())
      follow_plane();
    else
      choose_directions();
    slab_round_off_ = kSlabRoundOff * (apart_[0].cwiseAbs().sum() + apart_[1].cwiseAbs().sum() + a.arm() + b.arm());
  }

  /// A nearer look would bound it more sharply.
  bool has_offset() const { return offset_ > 0.0; }

  enum class Seen { kClear, kTouching, kTooMuch };
  /// The earliest time from now, at most the stretch, at which a gap may be down to `kept`. Touching: one is down to
  /// `margin` now. Too much: more than a few parts come near only as the stretch is long.
  Seen advancement(double kept, double margin, double& time) {
    const internal::FinderTuning& tuning = internal::collision_tuning().finder;
    kept_ = kept, margin_ = margin;
    best_ = pruned_ = 1.0;
    nearest_ = std::numeric_limits<double>::infinity();
    visits_ = 0;
    Seen seen = last_ ? visit(a.points(last_->m, last_->i), b.points(last_->n, last_->j), last_bend()) : Seen::kClear;
    if (seen == Seen::kClear) seen = walk(tuning);
    time = std::min(best_, pruned_) * duration_;
    return seen;
  }

 private:
  struct Entry {
    Index m, n;
    double part;
  };

  Seen walk(const internal::FinderTuning& tuning) {
    std::array<Entry, 2 * CollisionSurface::kMaxDepth + 4> stack;
    std::size_t size = 0;
    const auto entry = [&](Index m, Index n) { return Entry{m, n, earliest(a.node(m), b.node(n))}; };
    stack[size++] = entry(0, 0);
    while (size > 0) {
      const Entry e = stack[--size];
      if (pruned(e.part)) continue;
      if (a.leaf(e.m) && b.leaf(e.n)) {
        if (const Seen seen = visit(e.m, e.n); seen != Seen::kClear) return seen;
        if (visits_ > tuning.visits_of_a_look && doubt_ > tuning.fine_doubt * nearest_) return Seen::kTooMuch;
        continue;
      }
      const bool descend_a = b.leaf(e.n) || (!a.leaf(e.m) && a.weight(e.m) >= b.weight(e.n));
      Entry near = descend_a ? entry(a.child(e.m), e.n) : entry(e.m, b.child(e.n));
      Entry far = descend_a ? entry(a.child(e.m) + 1, e.n) : entry(e.m, b.child(e.n) + 1);
      if (far.part < near.part) std::swap(near, far);
      stack[size++] = far;
      stack[size++] = near;
    }
    return Seen::kClear;
  }

  /// What comes hardly earlier than the best is left for the next look, so that many that come together cost little.
  bool pruned(double part) {
    if (part < internal::collision_tuning().finder.worth_a_look * best_) return false;
    pruned_ = std::min(pruned_, part);
    return true;
  }

  ChordError plane_error() const {
    const double speed = a.speed() + b.frame_bounds().speed;
    const double reach = apart_[0].norm() + a.arm() + a.frame_bounds().travel + b.frame_bounds().travel;
    ChordError e = b.plane_error(reach, speed);
    if (b.frame_bounds().turn > 0.0) e.bend += falling_.norm();
    return e;
  }

  /// Along the plane's normal alone.
  void follow_plane() {
    std::array<std::array<Vec3, internal::kDirections>, 2> directions;
    for (std::size_t end = 0; end < 2; ++end) {
      const Vec3 n = b.rotation(static_cast<int>(end)) * b.plane()->normal;
      directions[end].fill(n);
      const double height = n.dot(apart_[end]) - b.plane()->offset;
      std::fill_n(way_.between[end], internal::kDirections, static_cast<float>(height));
    }
    const double fall = b.frame_bounds().turn > 0.0 ? 0.0 : directions[0][0].dot(falling_);
    std::fill_n(way_.bend, internal::kDirections, static_cast<float>(fall));
    a.set_directions(directions);
    b.set_directions(directions);
  }

  /// Axes of both bodies and what lies between them, the way of one as the other sees it, and directions across it,
  /// along which they do not come nearer.
  void choose_directions() {
    std::array<std::array<Vec3, internal::kDirections>, 2> directions;
    std::array<Vec3, internal::kDirections>& n = directions[0];
    const Mat3 &A = a.rotation(0), &B = b.rotation(0);
    for (int axis = 0; axis < 3; ++axis) n[static_cast<std::size_t>(axis)] = A.col(axis);
    for (int axis = 0; axis < 3; ++axis) n[static_cast<std::size_t>(axis) + 3] = B.col(axis);
    const Vec3 way = apart_[1] - apart_[0];
    const Vec3 along = way.squaredNorm() > 0.0 ? Vec3(way.normalized()) : Vec3(Vec3::UnitX());
    const Vec3 u = along.unitOrthogonal(), v = along.cross(u);
    const double half = std::sqrt(0.5), third = std::sqrt(1.0 / 3.0);
    n[6] = along, n[7] = u, n[8] = v, n[9] = half * (u + v), n[10] = half * (u - v);
    n[11] = third * (along + u + v), n[12] = third * (along - u + v), n[13] = third * (along + u - v);
    n[14] = third * (along - u - v);
    n[15] = apart_[0].squaredNorm() > 0.0 ? Vec3(apart_[0].normalized()) : along;
    directions[1] = n;
    for (std::size_t i = 0; i < internal::kDirections; ++i) {
      for (std::size_t end = 0; end < 2; ++end) way_.between[end][i] = static_cast<float>(n[i].dot(apart_[end]));
      way_.bend[i] = static_cast<float>(n[i].dot(falling_));
    }
    a.set_directions(directions);
    b.set_directions(directions);
  }

  double earliest(const PlacedPart& one, const PlacedPart& other) const {
    const double kept = thickness_ + kept_ + offset_ + slab_round_off_;
    const double bend = static_cast<double>(one.bend) + static_cast<double>(other.bend) + plane_bend_;
    return static_cast<double>(
        internal::earliest_in_stretch(one.slab, other.slab, way_, static_cast<float>(kept), static_cast<float>(bend)));
  }

  /// All pairs of items of two leaves.
  Seen visit(Index m, Index n) {
    for (Index i = 0; i < a.weight(m); ++i) {
      const PlacedPart& one = a.item(m, i);
      for (Index j = 0; j < b.weight(n); ++j) {
        const PlacedPart& other = b.item(n, j);
        if (pruned(earliest(one, other))) continue;
        const double before = best_, bend = static_cast<double>(one.bend) + static_cast<double>(other.bend);
        if (visit(a.points(m, i), b.points(n, j), bend) == Seen::kTouching) return Seen::kTouching;
        if (best_ < before) last_ = {m, n, i, j};
      }
    }
    return Seen::kClear;
  }

  struct ItemPair {
    Index m, n, i, j;
  };
  double last_bend() {
    return static_cast<double>(a.item(last_->m, last_->i).bend) + static_cast<double>(b.item(last_->n, last_->j).bend);
  }

  Seen visit(const MovingSide::Item& one, const MovingSide::Item& other, double bend) {
    ++visits_;
    return b.plane() ? visit_plane(one, bend + plane_bend_) : visit_items(one, other, bend);
  }

  Seen visit_plane(const MovingSide::Item& item, double bend) {
    for (std::size_t i = 0; i < item.count; ++i) {
      std::array<double, 2> gap;
      for (std::size_t end = 0; end < 2; ++end) {
        const int e = static_cast<int>(end);
        const Vec3 n = b.rotation(e) * b.plane()->normal;
        gap[end] = n.dot(apart_[end] + a.rotation(e) * item.point[end][i]) - b.plane()->offset - thickness_;
      }
      if (gap[0] <= margin_) return Seen::kTouching;
      nearest_ = std::min(nearest_, gap[0]);
      const double fall = b.frame_bounds().turn > 0.0 ? 0.0 : (b.rotation(0) * b.plane()->normal).dot(falling_);
      best_ = std::min(best_, part_to_close(gap[0] - kept_ - offset_, gap[1] - kept_ - offset_, bend + fall));
    }
    return Seen::kClear;
  }

  /// Along the line of the nearest points: convex items stay apart as long as their corners do.
  Seen visit_items(const MovingSide::Item& one, const MovingSide::Item& other, double bend) {
    std::array<std::array<Vec3, 3>, 2> x, y;  // from the origin of b, world axes
    for (std::size_t end = 0; end < 2; ++end) {
      const int e = static_cast<int>(end);
      for (std::size_t i = 0; i < one.count; ++i) x[end][i] = apart_[end] + a.rotation(e) * one.point[end][i];
      for (std::size_t j = 0; j < other.count; ++j) y[end][j] = b.rotation(e) * other.point[end][j];
    }
    const Vec3 between = nearest(x[0], one.count, y[0], other.count);
    const double distance = between.norm();
    if (distance - thickness_ <= margin_) return Seen::kTouching;
    nearest_ = std::min(nearest_, distance - thickness_);
    const Vec3 direction = between / distance;
    const double less = thickness_ + kept_ + offset_;
    bend += direction.dot(falling_);
    for (std::size_t i = 0; i < one.count; ++i)
      for (std::size_t j = 0; j < other.count; ++j)
        best_ = std::min(best_, part_to_close(direction.dot(x[0][i] - y[0][j]) - less,
                                              direction.dot(x[1][i] - y[1][j]) - less, bend));
    return Seen::kClear;
  }

  /// From the nearest point of y to that of x; zero where they intersect.
  static Vec3 nearest(const std::array<Vec3, 3>& x, std::size_t x_count, const std::array<Vec3, 3>& y,
                      std::size_t y_count) {
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

  double duration_ = 0.0;
  std::array<Vec3, 2> apart_{Vec3::Zero(), Vec3::Zero()};
  Vec3 falling_ = Vec3::Zero();
  double thickness_ = 0.0, plane_bend_ = 0.0, offset_ = 0.0, doubt_ = 0.0, slab_round_off_ = 0.0;
  internal::SlabWay way_;
  std::optional<ItemPair> last_;  // whose time was the least: likely to be it again

  // Of the look at hand.
  double kept_ = 0.0, margin_ = 0.0;
  double best_ = 1.0, pruned_ = 1.0, nearest_ = 0.0;  // parts of the stretch; m
  int visits_ = 0;
};

}  // namespace

struct TimeOfImpact::Impl {
  TimeOfImpactOptions options;
  Pair pair;
};

TimeOfImpact::TimeOfImpact(const TimeOfImpactOptions& options) : impl_(std::make_unique<Impl>()) {
  if (options.max_advancements < 1)
    throw InvalidArgument("TimeOfImpact: max_advancements is " + std::to_string(options.max_advancements) +
                          ", expected at least 1");
  impl_->options = options;
}
TimeOfImpact::~TimeOfImpact() = default;
TimeOfImpact::TimeOfImpact(TimeOfImpact&&) noexcept = default;
TimeOfImpact& TimeOfImpact::operator=(TimeOfImpact&&) noexcept = default;

ImpactTime TimeOfImpact::find(const MovingBody& first, const MovingBody& second, double step, double margin) {
  using Status = ImpactTime::Status;
  Pair& pair = impl_->pair;
  const double round_off = pair.start(first, second, step);
  if (pair.a.plane()) return {Status::kNone, step, 0};  // two half-spaces
  margin = std::max(margin, round_off);
  const internal::FinderTuning& tuning = internal::collision_tuning().finder;
  double t = 0.0, until = step;
  bool apart = false;  // at the start, by more than the margin: from then on half of it is kept
  for (int n = 1; n <= impl_->options.max_advancements; ++n) {
    const double ahead = until - t;
    double safe = 0.0;
    const Pair::Seen seen = pair.advancement(apart ? tuning.kept_gap * margin : margin, margin, safe);
    if (seen == Pair::Seen::kTouching) return {t == 0.0 ? Status::kTouching : Status::kImpact, t, n};
    const bool first = !apart, short_way = safe < tuning.good_advancement * ahead;
    apart = apart || seen == Pair::Seen::kClear;
    if (seen == Pair::Seen::kTooMuch || (short_way && pair.has_offset())) {
      const double kick = std::min(pair.a.smooth_until(t), pair.b.smooth_until(t));
      const double nearer = std::clamp(tuning.look_again * safe, tuning.look_nearer * ahead, 0.5 * ahead);
      until = std::min(t + nearer, kick > t ? kick : until);
      pair.look_ahead(t, until);
      continue;
    }
    if (first && short_way) continue;
    t += safe;
    if (t >= step) return {Status::kNone, step, n};
    until = std::min(step, t + tuning.look_farther * safe);
    pair.go_to(t, until);
  }
  return {Status::kResting, t, impl_->options.max_advancements};
}

ImpactTime TimeOfImpact::find(const MovingBody& a, const MovingBody& b, double step, double margin, double least) {
  constexpr double kNearer = 0.5, kSmallestMargin = std::numeric_limits<double>::min();
  ImpactTime time = find(a, b, step, margin);
  while (time.status == ImpactTime::Status::kTouching && kNearer * margin >= std::max(least, kSmallestMargin))
    time = find(a, b, step, margin *= kNearer);
  return time;
}

Aabb swept(const Aabb& box_B, std::span<const double> shape, const ExactMotion& motion) {
  const FramePath& path = motion.path();
  const RigidTransform start = path.pose(0.0);
  const Vec3 v = path.velocity(0.0), &a = path.acceleration();
  Aabb track;
  track.include(start.p);
  track.include(path.pose(path.step()).p);
  for (int axis = 0; axis < 3; ++axis)  // where the parabola turns back
    if (const double t = -v[axis] / a[axis]; t > 0.0 && t < path.step()) {
      const double turn = start.p[axis] + 0.5 * t * v[axis];
      track.low[axis] = std::min(track.low[axis], turn);
      track.high[axis] = std::max(track.high[axis], turn);
    }
  const double arm = internal::farthest_of(box_B), sway = motion.sway(arm, shape);
  const Vec3 center = start.q * box_B.center();
  const Vec3 half = to_matrix(start.q).cwiseAbs() * box_B.half_extents();
  const Vec3 low = (center - half).array() - sway, high = (center + half).array() + sway;
  track.low += low.cwiseMax(-(arm + sway));
  track.high += high.cwiseMin(arm + sway);
  return box_about(track.center(), track.half_extents());
}

}  // namespace limber
