#include "limber/dynamics/skin_extent.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "limber/core/cross_matrix.h"
#include "limber/dynamics/body_shape.h"

namespace limber {
namespace {

double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * std::abs(b[i]);
  return sum;
}

double largest_stretch(const Mat3& m) {
  return std::sqrt(Mat3(m.transpose() * m).selfadjointView<Eigen::Lower>().eigenvalues()[2]);
}

Mat3 symmetric_part(const Mat3& m) { return 0.5 * (m + m.transpose()); }

/// Map of a couple to a turn about the mass centre, for C = Σ m r rᵀ: (tr C) 1 − C.
Mat3 inertia_of(const Mat3& moment) { return moment.trace() * Mat3::Identity() - moment; }

}  // namespace

SkinExtent::SkinExtent(const ModalModel& model)
    : skin_(&*model.data().skin),
      k_(static_cast<std::size_t>(model.modes())),
      balls_(static_cast<std::size_t>(skin_->handles)),
      flexing_(k_, 0.0) {
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
    ball.reach = std::max(ball.reach, (r - skin_->rest[h]).norm());
  });
  const auto norms = [&](const float* rows, std::vector<double>& to) {
    for (std::size_t i = 0; i < k_; ++i) to.push_back(std::hypot(rows[i], rows[k_ + i], rows[2 * k_ + i]));
  };
  for (Index l = 0; l < skin_->handles; ++l) {
    norms(skin_->rotation_row(l, 0), turns_);
    for (Index h = 0; h < skin_->handles; ++h) norms(skin_->shift_row(l, h, 0), shifts_);
  }
  SkinPose pose(*skin_);
  if (skin_->has_gauge()) {
    pose.set(std::vector<double>(k_, 0.0));
    const Mat3 moment = symmetric_part(pose.frame_moment());
    const Eigen::SelfAdjointEigenSolver<Mat3> inertia(inertia_of(moment));
    root_moment_ = Eigen::SelfAdjointEigenSolver<Mat3>(moment).operatorSqrt();
    turned_ = inertia.operatorInverseSqrt();
    thinnest_ = std::sqrt(inertia.eigenvalues()[0]);
  }
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

/// sup ‖[x]× J^−½‖ over the balls: what a couple of size 1 does to a point at most.
double SkinExtent::farthest_over_turns(const SkinPose& pose, double flexed) const {
  double most = 0.0;
  for (std::size_t h = 0; h < balls_.size(); ++h) {
    if (!balls_[h].used) continue;
    const SkinPose::Handle& handle = pose.handles()[h];
    const Vec3 center = balls_[h].center + handle.turn * balls_[h].center + handle.shift;
    most = std::max(most, largest_stretch(cross_matrix(center) * turned_) + balls_[h].radius / thinnest_);
  }
  return most + flexed / thinnest_;
}

/// Σ_j |∂_ij x| change_j over the vertices of a handle, before a free body is put into its frame; the most goes to
/// `out`.
void SkinExtent::find_curvature(Index h, std::span<const double> z, std::span<const double> change,
                                std::span<double> out, std::span<double> sums) const {
  const auto row = [&](const std::vector<double>& rows, Index block) {
    return std::span<const double>(rows).subspan(static_cast<std::size_t>(block) * k_, k_);
  };
  const std::span<const double> turn_h = row(turns_, h);
  const double own = dot(turn_h, change), flexes = dot(flexing_, change);
  const double arm = balls_[static_cast<std::size_t>(h)].reach + dot(flexing_, z) + flexes;
  for (std::size_t i = 0; i < k_; ++i) sums[i] = turn_h[i] * (1.5 * own * arm + flexes) + own * flexing_[i];
  for (Index l = 0; l < skin_->handles; ++l) {
    const std::span<const double> turn_l = row(turns_, l), D = row(shifts_, l * skin_->handles + h);
    const double turns = dot(turn_l, change), shifts = dot(D, change);
    const double by_turn = 1.5 * turns * (skin_->arm(l, h).norm() + dot(D, z) + shifts) + shifts;
    for (std::size_t i = 0; i < k_; ++i) sums[i] += turn_l[i] * by_turn + turns * D[i];
  }
  for (std::size_t i = 0; i < k_; ++i) out[i] = std::max(out[i], sums[i]);
}

double SkinExtent::find(const SkinPose& pose, std::span<const double> z, std::span<const double> change,
                        std::span<double> shape, std::span<double> scratch) const {
  const std::span<double> curvatures = scratch.first(k_), free_rates = scratch.subspan(k_, k_);
  const std::span<double> sums = scratch.subspan(2 * k_, k_);
  const bool free = skin_->has_gauge();
  const double flexed = dot(flexing_, z);
  std::fill(shape.begin(), shape.end(), 0.0);
  std::fill(scratch.begin(), scratch.end(), 0.0);
  for (Index h = 0; h < skin_->handles; ++h) {
    const Ball& ball = balls_[static_cast<std::size_t>(h)];
    if (!ball.used) continue;
    find_curvature(h, z, change, curvatures, sums);
    const SkinPose::Handle& handle = pose.handles()[static_cast<std::size_t>(h)];
    const Vec3 center = ball.center + handle.turn * ball.center;
    const auto fastest = [&](const Vec3& turn, const Vec3& shift, std::size_t i) {
      return (shift + turn.cross(center)).norm() + turn.norm() * (ball.radius + flexed) + flexing_[i];
    };
    for (std::size_t i = 0; i < k_; ++i) {
      const auto [turn_rate, shift_rate] = pose.rate(h, static_cast<Index>(i));
      shape[i] = std::max(shape[i], fastest(turn_rate, shift_rate, i));
      if (!free) continue;
      const Vec3& frame = pose.frame_rate(static_cast<Index>(i)).turn;
      free_rates[i] = std::max(free_rates[i], fastest(turn_rate + frame, shift_rate + frame.cross(handle.shift), i));
    }
  }
  const double far = farthest(pose, flexed);
  if (free)
    keep_in_frame(pose, flexed, far, change, scratch, shape);
  else
    for (std::size_t i = 0; i < k_; ++i) shape[i] += curvatures[i];
  return far;
}

/// From rates now to rates of all amplitudes within reach; derivation: docs/derivations/modal-skin.md, section 6.
/// However far that is, no point moves by more than both its distances from the mass centre.
void SkinExtent::keep_in_frame(const SkinPose& pose, double flexed, double far, std::span<const double> change,
                               std::span<const double> scratch, std::span<double> shape) const {
  const std::span<const double> curvatures = scratch.first(k_), free_rates = scratch.subspan(k_, k_);
  const Mat3 P = symmetric_part(pose.frame_moment()), inverse = P.inverse();
  double curved = 0.0, B = 0.0, narrowed = 0.0, all = 0.0;
  for (std::size_t i = 0; i < k_; ++i) {
    curved += curvatures[i] * change[i], all += change[i];
    B += (free_rates[i] + 2.0 * curvatures[i]) * change[i];
    narrowed += symmetric_part(pose.frame_rate(static_cast<Index>(i)).moment * inverse).norm() * change[i];
  }
  narrowed += 0.5 * curved * largest_stretch(root_moment_ * inverse);
  const double firmness = Mat3(turned_ * inertia_of(P) * turned_).selfadjointView<Eigen::Lower>().eigenvalues()[0];
  const double m = firmness * (1.0 - narrowed), most = 2.0 * (far + B);
  double sum = std::numeric_limits<double>::infinity();
  if (narrowed < 1.0) {
    double reach = farthest_over_turns(pose, flexed);
    reach += (m + reach) * std::expm1(B / (m * thinnest_));
    const double growth = 1.0 + reach / m, turned = (B + growth * B) / (m * thinnest_);
    sum = 0.0;
    for (std::size_t i = 0; i < k_; ++i) {
      const double rate = free_rates[i] + 2.0 * curvatures[i], turning = turned * rate;
      shape[i] =
          std::min(growth * rate, shape[i] + 2.0 * curvatures[i] + reach / m * (curvatures[i] + turning) + turning);
      sum += shape[i] * change[i];
    }
  }
  if (!(sum <= most)) std::fill(shape.begin(), shape.end(), all > 0.0 ? most / all : 0.0);
}

}  // namespace limber
