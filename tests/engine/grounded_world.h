// A world with the ground and bodies that lie on it.
#pragma once

#include <algorithm>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "constants.h"
#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber::testing {

/// Boxes whose first mode has 3 % of critical damping.
inline std::shared_ptr<const ModalModel> damped_box(int modes, double hz) {
  return sample_model({.modes = modes, .lowest_hz = hz, .decay = 0.03 * 2.0 * std::numbers::pi * hz});
}

/// The same by the exact solver.
inline ContactOptions exactly(ContactOptions options = {}) {
  options.solver = ContactSolver::kExact;
  return options;
}

/// Who finds contacts for a solver, as scenes choose.
inline std::unique_ptr<ContactSource> make_finder(ContactSolver solver = kDefaultContactSolver) {
  if (solver == ContactSolver::kGame) return std::make_unique<ManifoldFinder>();
  return std::make_unique<ContactFinder>();
}

inline std::shared_ptr<const Shape> share(Shape shape) { return std::make_shared<const Shape>(std::move(shape)); }

/// A world with the ground, and its finder.
struct GroundedWorld {
  explicit GroundedWorld(const ContactOptions& options = {}, const WorldOptions& world_options = {},
                         Jobs& jobs = serial_jobs())
      : finder(make_finder(options.solver)), world(world_options, jobs) {
    world.set_contact_source(finder.get(), options);
    ground = world.add_static(std::make_shared<Shape>(HalfSpace{}));
  }
  void step(int count) {
    for (int i = 0; i < count; ++i) world.step();
  }
  std::unique_ptr<ContactSource> finder;
  World world;
  BodyId ground;
};

/// The lowest vertex of a body's render surface.
inline double lowest(const World& world, BodyId id) {
  std::vector<float> positions(3 * static_cast<std::size_t>(world.model(id).render().vertices()));
  world.reconstruct(id, positions, {});
  float low = positions[2];
  for (std::size_t i = 2; i < positions.size(); i += 3) low = std::min(low, positions[i]);
  return static_cast<double>(low);
}

inline double total_energy(const World& world, const std::vector<BodyId>& bodies) {
  double sum = 0.0;
  for (const BodyId body : bodies) sum += world.energy(body).total();
  return sum;
}

/// The most by which the bodies' energy rises in one of the next steps, J.
inline double largest_rise(World& world, const std::vector<BodyId>& bodies, int steps) {
  double before = total_energy(world, bodies), worst = 0.0;
  for (int i = 0; i < steps; ++i) {
    world.step();
    const double now = total_energy(world, bodies);
    worst = std::max(worst, now - before);
    before = now;
  }
  return worst;
}

/// How far the lowest point of a model at rest shape is below its origin.
inline double depth_below_origin(const ModalModel& model) {
  double low = 0.0;
  for (const auto& p : model.collision().rest) low = std::min(low, static_cast<double>(p.z()));
  return -low;
}

}  // namespace limber::testing
