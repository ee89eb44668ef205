#include "game/row_kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <random>
#include <vector>

#include "instruction_sets.h"

namespace limber::internal {
namespace {

/// Constraints of one row to seven on a few bodies of one block to three.
class RowKernels : public ::testing::Test {
 protected:
  static constexpr std::int32_t kFrames = 5;

  RowKernels() {
    for (std::int32_t frame = 0; frame < kFrames; ++frame)
      first_.push_back(blocks_), sizes_.push_back(1 + frame % 3), blocks_ += sizes_.back();
    for (std::int32_t g = 0; g < 14; ++g) {
      GameGroup group;
      group.first = static_cast<std::uint32_t>(rows_), group.count = static_cast<std::uint32_t>(1 + g % 7);
      group.sides[0] = side(g % kFrames, group.count);
      if (g % 4 != 0) group.sides[1] = side((g + 1) % kFrames, group.count);
      rows_ += static_cast<Eigen::Index>(group.count);
      groups_.push_back(group);
    }
    for (Double8& block : numbers_) fill(block, 0.0);
    weights_.resize(kFrames);
    for (Double8& block : weights_) fill(block, 2.0);
    for (std::int32_t b = 0; b < blocks_; ++b) fill(y_.emplace_back(), 0.0);
  }

  GameSide side(std::int32_t frame, std::uint32_t rows) {
    const auto at = static_cast<std::size_t>(frame);
    const GameSide out{frame, sizes_[at], first_[at], static_cast<std::int32_t>(numbers_.size())};
    numbers_.resize(numbers_.size() + rows * static_cast<std::size_t>(sizes_[at]));
    return out;
  }
  void fill(Double8& block, double about) {
    for (double& x : block.v) x = about + number_(random_);
  }
  static Eigen::VectorXd whole(const std::vector<Double8>& blocks) {
    return Eigen::Map<const Eigen::VectorXd>(blocks.front().v, static_cast<Eigen::Index>(8 * blocks.size()));
  }
  Eigen::MatrixXd J() const {
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(rows_, 8 * blocks_);
    for (const GameGroup& group : groups_)
      for (const GameSide& at : group.sides)
        for (std::int32_t k = 0; at.frame >= 0 && k < static_cast<std::int32_t>(group.count) * at.blocks; ++k)
          for (std::int32_t l = 0; l < 8; ++l)
            out(static_cast<Eigen::Index>(group.first) + k / at.blocks, 8 * (at.body + k % at.blocks) + l) =
                numbers_[static_cast<std::size_t>(at.at + k)].v[l];
    return out;
  }
  Eigen::VectorXd W() const {
    Eigen::VectorXd out = Eigen::VectorXd::Ones(8 * blocks_);
    for (std::size_t frame = 0; frame < kFrames; ++frame)
      for (std::int32_t l = 0; l < 8; ++l) out[8 * first_[frame] + l] = weights_[frame].v[l];
    return out;
  }
  Eigen::VectorXd forces() const { return Eigen::VectorXd::LinSpaced(rows_, -1.0, 2.0); }
  std::vector<double> product() const {
    std::vector<double> out(static_cast<std::size_t>(rows_), 7.0);
    multiply_rows(arrays(), y_.data(), out.data());
    return out;
  }
  std::vector<Double8> answer() const {
    std::vector<Double8> out = y_;
    add_answer_of_rows(arrays(), forces().data(), out.data());
    return out;
  }
  static std::vector<std::int32_t> some_of(const GameGroup& group, std::int32_t step) {
    std::vector<std::int32_t> out;
    for (std::int32_t i = step - 1; i < static_cast<std::int32_t>(group.count); i += step) out.push_back(i);
    return out;
  }
  std::vector<double> pair(const GameGroup& a, const std::vector<std::int32_t>& rows, const GameGroup& b,
                           const std::vector<std::int32_t>& columns) const {
    std::vector<double> out(rows.size() * columns.size());
    multiply_pair(arrays(), {&a, rows.data(), rows.size()}, {&b, columns.data(), columns.size()}, out.data());
    return out;
  }
  RowArrays arrays() const { return {groups_.data(), groups_.size(), numbers_.data(), weights_.data()}; }

  std::mt19937 random_{1};
  std::normal_distribution<double> number_;
  std::vector<std::int32_t> first_, sizes_;  // blocks, by frame
  std::int32_t blocks_ = 0;
  Eigen::Index rows_ = 0;
  std::vector<GameGroup> groups_;
  std::vector<Double8> numbers_, weights_, y_;
};

TEST_F(RowKernels, RowsTimesAMotion) {
  for_each_instruction_set([&](std::int64_t) {
    EXPECT_LT((Eigen::Map<const Eigen::VectorXd>(product().data(), rows_) - J() * whole(y_)).norm(), 1e-13);
  });
}

TEST_F(RowKernels, ForcesAddTheirWeighedAnswer) {
  const Eigen::VectorXd expected = whole(y_) + Eigen::VectorXd(W().cwiseProduct(J().transpose() * forces()));
  for_each_instruction_set([&](std::int64_t) { EXPECT_LT((whole(answer()) - expected).norm(), 1e-13); });
}

/// Of all rows, and of every second one; on the diagonal the lower part counts.
TEST_F(RowKernels, PairsAreBlocksOfTheMatrix) {
  const Eigen::MatrixXd all = J() * W().asDiagonal() * J().transpose();
  for_each_instruction_set([&](std::int64_t) {
    for (const std::int32_t step : {1, 2})
      for (const GameGroup& a : groups_)
        for (const GameGroup& b : groups_) {
          const std::vector<std::int32_t> rows = some_of(a, step), columns = some_of(b, step);
          const std::vector<double> part = pair(a, rows, b, columns);
          for (std::size_t i = 0; i < rows.size(); ++i)
            for (std::size_t j = 0; j < (&a == &b ? i + 1 : columns.size()); ++j)
              EXPECT_NEAR(part[i * columns.size() + j], all(a.first + rows[i], b.first + columns[j]), 1e-13);
        }
  });
}

TEST_F(RowKernels, BitsAreTheSameWithFusedMultiplyAdd) {
  std::vector<double> expected;
  for_each_instruction_set([&](std::int64_t target) {
    if (!has_fused_multiply_add(target)) return;
    std::vector<double> out = product();
    for (const Double8& block : answer()) out.insert(out.end(), block.v, block.v + 8);
    for (std::size_t g = 0; g + 1 < groups_.size(); ++g) {
      const std::vector<double> part =
          pair(groups_[g], some_of(groups_[g], 1), groups_[g + 1], some_of(groups_[g + 1], 1));
      out.insert(out.end(), part.begin(), part.end());
    }
    if (expected.empty()) expected = out;
    EXPECT_TRUE(out == expected);
  });
}

}  // namespace
}  // namespace limber::internal
