#include "sparse_coupling.h"

#include <algorithm>

namespace limber {
namespace {

/// (1 − P' + P'/ρ)⁻¹ − 1, by the eigenvectors of P', which keeps the digits where ρ is large.
Mat3 inverse_change(const ProjectionDerivative& P, double rho) {
  Mat3 change = Mat3::Zero();
  for (std::size_t c = 0; c < P.columns; ++c) {
    const double part = P.s[c].squaredNorm();
    if (part > 0.0) change += (1.0 / (1.0 - part + part / rho) - 1.0) / part * P.s[c] * P.s[c].transpose();
  }
  return change;
}

}  // namespace

void SparseCoupling::begin_structure() {
  rows_ = numbers_ = 0;
  widths_.clear(), unit_of_.clear(), units_.clear(), sides_.clear();
}

std::size_t SparseCoupling::add_node(std::size_t width) {
  widths_.push_back(width);
  return widths_.size() - 1;
}

void SparseCoupling::add_unit(std::size_t rows) {
  units_.push_back({.first = rows_, .rows = rows, .first_side = sides_.size()});
  for (std::size_t i = 0; i < rows; ++i) unit_of_.push_back(units_.size() - 1);
  rows_ += rows;
}

std::size_t SparseCoupling::add_side(std::size_t node) {
  sides_.push_back({node, numbers_});
  numbers_ += units_.back().rows * padded(widths_[node]);
  ++units_.back().sides;
  return sides_.size() - 1;
}

void SparseCoupling::end_structure() {
  factor_.begin_pattern(widths_);
  for (const Unit& unit : units_)
    for (std::size_t a = unit.first_side; a < unit.first_side + unit.sides; ++a)
      for (std::size_t b = unit.first_side; b < a; ++b) factor_.add_edge(sides_[a].node, sides_[b].node);
  factor_.end_pattern();
  blocks_.clear();
  for (const Unit& unit : units_)
    for (std::size_t s = unit.first_side; s < unit.first_side + unit.sides; ++s)
      blocks_.push_back({.row = unit.first,
                         .rows = unit.rows,
                         .column = factor_.first(sides_[s].node),
                         .width = padded(widths_[sides_[s].node]),
                         .values = sides_[s].offset,
                         .stride = padded(widths_[sides_[s].node])});
  places_.clear();
  for (Unit& unit : units_) {
    unit.first_place = places_.size();
    for (std::size_t a = unit.first_side; a < unit.first_side + unit.sides; ++a)
      for (std::size_t b = unit.first_side; b < unit.first_side + unit.sides; ++b) {
        const std::size_t i = sides_[a].node, j = sides_[b].node;
        if (i == j || factor_.comes_first(i, j)) places_.push_back({a, b, factor_.block(i, j)});
      }
  }
  std::size_t widest = 0;
  for (const std::size_t width : widths_) widest = std::max(widest, padded(width));
  product_.need(3 * widest), motion_.need(factor_.size()), step_.need(factor_.size());
  rows_memory_.need(rows_);
  compliance_.assign(rows_, 0.0), scaled_compliance_.assign(rows_, 0.0);
  share_.resize(rows_), swept_.resize(rows_);
  left_.resize(units_.size()), right_.resize(units_.size());
  std::fill_n(given_.need(numbers_), padded(numbers_), 0.0);
  scaled_.need(numbers_);
}

/// To be read only.
MatrixView SparseCoupling::used(std::size_t side) const {
  return {const_cast<double*>(used_) + sides_[side].offset, padded(widths_[sides_[side].node])};
}

Mat3 SparseCoupling::own_block(std::size_t first, std::size_t count) const {
  const Unit& unit = units_[unit_of_[first]];
  Mat3 A = Mat3::Zero();
  for (std::size_t r = 0; r < count; ++r) A(static_cast<int>(r), static_cast<int>(r)) = compliance_[first + r];
  for (std::size_t s = unit.first_side; s < unit.first_side + unit.sides; ++s) {
    const std::size_t stride = padded(widths_[sides_[s].node]);
    const double* G = given_.data() + sides_[s].offset;
    for (std::size_t r = 0; r < count; ++r)
      for (std::size_t c = 0; c < count; ++c)
        A(static_cast<int>(r), static_cast<int>(c)) +=
            dot(G + (first - unit.first + r) * stride, G + (first - unit.first + c) * stride, stride);
  }
  return A;
}

void SparseCoupling::scale(std::span<const double> s) {
  used_ = s.empty() ? given_.data() : scaled_.data();
  for (std::size_t i = 0; i < rows_; ++i) scaled_compliance_[i] = compliance_[i] / (s.empty() ? 1.0 : s[i] * s[i]);
  if (s.empty()) return;
  for (const Unit& unit : units_)
    for (std::size_t side = unit.first_side; side < unit.first_side + unit.sides; ++side) {
      const std::size_t stride = padded(widths_[sides_[side].node]);
      for (std::size_t r = 0; r < unit.rows; ++r) {
        const std::size_t row = sides_[side].offset + r * stride;
        for (std::size_t j = 0; j < stride; ++j) scaled_.data()[row + j] = given_.data()[row + j] / s[unit.first + r];
      }
    }
}

/// x += Gᵀ of a unit's numbers.
void SparseCoupling::add_to_motion(const Unit& unit, const double* rows, double* x) const {
  for (std::size_t s = unit.first_side; s < unit.first_side + unit.sides; ++s) {
    double* to = x + factor_.first(sides_[s].node);
    combine_rows(to, to, used(s), nullptr, rows, unit.rows, used(s).stride);
  }
}

/// G x of a unit's rows.
Vec3 SparseCoupling::seen(const Unit& unit, const double* x) const {
  Vec3 sum = Vec3::Zero();
  for (std::size_t s = unit.first_side; s < unit.first_side + unit.sides; ++s) {
    double part[3] = {};
    multiply_rows(part, used(s), nullptr, x + factor_.first(sides_[s].node), unit.rows, used(s).stride);
    sum += Vec3(part[0], part[1], part[2]);
  }
  return sum;
}

void SparseCoupling::gather(const double* rows, double* x) const {
  std::fill_n(x, padded(factor_.size()), 0.0);
  gather_blocks(x, blocks_.data(), blocks_.size(), used_, rows);
}

void SparseCoupling::multiply(double* out, const double* x) {
  double* motion = motion_.data();
  gather(x, motion);
  for (std::size_t i = 0; i < rows_; ++i) out[i] = scaled_compliance_[i] * x[i];
  spread_blocks(out, blocks_.data(), blocks_.size(), used_, motion);
}

/// D of a unit, as it is scaled.
Mat3 SparseCoupling::own_compliance(const Unit& unit) const {
  Vec3 own = Vec3::Zero();
  std::copy_n(scaled_compliance_.begin() + static_cast<std::ptrdiff_t>(unit.first), unit.rows, own.data());
  return own.asDiagonal();
}

/// M += Gᵀ N G of a unit.
void SparseCoupling::add_product(const Unit& unit, const Mat3& N, bool symmetric) {
  const std::size_t end = unit.first_place + (unit.sides * (unit.sides + 1)) / 2;
  const auto add = [&](const Place& place, const Mat3& weight, double* to) {
    const MatrixView left = used(place.a), right = used(place.b);
    const MatrixView product{product_.data(), right.stride};
    for (std::size_t r = 0; r < unit.rows; ++r) {
      double row[3];
      for (std::size_t c = 0; c < 3; ++c) row[c] = weight(static_cast<int>(r), static_cast<int>(c));
      std::fill_n(product.row(r), right.stride, 0.0);
      combine_rows(product.row(r), product.row(r), right, nullptr, row, unit.rows, right.stride);
    }
    for (std::size_t p = 0; p < widths_[sides_[place.a].node]; ++p) {
      double column[3];
      for (std::size_t r = 0; r < unit.rows; ++r) column[r] = left.row(r)[p];
      double* row = to + p * place.block.stride;
      combine_rows(row, row, product, nullptr, column, unit.rows, right.stride);
    }
  };
  for (std::size_t k = unit.first_place; k < end; ++k) {
    const Place& place = places_[k];
    add(place, N, factor_.upper(place.block));
    if (!symmetric && place.a != place.b) add(place, N.transpose(), factor_.lower(place.block));
  }
}

/// The matrix of (1), with K⁻¹ in left_ and N in right_, which comes to be K⁻¹N.
bool SparseCoupling::factor_with(std::span<const ProjectionDerivative> P, bool symmetric) {
  factor_.set_identity();
  for (std::size_t u = 0; u < units_.size(); ++u) {
    if (P[u].columns == 0) continue;
    right_[u] = left_[u] * right_[u];
    add_product(units_[u], right_[u], symmetric);
  }
  return symmetric ? factor_.factor_symmetric() : factor_.factor_general();
}

/// dy = −K⁻¹d − K⁻¹N G dx with M dx = −GᵀK⁻¹d, M factored.
void SparseCoupling::step_of_rows(std::span<const ProjectionDerivative> P, const double* d, double* dy) {
  double *dx = step_.data(), *weighted = rows_memory_.data();  // K⁻¹d
  for (std::size_t u = 0; u < units_.size(); ++u) {
    Vec3 own = Vec3::Zero();
    std::copy_n(d + units_[u].first, units_[u].rows, own.data());
    own = left_[u] * own;
    std::copy_n(own.data(), units_[u].rows, weighted + units_[u].first);
  }
  gather(weighted, dx);
  for (std::size_t i = 0; i < factor_.size(); ++i) dx[i] = -dx[i];
  factor_.solve(dx);
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const Unit& unit = units_[u];
    Vec3 change = Vec3::Zero();
    if (P[u].columns > 0) change = right_[u] * seen(unit, dx);
    for (std::size_t r = 0; r < unit.rows; ++r)
      dy[unit.first + r] = -weighted[unit.first + r] - change[static_cast<int>(r)];
  }
}

/// K = 1 + ρ P'D, N = ρ P'
bool SparseCoupling::convex_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) {
  for (std::size_t u = 0; u < units_.size(); ++u) {
    left_[u].setIdentity(), right_[u].setZero();
    for (std::size_t c = 0; c < P[u].columns; ++c) right_[u] += rho * P[u].s[c] * P[u].s[c].transpose();
    const Mat3 D = own_compliance(units_[u]);
    if (P[u].columns > 0 && !D.isZero(0.0)) left_[u] = (Mat3::Identity() + right_[u] * D).inverse();
  }
  if (!factor_with(P, true)) return false;
  step_of_rows(P, d, dy);
  return true;
}

/// K = 1 − P' + P'/ρ + P'C D, N = P'C
bool SparseCoupling::map_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) {
  for (std::size_t u = 0; u < units_.size(); ++u) {
    left_[u].setIdentity(), right_[u].setZero();
    for (std::size_t c = 0; c < P[u].columns; ++c) right_[u] += P[u].s[c] * P[u].s[c].transpose();
    const Mat3 own = right_[u], D = own_compliance(units_[u]);
    right_[u] += own.col(0) * P[u].shift.transpose();
    if (P[u].columns == 0) continue;
    if (!D.isZero(0.0))
      left_[u] = (Mat3::Identity() - (1.0 - 1.0 / rho) * own + right_[u] * D).inverse();
    else
      left_[u] += inverse_change(P[u], rho);
  }
  if (!factor_with(P, false)) return false;
  step_of_rows(P, d, dy);
  return true;
}

bool SparseCoupling::factor_shifted(double shift) {
  shift_ = shift;
  factor_.set_identity();
  for (const Unit& unit : units_) {
    Mat3 inverse = Mat3::Identity() / shift;
    for (std::size_t r = 0; r < unit.rows; ++r) {
      const auto at = static_cast<int>(r);
      share_[unit.first + r] = shift / (shift + scaled_compliance_[unit.first + r]);
      inverse(at, at) *= share_[unit.first + r];
    }
    add_product(unit, inverse, true);
  }
  return factor_.factor_symmetric();
}

/// With s = c/(D + c): (G Gᵀ + D + c)⁻¹ = s (1 − G (1 + Gᵀ s G/c)⁻¹ Gᵀs/c)/c
void SparseCoupling::solve_shifted(double* x) {
  double *motion = motion_.data(), *own = rows_memory_.data();
  for (std::size_t i = 0; i < rows_; ++i) own[i] = share_[i] * x[i];
  gather(own, motion);
  factor_.solve(motion);
  std::fill_n(own, rows_, 0.0);
  spread_blocks(own, blocks_.data(), blocks_.size(), used_, motion);
  const double inverse = 1.0 / shift_;
  for (std::size_t i = 0; i < rows_; ++i) x[i] = share_[i] * inverse * (x[i] - inverse * own[i]);
}

void SparseCoupling::begin_sweeps(const double* f) {
  std::copy_n(f, rows_, swept_.begin());
  gather(f, motion_.data());
}

Vec3 SparseCoupling::answer(std::size_t first, std::size_t count) const {
  Vec3 sum = seen(units_[unit_of_[first]], motion_.data());
  for (std::size_t r = 0; r < count; ++r) sum[static_cast<int>(r)] += scaled_compliance_[first + r] * swept_[first + r];
  return sum;
}

void SparseCoupling::move(std::size_t first, std::size_t count, const Vec3& change) {
  for (std::size_t r = 0; r < count; ++r) swept_[first + r] += change[static_cast<int>(r)];
  add_to_motion(units_[unit_of_[first]], change.data(), motion_.data());
}

}  // namespace limber
