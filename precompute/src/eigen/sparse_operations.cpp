#include "eigen/sparse_operations.h"

#include <cassert>
#include <cmath>

namespace limber::internal {

SparseMatrix principal_submatrix(const SparseMatrix& A, std::span<const Index> kept) {
  std::vector<Index> place(A.size, -1);
  for (std::size_t i = 0; i < kept.size(); ++i) place[kept[i]] = static_cast<Index>(i);
  SparseMatrix B;
  B.size = static_cast<Index>(kept.size());
  B.column_start.reserve(kept.size() + 1);
  B.column_start.push_back(0);
  B.row.reserve(A.row.size());
  B.value.reserve(A.row.size());
  for (const Index column : kept) {
    for (Index e = A.column_start[column]; e < A.column_start[column + 1]; ++e)
      if (place[A.row[e]] >= 0) {
        B.row.push_back(place[A.row[e]]);
        B.value.push_back(A.value[e]);
      }
    B.column_start.push_back(static_cast<Index>(B.row.size()));
  }
  return B;
}

Eigen::MatrixXd multiply(const SparseMatrix& A, const Eigen::Ref<const Eigen::MatrixXd>& X) {
  assert(X.rows() == A.size);
  Eigen::MatrixXd Y(A.size, X.cols());
  for (Eigen::Index c = 0; c < X.cols(); ++c) {
    const double* x = X.col(c).data();
    for (Index j = 0; j < A.size; ++j) {
      double sum = 0.0;  // symmetric: column j is row j
      for (Index e = A.column_start[j]; e < A.column_start[j + 1]; ++e) sum += A.value[e] * x[A.row[e]];
      Y(j, c) = sum;
    }
  }
  return Y;
}

Eigen::MatrixXd multiply_by_axes(const SparseMatrix& node_mass, const Eigen::Ref<const Eigen::MatrixXd>& X) {
  assert(X.rows() == 3 * node_mass.size);
  Eigen::MatrixXd Y(X.rows(), X.cols());
  for (Eigen::Index c = 0; c < X.cols(); ++c) {
    const double* x = X.col(c).data();
    double* y = Y.col(c).data();
    for (Index j = 0; j < node_mass.size; ++j) {
      Vec3 sum = Vec3::Zero();
      for (Index e = node_mass.column_start[j]; e < node_mass.column_start[j + 1]; ++e)
        sum += node_mass.value[e] * Eigen::Map<const Vec3>(x + 3 * node_mass.row[e]);
      Eigen::Map<Vec3>(y + 3 * j) = sum;
    }
  }
  return Y;
}

SparseMatrix add_mass(const SparseMatrix& K, double s, const SparseMatrix& node_mass) {
  SparseMatrix sum = K;
  for (Index j = 0; j < node_mass.size; ++j)
    for (int axis = 0; axis < 3; ++axis) {
      Index e = K.column_start[3 * j + axis];
      for (Index m = node_mass.column_start[j]; m < node_mass.column_start[j + 1]; ++m) {
        while (K.row[e] != 3 * node_mass.row[m] + axis) ++e;
        sum.value[e] += s * node_mass.value[m];
      }
    }
  return sum;
}

double norm_estimate(const SparseMatrix& A) {
  constexpr int kSteps = 20;  // power iteration: a few per cent below ‖A‖ is all the accuracy a bound needs
  Eigen::MatrixXd x(A.size, 1);
  for (Index i = 0; i < A.size; ++i) x(i) = scattered(0, i);
  double norm = 0.0;
  for (int step = 0; step < kSteps && x.norm() > 0.0; ++step) {
    x /= x.norm();
    x = multiply(A, x);
    norm = x.norm();
  }
  return norm;
}

double scattered(std::uint64_t seed, std::uint64_t i) {
  // A counter passed through a multiply-and-fold hash; the multiplier is 2⁶⁴ over the golden ratio.
  std::uint64_t x = (i + 1) * 0x9e3779b97f4a7c15ULL + (seed + 1) * 0xd1b54a32d192ed03ULL;
  for (int round = 0; round < 3; ++round) {
    x ^= x >> 32;
    x *= 0x9e3779b97f4a7c15ULL;
  }
  return std::ldexp(static_cast<double>(x >> 11), -52) - 1.0;
}

}  // namespace limber::internal
