#include <algorithm>
#include <utility>

#include "world_impl.h"

namespace limber {

void World::step() {
  Impl& m = *impl_;
  m.energy_removed = 0.0, m.solved = true, m.iterations = m.newton_steps = 0;
  m.attempts = {};
  m.programs = {};
  m.keep_dents();
  if (m.source != nullptr) m.parts->begin_events();
  for (int part = 0; part < m.parts->count(); ++part) {
    m.advance_part(part);
    const IslandReport report = m.constraints.report();
    m.energy_removed += report.energy_removed;
    m.solved = m.solved && report.status == SolveStatus::kSolved;
    m.iterations = std::max(m.iterations, report.iterations);
    m.newton_steps = std::max(m.newton_steps, report.newton_steps);
    m.attempts.add(report.attempts);
    m.programs.add(report.programs);
  }
  m.parts->finish();
  if (m.source != nullptr) m.parts->end_events();
  if (m.options.sleep.enabled) m.sleep.update(m.options.sleep, m.options.step, contact_events());
  ++m.steps;
}

void World::Impl::advance_part(int part) {
  for (const auto& group : groups)
    if (group) group->set_within_step(part > 0);
  parts->begin(part);
  find_contacts();
  constraints.hold_back(passing.members);
  constraints.find_islands();
  // One captured pointer fits in std::function's own storage, so this allocates nothing.
  jobs->parallel_for(ranges.size(), 1, [this](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r)
      groups[static_cast<std::size_t>(ranges[r].group)]->advance(ranges[r].begin, ranges[r].end, options.gravity);
  });
  constraints.step(*jobs, {.step = parts->length(), .gravity = options.gravity, .contact = contacts.options().rule});
  if (source == nullptr) return;
  contacts.finish(passing.any() ? passing.rests : sleep.asleep());
  parts->add_events(part, contacts.events());
  if (passing.any()) advance_passing(part);
}

/// What touches, or may within the step, as rows for the islands.
void World::Impl::find_contacts() {
  if (source == nullptr) return;
  passing.farther.clear();
  do {
    write_states();
    source->find_contacts({.states = states}, touching, *jobs);
    if (contact_acts) std::erase_if(touching, [this](const ContactPoint& contact) { return !contact_acts(contact); });
  } while (wake_what_is_touched() || find_passing());
  friction.resize(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i)
    friction[i] = entries[i].friction >= 0.0 ? entries[i].friction : contact_options.friction;
  if (!passing.any()) {
    set_contacts(touching);
  } else {
    passing.leave_out(sleep.asleep(), touching);
    set_contacts(passing.contacts);
  }
  constraints.set_contacts(contacts.constraints());
}

void World::Impl::set_contacts(std::span<const ContactPoint> found) {
  contacts.update(constraints.states(), found, Vec3::Zero(), friction);
}

/// For the source: where bodies are, and how far they may come within the step.
void World::Impl::write_states() {
  states.resize(entries.size());
  motions.resize(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    Entry& e = entries[i];
    if (!e.alive) continue;
    if (e.group < 0) {
      states[i] = {.pose = e.pose, .asleep = std::exchange(e.placed, true)};
      continue;
    }
    write_state(static_cast<Index>(i), parts->length());
  }
}

/// Of a body that moves. @param length how long it is to be looked ahead, s
void World::Impl::write_state(Index body, double length) {
  const auto i = static_cast<std::size_t>(body);
  const Entry& e = entries[i];
  const BodyGroup& bodies = group(e);
  const RigidFrame& frame = bodies.frame(e.slot);
  states[i] = {.pose = frame.pose(), .asleep = sleep.asleep(body)};
  if (!e.shape) states[i].amplitudes = bodies.amplitudes(e.slot);
  if (states[i].asleep) return;
  bodies.predict_motion(e.slot, options.gravity, length, motions[i]);
  if (e.shape) motions[i].set_modes({}, {}, {}, {});
  // Without gravity: what lies on something does not fall, and what falls has a velocity.
  states[i].displacement = length * frame.velocity();
  states[i].rotation = length * frame.angular_velocity(bodies.frame_constants());
  const SurfaceExtent& extent = bodies.model().collision_extent();
  states[i].reach = e.shape ? motions[i].reach(e.extent.radius, {}) : motions[i].reach(extent.radius, extent.shape);
  if (!passing.looks_farther(body) && can_wait(body)) states[i].look_ahead = e.extent.thickness;
}

/// Bodies that sleep are not tested with each other, so those that wake are to be looked at again.
bool World::Impl::wake_what_is_touched() {
  bool woke = false;
  for (const ContactPoint& contact : touching)
    for (const Index body : {contact.a.body, contact.b.body})
      if (sleep.asleep(body)) {
        sleep.wake(body);
        woke = true;
      }
  return woke;
}

}  // namespace limber
