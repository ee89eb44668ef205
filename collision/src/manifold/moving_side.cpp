#include "manifold/moving_side.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <variant>

#include "finder/world_bounds.h"
#include "limber/core/quaternion.h"

namespace limber::internal {

void PlacedParts::forget_all() {
  used_ = 0;
  if (++stamp_ != 0) return;
  for (Slot& slot : slots_) slot.stamp = 0;
  stamp_ = 1;
}

std::pair<PlacedPart*, bool> PlacedParts::at(std::size_t key) {
  reserve(key + 1);
  Slot& slot = slots_[key];
  if (slot.stamp == stamp_) return {&parts_[slot.part], true};
  slot = {stamp_, static_cast<std::uint32_t>(used_)};
  if (used_ == parts_.size()) parts_.emplace_back();
  return {&parts_[used_++], false};
}

void MovingSide::start(const MovingBody& body) {
  body_ = body;
  surface_ = body.geometry ? body.geometry->surface() : body.surface;
  flexes_ = std::ranges::any_of(body.rates, [](double rate) { return rate != 0.0; });
  moves_ = flexes_ || !body.displacement.isZero(0.0) || !body.rotation.isZero(0.0);
  swapped_ = false;
  core_ = {};
  if (body.geometry) take_core(body.geometry->shape());
  if (surface_) parts_.reserve(surface_->nodes().size() + static_cast<std::size_t>(surface_->triangles()));
  evaluate(0.0, 0);
  ends_[1].time = -1.0;
  if (surface_ && !flexes_) bind_shape(0);
}

void MovingSide::take_core(const Shape& shape) {
  if (const auto* ball = std::get_if<Sphere>(&shape)) {
    core_.count = 1;
    core_.radius = ball->radius;
  } else if (const auto* capsule = std::get_if<Capsule>(&shape)) {
    core_.points = {Vec3(0.0, 0.0, capsule->half_length), Vec3(0.0, 0.0, -capsule->half_length)};
    core_.count = 2;
    core_.radius = capsule->radius;
  }
}

void MovingSide::bind_shape(std::size_t place) { ends_[place].shape.bind(surface_, ends_[place].amplitudes); }

void MovingSide::evaluate(double t, int end) {
  End& e = ends_[place(end)];
  e.time = t;
  e.pose.p = body_.pose.p + t * body_.displacement;
  e.pose.q = normalized(quaternion_from_rotation_vector(t * body_.rotation) * body_.pose.q);
  e.rotation = to_matrix(e.pose.q);
  e.amplitudes.assign(body_.amplitudes.begin(), body_.amplitudes.end());
  if (!flexes_) return;
  for (std::size_t i = 0; i < e.amplitudes.size(); ++i) e.amplitudes[i] += t * body_.rates[i];
  if (end == 0 || !skinned()) bind_shape(place(end));
}

void MovingSide::go_to(double t) {
  if (!moves_ || at(0).time == t) return;
  if (at(1).time != t) return evaluate(t, 0);
  swapped_ = !swapped_;
  if (flexes_ && skinned()) bind_shape(place(0));
}

void MovingSide::look_ahead(double until) {
  if (moves_ && at(1).time != until) evaluate(until, 1);
  bounds_ = {.arm = radius()};
  if (skinned())
    bound_skin();
  else
    bound_flexing();
  const double angle = moves_ ? body_.rotation.norm() * (until - at(0).time) : 0.0;
  bounds_.bend = 0.5 * angle * angle;
  bounds_.way *= angle;
  bounds_.chord = 2.0 * std::sin(0.5 * std::min(angle, std::numbers::pi));
  bounds_.turns_at_once = !(bounds_.bend * bounds_.arm + bounds_.way <= 4.0 * bounds_.chord * bounds_.arm);
}

/// Of the rest shape about the body origin, m.
double MovingSide::radius() const {
  if (!surface_) return core_.points[0].norm();
  const auto& model = surface_->model();
  return model ? model->collision_extent().radius : farthest_of(surface_->rest_bounds());
}

void MovingSide::bound_flexing() {
  const std::vector<double>&z0 = at(0).amplitudes, &z1 = at(1).amplitudes;
  for (std::size_t i = 0; i < z0.size(); ++i) {
    const double u = surface_->largest_shape(static_cast<Index>(i));
    bounds_.arm += u * std::max(std::abs(z0[i]), std::abs(z1[i]));
    bounds_.way += u * std::abs(z1[i] - z0[i]);
  }
}

void MovingSide::bound_skin() {
  const std::vector<double>&z0 = at(0).amplitudes, &z1 = at(1).amplitudes;
  change_.resize(z0.size()), shape_rates_.resize(z0.size());
  for (std::size_t i = 0; i < z0.size(); ++i) change_[i] = std::abs(z1[i] - z0[i]);
  bounds_.arm = shape(0).skin_extent(change_, shape_rates_);
  for (std::size_t i = 0; i < z0.size(); ++i) bounds_.offset += shape_rates_[i] * change_[i];
  bounds_.arm += bounds_.offset;
}

ChordError MovingSide::error(double arm) const {
  const Bounds& b = bounds_;
  if (b.turns_at_once) return {.bend = 0.0, .offset = b.offset + b.chord * arm};
  return {.bend = b.bend * arm + b.way, .offset = b.offset};
}

void MovingSide::set_directions(const std::array<Vec3, kDirections>& directions) {
  for (std::size_t end = 0; end < 2; ++end) {
    const Mat3 to_body = rotation(static_cast<int>(end)).transpose();
    for (std::size_t i = 0; i < kDirections; ++i) {
      const Eigen::Vector3f n = (to_body * directions[i]).cast<float>();
      directions_[end].x[i] = n.x(), directions_[end].y[i] = n.y(), directions_[end].z[i] = n.z();
    }
  }
  parts_.forget_all();
}

const PlacedPart& MovingSide::node(Index node) {
  if (!surface_) return item(node, 0);
  const auto [found, is_placed] = parts_.at(static_cast<std::size_t>(node));
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
  const auto [found, is_placed] = parts_.at(key);
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
  return part;
}

MovingSide::Item MovingSide::points(Index node, Index number) {
  Item it;
  if (!surface_) {
    it.count = core_.count;
    for (auto& end : it.point) std::copy_n(core_.points.begin(), core_.count, end.begin());
    return it;
  }
  const Index t = item_triangle(node, number);
  it.count = 3;
  for (const int end : {0, 1})
    for (std::size_t i = 0; i < 3; ++i)
      it.point[static_cast<std::size_t>(end)][i] = shape(end).vertex(surface_->triangle(t)[i]);
  return it;
}

}  // namespace limber::internal
