/// @file figures.h
/// Figures of a benchmark held to limits, so that a test can tell when one got worse. Times differ from machine to
/// machine; counts, errors and ratios within one run do not, or by little.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace limber::tools {

class Program;

struct Figure {
  std::string name;
  double value = 0.0;
};

/// @param limits a JSON file: {"FIGURE": {"least": …, "most": …}, …}, either end optional
/// @throws ComputationError naming all figures that are not finite or beyond their limits; InputError for a wrong file,
/// a limit of a figure that is not there, and a figure without a limit
void hold_to_limits(Program& program, const std::vector<Figure>& figures, const std::filesystem::path& limits);

}  // namespace limber::tools
