#include "limber/collision/deformed_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "limber/core/error.h"

namespace limber {

struct DeformedSurface::Scratch {
  struct Box {
    float center[3], half[3];
    std::uint32_t epoch;
  };
  struct Vertex {
    Vec3 p;
    std::uint32_t epoch;
  };
  std::uint32_t epoch = 0;
  std::vector<Box> boxes;
  std::vector<Vertex> vertices;
  std::vector<double> z;
  std::vector<float> amplitudes, magnitudes;
  float norm = 0.0f;
};

DeformedSurface::DeformedSurface() : scratch_(std::make_unique<Scratch>()) {}
DeformedSurface::~DeformedSurface() = default;
DeformedSurface::DeformedSurface(DeformedSurface&&) noexcept = default;
DeformedSurface& DeformedSurface::operator=(DeformedSurface&&) noexcept = default;

std::span<const double> DeformedSurface::amplitudes() const { return scratch_->z; }

void DeformedSurface::bind(std::shared_ptr<const CollisionSurface> surface, std::span<const double> z, BoundsChoice) {
  if (!surface) throw InvalidArgument("DeformedSurface::bind: the surface is null, expected one");
  if (z.size() != static_cast<std::size_t>(surface->modes()))
    throw InvalidArgument("DeformedSurface::bind: " + std::to_string(z.size()) + " amplitudes, expected " +
                          std::to_string(surface->modes()));
  double farthest = 0.0, squared_norm = 0.0;
  for (std::size_t i = 0; i < z.size(); ++i) {
    farthest += std::abs(z[i]) * surface->largest_shape(static_cast<Index>(i));
    squared_norm += surface->weights_[i] * z[i] * z[i];
  }
  if (!(farthest <= 1e30))
    throw InvalidArgument("DeformedSurface::bind: the amplitudes move a vertex by up to " + std::to_string(farthest) +
                          " m, expected at most 1e30");
  Scratch& s = *scratch_;
  surface_ = std::move(surface);
  counters_ = {};
  s.z.assign(z.begin(), z.end());
  s.amplitudes.clear(), s.magnitudes.clear();
  for (const double a : z) {
    s.amplitudes.push_back(static_cast<float>(a));
    s.magnitudes.push_back(std::abs(static_cast<float>(a)));
  }
  s.norm = std::nextafter(static_cast<float>(std::sqrt(squared_norm)), std::numeric_limits<float>::infinity());
  if (s.boxes.size() < surface_->nodes().size()) s.boxes.resize(surface_->nodes().size());
  if (s.vertices.size() < static_cast<std::size_t>(surface_->vertices()))
    s.vertices.resize(static_cast<std::size_t>(surface_->vertices()));
  if (++s.epoch == 0) {
    for (auto& box : s.boxes) box.epoch = 0;
    for (auto& vertex : s.vertices) vertex.epoch = 0;
    s.epoch = 1;
  }
}

Aabb DeformedSurface::bounds(Index node) {
  Scratch& s = *scratch_;
  Scratch::Box& box = s.boxes[static_cast<std::size_t>(node)];
  if (box.epoch != s.epoch) {
    const CollisionSurface::NodeShape& shape = surface_->node_shapes_[static_cast<std::size_t>(node)];
    const std::size_t stride = surface_->coefficients_.size() / (6 * surface_->nodes().size());
    const float* C = surface_->coefficients_.data() + static_cast<std::size_t>(node) * 6 * stride;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float *c = C + axis * stride, *d = c + 3 * stride;
      float center = shape.center[axis], spread = 0.0f;
      for (std::size_t i = 0; i < s.amplitudes.size(); ++i) {
        center += c[i] * s.amplitudes[i];
        spread += d[i] * s.magnitudes[i];
      }
      box.center[axis] = center;
      box.half[axis] = shape.half[axis] + std::min(spread, shape.energy[axis] * s.norm);
    }
    box.epoch = s.epoch;
    ++counters_.boxes;
  }
  const Vec3 center(box.center[0], box.center[1], box.center[2]), half(box.half[0], box.half[1], box.half[2]);
  return {center - half, center + half};
}

const Vec3& DeformedSurface::vertex(Index v) {
  Scratch& s = *scratch_;
  Scratch::Vertex& vertex = s.vertices[static_cast<std::size_t>(v)];
  if (vertex.epoch != s.epoch) {
    vertex.p = surface_->rest(v);
    for (int axis = 0; axis < 3; ++axis) {
      const float* u = surface_->row(v, axis);
      for (std::size_t i = 0; i < s.z.size(); ++i) vertex.p[axis] += static_cast<double>(u[i]) * s.z[i];
    }
    vertex.epoch = s.epoch;
    ++counters_.vertices;
  }
  return vertex.p;
}

std::array<Vec3, 3> DeformedSurface::triangle(Index t) {
  const auto& [a, b, c] = surface_->triangle(t);
  return {vertex(a), vertex(b), vertex(c)};
}

void DeformedSurface::refit() {}

}  // namespace limber
