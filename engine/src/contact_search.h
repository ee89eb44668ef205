// How a step's contacts are found: at its start, as far as bodies are expected to come; anew where the step, as
// foreseen, takes them elsewhere; and where it ends.
#pragma once

#include <vector>

#include "body_table.h"
#include "constraint_stage.h"
#include "contact_registry.h"
#include "contact_rows.h"
#include "fast_bodies.h"
#include "limber/core/stage_times.h"
#include "motion_forecast.h"
#include "sleep_stage.h"

namespace limber::internal {

class ContactSearch {
 public:
  ContactSearch(BodyTable& bodies, const ConstraintStage& constraints, SleepStage& sleep, ContactRegistry& registry,
                MotionForecast& forecast, FastBodies& fast, ContactRows& rows)
      : bodies_(&bodies),
        constraints_(&constraints),
        sleep_(&sleep),
        registry_(&registry),
        forecast_(&forecast),
        fast_(&fast),
        rows_(&rows) {}

  /// A step of `length` seconds begins. All below: @pre there is a source
  void begin(double length) { length_ = length; }
  /// Finds what touches, or may within the step. Bodies that are touched wake, fast ones are gathered.
  void find(Jobs& jobs, StageClock& clock);
  /// Once the step has been foreseen: looks for contacts anew where a body ends elsewhere than they were looked for, by
  /// a blow or since something lets go of it: along the motion foreseen then. Where none of those that were not known
  /// is met by that motion, it is the answer with them, too.
  /// @return whether there are others: the step is to be foreseen anew
  bool find_again_along_foreseen(Jobs& jobs, StageClock& clock);
  /// Looks where the step would end: a contact found ahead is a plane between features, and what moves far over a bumpy
  /// surface gets under another part of it. Points that have gone in deeper by then than recovery would part them
  /// within the step are contacts too, of the planes that they have there. Planes left behind, such as
  /// the far side of a thin part, are none: seen from there points were deeper before. Nor are contacts in force that
  /// the motion foreseen leaves as deep by their own planes: it is not yet as they ask.
  /// @return whether there are any: the step is to be foreseen anew
  bool add_those_of_foreseen_end(Jobs& jobs);

  /// Contacts of all bodies, ordered as by ContactSource.
  std::span<const ContactPoint> found() const { return found_; }
  /// Contacts that islands answer to in the step of all but the fast. @pre FastBodies::leave_out_contacts()
  std::vector<ContactPoint>& in_force() { return fast_->any() ? fast_->contacts() : found_; }
  /// How near to the law motions are found that are only looked at, m: to a share of what makes a look, and of the
  /// thinnest body.
  double roughness();

 private:
  double sinking() const;
  void ask_source(Jobs& jobs, StageClock& clock);
  bool wake_touched();
  void keep_known();
  bool are_met(std::span<const ContactPoint> before);
  bool is_left_open(std::span<const ContactPoint> in_force, const ContactPoint& contact, double deepest);
  double gap_at_end(const ContactPoint& contact);
  Vec3 place_at_end(const ContactSide& side, const Vec3& inwards);
  Vec3 place_at_start(ContactSide& side, const Vec3& inwards) const;
  bool list_ends(double least);

  /// Where bodies of islands end, as foreseen.
  struct Ends {
    std::vector<BodyState> states;  // by body
    std::vector<Index> members;     // ascending
    std::vector<ContactPoint> contacts;
    ExpectedEnd one;  // scratch
  };

  BodyTable* bodies_;
  const ConstraintStage* constraints_;
  SleepStage* sleep_;
  ContactRegistry* registry_;
  MotionForecast* forecast_;
  FastBodies* fast_;
  ContactRows* rows_;
  double length_ = 0.0;
  std::vector<ContactPoint> found_, known_;  // the latter while contacts are looked for anew
  Ends ends_;
};

}  // namespace limber::internal
