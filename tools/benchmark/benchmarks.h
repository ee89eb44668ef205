/// @file benchmarks.h
/// The subcommands of `limber-benchmark`. Each function declares one and returns what does its work when it is asked
/// for.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace limber::tools {

class Program;

/// `step`: what a step of free flight and a reconstruction take.
std::function<void(Program&)> add_step(CLI::App& programs);

/// `stability`: cases driven to the ends of every axis, each with a verdict.
std::function<void(Program&)> add_stability(CLI::App& programs);

/// `error`: scenes beside finite elements of all their nodes, error against time.
std::function<void(Program&)> add_error(CLI::App& programs);

}  // namespace limber::tools
