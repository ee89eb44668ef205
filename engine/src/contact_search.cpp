#include "contact_search.h"
#include "tuning.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

namespace limber::internal {
namespace {

const auto by_bodies = [](const ContactPoint& p, const ContactPoint& q) {
  return std::tie(p.a.body, p.b.body, p.id) < std::tie(q.a.body, q.b.body, q.id);
};

}  // namespace

/// How far recovery parts bodies within the step.
double ContactSearch::sinking() const { return rows_->options().recovery_speed * length_; }

double ContactSearch::roughness() {
  double thinnest = std::numeric_limits<double>::infinity();
  for (const Index body : sleep_->awake())
    if (const BodyTable::Entry& e = (*bodies_)[body]; bodies_->shows(e))
      thinnest = std::min(thinnest, e.extent.thickness);
  return std::min(kEngineTuning.looks.rough_of_recovery * sinking(), kEngineTuning.looks.rough_of_thickness * thinnest);
}

void ContactSearch::find(Jobs& jobs, StageClock& clock) {
  forecast_->look_as_before();
  do {
    ask_source(jobs, clock);
    if (registry_->has_veto())
      std::erase_if(found_, [this](const ContactPoint& contact) { return !registry_->acts(contact); });
  } while (wake_touched() || fast_->gather(found_, length_, jobs));
  clock.lap(Stage::kFastBodies);
  known_.reserve(found_.capacity());
}

/// Finds what touches in the states as they are.
void ContactSearch::ask_source(Jobs& jobs, StageClock& clock) {
  const bool told_all = forecast_->write_states();
  if (told_all) rows_->note_friction(*bodies_);
  if (clock.runs()) clock.lap(Stage::kLookAhead, static_cast<std::int64_t>(sleep_->awake().size()));
  StageTimes theirs;
  registry_->source()->find_contacts({.states = forecast_->states(),
                                      .awake = told_all ? std::span<const Index>() : sleep_->awake(),
                                      .times = clock.runs() ? &theirs : nullptr},
                                     found_, jobs);
  clock.lap(theirs, Stage::kNarrowPhase);
}

/// Bodies that sleep are not tested with each other, so those that wake are to be looked at again.
bool ContactSearch::wake_touched() {
  bool woke = false;
  for (const ContactPoint& contact : found_)
    for (const Index body : {contact.a.body, contact.b.body})
      if (sleep_->asleep(body)) {
        sleep_->wake(body);
        woke = true;
      }
  return woke;
}

bool ContactSearch::find_again_along_foreseen(Jobs& jobs, StageClock& clock) {
  if (!forecast_->expect_foreseen_ends()) return false;
  const std::uint64_t wakings = sleep_->wakings();
  const bool waited = fast_->any();
  std::swap(found_, known_);
  find(jobs, clock);
  const bool others_move = waited || fast_->any() || sleep_->wakings() != wakings;
  if (others_move || !constraints_->are_accepted() || are_met(known_)) return true;
  keep_known();
  return false;
}

/// Takes the contacts known before again, with the regions of those found now, as the source has forgotten
/// theirs.
void ContactSearch::keep_known() {
  for (ContactPoint& contact : known_) {
    const auto found = std::ranges::lower_bound(found_, contact, by_bodies);
    const bool again = found != found_.end() && !by_bodies(contact, *found);
    contact.a.region = again ? found->a.region : std::span<const VertexShare>();
    contact.b.region = again ? found->b.region : std::span<const VertexShare>();
  }
  std::swap(found_, known_);
}

/// Whether a contact that touches, and is not known, closes in the motion that is foreseen.
/// @param before ordered as `found_`, by bodies and id
bool ContactSearch::are_met(std::span<const ContactPoint> before) {
  return std::ranges::any_of(found_, [&](const ContactPoint& contact) {
    return !std::ranges::binary_search(before, contact, by_bodies) &&
           gap_at_end(contact) < std::min(contact.gap, 0.0) - kEngineTuning.looks.rounded * contact.position.norm();
  });
}

/// Whether a contact is in force whose own plane tells as much of how deep it is found at the end.
bool ContactSearch::is_left_open(std::span<const ContactPoint> in_force, const ContactPoint& contact, double deepest) {
  const auto known_as = std::ranges::lower_bound(in_force, contact, by_bodies);
  return known_as != in_force.end() && !by_bodies(contact, *known_as) && gap_at_end(*known_as) <= deepest;
}

/// In the motion that is foreseen.
double ContactSearch::gap_at_end(const ContactPoint& contact) {
  return contact.normal.dot(place_at_end(contact.a, contact.normal) - place_at_end(contact.b, -contact.normal));
}

/// Where a contact's point is in the end, as foreseen. A round surface touches with another point of it then.
Vec3 ContactSearch::place_at_end(const ContactSide& side, const Vec3& inwards) {
  const BodyTable::Entry& e = (*bodies_)[side.body];
  if (e.group < 0) return e.pose * side.point_B;
  ExpectedEnd& end = ends_.one;
  forecast_->find_end(side.body, end);
  if (side.triangle >= 0)
    return end.pose *
           bodies_->group(e)
               .shape_at(e.slot, end.amplitudes)
               .position(
                   {.surface = SurfacePoint::Surface::kCollision, .triangle = side.triangle, .weight = side.weight});
  const Vec3 rim = -side.radius * inwards;
  return end.pose * Vec3(side.point_B - forecast_->state(side.body).pose.q.conjugate() * rim) + rim;
}

/// A contact's point as the step begins, of one that was found at its end. A round surface touches with another point
/// of it then.
Vec3 ContactSearch::place_at_start(ContactSide& side, const Vec3& inwards) const {
  const BodyTable::Entry& e = (*bodies_)[side.body];
  if (e.group < 0) return e.pose * side.point_B;
  const BodyGroup& bodies = bodies_->group(e);
  const RigidTransform& X = bodies.frame(e.slot).pose();
  if (side.triangle >= 0)
    return bodies.position(
        e.slot, {.surface = SurfacePoint::Surface::kCollision, .triangle = side.triangle, .weight = side.weight});
  const Vec3 rim = -side.radius * inwards;
  const RigidTransform& X_end = ends_.states[static_cast<std::size_t>(side.body)].pose;
  side.point_B += X.q.conjugate() * rim - X_end.q.conjugate() * rim;
  return X * side.point_B;
}

bool ContactSearch::add_those_of_foreseen_end(Jobs& jobs) {
  const double least = sinking();
  if (!list_ends(least)) return false;
  std::vector<ContactPoint>& known = in_force();
  std::vector<ContactPoint>& more = ends_.contacts;
  registry_->source()->find_contacts({.states = ends_.states, .bodies = ends_.members}, more, jobs);
  std::erase_if(more, [&](ContactPoint& contact) {
    contact.a.region = contact.b.region = {};
    const Vec3 a = place_at_start(contact.a, contact.normal), b = place_at_start(contact.b, -contact.normal);
    contact.position = 0.5 * (a + b);
    const double before = contact.normal.dot(a - b), after = std::exchange(contact.gap, before);
    return !(after < std::min(before, 0.0) - least) || is_left_open(known, contact, after + least) ||
           !registry_->acts(contact);
  });
  if (more.empty()) return false;
  std::ranges::sort(more, by_bodies);
  std::erase_if(known,
                [&](const ContactPoint& contact) { return std::ranges::binary_search(more, contact, by_bodies); });
  known.insert(known.end(), more.begin(), more.end());
  known_.reserve(found_.capacity());
  std::ranges::sort(known, by_bodies);
  return true;
}

/// Where islands end, and their members. @return whether two of them may have come nearer than this
bool ContactSearch::list_ends(double least) {
  ends_.members.clear();
  double farthest = 0.0;
  for (const Index body : sleep_->awake()) {
    if (!bodies_->shows((*bodies_)[body]) || !constraints_->constrained(body)) continue;
    ends_.members.push_back(body);
    forecast_->foreseen_end(body, ends_.one);
    farthest = std::max(farthest,
                        (ends_.one.pose.p - forecast_->state(body).pose.p).norm() + forecast_->beside(body, ends_.one));
  }
  if (!(2.0 * farthest > least)) return false;
  ends_.states.assign(forecast_->states().begin(), forecast_->states().end());
  for (const Index body : ends_.members) {
    const BodyTable::Entry& e = (*bodies_)[body];
    const BodyGroup& bodies = bodies_->group(e);
    BodyState& state = ends_.states[static_cast<std::size_t>(body)];
    state = {.pose = bodies.predicted_frame(e.slot).pose()};
    if (!e.shape) state.amplitudes = bodies.predicted_amplitudes(e.slot);
  }
  return true;
}

}  // namespace limber::internal
