/// @file bridges.h
/// Edges of a graph that alone hold it together. Private to the articulation module.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "limber/core/types.h"

namespace limber::internal {

/// Per edge: whether nothing else leads from one of its nodes to the other, by Tarjan's search; time linear.
std::vector<bool> find_bridges(Index nodes, std::span<const std::pair<Index, Index>> edges);

}  // namespace limber::internal
