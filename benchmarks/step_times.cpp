// What a step of ten soft bodies costs from C++: npm_times.mjs plays the same scenes by WebAssembly. Prints lines
// "SCENE µs".
#include <array>
#include <cstdio>
#include <memory>

#include "cpu_time.h"
#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"
#include "limber/model/soft_bodies.h"

namespace limber {
namespace {

void tell(const char* name, World& world) {
  for (int i = 0; i < 600; ++i) world.step();
  LeastTime time;
  for (int round = 0; round < 60; ++round)
    time.measure([&] {
      for (int i = 0; i < 20; ++i) world.step();
    });
  std::printf("%s %.2f\n", name, 1e6 * time.seconds() / 20);
}

/// @param height of the lowest bodies' centres
void add_bodies(World& world, double height) {
  const Material jelly{.youngs_modulus = 6e4, .poisson_ratio = 0.4, .density = 1000.0};
  const std::array models{make_soft_ball(0.3, 6, jelly, 12, 0.1),
                          make_soft_box({0.2, 0.2, 0.35}, {4, 4, 6}, jelly, 12, 0.1)};
  for (int i = 0; i < 10; ++i)
    world.add_body(models[static_cast<std::size_t>(i % 2)],
                   {.pose = {.p = {(i % 5 - 2) * 0.75, i / 5 * 0.7 - 0.3, height + 0.35 * (i % 3)}}});
}

void tell_all() {
  World flight;
  add_bodies(flight, 0.0);
  tell("flight", flight);
  ManifoldFinder finder;
  World contact;
  contact.set_contact_source(&finder);
  contact.add_static(std::make_shared<Shape>(HalfSpace{}));
  add_bodies(contact, 0.6);
  tell("contact", contact);
}

}  // namespace
}  // namespace limber

int main() { limber::tell_all(); }
