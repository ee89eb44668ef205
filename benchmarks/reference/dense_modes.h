/// @file dense_modes.h
/// All modes of small models, by a dense solver.
#pragma once

#include <Eigen/Core>

namespace limber::testing {

/// K W = M W Λ with WᵀMW = I.
struct DenseModes {
  Eigen::VectorXd lambda;  // ascending
  Eigen::MatrixXd W;       // one mode a column
};

/// @param K symmetric
/// @param M symmetric, positive definite
DenseModes dense_modes(const Eigen::MatrixXd& K, const Eigen::MatrixXd& M);

}  // namespace limber::testing
