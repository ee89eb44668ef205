/// @file stability.h
/// `limber-benchmark stability`: cases driven to the ends of every axis, each with a verdict.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace limber::tools {

class Program;

/// Declares the subcommand. @return what does its work if it was asked for
std::function<void(Program&)> add_stability(CLI::App& programs);

}  // namespace limber::tools
