/// @file slepc_engine.h
/// Modes by limber-eigen on many processes, as slices that a bake takes.
#pragma once

#include <string>

#include "precompute_arguments.h"
#include "program.h"

namespace limber::tools {

/// Runs limber-eigen by mpirun on bodies that bake_eigenproblems() gave. What it tells of its processes goes into the
/// report. @return the file of slices, beside the output, which stays if what follows fails
/// @throws InputError where limber-eigen or mpirun is missing; ComputationError in the words of limber-eigen, or where
/// a process of it was ended
std::string run_limber_eigen(Program& program, const PrecomputeArguments& a, const std::string& bodies);

}  // namespace limber::tools
