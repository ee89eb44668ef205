/// @file near_samples.h
/// Points of one surface that face another across a small gap. Private to the articulation module.
#pragma once

#include <vector>

#include "limber/articulation/contact_region.h"
#include "parts/smooth_surface.h"

namespace limber::internal {

struct NearSample {
  ContactSample contact;
  Vec3 facing_facet;         ///< unit normal of the other triangle
  double distance = 0.0;     ///< unsigned gap
  double chord_error = 0.0;  ///< of the two triangles, the larger
};

/// Points spread evenly over the part of `surface` that may lie within `reach` of `other` and face it: those that do.
/// Triangles are halved, the largest first, and what is too far is dropped on the way. Where the points lie depends on
/// the shapes alone, not on pose, scale or the order of the triangles, but for triangles smaller than a point's share.
/// @param wanted points over that part, about; fewer come back where it faces nothing
std::vector<NearSample> near_samples(const SmoothSurface& surface, const SmoothSurface& other, double reach,
                                     double facing_cosine, int wanted);

/// Points spread evenly over the part of `surface` that lies inside a closed surface. Each faces itself.
std::vector<NearSample> inside_samples(const SmoothSurface& surface, const SmoothSurface& solid, int wanted);

/// Replaces each sample by the mean of a patch around it: points, and facets' normals, whose sum by area is the patch's
/// vector area, in which noise of vertices inside cancels. Means of points and normals belong together: where normals
/// are linear in the point (planes, spheres, cylinders) they stay so. For rough surfaces; a smooth one's own normals
/// are better.
void average_patches(std::vector<NearSample>& samples);

}  // namespace limber::internal
