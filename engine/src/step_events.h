// Contact events of a whole step, while the step is taken in substeps: one for each contact that pressed in any of
// them, with the sum of its impulses and the place where it pressed last.
#pragma once

#include <span>
#include <tuple>
#include <vector>

#include "limber/constraints/contact_constraint.h"

namespace limber::internal {

class StepEvents {
 public:
  // begin(), the events of each substep in turn, end(). Then events() are those of the step.
  void begin();
  /// @param substep 0: the first
  void add(int substep, std::span<const ContactEvent> events);
  void end();
  std::span<const ContactEvent> events() const { return events_; }

 private:
  friend struct limber::StateFields;
  /// Between steps.
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.events_, s.released_);
  }

  /// A contact over all substeps so far.
  struct Merged {
    ContactEvent event;
    bool pressed;  // in some substep
    bool let_go;   // since it last pressed
  };
  static Merged first_of(const ContactEvent& event, int substep, bool pressed_before);
  static void add_to(Merged& merged, const ContactEvent& event);

  std::vector<Merged> merged_;  // in the order of contacts
  std::vector<ContactEvent> events_, last_events_;
  std::vector<ContactEvent> released_;  // told as pressing, but let go before the step's end
};

}  // namespace limber::internal
