// The vector loops behind TimeOfImpact. No Eigen here, see hierarchy/bounds_kernels.h.
#pragma once

#include <cstddef>

namespace limber::internal {

/// Directions along which what moves is compared.
inline constexpr std::size_t kDirections = 16;

/// Unit vectors in one frame, by axis.
struct alignas(64) Directions {
  float x[kDirections], y[kDirections], z[kDirections];
};

/// Where a convex set lies along each direction, at both ends of a stretch of time, from its body's origin on, m.
struct alignas(64) Slab {
  float low[2][kDirections], high[2][kDirections];
};

/// From the origin of body b to that of body a, along each direction, at both ends, m.
struct alignas(64) SlabWay {
  float between[2][kDirections];
};

void place_box(const Directions& directions, const float* center, const float* half, float* low, float* high);
/// @param points xyz, xyz, …; count ≥ 1
void place_points(const Directions& directions, const float* points, std::size_t count, float* low, float* high);

/// From where on in a stretch, as a part of it, two sets may be nearer than `kept`: the latest of what each direction
/// says; beyond 1 if not within it. Along a direction where their gap is g₀ at the start and g₁ at the end it is at
/// least (1 − s) g₀ + s g₁ − s (1 − s) bend at s.
float earliest_in_stretch(const Slab& a, const Slab& b, const SlabWay& way, float kept, float bend);

}  // namespace limber::internal
