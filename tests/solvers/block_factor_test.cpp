// The sparse factor of bodies that touch, against a dense one.
#include "limber/solvers/block_factor.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>
#include <vector>

#include "counted_new.h"

namespace limber::internal {
namespace {

using Edge = std::pair<std::size_t, std::size_t>;

/// 1 + Σ Gᵀ G over the pairs of a graph, as a contact adds it, with its bodies' numbers at their own places.
struct System {
  std::vector<std::size_t> widths, first;
  std::vector<Edge> edges;
  Eigen::MatrixXd M;

  System(std::size_t nodes, std::size_t pairs, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::size_t size = 0;
    for (std::size_t i = 0; i < nodes; ++i) {
      widths.push_back(1 + random() % 21);
      first.push_back(size);
      size += widths.back();
    }
    M = Eigen::MatrixXd::Identity(static_cast<Eigen::Index>(size), static_cast<Eigen::Index>(size));
    for (std::size_t p = 0; p < pairs; ++p) {
      const std::size_t a = random() % nodes, b = random() % nodes;
      if (a == b) continue;
      edges.emplace_back(a, b);
      Eigen::MatrixXd G = Eigen::MatrixXd::Zero(3, M.cols());
      for (const std::size_t node : {a, b})
        for (std::size_t k = 0; k < widths[node]; ++k)
          for (int r = 0; r < 3; ++r) G(r, static_cast<Eigen::Index>(first[node] + k)) = 30.0 * normal(random);
      M += G.transpose() * G;
    }
  }

  void write(BlockFactor& factor) const {
    factor.set_identity();
    const auto write_block = [&](std::size_t i, std::size_t j) {
      const BlockFactor::Block block = factor.block(i, j);
      for (std::size_t p = 0; p < widths[i]; ++p)
        for (std::size_t q = 0; q < widths[j]; ++q)
          factor.upper(block)[p * block.stride + q] =
              M(static_cast<Eigen::Index>(first[i] + p), static_cast<Eigen::Index>(first[j] + q));
    };
    for (std::size_t i = 0; i < widths.size(); ++i) write_block(i, i);
    for (const auto& [a, b] : edges) factor.comes_first(a, b) ? write_block(a, b) : write_block(b, a);
  }

  Eigen::VectorXd solve(BlockFactor& factor, const Eigen::VectorXd& b) const {
    AlignedBuffer memory;
    double* x = memory.need(factor.size());
    std::fill_n(x, factor.size(), 0.0);
    for (std::size_t i = 0; i < widths.size(); ++i) std::copy_n(b.data() + first[i], widths[i], x + factor.first(i));
    factor.solve(x);
    Eigen::VectorXd result(b.size());
    for (std::size_t i = 0; i < widths.size(); ++i)
      std::copy_n(x + factor.first(i), widths[i], result.data() + first[i]);
    return result;
  }
};

void place(const System& system, BlockFactor& factor) {
  factor.begin_pattern(system.widths);
  for (const auto& [a, b] : system.edges) factor.add_edge(a, b);
  factor.end_pattern();
}

TEST(BlockFactor, SolvesAsADenseFactorDoes) {
  BlockFactor factor;
  for (unsigned seed = 0; seed < 60; ++seed) {
    const System system(1 + seed % 12, 2 * (seed % 17), seed);
    place(system, factor);
    system.write(factor);
    ASSERT_TRUE(factor.factor()) << seed;
    const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(system.M.cols(), -1.0, 2.0);
    const Eigen::VectorXd x = system.solve(factor, b);
    // Backward stability: what is missing, by the size of the terms.
    EXPECT_LE((system.M * x - b).norm(), 1e-12 * system.M.norm() * x.norm()) << seed;
  }
}

TEST(BlockFactor, WhatIsLeftOfKeptNodesIsTheSchurComplement) {
  BlockFactor factor;
  for (unsigned seed = 0; seed < 30; ++seed) {
    const System system(4 + seed % 9, 3 * (seed % 11), seed);
    const std::size_t nodes = system.widths.size();
    const std::vector<std::size_t> kept{0, nodes / 2, nodes - 1};
    factor.begin_pattern(system.widths);
    for (const auto& [a, b] : system.edges) factor.add_edge(a, b);
    for (const std::size_t i : kept) {
      factor.keep(i);
      for (const std::size_t j : kept) factor.add_edge(i, j);
    }
    factor.end_pattern();
    system.write(factor);
    ASSERT_TRUE(factor.factor()) << seed;

    // (M⁻¹) of the kept rows and columns is the inverse of the Schur complement.
    Eigen::Index size = 0;
    std::vector<Eigen::Index> at, rows;
    for (const std::size_t i : kept) {
      at.push_back(size);
      for (std::size_t k = 0; k < system.widths[i]; ++k) rows.push_back(static_cast<Eigen::Index>(system.first[i] + k));
      size += static_cast<Eigen::Index>(system.widths[i]);
    }
    Eigen::MatrixXd S(size, size);
    for (std::size_t i = 0; i < kept.size(); ++i)
      for (std::size_t j = 0; j < kept.size(); ++j) {
        if (i != j && !factor.comes_first(kept[i], kept[j])) continue;
        const BlockFactor::Block block = factor.block(kept[i], kept[j]);
        for (std::size_t p = 0; p < system.widths[kept[i]]; ++p)
          for (std::size_t q = 0; q < system.widths[kept[j]]; ++q) {
            const auto row = at[i] + static_cast<Eigen::Index>(p), column = at[j] + static_cast<Eigen::Index>(q);
            S(row, column) = S(column, row) = factor.upper(block)[p * block.stride + q];
          }
      }
    const Eigen::MatrixXd inverse = Eigen::MatrixXd(system.M.inverse())(rows, rows);
    EXPECT_LE((S * inverse - Eigen::MatrixXd::Identity(size, size)).norm(), 1e-9 * S.norm() * inverse.norm()) << seed;

    const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(system.M.cols(), -1.0, 2.0);
    AlignedBuffer memory;
    double* x = memory.need(factor.size());
    for (std::size_t i = 0; i < nodes; ++i)
      std::copy_n(b.data() + system.first[i], system.widths[i], x + factor.first(i));
    factor.reduce(x);
    Eigen::VectorXd condensed(size);
    for (std::size_t i = 0; i < kept.size(); ++i)
      std::copy_n(x + factor.first(kept[i]), system.widths[kept[i]], condensed.data() + at[i]);
    condensed = S.ldlt().solve(condensed).eval();
    for (std::size_t i = 0; i < kept.size(); ++i)
      std::copy_n(condensed.data() + at[i], system.widths[kept[i]], x + factor.first(kept[i]));
    factor.expand(x);
    Eigen::VectorXd result(b.size());
    for (std::size_t i = 0; i < nodes; ++i)
      std::copy_n(x + factor.first(i), system.widths[i], result.data() + system.first[i]);
    EXPECT_LE((system.M * result - b).norm(), 1e-10 * system.M.norm() * result.norm()) << seed;
  }
}

TEST(BlockFactor, RefusesWhatIsNotPositive) {
  System system(4, 6, 3);
  system.M(5, 5) = -1.0;
  BlockFactor factor;
  place(system, factor);
  system.write(factor);
  EXPECT_FALSE(factor.factor());
}

TEST(BlockFactor, AWarmPatternAllocatesNothing) {
  const System system(8, 20, 5);
  BlockFactor factor;
  const auto run = [&] {
    place(system, factor);
    system.write(factor);
    return factor.factor();
  };
  ASSERT_TRUE(run());
  const long before = testing::allocations();
  ASSERT_TRUE(run());
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace limber::internal
