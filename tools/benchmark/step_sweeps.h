/// @file step_sweeps.h
/// How the cost of a step grows with the size of a scene.
#pragma once

#include <string>
#include <vector>

#include "timed_scenes.h"

namespace limber::tools {

/// A scene of the library at several sizes along one axis.
struct Sweep {
  std::string axis;  ///< "bodies", "modes", "vertices" or "contacts"
  std::string scene;
  std::vector<int> sizes;  ///< bodies, modes or vertices; of "contacts": bodies
  int bodies = 0;          ///< where another axis varies; 0: the scene's own
};
std::vector<Sweep> sweeps();

struct SweepLine {
  std::string axis, name;
  std::vector<double> x;        ///< as measured: bodies, modes, drawn vertices, contacts a step
  std::vector<double> seconds;  ///< median of a step, or of a drawing
  double slope() const;         ///< of the least-squares line through the logarithms
};
/// One line; of "vertices" two, positions alone and with normals.
/// @param steps timed at each size; 0: 120
std::vector<SweepLine> run_sweep(const Sweep& sweep, SceneSource& source, int steps);

std::string text_of(const SweepLine& line);
/// A field per axis. Empty where gnuplot fails.
std::string svg_of(const std::vector<SweepLine>& lines);

}  // namespace limber::tools
