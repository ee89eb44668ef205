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
#include <vector>

#include "limber/constraints/constraint.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/jobs.h"
#include "limber/dynamics/contact_source.h"

namespace limber::internal {

struct PassingBodies {
  /// Part of the smallest look-ahead at hand at which bodies touch.
  static constexpr double kTouch = 0.05;
  /// Of the look-ahead: what moves less far within a step passes nothing.
  static constexpr double kSlow = 0.5;
  /// Of that part, for those who come after: what came to a touch is apart then.
  static constexpr double kNearer = 0.45;
  /// Of that part: so near bodies that touch may come before they are no more looked at.
  static constexpr double kLeast = 1e-3;
  /// rad, about which a body may turn while contacts hold it: by then other parts of it would touch.
  static constexpr double kMostTurn = 0.5;
  /// Of a cluster's step.
  static constexpr int kMostParts = 4;

  std::vector<Index> fast;      // ascending
  std::vector<char> farther;    // by body: contacts are looked for as far as it comes, as its step cannot be cut
  std::vector<char> fixed;      // by body: its step cannot be cut
  std::vector<Impact> touches;  // first ones of the fast
  DisjointSets sets;
  std::vector<char> waits;     // by body: it is in a cluster
  std::vector<Index> members;  // of all clusters, one after the other
  std::vector<std::size_t> ends;
  std::vector<const ExactMotion*> motions;        // by body
  std::vector<ContactPoint> contacts;             // of the part at hand
  std::vector<char> rests;                        // by body: not in the part at hand
  std::vector<std::pair<Index, Index>> touching;  // pairs too near to be looked at: their contacts are in force
  std::vector<std::pair<Index, Index>> crept;     // of the cluster: so near for long that it took no end
  std::vector<char> planes;                       // by body: a half-space, whose contacts are good however far
  std::vector<char> turns;                        // by body: what it touches with changes as it turns
  std::vector<char> wears_shape;                  // by body: it shows a rigid shape, which its modes do not move
  std::vector<ExactMotion> frames;                // by member, of those
  double first_margin = 0.0, margin = 0.0;        // m, at which bodies touch; each cluster takes a smaller one

  void drop_planes();
  /// @param in_force ordered by pairs. @param within m: of those, the pairs that are so near
  void list_touching(std::span<const ContactPoint> in_force, double within);
  /// m: nearer pairs are not looked at.
  double least_margin() const { return kLeast * first_margin; }
  bool any() const { return !members.empty(); }
  bool looks_farther(Index body) const {
    return static_cast<std::size_t>(body) < farther.size() && farther[static_cast<std::size_t>(body)] != 0;
  }
  /// `contacts` without those of clusters; `rests` those that sleep or wait.
  void leave_out(std::span<const char> asleep, std::span<const ContactPoint> found);
};

/// Ends a part where a pair without a contact first touches; and where a body of a pair that touches, and is not looked
/// at, has turned so far that others would come.
class PassingWatch final : public MotionWatch {
 public:
  /// @param passing its `touching` are those of the part
  PassingWatch(ContactSource& source, std::span<const BodyState> states, PassingBodies& passing)
      : source_(source), states_(states), passing_(passing), margin_(passing.margin) {}
  double clear_until(const FreeMotions& found, double length) override;
  double clearance() const override { return passing_.first_margin; }
  /// What ended the last motion shown; none: nothing did.
  const Impact* touch() const { return touch_.a < 0 ? nullptr : &touch_; }

 private:
  double first_turned(const FreeMotions& found, double length) const;

  ContactSource& source_;
  std::span<const BodyState> states_;
  PassingBodies& passing_;
  double margin_;
  Impact touch_;
};

}  // namespace limber::internal
