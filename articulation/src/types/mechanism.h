/// @file mechanism.h
/// What the contacts of an assembly tell together, which each alone does not. Private to the articulation module.
#pragma once

#include <vector>

#include "limber/articulation/assembly.h"
#include "limber/articulation/slippage.h"

namespace limber::internal {

/// What the contacts of two components may be.
struct PairOfParts {
  std::vector<ContactRegion> regions;
  Slippage slippage;

  Index a() const { return regions.front().a; }
  Index b() const { return regions.front().b; }
  bool is_flat() const { return slippage.hypotheses.front().joint.type == JointType::kPlanar; }
};

/// Where flat contacts alone hold parts together, they rest on each other, and weight presses all of them one way.
/// Flat contacts that look different ways are flanges of bearings, which are not drawn: each turns, about the line that
/// its hypothesis of a turn has, or else about the middle of the contact. Contacts in closed chains do not count.
void explain_flanges(const Assembly& assembly, std::vector<PairOfParts>& pairs);

}  // namespace limber::internal
