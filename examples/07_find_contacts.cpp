// 07_find_contacts: where does a bent body touch, without any world?
//   bake:  limber-precompute bunny.obj --scale 0.1 --material rubber --modes 16 -o bunny.glb
//   run:   07_find_contacts bunny.glb
//   see:   the contacts of a body over a table as its first mode bends it: more of them, then an overlap; ids of those
//          that stay stay the same, so that a solver can start from last time's forces
//   next:  08_picture_of_a_flight, docs/collision.md
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>

#include "limber/collision/contact_finder.h"
#include "limber/core/error.h"
#include "limber/model/asset.h"

namespace {

/// How far the body's lowest vertex is below its origin when the first mode has this amplitude.
double depth(const limber::ModalModel& model, double amplitude) {
  const limber::ModalSurface& surface = model.collision();
  double lowest = 0.0;
  for (limber::Index v = 0; v < surface.vertices(); ++v) {
    const limber::Vec3f u = surface.basis.shape(v, 0);
    lowest = std::min(lowest, surface.rest[static_cast<std::size_t>(v)].z() + amplitude * u.z());
  }
  return -lowest;
}

}  // namespace

int main(int argc, char** argv) try {
  const auto model = limber::read_asset(argc > 1 ? argv[1] : "bunny.glb").bodies.at(0);
  if (model->modes() == 0) throw limber::InvalidArgument("the body has no modes, expected one that bends");
  const double size = model->collision_extent().radius, most = 0.05 * size / model->collision_extent().shape.at(0);
  // A mode may as well be its negative: of the two, the bend that comes closer to the table.
  const double bend = depth(*model, most) > depth(*model, -most) ? most : -most;

  limber::ContactFinder finder;
  finder.add_body(0, {.model = model}, {});
  finder.add_body(1, {.shape = std::make_shared<limber::Shape>(limber::HalfSpace{})}, {});

  std::vector<double> z(static_cast<std::size_t>(model->modes()), 0.0);
  std::vector<limber::ContactPoint> contacts;
  const double height = depth(*model, 0.0) + 0.005 * size;  // of the origin, the body at rest just above the table
  for (int i = 0; i <= 4; ++i) {
    z[0] = 0.25 * i * bend;
    const std::array states{limber::BodyState{.pose = {.p = {0, 0, height}}, .amplitudes = z}, limber::BodyState{}};
    finder.find_contacts({.states = states, .margin = 0.01 * size}, contacts, limber::serial_jobs());
    std::printf("bent by up to %.1f mm: %zu contacts\n", 1e3 * std::abs(z[0]) * model->collision_extent().shape[0],
                contacts.size());
    for (const auto& c : contacts)
      std::printf("  %016llx  gap %+7.2f mm  at (%+.3f, %+.3f)  triangle %d\n", static_cast<unsigned long long>(c.id),
                  1e3 * c.gap, c.position.x(), c.position.y(), c.a.triangle);
  }
} catch (const std::exception& e) {
  std::fprintf(stderr, "07_find_contacts: %s\n", e.what());
  return 1;
}
