// How deep the bodies of a world overlap, by a finder of its own.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"

namespace limber::testing {

/// All contacts of the bodies of a world with the ground and with each other as they stand now: found anew and not
/// thinned, indentations included.
class Overlap {
 public:
  struct Depth {
    double ground = 0.0, between = 0.0;  ///< with the ground; between bodies, m
    double anywhere() const { return std::max(ground, between); }
  };

  /// @param ground a half-space as it is by default
  /// @param bodies that meet as their collision surfaces; world and bodies outlive this
  Overlap(const World& world, const std::vector<BodyId>& bodies, BodyId ground)
      : world_(world), bodies_(bodies), ground_(static_cast<Index>(ground.index)) {
    finder_.add_body(ground_, {.shape = std::make_shared<Shape>(HalfSpace{})}, {});
    states_.resize(ground.index + 1);
    for (const BodyId id : bodies) {
      // Not owned: the world outlives this.
      const std::shared_ptr<const ModalModel> model(std::shared_ptr<void>(), &world.model(id));
      finder_.add_body(static_cast<Index>(id.index), {.model = model}, {});
      states_.resize(std::max<std::size_t>(states_.size(), id.index + 1));
    }
  }

  Depth deepest() {
    for (const BodyId id : bodies_) {
      const BodyView view = world_.body(id);
      states_[id.index] = {.pose = view.pose, .amplitudes = view.amplitudes};
    }
    finder_.find_contacts({.states = states_, .margin = 0.0}, contacts_, serial_jobs());
    Depth most;
    for (const ContactPoint& contact : contacts_) {
      const double depth = -contact.gap - contact.normal.dot(indentation_of(contact.a) - indentation_of(contact.b));
      double& of_kind = contact.a.body == ground_ || contact.b.body == ground_ ? most.ground : most.between;
      of_kind = std::max(of_kind, depth);
    }
    return most;
  }

 private:
  Vec3 indentation_of(const ContactSide& side) const {
    for (const BodyId id : bodies_)
      if (static_cast<Index>(id.index) == side.body)
        return world_.indentation(id, {.triangle = side.triangle, .weight = side.weight});
    return Vec3::Zero();  // the ground
  }

  const World& world_;
  const std::vector<BodyId>& bodies_;
  Index ground_;
  ContactFinder finder_;
  std::vector<BodyState> states_;
  std::vector<ContactPoint> contacts_;
};

}  // namespace limber::testing
