#include <algorithm>

#include "world_impl.h"

namespace limber {

using internal::PassingBodies;
using internal::PassingWatch;

/// Looks for bodies that come farther than contacts were looked for. @return whether contacts are to be found again
bool World::Impl::find_passing() {
  PassingBodies& p = passing;
  p.members.clear();
  p.ends.clear();
  list_fast();
  if (p.fast.empty()) return false;
  find_first_touches();
  add_brisk();
  if (p.touches.empty()) return false;
  bool woke = false;
  for (const Impact& touch : p.touches)
    for (const Index body : {touch.a, touch.b})
      if (sleep.asleep(body)) {
        sleep.wake(body);
        woke = true;
      }
  if (woke) return true;
  join_passing();
  return look_farther();
}

void World::Impl::list_fast() {
  passing.fast.clear();
  for (const Index body : sleep.awake()) {
    const BodyState& state = states[static_cast<std::size_t>(body)];
    if (ways[static_cast<std::size_t>(body)] > PassingBodies::kSlow * state.look_ahead) passing.fast.push_back(body);
  }
}

/// Of the fast, among all that move: what is slow may come to meet them.
void World::Impl::find_first_touches() {
  PassingBodies& p = passing;
  p.motions.assign(entries.size(), nullptr);
  p.planes.assign(entries.size(), 0);
  for (std::size_t i = 0; i < entries.size(); ++i)
    p.planes[i] = entries[i].alive && entries[i].shape && std::holds_alternative<HalfSpace>(*entries[i].shape);
  p.first_margin = std::numeric_limits<double>::infinity();
  for (const Index body : sleep.awake())
    p.motions[static_cast<std::size_t>(body)] = &motions[static_cast<std::size_t>(body)];
  for (const Index body : p.fast) {
    const auto i = static_cast<std::size_t>(body);
    p.first_margin = std::min(p.first_margin, PassingBodies::kTouch * states[i].look_ahead);
  }
  p.margin = p.first_margin;
  p.crept.clear();
  p.list_touching(touching, p.first_margin);
  source->find_impacts({.states = states,
                        .motions = p.motions,
                        .step = parts->length(),
                        .margin = p.margin,
                        .least_margin = p.least_margin(),
                        .bodies = p.fast,
                        .except = p.touching},
                       p.touches, *jobs);
  for (const Index body : sleep.awake()) p.motions[static_cast<std::size_t>(body)] = nullptr;
  std::erase_if(p.touches, [&](const Impact& touch) { return planes_last(touch.a, touch.b); });
}

/// Whether contacts found ahead are good for two bodies: the step moves one by less than the thinner's thickness, as
/// the other sees it.
bool World::Impl::planes_last(Index a, Index b) const {
  const BodyState &x = states[static_cast<std::size_t>(a)], &y = states[static_cast<std::size_t>(b)];
  const auto beside = [&](Index body, const BodyState& s) {
    return s.asleep || !constraints.moves(body)
               ? 0.0
               : std::max(0.0, ways[static_cast<std::size_t>(body)] - s.displacement.norm());
  };
  return (x.displacement - y.displacement).norm() + beside(a, x) + beside(b, y) <= std::min(x.look_ahead, y.look_ahead);
}

/// What touches already, and goes on faster than by its fall.
void World::Impl::add_brisk() {
  PassingBodies& p = passing;
  const auto brisk = [&](Index body) {
    const BodyState& s = states[static_cast<std::size_t>(body)];
    return constraints.moves(body) && !s.asleep && ways[static_cast<std::size_t>(body)] - fall() > s.look_ahead;
  };
  for (const auto& [a, b] : p.touching)
    if (brisk(a) || brisk(b)) p.touches.push_back({.a = a, .b = b});
  p.drop_planes();
}

/// Clusters: what touches so, and what that is tied to.
void World::Impl::join_passing() {
  PassingBodies& p = passing;
  const auto moves = [&](Index body) { return constraints.moves(body) && !sleep.asleep(body); };
  const auto join = [&](Index a, Index b) {
    if (a >= 0 && b >= 0 && moves(a) && moves(b)) p.sets.join(a, b);
  };
  p.sets.reset(entries.size());
  for (const ContactPoint& contact : touching) join(contact.a.body, contact.b.body);
  for (const internal::ConstraintStage::Entry& entry : constraints.entries())
    if (const Constraint* constraint = entry.constraint()) join(constraint->bodies()[0], constraint->bodies()[1]);
  for (const Impact& touch : p.touches) join(touch.a, touch.b);
  p.waits.assign(entries.size(), 0);
  for (const Impact& touch : p.touches)
    for (const Index body : {touch.a, touch.b})
      if (moves(body)) p.waits[static_cast<std::size_t>(p.sets.root(body))] = 1;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const auto body = static_cast<Index>(i);
    if (!entries[i].alive || !moves(body)) continue;
    p.waits[i] = p.waits[static_cast<std::size_t>(p.sets.root(body))];  // a root comes before the others
    if (p.waits[i] != 0) p.members.push_back(body);
  }
  std::ranges::sort(p.members, {}, [&](Index body) { return std::pair(p.sets.root(body), body); });
  for (std::size_t m = 1; m <= p.members.size(); ++m)
    if (m == p.members.size() || p.sets.root(p.members[m]) != p.sets.root(p.members[m - 1])) p.ends.push_back(m);
}

/// Steps of bodies that are led, hang from what is fixed, or that something comes to at a time of its own are not cut:
/// in their clusters contacts are looked for as far as bodies come. @return whether there are new ones
bool World::Impl::look_farther() {
  PassingBodies& p = passing;
  p.fixed.assign(entries.size(), 0);
  for (const internal::ConstraintStage::Entry& entry : constraints.entries())
    if (entry.handle) p.fixed[static_cast<std::size_t>(entry.handle->bodies()[0])] = 1;
  bool more = false;
  std::size_t begin = 0;
  for (const std::size_t end : p.ends) {
    const auto cluster = std::span(p.members).subspan(begin, end - begin);
    begin = end;
    if (std::ranges::all_of(cluster,
                            [&](Index body) { return p.fixed[static_cast<std::size_t>(body)] == 0 && can_wait(body); }))
      continue;
    p.farther.resize(entries.size());
    for (const Index body : cluster) p.farther[static_cast<std::size_t>(body)] = 1;
    more = true;
  }
  return more;
}

bool World::Impl::can_wait(Index body) const {
  const Entry& e = entries[static_cast<std::size_t>(body)];
  const BodyGroup& bodies = group(e);
  return bodies.frame_constants().motion == FrameMotion::kFree && !bodies.has_delayed_impulse(e.slot);
}

/// All else has taken its step.
void World::Impl::advance_passing(int part) {
  PassingBodies& p = passing;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (!entries[i].alive || entries[i].group < 0) continue;
    states[i].pose = group(entries[i]).frame(entries[i].slot).pose();
    states[i].reach = 0.0;
    states[i].displacement = states[i].rotation = Vec3::Zero();
    expect_to_stay(states[i]);
  }
  p.turns.assign(entries.size(), 0);
  p.wears_shape.assign(entries.size(), 0);
  for (const Index member : p.members) {
    const auto i = static_cast<std::size_t>(member);
    const Shape* shape = entries[i].shape.get();
    p.wears_shape[i] = shape != nullptr;
    p.turns[i] = shape == nullptr || !std::holds_alternative<Sphere>(*shape);
  }
  std::size_t begin = 0;
  for (const std::size_t end : p.ends) {
    advance_cluster(std::span(p.members).subspan(begin, end - begin), part);
    p.margin *= PassingBodies::kNearer;
    begin = end;
  }
  constraints.let_go();
  p.members.clear();
  p.ends.clear();
}

void World::Impl::advance_cluster(std::span<const Index> members, int part) {
  PassingBodies& p = passing;
  p.rests.assign(entries.size(), 1);
  p.crept.clear();
  for (const Index member : members) p.rests[static_cast<std::size_t>(member)] = 0;
  const double whole = parts->length();
  IslandOptions step{
      .step = whole, .gravity = options.gravity, .contact = contacts.options().rule, .whole_step = whole};
  for (int count = 1;; ++count, step.begins = false) {
    const std::span<const ContactPoint> found = contacts_of_cluster(members, count == 1, step.step);
    set_contacts(found);
    p.list_touching(found, p.least_margin());
    PassingWatch watch(*source, states, p);
    step.watch = &watch;
    const double taken = constraints.step_together(members, contacts.constraints(), step);
    contacts.finish(p.rests, true);
    parts->add_events(part, contacts.events());
    for (const Index member : members) write_state(member, 0.0);
    const Impact* touch = watch.touch();
    if (!(taken < step.step)) break;
    ++attempts[StepAttempt::kCutAtFirstTouch];
    step.step -= taken;
    const auto stands = [&](Index body) {
      return p.rests[static_cast<std::size_t>(body)] != 0 && constraints.moves(body);
    };
    const bool met_another = touch != nullptr && (stands(touch->a) || stands(touch->b));
    if (met_another || count == PassingBodies::kMostParts) {
      ++attempts[StepAttempt::kHeldAtTouch];
      break;
    }
  }
  constraints.end_together(members);
  for (const Index member : members) sleep.wake(member);
}

/// Where a body would be when the part ends, if nothing held it.
void World::Impl::expect_in_part(Index body, double left) {
  const auto i = static_cast<std::size_t>(body);
  BodyState& state = states[i];
  ExpectedEnd& end = expected[i];
  end.amplitudes.resize(state.amplitudes.size());
  motions[i].at(left, end.pose, end.amplitudes);
  state.end_pose = end.pose;
  state.end_amplitudes = end.amplitudes;
  state.doubt = fall();
}

/// Of the members among each other and with what never moves: as far as the smallest of them, so that where one part
/// of it touches the others have their contacts.
std::span<const ContactPoint> World::Impl::contacts_of_cluster(std::span<const Index> members, bool first,
                                                               double left) {
  PassingBodies& p = passing;
  double smallest = std::numeric_limits<double>::infinity();
  for (const Index member : members)
    smallest = std::min(smallest, entries[static_cast<std::size_t>(member)].extent.radius);
  for (const Index member : members) {
    write_state(member, left);
    expect_in_part(member, left);
    states[static_cast<std::size_t>(member)].look_ahead = smallest;
  }
  if (first)
    p.contacts.assign(touching.begin(), touching.end());
  else
    source->find_contacts({.states = states, .bodies = members}, p.contacts, serial_jobs());
  std::erase_if(p.contacts, [&](const ContactPoint& contact) {
    if (!first && contact_acts && !contact_acts(contact)) return true;
    const bool a = p.rests[static_cast<std::size_t>(contact.a.body)] == 0,
               b = p.rests[static_cast<std::size_t>(contact.b.body)] == 0;
    return !(a || b) || (!a && constraints.moves(contact.a.body)) || (!b && constraints.moves(contact.b.body));
  });
  return p.contacts;
}

}  // namespace limber
