#include "finder/moving_side.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

#include "finder/world_bounds.h"
#include "limber/collision/narrow_phase.h"
#include "limber/core/error.h"

namespace limber::internal {
void MovingSide::start(const MovingBody& body) {
  if (!body.surface == !body.geometry)
    throw InvalidArgument("TimeOfImpact::find: a body has both a surface and a geometry, or neither, expected one");
  motion_ = body.motion;
  moves_ = motion_ != nullptr;
  swapped_ = false;
  surface_ = body.geometry ? body.geometry->surface() : body.surface;
  core_ = {Vec3::Zero(), Vec3::Zero()};
  core_count_ = 0;
  core_radius_ = 0.0;
  plane_.reset();
  if (body.geometry) take_core(body.geometry->shape());
  radius_ = surface_ ? surface_radius() : core_[0].norm();
  if (surface_) {
    const std::size_t slots = surface_->nodes().size() + static_cast<std::size_t>(surface_->triangles());
    if (slots_.size() < slots) slots_.resize(slots);
  }
  if (moves_) {
    evaluate(0.0, 0);
    states_[1].time = -1.0;
  } else {
    MotionState& s = states_[0];
    s.time = 0.0;
    s.pose = body.pose;
    s.velocity = s.angular_velocity = Vec3::Zero();
    s.amplitudes.assign(body.amplitudes.begin(), body.amplitudes.end());
    s.rates.assign(body.amplitudes.size(), 0.0);
    rotation_[0] = to_matrix(s.pose.q);
    bounds_.frame = {};
    bounds_.modes.assign(body.amplitudes.size(), {});
    for (std::size_t i = 0; i < bounds_.modes.size(); ++i) bounds_.modes[i].size = std::abs(body.amplitudes[i]);
    if (surface_) shapes_[0].bind(surface_, s.amplitudes, BoundsChoice::kAutomatic);
  }
  if (surface_ && moves_ && surface_->modes() == 0) shapes_[0].bind(surface_, {});
}

void MovingSide::bind_shape(std::size_t at) {
  if (surface_ && surface_->modes() > 0) shapes_[at].bind(surface_, states_[at].amplitudes, BoundsChoice::kAutomatic);
}

void MovingSide::evaluate(double t, int end) {
  const std::size_t at = place(end);
  motion_->evaluate(t, states_[at]);
  rotation_[at] = to_matrix(states_[at].pose.q);
  if (end == 0 || !skinned()) bind_shape(at);
}

void MovingSide::go_to(double t) {
  if (!moves_ || state(0).time == t) return;
  if (state(1).time != t) return evaluate(t, 0);
  swapped_ = !swapped_;
  if (skinned()) bind_shape(place(0));
}

void MovingSide::look_ahead(double until) {
  duration_ = until - state(0).time;
  if (moves_) {
    if (state(1).time != until) evaluate(until, 1);
    motion_->bounds(state(0), until, bounds_);
  }
  bound_flexing();
  bound_turning();
}

/// Of all of the body: how far its points come, and by how much modes are off their chords.
void MovingSide::bound_flexing() {
  arm_ = radius_;
  flexing_way_ = flexing_bend_ = flexing_offset_ = flexing_speed_ = 0.0;
  if (!surface_ || surface_->modes() == 0) return;
  if (skinned()) return bound_skin();
  const double half = 0.5 * duration_ * duration_;
  for (std::size_t i = 0; i < bounds_.modes.size(); ++i) {
    const ModeBound& mode = bounds_.modes[i];
    const double u = surface_->largest_shape(static_cast<Index>(i));
    arm_ += u * mode.size;
    if (!moves_) continue;
    const double way = std::abs(state(1).amplitudes[i] - state(0).amplitudes[i]);
    const double bend = half * mode.acceleration, offset = mode.change + way;
    flexing_way_ += u * way;
    flexing_speed_ += u * mode.rate;
    if (bend <= 4.0 * offset)
      flexing_bend_ += u * bend;
    else
      flexing_offset_ += u * offset;
  }
}

/// A skin is taken as it is at the start, and all that it can do as a whole.
void MovingSide::bound_skin() {
  const std::size_t k = bounds_.modes.size();
  change_.resize(k), shape_rates_.resize(k);
  for (std::size_t i = 0; i < k; ++i) change_[i] = moves_ ? bounds_.modes[i].change : 0.0;
  arm_ = shape(0).skin_extent(change_, shape_rates_);
  for (std::size_t i = 0; i < k; ++i) {
    flexing_offset_ += shape_rates_[i] * change_[i];
    flexing_speed_ += moves_ ? shape_rates_[i] * bounds_.modes[i].rate : 0.0;
  }
  arm_ += flexing_offset_;
}

/// Whether the turning is bounded by its acceleration, or by all it can do.
void MovingSide::bound_turning() {
  const FrameBounds& frame = bounds_.frame;
  turning_way_ = frame.angular_speed * duration_ * flexing_way_;
  turning_bend_ = 0.5 * duration_ * duration_ * frame.bend;
  turning_chord_ = 2.0 * std::sin(0.5 * frame.turn);
  turns_at_once_ = !(turning_bend_ * arm_ + turning_way_ <= 4.0 * turning_chord_ * arm_);
}

ChordError MovingSide::error(double arm) const {
  if (turns_at_once_) return {.bend = flexing_bend_, .offset = flexing_offset_ + turning_chord_ * arm};
  return {.bend = flexing_bend_ + turning_bend_ * arm + turning_way_, .offset = flexing_offset_};
}

ChordError MovingSide::plane_error(double reach, double others_speed) const {
  const FrameBounds& frame = bounds_.frame;
  if (frame.turn == 0.0) return {};
  const double bend = turning_bend_ * reach + duration_ * duration_ * frame.angular_speed * others_speed;
  const double offset = turning_chord_ * reach;
  return bend <= 4.0 * offset ? ChordError{.bend = bend, .offset = 0.0} : ChordError{.bend = 0.0, .offset = offset};
}

double MovingSide::speed() const { return bounds_.frame.speed + bounds_.frame.angular_speed * arm_ + flexing_speed_; }

double MovingSide::smooth_until(double t) const {
  return moves_ ? motion_->smooth_until(t) : std::numeric_limits<double>::infinity();
}

void MovingSide::set_directions(const std::array<std::array<Vec3, kDirections>, 2>& directions) {
  for (std::size_t end = 0; end < 2; ++end) {
    const Mat3 to_body = rotation(static_cast<int>(end)).transpose();
    for (std::size_t i = 0; i < kDirections; ++i) {
      const Eigen::Vector3f n = (to_body * directions[end][i]).cast<float>();
      directions_[end].x[i] = n.x(), directions_[end].y[i] = n.y(), directions_[end].z[i] = n.z();
    }
  }
  parts_used_ = 0;
  if (++stamp_ != 0) return;
  for (Slot& slot : slots_) slot.stamp = 0;
  stamp_ = 1;
}

/// Of a node or a triangle, and whether it has been placed along the directions at hand.
std::pair<PlacedPart*, bool> MovingSide::part_at(std::size_t key) {
  if (slots_.size() <= key) slots_.resize(key + 1);
  Slot& slot = slots_[key];
  if (slot.stamp == stamp_) return {&parts_[slot.part], true};
  slot = {stamp_, static_cast<std::uint32_t>(parts_used_)};
  if (parts_used_ == parts_.size()) parts_.emplace_back();
  return {&parts_[parts_used_++], false};
}

const PlacedPart& MovingSide::node(Index node) {
  if (!surface_) return item(node, 0);
  const auto [found, is_placed] = part_at(static_cast<std::size_t>(node));
  PlacedPart& part = *found;
  if (is_placed) return part;
  double arm = 0.0;
  for (const int end : {0, 1}) {
    const Aabb box = shape(end).bounds(node);
    arm = std::max(arm, farthest_of(box));
    const Eigen::Vector3f center = box.center().cast<float>(), half = box.half_extents().cast<float>();
    const auto e = static_cast<std::size_t>(end);
    place_box(directions_[e], center.data(), half.data(), part.slab.low[e], part.slab.high[e]);
  }
  part.bend = static_cast<float>(error(arm).bend);
  return part;
}

const PlacedPart& MovingSide::item(Index node, Index number) {
  const auto key = surface_ ? surface_->nodes().size() + static_cast<std::size_t>(item_triangle(node, number)) : 0u;
  const auto [found, is_placed] = part_at(key);
  PlacedPart& part = *found;
  if (is_placed) return part;
  const Item it = points(node, number);
  double arm = 0.0;
  for (std::size_t end = 0; end < 2; ++end) {
    float xyz[9];
    for (std::size_t i = 0; i < it.count; ++i) {
      const Vec3& p = it.point[end][i];
      arm = std::max(arm, p.norm());
      for (std::size_t axis = 0; axis < 3; ++axis) xyz[3 * i + axis] = static_cast<float>(p[static_cast<int>(axis)]);
    }
    place_points(directions_[end], xyz, it.count, part.slab.low[end], part.slab.high[end]);
  }
  part.bend = static_cast<float>(error(arm).bend);
  if (plane_) fill_below(part.slab);
  return part;
}

/// All that is below a plane.
void MovingSide::fill_below(Slab& slab) {
  for (float(&low)[kDirections] : slab.low) std::fill(std::begin(low), std::end(low), -1e30f);
}

MovingSide::Item MovingSide::points(Index node, Index number) {
  Item it;
  if (!surface_) {
    it.count = core_count_;
    for (auto& end : it.point) std::copy_n(core_.begin(), core_count_, end.begin());
    return it;
  }
  const Index t = item_triangle(node, number);
  it.count = 3;
  for (const int end : {0, 1})
    for (std::size_t i = 0; i < 3; ++i)
      it.point[static_cast<std::size_t>(end)][i] = shape(end).vertex(surface_->triangle(t)[i]);
  return it;
}

double MovingSide::surface_radius() const {
  const auto& model = surface_->model();
  return model ? model->collision_extent().radius : farthest_of(surface_->rest_bounds());
}

void MovingSide::take_core(const Shape& shape) {
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

}  // namespace limber::internal
