// limber-benchmark: how long limber takes, and what it withstands. Tables as CSV and JSON, plots as SVG.
#include <CLI/CLI.hpp>

#include <functional>
#include <vector>

#include "benchmarks.h"
#include "program.h"

int main(int argc, char** argv) {
  using namespace limber::tools;
  Program program("limber-benchmark", "Measures limber on this machine, in one thread.");
  program.options().require_subcommand(1)->fallthrough();  // so that --report may follow the subcommand
  std::vector<std::function<void(Program&)>> benchmarks{add_step(program.options())};
#if LIMBER_HAS_PAPERS
  benchmarks.push_back(add_methods(program.options()));
#endif
#if LIMBER_HAS_PRECOMPUTE
  benchmarks.push_back(add_stability(program.options()));
  benchmarks.push_back(add_soak(program.options()));
  benchmarks.push_back(add_error(program.options()));
#if LIMBER_HAS_BOX3D || LIMBER_HAS_BULLET || LIMBER_HAS_MUJOCO
  benchmarks.push_back(add_peers(program.options()));
#endif
#endif
  return program.run(argc, argv, [&] {
    for (const auto& run_if_asked_for : benchmarks) run_if_asked_for(program);
  });
}
