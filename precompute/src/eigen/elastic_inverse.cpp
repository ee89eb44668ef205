#include "eigen/elastic_inverse.h"

#include <Eigen/QR>
#include <algorithm>
#include <numeric>

#include "eigen/refinement.h"
#include "eigen/sparse_operations.h"
#include "limber/core/error.h"

namespace limber::internal {
namespace {

std::vector<Index> all_but(Index size, const std::vector<Index>& left_out) {
  std::vector<Index> all(size), kept;
  std::iota(all.begin(), all.end(), 0);
  std::set_difference(all.begin(), all.end(), left_out.begin(), left_out.end(), std::back_inserter(kept));
  return kept;
}

/// The order of elimination of the kept degrees of freedom, in their own numbering.
std::vector<Index> order_of_kept(const std::vector<Index>& node_order, const std::vector<Index>& kept, Index size) {
  std::vector<Index> place(size, -1), order;
  for (std::size_t i = 0; i < kept.size(); ++i) place[kept[i]] = static_cast<Index>(i);
  order.reserve(kept.size());
  for (const Index node : node_order)
    for (Index dof = 3 * node; dof < 3 * node + 3; ++dof)
      if (place[dof] >= 0) order.push_back(place[dof]);
  return order;
}

}  // namespace

std::vector<Index> choose_pins(const Eigen::MatrixXd& N) {
  if (N.cols() == 0) return {};
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(N.transpose());
  const auto& chosen = qr.colsPermutation().indices();
  std::vector<Index> pins(chosen.data(), chosen.data() + N.cols());
  std::sort(pins.begin(), pins.end());
  return pins;
}

Eigen::MatrixXd ScaledProblem::mass_times(const Eigen::Ref<const Eigen::MatrixXd>& X) const {
  return multiply_by_axes(node_mass, X);
}

ElasticInverse::ElasticInverse(const ScaledProblem& problem, const std::vector<Index>& node_order)
    : SpectralInverse(problem),
      pinned_(choose_pins(problem.N)),
      kept_(all_but(problem.size(), pinned_)),
      solver_(factor(node_order)) {}

CholeskySolver ElasticInverse::factor(const std::vector<Index>& node_order) {
  const Index size = problem_.size();
  CholeskySolver pinned(principal_submatrix(problem_.K, kept_), order_of_kept(node_order, kept_, size));
  if (pinned.definite()) return pinned;
  pinned_.clear();
  kept_ = all_but(size, pinned_);
  const auto order = order_of_kept(node_order, kept_, size);
  // From a little above round-off of K, tenfold until it works.
  for (shift_ = 1e-15; shift_ < 1.0; shift_ *= 10.0) {
    CholeskySolver shifted(add_mass(problem_.K, shift_, problem_.node_mass), order);
    if (shifted.definite()) return shifted;
  }
  throw ComputationError(
      "the stiffness matrix is not positive definite in floating point: look for tetrahedra that are nearly flat, or "
      "materials whose stiffnesses differ by more than about 1e12");
}

Eigen::MatrixXd ElasticInverse::answer(const Eigen::Ref<const Eigen::MatrixXd>& balanced) {
  Eigen::MatrixXd U = Eigen::MatrixXd::Zero(balanced.rows(), balanced.cols());
  U(kept_, Eigen::all) = solver_.solve(balanced(kept_, Eigen::all));
  return U;
}

ShiftedInverse::ShiftedInverse(const ScaledProblem& problem, const std::vector<Index>& node_order, double sigma)
    : SpectralInverse(problem, -sigma), factor_(problem.K, node_order, IndefiniteFactor::Keeps::kFactor) {
  factor_.factor(add_mass(problem.K, shift_, problem.node_mass));
}

Eigen::MatrixXd ShiftedInverse::answer(const Eigen::Ref<const Eigen::MatrixXd>& balanced) {
  return factor_.solve(balanced);
}

Eigen::MatrixXd SpectralInverse::apply(const Eigen::Ref<const Eigen::MatrixXd>& F) {
  const auto& [N, MN] = std::tie(problem_.N, problem_.MN);
  solves_ += static_cast<int>(F.cols());
  Eigen::MatrixXd U = answer(F - MN * (N.transpose() * F));
  U -= N * (MN.transpose() * U);
  return U;
}

Eigen::MatrixXd SpectralInverse::apply_accurately(const Eigen::Ref<const Eigen::MatrixXd>& F) {
  const Eigen::MatrixXd& MN = problem_.MN;
  const auto lengths = [&](const Eigen::MatrixXd& X) -> Eigen::ArrayXd {
    return X.cwiseProduct(problem_.mass_times(X)).colwise().sum().cwiseSqrt().transpose();
  };
  const auto residual = [&](const Eigen::MatrixXd& U) {
    Eigen::MatrixXd left = F - MN * (problem_.N.transpose() * F) - problem_.stiffness_times(U);
    if (shift_ != 0.0) left -= shift_ * problem_.mass_times(U);
    return left;
  };
  return refined_answer(
      F, [&](const auto& X) { return apply(X); }, residual, lengths);
}

}  // namespace limber::internal
