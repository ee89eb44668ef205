// Islands made by hand: bodies of one group under constraints, without a world.
#pragma once

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "constants.h"
#include "limber/constraints/handle.h"
#include "limber/constraints/island_solver.h"
#include "limber/constraints/joint_constraint.h"
#include "sample_models.h"

namespace limber::testing {

/// Ends of the sample body along x, where links are joined, m.
inline const Vec3 kLeftEnd{-0.3, 0.0, 0.0}, kRightEnd{0.3, 0.0, 0.0};

/// One island. Add bodies first, then constraints.
class Island {
 public:
  Island(std::shared_ptr<const ModalModel> body, double step, const Vec3& gravity = {0.0, 0.0, -kGravity})
      : model(std::move(body)), group(model, step), gravity_(gravity), step_(step) {}
  Island(const SampleOptions& sample, double step, const Vec3& gravity = {0.0, 0.0, -kGravity})
      : Island(sample_model(sample), step, gravity) {}

  Index add_body(const RigidTransform& X_WB, const Vec3& velocity = Vec3::Zero(),
                 const Vec3& angular_velocity = Vec3::Zero()) {
    const Index slot = group.add(X_WB, velocity, angular_velocity);
    table.push_back({&group, slot});
    members.push_back(slot);
    return slot;
  }

  /// The frame of a body at a point of its rest shape: on the corners of the face that is nearest, if it deforms.
  MaterialFrame frame(Index body, const JointFrame& at) const {
    if (body < 0) return MaterialFrame(at);
    if (model->modes() == 0) return {body, at};
    const auto patch = patch_around(*model, SurfacePoint::Surface::kCollision, at.origin, 0.3);
    return {body, *model, patch, at};
  }
  JointConstraint& join(MaterialFrame a, MaterialFrame b, const JointSpec& spec) {
    auto joint = std::make_unique<JointConstraint>(std::move(a), std::move(b), spec);
    JointConstraint& result = *joint;
    constraints.push_back(joint.get());
    owned.push_back(std::move(joint));
    joints.push_back(&result);
    return result;
  }
  Handle& hold(Index body, const SurfacePoint& at, const HandleOptions& options = {}) {
    auto handle = std::make_unique<Handle>(MaterialFrame(body, *model, at), group.position(body, at), options);
    Handle& result = *handle;
    constraints.push_back(handle.get());
    owned.push_back(std::move(handle));
    return result;
  }

  IslandReport step() {
    const IslandReport report = solver->step(table, members, constraints,
                                             {.step = step_,
                                              .gravity = gravity_,
                                              .max_iterations = max_iterations,
                                              .guard_energy = guard_energy,
                                              .undisturbed = steps > 0,
                                              .energy_surplus = surplus});
    ++steps;
    surplus = report.energy_surplus;
    return report;
  }

  BodyStates states() const { return BodyStates(table); }
  double energy() const {
    double sum = 0.0;
    for (const Index slot : members) sum += group.energy(slot, gravity_).total();
    return sum;
  }
  /// Σ m g size, and what moves at first.
  double energy_scale() const {
    double kinetic = 0.0;
    for (const Index slot : members) {
      const BodyEnergy e = group.energy(slot, gravity_);
      kinetic += e.kinetic_rigid + e.kinetic_modal + e.elastic;
    }
    return std::max(kinetic, static_cast<double>(members.size()) * model->data().mass * gravity_.norm() * 0.6);
  }
  Vec3 linear_momentum() const {
    Vec3 sum = Vec3::Zero();
    for (const Index slot : members) sum += group.frame(slot).linear_momentum(group.frame_constants());
    return sum;
  }
  Vec3 angular_momentum() const {
    Vec3 sum = Vec3::Zero();
    for (const Index slot : members) {
      const RigidFrame& f = group.frame(slot);
      sum += f.angular_momentum(group.frame_constants()) + f.pose().p.cross(f.linear_momentum(group.frame_constants()));
    }
    return sum;
  }
  /// Largest error of any joint, m or rad.
  double joint_error() const {
    double worst = 0.0;
    for (const JointConstraint* joint : joints) {
      const JointConstraint::Error e = joint->error(states());
      worst = std::max({worst, e.distance, e.angle});
    }
    return worst;
  }

  std::shared_ptr<const ModalModel> model;
  BodyGroup group;
  std::vector<ConstrainedBody> table;
  std::vector<Index> members;
  std::vector<std::unique_ptr<Constraint>> owned;
  std::vector<Constraint*> constraints;
  std::vector<JointConstraint*> joints;
  std::unique_ptr<IslandSolver> solver = make_island_solver();
  int max_iterations = IslandOptions{}.max_iterations;
  bool guard_energy = true;
  int steps = 0;
  double surplus = 0.0;

 private:
  Vec3 gravity_;
  double step_;
};

/// Links along x from the world's origin, joined end to end. @param fixed whether the first hangs from the world
inline void add_chain(Island& island, int links, const JointSpec& spec, bool fixed = true) {
  for (int i = 0; i < links; ++i) island.add_body({{}, {0.3 + 0.6 * i, 0.0, 0.0}});
  for (int i = fixed ? 0 : 1; i < links; ++i) {
    MaterialFrame a = i == 0 ? MaterialFrame(JointFrame{.origin = Vec3::Zero(), .axes = spec.frame.axes})
                             : island.frame(i - 1, {.origin = kRightEnd, .axes = spec.frame.axes});
    island.join(std::move(a), island.frame(i, {.origin = kLeftEnd, .axes = spec.frame.axes}), spec);
  }
}

/// Axes of a joint whose x is the world's y: hinges of a chain that swings in the xz plane.
inline Mat3 hinge_axes() {
  Mat3 axes;
  axes.col(0) = Vec3::UnitY(), axes.col(1) = Vec3::UnitZ(), axes.col(2) = Vec3::UnitX();
  return axes;
}

}  // namespace limber::testing
