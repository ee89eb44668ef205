#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "world_impl.h"

namespace limber {
namespace {

/// How far a turn takes a point at an arm of 1.
double chord(const Quaternion& from, const Quaternion& to) {
  const Quaternion turn = to * from.conjugate();
  return 2.0 * turn.vector().norm();
}

}  // namespace

/// How far contacts are looked for. A body that nothing held in the last step comes as far as it does by itself. What
/// held others holds them on for the most part: a squeezed body does not spring open. So they are expected to come
/// twice as far as their velocities take them, and as they fall; whether they do is seen in find_farther().
void World::Impl::expect_reach(Index body) {
  const auto i = static_cast<std::size_t>(body);
  const Entry& e = entries[i];
  BodyState& state = states[i];
  if (state.asleep) return;
  if (e.held) {
    const BodyGroup& bodies = group(e);
    const double length = parts->length();
    double arm = e.extent.radius, way = 0.0;
    if (!e.shape) {
      const std::span<const double> shape = bodies.model().collision_extent().shape, z = bodies.amplitudes(e.slot),
                                    rates = bodies.rates(e.slot);
      for (std::size_t k = 0; k < z.size(); ++k) {
        arm += shape[k] * std::abs(z[k]);
        way += shape[k] * std::abs(rates[k]) * length;
      }
    }
    way += state.displacement.norm() + state.rotation.norm() * arm;
    const double fall = 0.5 * options.gravity.norm() * length * length;
    state.reach = std::min(state.reach, 2.0 * way + fall);
  }
  state.reach = std::max(state.reach, ways[i]);
}

/// How far any point of a body comes by what has been foreseen, m.
double World::Impl::foreseen_way(Index body) const {
  const auto i = static_cast<std::size_t>(body);
  const Entry& e = entries[i];
  const BodyGroup& bodies = group(e);
  const SurfaceExtent& extent = bodies.model().collision_extent();
  if (!constraints.constrained(body))
    return e.shape ? motions[i].reach(e.extent.radius, {}) : motions[i].reach(extent.radius, extent.shape);
  const RigidTransform &from = bodies.frame(e.slot).pose(), &to = bodies.predicted_frame(e.slot).pose();
  double arm = e.extent.radius, flexing = 0.0;
  if (!e.shape) {
    const std::span<const double> z = bodies.amplitudes(e.slot), end = bodies.predicted_amplitudes(e.slot);
    for (std::size_t k = 0; k < z.size(); ++k) {
      arm += extent.shape[k] * std::abs(z[k]);
      flexing += extent.shape[k] * std::abs(end[k] - z[k]);
    }
  }
  return (to.p - from.p).norm() + chord(from.q, to.q) * arm + flexing;
}

/// Once the step has been foreseen: looks for contacts anew where a body comes farther than they were looked for, by a
/// blow or since something lets go of it. @return whether it did: the step is to be foreseen anew
bool World::Impl::find_farther() {
  bool farther = false;
  for (const Index body : sleep.awake()) {
    const auto i = static_cast<std::size_t>(body);
    if (!shows(entries[i]) || constraints.is_held_back(body)) continue;
    const double way = foreseen_way(body);
    if (!(way > states[i].reach)) continue;
    farther = farther || states[i].reach < states[i].look_ahead;
    ways[i] = constraints.constrained(body) ? 2.0 * way : way;
  }
  if (farther) find_contacts();
  return farther;
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
    farthest = std::max(farthest, foreseen_way(body));
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
