#include "limber/model/skin_pose.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "limber/core/cross_matrix.h"
#include "limber/core/exact_math.h"
#include "skin_kernels.h"

namespace limber {
namespace {

using Moments = Eigen::Matrix<double, 3, 4>;

/// exp[w]× − 1, exact to round-off of itself for any |w|.
Mat3 turn_of(const Vec3& w) {
  const double y = w.squaredNorm();
  const Mat3 W = cross_matrix(w);
  return sinc(std::sqrt(y)) * W + stumpff_c2(y) * W * W;
}

/// ∂ exp[w]× = exp[w]× [J ∂w]×.
Mat3 right_jacobian(const Vec3& w) {
  const double y = w.squaredNorm();
  const Mat3 W = cross_matrix(w);
  return Mat3::Identity() - stumpff_c2(y) * W + stumpff_c3(y) * W * W;
}

Vec3 axial(const Mat3& m) { return {m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)}; }

/// The rotation Q that is nearest to A (largest tr QᵀA): Horn's quaternion, defined for any A.
Mat3 nearest_rotation(const Mat3& A) {
  const Vec3 a = axial(A);
  Eigen::Matrix4d N;
  N(0, 0) = A.trace();
  N.block<3, 1>(1, 0) = a;
  N.block<1, 3>(0, 1) = a.transpose();
  N.block<3, 3>(1, 1) = A + A.transpose() - A.trace() * Mat3::Identity();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(N);
  const Eigen::Vector4d q = eigen.eigenvectors().col(3);
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

/// Three rows of k numbers, times k numbers.
template <class T>
Vec3 product(const T* rows, std::span<const double> z) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t i = 0; i < z.size(); ++i) sum[static_cast<Index>(axis)] += rows[axis * z.size() + i] * z[i];
  return sum;
}

/// Three rows of k numbers: out += m in.
template <class T>
void add_product(const Mat3& m, const T* in, std::size_t k, double* out) {
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = m;
  internal::add_product(rows.data(), in, k, out);
}

}  // namespace

SkinPose::SkinPose(const ModalSkin& skin) { bind(skin); }

void SkinPose::bind(const ModalSkin& skin) {
  skin_ = &skin;
  out_of_frame_ = stretch_ = Mat3::Identity();
  centre_ = Vec3::Zero();
  const auto n = static_cast<std::size_t>(skin.handles), k = static_cast<std::size_t>(skin.modes);
  handles_.assign(n, {});
  numbers_.resize(kNumbers * n);
  reach_.resize(n * n, Vec3::Zero());
  moments_ = skin.gauge.rest;
  turn_rates_.resize(3 * n * k);
  shift_rates_.resize(3 * n * k);
  drift_shapes_.assign(3 * n * k, 0.0);
  frame_rates_.resize(skin.has_gauge() ? k : 0);
  for (Index h = 0; h < skin.handles; ++h) {
    double* drift = drift_shapes_.data() + row(h, 0);
    for (Index l = 0; l < skin.handles; ++l) {
      add_product(Mat3::Identity(), skin.shift_row(l, h, 0), k, drift);
      add_product(-cross_matrix(skin.arm(l, h)), skin.rotation_row(l, 0), k, drift);
    }
    add_product(cross_matrix(skin.rest[static_cast<std::size_t>(h)]), skin.rotation_row(h, 0), k, drift);
  }
}

std::size_t SkinPose::row(Index handle, int axis) const {
  return (std::size_t{3} * static_cast<std::size_t>(handle) + static_cast<std::size_t>(axis)) *
         static_cast<std::size_t>(skin_->modes);
}

void SkinPose::set(std::span<const double> z) {
  place_handles(z);
  if (skin_->has_gauge()) find_frame(z), stay_in_frame();
  write_numbers();
}

void SkinPose::write_numbers() {
  float* to = numbers_.data();
  for (const Handle& handle : handles_) {
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column) *to++ = static_cast<float>(handle.turn(row, column));
    for (const Vec3* v : {&handle.shift, &handle.angle, &handle.drift})
      for (int axis = 0; axis < 3; ++axis) *to++ = static_cast<float>((*v)[axis]);
  }
}

void SkinPose::place_handles(std::span<const double> z) {
  const ModalSkin& s = *skin_;
  const auto n = handles_.size();
  internal::rows_times(s.rotations.data(), 3 * n, z.size(), z.data(), reach_.data()->data());
  for (std::size_t h = 0; h < n; ++h) {
    Handle& handle = handles_[h];
    handle.angle = reach_[h];
    handle.turn = turn_of(handle.angle);
    handle.shift = -(handle.turn * s.rest[h]);
    handle.drift = -handle.angle.cross(s.rest[h]);
  }
  internal::rows_times(s.shifts.data(), 3 * n * n, z.size(), z.data(), reach_.data()->data());
  for (std::size_t l = 0; l < n; ++l)
    for (std::size_t h = 0; h < n; ++h) {
      const Vec3 arm = s.arm(static_cast<Index>(l), static_cast<Index>(h)), stretch = reach_[l * n + h];
      Vec3& reach = reach_[l * n + h];
      reach = arm + stretch;
      handles_[h].shift += handles_[l].turn * reach + stretch;
      handles_[h].drift += handles_[l].angle.cross(arm) + stretch;
    }
}

/// c, Q and P. Sums what differs from rest, so that a body at rest stays where it is.
void SkinPose::find_frame(std::span<const double> z) {
  const ModalSkin& s = *skin_;
  Moments change = Moments::Zero();
  Mat3 at_rest = Mat3::Zero();
  for (Index h = 0; h < s.handles; ++h) {
    const auto at = static_cast<std::size_t>(h);
    Moments stretch = Moments::Zero();
    for (std::size_t i = 0; i < z.size(); ++i)
      stretch += z[i] * Eigen::Map<const Moments>(s.gauge.shapes.data() + 12 * (at * z.size() + i));
    const Eigen::Map<const Moments> rest(s.gauge.rest.data() + 12 * at);
    const Moments now = rest + stretch;
    Eigen::Map<Moments>(moments_.data() + 12 * at) = now;
    const Eigen::Map<const Eigen::RowVector4d> weights(s.gauge.weights.data() + 4 * at);
    change += handles_[at].shift * weights + handles_[at].turn * now + stretch;
    at_rest += rest.rightCols<3>();
  }
  centre_ = change.col(0);
  const Mat3 moment = 0.5 * (at_rest + at_rest.transpose()) + change.rightCols<3>();
  out_of_frame_ = nearest_rotation(moment);
  stretch_ = out_of_frame_.transpose() * moment;
}

void SkinPose::stay_in_frame() {
  const Mat3 back = out_of_frame_.transpose();
  for (Handle& handle : handles_) {
    handle.turn = back * handle.turn + (back - Mat3::Identity());
    handle.shift = back * (handle.shift - centre_);
  }
}

double SkinPose::largest_angle() const {
  double most = 0.0;
  for (const Handle& handle : handles_) most = std::max(most, handle.angle.squaredNorm());
  return std::sqrt(most);
}

// Points ------------------------------------------------------------------------------------------------------------

/// r + u.
Vec3 SkinPose::undeformed_part(const SkinInfluences& at, const Vec3& rest, const Vec3& linear) const {
  Vec3 drift = Vec3::Zero(), angle = Vec3::Zero();
  for (std::size_t i = 0; i < SkinInfluences::kMost; ++i) {
    const Handle& handle = handles_[at.handle[i]];
    drift += static_cast<double>(at.weight[i]) * handle.drift;
    angle += static_cast<double>(at.weight[i]) * handle.angle;
  }
  return rest + (linear - drift - angle.cross(rest));
}

Vec3 SkinPose::position(const SkinInfluences& at, const Vec3& rest, const Vec3& linear) const {
  const Vec3 y = undeformed_part(at, rest, linear);
  Vec3 moved = Vec3::Zero();
  for (std::size_t i = 0; i < SkinInfluences::kMost; ++i) {
    const Handle& handle = handles_[at.handle[i]];
    moved += static_cast<double>(at.weight[i]) * (handle.turn * y + handle.shift);
  }
  return y + moved;
}

Mat3 SkinPose::turn(const SkinInfluences& at) const {
  Mat3 sum = Mat3::Identity();
  for (std::size_t i = 0; i < SkinInfluences::kMost; ++i)
    sum += static_cast<double>(at.weight[i]) * handles_[at.handle[i]].turn;
  return sum;
}

Vec3 SkinPose::add_rows(const SkinInfluences& at, const Vec3& rest, const Vec3& linear, const Vec3& f,
                        std::span<double> g) const {
  const Vec3 y = undeformed_part(at, rest, linear), turned = turn(at).transpose() * f;
  const std::size_t k = g.size();
  for (std::size_t i = 0; i < SkinInfluences::kMost; ++i) {
    const auto weight = static_cast<double>(at.weight[i]);
    if (weight == 0.0) continue;
    const Index h = at.handle[i];
    const Handle& handle = handles_[static_cast<std::size_t>(h)];
    const Vec3 carried = y + handle.turn * y;
    const Vec3 along[] = {weight * f, weight * carried.cross(f), -weight * turned, -weight * rest.cross(turned)};
    internal::add_row(along[0].data(), shift_rates_.data() + row(h, 0), k, g.data());
    internal::add_row(along[1].data(), turn_rates_.data() + row(h, 0), k, g.data());
    internal::add_row(along[2].data(), drift_shapes_.data() + row(h, 0), k, g.data());
    internal::add_row(along[3].data(), skin_->rotation_row(h, 0), k, g.data());
  }
  return turned;
}

Vec3 SkinPose::velocity(const SkinInfluences& at, const Vec3& rest, const Vec3& linear, const Vec3& linear_rate,
                        std::span<const double> rates) const {
  const Vec3 y = undeformed_part(at, rest, linear);
  Vec3 y_rate = linear_rate, moved = Vec3::Zero();
  Mat3 turned = Mat3::Identity();
  for (std::size_t i = 0; i < SkinInfluences::kMost; ++i) {
    const auto weight = static_cast<double>(at.weight[i]);
    if (weight == 0.0) continue;
    const Index h = at.handle[i];
    const Handle& handle = handles_[static_cast<std::size_t>(h)];
    const Vec3 angle_rate = product(skin_->rotation_row(h, 0), rates);
    y_rate -= weight * (product(drift_shapes_.data() + row(h, 0), rates) + angle_rate.cross(rest));
    turned += weight * handle.turn;
    moved += weight * (product(shift_rates_.data() + row(h, 0), rates) +
                       product(turn_rates_.data() + row(h, 0), rates).cross(y + handle.turn * y));
  }
  return turned * y_rate + moved;
}

SkinPose::Rate SkinPose::rate(Index handle, Index mode) const {
  const auto number = [&](const std::vector<double>& rows, int axis) {
    return rows[row(handle, axis) + static_cast<std::size_t>(mode)];
  };
  return {{number(turn_rates_, 0), number(turn_rates_, 1), number(turn_rates_, 2)},
          {number(shift_rates_, 0), number(shift_rates_, 1), number(shift_rates_, 2)}};
}

// Derivative --------------------------------------------------------------------------------------------------------

void SkinPose::differentiate() {
  differentiate_places();
  if (skin_->has_gauge()) differentiate_frame();
}

/// In the axes that stay_in_frame() turned to, as if Q did not change.
void SkinPose::differentiate_places() {
  const ModalSkin& s = *skin_;
  const auto k = static_cast<std::size_t>(s.modes);
  std::fill(turn_rates_.begin(), turn_rates_.end(), 0.0);
  std::fill(shift_rates_.begin(), shift_rates_.end(), 0.0);
  for (Index l = 0; l < s.handles; ++l) {
    const Handle& handle = handles_[static_cast<std::size_t>(l)];
    const Mat3 R = Mat3::Identity() + handle.turn;
    double* turn = turn_rates_.data() + row(l, 0);
    add_product(R * right_jacobian(handle.angle), s.rotation_row(l, 0), k, turn);
    for (Index h = 0; h < s.handles; ++h) {
      const Vec3 arm = R * reach_[static_cast<std::size_t>(l * s.handles + h)];
      double* shift = shift_rates_.data() + row(h, 0);
      add_product(R, s.shift_row(l, h, 0), k, shift);
      add_product(-cross_matrix(arm), turn, k, shift);
    }
    add_product(cross_matrix(R * s.rest[static_cast<std::size_t>(l)]), turn, k, shift_rates_.data() + row(l, 0));
  }
}

/// The part that c and Q take away: Qᵀ dQ = [dθ]× with ((tr P) 1 − P) dθ = axial(Qᵀ dA).
void SkinPose::differentiate_frame() {
  const ModalSkin& s = *skin_;
  const auto k = static_cast<std::size_t>(s.modes);
  const Mat3 to_angle = (stretch_.trace() * Mat3::Identity() - stretch_).inverse();
  for (std::size_t i = 0; i < k; ++i) {
    const auto column = [&](std::vector<double>& rows, std::size_t h) {
      return Eigen::Map<Vec3, 0, Eigen::InnerStride<>>(rows.data() + 3 * h * k + i,
                                                       Eigen::InnerStride<>(static_cast<Eigen::Index>(k)));
    };
    Moments change = Moments::Zero();
    Eigen::RowVector4d weight = Eigen::RowVector4d::Zero();
    for (std::size_t h = 0; h < handles_.size(); ++h) {
      const Mat3 R = Mat3::Identity() + handles_[h].turn;
      const Moments carried = R * Eigen::Map<const Moments>(moments_.data() + 12 * h);
      const Eigen::Map<const Eigen::RowVector4d> weights(s.gauge.weights.data() + 4 * h);
      change += column(shift_rates_, h) * weights + cross_matrix(column(turn_rates_, h)) * carried +
                R * Eigen::Map<const Moments>(s.gauge.shapes.data() + 12 * (h * k + i));
      weight += weights;
    }
    const Vec3 centre = change.col(0);
    const Mat3 moment = change.rightCols<3>() - centre * weight.tail<3>();
    const Vec3 angle = to_angle * axial(moment);
    frame_rates_[i] = {angle, centre, moment};
    for (std::size_t h = 0; h < handles_.size(); ++h) {
      column(turn_rates_, h) -= angle;
      column(shift_rates_, h) -= centre + angle.cross(handles_[h].shift);
    }
  }
}

}  // namespace limber
