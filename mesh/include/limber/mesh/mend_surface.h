/// @file limber/mesh/mend_surface.h
/// Faults of a surface that can be mended with all vertices where they are.
#pragma once

#include <string>

#include "limber/mesh/surface_mesh.h"

namespace limber {

/// How far apart two vertices may be that a file means to be one, m: 32 last bits of a float (2⁻²³) of the surface's
/// size, which is its largest coordinate or the diagonal of its bounding box, whichever is more. Programs that
/// transform and store in single precision leave such gaps.
double weld_tolerance(const SurfaceMesh& surface);

/// As weld(), but for vertices within `tolerance` of each other: each joins the nearest of those before it that stay.
/// Triangles keep their number and order, those too that then name a vertex twice. @param tolerance ≥ 0, m
/// @return how many vertices went. @pre indices are in range
Index weld_within(SurfaceMesh& surface, double tolerance);

/// Counts of what was mended.
struct SurfaceMending {
  double tolerance = 0.0;  ///< m
  Index welded = 0;        ///< vertices of open edges and of flat triangles, joined within the tolerance
  Index doubled = 0;       ///< triangles that stood more than once, dropped
  Index flat = 0;          ///< triangles no higher than the tolerance, dropped
  Index split = 0;         ///< vertices in the middle of another triangle's open edge, which has been split there
  Index turned = 0;        ///< triangles, to run as their neighbours do
  bool any() const { return welded + doubled + flat + split + turned > 0; }
  /// "2 doubled triangles dropped, 1 triangle turned"; empty if nothing was mended.
  std::string text() const;
};

/// Mends what keeps a surface from bounding a solid, as far as no vertex need move by more than the tolerance, in this
/// order:
///
/// - Vertices at equal coordinates become one (see weld()); this is not counted.
/// - Vertices of open edges that lie within the tolerance of each other become one, the first.
/// - Triangles over the same three vertices, whichever way they run, count as one where the surface around them needs
///   one, as on a body whose triangles all stand twice or back to back. They go where it needs none: a wall between two
///   bodies that share it, a sheet that hangs on a closed body. A sheet by itself keeps both sides.
/// - Triangles no higher than the tolerance go; the edges that they leave open are closed by the next step.
/// - Open edges on which a vertex of another open edge lies are split there (T-junctions).
/// - Triangles are turned to run as their neighbours across edges of two triangles; the greater part of those that hang
///   together stays. A one-sided surface stays as it is.
///
/// Holes, crossing triangles, edges and vertices at which solids touch are not mended. Vertices that no triangle uses
/// any more are left out. Takes O(n log n) time. @param tolerance ≥ 0, m @pre the surface is valid (see validate())
/// @throws InvalidArgument if the tolerance is negative or not finite
SurfaceMending mend_surface(SurfaceMesh& surface, double tolerance);

}  // namespace limber
