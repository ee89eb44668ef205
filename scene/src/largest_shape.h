/// @file largest_shape.h
/// Private to the scene module.
#pragma once

#include <algorithm>

#include "limber/model/modal_model.h"

namespace limber::internal {

/// Length of a mode's largest displacement of a vertex, kg^−½.
inline double largest_shape(const ModalSurface& surface, Index mode) {
  double largest = 0.0;
  for (Index v = 0; v < surface.vertices(); ++v)
    largest = std::max(largest, surface.basis.shape(v, mode).cast<double>().norm());
  return largest;
}

}  // namespace limber::internal
