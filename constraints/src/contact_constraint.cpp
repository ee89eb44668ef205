#include "limber/constraints/contact_constraint.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "limber/core/error.h"
#include "pair_contacts.h"
#include "rolling_resistance.h"

namespace limber {
namespace {

const auto by_id = [](const auto& x, const auto& y) { return x.id < y.id; };
const ContactMemory* find_in(std::span<const ContactMemory> known, std::uint64_t id) {
  const auto found =
      std::lower_bound(known.begin(), known.end(), id,
                       [](const ContactMemory& memory, std::uint64_t sought) { return memory.id < sought; });
  return found != known.end() && found->id == id ? &*found : nullptr;
}
const auto by_pair = [](const auto& x, const auto& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; };
const Vec3* moment_of(std::span<const RollingMemory> known, Index a, Index b) {
  const auto found = std::lower_bound(known.begin(), known.end(), RollingMemory{.a = a, .b = b}, by_pair);
  return found != known.end() && found->a == a && found->b == b ? &found->moment : nullptr;
}

}  // namespace

void ContactOptions::validate() const {
  const auto number = [](double value, const char* name) {
    if (!(value >= 0.0) || std::isinf(value))
      throw InvalidArgument(std::string("ContactOptions: ") + name + " is " + std::to_string(value) +
                            ", expected a finite number of at least 0");
  };
  number(friction, "friction");
  number(rolling_friction, "rolling_friction");
  number(recovery_speed, "recovery_speed");
  number(impact_speed, "impact_speed");
  number(penalty_frequency, "penalty_frequency");
  number(penalty_damping, "penalty_damping");
  if (penalty_frequency == 0.0) throw InvalidArgument("ContactOptions: penalty_frequency is 0, expected more");
}

struct ContactSet::Impl {
  ContactOptions options;
  std::vector<PreparedContact> contacts;
  std::vector<VertexShare> regions;                // of their sides
  std::vector<double> shapes;                      // of these
  std::vector<ContactMemory> memory, last_memory;  // by id, those that pressed in the last step
  std::vector<ContactMemory> resting_memory;       // by id, those of bodies that sleep
  std::vector<ContactMemory> foreseen;             // by id, where the step has been foreseen before
  std::vector<StrikeMemory> strikes;               // by (a, b), those that did so in the last step
  std::vector<RollingMemory> rolling_memory;       // by (a, b), of the last step
  std::vector<RollingMemory> rolling_foreseen;     // and where the step has been foreseen before
  std::vector<std::unique_ptr<PairContacts>> pairs;
  std::vector<std::unique_ptr<RollingResistance>> rolling;
  std::size_t pairs_used = 0, rolling_used = 0;
  std::vector<Constraint*> constraints;
  std::vector<ContactEvent> events, last_events;
  std::vector<ContactEvent> resting;  // the last of bodies that sleep
  ContactDents dents;
  std::vector<double> give_energy, resting_energy;  // by body: of `memory` and of `resting_memory`
  std::vector<Index> touched;                       // scratch of finish()

  void tell_pressing();
  void tell_ended(std::span<const char> asleep, bool some_woke);
  void remember(std::span<const char> asleep, bool some_woke);
  void remember_rolling(std::span<const char> asleep);
  static void add_energy(std::vector<double>& energy, std::span<const ContactMemory> of);
  void find_energies();
  const ContactMemory* find(std::uint64_t id) const;
  void remember_foreseen();
  double lasted(Index a, Index b) const;
  void resist_rolling(const BodyStates& states, std::span<const PreparedContact> pair);
  void add(const BodyStates& states, const ContactPoint& point, const Vec3& origin, std::span<const double> friction);
  void reserve_regions(const BodyStates& states, std::span<const ContactPoint> points);
  void add_region(PreparedSide& side, const ContactSide& found);
  void spread_shapes(PreparedSide& side);
};

const ContactMemory* ContactSet::Impl::find(std::uint64_t id) const {
  const ContactMemory* known = find_in(memory, id);
  return known != nullptr ? known : find_in(resting_memory, id);
}

/// Of contacts that are to be found anew for the step at hand.
void ContactSet::Impl::remember_foreseen() {
  foreseen.clear();
  for (const PreparedContact& contact : contacts)
    if (contact.foreseen)
      foreseen.push_back({.id = contact.id, .force = contact.foreseen_force, .slip = contact.foreseen_slip});
  std::ranges::sort(foreseen, by_id);
  rolling_foreseen.clear();
  for (std::size_t i = 0; i < rolling_used; ++i)
    if (rolling[i]->is_foreseen()) {
      const auto [a, b] = rolling[i]->bodies();
      rolling_foreseen.push_back({a, b, rolling[i]->foreseen_moment()});
    }
  std::ranges::sort(rolling_foreseen, by_pair);
}

double ContactSet::Impl::lasted(Index a, Index b) const {
  for (const StrikeMemory& strike : strikes)
    if (strike.a == a && strike.b == b) return strike.since;
  return 0.0;
}

void ContactSet::Impl::add(const BodyStates& states, const ContactPoint& point, const Vec3& origin,
                           std::span<const double> friction) {
  const auto of = [&](Index body) {
    return static_cast<std::size_t>(body) < friction.size() ? friction[static_cast<std::size_t>(body)]
                                                            : options.friction;
  };
  PreparedContact contact{
      .id = point.id, .a = make_side(states, point.a, point.normal), .b = make_side(states, point.b, -point.normal)};
  add_region(contact.a, point.a);
  add_region(contact.b, point.b);
  contact.axes = frame_along(point.normal);
  contact.friction = std::sqrt(of(point.a.body) * of(point.b.body));
  contact.offset = contact.a.position(states, StepTime::kStart) - contact.b.position(states, StepTime::kStart);
  contact.start_position = point.position + origin;
  contact.yielding = flexes(contact.a) || states.is_static(point.b.body) ? point.a.body : point.b.body;
  if (states.is_static(contact.yielding)) contact.yielding = point.b.body;
  if (const ContactMemory* known = find(point.id))
    contact.last_force = known->force, contact.give = known->give, contact.slip = known->slip;
  if (const ContactMemory* known = find_in(foreseen, point.id))
    contact.foreseen = true, contact.foreseen_force = known->force, contact.foreseen_slip = known->slip;
  contacts.push_back(contact);
}

/// So that spans of them stay where they are.
void ContactSet::Impl::reserve_regions(const BodyStates& states, std::span<const ContactPoint> points) {
  std::size_t most = 0, most_shapes = 0;
  for (const ContactPoint& point : points)
    for (const ContactSide* side : {&point.a, &point.b}) {
      most += std::max<std::size_t>(3, side->region.size());
      if (!side->region.empty() && !states.is_static(side->body))
        most_shapes += 3 * static_cast<std::size_t>(states.body(side->body).group->model().modes());
    }
  regions.clear(), shapes.clear();
  regions.reserve(most), shapes.reserve(most_shapes);
}

/// The vertices that a contact's force is spread over, its point's own where it stands for no others.
void ContactSet::Impl::add_region(PreparedSide& side, const ContactSide& found) {
  if (!yields(side)) return;
  const std::size_t first = regions.size();
  regions.insert(regions.end(), found.region.begin(), found.region.end());
  const Triangle& corners = side.model->collision().triangles[static_cast<std::size_t>(side.at.triangle)];
  for (std::size_t c = 0; c < 3 && found.region.empty(); ++c)
    if (side.at.weight[c] != 0.0) regions.push_back({.vertex = corners[c], .share = side.at.weight[c]});
  side.region = std::span(regions).subspan(first);
  if (!found.region.empty()) spread_shapes(side);
}

/// The modes' part of a contact, too, is that of its region.
void ContactSet::Impl::spread_shapes(PreparedSide& side) {
  const auto k = static_cast<std::size_t>(side.model->modes());
  const std::size_t first = shapes.size();
  shapes.resize(first + 3 * k, 0.0);
  side.shapes = std::span(shapes).subspan(first);
  for (const VertexShare& s : side.region)
    for (std::size_t axis = 0; axis < 3 && k > 0; ++axis) {
      const float* row = side.model->collision_rows().row(s.vertex, static_cast<int>(axis));
      for (std::size_t i = 0; i < k; ++i) shapes[first + axis * k + i] += s.share * static_cast<double>(row[i]);
    }
}

ContactSet::ContactSet(const ContactOptions& options) : impl_(std::make_unique<Impl>()) {
  options.validate();
  impl_->options = options;
}
ContactSet::~ContactSet() = default;
ContactSet::ContactSet(ContactSet&&) noexcept = default;
ContactSet& ContactSet::operator=(ContactSet&&) noexcept = default;

void ContactSet::update(const BodyStates& states, std::span<const ContactPoint> points, const Vec3& origin,
                        std::span<const double> friction) {
  Impl& s = *impl_;
  s.remember_foreseen();
  s.contacts.clear();
  s.constraints.clear();
  std::size_t bodies = s.give_energy.size();
  for (const ContactPoint& point : points)
    bodies = std::max(bodies, static_cast<std::size_t>(std::max({point.a.body, point.b.body, Index{-1}}) + 1));
  s.give_energy.resize(bodies), s.resting_energy.resize(bodies);
  s.dents.reserve(bodies);
  s.reserve_regions(states, points);
  for (const ContactPoint& point : points)
    if (!states.is_static(point.a.body) || !states.is_static(point.b.body)) s.add(states, point, origin, friction);
  s.foreseen.reserve(s.contacts.capacity());
  s.pairs_used = s.rolling_used = 0;
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= s.contacts.size(); ++i) {
    const PreparedContact& first = s.contacts[begin];
    if (i < s.contacts.size() && s.contacts[i].a.body == first.a.body && s.contacts[i].b.body == first.b.body) continue;
    if (s.pairs_used == s.pairs.size()) s.pairs.push_back(std::make_unique<PairContacts>());
    PairContacts& pair = *s.pairs[s.pairs_used++];
    const std::span<PreparedContact> of_pair = std::span(s.contacts).subspan(begin, i - begin);
    pair.set(of_pair, s.options, s.dents, s.lasted(first.a.body, first.b.body));
    s.constraints.push_back(&pair);
    s.resist_rolling(states, of_pair);
    begin = i;
  }
}

/// With the forces of the last step, where there were any.
void ContactSet::Impl::resist_rolling(const BodyStates& states, std::span<const PreparedContact> pair) {
  if (options.rolling_friction == 0.0 || options.rule.method != ContactMethod::kComplementary ||
      options.rule.friction != FrictionModel::kCone)
    return;
  double largest = 0.0;
  for (const PreparedContact& contact : pair)
    if (is_round(contact.a) || is_round(contact.b))
      largest += options.rolling_friction * shorter_arm(states, contact) *
                 std::max(0.0, contact.axes.col(0).dot(contact.last_force));
  if (largest == 0.0) return;
  const Index a = pair.front().a.body, b = pair.front().b.body;
  const Vec3 *last = moment_of(rolling_memory, a, b), *known = moment_of(rolling_foreseen, a, b);
  if (rolling_used == rolling.size()) rolling.push_back(std::make_unique<RollingResistance>());
  RollingResistance& resistance = *rolling[rolling_used++];
  resistance.set(a, b, largest, last != nullptr ? *last : Vec3(Vec3::Zero()), known);
  constraints.push_back(&resistance);
}

std::span<Constraint* const> ContactSet::constraints() const { return impl_->constraints; }

namespace {

bool rests(std::span<const char> asleep, Index a, Index b) {
  const auto sleeps = [&](Index body) {
    return static_cast<std::size_t>(body) < asleep.size() && asleep[static_cast<std::size_t>(body)] != 0;
  };
  return sleeps(a) || sleeps(b);
}

}  // namespace

void ContactSet::Impl::tell_pressing() {
  std::swap(events, last_events);
  events.clear();
  touched.clear();
  for (const PreparedContact& contact : contacts) {
    touched.insert(touched.end(), {contact.a.body, contact.b.body});
    if (contact.impulse.isZero(0.0)) continue;
    events.push_back({.id = contact.id,
                      .a = contact.a.body,
                      .b = contact.b.body,
                      .phase = find(contact.id) != nullptr ? ContactPhase::kLasting : ContactPhase::kBegun,
                      .position = contact.start_position,
                      .normal = contact.axes.col(0),
                      .impulse = contact.impulse});
  }
  std::sort(events.begin(), events.end(), by_id);
}

/// What pressed before, and does not now, unless bodies have fallen asleep with it.
void ContactSet::Impl::tell_ended(std::span<const char> asleep, bool some_woke) {
  const std::size_t pressed = events.size();
  const auto presses = [&](const ContactEvent& last) {
    return std::binary_search(events.begin(), events.begin() + static_cast<std::ptrdiff_t>(pressed), last, by_id);
  };
  const auto end = [&](const ContactEvent& last) {
    events.push_back(last);
    events.back().phase = ContactPhase::kEnded;
    events.back().impulse = Vec3::Zero();
  };
  if (some_woke)
    std::erase_if(resting, [&](const ContactEvent& last) {
      if (presses(last)) return true;
      if (rests(asleep, last.a, last.b)) return false;
      end(last);
      return true;
    });
  for (const ContactEvent& last : last_events) {
    if (last.phase == ContactPhase::kEnded || presses(last)) continue;
    if (rests(asleep, last.a, last.b))
      resting.push_back(last);
    else
      end(last);
  }
}

void ContactSet::finish(std::span<const char> asleep, bool some_woke) {
  Impl& s = *impl_;
  for (PreparedContact& contact : s.contacts) contact.foreseen = false;
  s.tell_pressing();
  s.tell_ended(asleep, some_woke);
  s.remember(asleep, some_woke);
  s.dents.finish(asleep, s.touched);
  std::erase_if(s.strikes, [&](const StrikeMemory& m) { return !rests(asleep, m.a, m.b); });
  for (std::size_t i = 0; i < s.pairs_used; ++i)
    if (const double lasted = s.pairs[i]->lasted(); lasted > 0.0) {
      const auto [a, b] = s.pairs[i]->bodies();
      s.strikes.push_back({a, b, lasted});
    }
  std::ranges::sort(s.strikes, by_pair);
  std::sort(s.events.begin(), s.events.end(), by_id);
}

/// The forces of this step, and those under which bodies fell asleep.
void ContactSet::Impl::remember(std::span<const char> asleep, bool some_woke) {
  const auto clear_energy = [](std::vector<double>& energy, std::span<const ContactMemory> of) {
    for (const ContactMemory& m : of)
      if (m.yielding >= 0) energy[static_cast<std::size_t>(m.yielding)] = 0.0;
  };
  clear_energy(give_energy, memory);
  std::swap(memory, last_memory);
  memory.clear();
  for (const PreparedContact& contact : contacts)
    if (!contact.impulse.isZero(0.0))
      memory.push_back({.id = contact.id,
                        .a = contact.a.body,
                        .b = contact.b.body,
                        .force = contact.last_force,
                        .give = contact.give,
                        .slip = contact.slip,
                        .yielding = contact.yielding});
  std::sort(memory.begin(), memory.end(), by_id);
  const std::size_t rested = resting_memory.size();
  for (const ContactMemory& last : last_memory)
    if (rests(asleep, last.a, last.b)) resting_memory.push_back(last);
  if (some_woke || resting_memory.size() > rested) {
    clear_energy(resting_energy, resting_memory);
    std::erase_if(resting_memory, [&](const ContactMemory& m) { return !rests(asleep, m.a, m.b); });
    std::sort(resting_memory.begin(), resting_memory.end(), by_id);
    add_energy(resting_energy, resting_memory);
  }
  add_energy(give_energy, memory);
  remember_rolling(asleep);
}

/// ½ give F² of each, to the body that yields.
void ContactSet::Impl::add_energy(std::vector<double>& energy, std::span<const ContactMemory> of) {
  for (const ContactMemory& m : of)
    if (m.give > 0.0) energy[static_cast<std::size_t>(m.yielding)] += 0.5 * m.give * m.force.squaredNorm();
}

void ContactSet::Impl::remember_rolling(std::span<const char> asleep) {
  std::erase_if(rolling_memory, [&](const RollingMemory& m) { return !rests(asleep, m.a, m.b); });
  for (std::size_t i = 0; i < rolling_used; ++i) {
    const auto [a, b] = rolling[i]->bodies();
    rolling_memory.push_back({a, b, rolling[i]->moment()});
  }
  std::ranges::sort(rolling_memory, by_pair);
}

const ContactOptions& ContactSet::options() const { return impl_->options; }

std::span<const ContactEvent> ContactSet::events() const { return impl_->events; }
std::span<const ContactMemory> ContactSet::memory() const { return impl_->memory; }
std::span<const ContactMemory> ContactSet::resting() const { return impl_->resting_memory; }
std::span<const StrikeMemory> ContactSet::strikes() const { return impl_->strikes; }
std::span<const RollingMemory> ContactSet::rolling() const { return impl_->rolling_memory; }

void ContactSet::clear() {
  impl_->contacts.clear();
  impl_->constraints.clear();
  impl_->memory.clear();
  impl_->resting_memory.clear();
  impl_->strikes.clear();
  impl_->rolling_memory.clear();
  impl_->events.clear();
  impl_->resting.clear();
  impl_->dents.clear();
  impl_->give_energy.clear();
  impl_->resting_energy.clear();
}

void ContactSet::save_state(StateWriter& state) const {
  const Impl& s = *impl_;
  state(s.options, s.memory, s.resting_memory, s.strikes, s.rolling_memory, s.events, s.resting, s.dents);
}

void ContactSet::Impl::find_energies() {
  for (std::vector<double>* energy : {&give_energy, &resting_energy}) energy->assign(dents.bodies(), 0.0);
  add_energy(give_energy, memory);
  add_energy(resting_energy, resting_memory);
}

void ContactSet::restore_state(StateReader& state) {
  Impl& s = *impl_;
  s.contacts.clear();
  s.constraints.clear();
  state(s.options, s.memory, s.resting_memory, s.strikes, s.rolling_memory, s.events, s.resting, s.dents);
  s.dents.list_loaded();
  s.find_energies();
}

void ContactSet::forget(Index body) { impl_->dents.forget(body); }

std::span<const DentLoad> ContactSet::dent_loads(Index body) const { return impl_->dents.loads(body); }

double ContactSet::dent_energy(const BodyStates& states, Index body) const {
  const auto i = static_cast<std::size_t>(body);
  const bool known = i < impl_->give_energy.size();
  return impl_->dents.energy(states, body) + (known ? impl_->give_energy[i] + impl_->resting_energy[i] : 0.0);
}

}  // namespace limber
