#include "sparse_coupling.h"

#include <algorithm>

namespace limber {

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
  std::fill_n(out, rows_, 0.0);
  spread_blocks(out, blocks_.data(), blocks_.size(), used_, motion);
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

/// dy = −d − N G dx with M dx = −Gᵀd, M factored; N by unit.
void SparseCoupling::step_of_rows(std::span<const ProjectionDerivative> P, const std::vector<Mat3>& N, const double* d,
                                  double* dy) {
  double* dx = step_.data();
  gather(d, dx);
  for (std::size_t i = 0; i < factor_.size(); ++i) dx[i] = -dx[i];
  factor_.solve(dx);
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const Unit& unit = units_[u];
    Vec3 change = Vec3::Zero();
    if (P[u].columns > 0) change = N[u] * seen(unit, dx);
    for (std::size_t r = 0; r < unit.rows; ++r) dy[unit.first + r] = -d[unit.first + r] - change[static_cast<int>(r)];
  }
}

bool SparseCoupling::convex_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) {
  factor_.set_identity();
  for (std::size_t u = 0; u < units_.size(); ++u) {
    left_[u].setZero();
    for (std::size_t c = 0; c < P[u].columns; ++c) left_[u] += rho * P[u].s[c] * P[u].s[c].transpose();
    if (P[u].columns > 0) add_product(units_[u], left_[u], true);
  }
  if (!factor_.factor_symmetric()) return false;
  step_of_rows(P, left_, d, dy);
  return true;
}

bool SparseCoupling::map_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) {
  factor_.set_identity();
  double* weighted = rows_memory_.data();  // K⁻¹ d
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const Unit& unit = units_[u];
    left_[u].setIdentity(), right_[u].setZero();
    for (std::size_t c = 0; c < P[u].columns; ++c) {
      const double part = P[u].s[c].squaredNorm(), inverse = 1.0 / (1.0 - part + part / rho);
      if (!(part > 0.0)) continue;
      const Mat3 square = P[u].s[c] * P[u].s[c].transpose() / part;
      left_[u] += (inverse - 1.0) * square;
      right_[u] += inverse * part * square;
    }
    right_[u] += right_[u].col(0) * P[u].shift.transpose();
    if (P[u].columns > 0) add_product(unit, right_[u], false);
    Vec3 own = Vec3::Zero();
    std::copy_n(d + unit.first, unit.rows, own.data());
    own = left_[u] * own;
    std::copy_n(own.data(), unit.rows, weighted + unit.first);
  }
  if (!factor_.factor_general()) return false;
  step_of_rows(P, right_, weighted, dy);
  return true;
}

bool SparseCoupling::factor_shifted(double shift) {
  shift_ = shift;
  factor_.set_identity();
  for (const Unit& unit : units_) add_product(unit, Mat3::Identity() / shift, true);
  return factor_.factor_symmetric();
}

/// (G Gᵀ + c)⁻¹ = (1 − G (1 + GᵀG/c)⁻¹ Gᵀ/c)/c
void SparseCoupling::solve_shifted(double* x) {
  double* motion = motion_.data();
  gather(x, motion);
  factor_.solve(motion);
  double* own = rows_memory_.data();
  std::fill_n(own, rows_, 0.0);
  spread_blocks(own, blocks_.data(), blocks_.size(), used_, motion);
  const double inverse = 1.0 / shift_;
  for (std::size_t i = 0; i < rows_; ++i) x[i] = inverse * (x[i] - inverse * own[i]);
}

void SparseCoupling::begin_sweeps(const double* f) { gather(f, motion_.data()); }

Vec3 SparseCoupling::answer(std::size_t first, std::size_t) const {
  return seen(units_[unit_of_[first]], motion_.data());
}

void SparseCoupling::move(std::size_t first, std::size_t, const Vec3& change) {
  add_to_motion(units_[unit_of_[first]], change.data(), motion_.data());
}

}  // namespace limber
