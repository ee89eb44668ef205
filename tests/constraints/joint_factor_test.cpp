// The block factor of joints against dense matrices.
#include "game/joint_factor.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace limber::internal {
namespace {

using Pairs = std::vector<JointFactor::Pair>;

/// J Jᵀ of random rows of nodes that share bodies, in the factor and dense.
struct Problem {
  Problem(std::size_t nodes, const Pairs& graph, const std::vector<std::int32_t>& node_sizes) : sizes(node_sizes) {
    factor.set_graph(nodes, graph);
    factor.begin(sizes);
    for (std::size_t i = 0; i < nodes; ++i) size += sizes[i];
    dense = Eigen::MatrixXd::Zero(size, size);
    for (std::size_t i = 0; i < nodes; ++i) {
      const Eigen::MatrixXd own = random(sizes[i], sizes[i]);
      const Eigen::MatrixXd block =
          own * own.transpose() + 40.0 * Eigen::MatrixXd::Identity(sizes[i], sizes[i]);  // more than its neighbours'
      put(i, i, block, factor.diagonal(i));
    }
    for (std::size_t c = 0; c < graph.size(); ++c) {
      const auto rows = static_cast<std::size_t>(factor.rows_of(c)), a = static_cast<std::size_t>(graph[c][0]),
                 b = static_cast<std::size_t>(graph[c][1]), columns = rows == a ? b : a;
      const Eigen::MatrixXd block = random(sizes[rows], sizes[columns]);
      put(rows, columns, block, factor.block(c));
      dense.block(first(columns), first(rows), sizes[columns], sizes[rows]) = block.transpose();
    }
    factor.factor();
  }
  Eigen::MatrixXd random(Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd::NullaryExpr(rows, columns,
                                        [&] { return std::uniform_real_distribution(-1.0, 1.0)(numbers); });
  }
  Eigen::Index first(std::size_t node) const { return static_cast<Eigen::Index>(factor.first(node)); }
  void put(std::size_t row, std::size_t column, const Eigen::MatrixXd& block, double* to) {
    dense.block(first(row), first(column), block.rows(), block.cols()) = block;
    for (Eigen::Index i = 0; i < block.rows(); ++i)
      for (Eigen::Index j = 0; j < block.cols(); ++j) to[i * block.cols() + j] = block(i, j);
  }
  /// Largest error of three right-hand sides.
  double error() {
    using Sides = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
    Sides x = random(size, 3);
    const Sides expected = dense.ldlt().solve(x);
    factor.solve<3>({x.data(), static_cast<std::size_t>(x.size())});
    return (x - expected).cwiseAbs().maxCoeff();
  }
  std::mt19937 numbers{7};
  JointFactor factor;
  std::vector<std::int32_t> sizes;
  Eigen::Index size = 0;
  Eigen::MatrixXd dense;
};

TEST(JointFactor, SolvesChainsTreesAndLoops) {
  const Pairs chain{{0, 1}, {1, 2}, {2, 3}, {3, 4}}, star{{0, 1}, {0, 2}, {0, 3}, {0, 4}, {1, 2}},
      loop{{0, 1}, {0, 4}, {1, 2}, {2, 3}, {3, 4}}, apart{{0, 3}};
  for (const Pairs& graph : {chain, star, loop, apart})
    for (const std::vector<std::int32_t>& sizes :
         {std::vector<std::int32_t>{3, 3, 3, 3, 3}, {6, 5, 3, 1, 2}, {3, 0, 3, 4, 0}})
      EXPECT_LT(Problem(5, graph, sizes).error(), 1e-9);
}

TEST(JointFactor, WhereNeighboursAreManyItLeavesOutWhatKeepsIterationConverging) {
  constexpr std::int32_t kNodes = 30;
  Pairs ring;  // each node with the five on either side
  for (std::int32_t i = 0; i < kNodes; ++i)
    for (std::int32_t j = i + 1; j < kNodes; ++j)
      if (std::min(j - i, kNodes + i - j) <= 5) ring.push_back({i, j});
  Problem problem(kNodes, ring, std::vector<std::int32_t>(kNodes, 3));
  ASSERT_FALSE(problem.factor.is_complete());
  const Eigen::VectorXd right = problem.random(problem.size, 1), expected = problem.dense.ldlt().solve(right);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(problem.size);
  double before = (x - expected).dot(problem.dense * (x - expected));
  for (int i = 0; i < 60; ++i) {
    Eigen::VectorXd change = right - problem.dense * x;
    problem.factor.solve<1>({change.data(), static_cast<std::size_t>(change.size())});
    x += change;
    const double now = (x - expected).dot(problem.dense * (x - expected));
    EXPECT_LE(now, before + 1e-12);
    before = now;
  }
  EXPECT_LT((x - expected).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(JointFactor, RowsThatSayTheSameShareAndThoseThatContradictMeetInTheMiddle) {
  JointFactor factor;
  const std::vector<std::int32_t> sizes{1, 1};
  factor.set_graph(2, Pairs{{0, 1}});
  factor.begin(sizes);
  *factor.diagonal(0) = *factor.diagonal(1) = *factor.block(0) = 2.0;
  factor.factor();
  std::vector<double> same{1.0, 1.0}, apart{1.0, 0.0};
  factor.solve<1>(same);
  EXPECT_NEAR(same[0], 0.25, 1e-6);
  EXPECT_NEAR(same[1], 0.25, 1e-6);
  factor.solve<1>(apart);
  EXPECT_NEAR(2.0 * (apart[0] + apart[1]), 0.5, 1e-6) << "where their body goes";
}

}  // namespace
}  // namespace limber::internal
