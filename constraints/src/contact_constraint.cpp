#include "limber/constraints/contact_constraint.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "contact_dents.h"
#include "contact_geometry.h"
#include "limber/core/error.h"
#include "limber/dynamics/surface_point.h"
#include "rolling_resistance.h"

namespace limber {
namespace {

// Gaps are met to this part of the distances at hand.
constexpr double kRelativeTolerance = 1e-9;
// Overlap left over is reduced by this part in a step, or less (ContactOptions::recovery_speed).
constexpr double kRecovery = 0.2;
// Of what a force moves the reduced mass of two bodies within a step: so far each contact of bodies that flex yields by
// itself. Loads that many contacts could share in many ways then have one answer that changes little where gaps change
// by a picometre; what rests sinks by less than kGive g Δt², 3e-7 m at 60 steps a second.
constexpr double kGive = 1e-4;
// Steps that an impact may last in any case.
constexpr double kShortestStrike = 2.0;

const auto by_id = [](const auto& x, const auto& y) { return x.id < y.id; };
const auto by_pair = [](const auto& x, const auto& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; };

/// One side of a contact, prepared.
struct Side {
  Index body = -1;
  const ModalModel* model = nullptr;  // null: a rigid shape, or one that stands still
  SurfacePoint at{};
  Vec3 rigid_point = Vec3::Zero();  // without a model: body frame; where the surface is that of a ball, its centre
  Vec3 rim = Vec3::Zero();          // from there to where it touches, world; as the normal it stays for the step

  /// Where the body touches.
  Vec3 position(const BodyStates& states, StepTime when) const {
    const Vec3 p = model != nullptr ? deformed_point(*model, at, states.amplitudes(body, when)) : rigid_point;
    return states.pose(body, when) * p + rim;
  }
  /// How far what is there has come beyond that by rolling, by the end of the step.
  Vec3 rolled(const BodyStates& states) const { return turn_of_step(states, body).cross(rim); }
  Vec3 velocity(const BodyStates& states, StepTime when) const {
    const RigidTransform& X = states.pose(body, when);
    Vec3 v = states.velocity(body, when) + states.angular_velocity(body, when).cross(position(states, when) - X.p);
    if (model != nullptr) v += X.q * displacement(*model, at, states.rates(body, when));
    return v;
  }
};

struct Contact {
  std::uint64_t id = 0;
  Side a, b;
  Mat3 axes = Mat3::Identity();  // columns: normal, two tangents; world
  double friction = 0.0;
  Vec3 offset = Vec3::Zero();  // p_a − p_b at the step's start, world
  Vec3 start_position = Vec3::Zero();
  Vec3 last_force = Vec3::Zero();  // world, on a, N
  Vec3 held_force = Vec3::Zero();  // what of it goes on
  double give = 0.0;               // what the contact yielded to it by itself, m/N
  Vec3 dent = Vec3::Zero();        // what the bodies yield at the step's start along the axes, m
  Vec3 impulse = Vec3::Zero();     // of this step, world, on a
};

/// @param inwards the normal, into the body
Side make_side(const BodyStates& states, const ContactSide& side, const Vec3& inwards) {
  Side made{.body = side.body, .rigid_point = side.point_B};
  if (side.radius > 0.0 && !states.is_static(side.body)) {
    made.rim = -side.radius * inwards;
    made.rigid_point -= states.pose(side.body, StepTime::kStart).q.conjugate() * made.rim;
  }
  if (side.triangle < 0 || states.is_static(side.body)) return made;
  made.model = &states.body(side.body).group->model();
  made.at = {.surface = SurfacePoint::Surface::kCollision, .triangle = side.triangle, .weight = side.weight};
  return made;
}

bool flexes(const Side& side) {
  return side.model != nullptr && (side.model->modes() > 0 || side.model->data().residual_compliance.has_value());
}

bool is_round(const Side& side) { return !side.rim.isZero(0.0); }

bool yields(const Side& side) { return side.model != nullptr && side.model->data().residual_compliance.has_value(); }

/// Row of the velocity of a side's point along n, its arm ending at `end`, which both sides share.
RowSide point_row(const BodyStates& states, StepTime when, const Side& side, const Vec3& end, const Vec3& n,
                  std::vector<double>& modal) {
  modal.clear();
  if (states.is_static(side.body)) return {};
  const RigidTransform& X = states.pose(side.body, when);
  if (side.model != nullptr) {
    modal.assign(static_cast<std::size_t>(side.model->modes()), 0.0);
    add_modal_force(*side.model, side.at, X.q.conjugate() * n, modal);
  }
  return {side.body, n, (end - X.p).cross(n), modal};
}

/// The place and velocity of a side's point at some time, from its body's free motion.
struct Passage {
  MotionState state;

  void find(const BodyStates& states, const FreeMotions& motions, const Side& side, double time, Vec3& place,
            Vec3& velocity) {
    const ExactMotion* motion = motions.of(side.body);
    if (motion == nullptr) {
      place = side.position(states, StepTime::kStart);
      velocity = Vec3::Zero();
      return;
    }
    motion->evaluate(time, state);
    const Vec3 p = side.model != nullptr ? deformed_point(*side.model, side.at, state.amplitudes) : side.rigid_point;
    place = state.pose * p + side.rim;
    velocity = state.velocity + state.angular_velocity.cross(place - state.pose.p);
    if (side.model != nullptr) velocity += state.pose.q * displacement(*side.model, side.at, state.rates);
  }
};

/// From where they touch to the nearer of the origins of those that move.
double shorter_arm(const BodyStates& states, const Contact& contact) {
  double arm = std::numeric_limits<double>::infinity();
  for (const Side* side : {&contact.a, &contact.b})
    if (!states.is_static(side->body))
      arm = std::min(arm,
                     (side->position(states, StepTime::kStart) - states.pose(side->body, StepTime::kStart).p).norm());
  return arm;
}

/// The longest that two bodies take to spring back from each other, s: a period of the lowest mode of either.
double longest_rebound(const Side& a, const Side& b) {
  double longest = 0.0;
  for (const Side* side : {&a, &b}) {
    if (side->model == nullptr) continue;
    for (const double lambda : side->model->data().eigenvalues)
      if (lambda > 0.0) {
        longest = std::max(longest, 2.0 * std::numbers::pi / std::sqrt(lambda));
        break;
      }
  }
  return longest;
}

/// All contacts of one pair of bodies.
class PairContacts final : public Constraint {
 public:
  /// @param lasted since when the bodies have struck each other, s
  void set(std::span<Contact> contacts, const ContactOptions& options, ContactDents& dents, double lasted) {
    contacts_ = contacts;
    options_ = &options;
    dents_ = &dents;
    lasted_ = lasted;
    const Contact& first = contacts.front();
    yields_ = {options.residual_compliance && yields(first.a), options.residual_compliance && yields(first.b)};
  }

  std::array<Index, 2> bodies() const override { return {contacts_.front().a.body, contacts_.front().b.body}; }

  void add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) override {
    step_ = step;
    if (when == StepTime::kStart) begin(states);
    const Index first = rows.size();
    for (const Contact& contact : contacts_) add_contact(states, when, contact, rows);
    if (when == StepTime::kStart) add_flexibility(states, first, rows);
  }

  void gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const override {
    std::size_t row = 0;
    for (const Contact& contact : contacts_) {
      const Vec3 offset = contact.a.position(states, when) - contact.b.position(states, when);
      gaps[row++] = contact.axes.col(0).dot(offset) + (when == StepTime::kStart ? contact.dent[0] : 0.0);
      if (contact.friction == 0.0) continue;
      const Vec3 slip = offset - contact.offset + rolled(states, when, contact);
      for (int t = 1; t < 3; ++t)
        gaps[row++] = contact.axes.col(t).dot(slip) + (when == StepTime::kStart ? contact.dent[t] : 0.0);
    }
  }

  bool is_contact() const override { return true; }

  double next_cut(const BodyStates& states, const FreeMotions& motions, double within) override {
    const Contact& first = contacts_.front();
    const bool struck = options_->impact == ImpactModel::kHeldFromTouch && (flexes(first.a) || flexes(first.b));
    if (!struck && options_->rule.method != ContactMethod::kVelocityProgram) return within;
    for (const Contact& contact : contacts_) within = touch(states, motions, contact, within);
    return within;
  }

  void accept(const BodyStates&, std::span<const double> impulses) override {
    std::size_t row = 0;
    bool pressed = false;
    for (Contact& contact : contacts_) {
      Vec3 impulse = impulses[row++] * contact.axes.col(0);
      for (int t = 1; t < 3 && contact.friction != 0.0; ++t) impulse += impulses[row++] * contact.axes.col(t);
      const Vec3 before = contact.last_force;
      contact.last_force = impulse / step_;
      contact.held_force = lasting_part(before.norm(), contact.last_force.norm()) * contact.last_force;
      contact.give = give_;
      contact.impulse += impulse;
      pressed = pressed || !impulse.isZero(0.0);
      for (std::size_t side = 0; side < 2; ++side)
        if (yields_[side])
          dents_->press(body(contact, side),
                        {at(contact, side), turn_[side].conjugate() * (sign(side) * contact.last_force)});
    }
    lasted_ = strikes_ && pressed ? lasted_ + step_ : 0.0;
  }

  /// Since when the bodies have struck each other, after the step, s; 0: they have not.
  double lasted() const { return lasted_; }

 private:
  /// A step, or part of one, starts from here.
  void begin(const BodyStates& states) {
    for (Contact& contact : contacts_)
      contact.offset = contact.a.position(states, StepTime::kStart) - contact.b.position(states, StepTime::kStart);
    strikes_ = strikes(states);
    for (std::size_t side = 0; side < 2; ++side)
      if (yields_[side]) turn_[side] = states.pose(body(contacts_.front(), side), StepTime::kStart).q;
    deepest_dent_ = 0.0;
    const Contact& first = contacts_.front();
    give_ = (flexes(first.a) || flexes(first.b)) && options_->rule.method != ContactMethod::kPenalty
                ? kGive * step_ * step_ / reduced_mass(states, first)
                : 0.0;
    for (Contact& contact : contacts_) {
      Vec3 dent = Vec3::Zero();
      for (std::size_t side = 0; side < 2; ++side)
        if (yields_[side]) dent += sign(side) * dents_->displacement(states, body(contact, side), at(contact, side));
      contact.dent = contact.axes.transpose() * (dent + contact.give * contact.last_force);
      deepest_dent_ = std::max(deepest_dent_, contact.dent[0]);
    }
    caught_ = (flexes(first.a) || flexes(first.b)) && is_caught();
  }

  /// Whether a part of one body is caught between two of the other: contacts that overlap and push either way. To come
  /// apart they would press against each other without bound.
  bool is_caught() const {
    constexpr double kOpposed = -0.5;
    const auto overlaps = [](const Contact& c) { return c.axes.col(0).dot(c.offset) < 0.0; };
    for (const Contact& contact : contacts_)
      if (overlaps(contact) && std::ranges::any_of(contacts_, [&](const Contact& other) {
            return overlaps(other) && contact.axes.col(0).dot(other.axes.col(0)) < kOpposed;
          }))
        return true;
    return false;
  }

  /// Where both forces act. What is round touches at its own point, wherever that of the other has gone.
  static Vec3 point_of_action(const Contact& contact, const Vec3& a, const Vec3& b) {
    if (is_round(contact.a) != is_round(contact.b)) return is_round(contact.a) ? a : b;
    return 0.5 * (a + b);
  }

  static Vec3 rolled(const BodyStates& states, StepTime when, const Contact& contact) {
    if (when == StepTime::kStart) return Vec3::Zero();
    return contact.a.rolled(states) - contact.b.rolled(states);
  }

  /// The two sides of a contact by number: a, b. Forces and displacements of b count the other way.
  static const SurfacePoint& at(const Contact& contact, std::size_t side) {
    return (side == 0 ? contact.a : contact.b).at;
  }
  static Index body(const Contact& contact, std::size_t side) { return (side == 0 ? contact.a : contact.b).body; }
  static double sign(std::size_t side) { return side == 0 ? 1.0 : -1.0; }

  /// When a contact that is open closes faster than what counts as an impact; `within` if it does not before.
  double touch(const BodyStates& states, const FreeMotions& motions, const Contact& contact, double within) {
    constexpr int kMostHalvings = 60;
    constexpr double kClosed = 1e-12;  // of the way through the step
    const Vec3 n = contact.axes.col(0);
    Vec3 a, b, velocity_a, velocity_b;
    const auto gap = [&](double time) {
      passage_a_.find(states, motions, contact.a, time, a, velocity_a);
      passage_b_.find(states, motions, contact.b, time, b, velocity_b);
      return n.dot(a - b);
    };
    double open = 0.0, closed = within, gap_open = gap(open), gap_closed = gap(closed);
    const double least = kRelativeTolerance * a.norm();
    if (!(gap_open > least && gap_closed < 0.0)) return within;
    for (int i = 0; i < kMostHalvings && closed - open > kClosed * within; ++i) {
      // Secants from both ends close in from one side alone: every third step halves.
      const double part = i % 3 == 2 ? 0.5 : std::clamp(gap_open / (gap_open - gap_closed), 1e-3, 1.0 - 1e-3);
      const double between = open + part * (closed - open), seen = gap(between);
      (seen > 0.0 ? open : closed) = between;
      (seen > 0.0 ? gap_open : gap_closed) = seen;
      if (seen > 0.0 && seen <= least) break;
    }
    gap(open);
    return n.dot(velocity_b - velocity_a) > options_->impact_speed ? open : within;
  }

  /// Whether the bodies are in an impact in the coming step.
  bool strikes(const BodyStates& states) const {
    const Contact& first = contacts_.front();
    if (options_->impact == ImpactModel::kAbsorbed || !(flexes(first.a) || flexes(first.b))) return false;
    if (lasted_ > 0.0) return lasted_ < std::max(longest_rebound(first.a, first.b), kShortestStrike * step_);
    return std::ranges::any_of(contacts_, [&](const Contact& contact) {
      if (!contact.last_force.isZero(0.0)) return false;  // it has begun before
      const Vec3 n = contact.axes.col(0);
      const double speed =
          n.dot(contact.a.velocity(states, StepTime::kStart) - contact.b.velocity(states, StepTime::kStart));
      return -speed > options_->impact_speed && n.dot(contact.offset) + step_ * speed < 0.0;
    });
  }

  /// Each contact by itself: what keeps loads that could be shared in many ways from wandering between contacts.
  void add_give(Index first, ConstraintRows& rows) const {
    if (give_ == 0.0) return;
    for (Index row = first; row < rows.size(); ++row) rows.add_give(row, give_);
    double stored = 0.0;
    for (const Contact& contact : contacts_) stored += 0.5 * contact.give * contact.last_force.squaredNorm();
    rows.add_stored_energy(stored);
  }

  /// @param first row of the first contact
  void add_flexibility(const BodyStates& states, Index first, ConstraintRows& rows) {
    add_give(first, rows);
    for (std::size_t side = 0; side < 2; ++side) {
      if (!yields_[side]) continue;
      const Mat3 R = to_matrix(turn_[side]);
      Index row = first;
      for (const Contact& contact : contacts_) {
        const Mat3 axes = sign(side) * (R.transpose() * contact.axes);
        dents_->add_rows(states, body(contact, side), {at(contact, side), axes, row, row_count(contact)}, rows);
        row += row_count(contact);
      }
    }
  }

  static Index row_count(const Contact& contact) { return contact.friction == 0.0 ? 1 : 3; }

  void add_contact(const BodyStates& states, StepTime when, const Contact& contact, ConstraintRows& rows) {
    const Vec3 a = contact.a.position(states, when), b = contact.b.position(states, when);
    const Vec3 end = point_of_action(contact, a, b);
    double length = a.norm();
    if (!states.is_static(contact.a.body)) length += (a - states.pose(contact.a.body, when).p).norm();
    if (!states.is_static(contact.b.body)) length += (b - states.pose(contact.b.body, when).p).norm();
    const double tolerance = kRelativeTolerance * length + std::numeric_limits<double>::min();
    for (Index axis = 0; axis < row_count(contact); ++axis) {
      const Vec3 n = contact.axes.col(axis);
      RowLaw law{.tolerance = tolerance, .contact = true};
      if (axis == 0) {
        const double gap = n.dot(a - b) + (when == StepTime::kStart ? contact.dent[0] : 0.0);
        const double recovery =
            caught_ ? 0.0 : std::min(kRecovery * std::max(0.0, -gap - deepest_dent_), step_ * options_->recovery_speed);
        law.offset = std::min(0.0, gap) + recovery;
        law.agent_displacement = recovery;
        law.lower = 0.0;
        law.holds = true;
        law.strikes = strikes_;
        if (options_->rule.method == ContactMethod::kPenalty) make_spring(states, contact, gap, law);
        law.friction = contact.friction;
      } else {
        law.offset = contact.dent[axis];
        law.slides = true;
        law.goes_on = true;
      }
      law.last_force = n.dot(contact.last_force);
      law.held_force = n.dot(contact.held_force);
      const RowSide on_a = point_row(states, when, contact.a, end, n, modal_a_);
      const RowSide on_b = point_row(states, when, contact.b, end, -n, modal_b_);
      rows.add(on_a, on_b, law);
    }
  }

  /// F = −k x' − c (x' − min(0, x))/Δt ≥ 0, x' the gap at the step's end.
  void make_spring(const BodyStates& states, const Contact& contact, double gap, RowLaw& law) const {
    const double mass = reduced_mass(states, contact), omega = 2.0 * std::numbers::pi * options_->penalty_frequency;
    const double k = mass * omega * omega, d = 2.0 * options_->penalty_damping * mass * omega;
    law.compliance = 1.0 / (step_ * k + d);
    law.offset = d * law.compliance * std::min(0.0, gap);
    law.stiffness = k;
    law.holds = law.strikes = false;
    law.goes_on = true;
    law.agent_displacement = 0.0;
  }

  static double reduced_mass(const BodyStates& states, const Contact& contact) {
    double inverse = 0.0;
    for (const Side* side : {&contact.a, &contact.b})
      if (!states.is_static(side->body)) inverse += 1.0 / states.body(side->body).group->frame_constants().mass;
    return 1.0 / inverse;
  }

  std::span<Contact> contacts_;
  const ContactOptions* options_ = nullptr;
  ContactDents* dents_ = nullptr;
  std::array<bool, 2> yields_{};      // by side, whether its body has a residual compliance that is to be used
  std::array<Quaternion, 2> turn_{};  // of its body at the step's start, where it yields
  bool strikes_ = false, caught_ = false;
  double step_ = 0.0, lasted_ = 0.0;
  double give_ = 0.0;          // of each contact of bodies that flex, m/N
  double deepest_dent_ = 0.0;  // of the bodies' contacts, m: what the kept modes do not show of their shapes
  std::vector<double> modal_a_, modal_b_;
  Passage passage_a_, passage_b_;
};

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
  std::vector<Contact> contacts;
  std::vector<ContactMemory> memory, last_memory;  // by id, those that pressed in the last step
  std::vector<StrikeMemory> strikes;               // by (a, b), those that did so in the last step
  std::vector<RollingMemory> rolling_memory;       // by (a, b), of the last step
  std::vector<std::unique_ptr<PairContacts>> pairs;
  std::vector<std::unique_ptr<RollingResistance>> rolling;
  std::size_t pairs_used = 0, rolling_used = 0;
  std::vector<Constraint*> constraints;
  std::vector<ContactEvent> events, last_events;
  std::vector<ContactEvent> resting, last_resting;  // the last of bodies that sleep
  ContactDents dents;
  std::vector<double> give_energy;  // by body

  void remember(std::span<const char> asleep);
  void remember_rolling(std::span<const char> asleep);
  const ContactMemory* find(std::uint64_t id) const;
  double lasted(Index a, Index b) const;
  void resist_rolling(const BodyStates& states, std::span<const Contact> pair);
  void add(const BodyStates& states, const ContactPoint& point, const Vec3& origin, std::span<const double> friction);
};

const ContactMemory* ContactSet::Impl::find(std::uint64_t id) const {
  const auto found = std::lower_bound(memory.begin(), memory.end(), id,
                                      [](const ContactMemory& m, std::uint64_t i) { return m.id < i; });
  return found != memory.end() && found->id == id ? &*found : nullptr;
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
  Contact contact{
      .id = point.id, .a = make_side(states, point.a, point.normal), .b = make_side(states, point.b, -point.normal)};
  contact.axes = frame_along(point.normal);
  contact.friction = std::sqrt(of(point.a.body) * of(point.b.body));
  contact.offset = contact.a.position(states, StepTime::kStart) - contact.b.position(states, StepTime::kStart);
  contact.start_position = point.position + origin;
  if (const ContactMemory* known = find(point.id))
    contact.last_force = known->force, contact.held_force = known->held, contact.give = known->give;
  contacts.push_back(contact);
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
  s.contacts.clear();
  s.constraints.clear();
  std::size_t bodies = s.give_energy.size();
  for (const ContactPoint& point : points)
    bodies = std::max(bodies, static_cast<std::size_t>(std::max({point.a.body, point.b.body, Index{-1}}) + 1));
  s.give_energy.resize(bodies);
  s.dents.reserve(bodies);
  for (const ContactPoint& point : points)
    if (!states.is_static(point.a.body) || !states.is_static(point.b.body)) s.add(states, point, origin, friction);
  s.pairs_used = s.rolling_used = 0;
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= s.contacts.size(); ++i) {
    const Contact& first = s.contacts[begin];
    if (i < s.contacts.size() && s.contacts[i].a.body == first.a.body && s.contacts[i].b.body == first.b.body) continue;
    if (s.pairs_used == s.pairs.size()) s.pairs.push_back(std::make_unique<PairContacts>());
    PairContacts& pair = *s.pairs[s.pairs_used++];
    const std::span<Contact> of_pair = std::span(s.contacts).subspan(begin, i - begin);
    pair.set(of_pair, s.options, s.dents, s.lasted(first.a.body, first.b.body));
    s.constraints.push_back(&pair);
    s.resist_rolling(states, of_pair);
    begin = i;
  }
}

/// With the forces of the last step, where there were any.
void ContactSet::Impl::resist_rolling(const BodyStates& states, std::span<const Contact> pair) {
  if (options.rolling_friction == 0.0 || options.rule.method != ContactMethod::kComplementary ||
      options.rule.friction != FrictionModel::kCone)
    return;
  double largest = 0.0;
  for (const Contact& contact : pair)
    if (is_round(contact.a) || is_round(contact.b))
      largest += options.rolling_friction * shorter_arm(states, contact) *
                 std::max(0.0, contact.axes.col(0).dot(contact.last_force));
  if (largest == 0.0) return;
  const Index a = pair.front().a.body, b = pair.front().b.body;
  const auto known = std::ranges::lower_bound(rolling_memory, RollingMemory{a, b, Vec3::Zero()}, by_pair);
  const bool knows = known != rolling_memory.end() && known->a == a && known->b == b;
  if (rolling_used == rolling.size()) rolling.push_back(std::make_unique<RollingResistance>());
  RollingResistance& resistance = *rolling[rolling_used++];
  resistance.set(a, b, largest, knows ? known->moment : Vec3(Vec3::Zero()));
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

void ContactSet::finish(std::span<const char> asleep) {
  Impl& s = *impl_;
  std::swap(s.events, s.last_events);
  std::swap(s.resting, s.last_resting);
  s.events.clear();
  s.resting.clear();
  for (const Contact& contact : s.contacts) {
    if (contact.impulse.isZero(0.0)) continue;
    s.events.push_back({.id = contact.id,
                        .a = contact.a.body,
                        .b = contact.b.body,
                        .phase = s.find(contact.id) != nullptr ? ContactPhase::kLasting : ContactPhase::kBegun,
                        .position = contact.start_position,
                        .normal = contact.axes.col(0),
                        .impulse = contact.impulse});
  }
  std::sort(s.events.begin(), s.events.end(), by_id);
  const std::size_t pressed = s.events.size();
  for (const std::vector<ContactEvent>* earlier : {&s.last_events, &s.last_resting})
    for (const ContactEvent& last : *earlier) {
      const auto end = s.events.begin() + static_cast<std::ptrdiff_t>(pressed);
      if (last.phase == ContactPhase::kEnded || std::binary_search(s.events.begin(), end, last, by_id)) continue;
      if (rests(asleep, last.a, last.b)) {
        s.resting.push_back(last);
        continue;
      }
      s.events.push_back(last);
      s.events.back().phase = ContactPhase::kEnded;
      s.events.back().impulse = Vec3::Zero();
    }
  s.remember(asleep);
  s.dents.finish(asleep);
  s.strikes.clear();
  for (std::size_t i = 0; i < s.pairs_used; ++i)
    if (const double lasted = s.pairs[i]->lasted(); lasted > 0.0) {
      const auto [a, b] = s.pairs[i]->bodies();
      s.strikes.push_back({a, b, lasted});
    }
  std::sort(s.events.begin(), s.events.end(), by_id);
}

/// The forces of this step, and those under which bodies fell asleep.
void ContactSet::Impl::remember(std::span<const char> asleep) {
  std::swap(memory, last_memory);
  memory.clear();
  for (const Contact& contact : contacts)
    if (!contact.impulse.isZero(0.0))
      memory.push_back({.id = contact.id,
                        .a = contact.a.body,
                        .b = contact.b.body,
                        .force = contact.last_force,
                        .held = contact.held_force,
                        .give = contact.give,
                        .yielding = flexes(contact.a) ? contact.a.body : contact.b.body});
  for (const ContactMemory& last : last_memory)
    if (rests(asleep, last.a, last.b)) memory.push_back(last);
  std::sort(memory.begin(), memory.end(), by_id);
  remember_rolling(asleep);
  std::ranges::fill(give_energy, 0.0);
  for (const ContactMemory& m : memory)
    if (m.give > 0.0) give_energy[static_cast<std::size_t>(m.yielding)] += 0.5 * m.give * m.force.squaredNorm();
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
std::span<const StrikeMemory> ContactSet::strikes() const { return impl_->strikes; }
std::span<const RollingMemory> ContactSet::rolling() const { return impl_->rolling_memory; }

void ContactSet::clear() {
  impl_->contacts.clear();
  impl_->constraints.clear();
  impl_->memory.clear();
  impl_->strikes.clear();
  impl_->rolling_memory.clear();
  impl_->events.clear();
  impl_->resting.clear();
  impl_->dents.clear();
}

void ContactSet::forget(Index body) { impl_->dents.forget(body); }

std::span<const DentLoad> ContactSet::dent_loads(Index body) const { return impl_->dents.loads(body); }

double ContactSet::dent_energy(const BodyStates& states, Index body) const {
  const auto i = static_cast<std::size_t>(body);
  return impl_->dents.energy(states, body) + (i < impl_->give_energy.size() ? impl_->give_energy[i] : 0.0);
}

}  // namespace limber
