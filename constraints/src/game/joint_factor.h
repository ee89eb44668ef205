// Block LDLᵀ of J Jᵀ + C, the matrix of all joints and handles together.
//
// A node is a constraint, and two nodes couple where they share a body that moves. Nodes are eliminated in the order of
// least degree: leaves first along a tree, whose factor then has no more blocks than the matrix, so that time is linear
// in its links. Loops fill in.
//
// Nodes that have many neighbours when their turn comes, as in nets of a thousand meshes, fill in no more. Each product
// that has no place is left out, and its size added to the diagonals of its two nodes: LDLᵀ − J Jᵀ − C has then no
// negative eigenvalue, so that solving by it again and again converges.
//
// Rows that say the same make the matrix singular. A part kRegular of each row's own response is added to its diagonal:
// rows that say the same share their force, and rows that contradict meet in the least-squares sense.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace limber::internal {

class JointFactor {
 public:
  using Pair = std::array<std::int32_t, 2>;

  /// Finds the order and what fills in; nothing where the graph is that already.
  /// @param couplings pairs of different nodes, ascending in themselves and as a list, each once
  void set_graph(std::size_t nodes, std::span<const Pair> couplings);
  /// Begins a matrix of zeros. @param sizes rows of each node, 0 too
  void begin(std::span<const std::int32_t> sizes);
  /// The lower part counts, row by row.
  double* diagonal(std::size_t node) { return &values_[starts_[pattern_.position[node]]]; }
  /// Rows of the one node by columns of the other, row by row: that with rows is rows_of(coupling).
  double* block(std::size_t coupling) { return &values_[starts_[pattern_.places[coupling]]]; }
  std::int32_t rows_of(std::size_t coupling) const;
  void factor();
  /// Where the numbers of a node begin in a right-hand side of one column.
  std::size_t first(std::size_t node) const { return firsts_[pattern_.position[node]]; }
  std::size_t size() const { return size_; }
  /// Whether nothing has been left out.
  bool is_complete() const { return pattern_.complete; }
  /// Overwrites right-hand sides by their solutions. @param x size() rows of `columns` numbers, 1 or 3
  template <std::size_t columns>
  void solve(std::span<double> x) const;

 private:
  void order();
  bool has_sizes(std::span<const std::int32_t> sizes) const;
  void lay_out(std::span<const std::int32_t> sizes);
  void eliminate(std::size_t column);
  void leave_out(std::size_t column, std::size_t a, std::size_t b);
  std::int32_t find(std::int32_t row, std::int32_t column) const;

  /// Which blocks L has, whatever its numbers.
  struct Pattern {
    std::vector<std::int32_t> position, node_at;       // by node; by position
    std::vector<std::size_t> column_starts;            // in rows
    std::vector<std::int32_t> rows;                    // of L below its diagonal: positions, ascending in each column
    std::vector<std::int32_t> places;                  // by coupling: its block
    std::vector<std::int32_t> target_starts, targets;  // by column: the block that each pair of its rows changes
    bool complete = true;
  };

  std::size_t nodes_ = 0, size_ = 0;
  std::vector<Pair> graph_;
  Pattern pattern_;
  std::vector<std::size_t> starts_;  // by block, the diagonal ones first: of its numbers
  std::vector<std::int32_t> sizes_;  // by position
  std::vector<std::size_t> firsts_;  // by position
  std::vector<double> values_;
  std::vector<double> own_;  // by row: its diagonal before elimination
};

}  // namespace limber::internal
