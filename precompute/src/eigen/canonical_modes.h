/// @file canonical_modes.h
/// One choice among the many that equal eigenvalues leave: the same shapes from every run and every start vector.
#pragma once

#include <Eigen/Core>

namespace limber::internal {

/// Turns the columns of W within their span, which stays the same, and so does WᵀW and, for an M-orthonormal W, WᵀMW.
/// The row of largest norm becomes (r, 0, 0, …) with r > 0; then the same for the other columns. Rows within 1e-6 of
/// the largest count as equally large, and the first of them is taken: a symmetric body has several. One column: its
/// largest entry becomes positive.
void make_canonical(Eigen::Ref<Eigen::MatrixXd> W);

}  // namespace limber::internal
