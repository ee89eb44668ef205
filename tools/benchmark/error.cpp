// limber-benchmark error: scenes played by limber and by finite elements of all nodes, error against time.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>

#include "benchmarks.h"
#include "error_scenes.h"
#include "limber/core/error.h"
#include "limber/model/asset.h"
#include "plot.h"
#include "program.h"

namespace limber::tools {
namespace {

using limber::testing::ElasticLaw;
using limber::testing::ErrorScene;
using limber::testing::ErrorSetting;
using limber::testing::PlayedScene;
using limber::testing::SceneError;
using Json = nlohmann::ordered_json;

constexpr double kFrame = 1.0 / 60.0;  // s: times of a frame compare steps of any length
constexpr double kFinestRate = 960.0;  // 1/s, of limber, where its step is to cost little error
constexpr int kManyModes = 4;          // times as many, where truncation is to cost little
constexpr double kNudge = 0.01;        // by how much what drives a scene is changed to see what the scene makes of it

/// All that is varied: each setting takes one of each.
struct ErrorAxes {
  std::vector<std::string> methods{"complementary"}, residuals{"on"}, bases{"float"};
  std::vector<int> modes{1, 2, 5, 10, 20, 40, 80}, rates{60, 240, 960}, meshes{1}, substeps{0, 2, 4, 8, 16, 32};
  std::vector<double> drives{1.0};
};

struct ErrorArguments {
  std::vector<std::string> scenes;
  ErrorAxes axes{};
  std::string against = "linear", target, settings, csv, plot;
  bool split = false, capture = false;
};

/// A setting of a scene and how far it was off, in how long.
struct ErrorRow {
  std::string scene, method;  // the latter: all but the modes; a line of the plot
  ErrorSetting at{};
  SceneError error{};
  testing::Quantiles step{};  // s
  double frame = 0.0;         // s of the thread for 1/60 s of the scene, in the mean
  double bake = 0.0, energy_rise = 0.0, energy_loss = 0.0;
  std::size_t bytes = 0;
  int unsettled = 0;
  bool on_front = false;
};

constexpr double kReferenceStep = 0.4;  // of the stable one

/// Plays what is asked for, the references once.
class ErrorRuns {
 public:
  explicit ErrorRuns(Program& program) : program_(program) {}

  const PlayedScene& reference(const ErrorScene& scene, ElasticLaw law, int mesh, double drive,
                               double fraction = kReferenceStep) {
    const auto key = std::tuple(scene.name, law, mesh, drive, fraction);
    const auto known = references_.find(key);
    if (known != references_.end()) return known->second;
    program_.progress().stage(fmt::format("{}: all nodes of mesh {}", scene.name, mesh));
    return references_.emplace(key, testing::play_reference(testing::driven(scene, drive), law, mesh, fraction))
        .first->second;
  }
  PlayedScene play(const ErrorScene& scene, const ErrorSetting& at) {
    program_.progress().stage(scene.name + ": " + text(at));
    return testing::play(testing::driven(scene, at.drive), at, bakery_);
  }
  testing::SceneBakery& bakery() { return bakery_; }

  /// @param finest mesh of the settings
  const PlayedScene& against(const ErrorScene& scene, const std::string& what, const ErrorSetting& at, int finest) {
    if (what == "linear") return reference(scene, ElasticLaw::kLinear, at.mesh, at.drive);
    if (what == "linear-fine") return reference(scene, ElasticLaw::kLinear, 2 * finest, at.drive);
    if (what == "neo-hookean") return reference(scene, ElasticLaw::kNeoHookean, at.mesh, at.drive);
    return reference(scene, ElasticLaw::kStVenantKirchhoff, what == "fine" ? 2 * finest : at.mesh, at.drive);
  }

 private:
  Program& program_;
  testing::SceneBakery bakery_;
  std::map<std::tuple<std::string, ElasticLaw, int, double, double>, PlayedScene> references_;
};

/// A line of the plot: what differs from the defaults, but for the modes.
std::string method_of(const ErrorSetting& at) {
  std::string out = fmt::format("{:.0f} steps/s", 1.0 / at.step);
  const ErrorSetting usual;
  if (at.method != usual.method) out += ", " + at.method;
  if (!at.residual) out += ", no residual";
  if (at.substeps > 0) out += fmt::format(", game {}", at.substeps);
  if (at.basis != usual.basis) out += ", " + at.basis;
  if (at.mesh != usual.mesh) out += fmt::format(", mesh {}", at.mesh);
  if (at.drive != usual.drive) out += fmt::format(", drive {:g}", at.drive);
  return out;
}

double frame_of(const ErrorScene& scene, double all_steps) { return all_steps * kFrame / scene.duration; }

ErrorRow run_setting(ErrorRuns& runs, const ErrorScene& scene, const ErrorSetting& at, const ErrorArguments& a) {
  const PlayedScene played = runs.play(scene, at);
  const testing::BakedScene& baked = runs.bakery().baked(scene, at);
  ErrorRow row{.scene = scene.name, .method = method_of(at), .at = at};
  const int finest = *std::max_element(a.axes.meshes.begin(), a.axes.meshes.end());
  row.error = scene_error(scene, played, runs.against(scene, a.against, at, finest));
  row.step = testing::quantiles(played.step_seconds);
  row.frame = frame_of(scene, std::accumulate(played.step_seconds.begin(), played.step_seconds.end(), 0.0));
  row.bake = baked.bake_seconds;
  row.bytes = baked.bytes;
  row.energy_rise = played.energy_rise, row.energy_loss = played.energy_loss;
  row.unsettled = played.unsettled;
  return row;
}

/// All nodes stepped by central differences at nine tenths of what is stable.
ErrorRow run_all_nodes(ErrorRuns& runs, const ErrorScene& scene) {
  const PlayedScene played = testing::play_reference(scene, ElasticLaw::kLinear, 1, 0.9);
  ErrorRow row{.scene = scene.name, .method = "all nodes"};
  row.error = scene_error(scene, played, runs.reference(scene, ElasticLaw::kLinear, 1, 1.0));
  row.step = testing::quantiles(played.step_seconds);
  double longest = 1.0;
  for (const auto& body : scene.bodies) longest = std::min(longest, 0.9 * testing::stable_step_of(body));
  row.at.step = longest, row.at.modes = 0;
  row.frame = row.step.median * kFrame / longest;
  return row;
}

std::vector<ErrorSetting> settings_of(const ErrorArguments& a) {
  std::vector<ErrorSetting> out;
  for (const int mesh : a.axes.meshes)
    for (const std::string& basis : a.axes.bases)
      for (const std::string& residual : a.axes.residuals)
        for (const int substeps : a.axes.substeps)
          for (const std::string& method : a.axes.methods)
            for (const double drive : a.axes.drives)
              for (const int rate : a.axes.rates)
                for (const int modes : a.axes.modes)
                  out.push_back({.modes = modes,
                                 .step = 1.0 / rate,
                                 .method = method,
                                 .substeps = substeps,
                                 .residual = residual == "on",
                                 .basis = basis,
                                 .mesh = mesh,
                                 .drive = drive});
  return out;
}

bool is_first_contact_rule(const ErrorSetting& at, const ErrorArguments& a) {
  return at.method == a.axes.methods.front();
}

/// Whether no other setting makes the same run: rules of contact are the exact solver's, substeps those of what is
/// held, joined or touched.
bool is_run_of_its_own(const ErrorScene& scene, const ErrorSetting& at, const ErrorArguments& a) {
  const bool is_first_rule = is_first_contact_rule(at, a);
  if (!scene.has_constraints()) return is_first_rule && at.substeps == a.axes.substeps.front();
  return is_first_rule || (at.substeps == 0 && scene.has_contact());
}

/// Marks the rows of a scene that no other beats in both error and time.
void mark_front(std::vector<ErrorRow>& rows) {
  for (ErrorRow& row : rows)
    row.on_front = std::none_of(rows.begin(), rows.end(), [&](const ErrorRow& other) {
      return other.scene == row.scene && other.error.motion.mean <= row.error.motion.mean && other.frame <= row.frame &&
             (other.error.motion.mean < row.error.motion.mean || other.frame < row.frame);
    });
}

// Table ------------------------------------------------------------------------------------------------------------

using Column = std::pair<const char*, double (*)(const ErrorRow&)>;
constexpr std::array<Column, 23> kColumns{{
    {"substeps", [](const ErrorRow& r) { return static_cast<double>(r.at.substeps); }},
    {"error", [](const ErrorRow& r) { return r.error.motion.mean; }},
    {"error_worst", [](const ErrorRow& r) { return r.error.motion.worst; }},
    {"error_vertex", [](const ErrorRow& r) { return r.error.motion.worst_vertex; }},
    {"error_shape", [](const ErrorRow& r) { return r.error.motion.shape_mean; }},
    {"error_tip", [](const ErrorRow& r) { return r.error.tip; }},
    {"error_impulse", [](const ErrorRow& r) { return r.error.impulse; }},
    {"error_first", [](const ErrorRow& r) { return r.error.first; }},
    {"error_first_impulse", [](const ErrorRow& r) { return r.error.first_impulse; }},
    {"error_first_length", [](const ErrorRow& r) { return r.error.first_length; }},
    {"error_momentum", [](const ErrorRow& r) { return r.error.momentum; }},
    {"energy_rise", [](const ErrorRow& r) { return r.energy_rise; }},
    {"energy_loss", [](const ErrorRow& r) { return r.energy_loss; }},
    {"unsettled", [](const ErrorRow& r) { return static_cast<double>(r.unsettled); }},
    {"peak_m", [](const ErrorRow& r) { return r.error.motion.peak; }},
    {"shape_peak_m", [](const ErrorRow& r) { return r.error.motion.shape_peak; }},
    {"step_median_us", [](const ErrorRow& r) { return 1e6 * r.step.median; }},
    {"step_p99_us", [](const ErrorRow& r) { return 1e6 * r.step.p99; }},
    {"frame_us", [](const ErrorRow& r) { return 1e6 * r.frame; }},
    {"bake_s", [](const ErrorRow& r) { return r.bake; }},
    {"bytes", [](const ErrorRow& r) { return static_cast<double>(r.bytes); }},
    {"steps_per_second", [](const ErrorRow& r) { return 1.0 / r.at.step; }},
    {"pareto", [](const ErrorRow& r) { return r.on_front ? 1.0 : 0.0; }},
}};

std::string csv_of(const std::vector<ErrorRow>& rows) {
  std::string csv = "scene,line,modes,method,residual,basis,mesh,drive";
  for (const auto& [name, value] : kColumns) csv += fmt::format(",{}", name);
  csv += '\n';
  for (const ErrorRow& r : rows) {
    csv += fmt::format("{},\"{}\",{},{},{},{},{},{:g}", r.scene, r.method, r.at.modes, r.at.method,
                       r.at.residual ? 1 : 0, r.at.basis, r.at.mesh, r.at.drive);
    for (const auto& [name, value] : kColumns) csv += fmt::format(",{:.6g}", value(r));
    csv += '\n';
  }
  return csv;
}

Json json_of(const ErrorRow& r) {
  Json row{{"scene", r.scene},          {"line", r.method},    {"modes", r.at.modes}, {"method", r.at.method},
           {"residual", r.at.residual}, {"basis", r.at.basis}, {"mesh", r.at.mesh},   {"drive", r.at.drive}};
  for (const auto& [name, value] : kColumns) row[name] = value(r);
  return row;
}

std::string line_of(const ErrorRow& r) {
  const auto percent = [](double x) { return 100.0 * x; };
  return fmt::format(
      "{:<8} {:<40} {:>5} {:>8.3g} {:>8.3g} {:>8.3g} {:>8.3g} {:>8.3g} {:>8.3g} {:>9.1f} {:>9.1f} {:>9.1f} {:>7.2f} "
      "{:>7.0f} {}\n",
      r.scene, r.method, r.at.modes, percent(r.error.motion.mean), percent(r.error.motion.shape_mean),
      percent(r.error.tip), percent(r.error.first), percent(r.error.first_impulse), percent(r.error.impulse),
      1e6 * r.step.median, 1e6 * r.step.p99, 1e6 * r.frame, r.bake, 1e-3 * static_cast<double>(r.bytes),
      r.on_front ? "*" : "");
}
constexpr const char* kHead =
    "scene    line                                     modes  error %  shape %    tip %  first %  f.imp %  impulse   "
    "step us    p99 us  frame us  bake s    kB\n";

// Plot -------------------------------------------------------------------------------------------------------------

/// A field per scene, log error against log time; a line per method, the Pareto front in circles.
std::string svg_of(const std::vector<ErrorRow>& rows) {
  std::map<std::string, std::map<std::string, std::vector<const ErrorRow*>>> fields;
  std::vector<std::string> order;
  for (const ErrorRow& r : rows) {
    if (std::find(order.begin(), order.end(), r.scene) == order.end()) order.push_back(r.scene);
    fields[r.scene][r.method].push_back(&r);
  }
  std::string data, commands =
                        "set logscale xy\nset format x '10^{%T}'\nset format y '%g'\nset grid lc rgb '#dddddd'\n"
                        "set key outside right top noenhanced font ',9' samplen 1.5\nset xlabel 'µs for 1/60 s of the "
                        "scene'\nset ylabel 'error, % of the peak'\n";
  const std::size_t across = order.size() == 1 ? 1 : 2, down = (order.size() + across - 1) / across;
  commands += fmt::format("set multiplot layout {},{}\n", down, across);
  int block = 0;
  for (const std::string& scene : order) {
    std::string lines;
    for (const auto& [method, points] : fields[scene]) {
      for (const ErrorRow* r : points) data += fmt::format("{} {}\n", 1e6 * r->frame, 100.0 * r->error.motion.mean);
      data += "\n\n";
      lines += fmt::format("{}'data.csv' index {} with linespoints pt 7 ps 0.4 lw 1.5 title '{}'",
                           lines.empty() ? "" : ", ", block++, method);
    }
    for (const auto& [method, points] : fields[scene])
      for (const ErrorRow* r : points)
        if (r->on_front) data += fmt::format("{} {}\n", 1e6 * r->frame, 100.0 * r->error.motion.mean);
    data += "\n\n";
    lines += fmt::format(", 'data.csv' index {} with points pt 6 ps 1.1 lc rgb 'black' title 'Pareto front'", block++);
    commands += fmt::format("set title '{}'\nplot {}\n", scene, lines);
  }
  commands += "unset multiplot\n";
  return svg_by_gnuplot({static_cast<int>(640 * across), static_cast<int>(340 * down)}, data, commands);
}

// Where the error comes from -----------------------------------------------------------------------------------------

/// Parts of the error of a setting, each the distance of two motions that differ in one thing. `ten_node` is what the
/// mesh costs a bake of ten-node tets; NaN where bodies touch: residual compliance of so many vertices takes hours.
struct ErrorParts {
  double step = 0.0, rule = 0.0, modes = 0.0, frame = 0.0, linear = 0.0, law = 0.0, mesh = 0.0, ten_node = 0.0,
         all = 0.0;
  double own = 0.0, nudged = 0.0;  // of the reference: at half its step; with what drives it changed by kNudge
};
using Part = std::pair<const char*, double ErrorParts::*>;
constexpr std::array<Part, 11> kParts{{{"step", &ErrorParts::step},
                                       {"rule", &ErrorParts::rule},
                                       {"modes", &ErrorParts::modes},
                                       {"frame", &ErrorParts::frame},
                                       {"linear", &ErrorParts::linear},
                                       {"law", &ErrorParts::law},
                                       {"mesh", &ErrorParts::mesh},
                                       {"ten_node", &ErrorParts::ten_node},
                                       {"all", &ErrorParts::all},
                                       {"own", &ErrorParts::own},
                                       {"nudged", &ErrorParts::nudged}}};

ErrorParts parts_of(ErrorRuns& runs, const ErrorScene& scene, const ErrorSetting& at) {
  const auto apart = [&](const PlayedScene& a, const PlayedScene& b) { return scene_error(scene, a, b).motion.mean; };
  const auto reference = [&](ElasticLaw law, int mesh, double drive = 1.0, double fraction = kReferenceStep) -> auto& {
    return runs.reference(scene, law, mesh, at.drive * drive, fraction);
  };
  ErrorSetting fine = at;
  fine.step = 1.0 / kFinestRate;
  ErrorSetting best = fine;
  if (scene.has_contact()) best.method = "complementary";
  ErrorSetting many = best;
  many.modes *= kManyModes;
  ErrorSetting ten_node = best;
  ten_node.quadratic = true;
  ErrorSetting ten_node_fine = ten_node;
  ten_node_fine.mesh *= 2;
  const PlayedScene seen = runs.play(scene, at), without_step = runs.play(scene, fine),
                    without_rule = scene.has_contact() ? runs.play(scene, best) : without_step,
                    without_truncation = runs.play(scene, many);
  const PlayedScene& linear = reference(ElasticLaw::kLinear, at.mesh);
  const PlayedScene& bending = reference(ElasticLaw::kStVenantKirchhoff, at.mesh);
  return {.step = apart(seen, without_step),
          .rule = apart(without_step, without_rule),
          .modes = apart(without_rule, without_truncation),
          .frame = apart(without_truncation, linear),
          .linear = apart(linear, bending),
          .law = apart(bending, reference(ElasticLaw::kNeoHookean, at.mesh)),
          .mesh = apart(linear, reference(ElasticLaw::kLinear, 2 * at.mesh)),
          .ten_node =
              scene.has_contact() ? std::nan("") : apart(runs.play(scene, ten_node), runs.play(scene, ten_node_fine)),
          .all = apart(seen, bending),
          .own = apart(linear, reference(ElasticLaw::kLinear, at.mesh, 1.0, 0.5 * kReferenceStep)),
          .nudged = apart(reference(ElasticLaw::kLinear, at.mesh, 1.0 + kNudge), linear)};
}

void print_parts(Program& program, ErrorRuns& runs, const std::vector<const ErrorScene*>& scenes,
                 const ErrorSetting& at) {
  std::string head = fmt::format("\nparts of the error, %, at {}\n{:<8}", text(at), "scene");
  for (const auto& [name, part] : kParts) head += fmt::format(" {:>8}", name);
  program.print(head + "\n");
  for (const ErrorScene* scene : scenes) {
    const ErrorParts parts = parts_of(runs, *scene, at);
    std::string line = fmt::format("{:<8}", scene->name);
    Json row{{"scene", scene->name}};
    for (const auto& [name, part] : kParts) {
      line += std::isnan(parts.*part) ? fmt::format(" {:>8}", "-") : fmt::format(" {:>8.3g}", 100.0 * parts.*part);
      row[name] = parts.*part;
    }
    program.print(line + "\n");
    program.report()["parts"].push_back(std::move(row));
  }
}

// Settings that do ---------------------------------------------------------------------------------------------------

double share_of(const std::string& text) {
  std::size_t end = 0;
  double value = 0.0;
  try {
    value = std::stod(text, &end);
  } catch (const std::exception&) {
    end = 0;
  }
  const std::string rest = text.substr(end);
  if (end == 0 || !(value > 0.0) || (rest != "" && rest != "%"))
    throw InvalidArgument("--target-error: \"" + text + "\", expected a share such as 0.01 or 1%");
  return rest == "%" ? value / 100.0 : value;
}

/// Settings that a scene file can hold.
bool is_told_by_a_scene(const ErrorSetting& at) { return at.substeps == 0 && at.modes > 0 && at.basis == "float"; }

void write_settings(Program& program, ErrorRuns& runs, const ErrorArguments& a, const std::vector<ErrorRow>& rows) {
  const double target = share_of(a.target);
  const ErrorRow* best = nullptr;
  double least = HUGE_VAL;
  for (const ErrorRow& r : rows) {
    if (!is_told_by_a_scene(r.at)) continue;
    least = std::min(least, r.error.motion.mean);
    if (r.error.motion.mean <= target && (best == nullptr || r.frame < best->frame)) best = &r;
  }
  if (best == nullptr)
    throw InputError(fmt::format(
        "--target-error {}: no setting tried comes within it, the best is {:.3g} %: give more modes or steps", a.target,
        100.0 * least));
  program.print(fmt::format("cheapest within {}: {}: {}; error {:.3g} %, {:.1f} us per 1/60 s\n", a.target, best->scene,
                            text(best->at), 100.0 * best->error.motion.mean, 1e6 * best->frame));
  program.report()["cheapest"] = json_of(*best);
  if (a.settings.empty()) return;
  const std::filesystem::path path(a.settings);
  const ErrorScene& scene = testing::error_scene(best->scene);
  const auto file_of = [&](const std::string& body) { return path.stem().string() + "-" + body + ".glb"; };
  for (const auto& [body, asset] : runs.bakery().baked(scene, best->at).assets)
    program.write_file((path.parent_path() / file_of(body)).string(), asset_bytes(asset));
  program.write_file(a.settings, scene_text(testing::driven(scene, best->at.drive), best->at, file_of));
}

/// The assets' own account of their statics.
void print_capture(Program& program, ErrorRuns& runs, const std::vector<const ErrorScene*>& scenes,
                   const ErrorArguments& a) {
  program.print(
      "\nstatic compliance that the modes by frequency show, %: at the nodes that loads act on; of the vertices that "
      "touch\n"
      "scene    body     modes    least  |   least   median\n");
  for (const ErrorScene* scene : scenes)
    for (const int modes : a.axes.modes)
      for (const auto& [body, asset] : runs.bakery().baked(*scene, {.modes = modes}).assets) {
        const ModalModel& model = *asset.bodies[0];
        std::string line = fmt::format("{:<8} {:<8} {:>5}", scene->name, body, modes);
        double least = 1.0;
        for (const CapturedLoad& load : model.data().captured) least = std::min(least, load.share);
        line += model.data().captured.empty() ? fmt::format(" {:>8}", "") : fmt::format(" {:>8.3g}", 100.0 * least);
        if (scene->has_contact()) {
          std::vector<double> shown = model.captured_shares();
          std::sort(shown.begin(), shown.end());
          line += fmt::format("  |{:>8.3g} {:>8.3g}", 100.0 * shown.front(), 100.0 * shown[shown.size() / 2]);
        }
        program.print(line + "\n");
      }
}

void benchmark_error(Program& program, const ErrorArguments& a) {
  std::vector<const ErrorScene*> scenes;
  for (const std::string& name : a.scenes) scenes.push_back(&testing::error_scene(name));
  if (scenes.empty())
    for (const ErrorScene& scene : testing::error_scenes()) scenes.push_back(&scene);
  if (!a.settings.empty() && (scenes.size() != 1 || a.target.empty()))
    throw InvalidArgument("-o: expected one --scene and a --target-error");
  ErrorRuns runs(program);
  std::vector<ErrorRow> rows;
  program.print(kHead);
  for (const ErrorScene* scene : scenes) {
    for (const ErrorSetting& at : settings_of(a))
      if (is_run_of_its_own(*scene, at, a)) rows.push_back(run_setting(runs, *scene, at, a));
    if (a.against == "linear") rows.push_back(run_all_nodes(runs, *scene));
  }
  mark_front(rows);
  for (const ErrorRow& row : rows) program.print(line_of(row));
  Json& report = program.report();
  report["benchmark"] = "error";
  report["against"] = a.against;
  for (const ErrorRow& row : rows) report["rows"].push_back(json_of(row));
  if (a.split) {
    ErrorSetting last = settings_of(a).back();
    last.substeps = 0;
    print_parts(program, runs, scenes, last);
  }
  if (a.capture) print_capture(program, runs, scenes, a);
  if (!a.csv.empty()) program.write_file(a.csv, csv_of(rows));
  if (!a.plot.empty()) write_plot(program, a.plot, svg_of(rows));
  if (!a.target.empty()) write_settings(program, runs, a, rows);
}

void declare_axes(CLI::App& app, ErrorArguments& a) {
  const auto list = [&](const char* name, auto& values, const char* what, const char* type) {
    return app.add_option(name, values, what)->type_name(type)->delimiter(',')->capture_default_str();
  };
  list("--scene", a.scenes, "poke, drag, drop, collide, spin, lamp, squeeze, strip; default: all", "NAME,...");
  list("--modes", a.axes.modes, "modes kept", "K,...")->check(CLI::Range(1, 100'000));
  list("--steps-per-second", a.axes.rates, "a multiple of 30", "N,...")->check(CLI::Range(30, 1'000'000));
  list("--method", a.axes.methods, "how contact forces are found", "NAME,...")
      ->check(CLI::IsMember({"complementary", "gap_program", "velocity_program", "penalty"}));
  list("--substeps", a.axes.substeps, "of contact, handles and joints by small steps; 0: the exact solver", "N,...")
      ->check(CLI::Range(0, 1'000));
  list("--residual", a.axes.residuals, "static answers of the modes left out", "on|off,...")
      ->check(CLI::IsMember({"on", "off"}));
  list("--basis", a.axes.bases, "shapes as they are, or rounded to half precision", "float|half,...")
      ->check(CLI::IsMember({"float", "half"}));
  list("--mesh", a.axes.meshes, "times as many cells along each axis", "N,...")->check(CLI::Range(1, 8));
  list("--drive", a.axes.drives, "forces, ways, velocities and gravity, times those of the scene", "FACTOR,...")
      ->check(CLI::Range(1e-6, 1e6));
}

void declare(CLI::App& app, ErrorArguments& a) {
  declare_axes(app, a);
  app.add_option("--against", a.against,
                 "all nodes with small strains in a frame that turns; nonlinear: St. Venant-Kirchhoff; neo-hookean; "
                 "linear-fine, fine: the first and the second with twice the cells of the finest --mesh")
      ->type_name("NAME")
      ->check(CLI::IsMember({"linear", "nonlinear", "neo-hookean", "linear-fine", "fine"}))
      ->capture_default_str();
  app.add_flag("--split", a.split,
               "tell what the last setting's error by the exact solver is made of: step, contact rule, modes, frame, "
               "linearisation, mesh");
  app.add_flag("--capture", a.capture, "tell how much of the static compliance the modes show, from the assets alone");
  app.add_option("--target-error", a.target, "name the cheapest setting within it, such as 1%")->type_name("SHARE");
  app.add_option("-o,--output", a.settings, "write that setting as a scene for limber-simulate, with its assets beside")
      ->type_name("SCENE.json");
  app.add_option("--csv", a.csv, "write the table")->type_name("FILE.csv");
  app.add_option("--plot", a.plot, "plot error against time (needs gnuplot)")->type_name("FILE.svg");
}

}  // namespace

std::function<void(Program&)> add_error(CLI::App& programs) {
  const auto arguments = std::make_shared<ErrorArguments>();
  CLI::App* app =
      programs.add_subcommand("error", "scenes beside finite elements of all their nodes: error against time");
  declare(*app, *arguments);
  return [arguments, app](Program& program) {
    if (app->parsed()) benchmark_error(program, *arguments);
  };
}

}  // namespace limber::tools
