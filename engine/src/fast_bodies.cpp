#include "fast_bodies.h"

#include <algorithm>
#include <limits>
#include <tuple>

namespace limber::internal {

void NearPairs::list_touching(std::span<const ContactPoint> in_force, double within) {
  touching.clear();
  for (const ContactPoint& c : in_force) {
    const std::pair pair(c.a.body, c.b.body);
    if (c.gap <= within || std::ranges::find(crept, pair) != crept.end()) touching.push_back(pair);
  }
  std::ranges::sort(touching);
  touching.erase(std::unique(touching.begin(), touching.end()), touching.end());
}

/// Half-spaces are planes for good.
void NearPairs::drop_planes() {
  std::erase_if(touches, [&](const Impact& touch) {
    return planes[static_cast<std::size_t>(touch.a)] != 0 || planes[static_cast<std::size_t>(touch.b)] != 0;
  });
}

/// A motion that has been cut is another one: it is to stay clear of what the first came near, by half as much.
double PassingWatch::clear_until(const FreeMotions& found, double length) {
  if (pairs_.frames.size() < found.members.size()) pairs_.frames.resize(found.members.size());
  for (std::size_t i = 0; i < found.members.size(); ++i) {
    const auto body = static_cast<std::size_t>(found.members[i]);
    pairs_.motions[body] = &found.motions[i];
    if (pairs_.wears_shape[body] == 0) continue;
    pairs_.frames[i] = found.motions[i];
    pairs_.frames[i].set_modes({}, {}, {}, {});
    pairs_.motions[body] = &pairs_.frames[i];
  }
  const double until = first_turned(found, length);
  source_.find_impacts({.states = states_,
                        .motions = pairs_.motions,
                        .step = until,
                        .margin = margin_,
                        .least_margin = pairs_.least_margin(),
                        .bodies = found.members,
                        .except = pairs_.touching},
                       pairs_.touches, serial_jobs());
  for (const Index member : found.members) pairs_.motions[static_cast<std::size_t>(member)] = nullptr;
  pairs_.drop_planes();
  touch_ = {};
  if (pairs_.touches.empty()) return until;
  touch_ = pairs_.touches.front();
  if (touch_.resting) pairs_.crept.emplace_back(touch_.a, touch_.b);
  margin_ *= kEngineTuning.fast.nearer;
  return touch_.time;
}

/// When a body may have turned too far of a pair that is not looked at, as it touches.
double PassingWatch::first_turned(const FreeMotions& found, double length) const {
  double until = length;
  for (const auto& [a, b] : pairs_.touching)
    for (const Index body : {a, b}) {
      const ExactMotion* motion = found.of(body);
      if (motion == nullptr || pairs_.turns[static_cast<std::size_t>(body)] == 0) continue;
      const double speed = motion->path().bounds(0.0, until).angular_speed;
      if (speed * until > kEngineTuning.fast.most_turn) until = kEngineTuning.fast.most_turn / speed;
    }
  return until;
}

bool FastBodies::gather(std::span<const ContactPoint> found, double length, Jobs& jobs) {
  clusters_.members.clear();
  clusters_.ends.clear();
  list_fast();
  if (fast_.empty()) return false;
  find_first_touches(found, length, jobs);
  add_brisk();
  if (near_.touches.empty()) return false;
  if (wake_touched()) return true;
  join(found);
  mark_waiting();
  return look_farther();
}

void FastBodies::list_fast() {
  fast_.clear();
  for (const Index body : sleep_->awake())
    if (forecast_->way(body) > kEngineTuning.fast.slow * forecast_->state(body).look_ahead) fast_.push_back(body);
}

/// First touches of the fast with all that move: what is slow may come to meet them.
void FastBodies::find_first_touches(std::span<const ContactPoint> found, double length, Jobs& jobs) {
  NearPairs& p = near_;
  p.motions.assign(bodies_->size(), nullptr);
  p.planes.assign(bodies_->size(), 0);
  for (std::size_t i = 0; i < bodies_->size(); ++i) {
    const BodyTable::Entry& e = (*bodies_)[static_cast<Index>(i)];
    p.planes[i] = e.alive && e.shape && std::holds_alternative<HalfSpace>(*e.shape);
  }
  p.first_margin = std::numeric_limits<double>::infinity();
  for (const Index body : sleep_->awake()) p.motions[static_cast<std::size_t>(body)] = &forecast_->motion(body);
  for (const Index body : fast_)
    p.first_margin = std::min(p.first_margin, kEngineTuning.fast.touch * forecast_->state(body).look_ahead);
  p.margin = p.first_margin;
  p.crept.clear();
  p.list_touching(found, p.first_margin);
  registry_->source()->find_impacts({.states = forecast_->states(),
                                     .motions = p.motions,
                                     .step = length,
                                     .margin = p.margin,
                                     .least_margin = p.least_margin(),
                                     .bodies = fast_,
                                     .except = p.touching},
                                    p.touches, jobs);
  for (const Index body : sleep_->awake()) p.motions[static_cast<std::size_t>(body)] = nullptr;
  std::erase_if(p.touches, [&](const Impact& touch) { return planes_last(touch.a, touch.b); });
}

/// Whether contacts found ahead are good for two bodies: the step moves one by less than the thinner's thickness, as
/// the other sees it.
bool FastBodies::planes_last(Index a, Index b) const {
  const BodyState &x = forecast_->state(a), &y = forecast_->state(b);
  const auto beside = [&](Index body, const BodyState& s) {
    return s.asleep || !constraints_->moves(body) ? 0.0 : std::max(0.0, forecast_->way(body) - s.displacement.norm());
  };
  return (x.displacement - y.displacement).norm() + beside(a, x) + beside(b, y) <= std::min(x.look_ahead, y.look_ahead);
}

/// Adds pairs that touch already, and go on faster than by their fall.
void FastBodies::add_brisk() {
  const auto brisk = [&](Index body) {
    const BodyState& s = forecast_->state(body);
    return constraints_->moves(body) && !s.asleep && forecast_->way(body) - forecast_->fall() > s.look_ahead;
  };
  for (const auto& [a, b] : near_.touching)
    if (brisk(a) || brisk(b)) near_.touches.push_back({.a = a, .b = b});
  near_.drop_planes();
}

/// @return whether anything slept
bool FastBodies::wake_touched() {
  bool woke = false;
  for (const Impact& touch : near_.touches)
    for (const Index body : {touch.a, touch.b})
      if (sleep_->asleep(body)) {
        sleep_->wake(body);
        woke = true;
      }
  return woke;
}

/// Joins what touches and what is tied together.
void FastBodies::join(std::span<const ContactPoint> found) {
  const auto join = [&](Index a, Index b) {
    if (a >= 0 && b >= 0 && moves(a) && moves(b)) clusters_.sets.join(a, b);
  };
  clusters_.sets.reset(bodies_->size());
  for (const ContactPoint& contact : found) join(contact.a.body, contact.b.body);
  for (const ConstraintStage::Entry& entry : constraints_->entries())
    if (const Constraint* constraint = entry.constraint()) join(constraint->bodies()[0], constraint->bodies()[1]);
  for (const Impact& touch : near_.touches) join(touch.a, touch.b);
}

/// Clusters: what touches so, and what has been joined to it.
void FastBodies::mark_waiting() {
  auto& [sets, waits, members, ends] = clusters_;
  waits.assign(bodies_->size(), 0);
  for (const Impact& touch : near_.touches)
    for (const Index body : {touch.a, touch.b})
      if (moves(body)) waits[static_cast<std::size_t>(sets.root(body))] = 1;
  for (std::size_t i = 0; i < bodies_->size(); ++i) {
    const auto body = static_cast<Index>(i);
    if (!(*bodies_)[body].alive || !moves(body)) continue;
    waits[i] = waits[static_cast<std::size_t>(sets.root(body))];  // a root comes before the others
    if (waits[i] != 0) members.push_back(body);
  }
  const auto root = [this](Index body) { return clusters_.sets.root(body); };
  std::ranges::sort(members, {}, [&](Index body) { return std::pair(root(body), body); });
  for (std::size_t m = 1; m <= members.size(); ++m)
    if (m == members.size() || root(members[m]) != root(members[m - 1])) ends.push_back(m);
}

/// Steps of bodies that are led, hang from what is fixed, or that something comes to at a time of its own are not cut:
/// in their clusters contacts are looked for as far as bodies come. @return whether there are new ones
bool FastBodies::look_farther() {
  fixed_.assign(bodies_->size(), 0);
  for (const ConstraintStage::Entry& entry : constraints_->entries())
    if (entry.handle) fixed_[static_cast<std::size_t>(entry.handle->bodies()[0])] = 1;
  bool more = false;
  std::size_t begin = 0;
  for (const std::size_t end : clusters_.ends) {
    const auto cluster = std::span(clusters_.members).subspan(begin, end - begin);
    begin = end;
    if (std::ranges::all_of(cluster, [&](Index body) {
          return fixed_[static_cast<std::size_t>(body)] == 0 && forecast_->can_wait(body);
        }))
      continue;
    forecast_->look_farther(cluster);
    more = true;
  }
  return more;
}

void FastBodies::leave_out_contacts(std::span<const ContactPoint> found) {
  const auto waiting = [&](Index body) { return clusters_.waits[static_cast<std::size_t>(body)] != 0; };
  contacts_.clear();
  std::ranges::copy_if(found, std::back_inserter(contacts_),
                       [&](const ContactPoint& c) { return !waiting(c.a.body) && !waiting(c.b.body); });
  const std::span<const char> asleep = sleep_->asleep();
  rests_.assign(asleep.begin(), asleep.end());
  for (const Index member : clusters_.members) rests_[static_cast<std::size_t>(member)] = 1;
}

void FastBodies::advance(const Substep& substep, std::span<const ContactPoint> found, ContactRows& rows,
                         StepEvents& events, StepAttempts& attempts) {
  forecast_->stand_still();
  near_.turns.assign(bodies_->size(), 0);
  near_.wears_shape.assign(bodies_->size(), 0);
  for (const Index member : clusters_.members) {
    const auto i = static_cast<std::size_t>(member);
    const Shape* shape = (*bodies_)[member].shape.get();
    near_.wears_shape[i] = shape != nullptr;
    near_.turns[i] = shape == nullptr || !std::holds_alternative<Sphere>(*shape);
  }
  const Step step{substep, found, rows, events, attempts};
  std::size_t begin = 0;
  for (const std::size_t end : clusters_.ends) {
    advance_cluster(std::span(clusters_.members).subspan(begin, end - begin), step);
    near_.margin *= kEngineTuning.fast.nearer;
    begin = end;
  }
  constraints_->let_go();
  clusters_.members.clear();
  clusters_.ends.clear();
}

void FastBodies::advance_cluster(std::span<const Index> members, const Step& step) {
  rests_.assign(bodies_->size(), 1);
  near_.crept.clear();
  for (const Index member : members) rests_[static_cast<std::size_t>(member)] = 0;
  ContactSet& contacts = step.rows.set;
  const double whole = step.substep.length;
  IslandOptions options{.step = whole, .gravity = step.substep.gravity, .whole_step = whole};
  for (int count = 1;; ++count, options.begins = false) {
    const std::span<const ContactPoint> found = find_contacts(members, count == 1, options.step, step.found);
    step.rows.take(constraints_->states(), found);
    near_.list_touching(found, near_.least_margin());
    PassingWatch watch(*registry_->source(), forecast_->states(), near_);
    options.watch = &watch;
    const double taken = constraints_->step_together(members, contacts.constraints(), options);
    contacts.finish(rests_, true);
    step.events.add(step.substep.index, contacts.events());
    for (const Index member : members) forecast_->write_state(member, 0.0);
    const Impact* touch = watch.touch();
    if (!(taken < options.step)) break;
    ++step.attempts[StepAttempt::kCutAtFirstTouch];
    options.step -= taken;
    const auto stands = [&](Index body) {
      return rests_[static_cast<std::size_t>(body)] != 0 && constraints_->moves(body);
    };
    const bool met_another = touch != nullptr && (stands(touch->a) || stands(touch->b));
    if (met_another || count == kEngineTuning.fast.most_parts) {
      ++step.attempts[StepAttempt::kHeldAtTouch];
      break;
    }
  }
  constraints_->end_together(members);
  for (const Index member : members) sleep_->wake(member);
}

/// Contacts of the members among each other and with what never moves: as far as the smallest of them, so that where
/// one part of it touches the others have their contacts.
std::span<const ContactPoint> FastBodies::find_contacts(std::span<const Index> members, bool first, double left,
                                                        std::span<const ContactPoint> found) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const Index member : members) smallest = std::min(smallest, (*bodies_)[member].extent.radius);
  for (const Index member : members) forecast_->expect_in_part(member, left, smallest);
  if (first)
    contacts_.assign(found.begin(), found.end());
  else
    registry_->source()->find_contacts({.states = forecast_->states(), .bodies = members}, contacts_, serial_jobs());
  std::erase_if(contacts_, [&](const ContactPoint& contact) {
    if (!first && !registry_->acts(contact)) return true;
    const bool a = rests_[static_cast<std::size_t>(contact.a.body)] == 0,
               b = rests_[static_cast<std::size_t>(contact.b.body)] == 0;
    return !(a || b) || (!a && constraints_->moves(contact.a.body)) || (!b && constraints_->moves(contact.b.body));
  });
  return contacts_;
}

}  // namespace limber::internal
