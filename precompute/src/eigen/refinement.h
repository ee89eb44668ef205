/// @file refinement.h
/// Answers of an inverse, improved by what they leave of their loads.
#pragma once

#include <Eigen/Core>

namespace limber::internal {

/// U = apply(F), then U += apply(residual(U)) as long as that changes it.
/// @param apply the inverse on columns. @param residual F less what U is the answer to. @param lengths by column
template <class Apply, class Residual, class Lengths>
Eigen::MatrixXd refined_answer(const Eigen::Ref<const Eigen::MatrixXd>& F, const Apply& apply, const Residual& residual,
                               const Lengths& lengths) {
  constexpr int kMaxRefinements = 8;
  constexpr double kRefined = 1e-12;     // a correction this small, relative to the answer, was the last
  constexpr double kContraction = 0.25;  // a correction must be this much smaller than the one before
  Eigen::MatrixXd U = apply(F);
  double change_before = 1.0;
  for (int step = 0; step < kMaxRefinements; ++step) {
    const Eigen::MatrixXd correction = apply(residual(U));
    const double change = (lengths(correction) / lengths(U)).maxCoeff();
    if (change > kContraction * change_before) break;  // no longer improves
    U += correction;
    if (change < kRefined) break;
    change_before = change;
  }
  return U;
}

}  // namespace limber::internal
