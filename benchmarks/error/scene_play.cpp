// Plays a scene by limber and by finite elements of all nodes.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

#include "../cpu_time.h"
#include "constants.h"
#include "error_scenes.h"
#include "limber/core/error.h"
#include "limber/precompute/bake.h"
#include "limber/scene/scene_model.h"
#include "limber/scene/scene_player.h"
#include "scene_meshes.h"

namespace limber::testing {
namespace {

/// Nodes at which something acts on a body, by its mesh.
std::vector<Index> loaded_nodes(const ErrorScene& scene, std::size_t body, const TetMesh& mesh) {
  std::vector<Index> nodes;
  const auto add = [&](std::size_t of, const Vec3& at) {
    if (of == body) nodes.push_back(node_at(mesh, at));
  };
  for (const ErrorForce& f : scene.forces) add(f.body, f.at);
  for (const ErrorLead& lead : scene.leads) add(lead.body, lead.at);
  for (const ErrorTie& tie : scene.ties) add(tie.body_a, tie.at_a), add(tie.body_b, tie.at_b);
  return nodes;
}

ModalSurface half_surface(const ModalSurface& surface) {
  ModalSurface out{.rest = surface.rest,
                   .triangles = surface.triangles,
                   .basis = ModalBasis(surface.vertices(), surface.basis.modes())};
  for (Index v = 0; v < surface.vertices(); ++v)
    for (Index m = 0; m < surface.basis.modes(); ++m)
      out.basis.set(v, m,
                    surface.basis.shape(v, m).unaryExpr([](float x) { return static_cast<float>(Eigen::half(x)); }));
  return out;
}

/// Shapes as a file of halves would give them.
std::shared_ptr<const ModalModel> with_half_shapes(const ModalModel& model) {
  const ModalModelData& whole = model.data();
  ModalModelData data;
  data.name = whole.name;
  data.motion = whole.motion;
  data.mass = whole.mass, data.volume = whole.volume, data.inertia = whole.inertia;
  data.center_of_mass = whole.center_of_mass, data.origin_in_input = whole.origin_in_input;
  data.eigenvalues = whole.eigenvalues, data.decays = whole.decays;
  data.participation = whole.participation, data.moments = whole.moments;
  data.mode_scales = whole.mode_scales;
  data.render = half_surface(whole.render);
  if (whole.collision) data.collision = half_surface(*whole.collision);
  data.residual_compliance = whole.residual_compliance;
  data.captured = whole.captured;
  return std::make_shared<ModalModel>(std::move(data));
}

Asset baked_body(const ErrorScene& scene, std::size_t i, const ErrorSetting& setting) {
  const ErrorBody& body = scene.bodies[i];
  BakeInput input{.name = body.name, .mesh = body_mesh(body, setting.mesh)};
  BakeOptions options;
  options.materials = {{"*", body.material}};
  options.analysis.modes = options.limits.max_modes = setting.modes;
  options.analysis.mass = MassKind::kConsistent;  // as the references have
  options.elements = setting.quadratic ? Elements::kQuadratic : Elements::kLinear;
  options.volume_block = body.coupled;
  if (body.clamped) options.fixed = {NodesByIndex{clamped_nodes(body, input.mesh)}};
  if (setting.residual) {
    const std::vector<Index> loaded = loaded_nodes(scene, i, input.mesh);
    if (!loaded.empty()) options.residual.nodes = {NodesByIndex{loaded}};
    options.residual.surface = scene.has_contact();
  }
  Warnings warnings;
  Asset asset = bake(input, options, warnings).asset;
  if (setting.basis == "half") asset.bodies[0] = with_half_shapes(*asset.bodies[0]);
  return asset;
}

/// The render surface's vertex at each compared place.
std::vector<std::size_t> compared_vertices(const ErrorBody& body, const ModalModel& model) {
  std::vector<std::size_t> out;
  for (const Vec3& at : compared_places(body)) {
    const Vec3 wanted = at - model.data().origin_in_input;
    const auto& rest = model.render().rest;
    const auto found = std::find_if(rest.begin(), rest.end(),
                                    [&](const Vec3f& x) { return (x.cast<double>() - wanted).norm() < 1e-5; });
    if (found == rest.end()) throw InvalidArgument("compared_vertices: a node of the surface is not drawn");
    out.push_back(static_cast<std::size_t>(found - rest.begin()));
  }
  return out;
}

/// As many times a second as both step and sample fit.
std::int64_t steps_per_sample(double step) {
  for (const double interval : {kSampleInterval, 2.0 * kSampleInterval, kSlowestStep}) {
    const auto every = static_cast<std::int64_t>(std::llround(interval / step));
    if (every >= 1 && std::abs(static_cast<double>(every) * step - interval) <= 1e-9) return every;
  }
  throw InvalidArgument("play: step " + std::to_string(step) + " s does not divide 1/60 s");
}

/// limber's side of a scene, step by step.
class Playing {
 public:
  Playing(const ErrorScene& scene, const ErrorSetting& setting, const BakedScene& baked)
      : of_(scene),
        scene_(parse_scene(scene_text(scene, setting, [](const std::string& name) { return name + ".glb"; }),
                           scene.name, ".")),
        models_(make_models(scene_, baked.assets)),
        player_(scene_, models_, scene_.steps) {
    for (std::size_t i = 0; i < scene.bodies.size(); ++i)
      vertices_.push_back(compared_vertices(scene.bodies[i], *models_.of_body[i]));
    played_.motions.resize(scene.bodies.size());
    for (const ErrorForce& f : scene.forces) quiet_from_ = std::max(quiet_from_, f.duration);
    for (const ErrorLead& lead : scene.leads) quiet_from_ = std::max(quiet_from_, lead.ends);
  }

  PlayedScene run() {
    const double step = scene_.step;
    const std::int64_t every = steps_per_sample(step);
    sample();
    for (std::int64_t n = 1; n <= scene_.steps; ++n) {
      const double begin = thread_seconds();
      player_.step();
      played_.step_seconds.push_back(thread_seconds() - begin);
      note_step(static_cast<double>(n) * step);
      if (n % every == 0) sample();
    }
    played_.energy_rise /= scale_;
    played_.energy_loss /= scale_;
    return std::move(played_);
  }

 private:
  void note_step(double time) {
    const World& world = player_.world();
    played_.unsettled += world.constraint_report().solved ? 0 : 1;
    double impulse = 0.0;
    for (const ContactEvent& event : world.contact_events()) impulse += std::max(0.0, event.normal.dot(event.impulse));
    if (impulse > 0.0) played_.touches.push_back({time, impulse});
    double total = 0.0, moving = 0.0;
    for (const BodyId id : player_.bodies()) {
      const BodyEnergy e = world.energy(id);
      total += e.total();
      moving += e.kinetic_rigid + e.kinetic_modal + e.elastic;
    }
    scale_ = std::max(scale_, moving);
    if (time < quiet_from_ + 0.5 * scene_.step) return;
    if (!quiet_) quiet_ = total;
    played_.energy_rise = std::max(played_.energy_rise, total - *quiet_);
    played_.energy_loss = std::max(played_.energy_loss, *quiet_ - total);
  }

  void sample() {
    Vec3 momentum = Vec3::Zero();
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      const BodyId id = player_.bodies()[i];
      const Vec3 origin = player_.world().body(id).pose.p;
      drawn_.resize(3 * static_cast<std::size_t>(models_.of_body[i]->render().vertices()));
      player_.world().reconstruct(id, drawn_, {}, 1.0, origin);
      NodeVectors x(static_cast<Eigen::Index>(vertices_[i].size()), 3);
      for (std::size_t v = 0; v < vertices_[i].size(); ++v)
        for (std::size_t axis = 0; axis < 3; ++axis)
          x(static_cast<Eigen::Index>(v), static_cast<Eigen::Index>(axis)) =
              origin[static_cast<Eigen::Index>(axis)] + static_cast<double>(drawn_[3 * vertices_[i][v] + axis]);
      played_.motions[i].push_back(std::move(x));
      if (!of_.bodies[i].clamped) momentum += player_.world().linear_momentum(id);
    }
    played_.momenta.push_back(momentum);
  }

  const ErrorScene& of_;
  Scene scene_;
  SceneModels models_;
  ScenePlayer player_;
  std::vector<std::vector<std::size_t>> vertices_;
  std::vector<float> drawn_;
  PlayedScene played_;
  double quiet_from_ = 0.0, scale_ = 1e-300;
  std::optional<double> quiet_;
};

MovingBody moving_body(const ErrorBody& body, ElasticLaw law, const TetMesh& mesh) {
  const auto elasticity = std::make_shared<NodalElasticity>(mesh, body.material, law, clamped_nodes(body, mesh));
  const Mat3 R = to_matrix(body.pose.q);
  const NodeVectors arms = (elasticity->rest().rowwise() - 0.5 * body.size.transpose()) * R.transpose();
  MovingBody out{.elasticity = elasticity,
                 .x = arms.rowwise() + body.pose.p.transpose(),
                 .v = NodeVectors(arms.rows(), 3),
                 .wall = body.wall};
  for (Eigen::Index v = 0; v < arms.rows(); ++v)
    out.v.row(v) = (body.velocity + body.angular_velocity.cross(Vec3(arms.row(v)))).transpose();
  return out;
}

Vec3 led_way(const ErrorLead& lead, double time) {
  const double u = std::clamp(time / lead.arrives, 0.0, 1.0);
  return u * u * u * (10.0 + u * (6.0 * u - 15.0)) * lead.way;
}

/// A clamped body is seen in the frame that holds it: rest is where it starts. Else its places are those of the world.
ReferenceScene reference_scene(const ErrorScene& scene, ElasticLaw law, std::span<const TetMesh> meshes) {
  ReferenceScene out{.gravity = scene.gravity};
  for (std::size_t i = 0; i < scene.bodies.size(); ++i)
    out.bodies.push_back(moving_body(scene.bodies[i], law, meshes[i]));
  for (const ErrorForce& f : scene.forces)
    out.forces.push_back({f.body, node_at(meshes[f.body], f.at), f.force, 0.0, f.duration});
  for (const ErrorLead& lead : scene.leads)
    out.led.push_back({lead.body, node_at(meshes[lead.body], lead.at), 0.0, lead.ends,
                       [lead](double time) { return led_way(lead, time); }});
  for (const ErrorTie& tie : scene.ties)
    out.ties.push_back(
        {tie.body_a, node_at(meshes[tie.body_a], tie.at_a), tie.body_b, node_at(meshes[tie.body_b], tie.at_b)});
  return out;
}

double relative(double seen, double reference) {
  return reference > 0.0 ? std::abs(seen - reference) / reference : std::abs(seen);
}

double sum_of(std::span<const Touch> touches) {
  double sum = 0.0;
  for (const Touch& touch : touches) sum += touch.impulse;
  return sum;
}

/// Error of bodies until a time, root mean square, over the peaks of the whole reference; the worst body's.
double error_until(const ErrorScene& scene, const PlayedScene& seen, const PlayedScene& reference, double end) {
  double worst = 0.0;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const std::size_t each = (reference.motions[i].size() - 1) / (seen.motions[i].size() - 1);
    const double interval = static_cast<double>(each) * kSampleInterval;
    const auto count = std::min(seen.motions[i].size(), static_cast<std::size_t>(std::ceil(end / interval)) + 1);
    const Eigen::VectorXd masses = compared_masses(scene.bodies[i]);
    const MotionError whole = motion_error(reference.motions[i], reference.motions[i], masses);
    const MotionError part =
        motion_error(NodeMotion(seen.motions[i].begin(), seen.motions[i].begin() + static_cast<std::ptrdiff_t>(count)),
                     NodeMotion(reference.motions[i].begin(),
                                reference.motions[i].begin() + static_cast<std::ptrdiff_t>((count - 1) * each + 1)),
                     masses);
    if (whole.peak > 0.0) worst = std::max(worst, part.mean * part.peak / whole.peak);
  }
  return worst;
}

}  // namespace

const BakedScene& SceneBakery::baked(const ErrorScene& scene, const ErrorSetting& setting) {
  BakedScene& baked =
      known_[{scene.name, setting.modes, setting.residual, setting.basis, setting.mesh, setting.quadratic}];
  if (!baked.assets.empty()) return baked;
  const double begin = thread_seconds();
  for (std::size_t i = 0; i < scene.bodies.size(); ++i)
    baked.assets[scene.bodies[i].name] = baked_body(scene, i, setting);
  baked.bake_seconds = thread_seconds() - begin;
  for (const auto& [name, asset] : baked.assets) {
    const ModalModelData& data = asset.bodies[0]->data();
    baked.bytes += shape_bytes(data);
  }
  return baked;
}

PlayedScene play(const ErrorScene& scene, const ErrorSetting& setting, SceneBakery& bakery) {
  return Playing(scene, setting, bakery.baked(scene, setting)).run();
}

PlayedScene play_reference(const ErrorScene& scene, ElasticLaw law, int mesh, double fraction) {
  std::vector<TetMesh> meshes;
  for (const ErrorBody& body : scene.bodies) meshes.push_back(body_mesh(body, mesh));
  ReferenceScene reference = reference_scene(scene, law, meshes);
  double longest = kSampleInterval;
  for (const MovingBody& body : reference.bodies) longest = std::min(longest, fraction * stable_step(*body.elasticity));
  std::vector<std::vector<Index>> compared;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    compared.emplace_back();
    for (const Vec3& at : compared_places(scene.bodies[i])) compared.back().push_back(node_at(meshes[i], at));
  }

  ReferenceWorld world(std::move(reference));
  PlayedScene played;
  played.motions.resize(meshes.size());
  const auto samples = static_cast<int>(std::llround(scene.duration / kSampleInterval));
  for (int n = 0; n <= samples; ++n) {
    if (n > 0) {
      const double begin = thread_seconds();
      world.advance(kSampleInterval, longest);
      const double steps = std::ceil(kSampleInterval / longest * (1.0 - 1e-12));
      played.step_seconds.push_back((thread_seconds() - begin) / steps);
    }
    for (std::size_t i = 0; i < meshes.size(); ++i)
      played.motions[i].push_back(world.places(i)(compared[i], Eigen::all));
    Vec3 momentum = Vec3::Zero();
    for (std::size_t i = 0; i < meshes.size(); ++i)
      if (!scene.bodies[i].clamped) momentum += world.velocities(i).transpose() * world.node_masses(i);
    played.momenta.push_back(momentum);
  }
  // Two bodies that meet have a wall each.
  const auto walls =
      std::count_if(scene.bodies.begin(), scene.bodies.end(), [](const auto& b) { return b.wall.has_value(); });
  for (const auto& [time, impulse] : world.wall_impulses())
    played.touches.push_back({time, impulse / static_cast<double>(std::max<std::ptrdiff_t>(1, walls))});
  return played;
}

FirstImpact first_impact(std::span<const Touch> touches) {
  FirstImpact out;
  for (const Touch& touch : touches) {
    if (out.begin < 0.0)
      out.begin = touch.time;
    else if (touch.time - out.end > FirstImpact::kPause)
      break;
    out.end = touch.time;
    out.impulse += touch.impulse;
  }
  return out;
}

SceneError scene_error(const ErrorScene& scene, const PlayedScene& seen, const PlayedScene& reference) {
  SceneError out;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const MotionError e = motion_error(seen.motions[i], reference.motions[i], compared_masses(scene.bodies[i]));
    MotionError& worst = out.motion;
    if (e.peak > worst.peak) worst.peak = e.peak, worst.shape_peak = e.shape_peak;
    worst.mean = std::max(worst.mean, e.mean);
    worst.worst = std::max(worst.worst, e.worst);
    worst.worst_vertex = std::max(worst.worst_vertex, e.worst_vertex);
    worst.shape_mean = std::max(worst.shape_mean, e.shape_mean);
  }
  out.tip = node_error(seen.motions[scene.tip_body], reference.motions[scene.tip_body], compared_tip(scene));
  if (scene.has_contact()) {
    out.impulse = relative(sum_of(seen.touches), sum_of(reference.touches));
    const FirstImpact here = first_impact(seen.touches), there = first_impact(reference.touches);
    out.first = error_until(scene, seen, reference, there.end);
    out.first_impulse = relative(here.impulse, there.impulse);
    out.first_length = relative(here.end - here.begin, there.end - there.begin);
  }
  double largest = 0.0;
  const std::size_t each = (reference.momenta.size() - 1) / (seen.momenta.size() - 1);
  for (std::size_t n = 0; n < seen.momenta.size(); ++n) {
    out.momentum = std::max(out.momentum, (seen.momenta[n] - reference.momenta[each * n]).norm());
    largest = std::max(largest, reference.momenta[each * n].norm());
  }
  out.momentum = largest > 0.0 ? out.momentum / largest : 0.0;
  return out;
}

}  // namespace limber::testing
