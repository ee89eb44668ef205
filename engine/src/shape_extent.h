// How large what a body shows to others is, m.
#pragma once

#include <span>

#include "limber/collision/rigid_model.h"
#include "limber/model/modal_model.h"
#include "limber/model/shape.h"

namespace limber::internal {

struct ShapeExtent {
  double radius = 0.0;     ///< of a ball about the body origin that holds all of it
  double thickness = 0.0;  ///< the shortest side of its box in the body frame
};

/// @pre valid, and no half-space
ShapeExtent extent_of(const Shape& shape);
/// Of a compound: it is as thin as its thinnest part.
ShapeExtent extent_of(std::span<const ShapePart> parts);
/// Of the collision surface at rest.
ShapeExtent extent_of(const ModalModel& model);

}  // namespace limber::internal
