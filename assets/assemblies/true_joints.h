/// @file true_joints.h
/// What is known of a drawn assembly, as a joints file (docs/formats/joints.md).
#pragma once

#include "assemblies.h"
#include "limber/articulation/joints_file.h"

namespace limber::assemblies {

/// A component for each part, over the faces of `made.surface` as it stands; every joint with its limits where all of
/// them are known on paper. Where one is not, the joint has no limits and a reason says so. A ball's swings about y and
/// z are given as its cone, from which they differ by its facets.
JointsFile true_joints(const MadeAssembly& made);

}  // namespace limber::assemblies
