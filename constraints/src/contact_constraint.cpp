#include "limber/constraints/contact_constraint.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

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

/// A body as all contacts with it see it at the step's start.
struct StartOfBody {
  RigidTransform pose{};
  bool is_static = true;
  Vec3 velocity = Vec3::Zero(), angular_velocity = Vec3::Zero();
  Vec3 acceleration = Vec3::Zero();  // if nothing touches it
  BodySurface surface{};             // its velocity in the world's axes
};

StartOfBody start_of(const BodyStates& states, Index body, const BodySurface& surface, const Vec3& gravity) {
  StartOfBody start{.pose = states.pose(body, StepTime::kStart), .surface = surface};
  start.surface.velocity = start.pose.q * surface.velocity;
  start.is_static = states.is_static(body);
  if (start.is_static) return start;
  start.velocity = states.velocity(body, StepTime::kStart);
  start.angular_velocity = states.angular_velocity(body, StepTime::kStart);
  const auto& [group, slot, pose] = states.body(body);
  const FrameConstants& c = group->frame_constants();
  if (c.motion == FrameMotion::kFree)
    start.acceleration = group->own_gravity(slot, gravity) + group->held_force(slot) / c.mass;
  return start;
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
  struct {
    std::vector<const ContactPoint*> points;  // of those that act
    std::vector<const ContactMemory*> known;  // by point
    std::vector<std::size_t> first_of_pair;   // by pair, and where the last one ends
    std::vector<std::size_t> bending;         // those with a side that may bend
  } listed;                                   // what acts in the step
  std::vector<StartOfBody> starts;            // of bodies that points name, the world first
  std::vector<std::uint64_t> started;         // in which update
  std::uint64_t updates = 0;
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
  void list(const BodyStates& states, std::span<const ContactPoint> found, const ContactSurroundings& around);
  void prepare(const BodyStates& states, std::size_t number, const Vec3& origin);
  void measure(const BodyStates& states, std::size_t number);
  double approach(const BodyStates& states, const PreparedContact& contact, const Vec3 (&arms)[2]) const;
  const StartOfBody& start(Index body) const { return starts[static_cast<std::size_t>(body + 1)]; }
  void add_corners(const BodyStates& states, PreparedSide& side);
};

/// What acts, pair by pair, and the bodies that it is between.
void ContactSet::Impl::list(const BodyStates& states, std::span<const ContactPoint> found,
                            const ContactSurroundings& around) {
  auto& [points, known, first_of_pair, bending] = listed;
  points.clear(), first_of_pair.clear(), bending.clear();
  ++updates;
  std::size_t bodies = 0;
  const auto tell = [&](Index body) {
    const auto i = static_cast<std::size_t>(body + 1);
    bodies = std::max(bodies, i);
    if (i >= starts.size()) starts.resize(i + 1), started.resize(i + 1, 0);
    if (std::exchange(started[i], updates) == updates) return;
    const bool told = body >= 0 && static_cast<std::size_t>(body) < around.surfaces.size();
    starts[i] = start_of(states, body, told ? around.surfaces[i - 1] : BodySurface{.friction = options.friction},
                         around.gravity);
  };
  for (const ContactPoint& point : found) {
    tell(point.a.body), tell(point.b.body);
    if (start(point.a.body).is_static && start(point.b.body).is_static) continue;
    const std::size_t i = points.size();
    if (i == 0 || points.back()->a.body != point.a.body || points.back()->b.body != point.b.body)
      first_of_pair.push_back(i);
    if (point.a.triangle >= 0 || point.b.triangle >= 0) bending.push_back(i);
    points.push_back(&point);
  }
  first_of_pair.push_back(points.size());
  history.reserve(bodies);
  indentations.reserve(bodies);
}

/// But for what a skin's memory is asked for, which one thread may do at a time.
void ContactSet::Impl::prepare(const BodyStates& states, std::size_t number, const Vec3& origin) {
  const ContactPoint& point = *listed.points[number];
  const StartOfBody &a = start(point.a.body), &b = start(point.b.body);
  PreparedContact& contact = contacts[number];
  contact = {};
  contact.id = point.id;
  make_side(states, point.a, point.normal, contact.a);
  make_side(states, point.b, -point.normal, contact.b);
  contact.axes = frame_along(point.normal);
  const double smaller = std::min(a.surface.friction, b.surface.friction);
  contact.friction = smaller > 0.0 ? std::sqrt(a.surface.friction * b.surface.friction) : 0.0;
  // Bodies that bend rebound by their modes.
  contact.restitution =
      flexes(contact.a) || flexes(contact.b) ? 0.0 : std::max(a.surface.restitution, b.surface.restitution);
  contact.running = a.surface.velocity - b.surface.velocity;
  contact.start_position = point.position + origin;
  contact.yielding = flexes(contact.a) || b.is_static ? point.a.body : point.b.body;
  if (start(contact.yielding).is_static) contact.yielding = point.b.body;
  if (contact.a.skin == nullptr && contact.b.skin == nullptr) measure(states, number);
}

void ContactSet::Impl::measure(const BodyStates& states, std::size_t number) {
  PreparedContact& contact = contacts[number];
  Vec3 arms[2], at[2];
  for (std::size_t s = 0; s < 2; ++s) {
    PreparedSide& side = s == 0 ? contact.a : contact.b;
    if (side.model != nullptr) side.start_point = side.place(states.amplitudes(side.body, StepTime::kStart));
    const RigidTransform& pose = start(side.body).pose;
    arms[s] = pose.q * side.start_point;
    at[s] = arms[s] + pose.p + side.rim;
  }
  contact.offset = at[0] - at[1];
  if (const ContactMemory* last = listed.known[number])
    contact.last_force = last->force, contact.compliance = last->compliance, contact.slip = last->slip;
  else
    contact.approach = approach(states, contact, arms);
}

/// How fast a contact's points will come together as they meet; 0: they will not. @param arms from the bodies' origins
double ContactSet::Impl::approach(const BodyStates& states, const PreparedContact& contact,
                                  const Vec3 (&arms)[2]) const {
  const Vec3 n = contact.axes.col(0);
  double speed = 0.0, gain = 0.0;
  for (std::size_t s = 0; s < 2; ++s) {
    const PreparedSide& side = contact.side(s);
    const StartOfBody& body = start(side.body);
    if (body.is_static) continue;
    Vec3 v = body.velocity + body.angular_velocity.cross(arms[s]);
    if (side.model != nullptr)
      v += body.pose.q *
           side.deforming(states.amplitudes(side.body, StepTime::kStart), states.rates(side.body, StepTime::kStart));
    speed -= PreparedContact::sign(s) * n.dot(v);
    gain -= PreparedContact::sign(s) * n.dot(body.acceleration);
  }
  if (speed < 0.0 && gain <= 0.0) return 0.0;
  return std::sqrt(std::max(0.0, speed * speed + 2.0 * gain * std::max(0.0, n.dot(contact.offset))));
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
  s.list(states, points, surroundings);
  s.history.find(s.listed.points, s.listed.known);
  s.contacts.resize(s.listed.points.size());
  const auto part = [&](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) s.prepare(states, i, surroundings.origin);
  };
  constexpr std::size_t kAtOnce = 64;
  jobs.parallel_for(s.contacts.size(), kAtOnce, std::ref(part));
  s.corners.clear(), s.turns.clear();
  s.corners.reserve(6 * s.listed.bending.size());  // three of each side
  s.turns.reserve(2 * s.listed.bending.size());
  for (const std::size_t i : s.listed.bending) {
    PreparedContact& contact = s.contacts[i];
    s.add_corners(states, contact.a);
    s.add_corners(states, contact.b);
    if (contact.a.skin != nullptr || contact.b.skin != nullptr) s.measure(states, i);
  }
  s.constraints.clear();
  s.pairs.reuse(), s.rolling.reuse();
  for (std::size_t p = 0; p + 1 < s.listed.first_of_pair.size(); ++p) {
    const std::size_t begin = s.listed.first_of_pair[p];
    PairContacts& pair = s.pairs.next();
    const std::span<PreparedContact> of_pair =
        std::span(s.contacts).subspan(begin, s.listed.first_of_pair[p + 1] - begin);
    pair.set(of_pair, s.options, s.indentations);
    s.constraints.push_back(&pair);
    s.resist_rolling(states, of_pair);
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
  const RollingMemory* last = find_in(rolling_memory, RollingMemory{.a = a, .b = b}, kByPair);
  RollingResistance& resistance = rolling.next();
  resistance.set(a, b, largest, last != nullptr ? last->moment : Vec3(Vec3::Zero()));
  constraints.push_back(&resistance);
}

std::span<PreparedContact> ContactSet::prepared() { return impl_->contacts; }

void ContactSet::press_indentations(const BodyStates& states) {
  if (!impl_->options.residual_compliance) return;
  for (const std::size_t i : impl_->listed.bending)
    for (std::size_t s = 0; s < 2; ++s)
      if (const PreparedSide& side = impl_->contacts[i].side(s); yields(side)) impl_->indentations.renew(side.body);
  for (const std::size_t i : impl_->listed.bending)
    for (std::size_t s = 0; s < 2; ++s) {
      const PreparedContact& contact = impl_->contacts[i];
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
  for (const std::size_t i : s.listed.bending)
    for (const PreparedSide* side : {&s.contacts[i].a, &s.contacts[i].b})
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
  impl_->contacts.clear(), impl_->listed.bending.clear();
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
  s.contacts.clear(), s.listed.bending.clear();
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
