/// @file surface_place.h
/// From a place as a scene tells it to a point of a body's render surface.
#pragma once

#include <string>

#include "limber/engine/world.h"
#include "limber/scene/scene_file.h"

namespace limber::internal {

/// @param where the place in the scene file, for messages
/// @throws InputError if the surface has no such triangle or vertex, or the ray misses it
SurfacePoint find_place(const SurfacePlace& place, const World& world, BodyId body, const std::string& where);

}  // namespace limber::internal
