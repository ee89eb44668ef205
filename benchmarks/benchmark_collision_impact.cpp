// Time of one time-of-impact query, of a motion's bounds and of its evaluation: pairs that are far apart, that pass
// each other near by, and that hit. See README.md.
#include <benchmark/benchmark.h>

#include <cmath>
#include <memory>
#include <vector>

#include "cpu_time.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/narrow_phase.h"
#include "limber/collision/time_of_impact.h"
#include "limber/dynamics/body_group.h"
#include "sheet_model.h"

namespace limber {
namespace {

constexpr double kStep = 1.0 / 60.0, kMargin = 1e-4;
constexpr int kCells = 24;  // 2,496 triangles
const Vec3 kGravity{0.0, 0.0, -9.80665};

/// A vibrating sheet whose modes have equal energies, the lowest swinging by a millimetre.
struct Sheet {
  Sheet(const std::shared_ptr<const ModalModel>& model, const RigidTransform& pose, const Vec3& velocity,
        const Vec3& angular_velocity)
      : group(model, kStep), surface(std::make_shared<const CollisionSurface>(model)) {
    const Index slot = group.add(pose, velocity, angular_velocity);
    const double rate = 5e-4 * std::sqrt(model->data().eigenvalues[0]);
    std::vector<double> z, rates;
    for (const double lambda : model->data().eigenvalues) {
      z.push_back(rate / std::sqrt(lambda));
      rates.push_back(rate);
    }
    group.set_amplitudes(slot, z, rates);
    group.predict_motion(slot, kGravity, motion);
  }
  MovingBody body() const { return {.surface = surface, .motion = &motion}; }
  BodyGroup group;
  std::shared_ptr<const CollisionSurface> surface;
  ExactMotion motion;
};

enum class Encounter { kFar, kNear, kHit };

void report(benchmark::State& state, const MovingBody& a, const MovingBody& b) {
  TimeOfImpact solver;
  ImpactTime t;
  LeastTime time;
  constexpr int kRepeats = 20;
  for (auto _ : state)
    time.measure([&] {
      for (int i = 0; i < kRepeats; ++i) t = solver.find(a, b, kStep, kMargin);
    });
  state.counters["ns"] = 1e9 * time.seconds() / kRepeats;
  state.counters["advancements"] = t.advancements;
  state.counters["hit"] = t.status == ImpactTime::Status::kImpact ? 1.0 : 0.0;
}

/// A ball of 1 cm at 50 m/s and a sheet: far above, along it at 1 cm, straight into it. range(0) modes.
void ball_and_sheet(benchmark::State& state, Encounter encounter) {
  const auto model = testing::sheet_model(kCells, static_cast<int>(state.range(0)));
  const Sheet sheet(model, {}, {0.5, 0.0, 0.0}, {0.1, 0.2, 1.0});
  const double height = encounter == Encounter::kFar ? 20.0 : encounter == Encounter::kNear ? 0.02 : 0.4;
  const Vec3 velocity = encounter == Encounter::kHit ? Vec3(5.0, 2.0, -50.0) : Vec3(50.0, 0.0, 0.0);
  const RigidGeometry ball{Sphere{0.01}};
  ExactMotion shot;
  shot.set_frame({.pose = {.p = {-0.4, 0.03, height}}, .velocity = velocity, .acceleration = kGravity}, kStep);
  report(state, {.geometry = &ball, .motion = &shot}, sheet.body());
}

/// Two sheets: far apart, one sliding over the other at 2 cm, edge on into the other's middle.
void two_sheets(benchmark::State& state, Encounter encounter) {
  const auto model = testing::sheet_model(kCells, static_cast<int>(state.range(0)));
  const double height = encounter == Encounter::kFar ? 20.0 : encounter == Encounter::kNear ? 0.02 : 0.8;
  const Vec3 velocity = encounter == Encounter::kHit ? Vec3(1.0, 0.0, -30.0) : Vec3(20.0, 0.0, 0.0);
  const Quaternion upright = quaternion_from_rotation_vector({encounter == Encounter::kHit ? 1.4 : 0.0, 0.0, 0.3});
  const Sheet lower(model, {}, {0.5, 0.0, 0.0}, {0.1, 0.2, 1.0});
  const Sheet upper(model, {upright, {-0.3, 0.1, height}}, velocity, {0.1, 0.2, 0.5});
  report(state, upper.body(), lower.body());
}

/// evaluate() and bounds() of one body. range(0) modes.
void motion_state(benchmark::State& state) {
  const Sheet sheet(testing::sheet_model(2, static_cast<int>(state.range(0))), {}, {0.5, 0.0, 1.0}, {0.1, 0.2, 1.0});
  MotionState at;
  MotionBounds bounds;
  LeastTime evaluating, bounding;
  constexpr int kRepeats = 1000;
  for (auto _ : state) {
    evaluating.measure([&] {
      for (int i = 0; i < kRepeats; ++i) sheet.motion.evaluate(kStep * (i + 0.5) / kRepeats, at);
    });
    bounding.measure([&] {
      for (int i = 0; i < kRepeats; ++i) sheet.motion.bounds(at, kStep, bounds);
    });
  }
  state.counters["evaluate_ns"] = 1e9 * evaluating.seconds() / kRepeats;
  state.counters["bounds_ns"] = 1e9 * bounding.seconds() / kRepeats;
}

BENCHMARK(motion_state)->Arg(8)->Arg(32)->Arg(64);
BENCHMARK_CAPTURE(ball_and_sheet, far, Encounter::kFar)->Arg(8)->Arg(32)->Arg(64);
BENCHMARK_CAPTURE(ball_and_sheet, near, Encounter::kNear)->Arg(8)->Arg(32)->Arg(64);
BENCHMARK_CAPTURE(ball_and_sheet, hit, Encounter::kHit)->Arg(8)->Arg(32)->Arg(64);
BENCHMARK_CAPTURE(two_sheets, far, Encounter::kFar)->Arg(8)->Arg(32)->Arg(64);
BENCHMARK_CAPTURE(two_sheets, near, Encounter::kNear)->Arg(8)->Arg(32)->Arg(64);
BENCHMARK_CAPTURE(two_sheets, hit, Encounter::kHit)->Arg(8)->Arg(32)->Arg(64);

}  // namespace
}  // namespace limber
