#include "limber/solvers/secant_iteration.h"
#include "tuning.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace limber::internal {
namespace {

using Column = Eigen::Map<const Eigen::VectorXd>;

Column column(std::span<const double> v) { return {v.data(), static_cast<Eigen::Index>(v.size())}; }

}  // namespace

void SecantIteration::begin(std::size_t size) {
  for (std::vector<double>* v : {&x_, &step_, &residual_, &best_x_, &best_step_}) v->resize(size);
  for (auto* secants : {&change_, &dresidual_})
    for (std::vector<double>& v : *secants) v.resize(size);
  known_ = 0;
  first_ = true;
  best_ = std::numeric_limits<double>::infinity();
  length_ = 1.0;
}

void SecantIteration::advance(std::span<double> x, std::span<const double> step, std::span<const double> residual) {
  double size = 0.0;
  for (const double r : residual) size = std::max(size, std::abs(r));
  if (size < best_) {
    best_ = size;
    best_x_.assign(x.begin(), x.end()), best_step_.assign(step.begin(), step.end());
    length_ = std::min(1.0, 2.0 * length_);
  } else if (!(size < 2.0 * best_)) {  // leads away, or is not a number
    length_ *= 0.25;
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = best_x_[i] + length_ * best_step_[i];
    known_ = 0;
    first_ = true;
    return;
  }
  if (!first_) remember(x, step, residual);
  x_.assign(x.begin(), x.end()), step_.assign(step.begin(), step.end());
  residual_.assign(residual.begin(), residual.end());
  first_ = false;

  const std::array<double, kDepth> weight = secant_weights(residual);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += step[i];
  for (std::size_t s = 0; s < known_; ++s)
    for (std::size_t i = 0; i < x.size(); ++i) x[i] -= weight[s] * change_[s][i];
}

void SecantIteration::remember(std::span<const double> x, std::span<const double> step,
                               std::span<const double> residual) {
  if (known_ == kDepth) {  // forget the oldest
    for (auto* secants : {&change_, &dresidual_}) std::rotate(secants->begin(), secants->begin() + 1, secants->end());
    --known_;
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    change_[known_][i] = x[i] - x_[i] + (step[i] - step_[i]);
    dresidual_[known_][i] = residual[i] - residual_[i];
  }
  ++known_;
}

/// min |residual − Σ weight dresidual|, by normal equations with a ridge that round-off needs.
std::array<double, SecantIteration::kDepth> SecantIteration::secant_weights(std::span<const double> residual) const {
  std::array<double, kDepth> weights{}, scale{};
  Eigen::Matrix<double, kDepth, kDepth> N =
      Eigen::Matrix<double, kDepth, kDepth>::Identity() * (1.0 + kSolversTuning.secant_ridge);
  Eigen::Vector<double, kDepth> r = Eigen::Vector<double, kDepth>::Zero();
  for (std::size_t i = 0; i < known_; ++i) {
    const Column secant = column(dresidual_[i]);
    const double norm = secant.norm();
    scale[i] = norm > 0.0 ? 1.0 / norm : 0.0;
    r[i] = scale[i] * secant.dot(column(residual));
    for (std::size_t j = 0; j < i; ++j) N(i, j) = N(j, i) = scale[i] * scale[j] * secant.dot(column(dresidual_[j]));
  }
  const Eigen::Vector<double, kDepth> solution = N.llt().solve(r);
  if (!solution.allFinite()) return weights;
  for (std::size_t i = 0; i < known_; ++i) weights[i] = scale[i] * solution[i];
  return weights;
}

}  // namespace limber::internal
