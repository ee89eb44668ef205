// Time of a step of World under constraints: points of one body dragged together, and a chain of links. See README.md.
#include <benchmark/benchmark.h>

#include <Eigen/QR>
#include <cmath>
#include <random>
#include <vector>

#include "cpu_time.h"
#include "limber/engine/world.h"
#include "limber/precompute/bake.h"
#include "sample_models.h"
#include "tet_box.h"

namespace limber {
namespace {

/// A rubber box of 6 × 4 × 4 cells: 130 vertices on its surface.
std::shared_ptr<const ModalModel> baked_box(int modes) {
  BakeOptions o;
  o.materials = {{"*", Material{.youngs_modulus = 5e6, .poisson_ratio = 0.4, .density = 1100.0}}};
  o.analysis.modes = o.limits.max_modes = modes;
  o.damping = RayleighDamping::from_ratio(0.03, 50.0, 500.0);
  Warnings warnings;
  return bake({.name = "box", .mesh = testing::tet_box(6, 4, 4, {0.3, 0.2, 0.2})}, o, warnings).asset.bodies[0];
}

/// Points of a body dragged together, each along its own way.
class Drag {
 public:
  Drag(int points, int modes) {
    const auto model = baked_box(modes);
    body_ = world.add_body(model);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    const auto triangles = model->collision().triangles.size();
    for (int i = 0; i < points; ++i) {
      const double a = unit(random), b = (1.0 - a) * unit(random);
      const auto triangle = static_cast<Index>(static_cast<double>(triangles) * unit(random));
      const SurfacePoint at{
          .surface = SurfacePoint::Surface::kCollision, .triangle = triangle, .weight = {a, b, 1.0 - a - b}};
      hands_.push_back({world.add_handle(body_, at), at, world.position(body_, at)});
    }
    const double root_mass = std::sqrt(model->data().mass);
    for (int m = 0; m < modes; ++m) bend_.push_back(2e-3 * root_mass * (unit(random) - 0.5));
  }

  /// The hands ask for a translation and a swinging bend of all modes: feasible for any number of them.
  void aim() {
    const double t = world.time() + world.options().step;
    std::vector<double> z;
    for (std::size_t m = 0; m < bend_.size(); ++m) z.push_back(bend_[m] * std::sin(2.0 * t));
    for (const Hand& hand : hands_)
      world.set_handle_target(hand.id, {.position = hand.start + t * Vec3(0.02, -0.01, 0.03) +
                                                    displacement(world.model(body_), hand.at, z)});
  }

  /// Rank of the rows of all hands on the body's freedoms.
  Eigen::Index rank() const {
    const Index modes = world.model(body_).modes();
    Eigen::MatrixXd rows(3 * static_cast<Eigen::Index>(hands_.size()), 6 + modes);
    for (std::size_t h = 0; h < hands_.size(); ++h) {
      const auto row = 3 * static_cast<Eigen::Index>(h);
      rows.block<3, 3>(row, 0).setIdentity();
      for (int axis = 0; axis < 3; ++axis) rows.block<3, 1>(row, 3 + axis) = Vec3::Unit(axis).cross(hands_[h].start);
      for (Index m = 0; m < modes; ++m) rows.block<3, 1>(row, 6 + m) = shape_at(world.model(body_), hands_[h].at, m);
    }
    return rows.colPivHouseholderQr().rank();
  }
  double error() const {
    double worst = 0.0;
    for (const Hand& hand : hands_) worst = std::max(worst, world.handle(hand.id).error);
    return worst;
  }

  World world;

 private:
  struct Hand {
    HandleId id;
    SurfacePoint at;
    Vec3 start;
  };
  BodyId body_;
  std::vector<Hand> hands_;
  std::vector<double> bend_;
};

/// range(0) points dragged, range(1) modes.
void drag(benchmark::State& state) {
  Drag drag(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  const auto frame = [&](LeastTime& time) {
    drag.aim();
    time.measure([&] { drag.world.step(); });
  };
  LeastTime warm, time;
  for (int i = 0; i < 10; ++i) frame(warm);
  for (auto _ : state) frame(time);
  state.counters["us_per_step"] = 1e6 * time.seconds();
  state.counters["iterations"] = drag.world.constraint_report().iterations;
  state.counters["rank"] = static_cast<double>(drag.rank());
  state.counters["error_m"] = drag.error();
}
BENCHMARK(drag)->ArgNames({"points", "modes"})->ArgsProduct({{1, 10, 100, 300}, {40}});

/// range(0) links on hinges, range(1) modes of each.
void chain(benchmark::State& state) {
  const auto links = static_cast<int>(state.range(0)), modes = static_cast<int>(state.range(1));
  World world({.step = 1.0 / 240.0});
  const auto model = testing::sample_model({.modes = modes, .lowest_hz = 50.0, .decay = 1.0});
  JointSpec hinge{.type = JointType::kRevolute};
  hinge.frame.axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  BodyId last{};
  for (int i = 0; i < links; ++i) {
    const BodyId link = world.add_body(model, {.pose = {.p = {0.6 * i + 0.3, 0, 0}}});
    hinge.frame.origin = {0.6 * i, 0, 0};
    world.add_joint(last, link, hinge, {.radius = 0.25}, {.radius = 0.25});
    last = link;
  }
  for (int i = 0; i < 10; ++i) world.step();
  LeastTime time;
  for (auto _ : state) time.measure([&] { world.step(); });
  state.counters["us_per_step"] = 1e6 * time.seconds();
  state.counters["iterations"] = world.constraint_report().iterations;
}
BENCHMARK(chain)->ArgNames({"links", "modes"})->ArgsProduct({{1, 4, 16}, {0, 10}});

}  // namespace
}  // namespace limber
