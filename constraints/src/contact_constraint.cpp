#include "limber/constraints/contact_constraint.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "contact_history.h"
#include "limber/core/error.h"
#include "pair_contacts.h"
#include "rolling_resistance.h"

namespace limber {
namespace {

/// A right-handed frame whose first axis is n; the same for the same n. @param n unit
Mat3 frame_along(const Vec3& n) {
  Index least = 0;
  n.cwiseAbs().minCoeff(&least);
  Mat3 axes;
  axes.col(0) = n;
  axes.col(1) = n.cross(Vec3::Unit(least)).normalized();
  axes.col(2) = n.cross(axes.col(1));
  return axes;
}

/// Of a side's body, if nothing touches it, along n.
double acceleration(const BodyStates& states, const PreparedSide& side, const Vec3& n, const Vec3& gravity) {
  if (states.is_static(side.body)) return 0.0;
  const auto& [group, slot, pose] = states.body(side.body);
  const FrameConstants& c = group->frame_constants();
  if (c.motion != FrameMotion::kFree) return 0.0;
  return n.dot(group->own_gravity(slot, gravity) + group->held_force(slot) / c.mass);
}

/// How fast a contact's points will come together as they meet; 0: they will not.
double approach(const BodyStates& states, const PreparedContact& contact, const Vec3& gravity) {
  const Vec3 n = contact.axes.col(0);
  double speed = 0.0, gain = 0.0;
  for (std::size_t s = 0; s < 2; ++s) {
    const PreparedSide& side = contact.side(s);
    if (states.is_static(side.body)) continue;
    speed -= PreparedContact::sign(s) * n.dot(side.velocity(states));
    gain -= PreparedContact::sign(s) * acceleration(states, side, n, gravity);
  }
  if (speed < 0.0 && gain <= 0.0) return 0.0;
  return std::sqrt(std::max(0.0, speed * speed + 2.0 * gain * std::max(0.0, n.dot(contact.offset))));
}

/// Constraints that are used anew in every step.
template <class T>
class Pool {
 public:
  void reuse() { used_ = 0; }
  T& next() {
    if (used_ == all_.size()) all_.push_back(std::make_unique<T>());
    return *all_[used_++];
  }
  std::span<const std::unique_ptr<T>> used() const { return std::span(all_).first(used_); }

 private:
  std::vector<std::unique_ptr<T>> all_;
  std::size_t used_ = 0;
};

}  // namespace

void ContactOptions::validate() const {
  const auto number = [](double value, const char* name) {
    if (!(value >= 0.0) || std::isinf(value))
      throw InvalidArgument(std::string("ContactOptions: ") + name + " is " + std::to_string(value) +
                            ", expected a finite number of at least 0");
  };
  small_steps.validate();
  if (!(solver == ContactSolver::kGame && friction >= 0.0)) number(friction, "friction");
  number(rolling_friction, "rolling_friction");
  number(recovery_speed, "recovery_speed");
  number(compliance, "compliance");
}

struct ContactSet::Impl {
  ContactOptions options;
  std::vector<const ContactPoint*> points;  // of those that act
  std::vector<PreparedContact> contacts;
  std::vector<VertexShare> corners;  // of their sides, as what follows
  std::vector<Mat3> turns;
  ContactHistory history;
  std::vector<RollingMemory> rolling_memory;  // by (a, b), of the last step
  Pool<PairContacts> pairs;
  Pool<RollingResistance> rolling;
  std::vector<Constraint*> constraints;
  ContactIndentations indentations;
  std::vector<Index> touched;  // scratch of finish()

  void resist_rolling(const BodyStates& states, std::span<const PreparedContact> pair);
  void prepare(const BodyStates& states, const ContactPoint& point, const ContactSurroundings& around,
               PreparedContact& contact) const;
  void measure(const BodyStates& states, const Vec3& gravity, PreparedContact& contact) const;
  void add_corners(const BodyStates& states, PreparedSide& side);
};

/// But for what a skin's memory is asked for, which one thread may do at a time.
void ContactSet::Impl::prepare(const BodyStates& states, const ContactPoint& point, const ContactSurroundings& around,
                               PreparedContact& contact) const {
  const auto surface = [&](Index body) {
    const auto i = static_cast<std::size_t>(body);
    return i < around.surfaces.size() ? around.surfaces[i] : BodySurface{.friction = options.friction};
  };
  const BodySurface of_a = surface(point.a.body), of_b = surface(point.b.body);
  contact = {};
  contact.id = point.id;
  make_side(states, point.a, point.normal, contact.a);
  make_side(states, point.b, -point.normal, contact.b);
  contact.axes = frame_along(point.normal);
  const double smaller = std::min(of_a.friction, of_b.friction);
  contact.friction = smaller > 0.0 ? std::sqrt(of_a.friction * of_b.friction) : 0.0;
  // Bodies that bend rebound by their modes.
  contact.restitution = flexes(contact.a) || flexes(contact.b) ? 0.0 : std::max(of_a.restitution, of_b.restitution);
  contact.running = states.pose(point.a.body, StepTime::kStart).q * of_a.velocity -
                    states.pose(point.b.body, StepTime::kStart).q * of_b.velocity;
  contact.start_position = point.position + around.origin;
  contact.yielding = flexes(contact.a) || states.is_static(point.b.body) ? point.a.body : point.b.body;
  if (states.is_static(contact.yielding)) contact.yielding = point.b.body;
  if (contact.a.skin == nullptr && contact.b.skin == nullptr) measure(states, around.gravity, contact);
}

void ContactSet::Impl::measure(const BodyStates& states, const Vec3& gravity, PreparedContact& contact) const {
  for (PreparedSide* side : {&contact.a, &contact.b})
    side->start_point = side->place(states.amplitudes(side->body, StepTime::kStart));
  contact.offset = contact.a.start_position(states) - contact.b.start_position(states);
  if (const ContactMemory* known = history.find(contact.id))
    contact.last_force = known->force, contact.compliance = known->compliance, contact.slip = known->slip;
  else
    contact.approach = approach(states, contact, gravity);
}

/// @pre there is room: spans of them stay where they are
void ContactSet::Impl::add_corners(const BodyStates& states, PreparedSide& side) {
  if (!yields(side)) return;
  const std::size_t first = corners.size();
  const Triangle& vertices = side.model->collision().triangles[static_cast<std::size_t>(side.at.triangle)];
  for (std::size_t c = 0; c < 3; ++c)
    if (side.at.weight[c] != 0.0) corners.push_back({.vertex = vertices[c], .share = side.at.weight[c]});
  side.corners = std::span(corners).subspan(first);
  if (side.skin == nullptr) return;
  side.turn = &turns.emplace_back(side.shape(states.amplitudes(side.body, StepTime::kStart)).turn(side.at));
}

ContactSet::ContactSet(const ContactOptions& options) : impl_(std::make_unique<Impl>()) {
  options.validate();
  impl_->options = options;
}
ContactSet::~ContactSet() = default;
ContactSet::ContactSet(ContactSet&&) noexcept = default;
ContactSet& ContactSet::operator=(ContactSet&&) noexcept = default;

void ContactSet::update(const BodyStates& states, std::span<const ContactPoint> points,
                        const ContactSurroundings& surroundings, Jobs& jobs) {
  Impl& s = *impl_;
  s.points.clear();
  s.constraints.clear();
  std::size_t bodies = 0;
  for (const ContactPoint& point : points)
    bodies = std::max(bodies, static_cast<std::size_t>(std::max({point.a.body, point.b.body, Index{-1}}) + 1));
  s.history.reserve(bodies);
  s.indentations.reserve(bodies);
  s.corners.clear(), s.turns.clear();
  s.corners.reserve(6 * points.size());  // three of each side
  s.turns.reserve(2 * points.size());
  for (const ContactPoint& point : points)
    if (!states.is_static(point.a.body) || !states.is_static(point.b.body)) s.points.push_back(&point);
  s.contacts.resize(s.points.size());
  const auto part = [&](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) s.prepare(states, *s.points[i], surroundings, s.contacts[i]);
  };
  constexpr std::size_t kAtOnce = 64;
  jobs.parallel_for(s.contacts.size(), kAtOnce, std::ref(part));
  for (PreparedContact& contact : s.contacts) {
    s.add_corners(states, contact.a);
    s.add_corners(states, contact.b);
    if (contact.a.skin != nullptr || contact.b.skin != nullptr) s.measure(states, surroundings.gravity, contact);
  }
  s.pairs.reuse(), s.rolling.reuse();
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= s.contacts.size(); ++i) {
    const PreparedContact& first = s.contacts[begin];
    if (i < s.contacts.size() && s.contacts[i].a.body == first.a.body && s.contacts[i].b.body == first.b.body) continue;
    PairContacts& pair = s.pairs.next();
    const std::span<PreparedContact> of_pair = std::span(s.contacts).subspan(begin, i - begin);
    pair.set(of_pair, s.options, s.indentations);
    s.constraints.push_back(&pair);
    s.resist_rolling(states, of_pair);
    begin = i;
  }
}

/// With the forces of the last step, where there were any.
void ContactSet::Impl::resist_rolling(const BodyStates& states, std::span<const PreparedContact> pair) {
  if (options.rolling_friction == 0.0) return;
  double largest = 0.0;
  for (const PreparedContact& contact : pair)
    if (is_round(contact.a) || is_round(contact.b))
      largest += options.rolling_friction * shorter_arm(states, contact) *
                 std::max(0.0, contact.axes.col(0).dot(contact.last_force));
  if (largest == 0.0) return;
  const Index a = pair.front().a.body, b = pair.front().b.body;
  const RollingMemory* last = find_in(rolling_memory, {.a = a, .b = b}, kByPair);
  RollingResistance& resistance = rolling.next();
  resistance.set(a, b, largest, last != nullptr ? last->moment : Vec3(Vec3::Zero()));
  constraints.push_back(&resistance);
}

std::span<PreparedContact> ContactSet::prepared() { return impl_->contacts; }

void ContactSet::press_indentations(const BodyStates& states) {
  if (!impl_->options.residual_compliance) return;
  for (const PreparedContact& contact : impl_->contacts)
    for (std::size_t s = 0; s < 2; ++s)
      if (yields(contact.side(s))) impl_->indentations.renew(contact.side(s).body);
  for (const PreparedContact& contact : impl_->contacts)
    for (std::size_t s = 0; s < 2; ++s) {
      const PreparedSide& side = contact.side(s);
      if (!yields(side)) continue;
      const Quaternion q_BW = states.pose(side.body, StepTime::kStart).q.conjugate();
      impl_->indentations.press(side.body, side.corners,
                                side.turned_back(q_BW * (PreparedContact::sign(s) * contact.mean_force)));
    }
}

std::span<Constraint* const> ContactSet::constraints() const { return impl_->constraints; }

void ContactSet::finish(std::span<const char> asleep, bool some_woke) {
  Impl& s = *impl_;
  s.touched.clear();
  for (const PreparedContact& contact : s.contacts)
    for (const PreparedSide* side : {&contact.a, &contact.b})
      if (yields(*side)) s.touched.push_back(side->body);
  s.history.finish(s.contacts, asleep, some_woke);
  s.indentations.finish(asleep, s.touched);
  const auto wakes = [&](const auto& m) { return !rests(asleep, m.a, m.b); };
  std::erase_if(s.rolling_memory, wakes);
  for (const auto& rolling : s.rolling.used())
    s.rolling_memory.push_back({rolling->bodies()[0], rolling->bodies()[1], rolling->moment()});
  std::ranges::sort(s.rolling_memory, kByPair);
}

const ContactOptions& ContactSet::options() const { return impl_->options; }

std::span<const ContactEvent> ContactSet::events() const { return impl_->history.events(); }
std::span<const ContactMemory> ContactSet::memory() const { return impl_->history.memory(); }
std::span<const ContactMemory> ContactSet::resting() const { return impl_->history.resting(); }
std::span<const RollingMemory> ContactSet::rolling() const { return impl_->rolling_memory; }

void ContactSet::clear() {
  impl_->contacts.clear();
  impl_->constraints.clear();
  impl_->history.clear();
  impl_->rolling_memory.clear();
  impl_->indentations.clear();
}

void ContactSet::save_state(StateWriter& state) const {
  const Impl& s = *impl_;
  state(s.options, s.history, s.rolling_memory, s.indentations);
}

void ContactSet::restore_state(StateReader& state) {
  Impl& s = *impl_;
  s.contacts.clear();
  s.constraints.clear();
  state(s.options, s.history, s.rolling_memory, s.indentations);
  s.indentations.list_loaded();
  s.history.find_energies(s.indentations.bodies());
}

void ContactSet::forget(Index body) { impl_->indentations.forget(body); }

std::span<const IndentationLoad> ContactSet::indentation_loads(Index body) const {
  return impl_->indentations.loads(body);
}

double ContactSet::indentation_energy(const BodyStates& states, Index body) const {
  // Contacts of small steps have springs of their own; indentations are what their mean force shows.
  const bool by_springs = impl_->options.solver == ContactSolver::kGame;
  return (by_springs ? 0.0 : impl_->indentations.energy(states, body)) + impl_->history.energy(body);
}

}  // namespace limber
