#include "benchmarks.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <sstream>
#include <variant>

#include "../cpu_time.h"
#include "figures.h"
#include "growing_table.h"
#include "limber/constraints/contact_constraint.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/internal/strict_json.h"
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
  std::string grid = "extremes", csv, plot, limits, peer;
  std::vector<std::string> scenes, known;
  std::vector<std::string> solvers{"exact", "game"};
  int random = 360, steps = 120, every = 1, first = 0, substeps = SmallSteps{}.substeps;
  bool simplify = false, recovers = false;
};

/// A case and what became of it.
struct CaseRow {
  StabilityCase at;
  std::optional<StabilityResult> seen{};  // none: the bake did not take the body
  std::string refused{};                  // why
  unsigned faults = 0;
  double seconds = 0.0;                   // of this thread
  std::optional<StabilityResult> peer{};  // none: not asked for, or it cannot express the case
  unsigned peer_faults = 0;
};

// Tables -----------------------------------------------------------------------------------------------------------

using Place = std::variant<double StabilityResult::*, int StabilityResult::*, bool StabilityResult::*>;
constexpr std::array<std::pair<const char*, Place>, 18> kResults{
    {{"steps", &StabilityResult::steps},
     {"unsettled", &StabilityResult::unsettled},
     {"finite", &StabilityResult::finite},
     {"worst_rise", &StabilityResult::worst_rise},
     {"total_rise", &StabilityResult::total_rise},
     {"energy_digits", &StabilityResult::energy_digits},
     {"node_worst_rise", &StabilityResult::node_worst_rise},
     {"node_total_rise", &StabilityResult::node_total_rise},
     {"spin_bound", &StabilityResult::spin_bound},
     {"spin_excess", &StabilityResult::spin_excess},
     {"strain_difference", &StabilityResult::strain_difference},
     {"removed", &StabilityResult::removed},
     {"overlap", &StabilityResult::overlap},
     {"rest_overlap", &StabilityResult::rest_overlap},
     {"passed", &StabilityResult::passed},
     {"off_target", &StabilityResult::off_target},
     {"largest_turn", &StabilityResult::largest_turn},
     {"momentum_error", &StabilityResult::momentum_error}}};

double value_of(const StabilityResult& r, const Place& place) {
  return std::visit([&](auto member) { return static_cast<double>(r.*member); }, place);
}
void set_value(StabilityResult& r, const Place& place, double value) {
  std::visit([&](auto member) { r.*member = static_cast<std::decay_t<decltype(r.*member)>>(value); }, place);
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

/// A case as its columns of the table.
std::string key_of(const StabilityCase& at) {
  std::string key = testing::name(at.scene);
  for (const auto& [column, value] : testing::coordinates(at)) key += fmt::format(",{:g}", value);
  return key;
}

std::string csv_head() {
  std::string head = "scene";
  for (const auto& [column, value] : testing::coordinates({})) head += fmt::format(",{}", column);
  head += ",verdict,seconds";
  for (const auto& [column, place] : kResults) head += fmt::format(",{}", column);
  head += ",peer_verdict";
  for (const auto& [column, place] : kResults) head += fmt::format(",peer_{}", column);
  return head;
}

std::string csv_of(const CaseRow& row) {
  const auto results = [](const std::optional<StabilityResult>& r) {
    std::string out;
    for (const auto& [column, place] : kResults) out += r ? fmt::format(",{:.6g}", value_of(*r, place)) : ",";
    return out;
  };
  const std::string peer = !row.peer ? "" : row.peer_faults == 0 ? "good" : names_of(row.peer_faults);
  return key_of(row.at) + fmt::format(",{},{:.3g}", verdict(row), row.seconds) + results(row.seen) + "," + peer +
         results(row.peer);
}

/// Cases of earlier tables, by their keys.
using KnownRows = std::map<std::string, std::vector<std::string>>;

KnownRows read_known(Program& program, const std::vector<std::string>& files) {
  KnownRows known;
  const std::size_t coordinates = 1 + testing::coordinates({}).size();
  for (const std::string& file : files) {
    std::istringstream lines(read_file(file));
    program.add_input(file);
    std::string line;
    if (!std::getline(lines, line) || line != csv_head())
      throw InputError(internal::in_quotes(file) + ": is no table of this program's --csv, expected its columns");
    const std::ptrdiff_t columns = std::count(line.begin(), line.end(), ',') + 1;
    for (int number = 2; std::getline(lines, line); ++number) {
      std::vector<std::string> fields;
      std::istringstream row(line + ",");
      for (std::string field; std::getline(row, field, ',');) fields.push_back(field);
      if (std::ssize(fields) != columns)
        throw InputError(fmt::format("{}: line {} has {} fields, expected {}", internal::in_quotes(file), number,
                                     fields.size(), columns));
      const auto end = fields.begin() + static_cast<std::ptrdiff_t>(coordinates);
      known[fmt::format("{}", fmt::join(fields.begin(), end, ","))] = {end, fields.end()};
    }
  }
  return known;
}

/// Results that a table tells from a field on; none where it has none.
std::optional<StabilityResult> results_at(std::span<const std::string> fields, const std::string& key) {
  if (fields.front().empty()) return std::nullopt;
  StabilityResult r;
  for (std::size_t i = 0; i < kResults.size(); ++i) {
    char* end = nullptr;
    set_value(r, kResults[i].second, std::strtod(fields[i].c_str(), &end));
    if (end == fields[i].c_str() || *end != '\0')
      throw InputError(
          fmt::format("--known: {} of {} is \"{}\", expected a number", kResults[i].first, key, fields[i]));
  }
  return r;
}

// Runs -------------------------------------------------------------------------------------------------------------

CaseRow try_case(const StabilityCase& at, int steps, bool with_peer = false, const KnownRows& known = {}) {
  CaseRow row{.at = at};
  if (const auto told = known.find(key_of(at)); told != known.end()) {
    const std::span<const std::string> fields = told->second;  // verdict, seconds, …, the peer's verdict, …
    row.seconds = std::strtod(fields[1].c_str(), nullptr);
    row.seen = results_at(fields.subspan(2), told->first);
    row.peer = results_at(fields.subspan(3 + kResults.size()), told->first);
  }
  try {
    if (!row.seen) {
      const double begin = thread_seconds();
      row.seen = testing::run(at, steps);
      row.seconds = thread_seconds() - begin;
    }
    if (with_peer && !row.peer && testing::bullet_can(at)) row.peer = testing::run_by_bullet(at, steps);
  } catch (const Error& e) {
    row.refused = e.what();
  }
  if (row.seen) row.faults = testing::faults(at, *row.seen);
  if (row.peer) row.peer_faults = testing::faults(at, *row.peer);
  return row;
}

/// The simplest case found with one of the same faults.
CaseRow simplest(const CaseRow& bad, int steps) {
  const auto is_alike = [&](const StabilityCase& at) { return (try_case(at, steps).faults & bad.faults) != 0; };
  return try_case(testing::simplified(bad.at, is_alike), steps);
}

/// Tally of the cases of one scene.
struct SceneTally {
  int cases = 0, refused = 0, good = 0;
  std::array<int, testing::kStabilityFaults> by_fault{};
  long steps = 0, unsettled = 0;
  double worst_rise = 0.0;  // where nothing recovers
  double seconds = 0.0;

  void add(const CaseRow& row) {
    ++cases;
    refused += row.seen ? 0 : 1;
    if (!row.seen) return;
    good += row.faults == 0 ? 1 : 0;
    for (std::size_t i = 0; i < by_fault.size(); ++i) by_fault[i] += static_cast<int>(row.faults >> i & 1u);
    seconds += row.seconds;
    steps += row.seen->steps, unsettled += row.seen->unsettled;
    if (row.at.recovery_speed == 0.0) worst_rise = std::max(worst_rise, row.seen->worst_rise);
  }
};

std::string line(std::string_view scene, const SceneTally& t) {
  std::string out = fmt::format("{:<11} {:>6} {:>6} {:>8}", scene, t.cases, t.good, t.refused);
  for (const int count : t.by_fault) out += fmt::format(" {:>10}", count);
  return out + fmt::format(" {:>9.1e} {:>8.1f}\n", t.worst_rise, t.seconds);
}

std::string head() {
  std::string out = fmt::format("{:<11} {:>6} {:>6} {:>8}", "scene", "cases", "good", "refused");
  for (int i = 0; i < testing::kStabilityFaults; ++i) out += fmt::format(" {:>10}", name(StabilityFault(i)));
  return out + fmt::format(" {:>9} {:>8}\n", "rise", "seconds");
}

/// Both engines on the cases that both can express.
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

/// Share of bad cases over stiffness and step, one field a pair; a panel of the cases without an hour in one step, and
/// one of those with.
std::string svg_of(const std::vector<CaseRow>& rows) {
  std::map<std::pair<double, double>, std::pair<int, int>> fields[2];  // bad, all
  std::map<double, int> moduli, steps;
  for (const CaseRow& row : rows) {
    if (!row.seen) continue;
    auto& [bad, all] = fields[row.at.pause > 0.0 ? 1 : 0][{row.at.youngs_modulus, row.at.step}];
    bad += row.faults != 0 ? 1 : 0, ++all;
    moduli[row.at.youngs_modulus], steps[row.at.step];
  }
  const auto number = [](std::map<double, int>& levels) {
    int i = 0;
    for (auto& [level, at] : levels) at = i++;
  };
  number(moduli), number(steps);
  std::string data, labels_x, labels_y, plots;
  for (const auto& [level, at] : moduli) labels_x += fmt::format("{}'{:.0e}' {}", at > 0 ? "," : "", level, at);
  for (const auto& [level, at] : steps) labels_y += fmt::format("{}'{:.2g}' {}", at > 0 ? "," : "", level, at);
  int panels = 0;
  for (int paused = 0; paused < 2; ++paused) {
    if (fields[paused].empty()) continue;
    for (const auto& [place, count] : fields[paused])
      data += fmt::format("{},{},{},{}/{}\n", moduli[place.first], steps[place.second],
                          100.0 * count.first / count.second, count.first, count.second);
    data += "\n\n";
    plots += fmt::format(
        "set title '{}'\nplot 'data.csv' index {} using 1:2:3 with image pixels notitle, '' index {} using 1:2:4 with "
        "labels font ',10' notitle\n",
        paused == 0 ? "all but those with an hour in one step" : "with an hour in one step", panels, panels);
    ++panels;
  }
  const std::string commands = fmt::format(
      "set datafile separator ','\nset xtics ({})\nset ytics ({})\nset xlabel \"Young's modulus, Pa\"\nset ylabel "
      "'step, s'\nset cbrange [0:100]\nset palette defined (0 '#f7fbff', 10 '#fdd0a2', 100 '#a50f15')\n"
      "set cblabel 'share at fault, %'\nset xrange [-0.5:{}]\nset yrange [-0.5:{}]\n"
      "set multiplot layout {},1 title 'cases at fault / all'\n{}unset multiplot\n",
      labels_x, labels_y, static_cast<double>(moduli.size()) - 0.5, static_cast<double>(steps.size()) - 0.5, panels,
      plots);
  return svg_by_gnuplot({820, 60 + 420 * panels}, data, commands);
}

/// Figures that a change must not make worse.
std::vector<Figure> figures_of(const std::map<std::string, SceneTally>& tallies) {
  std::vector<Figure> figures;
  for (const auto& [scene, tally] : tallies) {
    if (scene == "all") continue;
    figures.push_back({scene + ".cases", static_cast<double>(tally.cases)});
    for (int i = 0; i < testing::kStabilityFaults; ++i)
      figures.push_back({fmt::format("{}.{}", scene, name(StabilityFault(i))),
                         static_cast<double>(tally.by_fault[static_cast<std::size_t>(i)])});
    figures.push_back({scene + ".unsettled_steps", static_cast<double>(tally.unsettled)});
  }
  return figures;
}

/// A scene by one of the solvers, as tables name it.
std::string tallied(const StabilityCase& at) {
  return std::string(testing::name(at.scene)) + (at.substeps > 0 ? ".game" : "");
}

/// The cases of a grid that are asked for, scene by scene; a solver at a time where constraints act.
std::vector<StabilityCase> cases_of(const std::vector<StabilityCase>& grid, const StabilityArguments& a) {
  std::vector<StabilityCase> cases;
  for (const std::string& solver : a.solvers)
    for (std::size_t i = static_cast<std::size_t>(a.first); i < grid.size(); i += static_cast<std::size_t>(a.every)) {
      const bool is_asked =
          a.scenes.empty() || std::ranges::find(a.scenes, testing::name(grid[i].scene)) != a.scenes.end();
      const bool is_known = grid[i].scene == testing::StabilityScene::kFlight && solver != a.solvers.front();
      if (!is_asked || is_known) continue;
      cases.push_back(grid[i]);
      if (solver == "game" && grid[i].scene != testing::StabilityScene::kFlight) cases.back().substeps = a.substeps;
    }
  return cases;
}

/// A line of a case at fault, and of the simplest one like it where that is asked for.
void tell_if_bad(Program& program, const CaseRow& row, const StabilityArguments& a) {
  if (row.faults == 0 && row.seen) return;
  program.print(verdict(row) + ": " + testing::text(row.at) + "\n");
  if (!a.simplify || !row.seen) return;
  program.progress().stage("simplifying " + testing::text(row.at));
  const CaseRow simple = simplest(row, a.steps);
  program.print("    as in " + verdict(simple) + ": " + testing::text(simple.at) + "\n");
}

/// Rows of one solver: shares of faults of two are not to be mixed in one field.
std::vector<CaseRow> of_first_solver(std::vector<CaseRow> rows) {
  const bool by_game = rows.front().at.substeps > 0;
  std::erase_if(rows, [&](const CaseRow& row) { return (row.at.substeps > 0) != by_game; });
  return rows;
}

void benchmark_stability(Program& program, const StabilityArguments& a) {
  if (!a.peer.empty() && !testing::has_bullet())
    throw InvalidArgument("--peer: this build found no Bullet (apt-get install libbullet-dev, then configure anew)");
  const std::vector<StabilityCase> grid = a.grid == "energy"
                                              ? testing::energy_grid(a.recovers ? ContactOptions{}.recovery_speed : 0.0)
                                              : testing::extreme_cases(a.random);
  const KnownRows known = read_known(program, a.known);
  const std::vector<StabilityCase> cases = cases_of(grid, a);
  GrowingTable csv(a.csv, csv_head());
  std::vector<CaseRow> rows;
  std::map<std::string, SceneTally> tallies;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    program.progress().stage(fmt::format("case {} of {}: {}", i + 1, cases.size(), testing::text(cases[i])));
    rows.push_back(try_case(cases[i], a.steps, !a.peer.empty() && cases[i].substeps == 0, known));
    csv.add(csv_of(rows.back()));
    tell_if_bad(program, rows.back(), a);
    SceneTally& tally = tallies[tallied(cases[i])];
    tally.add(rows.back());
    tallies["all"].add(rows.back());
    if (i + 1 == cases.size() || tallied(cases[i + 1]) != tallied(cases[i]))
      program.print(fmt::format("{}: {} of {} cases good, {} of {} done\n", tallied(cases[i]), tally.good, tally.cases,
                                i + 1, cases.size()));
  }
  program.print("\n" + head());
  for (const auto& [scene, tally] : tallies)
    if (scene != "all") program.print(line(scene, tally));
  const SceneTally& all = tallies["all"];
  program.print(line("all", all));
  if (!a.peer.empty()) program.print(peer_table(rows));

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
  if (!a.plot.empty()) write_plot(program, a.plot, svg_of(of_first_solver(rows)));
  if (!a.limits.empty()) hold_to_limits(program, figures_of(tallies), a.limits);
  csv.finish(program);
}

void declare(CLI::App& app, StabilityArguments& a) {
  app.add_option(
         "--grid", a.grid,
         "extremes: every level of every axis by itself, and random cases of all of them; energy: a full grid of "
         "stiffness, step, damping, modes and weights")
      ->type_name("NAME")
      ->check(CLI::IsMember({"extremes", "energy"}))
      ->capture_default_str();
  app.add_option("--scene", a.scenes, "these scenes alone: flight, ground, pile, handle, chain")
      ->type_name("NAME,...")
      ->delimiter(',')
      ->check(CLI::IsMember({"flight", "ground", "pile", "handle", "chain"}));
  app.add_option("--solver", a.solvers, "who answers contacts, handles and joints: exact, game")
      ->type_name("NAME,...")
      ->delimiter(',')
      ->check(CLI::IsMember({"exact", "game"}))
      ->capture_default_str();
  app.add_option("--substeps", a.substeps, "of game")
      ->type_name("N")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--random", a.random, "random cases of each scene, for --grid extremes")
      ->type_name("N")
      ->check(CLI::Range(0, 1'000'000))
      ->capture_default_str();
  app.add_flag("--recovery", a.recovers, "push bodies that overlap apart as by default, for --grid energy");
  app.add_option("--steps", a.steps, "steps per case")
      ->type_name("N")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--every", a.every, "one of so many cases of the grid")
      ->type_name("N")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--first", a.first, "the first of these, from 0: the grid in so many parts")
      ->type_name("I")
      ->check(CLI::Range(0, 1'000'000))
      ->capture_default_str();
  app.add_option("--peer", a.peer, "run what Bullet's reduced deformable body can express by that, too")
      ->type_name("bullet")
      ->check(CLI::IsMember({"bullet"}));
  app.add_flag("--simplify", a.simplify,
               "tell for each case at fault the simplest one found that shares a fault with it");
  app.add_option("--known", a.known, "take cases from these tables of earlier --csv, and run only the others")
      ->type_name("FILE.csv,...")
      ->delimiter(',');
  app.add_option("--check", a.limits, "hold the counts of faults to these limits, and fail beyond them")
      ->type_name("FILE.json");
  app.add_option("--csv", a.csv, "write the table; rows stand in FILE.csv.part as they come")->type_name("FILE.csv");
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
