// When contacts that are open close while bodies go on freely, and what their gaps accelerate by: [H03]'s second method
// acts at the touch, by accelerations.
#pragma once

#include <array>
#include <span>

#include "limber/dynamics/exact_motion.h"
#include "pair_contacts.h"

namespace limber::internal {

/// How the bodies of an island would go through the rest of a step if nothing touched them.
struct FreeMotions {
  std::span<const Index> members;        ///< bodies, ascending
  std::span<const ExactMotion> motions;  ///< one for each
  /// Null: the body stands still.
  const ExactMotion* of(Index body) const;
};

class TouchTimes {
 public:
  /// When within the rest of a step a contact closes, faster than what counts as an impact; `within`: none does.
  double next(const PairContacts& contacts, const BodyStates& states, const FreeMotions& motions, double within);

 private:
  /// The place and velocity of a side's point at some time.
  struct Passage {
    Vec3 place, velocity;
    MotionState state;  // scratch

    void find(const BodyStates& states, const FreeMotions& motions, const PreparedSide& side, double time);
  };
  double touch(const BodyStates& states, const FreeMotions& motions, const PreparedContact& contact, double within);

  std::array<Passage, 2> passage_;
};

/// J̇v of the contacts' rows at the step's start, in their order: what the gaps' rates change by while the bodies keep
/// their velocities. @param bias as many numbers
void bias_accelerations(const PairContacts& contacts, const BodyStates& states, std::span<double> bias);

}  // namespace limber::internal
