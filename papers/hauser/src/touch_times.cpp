#include "touch_times.h"

#include <algorithm>

namespace limber::internal {
namespace {

constexpr double kImpactSpeed = 0.25;  // m/s: what comes together more slowly cuts no step
constexpr int kMostHalvings = 60;      // of the search for a touch: more than the digits of a double
constexpr double kClosed = 1e-12;      // of the way through the step: where that search ends
constexpr double kLeastPart = 1e-3;    // of the bracket, from either end, that a secant may come to

/// A vertex of a surface, or what is round.
bool is_pointed(const PreparedSide& side) {
  return is_round(side) || (side.model != nullptr && std::ranges::count(side.at.weight, 0.0) == 2);
}

/// A point within a triangle of a surface, or a rigid shape with faces.
bool has_face(const PreparedSide& side) {
  return !is_round(side) && (side.model == nullptr || std::ranges::count(side.at.weight, 0.0) == 0);
}

/// ṅ of a normal that is that of a face: it turns with the frame of the body whose face it is. Of edges, and between
/// two rigid shapes or two round ones, which one's it is cannot be told from the points: 0.
Vec3 turn_of_normal(const BodyStates& states, const PreparedContact& contact) {
  const PreparedSide* owner = nullptr;
  if (is_pointed(contact.a) && has_face(contact.b)) owner = &contact.b;
  if (is_pointed(contact.b) && has_face(contact.a)) owner = &contact.a;
  return owner != nullptr ? states.angular_velocity(owner->body, StepTime::kStart).cross(contact.axes.col(0))
                          : Vec3(Vec3::Zero());
}

/// At the step's start, world, of the point that a side's body carries along: of what is round the centre.
Vec3 velocity_of(const BodyStates& states, const PreparedSide& side) {
  constexpr StepTime kStart = StepTime::kStart;
  const Quaternion& q = states.pose(side.body, kStart).q;
  Vec3 v = states.velocity(side.body, kStart) + states.angular_velocity(side.body, kStart).cross(q * side.start_point);
  if (side.model != nullptr)
    v += q * side.deforming(states.amplitudes(side.body, kStart), states.rates(side.body, kStart));
  return v;
}

/// The acceleration of the point that a side's body carries along, if the body keeps its velocities: ω × (ω × p) +
/// 2 ω × R J ż, [H03] equation 20; what J itself changes by is left out.
Vec3 bias_of(const BodyStates& states, const PreparedSide& side) {
  const Vec3 omega = states.angular_velocity(side.body, StepTime::kStart);
  const Vec3 relative = velocity_of(states, side) - states.velocity(side.body, StepTime::kStart);
  const Vec3 turning = omega.cross(states.pose(side.body, StepTime::kStart).q * side.start_point);
  return omega.cross(2.0 * relative - turning);
}

}  // namespace

const ExactMotion* FreeMotions::of(Index body) const {
  const auto at = std::lower_bound(members.begin(), members.end(), body);
  if (at == members.end() || *at != body) return nullptr;
  return &motions[static_cast<std::size_t>(at - members.begin())];
}

void TouchTimes::Passage::find(const BodyStates& states, const FreeMotions& motions, const PreparedSide& side,
                               double time) {
  const ExactMotion* motion = motions.of(side.body);
  if (motion == nullptr) {
    place = side.position(states, StepTime::kStart);
    velocity = Vec3::Zero();
    return;
  }
  motion->evaluate(time, state);
  place = state.pose * side.place(state.amplitudes) + side.rim;
  velocity = state.velocity + state.angular_velocity.cross(place - state.pose.p);
  if (side.model != nullptr) velocity += state.pose.q * side.deforming(state.amplitudes, state.rates);
}

double TouchTimes::next(const PairContacts& contacts, const BodyStates& states, const FreeMotions& motions,
                        double within) {
  for (const PreparedContact& contact : contacts.contacts()) within = touch(states, motions, contact, within);
  return within;
}

double TouchTimes::touch(const BodyStates& states, const FreeMotions& motions, const PreparedContact& contact,
                         double within) {
  const Vec3 n = contact.axes.col(0);
  Passage &a = passage_[0], &b = passage_[1];
  const auto gap = [&](double time) {
    a.find(states, motions, contact.a, time);
    b.find(states, motions, contact.b, time);
    return n.dot(a.place - b.place);
  };
  double open = 0.0, closed = within, gap_open = gap(open), gap_closed = gap(closed);
  const double least = gap_tolerance(states, StepTime::kStart, contact, a.place, b.place);
  if (!(gap_open > least && gap_closed < 0.0)) return within;
  for (int i = 0; i < kMostHalvings && closed - open > kClosed * within; ++i) {
    // Secants from both ends close in from one side alone: every third step halves.
    const double part = i % 3 == 2 ? 0.5 : std::clamp(gap_open / (gap_open - gap_closed), kLeastPart, 1.0 - kLeastPart);
    const double between = open + part * (closed - open), seen = gap(between);
    (seen > 0.0 ? open : closed) = between;
    (seen > 0.0 ? gap_open : gap_closed) = seen;
    if (seen > 0.0 && seen <= least) break;
  }
  gap(open);
  return n.dot(b.velocity - a.velocity) > kImpactSpeed ? open : within;
}

/// Of the gap n·d, d from b's point to a's: n·d̈ + 2 ṅ·ḋ + n̈·d, of what slides along an axis e: e·d̈. At a touch d is
/// along n, by the radii of what is round, and n̈·n = −|ṅ|².
void bias_accelerations(const PairContacts& contacts, const BodyStates& states, std::span<double> bias) {
  std::size_t row = 0;
  for (const PreparedContact& contact : contacts.contacts()) {
    const PreparedSide &a = contact.a, &b = contact.b;
    const Vec3 n = contact.axes.col(0), turn = turn_of_normal(states, contact),
               bias_ab = bias_of(states, a) - bias_of(states, b);
    const Vec3 apart = a.start_position(states) - a.rim - (b.start_position(states) - b.rim);
    for (Index axis = 0; axis < contact.rows(); ++axis)
      bias[row + static_cast<std::size_t>(axis)] = contact.axes.col(axis).dot(bias_ab);
    bias[row] += 2.0 * turn.dot(velocity_of(states, a) - velocity_of(states, b)) - turn.squaredNorm() * n.dot(apart);
    row += static_cast<std::size_t>(contact.rows());
  }
}

}  // namespace limber::internal
