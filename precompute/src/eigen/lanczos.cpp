#include "eigen/lanczos.h"

#include <algorithm>
#include <arpack.hpp>
#include <array>
#include <cassert>
#include <cmath>
#include <mutex>
#include <string>
#include <vector>

#include "eigen/sparse_operations.h"
#include "limber/core/error.h"

namespace limber::internal {
namespace {

constexpr int kMaxRestarts = 1000;

using Column = Eigen::Map<Eigen::VectorXd>;
using ConstColumn = Eigen::Map<const Eigen::VectorXd>;

/// K⁺ with found vectors taken out as well, scaled so that its largest eigenvalues are near one: ARPACK's test for
/// convergence compares with max(ε^⅔, |θ|), which means nothing for an operator in other units.
class Operator {
 public:
  Operator(SpectralInverse& inverse, const Eigen::MatrixXd& found, const Eigen::MatrixXd& mass_times_found)
      : inverse_(inverse), X_(found), MX_(mass_times_found) {}

  Eigen::VectorXd operator()(const Eigen::Ref<const Eigen::VectorXd>& Mx) {
    Eigen::VectorXd y = scale_ * inverse_.apply(Mx - MX_ * (X_.transpose() * Mx));
    y -= X_ * (MX_.transpose() * y);
    return y;
  }

  void set_scale(double scale) { scale_ = scale; }

 private:
  SpectralInverse& inverse_;
  const Eigen::MatrixXd &X_, &MX_;
  double scale_ = 1.0;
};

/// About one over the largest eigenvalue, a power of two: two steps of power iteration from the start vector.
double matching_scale(const ScaledProblem& problem, Operator& apply, const Eigen::VectorXd& start) {
  Eigen::VectorXd x = apply(problem.mass_times(start));
  Eigen::VectorXd Mx = problem.mass_times(x);
  const double norm_before = std::sqrt(x.dot(Mx));
  x = apply(Mx);
  const double norm_after = std::sqrt(x.dot(problem.mass_times(x).col(0)));
  if (!(norm_before > 0.0 && norm_after > 0.0)) return 1.0;
  return std::exp2(-std::round(std::log2(norm_after / norm_before)));
}

Eigen::VectorXd start_vector(Index size, std::uint64_t seed) {
  Eigen::VectorXd start(size);
  for (Index i = 0; i < size; ++i) start[i] = scattered(seed, i);
  return start;
}

struct Arpack {
  a_int n, count, subspace;
  Eigen::VectorXd residual;
  Eigen::MatrixXd basis;
  std::vector<double> work, small_work;
  std::array<a_int, 11> parameters{};
  std::array<a_int, 14> pointers{};
  a_int info = 1;  // the residual holds a start vector

  Arpack(a_int size, const LanczosOptions& options, Eigen::VectorXd start)
      : n(size),
        count(options.count),
        subspace(options.subspace),
        residual(std::move(start)),
        basis(size, options.subspace),
        work(3 * static_cast<std::size_t>(size)),
        small_work(static_cast<std::size_t>(subspace) * (subspace + 8)) {
    parameters[0] = 1;  // exact shifts
    parameters[2] = kMaxRestarts;
    parameters[6] = 3;  // shift and invert
  }

  void iterate(const ScaledProblem& problem, Operator& apply, double tolerance) {
    a_int request = 0;
    while (true) {
      arpack::saupd(request, arpack::bmat::generalized, n, arpack::which::largest_magnitude, count, tolerance,
                    residual.data(), subspace, basis.data(), n, parameters.data(), pointers.data(), work.data(),
                    small_work.data(), static_cast<a_int>(small_work.size()), info);
      const ConstColumn x(work.data() + pointers[0] - 1, n);
      Column y(work.data() + pointers[1] - 1, n);
      if (request == -1)
        y = apply(problem.mass_times(x));
      else if (request == 1)
        y = apply(ConstColumn(work.data() + pointers[2] - 1, n));
      else if (request == 2)
        y = problem.mass_times(x);
      else
        break;
    }
    if (info < 0) throw ComputationError("ARPACK dsaupd failed with info " + std::to_string(info));
  }

  /// Ritz vectors, ascending λ.
  Eigen::MatrixXd vectors(double tolerance) {
    std::vector<a_int> select(subspace);
    std::vector<double> values(count);
    Eigen::MatrixXd Z(n, count);
    arpack::seupd(1, arpack::howmny::ritz_vectors, select.data(), values.data(), Z.data(), n, 0.0,
                  arpack::bmat::generalized, n, arpack::which::largest_magnitude, count, tolerance, residual.data(),
                  subspace, basis.data(), n, parameters.data(), pointers.data(), work.data(), small_work.data(),
                  static_cast<a_int>(small_work.size()), info);
    if (info != 0) throw ComputationError("ARPACK dseupd failed with info " + std::to_string(info));
    const a_int converged = parameters[4];
    // In mode 3 the values come back as 1/θ = λ + s.
    std::vector<a_int> order(converged);
    for (a_int i = 0; i < converged; ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](a_int a, a_int b) { return values[a] < values[b]; });
    return Z(Eigen::all, order);
  }
};

std::mutex& arpack_mutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

Eigen::MatrixXd lanczos(const ScaledProblem& problem, SpectralInverse& inverse, const Eigen::MatrixXd& found,
                        const Eigen::MatrixXd& mass_times_found, const LanczosOptions& options) {
  assert(options.count >= 1 && options.count < options.subspace && options.subspace <= problem.size());
  Operator apply(inverse, found, mass_times_found);
  Eigen::VectorXd start = start_vector(problem.size(), options.seed);
  apply.set_scale(matching_scale(problem, apply, start));
  const std::scoped_lock lock(arpack_mutex());
  Arpack arpack(problem.size(), options, std::move(start));
  arpack.iterate(problem, apply, options.tolerance);
  return arpack.parameters[4] > 0 ? arpack.vectors(options.tolerance) : Eigen::MatrixXd(problem.size(), 0);
}

}  // namespace limber::internal
