// Which cells move as one, and what acts between them.
#pragma once

#include <span>

#include "limber/core/disjoint_sets.h"
#include "structure.h"

namespace limber::internal {

/// The cells that a joint's region claims of part `part`. A cell belongs to the region of one joint at most, the
/// nearest, so that regions that overlap do not become one.
/// @return per joint of the model its cells on side a and on side b: those claimed, or for want of any the cell nearest
/// to the joint's origin. Empty for rigid parts.
struct ClaimedCells {
  std::vector<Index> a, b;
};
std::vector<ClaimedCells> claim_cells(const JointedModel& model, const PoseStructure& structure,
                                      const std::vector<PartOptions>& options);

/// Strain between cells as links between the bodies they belong to. Sets of cells of one part that no face connects
/// (shells apart) are tied to the nearest others.
void link_bodies(const JointedModel& model, const std::vector<PartOptions>& options, StrainWeights weights,
                 PoseStructure& structure);

}  // namespace limber::internal
