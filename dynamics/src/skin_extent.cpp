#include "limber/dynamics/skin_extent.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "limber/dynamics/body_shape.h"

namespace limber {
namespace {

ModalSkin without_gauge(ModalSkin skin) {
  skin.gauge = {};
  return skin;
}

double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * std::abs(b[i]);
  return sum;
}

}  // namespace

SkinExtent::SkinExtent(const ModalModel& model)
    : bare_(without_gauge(*model.data().skin)),
      k_(static_cast<std::size_t>(model.modes())),
      balls_(static_cast<std::size_t>(bare_.handles)),
      flexing_(k_, 0.0),
      mean_radius_(std::sqrt(0.5 * model.data().inertia.trace() / model.data().mass)) {
  const ModalSurface& surface = model.collision();
  const std::span<const SkinInfluences> influences = skin_influences(model, SurfacePoint::Surface::kCollision);
  const auto for_vertices = [&](auto&& act) {
    for (std::size_t v = 0; v < influences.size(); ++v)
      for (std::size_t i = 0; i < SkinInfluences::kMost; ++i)
        if (influences[v].weight[i] > 0.0f)
          act(balls_[influences[v].handle[i]], surface.rest[v].cast<double>().eval(), influences[v].handle[i]);
  };
  std::vector<Eigen::AlignedBox3d> boxes(balls_.size());
  for_vertices([&](Ball& ball, const Vec3& r, std::size_t h) { ball.used = true, boxes[h].extend(r); });
  for (std::size_t h = 0; h < balls_.size(); ++h)
    if (balls_[h].used) balls_[h].center = boxes[h].center();
  for_vertices([&](Ball& ball, const Vec3& r, std::size_t h) {
    ball.radius = std::max(ball.radius, (r - ball.center).norm());
    ball.reach = std::max(ball.reach, (r - bare_.rest[h]).norm());
  });
  const auto norms = [&](const float* rows, std::vector<double>& to) {
    for (std::size_t i = 0; i < k_; ++i) to.push_back(std::hypot(rows[i], rows[k_ + i], rows[2 * k_ + i]));
  };
  for (Index l = 0; l < bare_.handles; ++l) {
    norms(bare_.rotation_row(l, 0), turns_);
    for (Index h = 0; h < bare_.handles; ++h) norms(bare_.shift_row(l, h, 0), shifts_);
  }
  SkinPose pose(bare_);
  std::vector<double> unit(k_, 0.0);
  for (std::size_t i = 0; i < k_; ++i) {
    unit[i] = 1.0;
    pose.set(unit);
    for (std::size_t v = 0; v < influences.size(); ++v) {
      const Vec3 r = surface.rest[v].cast<double>(),
                 u = surface.basis.shape(static_cast<Index>(v), static_cast<Index>(i)).cast<double>();
      flexing_[i] = std::max(flexing_[i], (pose.undeformed_part(influences[v], r, u) - r).norm());
    }
    unit[i] = 0.0;
  }
}

/// From the body origin, by the balls where their handles have them. @param flexed |Ũ z|
double SkinExtent::farthest(const SkinPose& pose, double flexed) const {
  double most = 0.0;
  for (std::size_t h = 0; h < balls_.size(); ++h) {
    const SkinPose::Handle& handle = pose.handles()[h];
    const Vec3 center = balls_[h].center + handle.turn * balls_[h].center + handle.shift;
    if (balls_[h].used) most = std::max(most, center.norm() + balls_[h].radius);
  }
  return most + flexed;
}

double SkinExtent::find(const SkinPose& pose, SkinPose& bare, std::span<const double> z, std::span<const double> change,
                        std::span<double> shape, std::span<double> rates) const {
  bare.set(z);
  bare.differentiate();
  const double flexed = dot(flexing_, z), flexes = dot(flexing_, change);
  std::fill(shape.begin(), shape.end(), 0.0);
  const auto row = [&](const std::vector<double>& rows, Index block) {
    return std::span<const double>(rows).subspan(static_cast<std::size_t>(block) * k_, k_);
  };
  for (Index h = 0; h < bare_.handles; ++h) {
    const Ball& ball = balls_[static_cast<std::size_t>(h)];
    if (!ball.used) continue;
    const SkinPose::Handle& handle = bare.handles()[static_cast<std::size_t>(h)];
    const Vec3 center = ball.center + handle.turn * ball.center;
    const double own = dot(row(turns_, h), change), arm = ball.reach + flexed + flexes;
    for (std::size_t i = 0; i < k_; ++i) {
      const auto [turn_rate, shift_rate] = bare.rate(h, static_cast<Index>(i));
      rates[i] = (shift_rate + turn_rate.cross(center)).norm() + turn_rate.norm() * (ball.radius + flexed) +
                 flexing_[i] + turn(h, i) * (1.5 * own * arm + flexes) + own * flexing_[i];
    }
    for (Index l = 0; l < bare_.handles; ++l) {
      const std::span<const double> turn_l = row(turns_, l), D = row(shifts_, l * bare_.handles + h);
      const double turns = dot(turn_l, change), shifts = dot(D, change);
      const double by_turn = 1.5 * turns * (bare_.arm(l, h).norm() + dot(D, z) + shifts) + shifts;
      for (std::size_t i = 0; i < k_; ++i) rates[i] += turn_l[i] * by_turn + turns * D[i];
    }
    for (std::size_t i = 0; i < k_; ++i) shape[i] = std::max(shape[i], rates[i]);
  }
  const double far = farthest(pose, flexed);
  if (pose.skin().has_gauge()) keep_in_frame(pose.frame_stiffness(), far, change, shape);
  return far;
}

/// x̃ = Qᵀ (x − c): |∂_i c| is at most that of some point, and Eckart's rotation θ_i = M⁻¹ axial(Qᵀ Σ m ∂_i x rᵀ) with
/// M = (tr P) 1 − P, whose least eigenvalue falls by at most 2 |Δ Σ m x rᵀ|. However far that is, no point moves by
/// more than both its distances from the mass centre.
void SkinExtent::keep_in_frame(double firmness, double far, std::span<const double> change,
                               std::span<double> shape) const {
  const double moved = dot(shape, change), least = firmness - 2.0 * mean_radius_ * moved;
  const double most = 2.0 * (far + moved);
  double sum = 0.0, all = 0.0;
  for (std::size_t i = 0; i < shape.size(); ++i) {
    const double turns =
        least > 0.0 ? std::numbers::sqrt2 * mean_radius_ * shape[i] / least : std::numeric_limits<double>::infinity();
    shape[i] = 2.0 * shape[i] + turns * (far + 2.0 * moved);
    sum += shape[i] * change[i], all += change[i];
  }
  if (!(sum <= most)) std::fill(shape.begin(), shape.end(), all > 0.0 ? most / all : 0.0);
}

}  // namespace limber
