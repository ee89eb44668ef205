// A step's contacts: found once, at its start, as far as the motion that bodies are expected to make may close gaps
// (speculative contacts).
#pragma once

#include <span>
#include <vector>

#include "body_table.h"
#include "contact_registry.h"
#include "contact_rows.h"
#include "limber/core/stage_times.h"
#include "motion_forecast.h"
#include "sleep_stage.h"
#include "substep.h"

namespace limber::internal {

class ContactSearch {
 public:
  ContactSearch(BodyTable& bodies, SleepStage& sleep, ContactRegistry& registry)
      : bodies_(&bodies), sleep_(&sleep), registry_(&registry), forecast_(bodies, sleep) {}

  /// Finds what touches, or may within the step. Bodies that are touched wake. @pre there is a source
  /// @param parts the step is taken in, of one length  @param rows are told of the bodies' surfaces
  void find(const Substep& substep, int parts, ContactRows& rows, Jobs& jobs, StageClock& clock);
  /// Contacts of all bodies, ordered as by ContactSource.
  std::span<const ContactPoint> found() const { return found_; }
  /// By body, m.
  std::span<const double> thickness() const { return forecast_.thickness(); }
  /// For another source, which knows nothing of the bodies.
  void tell_all_anew() { forecast_.tell_all_anew(); }

 private:
  bool wake_touched();
  void give_to_wholes();

  BodyTable* bodies_;
  SleepStage* sleep_;
  ContactRegistry* registry_;
  MotionForecast forecast_;
  std::vector<ContactPoint> found_;
};

}  // namespace limber::internal
