// Boxes on a plane: contacts of all corners with it, found by hand, so that islands with contact need no collision.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "islands.h"
#include "limber/constraints/contact_constraint.h"

namespace limber::testing {

/// A vertex of the collision surface: some triangle that has it, weight 1.
inline SurfacePoint corner_point(const ModalModel& model, Index vertex) {
  const std::vector<Triangle>& triangles = model.collision().triangles;
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t c = 0; c < 3; ++c)
      if (triangles[t][c] == vertex) {
        SurfacePoint at{.triangle = static_cast<Index>(t), .weight = {0.0, 0.0, 0.0}};
        at.weight[c] = 1.0;
        return at;
      }
  return {};
}

inline ContactSide contact_side(const Island& island, Index body, const SurfacePoint& at) {
  return {.body = body,
          .triangle = at.triangle,
          .weight = at.weight,
          .point_B = deformed_point(*island.model, at, island.group.amplitudes(body))};
}

/// An island over the solid half-space normal · x ≤ 0, which stands still.
class GroundedIsland : public Island {
 public:
  GroundedIsland(const SampleOptions& sample, double step, const ContactOptions& options = {},
                 const Vec3& normal = Vec3::UnitZ(), const Vec3& gravity = {0.0, 0.0, -kGravity})
      : GroundedIsland(sample_model(sample), step, options, normal, gravity) {}
  GroundedIsland(std::shared_ptr<const ModalModel> body, double step, const ContactOptions& options = {},
                 const Vec3& normal = Vec3::UnitZ(), const Vec3& gravity = {0.0, 0.0, -kGravity})
      : Island(std::move(body), step, gravity), contacts(options), normal_(normal) {}

  /// One step: contacts of all corners with the ground, and what is in `others`.
  IslandReport step() {
    table.resize(members.size());
    table.push_back({});  // the ground
    found.assign(others.begin(), others.end());
    for (const Index body : members) find_ground_contacts(body);
    contacts.update(states(), found);
    constraints.assign(contacts.constraints().begin(), contacts.constraints().end());
    const IslandReport report = Island::step();
    contacts.finish();
    return report;
  }

  /// With what the contacts store.
  double energy() const {
    double sum = Island::energy();
    for (const Index body : members) sum += contacts.indentation_energy(states(), body);
    return sum;
  }
  /// Of all contacts in the last step, on the bodies.
  Vec3 contact_impulse() const {
    Vec3 sum = Vec3::Zero();
    for (const ContactEvent& event : contacts.events()) sum += event.impulse;
    return sum;
  }
  double lowest_gap() const {
    double lowest = kUnbounded;
    for (const Index body : members)
      for (Index v = 0; v < 8; ++v)
        lowest = std::min(lowest, normal_.dot(group.position(body, corner_point(*model, v))));
    return lowest;
  }

  ContactSet contacts;
  std::vector<ContactPoint> others, found;

 private:
  void find_ground_contacts(Index body) {
    const auto ground = static_cast<Index>(members.size());
    for (Index v = 0; v < 8; ++v) {
      const SurfacePoint at = corner_point(*model, v);
      const Vec3 p = group.position(body, at);
      const double gap = normal_.dot(p);
      found.push_back({.a = contact_side(*this, body, at),
                       .b = {.body = ground, .point_B = p - gap * normal_},
                       .normal = normal_,
                       .position = p - 0.5 * gap * normal_,
                       .gap = gap,
                       .id = static_cast<std::uint64_t>(8 * body + v + 1)});
    }
  }

  Vec3 normal_;
};

}  // namespace limber::testing
