/// @file sparse_operations.h
/// The few things the solvers do with sparse and tall dense matrices.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "limber/precompute/sparse_matrix.h"

namespace limber::internal {

/// The rows and columns listed in `kept` (ascending), renumbered in that order.
SparseMatrix principal_submatrix(const SparseMatrix& A, std::span<const Index> kept);

/// A X for a symmetric A.
Eigen::MatrixXd multiply(const SparseMatrix& A, const Eigen::Ref<const Eigen::MatrixXd>& X);

/// An estimate of ‖A‖₂ from below, for a symmetric positive semidefinite A; deterministic.
double norm_estimate(const SparseMatrix& A);

/// The mass of every node and pair of nodes, acting alike on the three axes: (M ⊗ I₃) X.
Eigen::MatrixXd multiply_by_axes(const SparseMatrix& node_mass, const Eigen::Ref<const Eigen::MatrixXd>& X);

/// K + s (M ⊗ I₃). The pattern of M ⊗ I₃ must lie within that of K.
SparseMatrix add_mass(const SparseMatrix& K, double s, const SparseMatrix& node_mass);

/// Entry i of a fixed sequence of numbers spread evenly over (−1, 1), the same on every machine.
double scattered(std::uint64_t seed, std::uint64_t i);

}  // namespace limber::internal
