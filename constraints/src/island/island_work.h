// The work that is done on an island in a step, by all but gravity.
#pragma once

#include "island_step.h"

namespace limber::internal {

/// Of what moves the rows: f/Δt times the agents' displacements, what is negative not counted, and what springs give.
/// Where a force is at its limit: that force times the way of its point.
double agent_work(const IslandStep& step);
/// Of the forces that the caller holds over the step.
double load_work(const IslandStep& step);
/// Whether only rows act that can neither give nor take energy: hard ones that no agent moves.
bool is_workless(const IslandStep& step);

}  // namespace limber::internal
