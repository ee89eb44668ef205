#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "world_impl.h"

namespace limber {
namespace {

const auto by_bodies = [](const ContactPoint& p, const ContactPoint& q) {
  return std::tie(p.a.body, p.b.body, p.id) < std::tie(q.a.body, q.b.body, q.id);
};

}  // namespace

/// How far a body comes in a step that lets go of it. Where something held it, gravity acts at the step's start.
double World::Impl::fall() const { return options.gravity.norm() * parts->length() * parts->length(); }

/// How far recovery parts bodies within the step.
double World::Impl::sinking() const { return contact_options.recovery_speed * parts->length(); }

/// Where a body is expected when the step ends, before anything is known of it. One that nothing held in the last step
/// goes on by itself. What held others holds them on for the most part: a squeezed body does not spring open. So they
/// are expected to go on with their velocities, and modes no farther than they would swing by these.
void World::Impl::expect(Index body) {
  const auto i = static_cast<std::size_t>(body);
  const Entry& e = entries[i];
  BodyState& state = states[i];
  ExpectedEnd& end = expected[i];
  if (state.asleep) return;
  const BodyGroup& bodies = group(e);
  ways.resize(entries.size());
  if (!end.foreseen) {
    const std::span<const double> z = bodies.amplitudes(e.slot), rates = bodies.rates(e.slot),
                                  lambda = bodies.model().data().eigenvalues;
    end.amplitudes.resize(e.shape ? 0 : z.size());
    end.doubt = fall();
    if (e.held) {
      end.pose = {quaternion_from_rotation_vector(state.rotation) * state.pose.q, state.pose.p + state.displacement};
      for (std::size_t k = 0; k < end.amplitudes.size(); ++k)
        end.amplitudes[k] = z[k] + rates[k] * std::min(parts->length(), 1.0 / std::sqrt(lambda[k]));
    } else {
      motions[i].at(parts->length(), end.pose, end.amplitudes);
    }
  }
  state.end_pose = end.pose;
  state.end_amplitudes = end.amplitudes;
  state.doubt = end.doubt;
  const double by_itself = state.way();
  if (end.foreseen) {
    state.displacement = end.pose.p - state.pose.p;
    state.rotation = rotation_vector(end.pose.q * state.pose.q.conjugate());
  }
  state.reach = (end.pose.p - state.pose.p - state.displacement).norm() + beside(body, end) + end.doubt;
  ways[i] = end.foreseen || e.held ? std::min(by_itself, state.way()) : by_itself;
}

/// How far any point of a body is at most from where the way of its origin takes it, m.
double World::Impl::beside(Index body, const ExpectedEnd& end) const {
  const auto i = static_cast<std::size_t>(body);
  return difference(body, states[i].pose.q, states[i].amplitudes, end);
}

double World::Impl::difference(Index body, const Quaternion& q, std::span<const double> z,
                               const ExpectedEnd& end) const {
  const Entry& e = entries[static_cast<std::size_t>(body)];
  double arm = e.extent.radius, flexing = 0.0;
  const std::span<const double> shape = group(e).model().collision_extent().shape;
  for (std::size_t k = 0; k < end.amplitudes.size(); ++k) {
    arm += shape[k] * std::abs(z[k]);
    flexing += shape[k] * std::abs(end.amplitudes[k] - z[k]);
  }
  return 2.0 * (end.pose.q * q.conjugate()).vector().norm() * arm + flexing;
}

/// Where a constrained body ends, as foreseen.
void World::Impl::foreseen_end(Index body, ExpectedEnd& end) const {
  const Entry& e = entries[static_cast<std::size_t>(body)];
  const BodyGroup& bodies = group(e);
  end.pose = bodies.predicted_frame(e.slot).pose();
  end.amplitudes.clear();
  if (e.shape) return;
  const std::span<const double> z = bodies.predicted_amplitudes(e.slot);
  end.amplitudes.assign(z.begin(), z.end());
}

/// And one that may be free.
void World::Impl::find_end(Index body, ExpectedEnd& end) const {
  const auto i = static_cast<std::size_t>(body);
  if (constraints.constrained(body)) {
    foreseen_end(body, end);
  } else {
    end.amplitudes.resize(expected[i].amplitudes.size());
    motions[i].at(parts->length(), end.pose, end.amplitudes);
  }
}

/// Once the step has been foreseen: looks for contacts anew where a body ends elsewhere than they were looked for, by a
/// blow or since something lets go of it: along the motion foreseen then. Where none of those that were not known is
/// met by that motion, it is the answer with them, too.
/// @return whether there are others: the step is to be foreseen anew
bool World::Impl::find_elsewhere() {
  if (!end_elsewhere()) return false;
  const std::uint64_t wakings = sleep.wakings();
  const bool waited = passing.any();
  std::swap(touching, known);
  look_for_contacts();
  const bool others_move = waited || passing.any() || sleep.wakings() != wakings;
  if (!others_move && constraints.are_settled() && !are_met(known)) {
    keep_known();
    return false;
  }
  take_contacts();
  return true;
}

/// Those that touched before do again, with the regions of those found now, as the source has forgotten theirs.
void World::Impl::keep_known() {
  for (ContactPoint& contact : known) {
    const auto found = std::ranges::lower_bound(touching, contact, by_bodies);
    const bool again = found != touching.end() && !by_bodies(contact, *found);
    contact.a.region = again ? found->a.region : std::span<const VertexShare>();
    contact.b.region = again ? found->b.region : std::span<const VertexShare>();
  }
  std::swap(touching, known);
}

/// Whether some body ends elsewhere than contacts were looked for, which is then expected.
bool World::Impl::end_elsewhere() {
  bool elsewhere = false;
  for (const Index body : sleep.awake()) {
    const auto i = static_cast<std::size_t>(body);
    if (!shows(entries[i]) || constraints.is_held_back(body)) continue;
    ExpectedEnd& end = ends_foreseen;
    find_end(body, end);
    const double off =
        (end.pose.p - expected[i].pose.p).norm() + difference(body, expected[i].pose.q, expected[i].amplitudes, end);
    if (!(off > expected[i].doubt)) continue;
    elsewhere = elsewhere || states[i].way() < states[i].look_ahead;
    expected[i].amplitudes.assign(end.amplitudes.begin(), end.amplitudes.end());
    expected[i].pose = end.pose;
    expected[i].doubt = fall();
    expected[i].foreseen = true;
  }
  return elsewhere;
}

/// Whether a contact that touches, and is not known, closes in the motion that is foreseen.
/// @param before ordered as `touching`, by bodies and id
bool World::Impl::are_met(std::span<const ContactPoint> before) {
  constexpr double kRounded = 1e-9;  // of the way to the bodies
  return std::ranges::any_of(touching, [&](const ContactPoint& contact) {
    return !std::ranges::binary_search(before, contact, by_bodies) &&
           gap_at_end(contact) < std::min(contact.gap, 0.0) - kRounded * contact.position.norm();
  });
}

/// Whether a contact is in force whose own plane tells as much of how deep it is found at the end.
bool World::Impl::is_left_open(std::span<const ContactPoint> in_force, const ContactPoint& contact, double deepest) {
  const auto known_as = std::ranges::lower_bound(in_force, contact, by_bodies);
  return known_as != in_force.end() && !by_bodies(contact, *known_as) && gap_at_end(*known_as) <= deepest;
}

/// In the motion that is foreseen.
double World::Impl::gap_at_end(const ContactPoint& contact) {
  return contact.normal.dot(place_at_end(contact.a, contact.normal) - place_at_end(contact.b, -contact.normal));
}

/// Where a contact's point is in the end, as foreseen. What is round touches with another point of it then.
Vec3 World::Impl::place_at_end(const ContactSide& side, const Vec3& inwards) {
  const auto i = static_cast<std::size_t>(side.body);
  const Entry& e = entries[i];
  if (e.group < 0) return e.pose * side.point_B;
  ExpectedEnd& end = ends_foreseen;
  find_end(side.body, end);
  if (side.triangle >= 0)
    return end.pose *
           group(e)
               .shape_at(e.slot, end.amplitudes)
               .position(
                   {.surface = SurfacePoint::Surface::kCollision, .triangle = side.triangle, .weight = side.weight});
  const Vec3 rim = -side.radius * inwards;
  return end.pose * Vec3(side.point_B - states[i].pose.q.conjugate() * rim) + rim;
}

/// A contact's point as the step begins, of one that was found at its end. What is round touches with another point of
/// it then.
Vec3 World::Impl::place_at_start(ContactSide& side, const Vec3& inwards) const {
  const auto i = static_cast<std::size_t>(side.body);
  const Entry& e = entries[i];
  if (e.group < 0) return e.pose * side.point_B;
  const BodyGroup& bodies = group(e);
  const RigidTransform& X = bodies.frame(e.slot).pose();
  if (side.triangle >= 0)
    return bodies.position(
        e.slot, {.surface = SurfacePoint::Surface::kCollision, .triangle = side.triangle, .weight = side.weight});
  const Vec3 rim = -side.radius * inwards;
  side.point_B += X.q.conjugate() * rim - ends[i].pose.q.conjugate() * rim;
  return X * side.point_B;
}

/// Looks where the step would end: a contact found ahead is a plane between features, and what moves far over a bumpy
/// surface gets under another part of it. Points that have gone in deeper by then than recovery would part them within
/// the step are contacts too, of the planes that they have there. Those that they have left behind, such as the far
/// side of a thin part, are none: seen from there they were deeper before. Nor are those that are in force, and that
/// the motion foreseen leaves as deep by their own planes: it is not yet as they ask.
/// @return whether there are any: the step is to be foreseen anew
bool World::Impl::find_at_end() {
  const double least = sinking();
  if (!list_ends(least)) return false;
  std::vector<ContactPoint>& in_force = passing.any() ? passing.contacts : touching;
  source->find_contacts({.states = ends, .bodies = members}, found_at_end, *jobs);
  std::erase_if(found_at_end, [&](ContactPoint& contact) {
    contact.a.region = contact.b.region = {};
    const Vec3 a = place_at_start(contact.a, contact.normal), b = place_at_start(contact.b, -contact.normal);
    contact.position = 0.5 * (a + b);
    const double before = contact.normal.dot(a - b), after = std::exchange(contact.gap, before);
    return !(after < std::min(before, 0.0) - least) || is_left_open(in_force, contact, after + least) ||
           (contact_acts && !contact_acts(contact));
  });
  if (found_at_end.empty()) return false;
  std::ranges::sort(found_at_end, by_bodies);
  std::erase_if(in_force, [&](const ContactPoint& contact) {
    return std::ranges::binary_search(found_at_end, contact, by_bodies);
  });
  in_force.insert(in_force.end(), found_at_end.begin(), found_at_end.end());
  known.reserve(touching.capacity());
  std::ranges::sort(in_force, by_bodies);
  set_contacts(in_force);
  return true;
}

/// Where islands end, and their members. @return whether two of them may have come nearer than this
bool World::Impl::list_ends(double least) {
  members.clear();
  double farthest = 0.0;
  for (const Index body : sleep.awake()) {
    if (!shows(entries[static_cast<std::size_t>(body)]) || !constraints.constrained(body)) continue;
    members.push_back(body);
    foreseen_end(body, ends_foreseen);
    farthest = std::max(farthest, (ends_foreseen.pose.p - states[static_cast<std::size_t>(body)].pose.p).norm() +
                                      beside(body, ends_foreseen));
  }
  if (!(2.0 * farthest > least)) return false;
  ends = states;
  for (const Index body : members) {
    const auto i = static_cast<std::size_t>(body);
    const BodyGroup& bodies = group(entries[i]);
    ends[i] = {.pose = bodies.predicted_frame(entries[i].slot).pose()};
    if (!entries[i].shape) ends[i].amplitudes = bodies.predicted_amplitudes(entries[i].slot);
  }
  return true;
}

}  // namespace limber
