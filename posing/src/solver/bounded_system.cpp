#include "solver/bounded_system.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

namespace limber::internal {
namespace {

constexpr double kShared = 1e-12;  // of the diagonal: what rows that repeat others share by
constexpr int kRefinements = 3;    // each takes a further factor kShared / eigenvalue off what that changes

/// The solution over some rows, scaled to a unit diagonal.
VectorX solve_over(const MatrixX& A, const VectorX& b, const std::vector<Eigen::Index>& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  VectorX scale(n), rhs(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double d = A(rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(i)]);
    scale[i] = d > 0.0 ? 1.0 / std::sqrt(d) : 0.0;  // 0: nothing moves there, nothing is asked
    rhs[i] = scale[i] * b[rows[static_cast<std::size_t>(i)]];
  }
  MatrixX scaled(n, n);
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i < n; ++i)
      scaled(i, j) = scale[i] * scale[j] * A(rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(j)]);
  MatrixX shared = scaled;
  shared.diagonal().array() += kShared;
  const Eigen::LLT<MatrixX> factor(shared);
  VectorX x = factor.solve(rhs);
  for (int i = 0; i < kRefinements; ++i) x += factor.solve(rhs - scaled * x);
  return scale.cwiseProduct(x);
}

class ActiveSet {
 public:
  ActiveSet(const MatrixX& A, const VectorX& b, const std::vector<bool>& pushes, VectorX& lambda)
      : A_(A), b_(b), pushes_(pushes), lambda_(lambda), active_(pushes.size()) {
    for (std::size_t i = 0; i < pushes.size(); ++i) {
      auto& x = lambda_[static_cast<Eigen::Index>(i)];
      if (pushes[i]) x = std::max(x, 0.0);
      active_[i] = !pushes[i] || x > 0.0;
    }
  }

  void run() {
    settle();
    const double none = 1e-12 * std::max(b_.cwiseAbs().maxCoeff(), std::numeric_limits<double>::min());
    for (std::size_t round = 0; round <= 3 * pushes_.size(); ++round) {
      const VectorX lack = b_ - A_ * lambda_;
      Eigen::Index worst = -1;
      double most = none;
      for (Eigen::Index i = 0; i < lack.size(); ++i)
        if (!active_[static_cast<std::size_t>(i)] && lack[i] > most) most = lack[i], worst = i;
      if (worst < 0) return;
      active_[static_cast<std::size_t>(worst)] = true;
      if (!settle() && !active_[static_cast<std::size_t>(worst)]) return;  // what round-off asks for and takes back
    }
  }

 private:
  /// Goes towards the active rows' solution as far as no push becomes a pull, drops what stops it, and again.
  /// @return whether nothing was dropped
  bool settle() {
    for (bool whole = true;; whole = false) {
      std::vector<Eigen::Index> rows;
      for (std::size_t i = 0; i < active_.size(); ++i)
        if (active_[i]) rows.push_back(static_cast<Eigen::Index>(i));
      const VectorX x = solve_over(A_, b_, rows);
      double part = 1.0;
      for (std::size_t k = 0; k < rows.size(); ++k) {
        const double from = lambda_[rows[k]], to = x[static_cast<Eigen::Index>(k)];
        if (pushes_[static_cast<std::size_t>(rows[k])] && to <= 0.0) part = std::min(part, from / (from - to));
      }
      for (std::size_t k = 0; k < rows.size(); ++k) {
        double& l = lambda_[rows[k]];
        const double to = x[static_cast<Eigen::Index>(k)];
        const bool stops = pushes_[static_cast<std::size_t>(rows[k])] && to <= 0.0 && l / (l - to) <= part;
        l += part * (to - l);
        if (!stops || part >= 1.0) continue;
        l = 0.0;
        active_[static_cast<std::size_t>(rows[k])] = false;
      }
      if (part >= 1.0) return whole;
    }
  }

  const MatrixX& A_;
  const VectorX& b_;
  const std::vector<bool>& pushes_;
  VectorX& lambda_;
  std::vector<bool> active_;
};

}  // namespace

void solve_bounded(const MatrixX& A, const VectorX& b, const std::vector<bool>& pushes, VectorX& lambda) {
  if (b.size() == 0) return;
  if (lambda.size() != b.size()) lambda = VectorX::Zero(b.size());
  ActiveSet(A, b, pushes, lambda).run();
}

}  // namespace limber::internal
