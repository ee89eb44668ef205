#include "limber/collision/time_of_impact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "finder/world_bounds.h"
#include "limber/collision/closest_features.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/deformed_surface.h"
#include "limber/collision/narrow_phase.h"
#include "limber/core/error.h"
#include "tuning.h"

namespace limber {

using internal::box_about;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Round-off of a pose and of what is done with it, in ε of its coordinates.
constexpr double kMotionRoundOff = 32.0 * std::numeric_limits<double>::epsilon();
/// How fast two things come together along a direction: they close c t + ½ k t² + f at most.
struct Closing {
  double speed, acceleration, offset;
};

/// When a gap may be closed at the earliest.
double time_to_close(double gap, const Closing& c) {
  const double g = gap - c.offset;
  if (!(g > 0.0)) return 0.0;  // NaN too: infinity less infinity
  const double discriminant = c.speed * c.speed + 2.0 * c.acceleration * g;
  if (discriminant < 0.0) return kInfinity;
  const double root = std::sqrt(discriminant);
  if (c.speed > 0.0) return 2.0 * g / (c.speed + root);
  return c.acceleration > 0.0 ? (root - c.speed) / c.acceleration : kInfinity;
}

/// Largest distance of a point of a box from the origin.
double farthest(const Aabb& box) { return box.low.cwiseAbs().cwiseMax(box.high.cwiseAbs()).norm(); }

/// One body at one time, and what it can do within the time looked ahead.
class Side {
 public:
  void start(const MovingBody& body) {
    if (!body.surface == !body.geometry)
      throw InvalidArgument("TimeOfImpact::find: a body has both a surface and a geometry, or neither, expected one");
    motion_ = body.motion;
    surface_ = body.geometry ? body.geometry->surface() : body.surface;
    core_ = {Vec3::Zero(), Vec3::Zero()};
    core_count_ = 0;
    core_radius_ = 0.0;
    plane_.reset();
    if (body.geometry) take_core(body.geometry->shape());
    radius_ = surface_ ? surface_radius() : core_[0].norm();
    if (!motion_) {
      state_.time = 0.0;
      state_.pose = body.pose;
      state_.velocity = state_.angular_velocity = Vec3::Zero();
      state_.amplitudes.assign(body.amplitudes.begin(), body.amplitudes.end());
      state_.rates.assign(body.amplitudes.size(), 0.0);
      bounds_.frame = {};
      bounds_.modes.assign(body.amplitudes.size(), {});
      for (std::size_t i = 0; i < bounds_.modes.size(); ++i) bounds_.modes[i].size = std::abs(body.amplitudes[i]);
    }
    bound_ = false;
  }

  void go_to(double t) {
    if (motion_) motion_->evaluate(t, state_);
    rotation_ = to_matrix(state_.pose.q);
    if (surface_ && (!bound_ || (motion_ && surface_->modes() > 0))) shape_.bind(surface_, state_.amplitudes);
    bound_ = true;
  }

  /// Chooses for each mode and for the turning: what it does now and a bound on how that changes, or a bound on all it
  /// can do.
  void look_ahead(double until, double duration) {
    if (motion_) motion_->bounds(state_, until, bounds_);
    const FrameBounds& frame = bounds_.frame;
    const double chord = 2.0 * std::sin(0.5 * frame.turn), half_square = 0.5 * duration * duration;
    double arm = radius_, bent_rate = 0.0, bent = 0.0, whole = 0.0;
    flexing_speed_ = 0.0;
    rates_.assign(state_.rates.size(), 0.0);
    if (surface_ && surface_->skin()) arm = bend(whole);
    for (std::size_t i = 0; i < bounds_.modes.size() && !(surface_ && surface_->skin()); ++i) {
      const ModeBound& mode = bounds_.modes[i];
      const double shape = surface_->largest_shape(static_cast<Index>(i));
      arm += shape * mode.size;
      if (half_square * mode.acceleration <= mode.change) {
        rates_[i] = state_.rates[i];
        flexing_speed_ += shape * std::abs(state_.rates[i]);
        bent_rate += shape * mode.rate;
        bent += shape * mode.acceleration;
      } else {
        whole += shape * mode.change;
      }
    }
    arm_ = arm;
    if (flexing_speed_ > 0.0) flow_.bind(surface_, rates_);
    const bool as_it_turns = half_square * frame.bend <= chord;
    turning_ = as_it_turns ? state_.angular_velocity : Vec3(Vec3::Zero());
    turn_acceleration_ = as_it_turns ? frame.bend : 0.0;
    turn_offset_ = as_it_turns ? 0.0 : chord;
    acceleration_ = turn_acceleration_ * arm + (as_it_turns ? 2.0 * frame.angular_speed * bent_rate : 0.0) + bent;
    offset_ = turn_offset_ * arm + whole;
  }

  /// A plane is as wide as the other body is far: its points are those abreast of it.
  void widen_plane(double reach, double speed) {
    acceleration_ =
        turn_acceleration_ * reach + (turn_acceleration_ > 0.0 ? 2.0 * bounds_.frame.angular_speed * speed : 0.0);
    offset_ = turn_offset_ * reach;
  }

  const std::optional<HalfSpace>& plane() const { return plane_; }
  const Vec3& position() const { return state_.pose.p; }
  const Mat3& rotation() const { return rotation_; }
  const Vec3& velocity() const { return state_.velocity; }
  const Vec3& turning() const { return turning_; }  ///< ω as far as it is taken as it is now
  Vec3 linear_acceleration() const { return motion_ ? motion_->path().acceleration() : Vec3(Vec3::Zero()); }
  double acceleration() const { return acceleration_; }
  double offset() const { return offset_; }
  double flexing_speed() const { return flexing_speed_; }
  double thickness() const { return core_radius_; }
  double arm() const { return arm_; }
  const FrameBounds& frame_bounds() const { return bounds_.frame; }
  double speed() const { return bounds_.frame.speed + bounds_.frame.angular_speed * arm_ + flexing_speed_; }
  double smooth_until(double t) const { return motion_ ? motion_->smooth_until(t) : kInfinity; }

  // The tree; a core is one leaf.
  bool leaf(Index node) const { return !surface_ || surface_->node(node).leaf(); }
  Index child(Index node) const { return surface_->node(node).child; }
  /// Triangles below a node, or one core.
  Index weight(Index node) const { return surface_ ? surface_->node(node).count : 1; }
  Aabb box(Index node) {
    if (surface_) return shape_.bounds(node);
    Aabb box;
    for (std::size_t i = 0; i < core_count_; ++i) box.include(core_[i]);
    return box;
  }

  /// Points of one triangle or core, in the body frame, and their velocities there, as far as flexing goes.
  struct Item {
    std::array<Vec3, 3> point, flow;
    std::size_t count = 0;
    Aabb box() const {
      Aabb b;
      for (std::size_t i = 0; i < count; ++i) b.include(point[i]);
      return b;
    }
  };
  Item item(Index node, Index number) {
    Item it;
    if (!surface_) {
      it.count = core_count_;
      for (std::size_t i = 0; i < core_count_; ++i) it.point[i] = core_[i], it.flow[i] = Vec3::Zero();
      return it;
    }
    const Index t = surface_->node_triangles(node)[static_cast<std::size_t>(number)];
    it.count = 3;
    for (std::size_t i = 0; i < 3; ++i) {
      const Index v = surface_->triangle(t)[i];
      it.point[i] = shape_.vertex(v);
      it.flow[i] = Vec3::Zero();
      if (flexing_speed_ > 0.0) it.flow[i] = flow_.vertex(v) - surface_->rest(v);
    }
    return it;
  }

 private:
  /// What a surface with a skin can do in the time looked ahead, as a whole. @return how far its vertices can be
  double bend(double& whole) {
    change_.resize(bounds_.modes.size()), shape_rates_.resize(bounds_.modes.size());
    for (std::size_t i = 0; i < change_.size(); ++i) change_[i] = motion_ ? bounds_.modes[i].change : 0.0;
    const double far = shape_.skin_extent(change_, shape_rates_);
    for (std::size_t i = 0; i < change_.size(); ++i) whole += shape_rates_[i] * change_[i];
    return far + whole;
  }

  double surface_radius() const {
    const auto& model = surface_->model();
    return model ? model->collision_extent().radius : farthest(surface_->rest_bounds());
  }

  void take_core(const Shape& shape) {
    if (const auto* ball = std::get_if<Sphere>(&shape)) {
      core_count_ = 1;
      core_radius_ = ball->radius;
    } else if (const auto* capsule = std::get_if<Capsule>(&shape)) {
      core_ = {Vec3(0.0, 0.0, capsule->half_length), Vec3(0.0, 0.0, -capsule->half_length)};
      core_count_ = 2;
      core_radius_ = capsule->radius;
    } else if (const auto* half_space = std::get_if<HalfSpace>(&shape)) {
      plane_ = *half_space;
      core_count_ = 1;
    }
  }

  const ExactMotion* motion_ = nullptr;
  std::shared_ptr<const CollisionSurface> surface_;
  std::array<Vec3, 2> core_{Vec3::Zero(), Vec3::Zero()};
  std::size_t core_count_ = 0;
  double core_radius_ = 0.0;
  std::optional<HalfSpace> plane_;
  double radius_ = 0.0;  // of the rest shape about the body origin

  MotionState state_;
  MotionBounds bounds_;
  DeformedSurface shape_;
  DeformedSurface flow_;  // the surface after a second of the rates as they are now: its vertices tell their velocities
  std::vector<double> rates_;
  std::vector<double> change_, shape_rates_;  // with a skin
  bool bound_ = false;

  Mat3 rotation_ = Mat3::Identity();
  Vec3 turning_ = Vec3::Zero();
  double arm_ = 0.0;
  double flexing_speed_ = 0.0, acceleration_ = 0.0, offset_ = 0.0, turn_acceleration_ = 0.0, turn_offset_ = 0.0;
};

/// A direction in which boxes of both sides are compared. With x_A, x_B points of the bodies:
///   n·(p_a − p_b) = place + n_A·x_A − n_B·x_B,   its rate = velocity + w_A·x_A − w_B·x_B
struct Axis {
  Vec3 n_A, n_B, w_A, w_B;
  double place, velocity, acceleration;
};

/// Two sides at one time.
class Pair {
 public:
  Side a, b;  // b may be a plane, a may not

  /// @return round-off of the pair's geometry, m
  double start(const MovingBody& first, const MovingBody& second, double step) {
    const bool swap = first.geometry && std::holds_alternative<HalfSpace>(first.geometry->shape());
    a.start(swap ? second : first);
    b.start(swap ? first : second);
    last_.reset();
    go_to(0.0, step);
    return kMotionRoundOff * (a.position().norm() + b.position().norm() + a.arm() + b.arm());
  }

  void go_to(double t, double until) {
    a.go_to(t);
    b.go_to(t);
    look_ahead(t, until);
  }

  void look_ahead(double t, double until) {
    a.look_ahead(until, until - t);
    b.look_ahead(until, until - t);
    apart_ = a.position() - b.position();
    if (b.plane()) {
      const double speed = a.speed() + b.frame_bounds().speed;
      b.widen_plane(apart_.norm() + a.arm() + a.frame_bounds().travel + b.frame_bounds().travel, speed);
    }
    acceleration_ = a.acceleration() + b.acceleration();
    offset_ = a.offset() + b.offset();
    thickness_ = a.thickness() + b.thickness();
    falling_ = a.linear_acceleration() - b.linear_acceleration();
    make_axes();
  }

  /// A nearer look would bound it more sharply.
  bool has_offset() const { return offset_ > 0.0; }

  /// The earliest time from now, at most `best`, at which a gap may be down to `kept`; none where one is down to
  /// `margin` now.
  std::optional<double> advancement(double kept, double margin, double best) {
    struct Entry {
      Index m, n;
      double time;
    };
    std::array<Entry, 2 * CollisionSurface::kMaxDepth + 4> stack;
    std::size_t size = 0;
    const auto entry = [&](Index m, Index n) { return Entry{m, n, earliest(a.box(m), b.box(n), kept)}; };
    if (last_ && !visit(*last_, kept, margin, best)) return std::nullopt;
    stack[size++] = entry(0, 0);
    while (size > 0) {
      const Entry e = stack[--size];
      if (!(e.time < best)) continue;
      if (a.leaf(e.m) && b.leaf(e.n)) {
        if (!visit(e.m, e.n, kept, margin, best)) return std::nullopt;
        continue;
      }
      const bool descend_a = b.leaf(e.n) || (!a.leaf(e.m) && a.weight(e.m) >= b.weight(e.n));
      Entry near = descend_a ? entry(a.child(e.m), e.n) : entry(e.m, b.child(e.n));
      Entry far = descend_a ? entry(a.child(e.m) + 1, e.n) : entry(e.m, b.child(e.n) + 1);
      if (far.time < near.time) std::swap(near, far);
      stack[size++] = far;
      stack[size++] = near;
    }
    return best;
  }

 private:
  void make_axes() {
    axis_count_ = 0;
    if (b.plane()) {
      const Vec3 n = b.rotation() * b.plane()->normal, w_b = n.cross(b.turning());
      axes_[axis_count_++] = {.n_A = a.rotation().transpose() * n,
                              .n_B = Vec3::Zero(),
                              .w_A = a.rotation().transpose() * (n.cross(a.turning()) - w_b),
                              .w_B = Vec3::Zero(),
                              .place = n.dot(apart_) - b.plane()->offset,
                              .velocity = n.dot(a.velocity() - b.velocity()) - w_b.dot(apart_),
                              .acceleration = n.dot(falling_)};
      return;
    }
    for (int i = 0; i < 6; ++i) {
      const Vec3 n = i < 3 ? a.rotation().col(i) : b.rotation().col(i - 3);
      axes_[axis_count_++] = {.n_A = a.rotation().transpose() * n,
                              .n_B = b.rotation().transpose() * n,
                              .w_A = a.rotation().transpose() * n.cross(a.turning()),
                              .w_B = b.rotation().transpose() * n.cross(b.turning()),
                              .place = n.dot(apart_),
                              .velocity = n.dot(a.velocity() - b.velocity()),
                              .acceleration = n.dot(falling_)};
    }
  }

  /// For all points of two boxes: the latest of what each axis says.
  double earliest(const Aabb& box_A, const Aabb& box_B, double kept) const {
    const Vec3 c_A = box_A.center(), h_A = box_A.half_extents(), c_B = box_B.center(), h_B = box_B.half_extents();
    double time = 0.0;
    for (std::size_t i = 0; i < axis_count_; ++i) {
      const Axis& x = axes_[i];
      const double place = x.place + x.n_A.dot(c_A) - x.n_B.dot(c_B);
      const double sign = place < 0.0 && !b.plane() ? -1.0 : 1.0;
      const double gap = sign * place - x.n_A.cwiseAbs().dot(h_A) - x.n_B.cwiseAbs().dot(h_B) - thickness_ - kept;
      if (!(gap > offset_)) continue;
      const double speed = -sign * (x.velocity + x.w_A.dot(c_A) - x.w_B.dot(c_B)) + x.w_A.cwiseAbs().dot(h_A) +
                           x.w_B.cwiseAbs().dot(h_B) + a.flexing_speed() + b.flexing_speed();
      time = std::max(time, time_to_close(gap, {speed, acceleration_ - sign * x.acceleration, offset_}));
    }
    return time;
  }

  /// All pairs of items of two leaves. @return false where one is within the margin
  bool visit(Index m, Index n, double kept, double margin, double& best) {
    for (Index i = 0; i < a.weight(m); ++i) {
      const Side::Item one = a.item(m, i);
      const Aabb box_A = one.box();
      for (Index j = 0; j < b.weight(n); ++j) {
        const Side::Item other = b.item(n, j);
        if (!(earliest(box_A, other.box(), kept) < best)) continue;
        const double before = best;
        if (!visit(one, other, kept, margin, best)) return false;
        if (best < before) last_ = {m, n, i, j};
      }
    }
    return true;
  }

  struct ItemPair {
    Index m, n, i, j;
  };
  bool visit(const ItemPair& p, double kept, double margin, double& best) {
    return visit(a.item(p.m, p.i), b.item(p.n, p.j), kept, margin, best);
  }

  bool visit(const Side::Item& one, const Side::Item& other, double kept, double margin, double& best) const {
    return b.plane() ? visit_plane(one, kept, margin, best) : visit_items(one, other, kept, margin, best);
  }

  bool visit_plane(const Side::Item& item, double kept, double margin, double& best) const {
    const Axis& x = axes_[0];
    for (std::size_t i = 0; i < item.count; ++i) {
      const double gap = x.place + x.n_A.dot(item.point[i]) - thickness_;
      if (gap <= margin) return false;
      const double speed = -(x.velocity + x.w_A.dot(item.point[i]) + x.n_A.dot(item.flow[i]));
      best = std::min(best, time_to_close(gap - kept, {speed, acceleration_ - x.acceleration, offset_}));
    }
    return true;
  }

  /// Along the line of the nearest points: convex items stay apart as long as their corners do.
  bool visit_items(const Side::Item& one, const Side::Item& other, double kept, double margin, double& best) const {
    std::array<Vec3, 3> x, y;  // from the origin of b, world axes
    for (std::size_t i = 0; i < one.count; ++i) x[i] = apart_ + a.rotation() * one.point[i];
    for (std::size_t j = 0; j < other.count; ++j) y[j] = b.rotation() * other.point[j];
    const Vec3 between = nearest(x, one.count, y, other.count);
    const double distance = between.norm();
    if (distance - thickness_ <= margin) return false;
    const Vec3 direction = between / distance;
    const double acceleration = acceleration_ - direction.dot(falling_);
    const Vec3 w_a = direction.cross(a.turning()), w_b = direction.cross(b.turning());
    const Vec3 n_A = a.rotation().transpose() * direction, n_B = b.rotation().transpose() * direction;
    const double velocity = direction.dot(a.velocity() - b.velocity());
    for (std::size_t i = 0; i < one.count; ++i) {
      const double place_a = direction.dot(x[i]), velocity_a = w_a.dot(x[i] - apart_) + n_A.dot(one.flow[i]);
      for (std::size_t j = 0; j < other.count; ++j) {
        const double gap = place_a - direction.dot(y[j]) - thickness_ - kept;
        const double speed = -(velocity + velocity_a - w_b.dot(y[j]) - n_B.dot(other.flow[j]));
        best = std::min(best, time_to_close(gap, {speed, acceleration, offset_}));
      }
    }
    return true;
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

  Vec3 apart_ = Vec3::Zero(), falling_ = Vec3::Zero();
  double acceleration_ = 0.0, offset_ = 0.0, thickness_ = 0.0;
  std::array<Axis, 6> axes_;
  std::size_t axis_count_ = 0;
  std::optional<ItemPair> last_;  // whose time was the least: likely to be it again
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
  for (int n = 1; n <= impl_->options.max_advancements; ++n) {
    const double ahead = until - t;
    const std::optional<double> safe = pair.advancement(t == 0.0 ? margin : tuning.kept_gap * margin, margin, ahead);
    if (!safe) return {t == 0.0 ? Status::kTouching : Status::kImpact, t, n};
    if (*safe < tuning.good_advancement * ahead && pair.has_offset()) {
      const double kick = std::min(pair.a.smooth_until(t), pair.b.smooth_until(t));
      until = std::min(t + std::max(tuning.look_nearer * ahead, tuning.look_again * *safe), kick > t ? kick : until);
      pair.look_ahead(t, until);
      continue;
    }
    t += *safe;
    if (t >= step) return {Status::kNone, step, n};
    until = std::min(step, t + tuning.look_farther * *safe);
    pair.go_to(t, until);
  }
  return {Status::kResting, t, impl_->options.max_advancements};
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
  const double arm = farthest(box_B), sway = motion.sway(arm, shape);
  const Vec3 center = start.q * box_B.center();
  const Vec3 half = to_matrix(start.q).cwiseAbs() * box_B.half_extents();
  const Vec3 low = (center - half).array() - sway, high = (center + half).array() + sway;
  track.low += low.cwiseMax(-(arm + sway));
  track.high += high.cwiseMin(arm + sway);
  return box_about(track.center(), track.half_extents());
}

}  // namespace limber
