#include "eigen/canonical_modes.h"

#include <Eigen/Householder>

namespace limber::internal {
namespace {

constexpr double kTie = 1e-6;

Eigen::Index first_of_the_largest_rows(const Eigen::Ref<const Eigen::MatrixXd>& W) {
  const Eigen::VectorXd norms = W.rowwise().norm();
  const double enough = (1.0 - kTie) * norms.maxCoeff();
  Eigen::Index row = 0;
  while (norms[row] < enough) ++row;
  return row;
}

}  // namespace

void make_canonical(Eigen::Ref<Eigen::MatrixXd> W) {
  for (Eigen::Index first = 0; first < W.cols(); ++first) {
    auto rest = W.rightCols(W.cols() - first);
    const Eigen::Index pivot = first_of_the_largest_rows(rest);
    const Eigen::VectorXd row = rest.row(pivot);
    Eigen::VectorXd essential(row.size() - 1);
    double scale = 0.0, head = 0.0;
    row.makeHouseholder(essential, scale, head);
    Eigen::VectorXd workspace(rest.rows());
    rest.applyHouseholderOnTheRight(essential, scale, workspace.data());
    if (rest(pivot, 0) < 0.0) rest.col(0) = -rest.col(0);
  }
}

}  // namespace limber::internal
