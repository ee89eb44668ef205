// The few points of a manifold, of all contacts of a patch.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "narrow/pair_surface.h"

namespace limber::internal {

/// What two features are called; the lower half is that of b.
inline std::uint64_t feature_pair(const FeatureContact& c) {
  return static_cast<std::uint64_t>(c.a.key) << 32 | c.b.key;
}

inline constexpr std::size_t kManifoldPoints = 4;

/// Puts at most kManifoldPoints of contacts of like normals first: the deepest, and those that span the largest area
/// with it, each one's distance from the others, seen along the normal, less by how much farther it is from touching
/// than the deepest. Those of last time win by a tenth of a distance, or a thousandth of it in depth.
/// @param last feature_pair() of those kept last time  @return how many
std::size_t choose_manifold_points(std::span<FeatureContact> patch, std::span<const std::uint64_t> last);

/// Leaves of contacts of one pair each pair of features once, and so many of each patch. A patch is begun by the
/// deepest contact that is in none, and holds those whose normals are within 20° of its.
void keep_manifold_points(std::vector<FeatureContact>& found, std::span<const std::uint64_t> last);

}  // namespace limber::internal
