#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "world_impl.h"

namespace limber {

/// How far a body comes in a step that lets go of it. Where something held it, gravity acts at the step's start.
double World::Impl::fall() const { return options.gravity.norm() * parts->length() * parts->length(); }

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

/// Once the step has been foreseen: looks for contacts anew where a body ends elsewhere than they were looked for, by a
/// blow or since something lets go of it: along the motion foreseen then. @return whether it did: the step is to be
/// foreseen anew
bool World::Impl::find_elsewhere() {
  bool elsewhere = false;
  for (const Index body : sleep.awake()) {
    const auto i = static_cast<std::size_t>(body);
    if (!shows(entries[i]) || constraints.is_held_back(body)) continue;
    ExpectedEnd& end = ends_foreseen;
    if (constraints.constrained(body)) {
      foreseen_end(body, end);
    } else {
      end.amplitudes.resize(expected[i].amplitudes.size());
      motions[i].at(parts->length(), end.pose, end.amplitudes);
    }
    const double off =
        (end.pose.p - expected[i].pose.p).norm() + difference(body, expected[i].pose.q, expected[i].amplitudes, end);
    if (!(off > expected[i].doubt)) continue;
    elsewhere = elsewhere || states[i].way() < states[i].look_ahead;
    std::swap(expected[i].amplitudes, end.amplitudes);
    expected[i].pose = end.pose;
    expected[i].doubt = fall();
    expected[i].foreseen = true;
  }
  if (elsewhere) find_contacts();
  return elsewhere;
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
/// side of a thin part, are none: seen from there they were deeper before.
/// @return whether there are any: the step is to be foreseen anew
bool World::Impl::find_at_end() {
  const double least = contact_options.recovery_speed * parts->length();
  if (!list_ends(least)) return false;
  source->find_contacts({.states = ends, .bodies = members}, found_at_end, *jobs);
  std::erase_if(found_at_end, [&](ContactPoint& contact) {
    contact.a.region = contact.b.region = {};
    const Vec3 a = place_at_start(contact.a, contact.normal), b = place_at_start(contact.b, -contact.normal);
    contact.position = 0.5 * (a + b);
    const double before = contact.normal.dot(a - b), after = std::exchange(contact.gap, before);
    return !(after < std::min(before, 0.0) - least) || (contact_acts && !contact_acts(contact));
  });
  if (found_at_end.empty()) return false;
  std::vector<ContactPoint>& in_force = passing.any() ? passing.contacts : touching;
  const auto before = [](const ContactPoint& p, const ContactPoint& q) {
    return std::tie(p.a.body, p.b.body, p.id) < std::tie(q.a.body, q.b.body, q.id);
  };
  std::sort(found_at_end.begin(), found_at_end.end(), before);
  std::erase_if(in_force, [&](const ContactPoint& contact) {
    return std::binary_search(found_at_end.begin(), found_at_end.end(), contact, before);
  });
  in_force.insert(in_force.end(), found_at_end.begin(), found_at_end.end());
  std::sort(in_force.begin(), in_force.end(), before);
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
