/// @file bake_farm.h
/// Many bakes by one command, each in a process of its own (docs/large-bakes.md).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "job_process.h"
#include "limber/core/types.h"

namespace CLI {
class App;
}

namespace limber::tools {

class Program;

struct FarmArguments {
  std::string manifest;  ///< a file of jobs, or a pattern of meshes; empty: one bake
  std::string shard;     ///< "I/N"; empty: all
  Index job = 0;         ///< this one alone, from 1; 0: all
  std::string results;   ///< JSON lines are added to it; empty: to stdout
  bool resume = false;
  std::string cache;  ///< folder; empty: none
  double seconds = 0.0, megabytes = 0.0;
  int at_once = 1;
  std::vector<std::string> summaries;  ///< results that a page is to tell of; empty: none
};

void declare_farm_options(CLI::App& app, FarmArguments& a);

/// Runs the jobs and writes a line of results for each. @param outputs folder of a pattern's assets; empty for a
/// manifest. @throws ComputationError at the end if a job failed; InputError and InvalidArgument before the first one
void bake_many(Program& program, const FarmArguments& a, const std::string& outputs);

}  // namespace limber::tools
