#include "limber/constraints/manipulation.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "limber/core/error.h"
#include "tuning.h"

namespace limber {
namespace {

void require(bool good, const std::string& what) {
  if (!good) throw InvalidArgument("manipulate: " + what);
}

/// The bodies that the points are on, each once, in ascending order.
std::vector<Index> bodies_of(std::span<const PointWish> wishes, std::span<const PointForce> forces) {
  std::vector<Index> bodies;
  for (const PointWish& wish : wishes) bodies.push_back(wish.point.body());
  for (const PointForce& force : forces) bodies.push_back(force.point.body());
  std::sort(bodies.begin(), bodies.end());
  bodies.erase(std::unique(bodies.begin(), bodies.end()), bodies.end());
  return bodies;
}

/// D, one number per degree of freedom.
Eigen::VectorXd metric(const IslandBodies& bodies, ManipulationLevel level) {
  Eigen::VectorXd D(bodies.degrees_of_freedom());
  bodies.write_frame_metric({D.data(), static_cast<std::size_t>(D.size())});
  for (Index b = 0; b < bodies.count(); ++b) {
    const BodyGroup& group = *bodies.body(b).group;
    const ModalModelData& data = group.model().data();
    const double h = group.step_length();
    const int frame = bodies.response(b).translations + bodies.response(b).rotations;
    if (level == ManipulationLevel::kPosition) D.segment(bodies.first(b), frame) *= 0.5 * h;
    if (level == ManipulationLevel::kPositionImpulse) D.segment(bodies.first(b), frame) *= h;
    for (std::size_t i = 0; i < data.eigenvalues.size(); ++i) {
      double& d = D[bodies.first(b) + frame + static_cast<Eigen::Index>(i)];
      d = 1.0;
      if (level != ManipulationLevel::kPosition && level != ManipulationLevel::kPositionImpulse) continue;
      const ModePropagator p = propagator({data.eigenvalues[i], data.decays[i]}, h);
      d = level == ManipulationLevel::kPosition ? p.z_g / h : p.z_zdot;
    }
  }
  return D;
}

/// Acceleration of a point under its body's loads, [H03] equations 19 and 20.
Vec3 acceleration(const ConstrainedBody& body, const BodyStates& states, const MaterialFrame& point,
                  const Vec3& gravity) {
  const BodyGroup& group = *body.group;
  const FrameConstants& c = group.frame_constants();
  const RigidFrame& frame = group.frame(body.slot);
  const RigidTransform& X = frame.pose();
  const Mat3 R = to_matrix(X.q);
  const Vec3 omega = frame.angular_velocity(c), arm = point.position(states, StepTime::kStart) - X.p;
  const Mat3 inertia = R * c.inertia * R.transpose();
  const Vec3 alpha = inertia.llt().solve(group.held_torque(body.slot) - omega.cross(inertia * omega));
  const Vec3 deforming = point.velocity(states, StepTime::kStart) - frame.velocity() - omega.cross(arm);  // R U ż
  const ModalModelData& data = group.model().data();
  std::vector<double> bent(data.eigenvalues.size());  // z̈
  for (std::size_t i = 0; i < bent.size(); ++i)
    bent[i] = group.held_modal_forces(body.slot)[i] - 2.0 * data.decays[i] * group.rates(body.slot)[i] -
              data.eigenvalues[i] * group.amplitudes(body.slot)[i];
  const FrameInstant at = point.at(states, StepTime::kStart);
  std::vector<double> modal;
  Vec3 vibrating = Vec3::Zero();  // R U z̈
  for (int axis = 0; axis < 3; ++axis) {
    point.side(at, Vec3::Unit(axis), modal);
    for (std::size_t i = 0; i < modal.size(); ++i) vibrating[axis] += modal[i] * bent[i];
  }
  return group.own_gravity(body.slot, gravity) + group.held_force(body.slot) / c.mass + alpha.cross(arm) +
         omega.cross(omega.cross(arm)) + 2.0 * omega.cross(deforming) + vibrating;
}

void check(std::span<const ConstrainedBody> table, std::span<const PointWish> wishes,
           std::span<const PointForce> forces, std::span<const double> impulses, const ManipulationOptions& options) {
  const std::size_t count = forces.empty() ? wishes.size() : forces.size();
  require(impulses.size() == count, std::to_string(impulses.size()) + " impulses, expected " + std::to_string(count));
  require(options.max_iterations >= 1, "max_iterations is below 1");
  const auto point = [&](const MaterialFrame& at, const Vec3& direction) {
    require(std::abs(direction.squaredNorm() - 1.0) <= 1e-6, "a direction is not a unit vector");
    require(at.body() >= 0 && static_cast<std::size_t>(at.body()) < table.size() &&
                table[static_cast<std::size_t>(at.body())].group != nullptr,
            "a point is on no moving body");
  };
  for (const PointWish& wish : wishes) {
    point(wish.point, wish.direction);
    require(std::isfinite(wish.wanted), "a wish is not a finite number");
    const BodyGroup& group = *table[static_cast<std::size_t>(wish.point.body())].group;
    require(options.level != ManipulationLevel::kAcceleration || group.frame_constants().motion == FrameMotion::kFree,
            "accelerations are for free bodies");
  }
  for (const PointForce& force : forces) point(force.point, force.direction);
}

class Manipulation {
 public:
  Manipulation(std::span<const ConstrainedBody> table, std::span<const PointWish> wishes,
               std::span<const PointForce> forces, const ManipulationOptions& options)
      : table_(table), wishes_(wishes), states_(table), options_(options) {
    const std::vector<Index> members = bodies_of(wishes, forces);
    bodies_.set(table, members);
    const double step = bodies_.count() > 0 ? bodies_.body(0).group->step_length() : 0.0;
    for (Index b = 0; b < bodies_.count(); ++b)
      require(bodies_.body(b).group->step_length() == step, "bodies differ in their step");
    for (const PointWish& wish : wishes) add_row(measured_, wish.point, wish.direction);
    for (const PointForce& force : forces) add_row(forced_, force.point, force.direction);
    if (forces.empty()) forced_ = measured_;
  }

  ManipulationResult run(std::span<double> impulses) {
    const Eigen::MatrixXd A =
        jacobian(measured_) * metric(bodies_, options_.level).asDiagonal() * jacobian(forced_).transpose();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition;
    decomposition.setThreshold(internal::kConstraintsTuning.rows.manipulation_rank);
    decomposition.compute(A);
    std::fill(impulses.begin(), impulses.end(), 0.0);
    const bool positions =
        options_.level == ManipulationLevel::kPosition || options_.level == ManipulationLevel::kPositionImpulse;
    Eigen::VectorXd missing = wanted_less_coming();
    for (int i = 0; i < (positions ? options_.max_iterations : 1); ++i) {
      const Eigen::VectorXd f = decomposition.solve(missing);
      apply(f);
      for (std::size_t j = 0; j < impulses.size(); ++j) impulses[j] += f[static_cast<Eigen::Index>(j)];
      missing = wanted_less_coming();
      if ((A * f).lpNorm<Eigen::Infinity>() < internal::kConstraintsTuning.rows.manipulation_tolerance * scale_) break;
    }
    return {.rank = static_cast<int>(decomposition.rank()),
            .residual = missing.size() > 0 ? missing.lpNorm<Eigen::Infinity>() : 0.0};
  }

 private:
  void add_row(ConstraintRows& rows, const MaterialFrame& point, const Vec3& direction) {
    const FrameInstant at = point.at(states_, StepTime::kStart);
    scale_ = std::max(scale_, at.position.norm());
    rows.add(point.side(at, direction, modal_), {}, {});
  }

  Eigen::MatrixXd jacobian(const ConstraintRows& rows) const {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> J(rows.size(), bodies_.degrees_of_freedom());
    bodies_.write_jacobian(rows, {J.data(), static_cast<std::size_t>(J.size())});
    return J;
  }

  Eigen::VectorXd wanted_less_coming() {
    if (options_.level != ManipulationLevel::kAcceleration && options_.level != ManipulationLevel::kVelocity)
      for (Index b = 0; b < bodies_.count(); ++b)
        bodies_.body(b).group->predict(bodies_.body(b).slot,
                                       bodies_.body(b).group->own_gravity(bodies_.body(b).slot, options_.gravity));
    Eigen::VectorXd missing(static_cast<Eigen::Index>(wishes_.size()));
    for (std::size_t i = 0; i < wishes_.size(); ++i) {
      const PointWish& wish = wishes_[i];
      Vec3 comes = Vec3::Zero();
      switch (options_.level) {
        case ManipulationLevel::kAcceleration:
          comes =
              acceleration(table_[static_cast<std::size_t>(wish.point.body())], states_, wish.point, options_.gravity);
          break;
        case ManipulationLevel::kVelocity:
          comes = wish.point.velocity(states_, StepTime::kStart);
          break;
        default:
          comes = wish.point.position(states_, StepTime::kEnd);
      }
      missing[static_cast<Eigen::Index>(i)] = wish.wanted - wish.direction.dot(comes);
    }
    return missing;
  }

  /// Forces go to the loads of the next step, impulses to the velocities.
  void apply(const Eigen::VectorXd& f) {
    for (Index row = 0; row < forced_.size(); ++row) {
      const ConstraintRows::Side& side = forced_.row(row).sides[0];
      const ConstrainedBody& body = table_[static_cast<std::size_t>(side.body)];
      const bool held = options_.level == ManipulationLevel::kPosition;
      const double scale = f[row] / (held ? body.group->step_length() : 1.0);
      std::vector<double> modal(forced_.modal(side).begin(), forced_.modal(side).end());
      for (double& m : modal) m *= scale;
      if (held || options_.level == ManipulationLevel::kAcceleration)
        body.group->apply_generalized_force(body.slot, scale * side.linear, scale * side.angular, modal);
      else
        body.group->apply_generalized_impulse(body.slot, scale * side.linear, scale * side.angular, modal);
    }
  }

  std::span<const ConstrainedBody> table_;
  std::span<const PointWish> wishes_;
  BodyStates states_;
  ManipulationOptions options_;
  IslandBodies bodies_;
  ConstraintRows measured_, forced_;
  std::vector<double> modal_;
  double scale_ = 1e-300;
};

}  // namespace

ManipulationResult manipulate(std::span<const ConstrainedBody> table, std::span<const PointWish> wishes,
                              std::span<const PointForce> forces, std::span<double> impulses,
                              const ManipulationOptions& options) {
  check(table, wishes, forces, impulses, options);
  return Manipulation(table, wishes, forces, options).run(impulses);
}

}  // namespace limber
