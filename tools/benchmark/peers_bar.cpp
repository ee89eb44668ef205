#include "peers_bar.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cpu_time.h"
#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "limber/mesh/surface_mesh.h"
#include "scene_bodies.h"
#include "scene_cost.h"

namespace limber::tools {
namespace {

/// Bullet takes modes that are orthonormal in lumped masses.
void normalise(ReducedBody& body) {
  for (auto& mode : body.modes) {
    double sum = 0.0;
    for (std::size_t i = 0; i < mode.size(); ++i) sum += body.masses[i] * mode[i].squaredNorm();
    for (Vec3& u : mode) u /= std::sqrt(sum);
  }
}

std::vector<std::vector<Vec3>> modes_of(const ModalBasis& basis) {
  std::vector<std::vector<Vec3>> modes(static_cast<std::size_t>(basis.modes()));
  for (Index m = 0; m < basis.modes(); ++m)
    for (Index v = 0; v < basis.vertices(); ++v)
      modes[static_cast<std::size_t>(m)].push_back(basis.shape(v, m).cast<double>());
  return modes;
}

ReducedBody whole_of(const ModalModelData& data) {
  const ModalVolume& volume = *data.volume_block;
  ReducedBody body{.nodes = volume.rest,
                   .masses = std::vector<double>(volume.rest.size(), 0.0),
                   .triangles = {},
                   .tets = volume.tets,
                   .eigenvalues = data.eigenvalues,
                   .modes = modes_of(volume.basis)};
  TetMesh mesh{.nodes = volume.rest, .tets = volume.tets};
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (const Index node : mesh.tets[e])
      body.masses[static_cast<std::size_t>(node)] +=
          0.25 * signed_volume(mesh, static_cast<Index>(e)) * data.mass / data.volume;
  const BoundarySurface boundary = boundary_surface(mesh);
  for (Triangle t : boundary.surface.triangles) {
    for (Index& v : t) v = boundary.node_of[static_cast<std::size_t>(v)];
    body.triangles.push_back(t);
  }
  normalise(body);
  return body;
}

ReducedBody surface_of(const ModalModelData& data) {
  ReducedBody body{.nodes = {},
                   .masses = {},
                   .triangles = data.render.triangles,
                   .tets = {},
                   .eigenvalues = data.eigenvalues,
                   .modes = modes_of(data.render.basis)};
  for (const Vec3f& p : data.render.rest) body.nodes.push_back(p.cast<double>());
  body.masses.assign(body.nodes.size(), data.mass / static_cast<double>(body.nodes.size()));
  normalise(body);
  return body;
}

}  // namespace

Bar make_bar(int modes, int vertices, double step) {
  constexpr double kHighest = 0.5;  // ω Δt of the highest mode; Bullet explodes from 2 on
  scenes::BodyOptions options{
      .modes = modes, .vertices = vertices, .volume = true, .touched_as_drawn = true, .damped = false};
  const double highest = scenes::bake_body("bar", options).bodies.front()->data().eigenvalues.back();
  options.stiffness = std::pow(kHighest / step, 2) / highest;  // eigenvalues go with it
  Bar bar{.model = scenes::bake_body("bar", options).bodies.front(), .nodes = {}, .surface = {}};
  bar.nodes = whole_of(bar.model->data());
  bar.surface = surface_of(bar.model->data());
  return bar;
}

ReducedCost run_limber(const Bar& bar, const ReducedRun& run) {
  ContactFinder finder;
  World world({.step = run.step, .gravity = run.on_ground ? Vec3(0.0, 0.0, -9.80665) : Vec3(Vec3::Zero())});
  if (run.on_ground) {
    world.set_contact_source(&finder, {.solver = ContactSolver::kExact});
    world.add_static(std::make_shared<Shape>(HalfSpace{}));
  }
  double low = 0.0;
  for (const Vec3f& p : bar.model->render().rest) low = std::min(low, static_cast<double>(p.z()));
  std::vector<double> z, rates(bar.model->data().eigenvalues.size(), 0.0);
  for (std::size_t i = 0; i < rates.size(); ++i) z.push_back(0.002 / static_cast<double>(1 + i));
  std::vector<BodyId> ids;
  for (int i = 0; i < run.bodies; ++i) {
    ids.push_back(world.add_body(bar.model, {.pose = {{}, Vec3(0.0, i, run.on_ground ? 0.002 - low : 10.0)}}));
    world.set_amplitudes(ids.back(), z, rates);
  }
  // Bullet's step leaves the nodes' positions; so does this.
  const std::size_t floats = 3 * static_cast<std::size_t>(bar.model->render().vertices());
  std::vector<float> positions(floats * ids.size());
  std::vector<DrawTarget> targets;
  for (std::size_t i = 0; i < ids.size(); ++i)
    targets.push_back({.id = ids[i], .positions = std::span(positions).subspan(i * floats, floats)});
  std::vector<double> seconds;
  StageTimes stages;
  for (int n = 0; n < run.steps; ++n) {
    if (n == run.steps / 2) world.set_stage_times(&stages);
    const double began = thread_seconds();
    world.step();
    world.reconstruct(targets);
    if (n >= run.steps / 2) seconds.push_back(thread_seconds() - began);
  }
  const double timed = static_cast<double>(seconds.size()) * run.bodies;
  return {.seconds = quantile(seconds, 0.5),
          .contacts = static_cast<double>(stages[Stage::kNarrowPhase].units) / timed,
          .is_finite = std::isfinite(static_cast<double>(positions.front()))};
}

}  // namespace limber::tools
