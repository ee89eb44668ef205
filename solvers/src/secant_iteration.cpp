#include "limber/solvers/secant_iteration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace limber::internal {
namespace {

double largest(std::span<const double> v) {
  double size = 0.0;
  for (const double x : v) size = std::max(size, std::abs(x));
  return size;
}

double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace

void SecantIteration::begin(std::size_t size) {
  for (std::vector<double>* v : {&x_, &step_, &residual_, &best_x_, &best_step_}) v->resize(size);
  for (auto* secants : {&dx_, &dstep_, &dresidual_})
    for (std::vector<double>& v : *secants) v.resize(size);
  known_ = 0;
  first_ = true;
  best_ = std::numeric_limits<double>::infinity();
  length_ = 1.0;
}

void SecantIteration::advance(std::span<double> x, std::span<const double> step, std::span<const double> residual) {
  const double size = largest(residual);
  if (size < best_) {
    best_ = size;
    std::copy(x.begin(), x.end(), best_x_.begin());
    std::copy(step.begin(), step.end(), best_step_.begin());
    length_ = std::min(1.0, 2.0 * length_);
  } else if (!(size < 2.0 * best_)) {  // leads away, or is not a number
    length_ *= 0.25;
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = best_x_[i] + length_ * best_step_[i];
    known_ = 0;
    first_ = true;
    return;
  }
  if (!first_) remember(x, step, residual);
  std::copy(x.begin(), x.end(), x_.begin());
  std::copy(step.begin(), step.end(), step_.begin());
  std::copy(residual.begin(), residual.end(), residual_.begin());
  first_ = false;

  const std::array<double, kDepth> weight = secant_weights(residual);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += step[i];
  for (int k = 0; k < known_; ++k) {
    const auto s = static_cast<std::size_t>(k);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] -= weight[s] * (dx_[s][i] + dstep_[s][i]);
  }
}

void SecantIteration::remember(std::span<const double> x, std::span<const double> step,
                               std::span<const double> residual) {
  if (known_ == kDepth) {  // forget the oldest
    for (auto* secants : {&dx_, &dstep_, &dresidual_})
      std::rotate(secants->begin(), secants->begin() + 1, secants->end());
    --known_;
  }
  const auto s = static_cast<std::size_t>(known_++);
  for (std::size_t i = 0; i < x.size(); ++i) {
    dx_[s][i] = x[i] - x_[i];
    dstep_[s][i] = step[i] - step_[i];
    dresidual_[s][i] = residual[i] - residual_[i];
  }
}

/// min |residual − Σ weight dresidual|, by normal equations with a ridge that round-off needs.
std::array<double, SecantIteration::kDepth> SecantIteration::secant_weights(std::span<const double> residual) const {
  std::array<double, kDepth> weights{};
  if (known_ == 0) return weights;
  Eigen::Matrix<double, kDepth, kDepth> N = Eigen::Matrix<double, kDepth, kDepth>::Identity();
  Eigen::Matrix<double, kDepth, 1> r = Eigen::Matrix<double, kDepth, 1>::Zero();
  std::array<double, kDepth> scale{};
  for (int i = 0; i < known_; ++i) {
    const auto s = static_cast<std::size_t>(i);
    const double norm = std::sqrt(dot(dresidual_[s], dresidual_[s]));
    scale[s] = norm > 0.0 ? 1.0 / norm : 0.0;
    r[i] = scale[s] * dot(dresidual_[s], residual);
    for (int j = 0; j < i; ++j) {
      const auto t = static_cast<std::size_t>(j);
      N(i, j) = N(j, i) = scale[s] * scale[t] * dot(dresidual_[s], dresidual_[t]);
    }
  }
  constexpr double kRidge = 1e-12;
  N.diagonal().array() += kRidge;
  const Eigen::Matrix<double, kDepth, 1> solution = N.llt().solve(r);
  if (!solution.allFinite()) return weights;
  for (int i = 0; i < known_; ++i)
    weights[static_cast<std::size_t>(i)] = scale[static_cast<std::size_t>(i)] * solution[i];
  return weights;
}

}  // namespace limber::internal
