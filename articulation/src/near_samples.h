/// Points of one surface that face another across a small gap. Private to the module.
#pragma once

#include <vector>

#include "limber/articulation/contact_region.h"
#include "smooth_surface.h"

namespace limber {

struct NearSample {
  ContactSample contact;
  double distance = 0.0;     ///< unsigned gap
  double chord_error = 0.0;  ///< of the two triangles, the larger
};

/// Points spread evenly over the part of `surface` that may lie within `reach` of `other` and face it: those that do.
/// Triangles are halved, the largest first, and what is too far is dropped on the way.
/// @param wanted points over that part; fewer come back where it faces nothing
std::vector<NearSample> near_samples(const SmoothSurface& surface, const SmoothSurface& other, double reach,
                                     double facing_cosine, int wanted);

}  // namespace limber
