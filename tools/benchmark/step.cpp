// limber-benchmark step: what the steps of scenes cost, stage by stage, and how that grows.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>

#include "benchmarks.h"
#include "figures.h"
#include "limber/core/error.h"
#include "plot.h"
#include "program.h"
#include "scene_cost.h"
#include "step_sweeps.h"
#include "timed_scenes.h"

namespace limber::tools {
namespace {

using Json = nlohmann::ordered_json;

struct StepArguments {
  std::vector<std::string> scenes;
  SceneScale scale;
  ContactChoice contact;
  int steps = 0, threads = 1;
  bool sweep = false, rehearse = false;
  std::string csv, plot, limits, time_limits;
};

/// Name of a stage's unit, if one of it has a time.
const char* unit_of(Stage stage) {
  switch (stage) {
    case Stage::kBookkeeping:
      return "step";
    case Stage::kLookAhead:
    case Stage::kAdvance:
    case Stage::kCommit:
      return "body";
    case Stage::kBroadPhase:
      return "near pair";
    case Stage::kNarrowPhase:
      return "contact";
    case Stage::kRows:
    case Stage::kSolve:
      return "row";
    case Stage::kReconstruct:
      return "vertex";
  }
  return "";
}

constexpr Stage stage_at(std::size_t i) { return static_cast<Stage>(i); }

double share(const SceneCost& c, Stage stage) {
  const double all = c.stages.seconds();
  return all > 0.0 ? c.stages[stage].seconds / all : 0.0;
}

/// Seconds a step of a stage: its share of the wall clock's time, of what steps and drawing took by the clock that
/// their quantiles are by.
double stage_seconds(const SceneCost& c, Stage stage) {
  const auto sum = [](const std::vector<double>& s) { return std::accumulate(s.begin(), s.end(), 0.0); };
  return share(c, stage) * (sum(c.step_seconds) + sum(c.draw_seconds)) / c.size.steps;
}

double units_per_step(const SceneCost& c, Stage stage) {
  return static_cast<double>(c.stages[stage].units) / c.size.steps;
}

double ns_per_unit(const SceneCost& c, Stage stage) {
  const double units = units_per_step(c, stage);
  return units > 0.0 ? 1e9 * stage_seconds(c, stage) / units : 0.0;
}

std::string kib_text(const std::optional<std::size_t>& bytes) {
  return bytes ? fmt::format("{:.0f} KiB", static_cast<double>(*bytes) / 1024.0) : "unknown";
}

std::string text_of(const SceneCost& c) {
  std::string text = fmt::format("\n{}: {} bodies, {} modes, {} vertices; {} steps of {:.4g} ms", c.scene,
                                 c.size.bodies, c.size.modes, c.size.vertices, c.size.steps, 1e3 * c.size.step);
  text += fmt::format(
      "\n  a step  {:.1f} contacts, {:.1f} rows, {:.1f} rounds, {:.1f} Newton steps, {:.2f} allocations; {} "
      "unsettled\n",
      c.work.contacts, c.work.rows, c.work.iterations, c.work.newton_steps, c.allocations, c.work.unsettled);
  const auto times = [](const char* what, const std::vector<double>& s, const std::string& touched) {
    return fmt::format("  {:<8}p50 {:.4f}, p99 {:.4f}, worst {:.4f} ms; touches {}\n", what, 1e3 * quantile(s, 0.5),
                       1e3 * quantile(s, 0.99), 1e3 * quantile(s, 1.0), touched);
  };
  text += times("step", c.step_seconds, kib_text(c.step_bytes));
  if (!c.draw_seconds.empty()) text += times("draw", c.draw_seconds, kib_text(c.draw_bytes));
  for (std::size_t i = 0; i < kStages; ++i) {
    const Stage stage = stage_at(i);
    if (c.stages[stage].seconds == 0.0) continue;
    text += fmt::format("  {:<13}{:>5.1f} % {:>10.2f} us a step", to_string(stage), 100.0 * share(c, stage),
                        1e6 * stage_seconds(c, stage));
    const double units = units_per_step(c, stage);
    text += units > 0.0 ? fmt::format(", {:>9.1f} x {:>9.1f} ns a {}\n", units, ns_per_unit(c, stage), unit_of(stage))
                        : "\n";
  }
  return text;
}

Json counts_of(const SceneCost& c) {
  return {{"scene", c.scene},
          {"bodies", c.size.bodies},
          {"modes", c.size.modes},
          {"vertices", c.size.vertices},
          {"step", c.size.step},
          {"steps", c.size.steps},
          {"contacts_per_step", c.work.contacts},
          {"rows_per_step", c.work.rows},
          {"rounds_per_step", c.work.iterations},
          {"newton_steps_per_step", c.work.newton_steps},
          {"unsettled_steps", c.work.unsettled},
          {"asleep", c.work.asleep}};
}

Json quantiles_of(const std::vector<double>& seconds) {
  return {{"median", quantile(seconds, 0.5)}, {"p99", quantile(seconds, 0.99)}, {"worst", quantile(seconds, 1.0)}};
}

Json times_of(const SceneCost& c) {
  Json times{{"scene", c.scene},
             {"step", quantiles_of(c.step_seconds)},
             {"positions", quantiles_of(c.position_seconds)},
             {"positions_and_normals", quantiles_of(c.draw_seconds)},
             {"allocations_per_step", c.allocations},
             {"bytes_touched_by_a_step", c.step_bytes ? Json(*c.step_bytes) : Json()},
             {"bytes_touched_by_drawing", c.draw_bytes ? Json(*c.draw_bytes) : Json()},
             {"stages", Json::array()}};
  for (std::size_t i = 0; i < kStages; ++i)
    times["stages"].push_back({{"stage", to_string(stage_at(i))},
                               {"share", share(c, stage_at(i))},
                               {"per_step", stage_seconds(c, stage_at(i))},
                               {"units_per_step", units_per_step(c, stage_at(i))},
                               {"unit", unit_of(stage_at(i))},
                               {"per_unit", 1e-9 * ns_per_unit(c, stage_at(i))}});
  return times;
}

std::string csv_head() {
  std::string head =
      "scene,bodies,modes,vertices,steps,contacts,rows,rounds,newton_steps,unsettled,allocations,step_bytes,draw_bytes,"
      "step_us_p50,step_us_p99,step_us_worst,positions_us_p50,draw_us_p50";
  for (std::size_t i = 0; i < kStages; ++i)
    head += fmt::format(",{0}_us,{0}_ns_per_{1}", to_string(stage_at(i)), unit_of(stage_at(i)));
  std::replace(head.begin(), head.end(), ' ', '_');
  return head + "\n";
}

std::string csv_row(const SceneCost& c) {
  const auto bytes = [](const std::optional<std::size_t>& b) { return b ? std::to_string(*b) : ""; };
  std::string row = fmt::format(
      "{},{},{},{},{},{:.4g},{:.4g},{:.4g},{:.4g},{},{:.4g},{},{},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g}", c.scene,
      c.size.bodies, c.size.modes, c.size.vertices, c.size.steps, c.work.contacts, c.work.rows, c.work.iterations,
      c.work.newton_steps, c.work.unsettled, c.allocations, bytes(c.step_bytes), bytes(c.draw_bytes),
      1e6 * quantile(c.step_seconds, 0.5), 1e6 * quantile(c.step_seconds, 0.99), 1e6 * quantile(c.step_seconds, 1.0),
      1e6 * quantile(c.position_seconds, 0.5), 1e6 * quantile(c.draw_seconds, 0.5));
  for (std::size_t i = 0; i < kStages; ++i)
    row += fmt::format(",{:.4g},{:.4g}", 1e6 * stage_seconds(c, stage_at(i)), ns_per_unit(c, stage_at(i)));
  return row + "\n";
}

/// The time of every frame (a step and a drawing) against the scene's time, beside that of a screen at 60 Hz.
std::string frames_svg(const std::vector<SceneCost>& costs) {
  std::string data, lines;
  for (std::size_t i = 0; i < costs.size(); ++i) {
    const SceneCost& c = costs[i];
    for (std::size_t n = 0; n < c.step_seconds.size(); ++n)
      data += fmt::format("{},{:.6g},{:.6g}\n", i, c.size.step * static_cast<double>(n + 1),
                          1e3 * (c.step_seconds[n] + (n < c.draw_seconds.size() ? c.draw_seconds[n] : 0.0)));
    lines += fmt::format(", 'data.csv' using ($1=={} ? $2 : NaN):3 with lines title '{}, {} bodies'", i, c.scene,
                         c.size.bodies);
  }
  return svg_by_gnuplot({900, 420}, data,
                        "set datafile separator ','\nset xlabel 'time in the scene, s'\nset ylabel 'one frame: step, "
                        "positions and normals, ms'\nset logscale y\nset grid\nset key outside right top\n"
                        "plot 1000.0/60 with lines dt 2 lc 'black' title '60 frames a second'" +
                            lines);
}

void measure_scenes(Program& program, const StepArguments& a) {
  const std::unique_ptr<Jobs> jobs = jobs_of(a.threads);
  SceneSource source;
  std::vector<SceneCost> costs;
  std::string csv = csv_head();
  Json& report = program.report();
  report["benchmark"] = "step";
  report["threads"] = a.threads;
  report["rehearsed"] = a.rehearse;
  report["scenes"] = Json::array();
  Json times = Json::array();
  for (const std::string& name : a.scenes.empty() ? usual_scenes() : a.scenes) {
    if (name.ends_with(".json")) program.add_input(name);
    program.progress().stage(name);
    costs.push_back(measure(source.scene(name, a.scale),
                            {.steps = a.steps, .jobs = jobs.get(), .rehearse = a.rehearse, .contact = a.contact}));
    program.print(text_of(costs.back()));
    report["scenes"].push_back(counts_of(costs.back()));
    times.push_back(times_of(costs.back()));
    csv += csv_row(costs.back());
  }
  report["seconds"]["scenes"] = times;
  if (!a.csv.empty()) program.write_file(a.csv, csv);
  if (!a.plot.empty()) write_plot(program, a.plot, frames_svg(costs));
}

void sweep_scenes(Program& program, const StepArguments& a) {
  SceneSource source;
  std::vector<SweepLine> lines;
  std::string csv = "axis,line,x,us\n";
  program.print(fmt::format("{:<9} {:<22} {:>6}  cost in us at each\n", "against", "line", "slope"));
  for (const Sweep& sweep : sweeps()) {
    program.progress().stage(sweep.axis + ": " + sweep.scene);
    for (SweepLine& line : run_sweep(sweep, source, a.steps)) {
      program.print(text_of(line));
      for (std::size_t i = 0; i < line.x.size(); ++i)
        csv += fmt::format("{},{},{:.6g},{:.6g}\n", line.axis, line.name, line.x[i], 1e6 * line.seconds[i]);
      program.report()["seconds"]["lines"].push_back({{"against", line.axis},
                                                      {"line", line.name},
                                                      {"x", line.x},
                                                      {"per_step", line.seconds},
                                                      {"slope", line.slope()}});
      lines.push_back(std::move(line));
    }
  }
  program.report()["benchmark"] = "step";
  if (!a.csv.empty()) program.write_file(a.csv, csv);
  if (!a.plot.empty()) write_plot(program, a.plot, svg_of(lines));
}

/// Small scenes whose counts do not depend on the machine.
void check_small(Program& program, const StepArguments& a) {
  constexpr int kSteps = 60;
  const std::vector<std::pair<std::string, int>> small{{"flight", 30}, {"boxes", 20}, {"mixed", 20}, {"stack", 3},
                                                       {"chain", 4},   {"lamp", 3},   {"drag", 1},   {"sleepers", 200}};
  SceneSource source;
  std::vector<Figure> figures;
  for (const auto& [name, bodies] : small) {
    program.progress().stage(name);
    const SceneCost c = measure(source.scene(name, {.bodies = bodies}), {.steps = kSteps});
    const auto add = [&, scene = name](const char* what, double value) {
      figures.push_back({scene + "." + what, value});
    };
    if (c.work.rows > 0.0)
      add("rows", c.work.rows), add("rounds", c.work.iterations), add("newton_steps", c.work.newton_steps);
    if (c.work.contacts > 0.0) add("contacts", c.work.contacts);
    add("unsettled", c.work.unsettled);
    add("allocations", c.allocations);
  }
  hold_to_limits(program, figures, a.limits);
}

/// Ratios of times within this run: on a busy machine they scatter.
void check_times(Program& program, const StepArguments& a) {
  constexpr int kSteps = 60;
  SceneSource source;
  const auto ratio = [&](const std::string& scene, int many, int few) {
    program.progress().stage("growth of " + scene);
    return cost_ratio(source.scene(scene, {.bodies = many}), source.scene(scene, {.bodies = few}), kSteps);
  };
  const SceneCost flight = measure(source.scene("flight", {.bodies = 30}), {.steps = kSteps});
  hold_to_limits(
      program,
      {{"flight.time_of_300_over_30", ratio("flight", 300, 30)},
       {"chain.time_of_16_over_4", ratio("chain", 16, 4)},
       {"sleepers.time_of_10000_over_100", ratio("sleepers", 10000, 100)},
       {"drawing.normals_over_positions", quantile(flight.draw_seconds, 0.5) / quantile(flight.position_seconds, 0.5)}},
      a.time_limits);
}

void declare_step(CLI::App& app, StepArguments& a) {
  app.add_option("--scene", a.scenes, "scenes of the library (make_scene --list), or scene files")
      ->type_name("NAME|FILE.json,...")
      ->delimiter(',');
  const auto add_size = [&](const char* option, int& value, int most, const char* what) {
    return app.add_option(option, value, what)->type_name("N")->check(CLI::Range(1, most));
  };
  add_size("--bodies", a.scale.bodies, 100'000, "that move in a scene of the library; default: its own number");
  add_size("--modes", a.scale.modes, 1000, "of each body that bends; default: the scene's own");
  add_size("--vertices", a.scale.vertices, 1'000'000, "of each drawn surface, about; default: the mesh's own");
  add_size("--steps", a.steps, 1'000'000, "timed at most; default: all of the scene; with --sweep 120");
  add_size("--threads", a.threads, 1024, "that share the work; times are then by the wall clock")
      ->capture_default_str();
  using Finder = ContactChoice::Finder;
  app.add_option("--solver", a.contact.solver,
                 "who answers contacts, handles and joints: game, exact; default: the scene's")
      ->transform(CLI::Transformer(
          std::map<std::string, ContactSolver>{{"game", ContactSolver::kGame}, {"exact", ContactSolver::kExact}}))
      ->option_text("NAME");
  app.add_option("--finder", a.contact.finder,
                 "who finds contacts: exact (ContactFinder), manifolds (ManifoldFinder); default: the scene's")
      ->transform(CLI::Transformer(
          std::map<std::string, Finder>{{"exact", Finder::kContactFinder}, {"manifolds", Finder::kManifolds}}))
      ->option_text("NAME");
  app.add_option("--substeps", a.contact.substeps, "of the game solver; default: the scene's")
      ->type_name("N")
      ->check(CLI::Range(1, 1000));
  app.add_flag("--rehearse", a.rehearse,
               "take the steps once before, from the same state: the memory that they need is there");
  app.add_flag("--sweep", a.sweep, "how the cost grows with bodies, modes, vertices and contacts");
  app.add_option("--check", a.limits,
                 "measure small scenes alone and fail where counts are beyond these limits "
                 "(benchmarks/limits_step.json)")
      ->type_name("LIMITS.json");
  app.add_option("--check-times", a.time_limits,
                 "the same for ratios of times within this run, on a quiet machine (benchmarks/limits_times.json)")
      ->type_name("LIMITS.json");
  app.add_option("--csv", a.csv, "write the table")->type_name("FILE.csv");
  app.add_option("--plot", a.plot,
                 "plot the time of each frame, or with --sweep cost against size, log-log (needs gnuplot)")
      ->type_name("FILE.svg");
}

}  // namespace

std::function<void(Program&)> add_step(CLI::App& programs) {
  const auto arguments = std::make_shared<StepArguments>();
  CLI::App* app = programs.add_subcommand("step", "what the steps of scenes cost, stage by stage, and how that grows");
  declare_step(*app, *arguments);
  return [arguments, app](Program& program) {
    if (!app->parsed()) return;
    if (!arguments->limits.empty())
      check_small(program, *arguments);
    else if (!arguments->time_limits.empty())
      check_times(program, *arguments);
    else if (arguments->sweep)
      sweep_scenes(program, *arguments);
    else
      measure_scenes(program, *arguments);
  };
}

}  // namespace limber::tools
