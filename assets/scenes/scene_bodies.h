/// @file scene_bodies.h
/// Bodies of the scenes, meshed and baked.
#pragma once

#include <string>

#include "limber/model/asset.h"

namespace limber::scenes {

struct BodyOptions {
  int modes = 0;                  ///< kept, ≥ 0
  int vertices = 0;               ///< of the drawn surface, about; 0: the mesh's own
  bool volume = false;            ///< with all its nodes
  bool touched_as_drawn = false;  ///< the drawn surface is what touches, too
  bool damped = true;
  double stiffness = 1.0;  ///< times the body's own
};

/// @param name "box", "brick", "bar", "link", "bowl" or "bunny"; centred
Asset bake_body(const std::string& name, const BodyOptions& options);

/// The extents of a body of the library, m.
Vec3 body_size(const std::string& name);

}  // namespace limber::scenes
