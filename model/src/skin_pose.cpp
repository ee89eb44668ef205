#include "limber/model/skin_pose.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "limber/core/exact_math.h"

namespace limber {
namespace {

using Moments = Eigen::Matrix<double, 3, 4>;

Mat3 cross_matrix(const Vec3& w) {
  Mat3 m;
  m << 0.0, -w.z(), w.y(), w.z(), 0.0, -w.x(), -w.y(), w.x(), 0.0;
  return m;
}

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

/// Three rows, axis after axis, of so many numbers.
template <class T>
struct Rows {
  T *x, *y, *z;
  Rows(T* first, std::size_t count) : x(first), y(first + count), z(first + 2 * count) {}
};

/// out += m in.
template <class T>
void add_product(const Mat3& m, const Rows<const T>& in, const Rows<double>& out, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    const double a = in.x[i], b = in.y[i], c = in.z[i];
    out.x[i] += m(0, 0) * a + m(0, 1) * b + m(0, 2) * c;
    out.y[i] += m(1, 0) * a + m(1, 1) * b + m(1, 2) * c;
    out.z[i] += m(2, 0) * a + m(2, 1) * b + m(2, 2) * c;
  }
}

/// out += vᵀ in.
template <class T>
void add_row(const Vec3& v, const Rows<const T>& in, double* out, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) out[i] += v.x() * in.x[i] + v.y() * in.y[i] + v.z() * in.z[i];
}

/// Eight sums side by side, so that a compiler may use vectors and the order is the same for all of them.
double dot(const float* a, std::span<const double> z) {
  double sum[8] = {};
  std::size_t i = 0;
  for (; i + 8 <= z.size(); i += 8)
    for (std::size_t j = 0; j < 8; ++j) sum[j] += static_cast<double>(a[i + j]) * z[i + j];
  for (std::size_t j = 0; i < z.size(); ++i, ++j) sum[j] += static_cast<double>(a[i]) * z[i];
  return ((sum[0] + sum[4]) + (sum[2] + sum[6])) + ((sum[1] + sum[5]) + (sum[3] + sum[7]));
}

}  // namespace

SkinPose::SkinPose(const ModalSkin& skin) : skin_(&skin), out_of_frame_(Mat3::Identity()), stretch_(Mat3::Identity()) {
  const auto n = static_cast<std::size_t>(skin.handles), k = static_cast<std::size_t>(skin.modes);
  handles_.resize(n);
  numbers_.resize(kNumbers * n);
  reach_.resize(n * n, Vec3::Zero());
  moments_ = skin.gauge.rest;
  turn_rates_.resize(3 * n * k);
  shift_rates_.resize(3 * n * k);
  drift_shapes_.resize(3 * n * k);
  for (Index h = 0; h < skin.handles; ++h) {
    const Rows<double> drift(drift_shapes_.data() + row(h, 0), k);
    for (Index l = 0; l < skin.handles; ++l) {
      add_product<float>(Mat3::Identity(), {skin.shift_row(l, h, 0), k}, drift, k);
      add_product<float>(-cross_matrix(skin.arm(l, h)), {skin.rotation_row(l, 0), k}, drift, k);
    }
    const Vec3& rest = skin.rest[static_cast<std::size_t>(h)];
    add_product<float>(cross_matrix(rest), {skin.rotation_row(h, 0), k}, drift, k);
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
  for (Index h = 0; h < s.handles; ++h) {
    Handle& handle = handles_[static_cast<std::size_t>(h)];
    for (int axis = 0; axis < 3; ++axis) handle.angle[axis] = dot(s.rotation_row(h, axis), z);
    handle.turn = turn_of(handle.angle);
  }
  for (Index h = 0; h < s.handles; ++h) {
    Handle& handle = handles_[static_cast<std::size_t>(h)];
    const Vec3& rest = s.rest[static_cast<std::size_t>(h)];
    handle.shift = -(handle.turn * rest);
    handle.drift = -handle.angle.cross(rest);
    for (Index l = 0; l < s.handles; ++l) {
      const Handle& other = handles_[static_cast<std::size_t>(l)];
      const Vec3 arm = s.arm(l, h);
      Vec3 stretch;
      for (int axis = 0; axis < 3; ++axis) stretch[axis] = dot(s.shift_row(l, h, axis), z);
      const Vec3 reach = arm + stretch;
      handle.shift += other.turn * reach + stretch;
      handle.drift += other.angle.cross(arm) + stretch;
      reach_[static_cast<std::size_t>(l * s.handles + h)] = reach;
    }
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
    add_row<double>(weight * f, {shift_rates_.data() + row(h, 0), k}, g.data(), k);
    add_row<double>(weight * carried.cross(f), {turn_rates_.data() + row(h, 0), k}, g.data(), k);
    add_row<double>(-weight * turned, {drift_shapes_.data() + row(h, 0), k}, g.data(), k);
    add_row<float>(-weight * rest.cross(turned), {skin_->rotation_row(h, 0), k}, g.data(), k);
  }
  return turned;
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
    add_product<float>(R * right_jacobian(handle.angle), {s.rotation_row(l, 0), k}, {turn_rates_.data() + row(l, 0), k},
                       k);
    for (Index h = 0; h < s.handles; ++h) {
      const Vec3 arm = R * reach_[static_cast<std::size_t>(l * s.handles + h)];
      const Rows<double> out(shift_rates_.data() + row(h, 0), k);
      add_product<float>(R, {s.shift_row(l, h, 0), k}, out, k);
      add_product<double>(-cross_matrix(arm), {turn_rates_.data() + row(l, 0), k}, out, k);
    }
    const Vec3& rest = s.rest[static_cast<std::size_t>(l)];
    add_product<double>(cross_matrix(R * rest), {turn_rates_.data() + row(l, 0), k},
                        {shift_rates_.data() + row(l, 0), k}, k);
  }
}

/// What c and Q take away: Qᵀ dQ = [dθ]× with ((tr P) 1 − P) dθ = axial(Qᵀ dA).
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
    const Vec3 angle = to_angle * axial(change.rightCols<3>() - centre * weight.tail<3>());
    for (std::size_t h = 0; h < handles_.size(); ++h) {
      column(turn_rates_, h) -= angle;
      column(shift_rates_, h) -= centre + angle.cross(handles_[h].shift);
    }
  }
}

}  // namespace limber
