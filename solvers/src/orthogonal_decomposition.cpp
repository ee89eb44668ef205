// The one file of this module that instantiates an Eigen decomposition.
#include <Eigen/QR>

#include "argument_checks.h"
#include "limber/solvers/least_squares.h"

namespace limber {
using namespace internal;  // kernels and checks

void solve_by_orthogonal_decomposition(std::span<const double> J, std::span<const double> metric,
                                       std::span<const double> r, std::span<double> f, double rank_tolerance) {
  const char* name = "solve_by_orthogonal_decomposition";
  check_length(name, "J", J.size(), r.size() * metric.size());
  check_length(name, "f", f.size(), r.size());
  check_option(name, "rank_tolerance", rank_tolerance > 0.0, rank_tolerance, "> 0");
  const auto m = static_cast<Eigen::Index>(r.size()), d = static_cast<Eigen::Index>(metric.size());
  Eigen::Map<Eigen::VectorXd> force(f.data(), m);
  force.setZero();
  if (m == 0 || d == 0) return;
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::MatrixXd B = Eigen::Map<const RowMajor>(J.data(), m, d) *
                            Eigen::Map<const Eigen::VectorXd>(metric.data(), d).cwiseSqrt().asDiagonal();
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> cod;
  cod.setThreshold(std::sqrt(rank_tolerance));  // of singular values, not of their squares
  cod.compute(B);
  // (B Bᵀ)⁺ = (B⁺)ᵀ B⁺
  const Eigen::VectorXd u = cod.solve(Eigen::Map<const Eigen::VectorXd>(r.data(), m));
  force = cod.transpose().solve(u);
}

}  // namespace limber
