#include "limber/precompute/eigenvalue_count.h"

#include <gtest/gtest.h>

#include <numeric>

#include "dense_eigenvalues.h"
#include "eigen/elastic_modes.h"
#include "eigen/sparse_operations.h"
#include "limber/core/error.h"
#include "limber/precompute/fem.h"
#include "tet_box.h"

namespace limber {
namespace {

using internal::complete;
using internal::EigenPairs;
using internal::ElasticInverse;
using internal::lowest_modes;
using internal::multiply;
using internal::order_nodes;
using internal::principal_submatrix;
using internal::ScaledProblem;
using internal::scattered;
using testing::nodes_where;
using testing::tet_box;

const Material kUnit{.youngs_modulus = 1.0, .poisson_ratio = 0.3, .density = 1.0};

TEST(EigenvalueCount, IsThatOfADenseSolver) {
  const TetMesh mesh = tet_box(4, 3, 2, {1.0, 0.9, 0.8});
  const auto K = assemble_stiffness(mesh, std::span(&kUnit, 1));
  const auto M = assemble_mass(mesh, std::span(&kUnit, 1), MassKind::kConsistent);
  const auto lambda = testing::dense_eigenvalues(testing::dense_model(mesh, std::span(&kUnit, 1), false));
  EigenvalueCounter counter(K, M, order_nodes(K));
  EXPECT_EQ(counter.below(-0.1), 0);
  EXPECT_EQ(counter.below(lambda[6] / 2), 6);
  for (int i = 7; i < lambda.size(); i += 11)
    if (lambda[i] - lambda[i - 1] > 1e-6 * lambda[i]) {
      EXPECT_EQ(counter.below((lambda[i] + lambda[i - 1]) / 2), i) << "lambda " << lambda[i];
    }
  EXPECT_EQ(counter.below(2.0 * lambda[lambda.size() - 1]), lambda.size());
}

TEST(EigenvalueCount, RefusesMatricesThatDoNotBelongTogether) {
  const TetMesh mesh = tet_box(1, 1.0);
  const auto K = assemble_stiffness(mesh, std::span(&kUnit, 1));
  const std::vector<Index> short_order{0, 1, 2};
  EXPECT_THROW(EigenvalueCounter(K, assemble_mass(mesh, std::span(&kUnit, 1), MassKind::kLumped), short_order),
               InvalidArgument);
}

/// A clamped block: no null space, so that a test can build the problem by itself.
struct ClampedBlock : ::testing::Test {
  ScaledProblem problem;
  std::vector<Index> order;

  ClampedBlock() {
    const TetMesh mesh = tet_box(6, 4, 4, {1.0, 0.5, 0.6});
    const auto free_nodes = nodes_where(mesh, [](const Vec3& x) { return x.x() > 0.0; });
    std::vector<Index> dofs;
    for (const Index node : free_nodes)
      for (Index axis = 0; axis < 3; ++axis) dofs.push_back(3 * node + axis);
    problem.K = principal_submatrix(assemble_stiffness(mesh, std::span(&kUnit, 1)), dofs);
    problem.node_mass = principal_submatrix(assemble_mass(mesh, std::span(&kUnit, 1), MassKind::kLumped), free_nodes);
    problem.N = problem.MN = Eigen::MatrixXd(problem.size(), 0);
    problem.stiffness_times = [this](const Eigen::MatrixXd& X) { return multiply(problem.K, X); };
    order = order_nodes(problem.K);
  }
};

TEST_F(ClampedBlock, TheCertificateFindsAModeThatWasLeftOut) {
  ElasticInverse inverse(problem, order);
  EigenvalueCounter counter(problem.K, problem.node_mass, order);
  Eigen::Index kept = 0;
  const EigenPairs whole = lowest_modes(problem, inverse, 12, {}, kept);
  for (const std::vector<Eigen::Index>& left_out : {std::vector<Eigen::Index>{0}, {4}, {3, 4, 9}}) {
    std::vector<Eigen::Index> remaining;
    for (Eigen::Index i = 0; i < whole.count(); ++i)
      if (std::find(left_out.begin(), left_out.end(), i) == left_out.end()) remaining.push_back(i);
    EigenPairs pairs{
        .lambda = whole.lambda(remaining), .W = whole.W(Eigen::all, remaining), .MW = whole.MW(Eigen::all, remaining)};
    complete(problem, inverse, counter, pairs, 12, kept);
    ASSERT_GE(pairs.count(), 12);
    for (Eigen::Index i = 0; i < 12; ++i) EXPECT_NEAR(pairs.lambda[i], whole.lambda[i], 1e-10 * whole.lambda[i]) << i;
  }
}

TEST_F(ClampedBlock, TheCertificateRefusesAModeThatIsNotThere) {
  ElasticInverse inverse(problem, order);
  EigenvalueCounter counter(problem.K, problem.node_mass, order);
  Eigen::Index kept = 0;
  EigenPairs pairs = lowest_modes(problem, inverse, 12, {}, kept);
  const Eigen::Index last = pairs.count() - 1;
  std::vector<Eigen::Index> with_a_double(pairs.count() + 1);
  std::iota(with_a_double.begin() + 1, with_a_double.end(), 0);
  with_a_double[0] = 0;
  const EigenPairs wrong{.lambda = pairs.lambda(with_a_double).eval(),
                         .W = pairs.W(Eigen::all, with_a_double),
                         .MW = pairs.MW(Eigen::all, with_a_double)};
  ASSERT_EQ(wrong.count(), last + 2);
  EigenPairs copy = wrong;
  EXPECT_THROW(complete(problem, inverse, counter, copy, 13, kept), ComputationError);
}

TEST_F(ClampedBlock, PinnedInverseSolvesTheElasticProblem) {
  ElasticInverse inverse(problem, order);
  Eigen::MatrixXd F(problem.size(), 40);  // more than one block
  for (Eigen::Index i = 0; i < F.size(); ++i) F.data()[i] = scattered(5, i);
  EXPECT_LT((multiply(problem.K, inverse.apply(F)) - F).norm(), 1e-11 * F.norm());
  EXPECT_EQ(inverse.solves(), 40);
  EXPECT_EQ(inverse.shift(), 0.0);
}

}  // namespace
}  // namespace limber
