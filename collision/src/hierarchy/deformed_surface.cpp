#include "limber/collision/deformed_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "hierarchy/deformed_scratch.h"
#include "limber/core/error.h"

namespace limber {

using internal::BoxReader;
using internal::kFarthest;
using internal::kNodeConstants;
using internal::make_boxes;
using internal::make_displacement;
using internal::NodeBox;
using internal::prepare_state;
using internal::StateSums;

namespace {

constexpr double kLargestNorm = 1e37;  ///< a float holds it
constexpr double kUnitRoundOff = 0x1p-24;

/// Nodes whose boxes are made at once: a node and its sibling, which lie side by side. The root stands alone.
Index first_of_siblings(Index node) { return node == 0 ? 0 : node - (node + 1) % 2; }

void store(const Vec3& low, const Vec3& high, std::uint32_t stamp, NodeBox& box) {
  for (int i = 0; i < 3; ++i) box.low[i] = static_cast<float>(low[i]), box.high[i] = static_cast<float>(high[i]);
  box.stamp = stamp;
}

}  // namespace

DeformedSurface::DeformedSurface() : scratch_(std::make_unique<Scratch>()) {}
DeformedSurface::~DeformedSurface() = default;
DeformedSurface::DeformedSurface(DeformedSurface&&) noexcept = default;
DeformedSurface& DeformedSurface::operator=(DeformedSurface&&) noexcept = default;

std::span<const double> DeformedSurface::amplitudes() const {
  return std::span(scratch_->z.data(), static_cast<std::size_t>(surface_->modes()));
}

void DeformedSurface::bind(const std::shared_ptr<const CollisionSurface>& surface, std::span<const double> z) {
  if (!surface) throw InvalidArgument("DeformedSurface::bind: the surface is null, expected one");
  if (z.size() != static_cast<std::size_t>(surface->modes()))
    throw InvalidArgument("DeformedSurface::bind: " + std::to_string(z.size()) + " amplitudes, expected " +
                          std::to_string(surface->modes()));
  reserve(*surface);
  Scratch& s = *scratch_;
  const StateSums sums = prepare_state(z.data(), z.size(), surface->bounds_.stride,
                                       surface->bounds_.largest_shape.data(), surface->bounds_.weights.data(),
                                       surface->bounds_.scale.data(), s.amplitudes.data(), s.magnitudes.data());
  const double norm = std::sqrt(sums.squared_norm);
  if (!(sums.farthest <= kFarthest && norm <= kLargestNorm)) {
    surface_ = nullptr;
    throw InvalidArgument("DeformedSurface::bind: the amplitudes move a vertex by up to " +
                          std::to_string(sums.farthest) + " m, expected finite ones that move none beyond 1e30 m");
  }
  s.norm = static_cast<float>(norm * (1.0 + 4.0 * kUnitRoundOff));
  s.farthest = sums.farthest;
  std::fill(std::copy(z.begin(), z.end(), s.z.data()), s.z.data() + surface->bounds_.stride, 0.0);
  const bool same_surface = surface_ == surface;
  if (!same_surface) surface_ = surface;
  set_skin(z, same_surface);
  counters_ = {};
  begin_state();
}

void DeformedSurface::reserve(const CollisionSurface& surface) {
  Scratch& s = *scratch_;
  const std::size_t nodes = surface.nodes().size(), vertices = static_cast<std::size_t>(surface.vertices());
  if (s.boxes.size() < nodes) s.boxes = AlignedArray<NodeBox>(nodes);
  const auto triangles = static_cast<std::size_t>(surface.triangles());
  if (s.triangle_boxes.size() < triangles) s.triangle_boxes = AlignedArray<NodeBox>(triangles);
  if (s.vertices.size() < vertices) s.vertices.resize(vertices);
  if (s.amplitudes.size() < surface.bounds_.stride) {
    s.amplitudes = AlignedArray<float>(surface.bounds_.stride);
    s.magnitudes = AlignedArray<float>(surface.bounds_.stride);
    s.z = AlignedArray<double>(surface.bounds_.stride);
  }
}

/// The handles, and how far they take a vertex: Σ β [(R_h − 1) r + t_h + R_h Ũ z].
void DeformedSurface::set_skin(std::span<const double> z, bool same_surface) {
  const ModalSkin* skin = surface_->skin();
  if (skin == nullptr) return;
  Scratch& s = *scratch_;
  if (!s.skinned.pose)
    s.skinned.pose.emplace(*skin);
  else if (!same_surface || &s.skinned.pose->skin() != skin)
    s.skinned.pose->bind(*skin);
  s.skinned.rates.resize(3 * z.size());
  s.skinned.pose->set(z);
  s.skinned.flexed = s.farthest;
  s.farthest = s.skinned.carried = 0.0;
  const double radius = surface_->rest_radius_;
  for (const SkinPose::Handle& handle : s.skinned.pose->handles()) {
    s.farthest = std::max(s.farthest, handle.turn.norm() * radius + handle.shift.norm() + s.skinned.flexed);
    s.skinned.carried = std::max(s.skinned.carried,
                                 handle.shift.norm() + 2.0 * handle.drift.norm() + 2.0 * handle.angle.norm() * radius);
  }
}

const SkinPose* DeformedSurface::skin() const { return surface_->skin() ? &*scratch_->skinned.pose : nullptr; }

double DeformedSurface::skin_extent(std::span<const double> change, std::span<double> shape) {
  scratch_->skinned.pose->differentiate();
  return surface_->skin_->extent.find(*scratch_->skinned.pose, amplitudes(), change, shape, scratch_->skinned.rates);
}

/// A stamp that nothing made so far carries; after 2³² states all stamps are wiped.
void DeformedSurface::begin_state() {
  Scratch& s = *scratch_;
  if (++s.stamp != 0) return;
  for (std::size_t i = 0; i < s.boxes.size(); ++i) s.boxes[i].stamp = 0;
  for (std::size_t i = 0; i < s.triangle_boxes.size(); ++i) s.triangle_boxes[i].stamp = 0;
  for (Scratch::Vertex& vertex : s.vertices) vertex.stamp = 0;
  s.stamp = 1;
}

Aabb DeformedSurface::bounds(Index node) {
  const NodeBox& box = BoxReader(*this)(node);
  return {Vec3(box.low[0], box.low[1], box.low[2]), Vec3(box.high[0], box.high[1], box.high[2])};
}

void DeformedSurface::make_box(Index node) {
  Scratch& s = *scratch_;
  const auto first = static_cast<std::size_t>(first_of_siblings(node));
  const std::size_t count = node == 0 ? 1 : 2;
  NodeBox* boxes = s.boxes.data() + first;
  make_boxes({s.amplitudes.data(), s.magnitudes.data(), s.norm, surface_->bounds_.stride},
             surface_->bounds_.constants.data() + first * kNodeConstants,
             surface_->bounds_.coefficients.data() + first * 6 * surface_->bounds_.stride, count, s.stamp, boxes);
  if (surface_->skin())
    for (std::size_t i = 0; i < count; ++i) carry_box(static_cast<Index>(first + i));
  counters_.boxes += static_cast<long>(count);
}

/// From the box of r + Ũ z, whose rows are rounded to single precision, to that of the vertices.
void DeformedSurface::carry_box(Index node) {
  Scratch& s = *scratch_;
  NodeBox& box = s.boxes[static_cast<std::size_t>(node)];
  const Vec3 low(box.low[0], box.low[1], box.low[2]), high(box.high[0], box.high[1], box.high[2]);
  const Vec3 center = 0.5 * (low + high), half = 0.5 * (high - low);
  Aabb all;
  for (const std::uint8_t h : surface_->skin_->node_handles[node]) {
    const SkinPose::Handle& handle = s.skinned.pose->handles()[h];
    const Mat3 R = Mat3::Identity() + handle.turn;
    const Vec3 c = R * center + handle.shift, reach = R.cwiseAbs() * half;
    all.include(Aabb{c - reach, c + reach});
  }
  const double size = surface_->rest_radius_ + s.skinned.flexed + s.skinned.carried;
  const Vec3 rounding = Vec3::Constant(8.0 * kUnitRoundOff * size);
  store(all.low - rounding, all.high + rounding, s.stamp, box);
}

/// Of the triangles of a leaf, from their vertices; their union takes the place of the leaf's own box, which is wider.
void DeformedSurface::make_triangle_boxes(Index leaf) {
  const auto first = static_cast<std::size_t>(surface_->node(leaf).first);
  NodeBox* box = scratch_->triangle_boxes.data() + first;
  Aabb all;
  for (const Index t : surface_->node_triangles(leaf)) {
    const std::array<Vec3, 3> x = triangle(t);
    const Vec3 low = x[0].cwiseMin(x[1]).cwiseMin(x[2]), high = x[0].cwiseMax(x[1]).cwiseMax(x[2]);
    store(low, high, scratch_->stamp, *box++);
    all.include(Aabb{low, high});
  }
  const Vec3 rounding = 2.0 * kUnitRoundOff * all.low.cwiseAbs().cwiseMax(all.high.cwiseAbs());
  store(all.low - rounding, all.high + rounding, scratch_->stamp, scratch_->boxes[static_cast<std::size_t>(leaf)]);
}

const Vec3& DeformedSurface::vertex(Index v) {
  Scratch& s = *scratch_;
  Scratch::Vertex& vertex = s.vertices[static_cast<std::size_t>(v)];
  if (vertex.stamp == s.stamp) return vertex.p;
  vertex.stamp = s.stamp;
  ++counters_.vertices;
  vertex.p = surface_->rest(v);
  if (surface_->modes() == 0) return vertex.p;
  const VertexRows& rows = surface_->model()->collision_rows();
  double u[3];
  make_displacement(rows.row(v, 0), static_cast<std::size_t>(rows.stride()), s.z.data(), surface_->bounds_.stride, u);
  if (surface_->skin())
    vertex.p = s.skinned.pose->position(surface_->influences(v), vertex.p, {u[0], u[1], u[2]});
  else
    vertex.p += Vec3(u[0], u[1], u[2]);
  return vertex.p;
}

std::array<Vec3, 3> DeformedSurface::triangle(Index t) {
  const auto& [a, b, c] = surface_->triangle(t);
  return {vertex(a), vertex(b), vertex(c)};
}

}  // namespace limber
