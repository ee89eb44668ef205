#include "cone_splitting.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "coulomb_contact.h"

namespace limber {
namespace {

// Of (1), for rows scaled to A_ii = 1. With a tenth as much blows take several times as long to go through a pile, with
// ten times as much loads at rest do.
constexpr double kRho = 0.1;
constexpr double kRelaxation = 1.6;  // α

void put(const Vec3& v, double* to) { std::copy_n(v.data(), 3, to); }

}  // namespace

void ConeSplitting::begin(const BoundedRows& rows, RowCoupling& coupling) {
  rows_ = rows, coupling_ = &coupling;
  cones_ = static_cast<std::size_t>(rows.cones), n_ = coupling.rows();
  factored_ = false;
  double** vectors[] = {&b_, &x_, &z_, &f_};
  const std::size_t stride = padded(n_);
  double* next = memory_.need(std::size(vectors) * stride);
  std::fill_n(next, std::size(vectors) * stride, 0.0);
  for (double** vector : vectors) *vector = next, next += stride;
  scale_rows();
  make_force_sets(rows.friction.first(cones_), rows.radius, scale_, sets_);
}

void ConeSplitting::scale_rows() {
  scale_.resize(n_);
  for (std::size_t i = 0, count = 1; i < n_; i += count) {
    count = i < 3 * cones_ ? 3 : 1;
    const double a = coupling_->own_block(i, count).trace() / static_cast<double>(count);
    std::fill_n(scale_.begin() + static_cast<std::ptrdiff_t>(i), count, a > 0.0 ? std::sqrt(a) : 1.0);
  }
}

/// In scaled numbers, like all of iterate().
double ConeSplitting::clamped(std::size_t row, double force) const {
  return std::clamp(force, rows_.lower[row] * scale_[row], rows_.upper[row] * scale_[row]);
}

void ConeSplitting::project(const double* from, double* to) const {
  for (std::size_t i = 0; i < cones_; ++i) put(sets_[i].project(triple(from + 3 * i)), to + 3 * i);
  for (std::size_t i = 3 * cones_; i < n_; ++i) to[i] = clamped(i, from[i]);
}

double ConeSplitting::residual(std::span<const double> f, std::span<const double> w,
                               std::span<const double> unit) const {
  if (!all_finite(f.data(), n_) || !all_finite(w.data(), n_)) return std::numeric_limits<double>::infinity();
  double worst = 0.0;
  for (std::size_t i = 0; i < cones_; ++i) {
    const double s = scale_[3 * i];
    const Vec3 force = s * triple(&f[3 * i]), velocity = triple(&w[3 * i]) / s;
    const double off = (force - sets_[i].project(force - corrected_velocity(velocity, sets_[i].mu))).norm();
    worst = std::max(worst, s * off / unit[3 * i]);
  }
  for (std::size_t i = 3 * cones_; i < n_; ++i) {
    const double s = scale_[i], force = s * f[i];
    const double off = force - clamped(i, force - w[i] / s);
    worst = std::max(worst, s * std::abs(off) / unit[i]);
  }
  return worst;
}

void ConeSplitting::units_of(std::span<const double> b, std::vector<double>& unit) const {
  double size = 0.0;
  for (std::size_t i = 0; i < cones_; ++i) size = std::max(size, triple(&b[3 * i]).norm() / scale_[3 * i]);
  for (std::size_t i = 3 * cones_; i < n_; ++i) size = std::max(size, std::abs(b[i]) / scale_[i]);
  if (size == 0.0) size = 1.0;  // nothing moves
  unit.resize(n_);
  for (std::size_t i = 0; i < n_; ++i) unit[i] = size * scale_[i];
}

bool ConeSplitting::advance(std::span<const double> b, int iterations, std::span<double> f) {
  for (std::size_t i = 0; i < n_; ++i) b_[i] = b[i] / scale_[i];
  coupling_->scale(scale_);
  if (!factored_) {
    if (!coupling_->factor_shifted(kRho)) return false;
    start(f);
    factored_ = true;
  }
  for (int i = 0; i < iterations; ++i) iterate();
  project(x_, z_);
  for (std::size_t i = 0; i < n_; ++i) f[i] = z_[i] / scale_[i];
  return true;
}

/// x such that z = f and −y = û(f), if f is within the cones.
void ConeSplitting::start(std::span<const double> f) {
  for (std::size_t i = 0; i < n_; ++i) x_[i] = f[i] * scale_[i];
  project(x_, z_);
  coupling_->multiply(f_, z_);
  for (std::size_t i = 0; i < n_; ++i) f_[i] += b_[i];
  for (std::size_t i = 0; i < cones_; ++i) put(corrected_velocity(triple(f_ + 3 * i), sets_[i].mu), f_ + 3 * i);
  for (std::size_t i = 0; i < n_; ++i) x_[i] = z_[i] - f_[i] / kRho;
}

void ConeSplitting::iterate() {
  for (std::size_t i = 0; i < cones_; ++i) {
    const Vec3 x = triple(x_ + 3 * i), z = sets_[i].project(x), y = kRho * (x - z);
    put(z, z_ + 3 * i);
    put(kRho * z - triple(b_ + 3 * i) - corrected_velocity(y, sets_[i].mu), f_ + 3 * i);
  }
  for (std::size_t i = 3 * cones_; i < n_; ++i) {
    z_[i] = clamped(i, x_[i]);
    f_[i] = kRho * (2.0 * z_[i] - x_[i]) - b_[i];
  }
  coupling_->solve_shifted(f_);
  for (std::size_t i = 0; i < n_; ++i) x_[i] += kRelaxation * (f_[i] - z_[i]);
}

}  // namespace limber
