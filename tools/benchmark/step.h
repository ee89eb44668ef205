/// @file step.h
/// `limber-benchmark step`: what a step of free flight and a reconstruction take.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace limber::tools {

class Program;

/// Declares the subcommand. @return what does its work if it was asked for
std::function<void(Program&)> add_step(CLI::App& programs);

}  // namespace limber::tools
