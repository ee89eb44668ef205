/// @file prepared_contact.h
/// Contacts as the rows of a step see them: points that their bodies carry along. Private to the constraints module.
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "contact_geometry.h"
#include "limber/constraints/constraint.h"
#include "limber/dynamics/contact_source.h"
#include "limber/dynamics/exact_motion.h"
#include "limber/dynamics/surface_point.h"

namespace limber {

/// A material point at the step's start; `bias` is its acceleration if the body keeps its velocities.
struct PointMotion {
  Vec3 place, velocity, bias;
};

/// One side of a contact, prepared.
struct PreparedSide {
  Index body = -1;
  const ModalModel* model = nullptr;  // null: a rigid shape, or one that stands still
  SurfacePoint at{};
  std::span<const VertexShare> region{};  // of its residual compliance; none where it has none
  std::span<const double> shapes{};       // of the modes, the region's mean, 3 × k; none: those of the point
  Vec3 rest = Vec3::Zero();               // with shapes: the point at rest, body frame
  Vec3 rigid_point = Vec3::Zero();  // without a model: body frame; where the surface is that of a ball, its centre
  Vec3 rim = Vec3::Zero();          // from there to where it touches, world; as the normal it stays for the step

  /// Where the body touches.
  Vec3 position(const BodyStates& states, StepTime when) const {
    return states.pose(body, when) * place(states.amplitudes(body, when)) + rim;
  }
  /// How far what is there has come beyond that by rolling, by the end of the step.
  Vec3 rolled(const BodyStates& states) const { return turn_of_step(states, body).cross(rim); }
  Vec3 velocity(const BodyStates& states, StepTime when) const {
    const RigidTransform& X = states.pose(body, when);
    Vec3 v = states.velocity(body, when) + states.angular_velocity(body, when).cross(position(states, when) - X.p);
    if (model != nullptr) v += X.q * deformation(states.rates(body, when));
    return v;
  }
  /// Body frame. @param z amplitudes
  Vec3 place(std::span<const double> z) const {
    if (model == nullptr) return rigid_point;
    return shapes.empty() ? deformed_point(*model, at, z) : Vec3(rest + deformation(z));
  }
  /// U z; with rates its velocity.
  Vec3 deformation(std::span<const double> z) const {
    if (shapes.empty()) return displacement(*model, at, z);
    Vec3 u = Vec3::Zero();
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (std::size_t i = 0; i < z.size(); ++i) u[static_cast<Index>(axis)] += shapes[axis * z.size() + i] * z[i];
    return u;
  }
  /// g += Uᵀ f. @param f body frame
  void add_load(const Vec3& f, std::span<double> g) const {
    if (shapes.empty()) return add_modal_force(*model, at, f, g);
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (std::size_t i = 0; i < g.size(); ++i) g[i] += shapes[axis * g.size() + i] * f[static_cast<Index>(axis)];
  }
  /// Of the point that the body carries along: of what is round the centre. The bias is ω × (ω × p) + 2 ω × R U ż,
  /// [H03] equation 20.
  PointMotion motion(const BodyStates& states) const {
    const RigidTransform& X = states.pose(body, StepTime::kStart);
    const Vec3 omega = states.angular_velocity(body, StepTime::kStart),
               centre = position(states, StepTime::kStart) - rim;
    const Vec3 turning = omega.cross(centre - X.p);
    Vec3 deforming = Vec3::Zero();
    if (model != nullptr) deforming = X.q * deformation(states.rates(body, StepTime::kStart));
    return {centre, states.velocity(body, StepTime::kStart) + turning + deforming,
            omega.cross(turning) + 2.0 * omega.cross(deforming)};
  }
};

struct PreparedContact {
  std::uint64_t id = 0;
  PreparedSide a, b;
  Index yielding = -1;           // the body that the energy of its spring is counted with
  Mat3 axes = Mat3::Identity();  // columns: normal, two tangents; world
  double friction = 0.0;
  Vec3 offset = Vec3::Zero();  // p_a − p_b at the step's start, world
  Vec3 start_position = Vec3::Zero();
  Vec3 last_force = Vec3::Zero();  // world, on a, N
  double give = 0.0;               // what the contact yielded to it by itself, m/N
  double slip = 0.0;               // beyond what its spring gave, m
  Vec3 dent = Vec3::Zero();        // what the bodies yield at the step's start along the axes, m
  Vec3 impulse = Vec3::Zero();     // of this step, world, on a
};

/// @param inwards the normal, into the body
inline PreparedSide make_side(const BodyStates& states, const ContactSide& side, const Vec3& inwards) {
  PreparedSide made{.body = side.body, .rigid_point = side.point_B};
  if (side.radius > 0.0 && !states.is_static(side.body)) {
    made.rim = -side.radius * inwards;
    made.rigid_point -= states.pose(side.body, StepTime::kStart).q.conjugate() * made.rim;
  }
  if (side.triangle < 0 || states.is_static(side.body)) return made;
  made.model = &states.body(side.body).group->model();
  made.at = {.surface = SurfacePoint::Surface::kCollision, .triangle = side.triangle, .weight = side.weight};
  return made;
}

inline bool flexes(const PreparedSide& side) {
  return side.model != nullptr && (side.model->modes() > 0 || side.model->data().residual_compliance.has_value());
}

inline bool is_round(const PreparedSide& side) { return !side.rim.isZero(0.0); }

inline bool yields(const PreparedSide& side) {
  return side.model != nullptr && side.model->data().residual_compliance.has_value();
}

/// Row of the velocity of a side's point along n, its arm ending at `end`, which both sides share.
inline RowSide point_row(const BodyStates& states, StepTime when, const PreparedSide& side, const Vec3& end,
                         const Vec3& n, std::vector<double>& modal) {
  modal.clear();
  if (states.is_static(side.body)) return {};
  const RigidTransform& X = states.pose(side.body, when);
  if (side.model != nullptr) {
    modal.assign(static_cast<std::size_t>(side.model->modes()), 0.0);
    side.add_load(X.q.conjugate() * n, modal);
  }
  return {side.body, n, (end - X.p).cross(n), modal};
}

/// The place and velocity of a side's point at some time, from its body's free motion.
struct Passage {
  MotionState state;

  void find(const BodyStates& states, const FreeMotions& motions, const PreparedSide& side, double time, Vec3& place,
            Vec3& velocity) {
    const ExactMotion* motion = motions.of(side.body);
    if (motion == nullptr) {
      place = side.position(states, StepTime::kStart);
      velocity = Vec3::Zero();
      return;
    }
    motion->evaluate(time, state);
    place = state.pose * side.place(state.amplitudes) + side.rim;
    velocity = state.velocity + state.angular_velocity.cross(place - state.pose.p);
    if (side.model != nullptr) velocity += state.pose.q * side.deformation(state.rates);
  }
};

/// From where they touch to the nearer of the origins of those that move.
inline double shorter_arm(const BodyStates& states, const PreparedContact& contact) {
  double arm = std::numeric_limits<double>::infinity();
  for (const PreparedSide* side : {&contact.a, &contact.b})
    if (!states.is_static(side->body))
      arm = std::min(arm,
                     (side->position(states, StepTime::kStart) - states.pose(side->body, StepTime::kStart).p).norm());
  return arm;
}

}  // namespace limber
