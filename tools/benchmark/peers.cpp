// limber-benchmark peers: the same work in limber, Box3D, Bullet and MuJoCo, in one run.
#include "peers.h"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>

#include "benchmarks.h"
#include "cpu_time.h"
#include "growing_table.h"
#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#include "limber/core/error.h"
#include "limber/engine/world.h"
#include "peers_bar.h"
#include "program.h"
#include "scene_bodies.h"
#include "scene_cost.h"
#include "scene_library.h"

namespace limber::tools {
namespace {

using Json = nlohmann::ordered_json;

struct PeersArguments {
  int substeps = SmallSteps{}.substeps, bodies = 100, seconds = 6, modes = 20, copies = 4;
  std::vector<int> vertices{0, 1000};
  std::vector<std::string> scenes{"boxes", "mixed"}, solvers{"game"};
  std::string csv;
  bool skip_piles = false, skip_reduced = false;
};

// Piles
// -----------------------------------------------------------------------------------------------------------------

/// A pile of the library, all its bodies rigid and without rolling resistance.
struct LibraryPile {
  Scene scene;
  SceneModels models;
  RigidPile pile;
};

LibraryPile library_pile(scenes::SceneLibrary& library, const std::string& name, int bodies) {
  const scenes::LibraryScene made = library.scene(name, {.bodies = bodies});
  LibraryPile out{.scene = made.parsed(), .models = {}, .pile = {}};
  out.scene.contacts.options->rolling_friction = 0.0;
  const auto brick = std::make_shared<const Shape>(Box{.half_extents = 0.5 * scenes::body_size("brick")});
  for (SceneBody& body : out.scene.bodies) {
    auto& shape = std::get<std::shared_ptr<const Shape>>(body.shape);
    if (!shape) shape = brick;
  }
  out.models = make_models(out.scene, made.assets);
  out.pile.friction = out.scene.contacts.options->friction;
  out.pile.step = out.scene.step;
  out.pile.gravity = out.scene.gravity;
  for (std::size_t i = 0; i < out.scene.bodies.size(); ++i) {
    const ModalModelData& data = out.models.of_body[i]->data();
    out.pile.bodies.push_back(
        {out.models.shape_of_body[i], out.scene.bodies[i].placement.pose, data.mass, data.inertia.diagonal()});
  }
  for (const SceneStatic& s : out.scene.statics) {
    const Vec3 normal = s.pose.q * Vec3(Vec3::UnitZ());
    out.pile.planes.push_back({normal, normal.dot(s.pose.p)});
  }
  return out;
}

std::unique_ptr<ContactSource> finder_for(ContactSolver solver) {
  if (solver == ContactSolver::kGame) return std::make_unique<ManifoldFinder>();
  return std::make_unique<ContactFinder>();
}

class LimberPile final : public PileEngine {
 public:
  LimberPile(const LibraryPile& made, ContactSolver solver, int substeps)
      : finder_(finder_for(solver)), world_({.step = made.scene.step, .gravity = made.scene.gravity}) {
    ContactOptions options = *made.scene.contacts.options;
    options.solver = solver;
    options.small_steps.substeps = substeps;
    world_.set_contact_source(finder_.get(), options);
    for (std::size_t i = 0; i < made.scene.bodies.size(); ++i) {
      BodyPlacement placement = made.scene.bodies[i].placement;
      placement.shape = made.models.shape_of_body[i];
      bodies_.push_back(world_.add_body(made.models.of_body[i], placement));
    }
    for (std::size_t i = 0; i < made.scene.statics.size(); ++i)
      world_.add_static(made.models.shape_of_static[i], made.scene.statics[i].pose);
    world_.set_contact_veto([this](const ContactPoint& contact) {
      ++seen_.contacts;
      seen_.deepest = std::max(seen_.deepest, -contact.gap);
      return true;
    });
  }
  PileStep step() override {
    seen_ = {};
    const double began = thread_seconds();
    world_.step();
    seen_.seconds = thread_seconds() - began;
    return seen_;
  }
  PileMotion motion(std::size_t body) const override {
    const BodyView seen = world_.body(bodies_[body]);
    return {seen.pose, seen.velocity, seen.angular_velocity};
  }

 private:
  std::unique_ptr<ContactSource> finder_;
  World world_;
  std::vector<BodyId> bodies_;
  PileStep seen_;
};

constexpr double kSize = 0.3;  // m, of the bodies

/// Figures of an engine's pile over a span of time. Lengths over the bodies' size, energy over Σ m g size.
struct PileRow {
  std::string scene, engine;
  int from = 0, to = 0;                                     // s
  double mean = 0.0, median = 0.0, p99 = 0.0, worst = 0.0;  // s
  double contacts = 0.0, deepest = 0.0, moved = 0.0, rise = 0.0;
};

double energy_of(const PileEngine& engine, const RigidPile& pile) {
  double sum = 0.0;
  for (std::size_t i = 0; i < pile.bodies.size(); ++i) {
    const RigidPile::Body& body = pile.bodies[i];
    const PileMotion motion = engine.motion(i);
    const Vec3 turning = motion.pose.q.conjugate() * motion.angular_velocity;
    sum += 0.5 * body.mass * motion.velocity.squaredNorm() + 0.5 * turning.dot(body.inertia.cwiseProduct(turning)) -
           body.mass * pile.gravity.dot(motion.pose.p);
  }
  return sum;
}

double energy_scale(const RigidPile& pile) {
  double mass = 0.0;
  for (const RigidPile::Body& body : pile.bodies) mass += body.mass;
  return mass * pile.gravity.norm() * kSize;
}

void set_times(PileRow& row, const std::vector<double>& times) {
  row.mean = std::accumulate(times.begin(), times.end(), 0.0) / static_cast<double>(times.size());
  row.median = quantile(times, 0.5), row.p99 = quantile(times, 0.99), row.worst = quantile(times, 1.0);
}

/// The next second of a pile. @param all its steps' times are added here
PileRow run_second(PileEngine& engine, const RigidPile& pile, std::vector<double>& all) {
  const int steps = static_cast<int>(std::lround(1.0 / pile.step));
  PileRow row;
  std::vector<Vec3> before;
  for (std::size_t i = 0; i < pile.bodies.size(); ++i) before.push_back(engine.motion(i).pose.p);
  std::vector<double> times;
  double energy = energy_of(engine, pile);
  for (int n = 0; n < steps; ++n) {
    const PileStep seen = engine.step();
    times.push_back(seen.seconds);
    row.contacts += static_cast<double>(seen.contacts) / steps;
    row.deepest = std::max(row.deepest, seen.deepest / kSize);
    const double now = energy_of(engine, pile);
    row.rise = std::max(row.rise, (now - energy) / energy_scale(pile));
    energy = now;
  }
  for (std::size_t i = 0; i < before.size(); ++i)
    row.moved = std::max(row.moved, (engine.motion(i).pose.p - before[i]).norm() / kSize);
  set_times(row, times);
  all.insert(all.end(), times.begin(), times.end());
  return row;
}

std::string text_of(const PileRow& r) {
  return fmt::format(
      "{:<6} {:<7} {:>2}-{:<2} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.1f} {:>9.1e} {:>9.1e} {:>9.1e}\n", r.scene,
      r.engine, r.from, r.to, 1e3 * r.mean, 1e3 * r.median, 1e3 * r.p99, 1e3 * r.worst, r.contacts, r.deepest, r.moved,
      r.rise);
}

std::string pile_head() {
  return fmt::format("{:<6} {:<7} {:>5} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}\n", "scene", "engine", "s",
                     "mean", "p50", "p99", "worst", "contacts", "depth", "moved", "rise");
}

/// A pile's seconds in one row: times of all steps, what it moved in the last second, the rest at its worst.
PileRow summary_of(const std::vector<PileRow>& seconds, const std::vector<double>& times) {
  PileRow whole = seconds.front();
  whole.to = seconds.back().to;
  whole.contacts = 0.0;
  for (const PileRow& row : seconds) {
    whole.contacts += row.contacts / static_cast<double>(seconds.size());
    whole.deepest = std::max(whole.deepest, row.deepest), whole.rise = std::max(whole.rise, row.rise);
  }
  whole.moved = seconds.back().moved;
  set_times(whole, times);
  return whole;
}

/// Rows of seconds, and of the wholes.
struct PileTable {
  std::vector<PileRow> seconds, wholes;
};

std::string csv_of(const PileRow& r, int bodies) {
  return fmt::format("{},{},{},{},{},,,{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},{:.3g},{:.3g},{:.3g}", r.scene, r.engine,
                     r.from, r.to, bodies, 1e6 * r.mean, 1e6 * r.median, 1e6 * r.p99, 1e6 * r.worst, r.contacts,
                     r.deepest, r.moved, r.rise);
}

void run_pile(Program& program, PileEngine& engine, const RigidPile& pile, const PileRow& named, int seconds,
              PileTable& table, GrowingTable& csv) {
  std::vector<double> times;
  std::vector<PileRow> rows;
  for (int second = 0; second < seconds; ++second) {
    program.progress().stage(fmt::format("{}, {}: second {} of {}", named.scene, named.engine, second + 1, seconds));
    PileRow row = run_second(engine, pile, times);
    row.scene = named.scene, row.engine = named.engine, row.from = second, row.to = second + 1;
    program.print(text_of(row));
    csv.add(csv_of(row, static_cast<int>(pile.bodies.size())));
    rows.push_back(row);
  }
  table.wholes.push_back(summary_of(rows, times));
  table.seconds.insert(table.seconds.end(), rows.begin(), rows.end());
}

PileTable run_piles(Program& program, const PeersArguments& a, GrowingTable& csv) {
  program.print(fmt::format(
      "{} rigid bodies that fall into a pit, sleeping off; ms a step of this thread; depth and way over the size, rise "
      "of energy in a step over the sum of m g size\n",
      a.bodies));
  program.print(pile_head());
  scenes::SceneLibrary library;
  PileTable table;
  for (const std::string& scene : a.scenes) {
    const LibraryPile made = library_pile(library, scene, a.bodies);
    const auto play = [&](const std::string& name, std::unique_ptr<PileEngine> engine) {
      run_pile(program, *engine, made.pile, {.scene = scene, .engine = name}, a.seconds, table, csv);
    };
    for (const std::string& solver : a.solvers)
      play(solver == "game" ? "limber" : "exact",
           std::make_unique<LimberPile>(made, solver == "game" ? ContactSolver::kGame : ContactSolver::kExact,
                                        a.substeps));
#if LIMBER_HAS_BOX3D
    play("Box3D", box3d_pile(made.pile));
#endif
#if LIMBER_HAS_BULLET
    play("Bullet", bullet_pile(made.pile));
#endif
#if LIMBER_HAS_MUJOCO
    play("MuJoCo", mujoco_pile(made.pile));
#endif
  }
  program.print("\nthe whole of each; moved: in the last second\n" + pile_head());
  for (const PileRow& row : table.wholes) program.print(text_of(row));
  return table;
}

// The reduced body
// --------------------------------------------------------------------------------------------------------

struct ReducedRow {
  std::string scene, engine;
  std::size_t nodes = 0;
  int modes = 0, bodies = 0;
  ReducedCost cost;
};

std::string text_of(const ReducedRow& r) {
  return fmt::format("{:<7} {:<28} {:>6} {:>5} {:>6} {:>12.2f} {:>9.1f}{}\n", r.scene, r.engine, r.nodes, r.modes,
                     r.bodies, 1e6 * r.cost.seconds / r.bodies, r.cost.contacts, r.cost.is_finite ? "" : " not finite");
}

std::string csv_of(const ReducedRow& r) {
  return fmt::format("{},\"{}\",,,{},{},{},,{:.4g},,,{:.4g},,,", r.scene, r.engine, r.bodies, r.nodes, r.modes,
                     1e6 * r.cost.seconds, r.cost.contacts);
}

std::vector<ReducedRow> run_reduced(Program& program, const PeersArguments& a, GrowingTable& csv) {
  program.print(
      fmt::format("\na bar on the same modes, positions of the surface included, highest mode at 0.5 of omega dt; us a "
                  "step and body\n"
                  "{:<7} {:<28} {:>6} {:>5} {:>6} {:>12} {:>9}\n",
                  "scene", "engine", "nodes", "modes", "bodies", "us", "contacts"));
  std::vector<ReducedRow> rows;
  for (const int vertices : a.vertices)
    for (const bool on_ground : {false, true})
      for (const int bodies : {1, a.copies}) {
        const ReducedRun run{.bodies = bodies, .steps = on_ground ? 40 : 200, .on_ground = on_ground};
        const Bar bar = make_bar(a.modes, vertices, run.step);
        const std::string scene = on_ground ? "ground" : "flight";
        const auto add = [&](const std::string& engine, std::size_t nodes, const ReducedCost& cost) {
          rows.push_back({scene, engine, nodes, static_cast<int>(bar.model->modes()), bodies, cost});
          program.print(text_of(rows.back()));
          csv.add(csv_of(rows.back()));
          program.progress().stage(fmt::format("{}, {} bodies of about {} vertices", scene, bodies, vertices));
        };
        program.progress().stage(scene);
        add("limber", bar.surface.nodes.size(), run_limber(bar, run));
#if LIMBER_HAS_BULLET
        add("Bullet, the surface alone", bar.surface.nodes.size(), run_bullet(bar.surface, run));
        if (vertices == 0) add("Bullet, all nodes and tets", bar.nodes.nodes.size(), run_bullet(bar.nodes, run));
#endif
      }
  return rows;
}

// The whole
// ---------------------------------------------------------------------------------------------------------------

/// Cases in which a peer takes less time than limber, in words.
std::vector<std::string> better_peers(const std::vector<PileRow>& piles, const std::vector<ReducedRow>& reduced) {
  std::vector<std::string> out;
  for (const PileRow& own : piles)
    for (const PileRow& r : piles)
      if (own.engine == "limber" && r.engine != "limber" && r.scene == own.scene && r.from == own.from &&
          r.median < own.median)
        out.push_back(fmt::format(
            "{}, second {}: {} takes {:.2g} of limber's time; it overlaps by {:.1e} of the size, limber by {:.1e}",
            r.scene, r.to, r.engine, r.median / own.median, r.deepest, own.deepest));
  for (const ReducedRow& own : reduced)
    for (const ReducedRow& r : reduced)
      if (own.engine.starts_with("limber") && !r.engine.starts_with("limber") && r.scene == own.scene &&
          r.bodies == own.bodies && r.nodes == own.nodes && r.cost.seconds < own.cost.seconds)
        out.push_back(fmt::format("{}, {} bodies of {} nodes: {} takes {:.2g} of the time of {}", r.scene, r.bodies,
                                  r.nodes, r.engine, r.cost.seconds / own.cost.seconds, own.engine));
  return out;
}

Json json_of(const PileRow& r) {
  return {
      {"scene", r.scene},       {"engine", r.engine},           {"from", r.from},           {"to", r.to},
      {"step_mean", r.mean},    {"step_median", r.median},      {"step_p99", r.p99},        {"step_worst", r.worst},
      {"contacts", r.contacts}, {"deepest_of_size", r.deepest}, {"moved_of_size", r.moved}, {"rise_of_scale", r.rise}};
}

Json json_of(const ReducedRow& r) {
  return {{"scene", r.scene},
          {"engine", r.engine},
          {"nodes", r.nodes},
          {"modes", r.modes},
          {"bodies", r.bodies},
          {"step_median", r.cost.seconds},
          {"contacts", r.cost.contacts},
          {"finite", r.cost.is_finite}};
}

void benchmark_peers(Program& program, const PeersArguments& a) {
  GrowingTable csv(
      a.csv,
      "scene,engine,from_s,to_s,bodies,nodes,modes,us_mean,us_p50,us_p99,us_worst,contacts,deepest_of_size,"
      "moved_of_size,rise_of_scale");
  const PileTable piles = a.skip_piles ? PileTable{} : run_piles(program, a, csv);
  const std::vector<ReducedRow> reduced = a.skip_reduced ? std::vector<ReducedRow>{} : run_reduced(program, a, csv);
  Json& report = program.report();
  report["benchmark"] = "peers";
  Json& seconds = report["seconds"];
  seconds["piles"] = seconds["whole_piles"] = seconds["reduced_bodies"] = Json::array();
  for (const PileRow& r : piles.seconds) seconds["piles"].push_back(json_of(r));
  for (const PileRow& r : piles.wholes) seconds["whole_piles"].push_back(json_of(r));
  for (const ReducedRow& r : reduced) seconds["reduced_bodies"].push_back(json_of(r));
  const std::vector<std::string> better = better_peers(piles.seconds, reduced);
  program.print(better.empty() ? "\nno peer is faster anywhere\n" : "\nwhere a peer is faster:\n");
  for (const std::string& line : better) program.print("  " + line + "\n");
  seconds["faster_peers"] = better;
  csv.finish(program);
}

void declare_peers(CLI::App& app, PeersArguments& a) {
  const auto add = [&](const char* option, int& value, int most, const char* what) {
    app.add_option(option, value, what)->type_name("N")->check(CLI::Range(1, most))->capture_default_str();
  };
  app.add_option("--scene", a.scenes, "piles: boxes, mixed")
      ->type_name("NAME,...")
      ->delimiter(',')
      ->check(CLI::IsMember({"boxes", "mixed"}))
      ->capture_default_str();
  add("--bodies", a.bodies, 10'000, "of the piles");
  app.add_option("--solver", a.solvers, "limber's, of the piles: game, told as limber; exact")
      ->type_name("NAME,...")
      ->delimiter(',')
      ->check(CLI::IsMember({"game", "exact"}))
      ->capture_default_str();
  add("--substeps", a.substeps, 1000, "of game");
  add("--seconds", a.seconds, 1000, "that the piles are played");
  add("--modes", a.modes, 200, "of the reduced body");
  add("--copies", a.copies, 10'000, "of the reduced body, beside one alone");
  app.add_option("--vertices", a.vertices, "of the reduced body's surface, about; 0: the mesh's own")
      ->type_name("N,...")
      ->delimiter(',')
      ->capture_default_str();
  auto* no_piles = app.add_flag("--no-piles", a.skip_piles, "leave out the piles");
  app.add_flag("--no-reduced", a.skip_reduced, "leave out the reduced body")->excludes(no_piles);
  app.add_option("--csv", a.csv, "write the tables as one; rows stand in FILE.csv.part as they come")
      ->type_name("FILE.csv");
}

}  // namespace

std::function<void(Program&)> add_peers(CLI::App& programs) {
  const auto arguments = std::make_shared<PeersArguments>();
  CLI::App* app =
      programs.add_subcommand("peers", "the same work in other engines that were found when this was built");
  declare_peers(*app, *arguments);
  return [arguments, app](Program& program) {
    if (app->parsed()) benchmark_peers(program, *arguments);
  };
}

}  // namespace limber::tools
