#include "dense_modes.h"

#include <Eigen/Eigenvalues>

namespace limber::testing {

DenseModes dense_modes(const Eigen::MatrixXd& K, const Eigen::MatrixXd& M) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(K, M);
  return {.lambda = solver.eigenvalues(), .W = solver.eigenvectors()};
}

}  // namespace limber::testing
