/// @file scene_bodies.h
/// Bodies of the scenes, meshed and baked.
#pragma once

#include <string>

#include "limber/model/asset.h"

namespace limber::scenes {

/// @param name "box", "brick", "bar", "link", "bowl" or "bunny"; centred. @param modes kept, ≥ 0
/// @param vertices of the drawn surface, about; 0: the mesh's own
Asset bake_body(const std::string& name, int modes, int vertices);

/// The extents of a body of the library, m.
Vec3 body_size(const std::string& name);

}  // namespace limber::scenes
