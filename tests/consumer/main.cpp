// A game in miniature: makes a model by hand, strikes it, lets it ring and spin, reads its vertices.
// Exit code 0 if the motion obeys the physics that limber promises.

#include <limber/core/version.h>
#include <limber/engine/world.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

namespace {

/// A tetrahedron of 1 kg with one mode of 10 Hz that stretches it along x.
std::shared_ptr<const limber::ModalModel> stretchy_tetrahedron() {
  limber::ModalModelData data;
  data.name = "tetrahedron";
  data.mass = 1.0;
  data.volume = 1e-3;
  data.inertia = limber::Vec3(0.01, 0.02, 0.025).asDiagonal();
  const double omega = 2.0 * 3.14159265358979 * 10.0;
  data.eigenvalues = {omega * omega};
  data.decays = {0.0};
  data.participation = {limber::Vec3::Zero()};
  data.moments = {limber::Mat3::Zero()};
  data.render.rest = {{0.1f, 0.1f, 0.1f}, {0.1f, -0.1f, -0.1f}, {-0.1f, 0.1f, -0.1f}, {-0.1f, -0.1f, 0.1f}};
  data.render.triangles = {{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}};
  data.render.basis = limber::ModalBasis(4, 1);
  for (limber::Index v = 0; v < 4; ++v) data.render.basis.set(v, 0, {10.0f * data.render.rest[v].x(), 0.0f, 0.0f});
  return std::make_shared<const limber::ModalModel>(std::move(data));
}

}  // namespace

int main() {
  limber::World world({.step = 1.0 / 60.0, .gravity = {0.0, 0.0, 0.0}});
  const limber::BodyId body = world.add_body(stretchy_tetrahedron());
  const limber::Vec3 impulse{0.3, 0.0, 0.1};
  world.apply_impulse(body, {.triangle = 0, .weight = {1.0, 0.0, 0.0}}, impulse);
  const int steps = world.advance(0.1001);
  const double energy = world.energy(body).total();
  while (world.step_count() < 6000) world.step();

  std::vector<float> positions(12), normals(12);
  world.reconstruct(body, positions, normals);
  const double momentum_error = (world.linear_momentum(body) - impulse).norm() / impulse.norm();
  const double energy_error = std::abs(world.energy(body).total() / energy - 1.0);
  std::printf("limber %s: %d steps in the first 0.1 s, momentum error %.1e, energy drift over 6000 steps %.1e\n",
              LIMBER_VERSION_STRING, steps, momentum_error, energy_error);
  std::printf("vertex 0 at %g %g %g\n", positions[0], positions[1], positions[2]);
  const bool finite = std::isfinite(positions[0] + positions[4] + positions[8] + normals[0]);
  return finite && steps == 6 && momentum_error < 1e-12 && energy_error < 1e-9 ? 0 : 1;
}
