// Tets for one body: cells as small as its thin parts ask for and the budget allows, tried until they are good.
#pragma once

#include <string>
#include <vector>

#include "local_size.h"
#include "shells.h"

namespace limber::internal {

/// Times the nodes expected that a mesh for wide cells may take, and does where all sides are curved: half the distance
/// to a curved side asks for twice as many on it.
inline constexpr double kNodesOfWideCells = 2.0;

/// A body, the size of its cells and what it has of thin parts.
struct MeasuredBody {
  const Body* body = nullptr;
  double cell_size = 0.0;  ///< largest, m
  std::vector<ThicknessSample> samples;
  /// Nodes of a mesh whose cells are not made smaller than `smallest` for thin parts.
  double expected_nodes(double smallest) const;
  /// Nodes of a mesh with a cell across every thin part.
  double nodes_to_resolve() const;
};

/// @param cell_size wanted; a body of few cells gets smaller ones
MeasuredBody measure(const Body& body, double cell_size);

/// The least size that cells may have where bodies are thin, so that all together have at most `most_nodes`; where the
/// bodies' own cell sizes ask for more than that, those sizes stay and nothing is made smaller.
double smallest_affordable_cell(const std::vector<MeasuredBody>& bodies, double most_nodes);

struct FilledBody {
  TetMesh mesh;                   ///< nodes and tets only; empty if every try failed
  std::string fault;              ///< what is not good about the mesh, or why there is none; empty: nothing
  bool sharp_edges_kept = false;  ///< they are edges of the mesh
  int tries = 0;
  Index dropped_tets = 0;  ///< of stray pieces
};

struct Filling {
  bool keep_sharp_edges = false;
  bool wide_cells = false;  ///< where a body without inner surfaces is thin, wider than it is thick: for ten-node tets
  /// A wrap, whose edges are not kept, is curved all over.
  double nodes_per_expected() const { return wide_cells && !keep_sharp_edges ? kNodesOfWideCells : 1.0; }
};

/// The first good mesh, or else the best; if that is less than half of the body's volume, none. Good is: without flat
/// tets, in one piece and within a tenth of the body's volume. A mesh that is not good is made again with smaller
/// cells, a few times, and without the sharp edges where it cannot be made with them.
FilledBody fill(const MeasuredBody& body, double smallest_cell, const Filling& how);

}  // namespace limber::internal
