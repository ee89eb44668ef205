#include "step_sweeps.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "plot.h"

namespace limber::tools {
namespace {

constexpr std::array kAxes{"bodies", "modes", "vertices", "contacts"};

}  // namespace

std::vector<Sweep> sweeps() {
  return {{"bodies", "flight", {30, 100, 300, 1000, 3000}},
          {"bodies", "boxes", {10, 30, 100, 300}},
          {"bodies", "chain", {4, 8, 16, 32}},
          {"modes", "flight", {5, 10, 20, 40, 80}},
          {"modes", "stack", {6, 12, 24, 48}},
          {"modes", "chain", {5, 10, 20, 40}},
          {"vertices", "flight", {200, 600, 2500, 10000}, 30},
          {"contacts", "boxes", {10, 30, 100, 300}},
          {"contacts", "mixed", {10, 30, 100, 300}},
          {"contacts", "stack", {1, 2, 4, 8}}};
}

double SweepLine::slope() const {
  const auto n = static_cast<double>(x.size());
  double sum_x = 0.0, sum_y = 0.0, sum_xx = 0.0, sum_xy = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double a = std::log(x[i]), b = std::log(seconds[i]);
    sum_x += a, sum_y += b, sum_xx += a * a, sum_xy += a * b;
  }
  return (n * sum_xy - sum_x * sum_y) / (n * sum_xx - sum_x * sum_x);
}

std::vector<SweepLine> run_sweep(const Sweep& sweep, SceneSource& source, int steps) {
  constexpr int kSteps = 120;
  const bool draws = sweep.axis == "vertices";
  SweepLine line{.axis = sweep.axis, .name = draws ? "positions" : sweep.scene, .x = {}, .seconds = {}};
  SweepLine normals{.axis = sweep.axis, .name = "positions and normals", .x = {}, .seconds = {}};
  for (const int size : sweep.sizes) {
    SceneScale scale{.bodies = sweep.bodies};
    (sweep.axis == "modes" ? scale.modes : draws ? scale.vertices : scale.bodies) = size;
    const SceneCost cost =
        measure(source.scene(sweep.scene, scale), {.steps = steps > 0 ? steps : kSteps, .draw = draws});
    const double x = sweep.axis == "modes"      ? static_cast<double>(cost.size.modes)
                     : draws                    ? static_cast<double>(cost.size.vertices)
                     : sweep.axis == "contacts" ? cost.work.contacts
                                                : static_cast<double>(cost.size.bodies);
    line.x.push_back(x), normals.x.push_back(x);
    line.seconds.push_back(quantile(draws ? cost.position_seconds : cost.step_seconds, 0.5));
    normals.seconds.push_back(quantile(cost.draw_seconds, 0.5));
  }
  if (!draws) return {line};
  return {line, normals};
}

std::string text_of(const SweepLine& line) {
  std::string text = fmt::format("{:<9} {:<22} {:>6.2f} ", line.axis, line.name, line.slope());
  for (std::size_t i = 0; i < line.x.size(); ++i)
    text += fmt::format(" {:.4g}: {:.4g}", line.x[i], 1e6 * line.seconds[i]);
  return text + "\n";
}

std::string svg_of(const std::vector<SweepLine>& lines) {
  std::string data, commands =
                        "set datafile separator ','\nset multiplot layout 2,2\nset logscale xy\nset grid\n"
                        "set key below\nset format y '10^{%T}'\nset format x '10^{%T}'\n";
  for (std::size_t i = 0; i < lines.size(); ++i)
    for (std::size_t j = 0; j < lines[i].x.size(); ++j)
      data += fmt::format("{},{:.6g},{:.6g}\n", i, lines[i].x[j], 1e6 * lines[i].seconds[j]);
  for (const char* axis : kAxes) {
    std::string curves;
    for (std::size_t i = 0; i < lines.size(); ++i)
      if (lines[i].axis == axis)
        curves += fmt::format("{}'data.csv' using ($1=={} ? $2 : NaN):3 with linespoints pt 7 title '{}: slope {:.2f}'",
                              curves.empty() ? "" : ", ", i, lines[i].name, lines[i].slope());
    if (curves.empty()) continue;
    commands += fmt::format("set xlabel '{}{}'\nset ylabel '{}, us'\nplot {}\n", axis,
                            std::string(axis) == "contacts"   ? " a step"
                            : std::string(axis) == "vertices" ? " drawn"
                                                              : "",
                            std::string(axis) == "vertices" ? "drawing" : "one step", curves);
  }
  return svg_by_gnuplot({1000, 800}, data, commands + "unset multiplot\n");
}

}  // namespace limber::tools
