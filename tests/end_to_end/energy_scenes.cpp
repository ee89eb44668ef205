#include "energy_scenes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "constants.h"
#include "energy_meter.h"
#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "limber/precompute/bake.h"
#include "limber/scene/scene_model.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

const Vec3 kSize{0.3, 0.1, 0.1};  // of a bar, m
constexpr double kDensity = 1000.0;

TetMesh bar_mesh() { return tet_box(3, 2, 2, kSize); }

/// @param weight times the density, and the stiffness with it, so that the frequencies stay
Material bar_material(const EnergyCase& at, double weight) {
  return {
      .youngs_modulus = weight * at.youngs_modulus, .poisson_ratio = at.poisson_ratio, .density = weight * kDensity};
}

std::shared_ptr<const ModalModel> baked_bar(const EnergyCase& at, double weight) {
  BakeOptions o;
  o.materials = {{"*", bar_material(at, weight)}};
  o.analysis.modes = o.limits.max_modes = std::max(1, at.modes);
  o.analysis.mass = MassKind::kConsistent;  // so that the nodes have the inertia by which the frame turns
  o.volume_block = true;
  const auto bake_it = [&o] {
    Warnings warnings;
    return bake({.name = "bar", .mesh = bar_mesh()}, o, warnings).asset.bodies[0];
  };
  auto bar = bake_it();
  if (at.modes == 0) return reduce_model(*bar, {});
  if (at.damping_ratio == 0.0) return bar;
  o.damping.stiffness_proportional = 2.0 * at.damping_ratio / std::sqrt(bar->data().eigenvalues.front());
  return bake_it();
}

struct Bar {
  std::shared_ptr<const ModalModel> model;
  std::shared_ptr<const EnergyMeter> meter;
};
Bar make_bar(const EnergyCase& at, double weight) {
  const auto model = baked_bar(at, weight);
  return {model, std::make_shared<const EnergyMeter>(bar_mesh(), bar_material(at, weight), model)};
}

/// A point of the surface as near as may be to one of the bar at rest, body frame.
SurfacePoint corner(const ModalModel& model, const Vec3& near) {
  SurfacePoint best{.surface = SurfacePoint::Surface::kCollision};
  double least = 1e300;
  const ModalSurface& surface = model.collision();
  for (std::size_t t = 0; t < surface.triangles.size(); ++t)
    for (std::size_t c = 0; c < 3; ++c) {
      const Vec3 at = surface.rest[static_cast<std::size_t>(surface.triangles[t][c])].cast<double>();
      if ((at - near).norm() >= least) continue;
      least = (at - near).norm();
      best.triangle = static_cast<Index>(t);
      best.weight = {0.0, 0.0, 0.0};
      best.weight[c] = 1.0;
    }
  return best;
}

/// A world, its bodies and their energy.
class Scene {
 public:
  explicit Scene(const EnergyCase& at) : world_({.step = at.step}) {
    const Bar light = make_bar(at, 1.0), heavy = at.mass_ratio == 1.0 ? light : make_bar(at, at.mass_ratio);
    switch (at.scene) {
      case EnergyScene::kGround:
        stand_on_ground(at.friction);
        add(light, {quaternion_from_rotation_vector({0.3, 0.5, 0.1}), {0.0, 0.0, 0.25}}, {1.0, 0.0, -1.0},
            {0.0, 3.0, 2.0});
        break;
      case EnergyScene::kPile:
        stand_on_ground(at.friction);
        add(light, {{}, {0.0, 0.0, 0.06}});
        add(heavy, {quaternion_from_rotation_vector({0.1, 0.1, 0.7}), {0.02, 0.01, 0.25}}, {0.0, 0.0, -1.0});
        break;
      case EnergyScene::kHandle:
        add(light, {});
        world_.add_handle(bodies_[0], corner(*light.model, -0.5 * kSize));
        break;
      case EnergyScene::kChain:
        hang_chain(light, heavy);
        break;
    }
    scale_ = moving();
    double weights = 0.0;
    for (const BodyId id : bodies_) weights += world_.model(id).data().mass * kGravity * kSize.norm();
    scale_ = std::max(scale_, weights);
  }

  EnergyResult run(int steps) {
    EnergyResult result;
    const double first = total(), node_first = node_total(result);
    double before = first, node_before = node_first;
    for (; result.steps < steps && result.finite; ++result.steps) {
      world_.step();
      const double now = total(), node_now = node_total(result);
      result.finite = std::isfinite(now) && std::isfinite(node_now);
      result.worst_rise = std::max(result.worst_rise, (now - before) / scale_);
      result.total_rise = std::max(result.total_rise, (now - first) / scale_);
      result.node_worst_rise = std::max(result.node_worst_rise, (node_now - node_before) / scale_);
      result.node_total_rise = std::max(result.node_total_rise, (node_now - node_first) / scale_);
      if (!world_.constraint_report().solved) ++result.unsettled;
      result.removed += world_.constraint_report().energy_removed / scale_;
      before = now, node_before = node_now;
    }
    return result;
  }

 private:
  void stand_on_ground(double friction) {
    world_.set_contact_source(&finder_, {.friction = friction, .recovery_speed = 0.0});
    world_.add_static(std::make_shared<Shape>(HalfSpace{}));
  }

  BodyId add(const Bar& bar, const RigidTransform& pose, const Vec3& velocity = Vec3::Zero(),
             const Vec3& angular_velocity = Vec3::Zero()) {
    bodies_.push_back(
        world_.add_body(bar.model, {.pose = pose, .velocity = velocity, .angular_velocity = angular_velocity}));
    meters_.push_back(bar.meter);
    return bodies_.back();
  }

  /// Links along x, joined at the middles of their ends.
  void hang_chain(const Bar& light, const Bar& heavy) {
    constexpr double kLimit = 0.6;  // rad
    for (int i = 0; i < 3; ++i) {
      const BodyId link = add(i < 2 ? light : heavy, {{}, {kSize.x() * i, 0.0, 0.0}});
      JointSpec joint{.type = i == 1 ? JointType::kRevolute : JointType::kBall};
      joint.frame.origin = {kSize.x() * (i - 0.5), 0.0, 0.0};
      joint.frame.axes = Eigen::AngleAxisd(0.5 * EIGEN_PI, Vec3::UnitZ()).toRotationMatrix();  // the hinge is along y
      if (i == 1) joint.limits.rotation = {-kLimit, kLimit};
      const JointAttachment ends{.radius = 0.06};
      world_.add_joint(i == 0 ? BodyId{} : bodies_[static_cast<std::size_t>(i - 1)], link, joint, ends, ends);
    }
  }

  double moving() const {
    double sum = 0.0;
    for (const BodyId id : bodies_) {
      const BodyEnergy e = world_.energy(id);
      sum += e.kinetic_rigid + e.kinetic_modal + e.elastic;
    }
    return sum;
  }
  double total() const {
    double sum = 0.0;
    for (const BodyId id : bodies_) sum += world_.energy(id).total();
    return sum;
  }

  /// By the nodes, and how the parts compare with the world's.
  double node_total(EnergyResult& result) const {
    double sum = 0.0, spin = 0.0;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const NodeEnergy nodes = meters_[i]->read(world_.body(bodies_[i]), world_.options().gravity);
      const BodyEnergy e = world_.energy(bodies_[i]);
      const double beyond = std::abs(nodes.kinetic - e.kinetic_rigid - e.kinetic_modal) - nodes.spin_bound;
      result.spin_excess = std::max(result.spin_excess, beyond / scale_);
      result.strain_difference = std::max(result.strain_difference, std::abs(nodes.strain - e.elastic) / scale_);
      sum += nodes.total();
      spin += nodes.spin_bound / scale_;
    }
    result.spin_bound = std::max(result.spin_bound, spin);
    return sum;
  }

  ContactFinder finder_;
  World world_;
  std::vector<BodyId> bodies_;
  std::vector<std::shared_ptr<const EnergyMeter>> meters_;
  double scale_ = 1.0;
};

}  // namespace

EnergyResult run(const EnergyCase& at, int steps) { return Scene(at).run(steps); }

const char* name(EnergyScene scene) {
  constexpr std::array kNames{"ground", "pile", "handle", "chain"};
  return kNames[static_cast<std::size_t>(scene)];
}

std::vector<EnergyCase> energy_grid() {
  std::vector<EnergyCase> grid;
  for (const EnergyScene scene : {EnergyScene::kGround, EnergyScene::kPile, EnergyScene::kHandle, EnergyScene::kChain})
    for (const double modulus : {1e2, 1e4, 1e6, 1e8, 1e10, 1e12})
      for (const double poisson : {0.3, 0.499})
        for (const double step : {1e-4, 1e-3, 1.0 / 60.0, 0.1})
          for (const double damping : {0.0, 0.02, 2.0})
            for (const int modes : {0, 8, 20, 64})
              for (const double ratio : {1.0, 1e4}) {
                const bool two_weights = scene == EnergyScene::kPile || scene == EnergyScene::kChain;
                if (ratio != 1.0 && !two_weights) continue;
                if (modes == 0 && (modulus != 1e6 || poisson != 0.3 || damping != 0.0)) continue;  // all the same
                grid.push_back({.scene = scene,
                                .youngs_modulus = modulus,
                                .poisson_ratio = poisson,
                                .step = step,
                                .damping_ratio = damping,
                                .modes = modes,
                                .mass_ratio = ratio});
              }
  return grid;
}

}  // namespace limber::testing
