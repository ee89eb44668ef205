#include "eigen/elastic_modes.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "eigen/canonical_modes.h"
#include "eigen/sparse_operations.h"
#include "limber/core/error.h"

namespace limber::internal {
namespace {

// Eigenvalues this close, relative to each other, are one cluster, kept or dropped whole (as in mode selection).
constexpr double kClusterGap = 1e-6;
// Eigenvalues this close cannot be told apart: their shapes are free to turn among each other. A turn costs a residual
// of that size, which must stay below 1e-8.
constexpr double kUnresolvedGap = 1e-9;
// Up to so many unknowns the dense solver is as quick as Lanczos, and it cannot miss a mode.
constexpr Eigen::Index kDenseSize = 300;
constexpr int kSearches = 3;  // for missing modes

/// Lanczos vectors for a number of eigenpairs: 1.6 each needed the fewest solves in all (docs/modal-analysis.md).
Eigen::Index subspace_for(Eigen::Index count) { return 8 + count * 8 / 5; }

double gap_after(const Eigen::VectorXd& lambda, Eigen::Index i) { return (lambda[i] - lambda[i - 1]) / lambda[i - 1]; }

Eigen::Index available(const ScaledProblem& problem) { return problem.size() - problem.N.cols(); }

/// The `count` modes nearest to −s, nearest first, by a dense solver.
Eigen::MatrixXd dense_modes(const ScaledProblem& problem, SpectralInverse& inverse, Eigen::Index count) {
  const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(problem.size(), problem.size());
  const Eigen::MatrixXd M = problem.mass_times(I);
  const Eigen::MatrixXd L = Eigen::LLT<Eigen::MatrixXd>(M).matrixL();
  const Eigen::MatrixXd operator_matrix = L.transpose() * inverse.apply(L);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver((operator_matrix + operator_matrix.transpose()) / 2.0);
  const Eigen::VectorXd size = solver.eigenvalues().cwiseAbs();  // 1/|λ + s|, and 0 on N
  std::vector<Eigen::Index> order(static_cast<std::size_t>(size.size()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](Eigen::Index i, Eigen::Index j) { return size[i] > size[j]; });
  order.resize(static_cast<std::size_t>(count));
  const Eigen::MatrixXd Y = solver.eigenvectors()(Eigen::all, order);
  return L.transpose().triangularView<Eigen::Upper>().solve(Y);
}

/// The `count` modes nearest to −s.
Eigen::MatrixXd first_guess(const ScaledProblem& problem, SpectralInverse& inverse, Eigen::Index count,
                            LanczosOptions options) {
  options.count = static_cast<int>(count);
  options.subspace = static_cast<int>(subspace_for(count));
  if (problem.size() <= kDenseSize || options.subspace > available(problem) / 2)
    return dense_modes(problem, inverse, count);
  const Eigen::MatrixXd none(problem.size(), 0);
  return lanczos(problem, inverse, none, none, options);
}

/// Modes orthogonal to the pairs, those nearest to −s.
Eigen::MatrixXd others(const ScaledProblem& problem, SpectralInverse& inverse, const EigenPairs& pairs, int count,
                       std::uint64_t seed) {
  count = static_cast<int>(std::min<Eigen::Index>(count, available(problem) - pairs.count()));
  const Eigen::Index subspace = std::min<Eigen::Index>(4 * count + 20, available(problem) - pairs.count());
  if (count < 1 || subspace <= count) return Eigen::MatrixXd(problem.size(), 0);
  return lanczos(problem, inverse, pairs.W, pairs.MW,
                 {.count = count, .subspace = static_cast<int>(subspace), .tolerance = 1e-12, .seed = seed});
}

/// How many of the pairs lie below the widest gap from `first` on.
Eigen::Index widest_gap(const Eigen::VectorXd& lambda, Eigen::Index first) {
  Eigen::Index best = std::max<Eigen::Index>(first, 1);
  for (Eigen::Index i = best; i < lambda.size(); ++i)
    if (gap_after(lambda, i) > gap_after(lambda, best)) best = i;
  return best;
}

/// The pairs and further ones, orthogonal to each other.
EigenPairs with_others(const ScaledProblem& problem, SpectralInverse& inverse, const EigenPairs& pairs,
                       Eigen::Index missing, int search) {
  const Eigen::MatrixXd more =
      others(problem, inverse, pairs, static_cast<int>(missing) + 4, ~static_cast<std::uint64_t>(search));
  Eigen::MatrixXd all(problem.size(), pairs.count() + more.cols());
  all << pairs.W, more;
  return refined(problem, inverse, all);
}

EigenPairs only_between(const EigenPairs& pairs, double low, double high) {
  const double *begin = pairs.lambda.data(), *end = begin + pairs.count();
  const Eigen::Index first = std::upper_bound(begin, end, low) - begin,
                     count = std::lower_bound(begin, end, high) - begin - first;
  return {.lambda = pairs.lambda.segment(first, count),
          .W = pairs.W.middleCols(first, count),
          .MW = pairs.MW.middleCols(first, count)};
}

}  // namespace

void EigenPairs::keep_first(Eigen::Index count) {
  lambda.conservativeResize(count);
  W.conservativeResize(Eigen::NoChange, count);
  MW.conservativeResize(Eigen::NoChange, count);
}

Eigen::Index end_of_cluster(const Eigen::VectorXd& lambda, Eigen::Index wanted, Eigen::Index available) {
  if (wanted == 0) return 0;
  for (Eigen::Index i = wanted; i < lambda.size(); ++i)
    if (gap_after(lambda, i) > kClusterGap) return i;
  return lambda.size() == available ? available : -1;
}

EigenPairs refined(const ScaledProblem& problem, SpectralInverse& inverse, const Eigen::MatrixXd& X) {
  const Eigen::MatrixXd MX = problem.mass_times(X);
  Eigen::MatrixXd Y = inverse.apply_accurately(MX), MY = problem.mass_times(Y);
  // Columns of length one, so that the Gram matrix below is near I however far the eigenvalues are apart.
  const Eigen::VectorXd shrink = Y.cwiseProduct(MY).colwise().sum().cwiseSqrt().cwiseInverse().transpose();
  Y *= shrink.asDiagonal();
  MY *= shrink.asDiagonal();
  const Eigen::MatrixXd B = Y.transpose() * MY;
  const Eigen::MatrixXd A = Y.transpose() * (MX * shrink.asDiagonal()) - inverse.shift() * B;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz((A + A.transpose()) / 2.0,
                                                                       (B + B.transpose()) / 2.0);
  const Eigen::MatrixXd& S = ritz.eigenvectors();
  EigenPairs pairs{.lambda = Eigen::VectorXd(S.cols()), .W = Y * S, .MW = MY * S};
  // The dense solver's λ are good to round-off of the largest; quotients are good to round-off of their own.
  for (Eigen::Index i = 0; i < S.cols(); ++i) pairs.lambda[i] = S.col(i).dot(A * S.col(i)) / S.col(i).dot(B * S.col(i));
  return pairs;
}

EigenPairs lowest_modes(const ScaledProblem& problem, ElasticInverse& inverse, Eigen::Index wanted,
                        LanczosOptions options, Eigen::Index& pairs_to_keep) {
  const Eigen::Index most = available(problem);
  wanted = std::min(wanted, most);
  for (Eigen::Index extra = 6 + wanted / 16;; extra *= 2) {
    EigenPairs pairs =
        refined(problem, inverse, first_guess(problem, inverse, std::min(wanted + extra, most), options));
    pairs_to_keep = end_of_cluster(pairs.lambda, wanted, most);
    if (pairs_to_keep >= 0) return pairs;
    if (pairs.count() == most) throw ComputationError("the eigenvalues found are not in order");
  }
}

void complete(const ScaledProblem& problem, ElasticInverse& inverse, EigenvalueCounter& counter, EigenPairs& pairs,
              Eigen::Index wanted, Eigen::Index& pairs_to_keep) {
  wanted = std::min(wanted, available(problem));
  const Eigen::Index zeros = problem.N.cols();
  for (int search = 0;; ++search) {
    const Eigen::Index below = widest_gap(pairs.lambda, pairs_to_keep);
    const double last = pairs.lambda[below - 1];
    const double sigma = below < pairs.count() ? (last + pairs.lambda[below]) / 2.0 : 2.0 * last;
    const Eigen::Index missing = counter.below(sigma) - zeros - below;
    if (missing == 0) return;
    if (missing < 0 || search == kSearches)
      throw ComputationError("the certificate of completeness fails: " + std::to_string(zeros + below) +
                             " eigenvalues were found below a bound that has " +
                             std::to_string(zeros + below + missing) + " of them");
    pairs = with_others(problem, inverse, pairs, missing, search);
    pairs_to_keep = std::max<Eigen::Index>(end_of_cluster(pairs.lambda, wanted, available(problem)), 0);
  }
}

void confirm_zero_modes(const ScaledProblem& problem, const EigenPairs& pairs, EigenvalueCounter& counter,
                        Warnings& warnings) {
  const double sigma = pairs.lambda[0] / 2.0;
  const double round_off = (problem.N.transpose() * multiply(problem.K, problem.N)).norm();
  if (round_off > sigma / 10.0) {
    warnings.push_back(
        "the lowest frequencies lie within round-off of the stiffness matrix, so the number of zero modes is known "
        "from "
        "geometry alone");
    return;
  }
  const int counted = counter.below(sigma);
  if (counted != problem.N.cols())
    throw ComputationError("the body's geometry allows " + std::to_string(problem.N.cols()) +
                           " motions without deformation, but its stiffness matrix has " + std::to_string(counted) +
                           " eigenvalues near zero: look for tetrahedra that are nearly flat, or materials whose "
                           "stiffnesses differ by more than about 1e10");
}

EigenPairs modes_between(const ScaledProblem& problem, SpectralInverse& inverse, double low, double high,
                         Eigen::Index count, LanczosOptions options) {
  if (count == 0) return {Eigen::VectorXd(0), Eigen::MatrixXd(problem.size(), 0), Eigen::MatrixXd(problem.size(), 0)};
  EigenPairs pairs = refined(problem, inverse, first_guess(problem, inverse, count, options));
  for (int search = 0;; ++search) {
    EigenPairs found = only_between(pairs, low, high);
    if (found.count() == count) return found;
    if (found.count() > count || search == kSearches)
      throw ComputationError("the certificate of completeness fails: " + std::to_string(found.count()) +
                             " eigenvalues were found between two bounds that have " + std::to_string(count) +
                             " between them");
    pairs = with_others(problem, inverse, pairs, count - found.count(), search);
  }
}

void make_clusters_canonical(EigenPairs& pairs) {
  for (Eigen::Index begin = 0, end = 0; begin < pairs.count(); begin = end) {
    for (end = begin + 1; end < pairs.count() && gap_after(pairs.lambda, end) < kUnresolvedGap;) ++end;
    const Eigen::Index size = end - begin;
    auto W = pairs.W.middleCols(begin, size);
    auto MW = pairs.MW.middleCols(begin, size);
    const Eigen::MatrixXd before = MW;
    Eigen::MatrixXd turned = W;
    make_canonical(turned);
    MW = before * (before.transpose() * turned);
    W = turned;
    pairs.lambda.segment(begin, size).setConstant(pairs.lambda.segment(begin, size).mean());
  }
}

}  // namespace limber::internal
