#include "limber/solvers/difference_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limber::internal {
namespace {

// A difference moves the row by this many tolerances: 1e-6 of the lengths at hand, so that both its round-off and what
// is not linear in it stay below 1e-6.
constexpr double kDifference = 1e5;

}  // namespace

double DifferenceNewton::solve(const IntervalRows& rows, const Evaluate& evaluate, std::span<double> f) {
  constexpr int kIterations = 12, kLengths = 6;
  const std::size_t m = f.size();
  for (std::vector<double>* v : {&w_, &w_there_, &F_, &metric_, &step_, &multipliers_, &from_}) v->resize(m);
  J_.resize(m * m);
  evaluate(f, w_);
  double size = residual(rows, f);
  for (int iteration = 0; iteration < kIterations && size > 1.0; ++iteration) {
    differentiate(rows, evaluate, f);
    find_step();
    std::copy(f.begin(), f.end(), from_.begin());
    double length = 1.0, there = size;
    for (int tried = 0; tried < kLengths; ++tried, length *= 0.5) {
      for (std::size_t i = 0; i < m; ++i)
        f[i] = rows.slope[i] > 0.0 ? from_[i] + length * step_[i] * rows.tolerance[i] / rows.slope[i] : from_[i];
      evaluate(f, w_);
      there = residual(rows, f);
      if (there < (1.0 - 0.1 * length) * size) break;
    }
    if (!(there < size)) {  // nor is not a number
      std::copy(from_.begin(), from_.end(), f.begin());
      evaluate(f, w_);
      residual(rows, f);
      break;
    }
    size = there;
  }
  return size;
}

/// F_i = (f_i − clamp(f_i − w_i/a_i)) a_i, in tolerances.
double DifferenceNewton::residual(const IntervalRows& rows, std::span<const double> f) {
  double largest = 0.0;
  for (std::size_t i = 0; i < f.size(); ++i) {
    const double a = rows.slope[i];
    const double wanted = a > 0.0 ? std::clamp(f[i] - w_[i] / a, rows.lower[i], rows.upper[i]) : f[i];
    F_[i] = (f[i] - wanted) * a / rows.tolerance[i];
    largest = std::isfinite(F_[i]) ? std::max(largest, std::abs(F_[i])) : std::numeric_limits<double>::infinity();
  }
  return largest;
}

/// ∂F_i/∂x_j, x_j = f_j a_j/tolerance_j: rows at their bounds ask for them.
void DifferenceNewton::differentiate(const IntervalRows& rows, const Evaluate& evaluate, std::span<double> f) {
  const std::size_t m = f.size();
  std::fill(J_.begin(), J_.end(), 0.0);
  for (std::size_t j = 0; j < m; ++j) {
    if (!(rows.slope[j] > 0.0)) continue;
    const double kept = f[j];
    f[j] += kDifference * rows.tolerance[j] / rows.slope[j];
    evaluate(f, w_there_);
    f[j] = kept;
    for (std::size_t i = 0; i < m; ++i) J_[i * m + j] = (w_there_[i] - w_[i]) / (kDifference * rows.tolerance[i]);
  }
  for (std::size_t i = 0; i < m; ++i) {
    const double a = rows.slope[i], free = a > 0.0 ? f[i] - w_[i] / a : 0.0;
    if (a > 0.0 && free > rows.lower[i] && free < rows.upper[i]) continue;
    std::fill_n(J_.begin() + static_cast<std::ptrdiff_t>(i * m), m, 0.0);
    if (a > 0.0) J_[i * m + i] = 1.0;
  }
}

/// The shortest step that makes F least: Jᵀ(J Jᵀ)⁺ (−F).
void DifferenceNewton::find_step() {
  const std::size_t m = F_.size();
  std::fill(metric_.begin(), metric_.end(), 1.0);
  for (std::size_t i = 0; i < m; ++i) multipliers_[i] = -F_[i];
  least_squares_.factor(J_, metric_, static_cast<int>(m), {.rank_tolerance = 1e-13});
  least_squares_.solve(multipliers_, multipliers_);
  std::fill(step_.begin(), step_.end(), 0.0);
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j < m; ++j) step_[j] += J_[i * m + j] * multipliers_[i];
}

}  // namespace limber::internal
