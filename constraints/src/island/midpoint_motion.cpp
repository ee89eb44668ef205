#include "midpoint_motion.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "../tuning.h"
#include "limber/core/cross_matrix.h"

namespace limber::internal {
namespace {

Vec3 part(const Vector& v, Index local, int which) { return v.segment<3>(6 * local + 3 * which); }

/// What a change of τ turns the body by at the end.
Mat3 end_turn(const Vec3& turn) {
  return (Mat3::Identity() + 0.5 * cross_matrix(turn)) / (1.0 + 0.25 * turn.squaredNorm());
}

/// τ of free flight: (1 + ½[τ]) I τ = Δt L.
Vec3 free_turn(const Mat3& inertia, const Vec3& momentum, double length) {
  Vec3 turn = length * inertia.inverse() * momentum;
  // What is far from a sphere and turns fast is approached from the side of no turn.
  if (turn.norm() > 1.0) turn /= turn.norm();
  for (int i = 0; i < kConstraintsTuning.midpoint.most_free_turn; ++i) {
    const Vec3 spin = inertia * turn;
    const Vec3 residual = spin + 0.5 * turn.cross(spin) - length * momentum;
    const Mat3 slope = inertia + 0.5 * (cross_matrix(turn) * inertia - cross_matrix(spin));
    Vec3 change = slope.inverse() * residual;
    const double size = change.norm(), most = 1.0 + 0.5 * turn.norm();
    if (!(size > 1e-15 * (1.0 + turn.norm()))) break;
    if (size > most) change *= most / size;
    turn -= change;
  }
  return turn;
}

/// Of three rows, what a projection leaves.
template <class Rows>
void keep(const Mat3& projection, Rows&& rows) {
  for (Eigen::Index j = 0; j < rows.cols(); ++j) rows.col(j) = (projection * Vec3(rows.col(j))).eval();
}

}  // namespace

/// (1 − (1 − s)[τ]): of what acts, in the equation of the turn.
Mat3 MidpointMotion::late(const Vec3& turn) const { return Mat3::Identity() - (1.0 - share_) * cross_matrix(turn); }

/// By what holds the body to its line: m in (1 + ½[τ]) I τ/Δt = L₀ + s (1 − (1 − s)[τ])(L₁ − L₀ + m), across the line.
Vec3 MidpointMotion::parent_moment(const Body& b, const Vec3& after) const {
  const Vec3 spin = b.inertia * b.turn / length_, left = (spin + 0.5 * b.turn.cross(spin) - b.momentum) / share_;
  const Vec3 moment = late(b.turn).inverse() * left - (after - b.momentum);
  return moment - b.loose * moment;
}

void MidpointMotion::begin(IslandStep& step, bool bends) {
  const double h = step.length();
  bodies_.clear(), carried_.clear();
  length_ = h, bends_ = bends;
  share_ = step.loads_at_start ? 1.0 : 0.5;
  Index modes = 0;
  for (Index local = 0; local < step.bodies.count(); ++local) {
    const ConstrainedBody& at = step.bodies.body(local);
    const FrameConstants& c = at.group->frame_constants();
    const RigidFrame& frame = at.group->frame(at.slot);
    const Mat3 R = to_matrix(frame.pose().q);
    Body body{.momentum = frame.angular_momentum(c),
              .torque = h * at.group->held_torque(at.slot),
              .inertia = R * c.inertia * R.transpose(),
              .easy = R * c.inertia.inverse() * R.transpose(),
              .mass = c.mass,
              .size = std::sqrt(c.inertia.trace() / c.mass),
              .far = distance_tolerance(0.0, 0.0, frame.pose().p),
              .first_mode = modes,
              .modes = step.bodies.response(local).modes};
    body.flight =
        h * frame.velocity() + share_ * h * h * (step.gravity_of(local) + at.group->held_force(at.slot) / c.mass);
    if (c.motion == FrameMotion::kPoint) body.turn = free_turn(body.inertia, body.momentum, h);
    if (c.motion != FrameMotion::kFree) begin_carried(step, local, body);
    body.shift = body.flight;  // and what is free turns as guess() tells
    modes += body.modes;
    bodies_.push_back(body);
  }
  response_.setZero(modes), load_.setZero(modes);
  if (!bends) return;
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    const std::span<const double> response = step.bodies.response(local).position_modes;
    std::ranges::copy(response, response_.data() + b.first_mode);
  }
}

void MidpointMotion::guess(const IslandStep& step, std::span<const double> impulses) {
  sum_impulses(step.rows, step.bodies, impulses);
  for (Index local = 0; local < count(); ++local) {
    Body& b = bodies_[static_cast<std::size_t>(local)];
    if (b.carried >= 0) continue;
    b.shift = b.flight + share_ * length_ / b.mass * impulse_[static_cast<std::size_t>(local)];
    b.turn = free_turn(b.inertia, b.momentum + share_ * (moment_[static_cast<std::size_t>(local)] + b.torque), length_);
  }
  load_.setZero();
  for (Index i = 0; bends_ && i < step.rows.size(); ++i)
    for (const ConstraintRows::Side& side : step.rows.row(i).sides) {
      const Index local = step.bodies.local(side.body);
      if (local < 0) continue;
      const std::span<const double> shapes = step.rows.modal(side);
      for (std::size_t k = 0; k < shapes.size(); ++k)
        load_[first_mode(local) + static_cast<Index>(k)] += impulses[static_cast<std::size_t>(i)] * shapes[k];
    }
}

/// To impulse_ and moment_.
void MidpointMotion::sum_impulses(const ConstraintRows& rows, const IslandBodies& bodies,
                                  std::span<const double> impulses) {
  impulse_.assign(bodies_.size(), Vec3::Zero()), moment_.assign(bodies_.size(), Vec3::Zero());
  for (Index i = 0; i < rows.size(); ++i)
    for (const ConstraintRows::Side& side : rows.row(i).sides)
      if (const Index local = bodies.local(side.body); local >= 0) {
        impulse_[static_cast<std::size_t>(local)] += impulses[static_cast<std::size_t>(i)] * side.linear;
        moment_[static_cast<std::size_t>(local)] += impulses[static_cast<std::size_t>(i)] * side.angular;
      }
}

void MidpointMotion::begin_carried(const IslandStep& step, Index local, Body& body) {
  const ConstrainedBody& at = step.bodies.body(local);
  const FrameConstants& c = at.group->frame_constants();
  const RigidFrame& start = at.group->frame(at.slot);
  const bool turns = c.motion != FrameMotion::kKinematic;
  Carried carried(start);
  carried.torque = body.torque;
  carried.excitation = carried.end.begin_step(c, {.gravity = turns ? Vec3::Zero() : step.gravity_of(local)},
                                              at.group->first_moment(at.slot), length_);
  const KinematicFrame& parent = carried.end.parent();
  body.flight = carried.end.pose().p - start.pose().p;
  body.carried = static_cast<Index>(carried_.size());
  if (turns) {
    carried.field = length_ * (step.gravity_of(local) - parent.acceleration);
  } else {
    const Quaternion turn = carried.end.pose().q * start.pose().q.conjugate();
    body.turn = 2.0 / turn.w * turn.vector();
    body.loose = body.kept = body.easy = Mat3::Zero();
  }
  carried.turn = parent.pose.q * start.parent().pose.q.conjugate();
  if (c.motion == FrameMotion::kLine) {
    const Vec3 line = start.pose().q * c.line_axis;
    carried.line = carried.turn * line;
    carried.angle = length_ * line.dot(start.angular_velocity(c) - start.parent().angular_velocity);
  }
  carried_.push_back(carried);
  if (c.motion == FrameMotion::kLine) turn_about_line(body);
}

/// (1 + ½[τ])⁻¹(1 + ¼τ²) = 1 + ¼ττᵀ − ½[τ] takes what turns the body at the end to a change of τ.
void MidpointMotion::turn_about_line(Body& body) {
  Carried& carried = carried_[static_cast<std::size_t>(body.carried)];
  const Vec3 half = 0.5 * carried.angle * carried.line;
  const Quaternion turn = Quaternion{1.0, half.x(), half.y(), half.z()} * carried.turn;
  const Vec3& line = carried.line;
  body.turn = 2.0 / turn.w * turn.vector();
  carried.tangent = (line + 0.25 * body.turn * body.turn.dot(line) - 0.5 * body.turn.cross(line)) /
                    (1.0 + 0.25 * carried.angle * carried.angle);
  const Vec3 along = carried.tangent.normalized();
  body.loose = along * along.transpose();
  // What holds the body to its line is across it: so much of ½(1 − ½[τ]) m is not to count.
  const Vec3 late = 2.0 * (1.0 - share_) * body.turn;
  body.kept = along * (along + 0.25 * late * late.dot(along) - 0.5 * late.cross(along)).transpose() /
              (1.0 + 0.25 * late.squaredNorm());
  body.easy = body.loose / along.dot(body.inertia * along);
}

Quaternion MidpointMotion::attitude(const IslandStep& step, Index local) const {
  const Vec3 half = 0.5 * bodies_[static_cast<std::size_t>(local)].turn;
  const ConstrainedBody& at = step.bodies.body(local);
  return normalized(normalized(Quaternion{1.0, half.x(), half.y(), half.z()}) * at.group->frame(at.slot).pose().q);
}

/// The body's frame where it is at the end. Of one with fixed nodes, its momentum with it.
RigidFrame MidpointMotion::end_of(IslandStep& step, Index local, const Vec3& angular_momentum) const {
  const Body& b = bodies_[static_cast<std::size_t>(local)];
  const ConstrainedBody& at = step.bodies.body(local);
  const FrameConstants& c = at.group->frame_constants();
  if (c.motion == FrameMotion::kFree) {
    RigidFrame end = at.group->frame(at.slot);
    end.set_pose({attitude(step, local), end.pose().p + b.shift});
    return end;
  }
  RigidFrame end = carried_[static_cast<std::size_t>(b.carried)].end;
  if (c.motion != FrameMotion::kKinematic) end.set_turn(c, attitude(step, local), angular_momentum);
  return end;
}

/// What the modes feel of a frame that its parent carries: the field as it does its work on them, and of a body on a
/// line that a turning parent carries the mean of both ends, at its mean rate.
FrameExcitation MidpointMotion::excitation_of(const IslandStep& step, Index local, const RigidFrame& end) const {
  const Body& b = bodies_[static_cast<std::size_t>(local)];
  const Carried& carried = carried_[static_cast<std::size_t>(b.carried)];
  const ConstrainedBody& at = step.bodies.body(local);
  const FrameConstants& c = at.group->frame_constants();
  const RigidFrame& start = at.group->frame(at.slot);
  FrameExcitation excitation = carried.excitation;
  if (c.motion == FrameMotion::kKinematic) return excitation;
  const Quaternion q0 = start.pose().q.conjugate(), q1 = end.pose().q.conjugate();
  excitation.field = q0 * Vec3((carried.field - 0.5 * b.turn.cross(carried.field)) / length_);
  if (c.motion == FrameMotion::kPoint) return excitation;
  const Vec3 omega0 = q0 * start.parent().angular_velocity, omega1 = q1 * end.parent().angular_velocity;
  const Vec3& alpha = end.parent().angular_acceleration;
  const double rate = 2.0 * std::atan(0.5 * carried.angle) / length_;
  excitation.angular_acceleration = 0.5 * (q0 * alpha + q1 * alpha + (omega0 + omega1).cross(rate * c.line_axis));
  excitation.spin = 0.5 * (omega0 * omega0.transpose() + omega1 * omega1.transpose());
  return excitation;
}

void MidpointMotion::predict(IslandStep& step, Index local, const RigidFrame& end) {
  const Body& b = bodies_[static_cast<std::size_t>(local)];
  const ConstrainedBody& at = step.bodies.body(local);
  if (!bends_) return at.group->predict_rest(at.slot, end);
  const FrameExcitation excitation = b.carried < 0 ? FrameExcitation{} : excitation_of(step, local, end);
  at.group->predict(at.slot, end, excitation, {load_.data() + b.first_mode, static_cast<std::size_t>(b.modes)},
                    step.bodies.modal_step(local));
}

void MidpointMotion::place(IslandStep& step) {
  for (Index local = 0; local < count(); ++local) {
    Body& b = bodies_[static_cast<std::size_t>(local)];
    predict(step, local, end_of(step, local, b.momentum));
    if (b.carried < 0) continue;
    const ConstrainedBody& at = step.bodies.body(local);
    const Carried& carried = carried_[static_cast<std::size_t>(b.carried)];
    const Vec3 mass_moment = at.group->frame(at.slot).pose().q * at.group->first_moment(at.slot) +
                             at.group->predicted_frame(at.slot).pose().q * at.group->predicted_first_moment(at.slot);
    b.torque = carried.torque + 0.5 * mass_moment.cross(carried.field);
  }
  step.measure(StepTime::kEnd, step.gap);
  step.linearise(StepTime::kEnd, step.end_rows);
  step.linearise(StepTime::kMiddle, step.midpoint_rows);
}

void MidpointMotion::take_rows(const IslandStep& step, std::vector<MidpointRow>& rows) const {
  rows.resize(static_cast<std::size_t>(step.midpoint_rows.size()));
  for (Index i = 0; i < step.midpoint_rows.size(); ++i)
    for (std::size_t s = 0; s < 2; ++s) {
      const ConstraintRows::Side &middle = step.midpoint_rows.row(i).sides[s], &end = step.end_rows.row(i).sides[s];
      MidpointRow::Side& side = rows[static_cast<std::size_t>(i)].sides[s];
      side.body = step.bodies.local(middle.body);
      if (side.body < 0) continue;
      const Body& b = bodies_[static_cast<std::size_t>(side.body)];
      side.force << share_ * middle.linear, share_ * (late(b.turn) * middle.angular);
      side.gap << end.linear, (end.angular - 0.5 * b.turn.cross(end.angular)) / (1.0 + 0.25 * b.turn.squaredNorm());
      side.modal_force = step.midpoint_rows.modal(middle), side.modal_gap = step.end_rows.modal(end);
      if (b.carried >= 0) side.force << Vec3::Zero(), b.kept * Vec3(side.force.tail<3>());
    }
}

bool MidpointMotion::find_residual(std::span<const MidpointRow> rows, std::span<const double> impulses,
                                   Vector& residual, Vector& modal) {
  residual.resize(6 * count()), terms_.resize(2 * count());
  modal = load_;
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    const Vec3 spin = b.inertia * b.turn / length_,
               turned = spin + 0.5 * b.turn.cross(spin) - share_ * (late(b.turn) * b.torque);
    const double mass = b.carried < 0 ? b.mass / length_ : 0.0;
    residual.segment<6>(6 * local) << mass * (b.shift - b.flight), b.kept * (turned - b.momentum);
    terms_.segment<2>(2 * local) << mass * (b.shift.norm() + b.flight.norm()),
        spin.norm() + b.torque.norm() + b.momentum.norm();
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double p = impulses[i];
    if (p == 0.0) continue;
    rows[i].for_sides([&](const MidpointRow::Side& side) {
      residual.segment<6>(6 * side.body) -= p * side.force;
      terms_[2 * side.body] += std::abs(p) * side.force.head<3>().norm();
      terms_[2 * side.body + 1] += std::abs(p) * side.force.tail<3>().norm();
      const Index first = first_mode(side.body);
      for (std::size_t k = 0; k < side.modal_force.size(); ++k)
        modal[first + static_cast<Index>(k)] -= p * side.modal_force[k];
    });
  }
  bool met = true;
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    const double least =
        kConstraintsTuning.midpoint.met * (kConstraintsTuning.midpoint.length_tolerance + b.far / b.size) / length_;
    met = met &&
          part(residual, local, 0).norm() <=
              std::max(digits_of(terms_[2 * local]), least * b.mass * (b.size + b.shift.norm())) &&
          (part(residual, local, 1).norm() <= digits_of(terms_[2 * local + 1]) ||
           (b.easy * part(residual, local, 1)).norm() <= least);
  }
  return met;
}

void MidpointMotion::find_derivative(const IslandStep& step, std::span<const double> impulses, Matrix& K) {
  struct Sum final : ForceDerivative {
    const IslandStep& step;
    MidpointMotion& motion;
    const std::vector<Body>& bodies;
    Matrix& K;
    Sum(const IslandStep& s, MidpointMotion& m, Matrix& k) : step(s), motion(m), bodies(m.bodies_), K(k) {}
    void add_bending(Index body, const Vec3& impulse, std::span<const Vec3> shapes) override {
      const Index i = step.bodies.local(body);
      if (i < 0 || shapes.empty()) return;
      const Body& b = bodies[static_cast<std::size_t>(i)];
      const ConstrainedBody& at = step.bodies.body(i);
      const Mat3 f = cross_matrix(impulse);
      const Mat3 by_place =
          0.5 * motion.share_ * motion.late(b.turn) * f * to_matrix(at.group->predicted_frame(at.slot).pose().q);
      const Mat3 by_turn = -0.5 * f * to_matrix(at.group->frame(at.slot).pose().q);
      for (std::size_t k = 0; k < shapes.size(); ++k) {
        motion.bend_.col(b.first_mode + static_cast<Index>(k)) += by_place * shapes[k];
        motion.turned_.col(b.first_mode + static_cast<Index>(k)) += by_turn * shapes[k];
      }
    }
    void add(Index body, Of of, Index moved, By by, const Mat3& value) override {
      const Index i = step.bodies.local(body), j = step.bodies.local(moved);
      if (i < 0 || j < 0) return;
      Mat3 d = -motion.share_ * value;
      if (of == Of::kMoment) d = motion.late(bodies[static_cast<std::size_t>(i)].turn) * d;
      if (by == By::kTurn) d = d * end_turn(bodies[static_cast<std::size_t>(j)].turn);
      K.block<3, 3>(6 * i + (of == Of::kMoment ? 3 : 0), 6 * j + (by == By::kTurn ? 3 : 0)) += d;
    }
  };
  const double h = step.length();
  K.setZero(6 * count(), 6 * count());
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    K.block<3, 3>(6 * local, 6 * local) = b.mass / h * Mat3::Identity();
    K.block<3, 3>(6 * local + 3, 6 * local + 3) =
        (b.inertia + 0.5 * (cross_matrix(b.turn) * b.inertia - cross_matrix(b.inertia * b.turn))) / h -
        share_ * (1.0 - share_) * cross_matrix(b.torque);
  }
  for (Index i = 0; i < step.midpoint_rows.size(); ++i)
    for (const ConstraintRows::Side& side : step.midpoint_rows.row(i).sides)
      if (const Index local = step.bodies.local(side.body); local >= 0)
        K.block<3, 3>(6 * local + 3, 6 * local + 3) -=
            share_ * (1.0 - share_) * impulses[static_cast<std::size_t>(i)] * cross_matrix(side.angular);
  bend_.setZero(3, load_.size()), turned_.setZero(3, load_.size()), swung_.setZero(3, load_.size());
  Sum sum(step, *this, K);
  const BodyStates states(step.part.table);
  for (std::size_t i = 0; i < step.part.constraints.size(); ++i) {
    const auto begin = static_cast<std::size_t>(step.first_row[i]),
               end = static_cast<std::size_t>(step.first_row[i + 1]);
    step.part.constraints[i]->add_force_derivative(states, impulses.subspan(begin, end - begin), sum);
  }
  for (Index local = 0; local < count(); ++local)
    if (bodies_[static_cast<std::size_t>(local)].carried >= 0) find_field_derivative(step, local, K);
  hold_carried(K);
}

/// Of the moment that the field exerts, by turning and bending, and of what the modes get of it by turning.
void MidpointMotion::find_field_derivative(const IslandStep& step, Index local, Matrix& K) {
  const Body& b = bodies_[static_cast<std::size_t>(local)];
  const auto& [group, slot, pose] = step.bodies.body(local);
  const Mat3 field = cross_matrix(carried_[static_cast<std::size_t>(b.carried)].field),
             start = to_matrix(group->frame(slot).pose().q), end = to_matrix(group->predicted_frame(slot).pose().q),
             by_place = 0.5 * share_ * late(b.turn) * field;
  K.block<3, 3>(6 * local + 3, 6 * local + 3) -=
      by_place * cross_matrix(end * group->predicted_first_moment(slot)) * end_turn(b.turn);
  if (!bends_) return;
  const PropagatorTable& table = step.bodies.modal_step(local).table();
  for (Index k = 0; k < b.modes; ++k) {
    const Vec3& p = group->model().data().participation[static_cast<std::size_t>(k)];
    bend_.col(b.first_mode + k) += by_place * (end * p);
    swung_.col(b.first_mode + k) -= 0.5 * table.at(k).z_g / length_ * (field * (start * p));
  }
}

/// What parents hold does not change: of the equations of bodies with fixed nodes those of free turns are left.
void MidpointMotion::hold_carried(Matrix& K) {
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    if (b.carried < 0) continue;
    K.middleRows<3>(6 * local).setZero();
    K.block<3, 3>(6 * local, 6 * local) = b.mass / length_ * Mat3::Identity();
    keep(b.kept, K.middleRows<3>(6 * local + 3));
    K.block<3, 3>(6 * local + 3, 6 * local + 3) += b.inertia.trace() / length_ * (Mat3::Identity() - b.loose);
    keep(b.kept, bend_.middleCols(b.first_mode, b.modes));
  }
}

void MidpointMotion::condense(const Vector& modal_residual, Vector& residual) const {
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    residual.segment<3>(6 * local + 3).noalias() -=
        bend_.middleCols(b.first_mode, b.modes) * modal_residual.segment(b.first_mode, b.modes);
  }
}

void MidpointMotion::condense(Matrix& K, std::span<MidpointRow> rows) {
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    const Index turn = 6 * local + 3;
    for (Index k = b.first_mode; k < b.first_mode + b.modes; ++k) {
      swung_.col(k) += response_[k] * turned_.col(k);
      const Vec3 bend = bend_.col(k);
      K.block<3, 3>(turn, turn) += bend * swung_.col(k).transpose();
      bend_.col(k) *= response_[k];
    }
  }
  for (MidpointRow& row : rows)
    for (MidpointRow::Side& side : row.sides) {
      if (side.body < 0) continue;
      const Index first = first_mode(side.body);
      for (std::size_t k = 0; k < side.modal_force.size(); ++k) {
        side.force.tail<3>() -= side.modal_force[k] * bend_.col(first + static_cast<Index>(k));
        side.gap.tail<3>() += side.modal_gap[k] * swung_.col(first + static_cast<Index>(k));
      }
    }
}

double MidpointMotion::through_modes(const MidpointRow& i, const MidpointRow& j) const {
  double sum = 0.0;
  i.for_sides([&](const MidpointRow::Side& measured) {
    j.for_sides([&](const MidpointRow::Side& pushed) {
      if (measured.body != pushed.body) return;
      const double* response = response_.data() + first_mode(measured.body);
      for (std::size_t k = 0; k < measured.modal_gap.size(); ++k)
        sum += measured.modal_gap[k] * response[k] * pushed.modal_force[k];
    });
  });
  return sum;
}

void MidpointMotion::add_turned(const Vector& change, Vector& load) const {
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    load.segment(b.first_mode, b.modes) +=
        turned_.middleCols(b.first_mode, b.modes).transpose() * part(change, local, 1);
  }
}

double MidpointMotion::mobility(const MidpointRow& row) const {
  double sum = 0.0;
  row.for_sides([&](const MidpointRow::Side& side) {
    const Body& b = bodies_[static_cast<std::size_t>(side.body)];
    const Vec3 turned = side.gap.tail<3>(), moment = side.force.tail<3>();
    sum += side.force.head<3>().norm() * side.gap.head<3>().norm() / b.mass +
           std::sqrt(turned.dot(b.easy * turned) * moment.dot(b.easy * moment));
  });
  return length_ * sum;
}

double MidpointMotion::force_to_inertia(const Matrix& K) const {
  double largest = 0.0;
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    const Mat3 turning = K.block<3, 3>(6 * local + 3, 6 * local + 3) - b.inertia / length_;
    largest = std::max(largest, length_ * (b.easy * turning).norm());
  }
  return largest;
}

void MidpointMotion::move(const Vector& change, const Vector& load, double how_much) {
  for (Index local = 0; local < count(); ++local) {
    Body& b = bodies_[static_cast<std::size_t>(local)];
    if (b.carried >= 0 && !carried_[static_cast<std::size_t>(b.carried)].line.isZero(0.0)) {
      Carried& carried = carried_[static_cast<std::size_t>(b.carried)];
      carried.angle += how_much * part(change, local, 1).dot(carried.tangent) / carried.tangent.squaredNorm();
      turn_about_line(b);
      continue;
    }
    b.shift += how_much * part(change, local, 0);
    b.turn += how_much * part(change, local, 1);
  }
  load_ += how_much * load;
}

void MidpointMotion::write_place(Vector& to) const {
  to.resize(6 * count());
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    to.segment<6>(6 * local) << b.shift / b.size, b.turn;
  }
}

void MidpointMotion::write_relative(const Vector& change, Eigen::Ref<Vector> to) const {
  for (Index local = 0; local < count(); ++local)
    to.segment<6>(6 * local) << part(change, local, 0) / bodies_[static_cast<std::size_t>(local)].size,
        part(change, local, 1);
}

double MidpointMotion::size_of(const Vector& change) const {
  double largest = 0.0;
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    const double turn = (end_turn(b.turn) * part(change, local, 1)).norm();
    const double shift = part(change, local, 0).norm() / (b.size + b.shift.norm());
    const double tolerance = kConstraintsTuning.midpoint.length_tolerance + b.far / b.size;
    largest = std::isfinite(turn + shift) ? std::max(largest, std::max(turn, shift) / tolerance) : kUnbounded;
  }
  return largest;
}

double MidpointMotion::part_of(const Vector& change) const {
  double whole = 1.0;
  for (Index local = 0; local < count(); ++local) {
    const double turn = part(change, local, 1).norm(),
                 most = 1.0 + 0.5 * bodies_[static_cast<std::size_t>(local)].turn.norm();
    if (turn > most) whole = std::min(whole, most / turn);
  }
  return whole;
}

void MidpointMotion::finish(IslandStep& step, std::span<const double> impulses) {
  const double h = step.length();
  sum_impulses(step.midpoint_rows, step.bodies, impulses);
  for (Index local = 0; local < count(); ++local) {
    const Body& b = bodies_[static_cast<std::size_t>(local)];
    const ConstrainedBody& at = step.bodies.body(local);
    Vec3 momentum = b.momentum + moment_[static_cast<std::size_t>(local)] + b.torque;
    if (b.carried >= 0) {
      momentum += parent_moment(b, momentum);
      predict(step, local, end_of(step, local, momentum));
      continue;
    }
    RigidFrame end = at.group->frame(at.slot);
    const Vec3 velocity = end.velocity() + h * step.gravity_of(local) +
                          (impulse_[static_cast<std::size_t>(local)] + h * at.group->held_force(at.slot)) / b.mass;
    end.set_motion({attitude(step, local), end.pose().p + b.shift}, velocity, momentum);
    predict(step, local, end);
  }
}

void MidpointMotion::stay(IslandStep& step) {
  begin(step, false);
  for (Index local = 0; local < count(); ++local) {
    Body& b = bodies_[static_cast<std::size_t>(local)];
    const ConstrainedBody& at = step.bodies.body(local);
    const FrameConstants& c = at.group->frame_constants();
    if (b.carried < 0) {
      RigidFrame frame = at.group->frame(at.slot);
      frame.set_velocity(c, 0.5 * frame.velocity(), 0.5 * frame.angular_velocity(c));
      predict(step, local, frame);
      continue;
    }
    Carried& carried = carried_[static_cast<std::size_t>(b.carried)];
    if (c.motion == FrameMotion::kPoint) b.turn = Vec3::Zero();
    if (c.motion == FrameMotion::kLine) {
      carried.angle = 0.0;
      turn_about_line(b);
    }
    predict(step, local, end_of(step, local, 0.5 * b.momentum));
  }
  step.measure(StepTime::kEnd, step.gap);
}

}  // namespace limber::internal
