// Cost of finding contacts while bodies move: scenes run in a World, every query that it asks is written down, and
// then asked again of a fresh ContactFinder and of a fresh FclContactSource, in the same order, on one thread. Prints
// Markdown: µs of all queries of one step, by the thread's own work, of three runs through the least for each query.
//   collision_steps [SCENE [BUNNY.glb [BESIDE]]]     part of the names of the scenes wanted ("": all), the asset of the
//   bunnies ("": without them); beside ContactFinder: fcl (if nothing is given), alone (nothing), or manifolds
//   (ManifoldFinder, beside all contacts that ContactFinder finds; what game
//   contact asks, once a step)
// Figures: docs/reports/benchmarks.md.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cpu_time.h"
#include "finder_scenes.h"
#include "limber/collision/manifold_finder.h"
#include "limber/collision_fcl/fcl_contact_source.h"
#include "limber/model/asset.h"
#include "limber/precompute/bake.h"
#include "pile.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

constexpr double kStep = 1.0 / 60.0;
constexpr int kPasses = 3;
enum class Beside { kFcl, kNothing, kManifolds };
Beside beside = Beside::kFcl;  // whose finder is asked beside ContactFinder

/// A query with copies of all that it points to.
struct Query {
  std::vector<BodyState> states;
  std::vector<double> numbers;  // amplitudes, and those at the end, body after body
  std::vector<Index> awake;
  double margin = 0.0;
  Vec3 origin = Vec3::Zero();

  explicit Query(const ContactQuery& q)
      : states(q.states.begin(), q.states.end()),
        awake(q.awake.begin(), q.awake.end()),
        margin(q.margin),
        origin(q.origin) {
    for (const BodyState& s : states) {
      numbers.insert(numbers.end(), s.amplitudes.begin(), s.amplitudes.end());
      numbers.insert(numbers.end(), s.end_amplitudes.begin(), s.end_amplitudes.end());
    }
    const double* next = numbers.data();
    const auto own = [&next](std::span<const double>& of) {
      const std::size_t count = of.size();
      of = {next, count};
      next += count;
    };
    for (BodyState& s : states) own(s.amplitudes), own(s.end_amplitudes);
  }
  Query(Query&&) = default;
  Query(const Query&) = delete;

  ContactQuery asked() const { return {.states = states, .margin = margin, .origin = origin, .awake = awake}; }
};

/// Hands all to a finder, and writes down its bodies and its queries.
class Recorder final : public ContactSource {
 public:
  void add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) override {
    finder_.add_body(body, geometry, filter);
    replayed_.emplace_back([=](ContactSource& to) { to.add_body(body, geometry, filter); });
  }
  void remove_body(Index) override { throw std::logic_error("Recorder: bodies stay"); }
  void set_filter(Index, const CollisionFilter&) override { throw std::logic_error("Recorder: filters stay"); }
  void exclude_pair(Index a, Index b, bool excluded) override {
    finder_.exclude_pair(a, b, excluded);
    replayed_.emplace_back([=](ContactSource& to) { to.exclude_pair(a, b, excluded); });
  }
  void find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) override {
    queries_.emplace_back(query);
    finder_.find_contacts(query, contacts, jobs);
  }
  void save_state(StateWriter& state) const override { finder_.save_state(state); }
  void restore_state(StateReader& state) override { finder_.restore_state(state); }

  std::size_t queries() const { return queries_.size(); }

  struct Cost {
    double seconds = 1e30;
    std::size_t contacts = 0;
  };
  template <class Source>
  std::vector<Cost> replay() const {
    std::vector<Cost> costs(queries_.size());
    std::vector<ContactPoint> contacts;
    for (int pass = 0; pass < kPasses; ++pass) {
      Source finder;
      for (const auto& make : replayed_) make(finder);
      for (std::size_t q = 0; q < queries_.size(); ++q) {
        ContactQuery query = queries_[q].asked();
        const double start = thread_seconds();
        finder.find_contacts(query, contacts, serial_jobs());
        costs[q].seconds = std::min(costs[q].seconds, thread_seconds() - start);
        costs[q].contacts = contacts.size();
      }
    }
    return costs;
  }

 private:
  ContactFinder finder_;
  std::vector<std::function<void(ContactSource&)>> replayed_;
  std::vector<Query> queries_;
};

/// A span of a scene's steps that gets a row.
struct Phase {
  std::string name;
  int steps;
};

/// Times of all queries of each step, µs ascending.
std::vector<double> times_of_steps(std::span<const Recorder::Cost> costs, std::span<const std::size_t> ends) {
  std::vector<double> times;
  std::size_t begin = 0;
  for (const std::size_t end : ends) {
    double sum = 0.0;
    for (std::size_t q = begin; q < end; ++q) sum += costs[q].seconds;
    times.push_back(1e6 * sum);
    begin = end;
  }
  std::ranges::sort(times);
  return times;
}

double contacts_a_step(std::span<const Recorder::Cost> costs, std::span<const std::size_t> ends) {
  double contacts = 0.0;
  std::size_t begin = 0;
  for (const std::size_t end : ends) {
    if (end > begin) contacts += static_cast<double>(costs[end - 1].contacts);
    begin = end;
  }
  return contacts / static_cast<double>(ends.size());
}

void print_row(const std::string& scene, const std::string& phase, std::span<const Recorder::Cost> costs,
               std::span<const Recorder::Cost> others, std::span<const std::size_t> ends) {
  std::printf("| %s, %s | %zu | %.1f", scene.c_str(), phase.c_str(), ends.size(),
              static_cast<double>(costs.size()) / static_cast<double>(ends.size()));
  std::vector<std::span<const Recorder::Cost>> finders{costs};
  if (beside != Beside::kNothing) finders.push_back(others);
  for (const std::span<const Recorder::Cost> of : finders) {
    const std::vector<double> times = times_of_steps(of, ends);
    const auto last = static_cast<double>(times.size() - 1);
    const auto quantile = [&](double part) { return times[static_cast<std::size_t>(part * last + 0.5)]; };
    std::printf(" | %.0f | %.0f | %.0f | %.0f", contacts_a_step(of, ends), quantile(0.5), quantile(0.99),
                quantile(1.0));
  }
  std::printf(" |\n");
  std::fflush(stdout);
}

/// Steps through the phases, then asks again what was asked. @param step one of the scene
void run(const std::string& name, const Recorder& recorder, const std::vector<Phase>& phases,
         const std::function<void()>& step) {
  std::vector<std::size_t> ends;
  for (const Phase& phase : phases)
    for (int i = 0; i < phase.steps; ++i) {
      step();
      ends.push_back(recorder.queries());
    }
  const bool manifolds = beside == Beside::kManifolds;
  const std::vector<Recorder::Cost> costs = recorder.replay<ContactFinder>();
  const std::vector<Recorder::Cost> others = manifolds                    ? recorder.replay<ManifoldFinder>()
                                             : beside == Beside::kNothing ? costs
                                                                          : recorder.replay<FclContactSource>();
  std::size_t first_step = 0, first_query = 0;
  for (const Phase& phase : phases) {
    const auto count = static_cast<std::size_t>(phase.steps);
    std::vector<std::size_t> of_phase(ends.begin() + static_cast<std::ptrdiff_t>(first_step),
                                      ends.begin() + static_cast<std::ptrdiff_t>(first_step + count));
    const std::size_t end_query = of_phase.back();
    for (std::size_t& end : of_phase) end -= first_query;
    const std::size_t queries = end_query - first_query;
    if (!phase.name.empty())
      print_row(name, phase.name, std::span(costs).subspan(first_query, queries),
                std::span(others).subspan(first_query, queries), of_phase);
    first_step += count, first_query = end_query;
  }
}

std::shared_ptr<const ModalModel> baked(const Vec3& size, const std::array<int, 3>& cells, int modes) {
  BakeOptions o;
  o.materials = {{"*", {.youngs_modulus = 5e6, .poisson_ratio = 0.4, .density = 1100.0}}};
  o.analysis.modes = o.limits.max_modes = modes;
  o.residual.surface = false;
  Warnings warnings;
  const TetMesh mesh = tet_box(cells[0], cells[1], cells[2], size);
  const double lowest = bake({.name = "box", .mesh = mesh}, o, warnings).asset.bodies[0]->data().eigenvalues.front();
  o.damping.stiffness_proportional = 2.0 * 0.03 / std::sqrt(lowest);
  return bake({.name = "box", .mesh = mesh}, o, warnings).asset.bodies[0];
}

/// A world with a recorder on the ground.
struct Scene {
  Recorder recorder;
  World world{{.step = kStep}};
  Scene() {
    world.set_contact_source(&recorder, {.solver = ContactSolver::kExact, .friction = 0.5});
    world.add_static(std::make_shared<const Shape>(HalfSpace{}));
  }
  void run(const std::string& name, const std::vector<Phase>& phases) {
    testing::run(name, recorder, phases, [this] { world.step(); });
  }
};

void hundred_boxes() {
  Pile pile(100, -1, false);
  Recorder recorder;
  pile.world.set_contact_source(&recorder, {.solver = ContactSolver::kExact});
  run("100 boxes", recorder, {{"falling", 120}, {"", 180}, {"at rest", 60}}, [&] { pile.world.step(); });
}

/// Ten in a stack, laid.
void ten_boxes(const std::string& name, const std::array<int, 3>& cells) {
  const Vec3 size(0.4, 0.3, 0.2);
  const auto model = baked(size, cells, 12);
  Scene scene;
  for (int i = 0; i < 10; ++i)
    scene.world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.05 * i}),
                                          {0.012 * (i % 2), 0.01 * (i % 3), 0.5 * size.z() + i * (size.z() + 1e-4)}}});
  scene.run(name, {{"first second", 60}, {"", 60}, {"at rest", 60}});
}

/// In two layers, turned, from a little above the ground.
void eight_bunnies(const std::string& asset) {
  const auto model = read_asset(asset).bodies.at(0);
  const double size = model->collision_extent().radius;
  Random random(1);
  Scene scene;
  for (int i = 0; i < 8; ++i)
    scene.world.add_body(model, {.pose = {random.pose(0.0).q,
                                          {size * (i % 2 == 0 ? -1.0 : 1.0), size * (i / 2 % 2 == 0 ? -1.0 : 1.0),
                                           (1.5 + 2.0 * (i / 4)) * size}}});
  scene.run("8 bunnies", {{"falling", 90}, {"", 180}, {"at rest", 60}});
}

/// 48 × 12 × 12 squares on its faces: 2,594 vertices, 637 of them on the ground.
void long_bar() {
  const Vec3 size(0.8, 0.2, 0.2);
  Scene scene;
  scene.world.add_body(baked(size, {48, 12, 12}, 20), {.pose = {{}, {0.0, 0.0, 0.5 * size.z()}}});
  scene.run("bar of 2,594 vertices", {{"", 30}, {"flat on the ground", 60}});
}

/// Bent balls, boxes and capsules in layers on a floor, which stir by some millimetres.
void stirred_heap() {
  ContactScene scene = heap(1000, 16);
  Recorder recorder;
  scene.add_all_to(recorder);
  std::vector<ContactPoint> contacts;
  int step = 0;
  run("heap of 1,000", recorder, {{"stirred", 30}}, [&] {
    ++step;
    for (std::size_t i = 1; i < scene.poses.size(); ++i)
      scene.poses[i].p.x() += 0.001 * std::sin(0.3 * step + static_cast<double>(i));
    recorder.find_contacts({.states = scene.states(), .margin = 0.005}, contacts, serial_jobs());
  });
}

}  // namespace
}  // namespace limber::testing

int main(int argc, char** argv) try {
  using namespace limber::testing;
  const std::string wanted = argc > 1 ? argv[1] : "", asset = argc > 2 ? argv[2] : "";
  const std::string other = argc > 3 ? argv[3] : "fcl";
  beside = other == "fcl" ? Beside::kFcl : other == "manifolds" ? Beside::kManifolds : Beside::kNothing;
  const bool alone = beside == Beside::kNothing;
  const std::string heading = beside == Beside::kFcl ? " FCL" : " manifolds";
  std::printf(
      "| scene | steps | queries a step | contacts | µs a step, p50 | p99 | worst "
      "|%s\n|---|---|---|---|---|---|---|%s\n",
      alone ? "" : (heading + ": contacts | p50 | p99 | worst |").c_str(), alone ? "" : "---|---|---|---|");
  const std::vector<std::pair<std::string, std::function<void()>>> scenes{
      {"boxes", hundred_boxes},
      {"coarse",
       [] {
         ten_boxes("10 boxes, coarse", {3, 2, 2});
       }},
      {"fine",
       [] {
         ten_boxes("10 boxes, 8 × 6 × 4", {8, 6, 4});
       }},
      {"bar", long_bar},
      {"heap", stirred_heap},
  };
  for (const auto& [name, scene] : scenes)
    if (name.find(wanted) != std::string::npos) scene();
  if (!asset.empty() && std::string("bunnies").find(wanted) != std::string::npos) eight_bunnies(asset);
} catch (const std::exception& error) {
  std::fprintf(stderr, "collision_steps: %s\n", error.what());
  return 1;
}
