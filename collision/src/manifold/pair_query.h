// A pair of bodies whose contacts are wanted.
#pragma once

#include <span>

#include "field/field_pair.h"
#include "limber/dynamics/contact_source.h"
#include "manifold/manifold_body.h"
#include "manifold/mesh_contacts.h"

namespace limber::internal {

/// A pair as it is asked for. Contacts are told in the frame of a, by feature, each pair of features once.
struct PairQuery {
  Index index_a = -1, index_b = -1;  ///< equal: a body with itself
  const ManifoldBody &a, &b;
  const BodyState &state_a, &state_b;
  RigidTransform X_AB{};
  RigidTransform X_LS{};  ///< the smaller body in the frame of the larger one
  double reach = 0.0;     ///< m: gaps up to here are wanted
  Passing passing{};
  /// Planes that a, or b, rests on beside the other: what of the other reaches no farther is touched along these alone.
  /// In the frame of a, or of b.
  std::span<const SupportPlane> planes_a{}, planes_b{};
  /// Share of the expected way after which they are so; 0: now.
  double ahead = 0.0;
  /// Of pairs that FieldPairs finds: where b is expected in the frame of a at the step's end, and the gaps up to
  /// which contacts are wanted beside what the expected motion of their points, and a fall, close, m.
  bool by_fields = false;
  struct {
    RigidTransform X_AB_end{}, X_LS_end{};
    double near = 0.0;
    Vec3 fall = Vec3::Zero();    ///< ContactQuery::fall, frame of a
    Parting* parting = nullptr;  ///< see FieldMotion
  } expected{};
};

}  // namespace limber::internal
