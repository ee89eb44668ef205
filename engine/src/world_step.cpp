#include <algorithm>
#include <limits>
#include <utility>

#include "world_impl.h"

namespace limber {

void World::step() {
  Impl& m = *impl_;
  m.energy_removed = 0.0, m.solved = true, m.iterations = m.newton_steps = 0, m.residual = 0.0;
  m.attempts = {};
  m.programs = {};
  m.clock = StageClock(m.stage_times);
  m.keep_dents();
  if (m.source != nullptr) m.parts->begin_events();
  for (int part = 0; part < m.parts->count(); ++part) {
    m.advance_part(part);
    const IslandReport report = m.constraints.report();
    m.energy_removed += report.energy_removed;
    m.solved = m.solved && report.status == SolveStatus::kSolved;
    m.iterations = std::max(m.iterations, report.iterations);
    m.newton_steps = std::max(m.newton_steps, report.newton_steps);
    m.residual = std::max(m.residual, report.change);
    m.attempts.add(report.attempts);
    m.programs.add(report.programs);
  }
  m.parts->finish();
  if (m.source != nullptr) m.parts->end_events();
  if (m.options.sleep.enabled) m.sleep.update(m.options.sleep, m.options.step, contact_events());
  ++m.steps;
  m.clock.lap(Stage::kBookkeeping, 1);
}

void World::set_stage_times(StageTimes* times) { impl_->stage_times = times; }

void World::Impl::advance_part(int part) {
  for (const auto& group : groups)
    if (group) group->set_within_step(part > 0);
  parts->begin(part);
  clock.lap(Stage::kBookkeeping);
  foresee();
  make_ranges();
  advance_free();
  constraints.finish(*jobs);
  for (const Index body : sleep.awake()) entries[static_cast<std::size_t>(body)].held = constraints.constrained(body);
  if (clock.runs()) clock.lap(constraints.times(), Stage::kSolve);
  if (source == nullptr) return;
  const bool woke = some_woke();
  contacts.finish(passing.any() ? passing.rests : sleep.asleep(), woke);
  parts->add_events(part, contacts.events());
  clock.lap(Stage::kBookkeeping);
  if (!passing.any()) return;
  const auto waiting = static_cast<std::int64_t>(passing.members.size());
  advance_passing(part);
  clock.lap(Stage::kFastBodies, waiting);
}

/// Bodies that are awake, and are as `counts` asks for.
template <class F>
std::int64_t World::Impl::count_awake(F&& counts) {
  std::int64_t count = 0;
  for (const Index body : sleep.awake())
    if (counts(body)) ++count;
  return count;
}

/// Bodies that nothing constrains.
void World::Impl::advance_free() {
  // One captured pointer fits in std::function's own storage, so this allocates nothing.
  jobs->parallel_for(ranges.size(), 1, [this](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r)
      groups[static_cast<std::size_t>(ranges[r].group)]->advance(ranges[r].begin, ranges[r].end, options.gravity);
  });
  if (!clock.runs()) return;
  const std::int64_t constrained = count_awake([&](Index body) { return constraints.constrained(body); }) +
                                   static_cast<std::int64_t>(passing.members.size());
  clock.lap(Stage::kAdvance, count_awake([](Index) { return true; }) - constrained);
}

/// What touches in the states as they are.
void World::Impl::ask_source() {
  const bool told_all = write_states();
  if (clock.runs()) clock.lap(Stage::kLookAhead, count_awake([](Index) { return true; }));
  StageTimes theirs;
  source->find_contacts({.states = states,
                         .awake = told_all ? std::span<const Index>() : sleep.awake(),
                         .times = clock.runs() ? &theirs : nullptr},
                        touching, *jobs);
  clock.lap(theirs, Stage::kNarrowPhase);
}

/// What touches, what that makes islands of, and where these end. Contacts are looked for anew where bodies come
/// farther than expected, three times at most: each time at least twice as far.
void World::Impl::foresee() {
  constexpr int kMostLooks = 3;
  expected.resize(entries.size());
  for (const Index body : sleep.awake()) expected[static_cast<std::size_t>(body)].foreseen = false;
  double rough = 0.0;
  if (source != nullptr) {
    rough = roughness();
    look_for_contacts();
    take_contacts();
  }
  for (int look = 0;; ++look) {
    constraints.hold_back(passing.members);
    constraints.find_islands(sleep.awake());
    clock.lap(Stage::kRows);
    constraints.foresee(*jobs, {.step = parts->length(),
                                .gravity = options.gravity,
                                .contact = contacts.options().rule,
                                .timed = clock.runs(),
                                .rough = look < kMostLooks ? rough : 0.0});
    if (clock.runs()) clock.lap(constraints.foreseen_times(), Stage::kSolve);
    if (source == nullptr || look == kMostLooks) break;
    if (find_elsewhere())
      constraints.let_go();
    else if (find_at_end())
      constraints.set_contacts(contacts.constraints());
    else
      break;
    ++attempts[StepAttempt::kLookedFarther];
  }
  clock.lap(Stage::kLookAhead);
  constraints.refine(*jobs);
  if (clock.runs()) clock.lap(constraints.foreseen_times(), Stage::kSolve);
}

/// How near to the law motions are found that are only looked at, m: to a share of what makes a look, and of the
/// thinnest body.
double World::Impl::roughness() {
  constexpr double kOfSinking = 0.25, kOfThickness = 1e-4;
  double thinnest = std::numeric_limits<double>::infinity();
  for (const Index body : sleep.awake())
    if (const Entry& e = entries[static_cast<std::size_t>(body)]; shows(e))
      thinnest = std::min(thinnest, e.extent.thickness);
  return std::min(kOfSinking * sinking(), kOfThickness * thinnest);
}

/// What touches, or may within the step.
void World::Impl::look_for_contacts() {
  passing.farther.clear();
  do {
    ask_source();
    if (contact_acts) std::erase_if(touching, [this](const ContactPoint& contact) { return !contact_acts(contact); });
  } while (wake_what_is_touched() || find_passing());
  clock.lap(Stage::kFastBodies);
  known.reserve(touching.capacity());
}

/// As rows for the islands.
void World::Impl::take_contacts() {
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
/// @return whether those of bodies that sleep, too
bool World::Impl::write_states() {
  if (states_of != sleep.changes()) tellings_left = 2;
  states_of = sleep.changes();
  if (tellings_left > 0) {
    --tellings_left;
    write_all_states();
    return true;
  }
  for (const Index body : sleep.awake())
    if (shows(entries[static_cast<std::size_t>(body)])) {
      write_state(body, parts->length());
      expect(body);
    }
  return false;
}

/// Whether a body whose contacts were remembered as those of a sleeper takes part again.
bool World::Impl::some_woke() {
  const bool woke = contacts_of != sleep.wakings() || contacts_waited || passing.any();
  contacts_of = sleep.wakings();
  contacts_waited = passing.any();
  return woke;
}

void World::Impl::write_all_states() {
  friction.resize(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i)
    friction[i] = entries[i].friction >= 0.0 ? entries[i].friction : contact_options.friction;
  states.resize(entries.size());
  motions.resize(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    Entry& e = entries[i];
    if (!e.alive) continue;
    if (e.group < 0) {
      states[i] = {.pose = e.pose, .asleep = std::exchange(e.placed, true)};
      expect_to_stay(states[i]);
      continue;
    }
    if (!shows(e)) {
      states[i] = {};
      continue;
    }
    write_state(static_cast<Index>(i), parts->length());
    expect(static_cast<Index>(i));
  }
}

void World::Impl::expect_to_stay(BodyState& state) {
  state.doubt = 0.0;
  state.end_pose = state.pose;
  state.end_amplitudes = state.amplitudes;
}

/// Of a body that moves. @param length how long it is to be looked ahead, s
void World::Impl::write_state(Index body, double length) {
  const auto i = static_cast<std::size_t>(body);
  const Entry& e = entries[i];
  const BodyGroup& bodies = group(e);
  const RigidFrame& frame = bodies.frame(e.slot);
  states[i] = {.pose = frame.pose(), .asleep = sleep.asleep(body)};
  if (!e.shape) states[i].amplitudes = bodies.amplitudes(e.slot);
  if (states[i].asleep) {
    expect_to_stay(states[i]);
    return;
  }
  bodies.predict_motion(e.slot, options.gravity, length, motions[i]);
  if (e.shape) motions[i].set_modes({}, {}, {}, {});
  // Without gravity: what lies on something does not fall, and what falls has a velocity.
  states[i].displacement = length * frame.velocity();
  states[i].rotation = length * frame.angular_velocity(bodies.frame_constants());
  states[i].reach = free_reach(body, states[i].displacement);
  if (!passing.looks_farther(body) && can_wait(body)) states[i].look_ahead = e.extent.thickness;
}

/// How far any point of a body may come by itself beside a displacement, m.
double World::Impl::free_reach(Index body, const Vec3& displacement) const {
  const auto i = static_cast<std::size_t>(body);
  const Entry& e = entries[i];
  if (e.shape) return motions[i].reach(e.extent.radius, {}, displacement);
  const BodyGroup& bodies = group(e);
  const SurfaceExtent& extent = bodies.model().collision_extent();
  if (!bodies.skinned(e.slot)) return motions[i].reach(extent.radius, extent.shape, displacement);
  return skins[static_cast<std::size_t>(e.group)]->reach(bodies.shape(e.slot), motions[i], displacement);
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
