// Hits of the last step: pairs that came together fast, with all that they press each other by.
#pragma once

#include <span>
#include <vector>

#include "body_table.h"
#include "limber/engine/world.h"

namespace limber::internal {

class HitEvents {
 public:
  /// @param contacts of the step, by pair. @param speed m/s: slower ones are no hits
  void update(std::span<const ContactEvent> contacts, double speed, const BodyTable& bodies);
  std::span<const HitEvent> events() const { return events_; }

 private:
  std::vector<HitEvent> events_;  // by pair
};

}  // namespace limber::internal
