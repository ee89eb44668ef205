#include "limber/solvers/row_equilibrium.h"

#include <algorithm>
#include <cmath>

#include "dense_kernels.h"
#include "tuning.h"

namespace limber::internal {
namespace {

Vec3 part_of(std::span<const double> v, std::size_t first, std::size_t rows) {
  Vec3 part = Vec3::Zero();
  for (std::size_t r = 0; r < rows; ++r) part[static_cast<int>(r)] = v[first + r];
  return part;
}

}  // namespace

void RowEquilibrium::add_unit(std::size_t rows, const ContactPotential& set, double tolerance) {
  units_.push_back({.first = size_, .rows = rows, .set = set, .tolerance = tolerance});
  size_ += rows;
}

void RowEquilibrium::factor(std::span<const double> W) {
  to_scale(W);
  const MatrixView S = symmetric_.need(size_, size_);
  for (std::size_t i = 0; i < size_; ++i) {
    std::fill(S.row(i) + size_, S.row(i) + S.stride, 0.0);
    for (std::size_t j = 0; j < size_; ++j) S.row(i)[j] = 0.5 * (W_[i * size_ + j] + W_[j * size_ + i]);
  }
  cholesky_.factor(S, size_, kSolversTuning.equilibrium.pivot);
  convex_.begin_structure();
  convex_.add_node(std::max<std::size_t>(1, cholesky_.rank()));
  for (const Unit& unit : units_) {
    convex_.add_unit(unit.rows, unit.set, unit.tolerance);
    convex_.add_side(0);
  }
  convex_.end_structure();
  for (std::size_t u = 0; u < units_.size(); ++u)
    for (std::size_t r = 0; r < units_[u].rows; ++r)
      for (std::size_t c = 0; c < cholesky_.rank(); ++c)
        convex_.values(u).row(r)[c] = cholesky_.columns().row(c)[units_[u].first + r];
  convex_.begin();
}

/// To W_, so that impulses move their own units by about 1; and the sets with it.
void RowEquilibrium::to_scale(std::span<const double> W) {
  const std::size_t n = size_;
  W_.assign(W.begin(), W.end());
  for (Unit& unit : units_) {
    unit.scale = inverse_power_of_two(std::sqrt(unit.set.compliance));  // bounds stay what they are, to the bit
    unit.tolerance *= unit.scale;
    unit.set.compliance = kSolversTuning.equilibrium.yield;
    unit.set.lower /= unit.scale, unit.set.upper /= unit.scale;
    if (unit.set.set == ContactPotential::Set::kBall) unit.set.bound /= unit.scale;
    for (std::size_t r = unit.first; r < unit.first + unit.rows; ++r)
      for (std::size_t j = 0; j < n; ++j) W_[r * n + j] *= unit.scale, W_[j * n + r] *= unit.scale;
  }
}

double RowEquilibrium::solve(std::span<const double> b, std::span<double> f) {
  constexpr const EquilibriumTuning& tuning = kSolversTuning.equilibrium;
  b_.resize(size_), f_.resize(size_), gap_.resize(size_);
  for (const Unit& unit : units_)
    for (std::size_t r = unit.first; r < unit.first + unit.rows; ++r)
      b_[r] = unit.scale * b[r], f_[r] = f[r] / unit.scale;
  double best = kUnbounded, enough = tuning.met;
  for (int steps = 0, round = 0;; ++round) {
    find_gaps();
    const double left = take_starts();
    if (round == 0) enough = std::max(enough, tuning.enough * left);
    if (!(left >= best)) {
      best = left;
      for (const Unit& unit : units_)
        for (std::size_t r = unit.first; r < unit.first + unit.rows; ++r) f[r] = unit.scale * f_[r];
    }
    if (left <= enough || steps >= tuning.most_newton_steps || !std::isfinite(left)) return best;
    steps += 1 + improve(tuning.most_newton_steps - steps);
  }
}

void RowEquilibrium::find_gaps() {
  for (std::size_t i = 0; i < size_; ++i) {
    gap_[i] = b_[i];
    for (std::size_t j = 0; j < size_; ++j) gap_[i] += W_[i * size_ + j] * f_[j];
  }
}

/// The starts of the convex problem, so that its gaps are right under the impulses at hand. @return what these leave of
/// the law, by tolerance
double RowEquilibrium::take_starts() {
  double left = 0.0;
  for (std::size_t u = 0; u < units_.size(); ++u) convex_.impulse(u) = part_of(f_, units_[u].first, units_[u].rows);
  convex_.set_motion();
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const Unit& unit = units_[u];
    const Vec3& F = convex_.impulse(u);
    Vec3 open = part_of(gap_, unit.first, unit.rows);
    if (unit.set.set == ContactPotential::Set::kCone) open[0] += unit.set.bound * open.tail<2>().norm();
    convex_.start(u) = open - unit.set.compliance * F - convex_.moved(u);
    ContactPotential natural = unit.set;
    natural.compliance = 1.0;
    left = std::max(left, (natural.natural(open, F) - F).norm() / unit.tolerance);
  }
  return left;
}

int RowEquilibrium::improve(int most) {
  const ConvexContactReport done =
      convex_.solve_on({.tolerance = kSolversTuning.equilibrium.met, .max_iterations = most});
  for (std::size_t u = 0; u < units_.size(); ++u)
    for (std::size_t r = 0; r < units_[u].rows; ++r) f_[units_[u].first + r] = convex_.impulse(u)[static_cast<int>(r)];
  return done.iterations;
}

}  // namespace limber::internal
