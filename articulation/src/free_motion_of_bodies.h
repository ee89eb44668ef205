/// @file free_motion_of_bodies.h
/// free_motion() for bodies that were made ready once and are moved along many paths. Private to the articulation
/// module.
#pragma once

#include <span>

#include "orbit_faces.h"

namespace limber::internal {

/// @pre arguments that limber::free_motion() accepts
FreeMotion free_motion(std::span<const OrbitBody> moving, std::span<const OrbitBody> fixed, const MotionPath& path,
                       const FreeMotionOptions& options, double sagitta);

}  // namespace limber::internal
