#include "limber/scene/blows.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

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

/// Blows of one step of a world.
class StepOfBlows {
 public:
  StepOfBlows(const World& world, std::span<const BodyId> bodies, std::vector<BlowRecord>& blows)
      : world_(world), bodies_(bodies), blows_(blows) {}

  void add_strike(const LoadReport& report, const Strike& strike, double start) {
    BlowRecord blow = blow_on(report.number, report.point, strike.impulse);
    if (strike.axes == Axes::kBody) blow.impulse = strike.impulse;
    blow.time = start + report.delay;
    blow.contact_time = strike.contact_time;
    blows_.push_back(blow);
  }

  /// Of both bodies, as far as they move.
  void add_collision(const ContactEvent& e, std::size_t a, std::size_t b, double start) {
    double mass = 0.0, radius = 0.0;  // reciprocals
    for (const std::size_t body : {a, b}) {
      if (body >= bodies_.size()) continue;
      const ModalModelData& data = world_.model(bodies_[body]).data();
      const RigidTransform pose = world_.interpolated_pose(bodies_[body], 0.0);
      mass += inverse_mass(data, pose, e.position - pose.p, e.normal);
      radius += inverse_radius(data);
    }
    if (mass == 0.0) return;
    for (const auto& [body, other, impulse] : {std::tuple(a, b, e.impulse), std::tuple(b, a, Vec3(-e.impulse))}) {
      if (body >= bodies_.size()) continue;
      BlowRecord blow = blow_on(body, e.position, impulse);
      blow.time = start;
      blow.other = other;
      blow.mass = 1.0 / mass, blow.radius = 1.0 / radius, blow.approach = e.approach;
      blows_.push_back(blow);
    }
  }

 private:
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
  StepOfBlows step(world, bodies, blows);
  for (const LoadReport& report : player.strikes())
    if (!report.body.empty() && report.step == n)  // neither still to come nor long ago
      step.add_strike(report, scene.strikes[report.load], start);
  for (const ContactEvent& e : world.contact_events())
    if (e.phase == ContactPhase::kBegun && e.approach > 0.0)
      step.add_collision(e, number_of[static_cast<std::size_t>(e.a)], number_of[static_cast<std::size_t>(e.b)], start);
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
  constexpr double kShortest = 1e-6, kLongest = 10.0;
  if (blow.other == BlowRecord::kNobody) return blow.contact_time;
  const auto modulus = [](const SoundingBody* one) { return one ? one->modes().contact_modulus : kUnbounded; };
  if (std::isinf(modulus(body)) && std::isinf(modulus(other))) return kShortest;
  const double tau = contact_time({.mass = blow.mass, .radius = blow.radius, .modulus = modulus(body)},
                                  {.modulus = modulus(other)}, blow.approach);
  return std::clamp(tau, kShortest, kLongest);
}

}  // namespace limber
