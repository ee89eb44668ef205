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

/// `step`: what the steps of scenes cost, stage by stage.
std::function<void(Program&)> add_step(CLI::App& programs);

/// `stability`: cases driven to the ends of every axis, each with a verdict.
std::function<void(Program&)> add_stability(CLI::App& programs);

/// `soak`: hands that drag bodies for hours, every step held to laws.
std::function<void(Program&)> add_soak(CLI::App& programs);

/// `error`: scenes beside finite elements of all their nodes, error against time.
std::function<void(Program&)> add_error(CLI::App& programs);

/// `peers`: the same work in Box3D, Bullet and MuJoCo.
std::function<void(Program&)> add_peers(CLI::App& programs);

/// `methods`: contact methods of papers/ beside limber's own.
std::function<void(Program&)> add_methods(CLI::App& programs);

}  // namespace limber::tools
