#include "manifold/swept_path.h"

#include <algorithm>
#include <cmath>

#include "limber/collision/closest_features.h"
#include "tuning.h"

namespace limber::internal {
namespace {

/// How far a body's points may come beside the straight way that its state tells. @return m; 0 where nothing is
/// expected
double doubt_of(const BodyState& state) { return std::isfinite(state.doubt) ? state.doubt : 0.0; }

double thinner(const PairQuery& q) { return std::min(q.a.thickness, q.b.thickness); }

}  // namespace

// -- One body ---------------------------------------------------------------------------------------------------------

void SweptPath::Side::begin(const BodyState& from) {
  state = from;
  amplitudes.assign(from.amplitudes.begin(), from.amplitudes.end());
  state.amplitudes = amplitudes;
  rates.assign(amplitudes.size(), 0.0);
  if (std::isfinite(from.doubt) && from.end_amplitudes.size() == amplitudes.size())
    for (std::size_t i = 0; i < rates.size(); ++i) rates[i] = from.end_amplitudes[i] - from.amplitudes[i];
  moves = !(state.displacement.isZero(0.0) && state.rotation.isZero(0.0) &&
            std::ranges::all_of(rates, [](double rate) { return rate == 0.0; }));
}

void SweptPath::Side::go(double share) {
  if (!moves) return;
  state.pose = after(share);
  state.pose.q = normalized(state.pose.q);
  for (std::size_t i = 0; i < rates.size(); ++i) amplitudes[i] += share * rates[i];
}

RigidTransform SweptPath::Side::after(double share) const {
  return {quaternion_from_rotation_vector(share * state.rotation) * state.pose.q,
          state.pose.p + share * state.displacement};
}

std::span<const Vec3> SweptPath::Side::points_after(double share, const ConvexCore& core) {
  const RigidTransform X_WB = after(share);
  const Mat3 R = to_matrix(X_WB.q);
  points.clear();
  for (const Vec3& point : core.points) points.push_back(X_WB.p + R * point);
  return points;
}

MovingBody SweptPath::Side::moving(const ManifoldBody& body) const {
  MovingBody moving{.pose = state.pose,
                    .displacement = state.displacement,
                    .rotation = state.rotation,
                    .amplitudes = amplitudes,
                    .rates = rates};
  if (body.modal)
    moving.surface = body.modal->surface;
  else
    moving.geometry = &body.rigid->geometry;
  return moving;
}

// -- Two ------------------------------------------------------------------------------------------------------------

bool SweptPath::is_needed(const PairQuery& q) {
  if (q.index_a == q.index_b || q.a.half_space() != nullptr || q.b.half_space() != nullptr) return false;
  const double turning = q.state_a.reach - doubt_of(q.state_a) + q.state_b.reach - doubt_of(q.state_b);
  return q.passing.way.norm() + turning > thinner(q);
}

double SweptPath::near_at_start(const PairQuery& q) {
  return q.reach - q.passing.way.norm() - q.state_a.reach - q.state_b.reach + doubt_of(q.state_a) +
         doubt_of(q.state_b) + margin(q);
}

double SweptPath::margin(const PairQuery& q) { return collision_tuning().impact.touch * thinner(q); }

void SweptPath::begin(const PairQuery& q) {
  pair_ = &q;
  margin_ = margin(q);
  time_ = 0.0;
  sides_[0].begin(q.state_a);
  sides_[1].begin(q.state_b);
}

bool SweptPath::advance() {
  const double left = 1.0 - time_;
  if (!(left > 0.0)) return false;
  const double least = 0.125 * margin_;
  const ImpactTime touch =
      pair_->a.core() != nullptr && pair_->b.core() != nullptr
          ? touch_of_cores(left, least)
          : impacts_.find(sides_[0].moving(pair_->a), sides_[1].moving(pair_->b), left, margin_, least);
  if (touch.status == ImpactTime::Status::kNone || touch.status == ImpactTime::Status::kTouching) return false;
  for (Side& side : sides_) side.go(touch.time);
  time_ += touch.time;
  return true;
}

/// Conservative advancement: the gap along the line of the nearest points of two convex shapes closes no faster than
/// the bodies come and their farthest points turn. As long as this line tells, the nearest points are not searched
/// anew. The answer is as that of TimeOfImpact.
ImpactTime SweptPath::touch_of_cores(double left, double least) {
  using Status = ImpactTime::Status;
  const ConvexCore &a = *pair_->a.core(), &b = *pair_->b.core();
  const int most = collision_tuning().impact.looks_on_the_way;
  if (pass_beside(left)) return {Status::kNone, left, 0};
  double margin = margin_, t = 0.0;
  for (int n = 1; n <= most; ++n) {
    const ConvexDistance d =
        distance({sides_[0].points_after(t, a), a.radius}, {sides_[1].points_after(t, b), b.radius});
    while (t == 0.0 && d.distance <= margin && 0.5 * margin >= least) margin *= 0.5;
    if (d.distance <= margin) return {t == 0.0 ? Status::kTouching : Status::kImpact, t, n};
    const double closing = turning_towards(d.normal) - d.normal.dot(way());
    double gap = d.distance;
    for (int step = 0; step < most && gap > margin; ++step) {
      const double open = gap - collision_tuning().impact.kept_gap * margin;
      if (!(closing * (left - t) > open)) return {Status::kNone, left, n};
      t += open / closing;
      gap = gap_along(d.normal, sides_[0].after(t), sides_[1].after(t));
    }
  }
  return {Status::kResting, t, most};
}

/// How far two convex shapes are apart along a direction. @param normal unit, from b to a
double SweptPath::gap_along(const Vec3& normal, const RigidTransform& X_WA, const RigidTransform& X_WB) const {
  return normal.dot(X_WA.p - X_WB.p) - pair_->a.core()->reach(X_WA.q.conjugate() * -normal) -
         pair_->b.core()->reach(X_WB.q.conjugate() * normal);
}

/// How far points come along a direction, at most, as the bodies turn through what is left.
double SweptPath::turning_towards(const Vec3& normal) const {
  return normal.cross(sides_[0].state.rotation).norm() * pair_->a.radius +
         normal.cross(sides_[1].state.rotation).norm() * pair_->b.radius;
}

/// Whether a plane along the way, or that of a face, keeps two convex shapes apart.
bool SweptPath::pass_beside(double left) const {
  const Vec3 along = way().normalized(), between = sides_[0].state.pose.p - sides_[1].state.pose.p;
  if (keeps_apart((between - along.dot(between) * along).normalized(), left)) return true;
  for (std::size_t s = 0; s < 2; ++s) {
    const ConvexCore& core = *(s == 0 ? pair_->a : pair_->b).core();
    const Mat3 R = to_matrix(sides_[s].state.pose.q);
    for (const ConvexFace& face : core.faces)
      if (keeps_apart(R * (s == 0 ? Vec3(-face.normal) : face.normal), left)) return true;
  }
  return false;
}

/// Whether a plane does, all along what is left of the way. @param normal unit, from b to a
bool SweptPath::keeps_apart(const Vec3& normal, double left) const {
  const RigidTransform &X_WA = sides_[0].state.pose, &X_WB = sides_[1].state.pose;
  const double closing = std::max(0.0, -left * normal.dot(way()));
  if (!(normal.dot(X_WA.p - X_WB.p) > closing)) return false;
  const double gap = gap_along(normal, X_WA, X_WB) - closing;
  return turning_towards(normal) * left <= gap - collision_tuning().impact.kept_gap * margin_;
}

Vec3 SweptPath::way() const { return sides_[0].state.displacement - sides_[1].state.displacement; }

PairQuery SweptPath::query() const {
  const BodyState &a = sides_[0].state, &b = sides_[1].state;
  PairQuery q{.index_a = pair_->index_a,
              .index_b = pair_->index_b,
              .a = pair_->a,
              .b = pair_->b,
              .state_a = a,
              .state_b = b,
              .ahead = time_};
  const Quaternion to_a = a.pose.q.conjugate();
  q.X_AB = {to_a * b.pose.q, to_a * (b.pose.p - a.pose.p)};
  const double far = thinner(q), length = (1.0 - time_) * way().norm();
  q.passing = pair_->passing;
  q.passing.way = to_a * ((1.0 - time_) * std::min(1.0, far / std::max(length, far)) * way());
  q.reach = std::min(pair_->reach, far);
  q.planes_a = pair_->planes_a, q.planes_b = pair_->planes_b;
  return q;
}

void SweptPath::turn_aside(std::span<const FeatureContact> contacts) {
  if (contacts.empty()) return;
  const Quaternion from_a = sides_[0].state.pose.q;
  const auto deepest =
      std::min_element(contacts.begin(), contacts.end(), [](const auto& c, const auto& d) { return c.gap < d.gap; });
  Side& mover = sides_[0].moves ? sides_[0] : sides_[1];
  const double sign = sides_[0].moves ? 1.0 : -1.0;
  if (deepest->gap < margin_) mover.state.pose.p += sign * 1.25 * (margin_ - deepest->gap) * (from_a * deepest->normal);
  Vec3 on = way();
  bool turns_in = false;
  for (int round = 0; round < 2; ++round)
    for (const FeatureContact& c : contacts) {
      if (c.gap > std::max(deepest->gap, 0.0) + margin_) continue;
      const Vec3 normal = from_a * c.normal;
      on -= std::min(0.0, normal.dot(on)) * normal;
      const Vec3 arm_a = from_a * c.a.point, arm_b = from_a * (c.b.point - pair_b_in_a());
      turns_in =
          turns_in || normal.dot(sides_[0].state.rotation.cross(arm_a) - sides_[1].state.rotation.cross(arm_b)) < 0.0;
    }
  mover.state.displacement += sign * (on - way());
  if (turns_in)
    for (Side& side : sides_) side.state.rotation.setZero();
}

Vec3 SweptPath::pair_b_in_a() const {
  return sides_[0].state.pose.q.conjugate() * (sides_[1].state.pose.p - sides_[0].state.pose.p);
}

}  // namespace limber::internal
