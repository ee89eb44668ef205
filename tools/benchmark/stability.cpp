#include "benchmarks.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <array>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "limber/core/error.h"
#include "plot.h"
#include "program.h"
#include "stability_scenes.h"

namespace limber::tools {
namespace {

using limber::testing::StabilityCase;
using limber::testing::StabilityFault;
using limber::testing::StabilityResult;
using Json = nlohmann::ordered_json;

struct StabilityArguments {
  std::string grid = "extremes", scene, csv, plot;
  int random = 360, steps = 120, every = 1;
  bool simplify = false;
  std::string peer;
};

/// A case and what became of it.
struct CaseRow {
  StabilityCase at;
  std::optional<StabilityResult> seen{};  // none: the bake did not take the body
  std::string refused{};                  // why
  unsigned faults = 0;
  std::optional<StabilityResult> peer{};  // none: not asked for, or it cannot express the case
  unsigned peer_faults = 0;
};

CaseRow try_case(const StabilityCase& at, int steps, bool with_peer = false) {
  CaseRow row{.at = at};
  try {
    row.seen = testing::run(at, steps);
    row.faults = testing::faults(at, *row.seen);
    if (!with_peer || !testing::bullet_can(at)) return row;
    row.peer = testing::run_by_bullet(at, steps);
    row.peer_faults = testing::faults(at, *row.peer);
  } catch (const Error& e) {
    row.refused = e.what();
  }
  return row;
}

/// The simplest case found with one of the same faults.
CaseRow simplest(const CaseRow& bad, int steps) {
  const auto is_alike = [&](const StabilityCase& at) { return (try_case(at, steps).faults & bad.faults) != 0; };
  return try_case(testing::simplified(bad.at, is_alike), steps);
}

std::string names_of(unsigned faults) {
  std::string out;
  for (int i = 0; i < testing::kStabilityFaults; ++i)
    if ((faults >> i & 1u) != 0) out += (out.empty() ? "" : " + ") + std::string(name(StabilityFault(i)));
  return out;
}

std::string verdict(const CaseRow& row) {
  if (!row.seen) return "refused";
  return row.faults == 0 ? "good" : names_of(row.faults);
}

std::string csv_of(const std::vector<CaseRow>& rows) {
  std::string csv = "scene";
  for (const auto& [column, value] : testing::coordinates({})) csv += fmt::format(",{}", column);
  csv +=
      ",verdict,steps,unsettled,worst_rise,total_rise,node_worst_rise,node_total_rise,spin_bound,spin_excess,"
      "strain_difference,removed,overlap,rest_overlap,passed,off_target,momentum_error,peer_verdict,peer_total_rise,"
      "peer_overlap\n";
  for (const CaseRow& row : rows) {
    csv += testing::name(row.at.scene);
    for (const auto& [column, value] : testing::coordinates(row.at)) csv += fmt::format(",{:g}", value);
    const StabilityResult r = row.seen.value_or(StabilityResult{});
    csv +=
        fmt::format(",{},{},{},{:.3g},{:.3g},{:.3g},{:.3g},{:.3g},{:.3g},{:.3g},{:.3g},{:.3g},{:.3g},{},{:.3g},{:.3g}",
                    verdict(row), r.steps, r.unsettled, r.worst_rise, r.total_rise, r.node_worst_rise,
                    r.node_total_rise, r.spin_bound, r.spin_excess, r.strain_difference, r.removed, r.overlap,
                    r.rest_overlap, r.passed ? 1 : 0, r.off_target, r.momentum_error);
    const StabilityResult p = row.peer.value_or(StabilityResult{});
    const std::string peer = !row.peer ? "" : row.peer_faults == 0 ? "good" : names_of(row.peer_faults);
    csv += fmt::format(",{},{:.3g},{:.3g}\n", peer, p.total_rise, p.overlap);
  }
  return csv;
}

/// What became of the cases of one scene.
struct SceneTally {
  int cases = 0, refused = 0, good = 0;
  std::array<int, testing::kStabilityFaults> by_fault{};
  long steps = 0, unsettled = 0;
  double worst_rise = 0.0;  // where nothing recovers

  void add(const CaseRow& row) {
    ++cases;
    refused += row.seen ? 0 : 1;
    if (!row.seen) return;
    good += row.faults == 0 ? 1 : 0;
    for (std::size_t i = 0; i < by_fault.size(); ++i) by_fault[i] += static_cast<int>(row.faults >> i & 1u);
    steps += row.seen->steps, unsettled += row.seen->unsettled;
    if (row.at.recovery_speed == 0.0) worst_rise = std::max(worst_rise, row.seen->worst_rise);
  }
};

std::string line(std::string_view scene, const SceneTally& t) {
  std::string out = fmt::format("{:<8} {:>6} {:>6} {:>8}", scene, t.cases, t.good, t.refused);
  for (const int count : t.by_fault) out += fmt::format(" {:>10}", count);
  return out + fmt::format(" {:>9.1e}\n", t.worst_rise);
}

std::string head() {
  std::string out = fmt::format("{:<8} {:>6} {:>6} {:>8}", "scene", "cases", "good", "refused");
  for (int i = 0; i < testing::kStabilityFaults; ++i) out += fmt::format(" {:>10}", name(StabilityFault(i)));
  return out + fmt::format(" {:>9}\n", "rise");
}

/// What both engines made of the cases that both can express.
std::string peer_table(const std::vector<CaseRow>& rows) {
  std::string out = fmt::format("\n{:<8} {:<8} {:>6} {:>6} {:>10} {:>10} {:>10} {:>10} {:>10}\n", "scene", "by",
                                "cases", "good", "not finite", "doubled", "energy", "passed", "overlap");
  for (const auto scene : {testing::StabilityScene::kFlight, testing::StabilityScene::kGround})
    for (const bool peer : {false, true}) {
      int cases = 0, good = 0, doubled = 0;
      std::array<int, testing::kStabilityFaults> by_fault{};
      for (const CaseRow& row : rows) {
        if (!row.peer || row.at.scene != scene) continue;
        const StabilityResult& seen = peer ? *row.peer : *row.seen;
        const unsigned bits = peer ? row.peer_faults : row.faults;
        ++cases, good += bits == 0 ? 1 : 0, doubled += !seen.finite || seen.total_rise > 1.0 ? 1 : 0;
        for (std::size_t i = 0; i < by_fault.size(); ++i) by_fault[i] += static_cast<int>(bits >> i & 1u);
      }
      out += fmt::format("{:<8} {:<8} {:>6} {:>6} {:>10} {:>10} {:>10} {:>10} {:>10}\n", testing::name(scene),
                         peer ? "Bullet" : "limber", cases, good, by_fault[0], doubled, by_fault[1], by_fault[2],
                         by_fault[3]);
    }
  return out;
}

/// Share of bad cases over stiffness and step, one field a pair.
std::string svg_of(const std::vector<CaseRow>& rows) {
  std::map<std::pair<double, double>, std::pair<int, int>> fields;  // bad, all
  std::map<double, int> moduli, steps;
  for (const CaseRow& row : rows) {
    if (!row.seen) continue;
    auto& [bad, all] = fields[{row.at.youngs_modulus, row.at.step}];
    bad += row.faults != 0 ? 1 : 0, ++all;
    moduli[row.at.youngs_modulus], steps[row.at.step];
  }
  const auto number = [](std::map<double, int>& levels) {
    int i = 0;
    for (auto& [level, at] : levels) at = i++;
  };
  number(moduli), number(steps);
  std::string data, labels_x, labels_y, commands;
  for (const auto& [place, count] : fields)
    data += fmt::format("{},{},{},{}/{}\n", moduli[place.first], steps[place.second],
                        100.0 * count.first / count.second, count.first, count.second);
  for (const auto& [level, at] : moduli) labels_x += fmt::format("{}'{:.0e}' {}", at > 0 ? "," : "", level, at);
  for (const auto& [level, at] : steps) labels_y += fmt::format("{}'{:.2g}' {}", at > 0 ? "," : "", level, at);
  commands = fmt::format(
      "set datafile separator ','\nset xtics ({})\nset ytics ({})\nset xlabel \"Young's modulus, Pa\"\nset ylabel "
      "'step, s'\n"
      "set title 'share of cases at fault, %; at fault / all'\nset cbrange [0:100]\n"
      "set palette defined (0 '#f7fbff', 10 '#fdd0a2', 100 '#a50f15')\nset xrange [-0.5:{}]\nset yrange [-0.5:{}]\n"
      "plot 'data.csv' using 1:2:3 with image pixels notitle, '' using 1:2:4 with labels font ',10' notitle",
      labels_x, labels_y, static_cast<double>(moduli.size()) - 0.5, static_cast<double>(steps.size()) - 0.5);
  return svg_by_gnuplot({820, 520}, data, commands);
}

void benchmark_stability(Program& program, const StabilityArguments& a) {
  if (!a.peer.empty() && !testing::has_bullet())
    throw InvalidArgument("--peer: this build found no Bullet (apt-get install libbullet-dev, then configure anew)");
  const std::vector<StabilityCase> grid =
      a.grid == "energy" ? testing::energy_grid() : testing::extreme_cases(a.random);
  std::vector<CaseRow> rows;
  std::map<std::string, SceneTally> tallies;
  for (std::size_t i = 0; i < grid.size(); i += static_cast<std::size_t>(a.every)) {
    if (!a.scene.empty() && a.scene != testing::name(grid[i].scene)) continue;
    program.progress().stage(testing::text(grid[i]));
    rows.push_back(try_case(grid[i], a.steps, !a.peer.empty()));
    tallies[testing::name(grid[i].scene)].add(rows.back());
    tallies["all"].add(rows.back());
  }
  program.print(head());
  for (const auto& [scene, tally] : tallies)
    if (scene != "all") program.print(line(scene, tally));
  const SceneTally& all = tallies["all"];
  program.print(line("all", all));
  if (!a.peer.empty()) program.print(peer_table(rows));
  for (const CaseRow& row : rows) {
    if (row.faults == 0 && row.seen) continue;
    program.print(verdict(row) + ": " + testing::text(row.at) + "\n");
    if (!a.simplify || !row.seen) continue;
    program.progress().stage("simplifying " + testing::text(row.at));
    const CaseRow simple = simplest(row, a.steps);
    program.print("    as in " + verdict(simple) + ": " + testing::text(simple.at) + "\n");
  }

  Json& report = program.report();
  report["benchmark"] = "stability";
  report["grid"] = a.grid;
  report["cases"] = all.cases;
  report["good"] = all.good;
  report["refused"] = all.refused;
  for (int i = 0; i < testing::kStabilityFaults; ++i)
    report["faults"][name(StabilityFault(i))] = all.by_fault[static_cast<std::size_t>(i)];
  report["steps"] = all.steps;
  report["unsettled_steps"] = all.unsettled;
  report["worst_rise"] = all.worst_rise;
  if (!a.csv.empty()) program.write_file(a.csv, csv_of(rows));
  if (!a.plot.empty()) write_plot(program, a.plot, svg_of(rows));
}

void declare(CLI::App& app, StabilityArguments& a) {
  app.add_option(
         "--grid", a.grid,
         "extremes: every level of every axis by itself, and random cases of all of them; energy: a full grid of "
         "stiffness, step, damping, modes and weights, without recovery")
      ->type_name("NAME")
      ->check(CLI::IsMember({"extremes", "energy"}))
      ->capture_default_str();
  app.add_option("--scene", a.scene, "this scene alone: flight, ground, pile, handle or chain")
      ->type_name("NAME")
      ->check(CLI::IsMember({"flight", "ground", "pile", "handle", "chain"}));
  app.add_option("--random", a.random, "random cases of each scene, for --grid extremes")
      ->type_name("N")
      ->check(CLI::Range(0, 1'000'000))
      ->capture_default_str();
  app.add_option("--steps", a.steps, "steps per case")
      ->type_name("N")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--every", a.every, "one of so many cases of the grid")
      ->type_name("N")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--peer", a.peer, "run what Bullet's reduced deformable body can express by that, too")
      ->type_name("bullet")
      ->check(CLI::IsMember({"bullet"}));
  app.add_flag("--simplify", a.simplify,
               "tell for each case at fault the simplest one found that shares a fault with it");
  app.add_option("--csv", a.csv, "write the table")->type_name("FILE.csv");
  app.add_option("--plot", a.plot, "plot the share of faults over stiffness and step (needs gnuplot)")
      ->type_name("FILE.svg");
}

}  // namespace

std::function<void(Program&)> add_stability(CLI::App& programs) {
  const auto arguments = std::make_shared<StabilityArguments>();
  CLI::App* app =
      programs.add_subcommand("stability", "baked bars driven to the ends of every axis, each with a verdict");
  declare(*app, *arguments);
  return [arguments, app](Program& program) {
    if (app->parsed()) benchmark_stability(program, *arguments);
  };
}

}  // namespace limber::tools
