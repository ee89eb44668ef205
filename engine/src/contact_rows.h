// The contacts of a step as rows for islands, and what they remember from step to step.
#pragma once

#include <span>
#include <vector>

#include "body_table.h"
#include "limber/constraints/contact_constraint.h"
#include "state_hash.h"

namespace limber::internal {

struct ContactRows {
  ContactSet set;
  std::vector<BodySurface> surfaces;  // by body
  bool stale = false;                 // these

  const ContactOptions& options() const { return set.options(); }
  /// @param found at the start of the step, ordered as by ContactSource
  void take(const BodyStates& states, std::span<const ContactPoint> found, const Vec3& gravity, Jobs& jobs) {
    set.update(states, found, {.surfaces = surfaces, .gravity = gravity}, jobs);
  }
  void note_surfaces(const BodyTable& bodies) {
    stale = false;
    surfaces.resize(bodies.size());
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
      const BodyTable::Entry& e = bodies[static_cast<Index>(i)];
      surfaces[i] = {.friction = e.friction >= 0.0 ? e.friction : options().friction,
                     .restitution = e.restitution,
                     .velocity = e.surface_velocity};
    }
  }
};

/// What contacts remember of their last step. @param bodies how many there may be
inline void add_memory_to(StateHash& hash, const ContactSet& contacts, std::size_t bodies) {
  for (const std::span<const ContactMemory> known : {contacts.memory(), contacts.resting()})
    for (const ContactMemory& contact : known) {
      hash.add(contact.id);
      hash.add(contact.force);
      hash.add(contact.compliance);
      hash.add(contact.slip);
    }
  for (const RollingMemory& rolling : contacts.rolling()) hash.add(rolling.moment);
  for (std::size_t body = 0; body < bodies; ++body)
    for (const IndentationLoad& load : contacts.indentation_loads(static_cast<Index>(body))) hash.add(load.force);
}

}  // namespace limber::internal
