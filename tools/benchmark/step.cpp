#include "benchmarks.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>

#include "limber/core/error.h"
#include "limber/engine/world.h"
#include "limber/model/asset.h"
#include "limber/scene/scene_model.h"
#include "plot.h"
#include "program.h"

namespace limber::tools {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

struct StepArguments {
  std::string asset, csv, plot;
  std::vector<int> bodies{1, 10, 100, 1000}, modes{0, 8, 20, 32, 40, 64};
  int vertices = 2600;
  double step = 1.0 / 60.0, seconds_per_row = 0.2;
};

/// One measured case.
struct StepRow {
  Index modes = 0, bodies = 0, vertices = 0;
  double advance_median = 0.0, advance_p99 = 0.0;  // s per step of the whole world
  double positions = 0.0, normals = 0.0;           // s per reconstruction of all bodies; normals: positions and normals
  double energy_drift = 0.0;                       // relative change of the energy over all timed steps; nothing damps
};

/// A tube whose surface waves: only the counts matter for the time, the shapes are bounded and smooth.
std::shared_ptr<const ModalModel> synthetic_model(Index modes, Index vertices) {
  constexpr Index kAround = 20;
  const Index rings = std::max<Index>(vertices / kAround, 2);
  ModalModelData d;
  d.name = "tube";
  d.mass = 1.0;
  d.volume = std::numbers::pi * 0.01;
  d.inertia = Vec3(0.005, 0.086, 0.086).asDiagonal();
  d.render.basis = ModalBasis(rings * kAround, modes);
  for (Index r = 0; r < rings; ++r)
    for (Index a = 0; a < kAround; ++a) {
      const double x = static_cast<double>(r) / (rings - 1) - 0.5, angle = 2.0 * std::numbers::pi * a / kAround;
      d.render.rest.push_back(Vec3(x, 0.1 * std::cos(angle), 0.1 * std::sin(angle)).cast<float>());
      for (Index m = 0; m < modes; ++m) {
        const double wave = std::cos(2.0 * std::numbers::pi * (m + 1) * x);
        d.render.basis.set(r * kAround + a, m, Vec3(0.0, wave, wave).cast<float>());
      }
      if (r == 0) continue;
      const Index here = r * kAround + a, next = r * kAround + (a + 1) % kAround;
      d.render.triangles.push_back({here - kAround, next - kAround, next});
      d.render.triangles.push_back({here - kAround, next, here});
    }
  for (Index m = 0; m < modes; ++m) {
    const double omega = 2.0 * std::numbers::pi * 10.0 * (m + 1);
    d.eigenvalues.push_back(omega * omega);
    d.decays.push_back(0.0);
    d.participation.push_back(Vec3::Zero());
    d.moments.push_back(Mat3::Zero());
  }
  return std::make_shared<const ModalModel>(std::move(d));
}

/// Bodies in a row, all flying, spinning and ringing.
struct Flight {
  World world;
  std::vector<BodyId> ids;

  Flight(const std::shared_ptr<const ModalModel>& model, Index bodies, double step)
      : world({.step = step, .gravity = Vec3::Zero()}) {
    for (Index i = 0; i < bodies; ++i) {
      ids.push_back(world.add_body(model, {.pose = {.q = {}, .p = Vec3(2.0 * i, 0.0, 0.0)},
                                           .velocity = Vec3(0.0, 1.0, 3.0),
                                           .angular_velocity = Vec3(1.0, 2.0 + 0.001 * i, 0.5)}));
      world.apply_impulse(ids.back(), {.surface = SurfacePoint::Surface::kRender, .triangle = i % 7},
                          Vec3(0.0, 0.1, 0.2));
    }
    world.step();
  }

  double energy() const {
    double sum = 0.0;
    for (const BodyId id : ids) sum += world.energy(id).total();
    return sum;
  }
};

/// Arrays for the vertices of all bodies of a flight.
struct Drawing {
  std::vector<float> positions, normals;
  std::vector<DrawTarget> targets;

  Drawing(const Flight& flight, bool with_normals) {
    const std::size_t floats = 3 * static_cast<std::size_t>(flight.world.model(flight.ids.front()).render().vertices());
    positions.resize(floats * flight.ids.size());
    if (with_normals) normals.resize(positions.size());
    for (std::size_t i = 0; i < flight.ids.size(); ++i) {
      targets.push_back({.id = flight.ids[i], .positions = std::span(positions).subspan(i * floats, floats)});
      if (with_normals) targets.back().normals = std::span(normals).subspan(i * floats, floats);
    }
  }
};

/// Times work() until `seconds` have passed, in batches long enough for the clock. @return seconds per call, ascending
template <class F>
std::vector<double> time(double seconds, F&& work) {
  constexpr double kBatchSeconds = 20e-6;
  constexpr std::size_t kFewest = 5;
  work();  // warm
  std::int64_t batch = 1;
  const auto began = Clock::now();
  std::vector<double> per_call;
  while (per_call.size() < kFewest || std::chrono::duration<double>(Clock::now() - began).count() < seconds) {
    const auto start = Clock::now();
    for (std::int64_t i = 0; i < batch; ++i) work();
    const double took = std::chrono::duration<double>(Clock::now() - start).count();
    if (took < kBatchSeconds && per_call.empty())
      batch *= 2;
    else
      per_call.push_back(took / static_cast<double>(batch));
  }
  std::sort(per_call.begin(), per_call.end());
  return per_call;
}

double quantile(const std::vector<double>& sorted, double q) {
  return sorted[static_cast<std::size_t>(std::lround(q * static_cast<double>(sorted.size() - 1)))];
}

StepRow measure(const std::shared_ptr<const ModalModel>& model, Index bodies, const StepArguments& a) {
  Flight flight(model, bodies, a.step);
  StepRow row{.modes = model->modes(), .bodies = bodies, .vertices = model->render().vertices()};
  const double before = flight.energy();
  const auto steps = time(a.seconds_per_row, [&] { flight.world.step(); });
  row.advance_median = quantile(steps, 0.5);
  row.advance_p99 = quantile(steps, 0.99);
  row.energy_drift = std::abs(flight.energy() - before) / std::abs(before);
  const Drawing drawing(flight, false), with_normals(flight, true);
  row.positions = quantile(time(a.seconds_per_row, [&] { flight.world.reconstruct(drawing.targets); }), 0.5);
  row.normals = quantile(time(a.seconds_per_row, [&] { flight.world.reconstruct(with_normals.targets); }), 0.5);
  return row;
}

std::vector<std::shared_ptr<const ModalModel>> models(const StepArguments& a) {
  std::vector<std::shared_ptr<const ModalModel>> all;
  if (!a.asset.empty()) return {read_asset(a.asset).bodies.front()};
  for (const int k : a.modes) all.push_back(synthetic_model(k, a.vertices));
  return all;
}

double per_body_ns(double seconds, const StepRow& r) { return 1e9 * seconds / r.bodies; }
double per_vertex_ns(double seconds, const StepRow& r) { return per_body_ns(seconds, r) / r.vertices; }

Json json_row(const StepRow& r) {
  Json row{{"modes", r.modes},
           {"bodies", r.bodies},
           {"vertices", r.vertices},
           {"step_median", r.advance_median},
           {"step_p99", r.advance_p99},
           {"step_per_body", r.advance_median / r.bodies},
           {"positions_per_vertex", r.positions / r.bodies / r.vertices},
           {"positions_and_normals_per_vertex", r.normals / r.bodies / r.vertices},
           {"energy_drift", r.energy_drift}};
  row["step_per_body_and_mode"] = r.modes > 0 ? Json(r.advance_median / r.bodies / r.modes) : Json();
  return row;
}

std::string csv_of(const std::vector<StepRow>& rows) {
  std::string csv =
      "modes,bodies,vertices,step_us_median,step_us_p99,step_ns_per_body,positions_ns_per_vertex,"
      "positions_and_normals_ns_per_vertex,energy_drift\n";
  for (const StepRow& r : rows)
    csv += fmt::format("{},{},{},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},{:.3g}\n", r.modes, r.bodies, r.vertices,
                       1e6 * r.advance_median, 1e6 * r.advance_p99, per_body_ns(r.advance_median, r),
                       per_vertex_ns(r.positions, r), per_vertex_ns(r.normals, r), r.energy_drift);
  return csv;
}

/// Time per body against modes, a line per number of bodies, by gnuplot.
std::string svg_of(const std::vector<StepRow>& rows, const std::vector<int>& bodies) {
  std::string plot =
      "set datafile separator ','\nset xlabel 'modes'\n"
      "set ylabel 'one step in free flight, ns per body (median)'\nset yrange [0:*]\nset key left top\nset grid\nplot ";
  for (std::size_t i = 0; i < bodies.size(); ++i)
    plot += fmt::format("{}'data.csv' using ($2=={} ? $1 : NaN):6 with linespoints pt 7 title '{} bodies'",
                        i == 0 ? "" : ", ", bodies[i], bodies[i]);
  return svg_by_gnuplot({760, 480}, csv_of(rows), plot);
}

void check(const StepArguments& a) {
  for (const int n : a.bodies)
    if (n < 1 || n > 1'000'000) throw InvalidArgument(fmt::format("--bodies: is {}, expected 1 to 1000000", n));
  for (const int k : a.modes)
    if (k < 0 || k > 1000) throw InvalidArgument(fmt::format("--modes: is {}, expected 0 to 1000", k));
}

std::string text_of(const StepRow& r) {
  return fmt::format("{:>6} {:>7} {:>9} {:>14.1f} {:>14.2f} {:>18.2f} {:>13.1e}\n", r.modes, r.bodies, r.vertices,
                     per_body_ns(r.advance_median, r), per_vertex_ns(r.positions, r), per_vertex_ns(r.normals, r),
                     r.energy_drift);
}

void benchmark_step(Program& program, const StepArguments& a) {
  check(a);
  program.print(fmt::format("{:>6} {:>7} {:>9} {:>14} {:>14} {:>18} {:>13}\n", "modes", "bodies", "vertices",
                            "step ns/body", "positions ns/v", "with normals ns/v", "energy drift"));
  if (!a.asset.empty()) program.add_input(a.asset);
  std::vector<StepRow> rows;
  for (const auto& model : models(a))
    for (const int bodies : a.bodies) {
      program.progress().stage(fmt::format("{} modes, {} bodies", model->modes(), bodies));
      rows.push_back(measure(model, bodies, a));
      program.print(text_of(rows.back()));
    }
  Json& report = program.report();
  report["benchmark"] = "step";
  report["step"] = a.step;
  report["model"] = a.asset.empty() ? "synthetic" : std::filesystem::path(a.asset).filename().string();
  report["seconds"]["rows"] = Json::array();
  for (const StepRow& r : rows) report["seconds"]["rows"].push_back(json_row(r));
  if (!a.csv.empty()) program.write_file(a.csv, csv_of(rows));
  if (!a.plot.empty()) write_plot(program, a.plot, svg_of(rows, a.bodies));
}

void declare_step(CLI::App& app, StepArguments& a) {
  app.add_option("--asset", a.asset, "model to use; default: synthetic ones")->type_name("ASSET.glb");
  app.add_option("--modes", a.modes, "modes of the synthetic models")
      ->type_name("K,...")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--bodies", a.bodies, "instances in the world")
      ->type_name("N,...")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--vertices", a.vertices, "vertices of the synthetic models")
      ->type_name("N")
      ->check(CLI::Range(40, 10'000'000))
      ->capture_default_str();
  app.add_option("--step", a.step, "step length")->type_name("S")->check(positive_number())->capture_default_str();
  app.add_option("--seconds", a.seconds_per_row, "time spent on each figure")
      ->type_name("S")
      ->check(positive_number())
      ->capture_default_str();
  app.add_option("--csv", a.csv, "write the table")->type_name("FILE.csv");
  app.add_option("--plot", a.plot, "plot step time against modes (needs gnuplot)")->type_name("FILE.svg");
}

}  // namespace

std::function<void(Program&)> add_step(CLI::App& programs) {
  const auto arguments = std::make_shared<StepArguments>();
  CLI::App* app =
      programs.add_subcommand("step", "free flight: one step, and reconstruction, per body, mode and vertex");
  declare_step(*app, *arguments);
  return [arguments, app](Program& program) {
    if (app->parsed()) benchmark_step(program, *arguments);
  };
}

}  // namespace limber::tools
