// Bodies that a step takes farther than contacts are looked for ahead.
//
// A contact found ahead is a plane between features, good as far as a body is thick. What fast bodies meet is found on
// their exact motion (ContactSource::find_impacts). Two that meet and come farther, as the other sees it, than the
// thinner is thick are, with all that they are tied to, a cluster: it waits while all else takes the step, and then
// takes the step by itself, in parts. Each part ends where two bodies first touch; contacts are found there, and the
// next part goes on from there.
//
//   all but clusters:   contacts → islands → the whole step            no body farther than its look-ahead
//   one cluster after the other, while all else stands still:
//     part:             contacts → solve → is the motion clear? → to the first touch, or all the way
//
// Nothing passes, as only one of two bodies that are no contact moves unwatched, and no farther than its look-ahead. A
// cluster that comes to touch a body of another, or has taken its parts, stays where it is for the rest of the step.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "body_table.h"
#include "constraint_stage.h"
#include "contact_registry.h"
#include "contact_rows.h"
#include "limber/constraints/constraint.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/jobs.h"
#include "limber/dynamics/contact_source.h"
#include "motion_forecast.h"
#include "sleep_stage.h"
#include "step_path.h"
#include "tuning.h"

namespace limber::internal {

/// Pairs of fast bodies with what they come to: what the watch of a part looks at.
struct NearPairs {
  std::vector<Impact> touches;                    // first ones of the fast
  std::vector<std::pair<Index, Index>> touching;  // pairs too near to be looked at: their contacts are in force
  std::vector<std::pair<Index, Index>> crept;     // of the cluster: so near for long that it took no end
  std::vector<const ExactMotion*> motions;        // by body
  std::vector<ExactMotion> frames;                // by member, of those that show a rigid shape
  std::vector<char> planes;                       // by body: a half-space, whose contacts are good however far
  std::vector<char> turns;                        // by body: what it touches with changes as it turns
  std::vector<char> wears_shape;                  // by body: it shows a rigid shape, which its modes do not move
  double first_margin = 0.0, margin = 0.0;        // m, at which bodies touch; each cluster takes a smaller one

  void drop_planes();
  /// @param in_force ordered by pairs. @param within m: of those, the pairs that are so near
  void list_touching(std::span<const ContactPoint> in_force, double within);
  /// m: nearer pairs are not looked at.
  double least_margin() const { return kEngineTuning.fast.least * first_margin; }
};

/// Ends a part where a pair without a contact first touches; and where a body of a pair that touches, and is not looked
/// at, has turned so far that others would come.
class PassingWatch final : public MotionWatch {
 public:
  /// @param pairs their `touching` are those of the part
  PassingWatch(ContactSource& source, std::span<const BodyState> states, NearPairs& pairs)
      : source_(source), states_(states), pairs_(pairs), margin_(pairs.margin) {}
  double clear_until(const FreeMotions& found, double length) override;
  double clearance() const override { return pairs_.first_margin; }
  /// The touch that ended the last motion shown; null: nothing did.
  const Impact* touch() const { return touch_.a < 0 ? nullptr : &touch_; }

 private:
  double first_turned(const FreeMotions& found, double length) const;

  ContactSource& source_;
  std::span<const BodyState> states_;
  NearPairs& pairs_;
  double margin_;
  Impact touch_;
};

class FastBodies {
 public:
  FastBodies(BodyTable& bodies, ConstraintStage& constraints, SleepStage& sleep, ContactRegistry& registry,
             MotionForecast& forecast)
      : bodies_(&bodies), constraints_(&constraints), sleep_(&sleep), registry_(&registry), forecast_(&forecast) {}

  /// Gathers the bodies that come farther than contacts were looked for into clusters; wakes what they come to. Where
  /// the step of a cluster cannot be cut, it is looked ahead for as far as it comes.
  /// @param found the contacts of all bodies. @param length of the step, s
  /// @return whether contacts are to be found again
  bool gather(std::span<const ContactPoint> found, double length, Jobs& jobs);
  bool any() const { return !clusters_.members.empty(); }
  /// The bodies of all clusters, one after the other.
  std::span<const Index> members() const { return clusters_.members; }
  /// `found` without the contacts of clusters. Then rests() are those that sleep or wait.
  void leave_out_contacts(std::span<const ContactPoint> found);
  /// Contacts of the others, or of the part at hand.
  std::vector<ContactPoint>& contacts() { return contacts_; }
  /// By body: it is not in the part at hand.
  std::span<const char> rests() const { return rests_; }

  /// All else has taken its step: they take theirs. @param found as above
  void advance(const Substep& substep, std::span<const ContactPoint> found, ContactRows& rows, StepEvents& events,
               StepAttempts& attempts);

 private:
  struct Clusters {
    DisjointSets sets;
    std::vector<char> waits;     // by body: it is in a cluster
    std::vector<Index> members;  // of all clusters, one after the other
    std::vector<std::size_t> ends;
  };
  /// Arguments of a cluster's step.
  struct Step {
    const Substep& substep;
    std::span<const ContactPoint> found;
    ContactRows& rows;
    StepEvents& events;
    StepAttempts& attempts;
  };
  bool moves(Index body) const { return constraints_->moves(body) && !sleep_->asleep(body); }
  void list_fast();
  void find_first_touches(std::span<const ContactPoint> found, double length, Jobs& jobs);
  bool planes_last(Index a, Index b) const;
  void add_brisk();
  bool wake_touched();
  void join(std::span<const ContactPoint> found);
  void mark_waiting();
  bool look_farther();
  void advance_cluster(std::span<const Index> members, const Step& step);
  std::span<const ContactPoint> find_contacts(std::span<const Index> members, bool first, double left,
                                              std::span<const ContactPoint> found);

  BodyTable* bodies_;
  ConstraintStage* constraints_;
  SleepStage* sleep_;
  ContactRegistry* registry_;
  MotionForecast* forecast_;
  std::vector<Index> fast_;  // ascending
  std::vector<char> fixed_;  // by body: its step cannot be cut
  Clusters clusters_;
  NearPairs near_;
  std::vector<ContactPoint> contacts_;
  std::vector<char> rests_;
};

}  // namespace limber::internal
