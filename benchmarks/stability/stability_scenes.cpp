#include "stability_scenes.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include "constants.h"
#include "energy_meter.h"
#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"
#include "stability_bars.h"

namespace limber::testing {
namespace {

const Vec3 kSize = kBarSize;
constexpr int kPullSteps = 10;
constexpr std::uint64_t kPauseAfter = 40;  // steps

struct Bar {
  std::shared_ptr<const ModalModel> model;
  std::shared_ptr<const EnergyMeter> meter;
};
Bar make_bar(const StabilityCase& at, double weight) {
  const auto model = baked_bar(at, weight, MassKind::kConsistent);
  return {model, std::make_shared<const EnergyMeter>(bar_mesh(at), bar_material(at, weight), model)};
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

ContactOptions contact_options(const StabilityCase& at) {
  ContactOptions options{.friction = at.friction, .recovery_speed = at.recovery_speed};
  options.solver = at.substeps > 0 ? ContactSolver::kGame : ContactSolver::kExact;
  if (at.substeps > 0) options.small_steps.substeps = at.substeps;
  if (at.recovery_speed == 0.0) options.small_steps.push_speed = 0.0;
  return options;
}

std::unique_ptr<ContactSource> finder_for(const StabilityCase& at) {
  if (at.substeps > 0) return std::make_unique<ManifoldFinder>();
  return std::make_unique<ContactFinder>();
}

/// A world, its bodies and what is measured of them.
class Scene {
 public:
  explicit Scene(const StabilityCase& at)
      : at_(at),
        finder_(finder_for(at)),
        world_({.step = at.step, .gravity = at.gravity * kDown}),
        length_(kSize.x() * at.size) {
    const Bar light = make_bar(at, 1.0), heavy = at.mass_ratio == 1.0 ? light : make_bar(at, at.mass_ratio);
    world_.set_contact_source(nullptr, contact_options(at));  // which solver answers handles and joints
    switch (at.scene) {
      case StabilityScene::kFlight:
        let_fly(light);
        break;
      case StabilityScene::kGround:
        stand_on_ground();
        add(light, {quaternion_from_rotation_vector({0.3, 0.5, 0.1}), {0.0, 0.0, 0.25}}, {1.0, 0.0, -1.0},
            {0.0, 3.0, 2.0});
        break;
      case StabilityScene::kPile:
        stand_on_ground();
        add(light, {{}, {0.0, 0.0, 0.06}});
        add(heavy, {quaternion_from_rotation_vector({0.1, 0.1, 0.7}), {0.02, 0.01, 0.25}}, {0.0, 0.0, -1.0});
        break;
      case StabilityScene::kHandle:
        add(light, {});
        hand_ = world_.add_handle(bodies_[0], corner(*light.model, -0.5 * at.size * kSize));
        break;
      case StabilityScene::kChain:
        hang_chain(light, heavy);
        break;
    }
    double weights = 0.0;
    for (const BodyId id : bodies_)
      weights += world_.model(id).data().mass * std::max(at.gravity, kLeastGravity) * kGravity * at.size * kSize.norm();
    scale_ = std::max(moving(), weights);
  }

  StabilityResult run(int steps) {
    std::mt19937 random(1);
    if (at_.pull > 0.0 || at_.scene == StabilityScene::kFlight) put_in(random);
    StabilityResult result;
    const double first = total(), node_first = node_total(result);
    double before = first, node_before = node_first;
    start_ = state();
    for (; result.steps < steps && result.finite; ++result.steps) {
      step(random);
      const double now = total();
      result.finite = std::isfinite(now);
      if (!result.finite) break;  // nobody draws such a body
      const double node_now = node_total(result);
      result.finite = std::isfinite(node_now);
      result.worst_rise = std::max(result.worst_rise, (now - before) / scale_);
      result.total_rise = std::max(result.total_rise, (now - first) / scale_);
      result.node_worst_rise = std::max(result.node_worst_rise, (node_now - node_before) / scale_);
      result.node_total_rise = std::max(result.node_total_rise, (node_now - node_first) / scale_);
      if (world_.constraint_report().statuses.worst() == IslandStatus::kFailed) ++result.unsettled;
      result.energy_digits = std::max(result.energy_digits, energy_digits());
      result.largest_turn = std::max(result.largest_turn, largest_turn());
      result.removed += world_.constraint_report().energy_removed / scale_;
      see_places(result);
      before = now, node_before = node_now;
    }
    return result;
  }

 private:
  static constexpr double kLeastGravity = 1e-3;  // times the standard one: of the scale of energies alone

  /// Of the mass centre of the first body, and when.
  struct State {
    double time = 0.0;
    Vec3 place = Vec3::Zero(), velocity = Vec3::Zero(), spin = Vec3::Zero();
  };
  State state() const {
    const BodyView body = world_.body(bodies_[0]);
    return {world_.time(), body.pose.p, body.velocity, world_.angular_momentum(bodies_[0])};
  }

  void step(std::mt19937& random) {
    if (at_.varying_step) world_.set_step(at_.step * std::uniform_real_distribution<double>(0.1, 1.0)(random));
    const bool pauses = at_.pause > 0.0 && world_.step_count() == kPauseAfter;
    if (pauses) world_.set_step(at_.pause);
    last_step_ = world_.options().step;
    world_.step();
    if (pauses) world_.set_step(at_.step);
  }

  /// Drives the body before its energy is watched: a blow, or a pull by a hand that then lets go.
  void put_in(std::mt19937& random) {
    const Vec3 along = Vec3(1.0, 0.2, 0.3).normalized();
    if (at_.scene == StabilityScene::kFlight) {
      const ModalModel& model = world_.model(bodies_[0]);
      const double blow = model.data().mass * std::sqrt(at_.size);
      world_.apply_impulse(bodies_[0], corner(model, 0.5 * at_.size * kSize), blow * Vec3(0.3, 0.2, 1.0));
      step(random);
    } else {
      const Vec3 from = world_.handle(*hand_).target.position;
      for (int i = 1; i <= kPullSteps; ++i) {
        world_.set_handle_target(*hand_, {.position = from + at_.pull * length_ * i / kPullSteps * along});
        step(random);
      }
      world_.remove_handle(*hand_);
      hand_.reset();
    }
    scale_ = std::max(scale_, moving());
  }

  void stand_on_ground() {
    world_.set_contact_source(finder_.get(), contact_options(at_));
    world_.add_static(std::make_shared<Shape>(HalfSpace{}));
    has_ground_ = true;
  }

  /// Places in units of the size, velocities in those that gravity gives it.
  BodyId add(const Bar& bar, const RigidTransform& pose, const Vec3& velocity = Vec3::Zero(),
             const Vec3& angular_velocity = Vec3::Zero()) {
    const double root = std::sqrt(at_.size);
    bodies_.push_back(world_.add_body(bar.model, {.pose = {pose.q, at_.size * pose.p + away()},
                                                  .velocity = root * velocity - at_.speed * Vec3::UnitZ(),
                                                  .angular_velocity = angular_velocity / root}));
    meters_.push_back(bar.meter);
    return bodies_.back();
  }
  Vec3 away() const { return at_.far_away * Vec3(0.8, -0.6, 0.0); }

  void let_fly(const Bar& bar) {
    add(bar, {quaternion_from_rotation_vector({0.3, 0.5, 0.1}), Vec3::Zero()}, {1.0, 0.5, 3.0});
    world_.set_velocity(bodies_[0], world_.body(bodies_[0]).velocity, at_.spin * Vec3(0.6, 0.64, 0.48));
  }

  /// Links along x, joined at the middles of their ends.
  void hang_chain(const Bar& light, const Bar& heavy) {
    constexpr double kLimit = 0.6;  // rad
    for (int i = 0; i < 3; ++i) {
      const BodyId link = add(i < 2 ? light : heavy, {{}, {kSize.x() * i, 0.0, 0.0}});
      JointSpec joint{.type = i == 1 ? JointType::kRevolute : JointType::kBall};
      joint.frame.origin = away() + Vec3(length_ * (i - 0.5), 0.0, 0.0);
      joint.frame.axes = Eigen::AngleAxisd(0.5 * EIGEN_PI, Vec3::UnitZ()).toRotationMatrix();  // the hinge is along y
      if (i == 1) joint.limits.rotation = {-kLimit, kLimit};
      const JointAttachment ends{.radius = 0.06 * at_.size};
      joints_.push_back(
          world_.add_joint(i == 0 ? BodyId{} : bodies_[static_cast<std::size_t>(i - 1)], link, joint, ends, ends));
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
  /// Kinetic and potential energy cancel where bodies fall far: their sum has no digits beyond those of either.
  double energy_digits() const {
    double sum = 0.0;
    for (const BodyId id : bodies_) {
      const BodyEnergy e = world_.energy(id);
      sum += e.kinetic_rigid + std::abs(e.potential);
    }
    return kEpsilon * sum / scale_;
  }
  double largest_turn() const {
    double turn = 0.0;
    for (const BodyId id : bodies_) turn = std::max(turn, last_step_ * world_.body(id).angular_velocity.norm());
    return turn;
  }
  double total() const {
    double sum = 0.0;
    for (const BodyId id : bodies_) sum += world_.energy(id).total();
    return sum;
  }

  /// By the nodes, and how the parts compare with the world's.
  double node_total(StabilityResult& result) const {
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

  /// Compares the bodies' places with their targets.
  void see_places(StabilityResult& result) {
    if (has_ground_) {
      result.rest_overlap = 0.0;
      for (const BodyId id : bodies_) {
        const auto [low, high] = heights(id);
        result.rest_overlap = std::max(result.rest_overlap, -low / length_);
        result.passed = result.passed || high < 0.0;
      }
      result.overlap = std::max(result.overlap, result.rest_overlap);
    }
    if (hand_) result.off_target = std::max(result.off_target, world_.handle(*hand_).error / length_);
    for (const JointId joint : joints_) {
      const JointView seen = world_.joint(joint);
      result.off_target = std::max({result.off_target, seen.distance_error / length_, seen.angle_error});
    }
    if (at_.scene != StabilityScene::kFlight) return;
    const State now = state();
    const double t = now.time - start_.time;
    const Vec3 way = t * start_.velocity + 0.5 * t * t * world_.options().gravity;
    const double off = (now.place - start_.place - way).norm() /
                       (length_ + t * start_.velocity.norm() + 0.5 * t * t * world_.options().gravity.norm());
    result.momentum_error =
        std::max({result.momentum_error, off, (now.spin - start_.spin).norm() / start_.spin.norm()});
  }

  /// Lowest and highest vertex of a body.
  std::pair<double, double> heights(BodyId id) {
    vertices_.resize(3 * static_cast<std::size_t>(world_.model(id).render().vertices()));
    const Vec3 origin = world_.body(id).pose.p;
    world_.reconstruct(id, vertices_, {}, 1.0, origin);
    double low = 1e300, high = -1e300;
    for (std::size_t i = 2; i < vertices_.size(); i += 3) {
      const double z = origin.z() + static_cast<double>(vertices_[i]);
      low = std::min(low, z), high = std::max(high, z);
    }
    return {low, high};
  }

  StabilityCase at_;
  std::unique_ptr<ContactSource> finder_;
  World world_;
  double length_;
  std::vector<BodyId> bodies_;
  std::vector<std::shared_ptr<const EnergyMeter>> meters_;
  std::optional<HandleId> hand_;
  std::vector<JointId> joints_;
  std::vector<float> vertices_;
  State start_{};
  bool has_ground_ = false;
  double scale_ = 1.0, last_step_ = 0.0;
};

}  // namespace

StabilityResult run(const StabilityCase& at, int steps) { return Scene(at).run(steps); }

}  // namespace limber::testing
