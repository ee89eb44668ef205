/// @file slepc_engine.h
/// Modes by limber-eigen on many processes, as slices that a bake takes.
#pragma once

#include <filesystem>
#include <string>

#include "precompute_arguments.h"
#include "program.h"

namespace limber::tools {

/// The file of limber-eigen, beside this program, whether it is there or not.
std::filesystem::path limber_eigen_file();

/// What starts limber-eigen on many processes.
struct EigenLauncher {
  std::filesystem::path mpirun, eigen;
};
/// @throws InputError where limber-eigen or mpirun is missing
EigenLauncher find_eigen_launcher();

/// Runs limber-eigen on bodies that bake_eigenproblems() gave. What it tells of its processes goes into the report.
/// @return the file of slices, beside the output, which stays if what follows fails
/// @throws ComputationError in the words of limber-eigen, or where a process of it was ended
std::string run_limber_eigen(const EigenLauncher& launcher, Program& program, const PrecomputeArguments& a,
                             const std::string& bodies);

}  // namespace limber::tools
