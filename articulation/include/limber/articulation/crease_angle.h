/// @file limber/articulation/crease_angle.h
/// The bend from which on an edge between two facets is an edge of the shape, and no seam of a smooth surface.
///
/// Contacts smooth their normals across blunter edges (ContactRegionOptions), and ranges of motion take faces that meet
/// at blunter edges for one surface (FreeMotionOptions). A caller who changes one of the two means both. The corner of
/// an octagon (45°) is round at 50°, and that of a hexagon (60°) is not.
#pragma once

namespace limber {

inline constexpr double kDefaultCreaseAngle = 0.8727;  ///< rad (50°)

}  // namespace limber
