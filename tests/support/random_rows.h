// Random rows of constraints and their metric, for tests of dense solvers.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <span>

namespace limber::testing {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct Rows {
  Matrix J;
  Eigen::VectorXd metric;
  Matrix S() const { return J * metric.asDiagonal() * J.transpose(); }
};

inline std::span<const double> span_of(const Matrix& M) { return {M.data(), static_cast<std::size_t>(M.size())}; }
inline std::span<const double> span_of(const Eigen::VectorXd& v) {
  return {v.data(), static_cast<std::size_t>(v.size())};
}
inline std::span<double> span_of(Eigen::VectorXd& v) { return {v.data(), static_cast<std::size_t>(v.size())}; }

inline Eigen::VectorXd random_vector(Eigen::Index n, std::mt19937& random) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd v(n);
  for (double& x : v) x = normal(random);
  return v;
}

/// m rows of rank ≤ `rank` over d degrees of freedom, with a metric that spans two decades.
inline Rows make_rows(int m, int d, int rank, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Rows rows{.J = Matrix(m, d), .metric = Eigen::VectorXd(d)};
  for (double& x : rows.J.reshaped()) x = uniform(random);
  for (double& x : rows.metric) x = std::pow(10.0, uniform(random));
  for (int i = rank; i < m; ++i) rows.J.row(i) = rows.J.row(i % rank) * (1.0 + 0.5 * (i / rank));
  return rows;
}

}  // namespace limber::testing
