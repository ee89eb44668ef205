#include "limber/solvers/row_equilibrium.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dense_kernels.h"
#include "tuning.h"

namespace limber::internal {
namespace {

using Vec4 = Eigen::Vector4d;
using Mat4 = Eigen::Matrix4d;

Vec3 part_of(std::span<const double> v, std::size_t first, std::size_t rows) {
  Vec3 part = Vec3::Zero();
  for (std::size_t r = 0; r < rows; ++r) part[static_cast<int>(r)] = v[first + r];
  return part;
}

// The Jordan algebra of the second-order cone x₀ ≥ |x₁| (Alizadeh and Goldfarb, Math. Programming 95 (2003) 3).

double determinant(const Vec4& x) {
  const double across = x.tail<3>().norm();
  return (x[0] - across) * (x[0] + across);
}

Vec4 jordan_product(const Vec4& a, const Vec4& b) {
  Vec4 product;
  product << a.dot(b), a[0] * b.tail<3>() + b[0] * a.tail<3>();
  return product;
}

/// y of λ ∘ y = right.
Vec4 jordan_quotient(const Vec4& lambda, const Vec4& right) {
  const double first = (lambda[0] * right[0] - lambda.tail<3>().dot(right.tail<3>())) / determinant(lambda);
  Vec4 y;
  y << first, (right.tail<3>() - first * lambda.tail<3>()) / lambda[0];
  return y;
}

/// The largest t with x + t d in the cone, x within it.
double longest_step_in_cone(const Vec4& x, const Vec4& d) {
  double t = d[0] < 0.0 ? -x[0] / d[0] : kUnbounded;
  const double a = d[0] * d[0] - d.tail<3>().squaredNorm(), b = x[0] * d[0] - x.tail<3>().dot(d.tail<3>()),
               c = determinant(x), inside = b * b - a * c;
  if (!(inside >= 0.0)) return t;
  const double q = -(b + std::copysign(std::sqrt(inside), b));
  for (const double root : {q / a, c / q})
    if (root > 0.0) t = std::min(t, root);
  return t;
}

/// η Q(w): the scaling that takes x to λ and λ to z. @param sign −1: its inverse times η²
Mat4 scaling_by(const Vec4& w, double sign) {
  Mat4 V;
  V(0, 0) = w[0];
  V.block<1, 3>(0, 1) = sign * w.tail<3>().transpose();
  V.block<3, 1>(1, 0) = sign * w.tail<3>();
  V.block<3, 3>(1, 1) = Mat3::Identity() + w.tail<3>() * w.tail<3>().transpose() / (1.0 + w[0]);
  return V;
}

}  // namespace

void RowEquilibrium::clear() {
  units_.clear();
  size_ = 0;
}

void RowEquilibrium::add_unit(std::size_t rows, const ContactPotential& set, double tolerance) {
  units_.push_back({.first = size_, .rows = rows, .set = set, .tolerance = tolerance});
  size_ += rows;
}

/// So that impulses move their own units by about 1; bounds stay what they are, to the bit.
void RowEquilibrium::set_matrix(std::span<const double> W) {
  const std::size_t n = size_;
  W_.assign(W.begin(), W.end());
  for (Unit& unit : units_) {
    unit.scale = inverse_power_of_two(std::sqrt(unit.set.compliance));
    unit.tolerance *= unit.scale;
    unit.set.compliance = 1.0;
    unit.set.lower /= unit.scale, unit.set.upper /= unit.scale;
    if (unit.set.set == ContactPotential::Set::kBall) unit.set.bound /= unit.scale;
    for (std::size_t r = unit.first; r < unit.first + unit.rows; ++r)
      for (std::size_t j = 0; j < n; ++j) W_[r * n + j] *= unit.scale, W_[j * n + r] *= unit.scale;
  }
}

double RowEquilibrium::solve(std::span<const double> b, std::span<double> f) {
  constexpr const EquilibriumTuning& tuning = kSolversTuning.equilibrium;
  to_scale(b);
  for (const Unit& unit : units_)
    for (std::size_t r = unit.first; r < unit.first + unit.rows; ++r) f_[r] = f[r] / unit.scale;
  double best = kUnbounded;
  for (int i = 0; i <= tuning.most_steps; ++i) {
    const double left = take_nearest();
    if (i == 0) begin_pairs();
    if (!(left >= best)) {
      best = left;
      for (const Unit& unit : units_)
        for (std::size_t r = unit.first; r < unit.first + unit.rows; ++r) f[r] = unit.scale * near_[r];
    }
    if (best <= tuning.met || !factor()) break;
    find_direction({});
    const double all = product(), reached = all > 0.0 ? product_after(std::min(1.0, longest_step())) / all : 0.0;
    find_direction(
        {.centring = std::clamp(reached * reached * reached, tuning.least_centring, 1.0), .corrected = true});
    const double step = std::min(1.0, tuning.part_of_longest * longest_step());
    if (!(step > 0.0)) break;
    take_step(step);
  }
  return best;
}

void RowEquilibrium::solve(const IntervalRows& rows, std::span<double> f) {
  const std::size_t m = rows.b.size(), n = rows.dimension;
  A_.resize(m * m);
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j < m; ++j) {
      double sum = i == j && !rows.D.empty() ? rows.D[i] : 0.0;
      for (std::size_t k = 0; k < n; ++k) sum += rows.G[i * n + k] * rows.G[j * n + k];
      A_[i * m + j] = sum;
    }
  double size = 0.0;  // of the largest gap, as a length of b in the metric of W
  for (std::size_t i = 0; i < m; ++i)
    if (const double moved = A_[i * (m + 1)]; moved > 0.0)
      size = std::max(size, std::abs(rows.b[i]) / std::sqrt(moved));
  clear();
  for (std::size_t i = 0; i < m; ++i) {
    const double moved = A_[i * (m + 1)], rest = std::clamp(0.0, rows.lower[i], rows.upper[i]);
    ContactPotential set{.set = ContactPotential::Set::kInterval,
                         .compliance = moved > 0.0 ? moved : 1.0,
                         .lower = moved > 0.0 ? rows.lower[i] : rest,
                         .upper = moved > 0.0 ? rows.upper[i] : rest};
    add_unit(1, set,
             std::max(kSolversTuning.equilibrium.digits * size * std::sqrt(set.compliance),
                      std::numeric_limits<double>::min()));
  }
  set_matrix(A_);
  solve(rows.b, f);
}

void RowEquilibrium::to_scale(std::span<const double> b) {
  for (std::vector<double>* v : {&b_, &f_, &near_, &gap_, &left_, &change_}) v->resize(size_);
  for (const Unit& unit : units_)
    for (std::size_t r = unit.first; r < unit.first + unit.rows; ++r) b_[r] = unit.scale * b[r];
}

/// Sets of one impulse.
bool RowEquilibrium::is_fixed(const Unit& unit) const {
  using Set = ContactPotential::Set;
  return (unit.set.set == Set::kBall && unit.set.bound == 0.0) ||
         (unit.set.set == Set::kInterval && unit.set.lower == unit.set.upper);
}

bool RowEquilibrium::is_free(const Unit& unit) const {
  return unit.set.set == ContactPotential::Set::kInterval && unit.set.lower == -kUnbounded &&
         unit.set.upper == kUnbounded;
}

void RowEquilibrium::place_pairs() {
  using Set = ContactPotential::Set;
  bounds_.clear(), discs_.clear();
  fixed_.assign(size_, 0);
  for (const Unit& unit : units_) {
    if (is_fixed(unit)) {
      std::fill_n(fixed_.begin() + static_cast<std::ptrdiff_t>(unit.first), unit.rows, char{1});
    } else if (unit.set.set == Set::kCone) {
      bounds_.push_back({.row = unit.first});
      discs_.push_back({.first = unit.first + 1, .friction = unit.set.bound});
    } else if (unit.set.set == Set::kBall) {
      discs_.push_back({.first = unit.first, .rows = 3, .radius = unit.set.bound});
    } else {
      if (unit.set.lower > -kUnbounded) bounds_.push_back({.row = unit.first, .bound = unit.set.lower});
      if (unit.set.upper < kUnbounded) bounds_.push_back({.row = unit.first, .side = -1.0, .bound = unit.set.upper});
    }
  }
}

/// In the middle of the sets as far as these are narrow, else as far within as gaps are large; all products alike.
void RowEquilibrium::begin_pairs() {
  place_pairs();
  double size = 0.0;
  for (const double gap : b_) size = std::max(size, std::abs(gap));
  if (!(size > 0.0)) size = 1.0;
  for (const Unit& unit : units_) {
    std::fill_n(f_.begin() + static_cast<std::ptrdiff_t>(unit.first), unit.rows, 0.0);
    const ContactPotential& set = unit.set;
    double& f = f_[unit.first];
    if (set.set == ContactPotential::Set::kCone) f = size;
    if (set.set != ContactPotential::Set::kInterval) continue;
    const double half = 0.5 * (set.upper - set.lower);
    if (set.lower > -kUnbounded)
      f = set.lower + std::min(size, half);
    else if (set.upper < kUnbounded)
      f = set.upper - size;
  }
  for (Bound& bound : bounds_) {
    bound.x = bound.side * (f_[bound.row] - bound.bound);
    bound.z = size * size / bound.x;
  }
  for (Disc& disc : discs_) {
    disc.x = Vec4::UnitX() * (disc.radius + (disc.friction > 0.0 ? disc.friction * size : 0.0));
    disc.z = Vec4::UnitX() * (size * size / disc.x[0]);
  }
}

double RowEquilibrium::product() const {
  double sum = 0.0;
  for (const Bound& bound : bounds_) sum += bound.x * bound.z;
  for (const Disc& disc : discs_) sum += disc.x.dot(disc.z);
  return sum;
}

double RowEquilibrium::product_after(double step) const {
  double sum = 0.0;
  for (const Bound& b : bounds_) sum += (b.x + step * b.dx) * (b.z + step * b.dz);
  for (const Disc& d : discs_) sum += (d.x + step * d.dx).dot(d.z + step * d.dz);
  return sum;
}

/// W and what the pairs yield, after what they leave of u = b + W f. @return false where digits end
bool RowEquilibrium::factor() {
  const std::size_t pairs = bounds_.size() + discs_.size();
  level_ = pairs > 0 ? product() / static_cast<double>(pairs) : 0.0;
  find_gaps(f_);
  for (std::size_t i = 0; i < size_; ++i) left_[i] = -gap_[i];
  A_.assign(W_.begin(), W_.end());
  for (const Unit& unit : units_)
    if (is_free(unit)) A_[unit.first * (size_ + 1)] += kSolversTuning.equilibrium.yield;
  for (const Bound& bound : bounds_) {
    A_[bound.row * (size_ + 1)] += bound.z / bound.x;
    left_[bound.row] += bound.side * bound.z;
  }
  for (Disc& disc : discs_) {
    const double x = std::sqrt(determinant(disc.x)), z = std::sqrt(determinant(disc.z));
    if (!(x > 0.0 && z > 0.0)) return false;
    Vec4 w = disc.z / z + disc.x / x;
    w.tail<3>() -= 2.0 / x * disc.x.tail<3>();
    w /= std::sqrt(2.0 * (1.0 + disc.x.dot(disc.z) / (x * z)));
    disc.scaling = std::sqrt(z / x) * scaling_by(w, 1.0);
    disc.inverse = std::sqrt(x / z) * scaling_by(w, -1.0);
    const Mat4 yields = disc.scaling * disc.scaling;
    for (std::size_t r = 0; r < disc.rows; ++r) {
      const std::size_t row = disc.first + r;
      const auto axis = static_cast<int>(r + 1);
      left_[row] += disc.z[axis];
      if (disc.friction > 0.0) A_[row * size_ + disc.first - 1] += disc.friction * yields(axis, 0);
      for (std::size_t c = 0; c < disc.rows; ++c)
        A_[row * size_ + disc.first + c] += yields(axis, static_cast<int>(c + 1));
    }
  }
  for (std::size_t i = 0; i < size_; ++i) {
    if (fixed_[i] == 0) continue;
    std::fill_n(A_.begin() + static_cast<std::ptrdiff_t>(i * size_), size_, 0.0);
    A_[i * (size_ + 1)] = 1.0, left_[i] = 0.0;
  }
  return factor_.factor(A_, size_);
}

/// Newton's step to products of `centring` ν. With one before it, also against what that leaves of second order.
void RowEquilibrium::find_direction(const Direction& to) {
  const double aim = to.centring * level_;
  change_ = left_;
  for (Bound& b : bounds_) {
    b.aim = (aim - b.x * b.z - (to.corrected ? b.dx * b.dz : 0.0)) / b.x;
    change_[b.row] += b.side * b.aim;
  }
  for (Disc& d : discs_) {
    const Vec4 lambda = d.scaling * d.x;
    Vec4 right = aim * Vec4::UnitX() - jordan_product(lambda, lambda);
    if (to.corrected) right -= jordan_product(d.scaling * d.dx, d.inverse * d.dz);
    d.aim = d.scaling * jordan_quotient(lambda, right);
    for (std::size_t r = 0; r < d.rows; ++r) change_[d.first + r] += d.aim[static_cast<int>(r + 1)];
  }
  for (std::size_t i = 0; i < size_; ++i)
    if (fixed_[i] != 0) change_[i] = 0.0;
  factor_.solve(change_, 1);
  for (Bound& b : bounds_) {
    b.dx = b.side * change_[b.row];
    b.dz = b.aim - b.z / b.x * b.dx;
  }
  for (Disc& d : discs_) {
    d.dx = disc_change(d);
    d.dz = d.aim - d.scaling * (d.scaling * d.dx);
  }
}

Vec4 RowEquilibrium::disc_change(const Disc& disc) const {
  Vec4 change = Vec4::Zero();
  if (disc.friction > 0.0) change[0] = disc.friction * change_[disc.first - 1];
  for (std::size_t r = 0; r < disc.rows; ++r) change[static_cast<int>(r + 1)] = change_[disc.first + r];
  return change;
}

double RowEquilibrium::longest_step() const {
  double step = kUnbounded;
  for (const Bound& b : bounds_) {
    if (b.dx < 0.0) step = std::min(step, -b.x / b.dx);
    if (b.dz < 0.0) step = std::min(step, -b.z / b.dz);
  }
  for (const Disc& d : discs_)
    step = std::min({step, longest_step_in_cone(d.x, d.dx), longest_step_in_cone(d.z, d.dz)});
  return all_finite(change_.data(), size_) ? step : 0.0;
}

void RowEquilibrium::take_step(double step) {
  for (std::size_t i = 0; i < size_; ++i) f_[i] += step * change_[i];
  for (Bound& b : bounds_) b.x += step * b.dx, b.z += step * b.dz;
  for (Disc& d : discs_) d.x += step * d.dx, d.z += step * d.dz;
}

/// The impulses of the sets that the law makes of those at hand: what is next to a bound comes to it. @return what they
/// leave of the law, by tolerance
double RowEquilibrium::take_nearest() {
  const auto nearest = [&](const Unit& unit, std::span<const double> f) {
    Vec3 open = part_of(gap_, unit.first, unit.rows);
    if (unit.set.set == ContactPotential::Set::kCone) open[0] += unit.set.bound * open.tail<2>().norm();
    return unit.set.natural(open, part_of(f, unit.first, unit.rows));
  };
  find_gaps(f_);
  for (const Unit& unit : units_) {
    const Vec3 F = nearest(unit, f_);
    for (std::size_t r = 0; r < unit.rows; ++r) near_[unit.first + r] = F[static_cast<int>(r)];
  }
  find_gaps(near_);
  double left = 0.0;
  for (const Unit& unit : units_)
    left = std::max(left, (nearest(unit, near_) - part_of(near_, unit.first, unit.rows)).norm() / unit.tolerance);
  return left;
}

void RowEquilibrium::find_gaps(std::span<const double> f) {
  for (std::size_t i = 0; i < size_; ++i) {
    gap_[i] = b_[i];
    for (std::size_t j = 0; j < size_; ++j) gap_[i] += W_[i * size_ + j] * f[j];
  }
}

}  // namespace limber::internal
