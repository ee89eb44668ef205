// What small calls cost from C++: call_times.py asks for the same ones and takes the difference. Prints lines "NAME
// µs".
#include <cstdio>
#include <memory>

#include "cpu_time.h"
#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"
#include "limber/model/soft_bodies.h"

namespace limber {
namespace {

constexpr int kRounds = 100, kCalls = 200;

template <class Call>
void tell(const char* name, const Call& call) {
  LeastTime time;
  for (int round = 0; round < kRounds; ++round)
    time.measure([&] {
      for (int i = 0; i < kCalls; ++i) call();
    });
  std::printf("%s %.4f\n", name, 1e6 * time.seconds() / kCalls);
}

volatile double sink = 0.0;  // so that no answer is left out

void tell_all() {
  ManifoldFinder finder;
  World world({.gravity = Vec3::Zero()});
  world.set_contact_source(&finder);
  world.add_static(std::make_shared<Shape>(HalfSpace{}));
  const auto model = make_soft_ball(0.3, 6, material_preset("jelly"), 12, 0.02);
  const BodyId ball = world.add_body(model, {.pose = {.p = {0, 0, 1}}});
  const SurfacePoint at{.triangle = 5};
  std::vector<float> positions(static_cast<std::size_t>(model->render().vertices()) * 3);
  tell("step", [&] { world.step(); });
  tell("position", [&] { sink = world.body(ball).pose.p.x(); });
  tell("amplitudes", [&] { sink = world.body(ball).amplitudes[0]; });
  tell("energy", [&] { sink = world.energy(ball).elastic; });
  tell("point_position", [&] { sink = world.position(ball, at).x(); });
  tell("set_velocity", [&] { world.set_velocity(ball, Vec3::Zero(), Vec3::Zero()); });
  tell("apply_force", [&] { world.apply_force(ball, at, Vec3::Zero(), Axes::kWorld); });
  tell("cast_ray", [&] { sink = world.cast_ray({.from = {0, 0, 5}, .way = {0, 0, -9}})->distance; });
  tell("vertices", [&] { world.reconstruct(ball, positions, {}); });
}

}  // namespace
}  // namespace limber

int main() { limber::tell_all(); }
