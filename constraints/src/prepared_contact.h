/// @file prepared_contact.h
/// Contacts as the rows of a step see them: points that their bodies carry along. Private to the constraints module.
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "limber/constraints/constraint.h"
#include "limber/dynamics/body_shape.h"
#include "limber/dynamics/contact_source.h"
#include "tuning.h"

namespace limber {

/// By how much a body turns in the step, world, rad, whole turns and all: what it turns by as it turns at the step's
/// end, and what is left from there to where it is. (From its orientations alone only the shortest turn could be told.)
inline Vec3 turn_of_step(const BodyStates& states, Index body, double step) {
  if (states.is_static(body)) return Vec3::Zero();
  const Vec3 turn = step * states.angular_velocity(body, StepTime::kEnd);
  const Quaternion turned = states.pose(body, StepTime::kEnd).q * states.pose(body, StepTime::kStart).q.conjugate();
  return turn + rotation_vector(turned * quaternion_from_rotation_vector(-turn));
}

/// The share of a contact's force that a vertex of the collision surface takes.
struct VertexShare {
  Index vertex = -1;
  double share = 0.0;  // > 0
};

/// One side of a contact, prepared.
struct PreparedSide {
  Index body = -1;
  const ModalModel* model = nullptr;  // null: a rigid shape, or one that stands still
  SurfacePoint at{};
  std::span<const VertexShare> corners{};  // with a residual compliance: the vertices that the point lies between
  Mat3* turn = nullptr;                    // of what they yield, at the step's start; null: the body has no skin
  SkinMemory* skin = nullptr;              // null: the body bends by its modes alone
  Vec3 start_point = Vec3::Zero();  // place() at the step's start; where the surface is that of a ball, its centre
  Vec3 rim = Vec3::Zero();          // from there to where it touches, world; as the normal it stays for the step

  /// @pre with a model
  BodyShape shape(std::span<const double> z) const { return {*model, z, skin}; }

  /// What the body yields beyond its modes, in its own axes, from that of the rest shape; and the other way, a force.
  Vec3 turned(const Vec3& u) const { return turn == nullptr ? u : Vec3(*turn * u); }
  Vec3 turned_back(const Vec3& f) const { return turn == nullptr ? f : Vec3(turn->transpose() * f); }

  /// Where the body touches, at one of the step's ends.
  Vec3 position(const BodyStates& states, StepTime when) const {
    return states.pose(body, when) * place(states.amplitudes(body, when)) + rim;
  }
  Vec3 start_position(const BodyStates& states) const {
    return states.pose(body, StepTime::kStart) * start_point + rim;
  }
  /// How far what is there has come beyond that by rolling, by the end of the step.
  Vec3 rolled(const BodyStates& states, double step) const { return turn_of_step(states, body, step).cross(rim); }
  /// Body frame. @param z amplitudes
  Vec3 place(std::span<const double> z) const { return model == nullptr ? start_point : shape(z).position(at); }
  /// Its velocity by the rates ż.
  Vec3 deforming(std::span<const double> z, std::span<const double> rates) const {
    return shape(z).velocity(at, rates);
  }
};

struct PreparedContact {
  std::uint64_t id = 0;
  PreparedSide a, b;
  Index yielding = -1;           // the body that the energy of its spring is counted with
  Mat3 axes = Mat3::Identity();  // columns: normal, two tangents; world
  double friction = 0.0;
  double restitution = 0.0;     // of small steps alone
  Vec3 running = Vec3::Zero();  // of a's surface over a less that of b's over b, world, m/s
  double approach = 0.0;        // m/s, as ContactEvent::approach
  Vec3 offset = Vec3::Zero();   // p_a − p_b at the step's start, world
  Vec3 start_position = Vec3::Zero();
  Vec3 last_force = Vec3::Zero();  // world, on a, N
  Vec3 mean_force = Vec3::Zero();  // the same over the step; of small steps alone
  double compliance = 0.0;         // what the contact yielded to it by itself, m/N
  double slip = 0.0;               // beyond what its spring gave, m
  Vec3 impulse = Vec3::Zero();     // of this step, world, on a

  /// Its rows: along the normal, and along the tangents where it has friction.
  Index rows() const { return friction == 0.0 ? 1 : 3; }
  /// Its sides by number. Forces and displacements of b count the other way.
  const PreparedSide& side(std::size_t number) const { return number == 0 ? a : b; }
  static double sign(std::size_t side) { return side == 0 ? 1.0 : -1.0; }
  /// p_a − p_b, world.
  Vec3 apart(const BodyStates& states, StepTime when) const {
    return a.position(states, when) - b.position(states, when);
  }
  /// World, on a. @param impulses of its rows, and more
  Vec3 impulse_of(std::span<const double> impulses) const {
    Vec3 sum = Vec3::Zero();
    for (Index axis = 0; axis < rows(); ++axis) sum += impulses[static_cast<std::size_t>(axis)] * axes.col(axis);
    return sum;
  }
};

/// Written where it is to be: a copy would wait for what was just written.
/// @param inwards the normal, into the body. @param made a new one
inline void make_side(const BodyStates& states, const ContactSide& side, const Vec3& inwards, PreparedSide& made) {
  made.body = side.body;
  made.start_point = side.point_B;
  if (side.radius > 0.0 && !states.is_static(side.body)) {
    made.rim = -side.radius * inwards;
    made.start_point -= states.pose(side.body, StepTime::kStart).q.conjugate() * made.rim;
  }
  if (side.triangle < 0 || states.is_static(side.body)) return;
  made.model = &states.body(side.body).group->model();
  made.at = {.surface = SurfacePoint::Surface::kCollision, .triangle = side.triangle, .weight = side.weight};
  made.skin = states.body(side.body).group->skin(states.body(side.body).slot);
}

inline bool flexes(const PreparedSide& side) {
  return side.model != nullptr && (side.model->modes() > 0 || side.model->data().residual_compliance.has_value());
}

inline bool is_round(const PreparedSide& side) { return !side.rim.isZero(0.0); }

inline bool yields(const PreparedSide& side) {
  return side.model != nullptr && side.model->data().residual_compliance.has_value();
}

/// Row of the velocity of a side's point along n, its arm ending at `end`, which both sides share. In the middle of a
/// step a body with a skin gets what moves the point as the modes go through it (BodyShape, BodyStates).
inline RowSide point_row(const BodyStates& states, StepTime when, const PreparedSide& side, const Vec3& end,
                         const Vec3& n, std::vector<double>& modal) {
  modal.clear();
  if (states.is_static(side.body)) return {};
  const RowSide row{side.body, n, (end - states.origin(side.body, when)).cross(n), {}};
  if (side.model == nullptr) return row;
  modal.assign(static_cast<std::size_t>(side.model->modes()), 0.0);
  if (when == StepTime::kMiddle) {
    const Vec3 n_B = states.rotation(side.body, when).transpose() * n;
    if (side.skin == nullptr)
      side.shape({}).add_force(side.at, n_B, modal);
    else
      for (const auto& [shape, weight] : states.shapes_between(side.body))
        shape.add_force(side.at, weight * n_B, modal);
  } else {
    const Vec3 n_B = states.pose(side.body, when).q.conjugate() * n;
    side.shape(states.amplitudes(side.body, when)).add_force(side.at, n_B, modal);
  }
  return {row.body, row.linear, row.angular, modal};
}

/// How closely a gap can be met: by the arms of its points a and b, and their place.
inline double gap_tolerance(const BodyStates& states, StepTime when, const PreparedContact& contact, const Vec3& a,
                            const Vec3& b) {
  double arms = 0.0;
  if (!states.is_static(contact.a.body)) arms += (a - states.origin(contact.a.body, when)).norm();
  if (!states.is_static(contact.b.body)) arms += (b - states.origin(contact.b.body, when)).norm();
  return distance_tolerance(internal::kConstraintsTuning.rows.contact_tolerance, arms, a);
}

/// From where they touch to the nearer of the origins of those that move.
inline double shorter_arm(const BodyStates& states, const PreparedContact& contact) {
  double arm = std::numeric_limits<double>::infinity();
  for (const PreparedSide* side : {&contact.a, &contact.b})
    if (!states.is_static(side->body))
      arm = std::min(arm, (side->start_position(states) - states.pose(side->body, StepTime::kStart).p).norm());
  return arm;
}

}  // namespace limber
