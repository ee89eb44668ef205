#include "limber/scene/blows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>

#include "limber/core/mixed_bits.h"
#include "limber/mesh/closest_point.h"
#include "limber/sound/contact_time.h"
#include "limber/sound/radiation.h"

namespace limber {
namespace {

/// 1/m that a contact feels of a body, kg⁻¹. @param r from the body's origin, world
double inverse_mass(const ModalModelData& body, const RigidTransform& pose, const Vec3& r, const Vec3& normal) {
  const Vec3 moment = pose.q.conjugate() * Vec3(r.cross(normal));
  switch (body.motion) {
    case FrameMotion::kFree:
      return 1.0 / body.mass + moment.dot(body.inertia.ldlt().solve(moment));
    case FrameMotion::kPoint:
      return moment.dot(body.inertia.ldlt().solve(moment));
    case FrameMotion::kLine:
      return std::pow(moment.dot(body.line_axis), 2) / body.line_axis.dot(body.inertia * body.line_axis);
    case FrameMotion::kKinematic:
      break;
  }
  return 0.0;
}

/// 1/R of a body where it is touched, 1/m.
double inverse_radius(const ModalModelData& body) { return std::cbrt(4.0 * std::numbers::pi / 3.0 / body.volume); }

/// Within what Blow::contact_time may say, s.
double duration_in_range(double seconds) { return std::clamp(seconds, 1e-6, 10.0); }

/// Blows of one step of a world.
class StepOfBlows {
 public:
  StepOfBlows(const Scene& scene, const World& world, std::span<const BodyId> bodies, std::vector<BlowRecord>& blows)
      : scene_(scene), world_(world), bodies_(bodies), blows_(blows) {}

  void add_strike(const LoadReport& report, double start) {
    const Strike& strike = scene_.strikes[report.load];
    BlowRecord blow = blow_on(report.number, report.point, strike.impulse);
    if (strike.axes == Axes::kBody) blow.impulse = strike.impulse;
    blow.time = start + report.delay;
    blow.contact_time = strike.contact_time;
    blows_.push_back(blow);
  }

  /// Of both bodies, as far as they move.
  void add_collision(const ContactEvent& e, std::size_t a, std::size_t b, double start) {
    const double mass = mass_of(a, b, e.position, e.normal);
    if (std::isinf(mass)) return;
    double radius = 0.0;  // reciprocal
    for (const std::size_t body : {a, b})
      if (body < bodies_.size()) radius += inverse_radius(world_.model(bodies_[body]).data());
    add_pair(e.position, e.impulse, a, b,
             {.time = start, .mass = mass, .radius = 1.0 / radius, .approach = e.approach});
  }

  /// Noise of friction on both bodies.
  void add_slide(const ContactEvent& e, std::size_t a, std::size_t b, std::int64_t step) {
    const auto tangential = [&](const Vec3& v) -> Vec3 { return v - e.normal.dot(v) * e.normal; };
    const double length = scene_.step;
    const Vec3 friction = tangential(e.impulse) / length;
    const double force = friction.norm(), speed = tangential(velocity(a, e.position) - velocity(b, e.position)).norm();
    if (force == 0.0) return;
    const Vec3 along = friction / force;
    const double mass = mass_of(a, b, e.position, along);
    if (std::isinf(mass)) return;
    const double spacing = std::max(kRoughness, speed / kMostRoughnesses);
    const double deviation = std::sqrt(2.0 * mass * kShareOfFriction * force * spacing);
    Dice dice(e.id, static_cast<std::uint64_t>(step));
    const auto met = static_cast<int>(speed * length / spacing + dice.roll());
    const double duration = duration_in_range(spacing / speed);
    for (int i = 0; i < met; ++i) {
      const double time = (static_cast<double>(step) + (i + dice.roll()) / met) * length;
      const Vec3 impulse = std::sqrt(3.0) * (2.0 * dice.roll() - 1.0) * deviation * along;
      add_pair(e.position, impulse, a, b, {.time = time, .contact_time = duration});
    }
  }

 private:
  /// Even numbers in [0, 1) that follow from two.
  class Dice {
   public:
    Dice(std::uint64_t a, std::uint64_t b) : state_(a * 0x9e3779b97f4a7c15u + b) {}
    double roll() {
      state_ += 0x9e3779b97f4a7c15u;
      return static_cast<double>(mixed_bits(state_) >> 11) * 0x1p-53;
    }

   private:
    std::uint64_t state_;
  };

  /// That a contact of two bodies feels along a direction, kg: the reciprocal of both reciprocals' sum.
  double mass_of(std::size_t a, std::size_t b, const Vec3& position, const Vec3& along) const {
    double sum = 0.0;
    for (const std::size_t body : {a, b}) {
      if (body >= bodies_.size()) continue;
      const RigidTransform pose = world_.interpolated_pose(bodies_[body], 0.0);
      sum += inverse_mass(world_.model(bodies_[body]).data(), pose, position - pose.p, along);
    }
    return 1.0 / sum;
  }

  /// Of a body's frame and of the surface that runs over it, at a point.
  Vec3 velocity(std::size_t body, const Vec3& point) const {
    if (body >= bodies_.size()) {
      const SceneStatic& still = scene_.statics[body - bodies_.size()];
      return still.pose.q * still.surface_velocity;
    }
    const BodyId id = bodies_[body];
    const BodyView view = world_.body(id);
    return view.velocity + view.angular_velocity.cross(point - view.pose.p) + view.pose.q * world_.surface_velocity(id);
  }

  /// A blow on a, and its opposite on b, as far as they move. @param kind what both share
  void add_pair(const Vec3& position, const Vec3& impulse, std::size_t a, std::size_t b, const BlowRecord& kind) {
    for (const auto& [body, on] : {std::pair(a, impulse), std::pair(b, Vec3(-impulse))}) {
      if (body >= bodies_.size()) continue;
      BlowRecord blow = blow_on(body, position, on);
      blow.time = kind.time;
      blow.contact_time = kind.contact_time;
      blow.mass = kind.mass, blow.radius = kind.radius, blow.approach = kind.approach;
      if (kind.approach > 0.0) blow.other = body == a ? b : a;
      blows_.push_back(blow);
    }
  }

  /// Where the body was at the step's start.
  BlowRecord blow_on(std::size_t body, const Vec3& position, const Vec3& impulse) const {
    const RigidTransform pose = world_.interpolated_pose(bodies_[body], 0.0);
    BlowRecord blow;
    blow.body = body;
    blow.position = position;
    blow.point = pose.inverse() * position;
    blow.impulse = pose.q.conjugate() * impulse;
    return blow;
  }

  const Scene& scene_;
  const World& world_;
  std::span<const BodyId> bodies_;
  std::vector<BlowRecord>& blows_;
};

/// Of a raised cosine of unit area and length 2 at the angular frequency x: sin x/(x (1 − (x/π)²)), a half at x = π.
double transform_of_blow(double x) {
  constexpr double kPi = std::numbers::pi;
  const double sine = std::abs(x - kPi) < 1e-6 ? kPi - x : std::sin(x);
  return x < 1e-6 ? 1.0 : sine * kPi * kPi / (x * (kPi - x) * (kPi + x));
}

std::array<Vec3, 3> corners_of(const ModalSurface& surface, const Triangle& t) {
  const auto corner = [&](Index v) -> Vec3 { return surface.rest[static_cast<std::size_t>(v)].cast<double>(); };
  return {corner(t[0]), corner(t[1]), corner(t[2])};
}

}  // namespace

void list_blows(const Scene& scene, const ScenePlayer& player, std::span<const BodyId> bodies,
                std::span<const std::size_t> number_of, std::vector<BlowRecord>& blows) {
  const World& world = player.world();
  const std::int64_t n = player.steps_taken() - 1;
  const double start = static_cast<double>(n) * scene.step;
  StepOfBlows step(scene, world, bodies, blows);
  for (const LoadReport& report : player.strikes())
    if (!report.body.empty() && report.step == n)  // neither still to come nor long ago
      step.add_strike(report, start);
  for (const ContactEvent& e : world.contact_events()) {
    const std::size_t a = number_of[static_cast<std::size_t>(e.a)], b = number_of[static_cast<std::size_t>(e.b)];
    if (e.phase == ContactPhase::kBegun && e.approach > 0.0) step.add_collision(e, a, b, start);
  }
}

void list_slides(const Scene& scene, const ScenePlayer& player, std::span<const BodyId> bodies,
                 std::span<const std::size_t> number_of, std::vector<BlowRecord>& blows) {
  StepOfBlows step(scene, player.world(), bodies, blows);
  for (const ContactEvent& e : player.world().contact_events())
    if (e.phase == ContactPhase::kLasting)
      step.add_slide(e, number_of[static_cast<std::size_t>(e.a)], number_of[static_cast<std::size_t>(e.b)],
                     player.steps_taken() - 1);
}

SoundingBody::SoundingBody(std::shared_ptr<const SoundModes> modes, const ModalSurface& surface)
    : modes_(std::move(modes)), surface_(&surface), gains_(monopole_gains(*modes_, surface.rest, surface.triangles)) {
  double area = 0.0;
  for (const Triangle& t : surface.triangles) {
    const std::array<Vec3, 3> p = corners_of(surface, t);
    area += 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm();
  }
  radius_ = std::sqrt(area / (4.0 * std::numbers::pi));
}

StruckPoint SoundingBody::nearest(const Vec3& point) const {
  StruckPoint best;
  double least = std::numeric_limits<double>::infinity();
  for (const Triangle& t : surface_->triangles) {
    const SurfaceFoot foot = closest_on_triangle(point, corners_of(*surface_, t));
    if (const double distance = (foot.point - point).squaredNorm(); distance < least)
      least = distance, best = {.vertices = t, .weights = foot.weight};
  }
  return best;
}

double SoundingBody::largest_pressure(double contact_time) const {
  std::vector<double> sums(static_cast<std::size_t>(modes_->vertices), 0.0);
  for (Index k = 0; k < modes_->modes(); ++k) {
    const double x = 0.5 * std::sqrt(modes_->eigenvalues[static_cast<std::size_t>(k)]) * contact_time;
    const double gain = std::abs(gains_[static_cast<std::size_t>(k)] * transform_of_blow(x));
    for (Index v = 0; v < modes_->vertices; ++v)
      sums[static_cast<std::size_t>(v)] += gain * static_cast<double>(modes_->shape(k, v).norm());
  }
  return sums.empty() ? 0.0 : *std::max_element(sums.begin(), sums.end());
}

double duration_of(const BlowRecord& blow, const SoundingBody* body, const SoundingBody* other) {
  if (blow.other == BlowRecord::kNobody) return blow.contact_time;
  const auto modulus = [](const SoundingBody* one) { return one ? one->modes().contact_modulus : kUnbounded; };
  if (std::isinf(modulus(body)) && std::isinf(modulus(other))) return duration_in_range(0.0);
  return duration_in_range(contact_time({.mass = blow.mass, .radius = blow.radius, .modulus = modulus(body)},
                                        {.modulus = modulus(other)}, blow.approach));
}

}  // namespace limber
