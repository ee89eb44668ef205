/// @file free_motion_of_bodies.h
/// free_motion() for bodies that were made ready once and are moved along many paths. Private to the articulation
/// module.
#pragma once

#include <span>
#include <vector>

#include "ranges/orbit_faces.h"

namespace limber::internal {

/// @pre arguments that limber::free_motion() accepts
FreeMotion free_motion(std::span<const OrbitBody> moving, std::span<const OrbitBody> fixed, const MotionPath& path,
                       const FreeMotionOptions& options, double sagitta);

/// The bodies of these numbers.
inline std::vector<OrbitBody> some_of(std::span<const OrbitBody> bodies, std::span<const Index> which) {
  std::vector<OrbitBody> out;
  out.reserve(which.size());
  for (const Index i : which) out.push_back(bodies[static_cast<std::size_t>(i)]);
  return out;
}

}  // namespace limber::internal
