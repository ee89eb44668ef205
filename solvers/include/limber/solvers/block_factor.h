// Decomposition of a sparse symmetric positive definite matrix in square blocks: one row and column of blocks for each
// body of an island, blocks off the diagonal where two bodies touch. The order of elimination (elimination_order.h) is
// found once for a pattern.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "limber/solvers/aligned_buffer.h"
#include "limber/solvers/elimination_order.h"

namespace limber::internal {

class BlockFactor {
 public:
  /// Forgets the last pattern. @param widths of the blocks, one per node
  void begin_pattern(std::span<const std::size_t> widths) { order_.begin(widths); }
  /// Blocks (i, j) and (j, i) may hold numbers; i = j always may.
  void add_edge(std::size_t i, std::size_t j) { order_.add_edge(i, j); }
  /// A node that factor() does not eliminate: what is left of the blocks between such nodes is the Schur complement of
  /// all others. Two of them may hold numbers only if an edge says so, or elimination links them.
  void keep(std::size_t node) { order_.keep(node); }
  /// Finds the order and places the blocks. Memory grows to the largest pattern seen.
  void end_pattern();

  /// Where block (i, j) is kept, i eliminated before j or i = j: row p of node i at values + p · stride, padded.
  struct Block {
    std::size_t offset = 0, stride = 0;
  };
  bool comes_first(std::size_t i, std::size_t j) const { return order_.place(i) < order_.place(j); }
  /// @pre i comes first or i = j, and the pair is an edge
  Block block(std::size_t i, std::size_t j) const;

  /// Zero, but for 1 on the diagonal.
  void set_identity();
  /// What blocks' offsets count from.
  double* numbers_of_blocks() { return upper_.data(); }
  /// Blocks (i, j), i first, row by row of i.
  double* upper(const Block& b) { return upper_.data() + b.offset; }

  /// @return false where a pivot is not positive
  bool factor();

  /// Multiply-adds of factor(), and numbers of the factor: what solve() reads twice.
  double work() const;
  std::size_t numbers() const { return numbers_; }

  /// Where a node's numbers begin in vectors; each node's part is padded.
  std::size_t first(std::size_t node) const { return first_[node]; }
  std::size_t size() const { return size_; }
  /// x ← M⁻¹ x, by the last factor. Padding zero. @pre no node is kept
  void solve(double* x);
  /// The two halves of it. Between them x holds the right-hand side of the Schur complement at kept nodes, and is given
  /// its solution there.
  void reduce(double* x);
  void expand(double* x) { expand(x, 1); }
  /// Of several, size() apart.
  void expand(double* x, std::size_t count);

 private:
  struct Column {  // one node, in the order of elimination
    std::size_t node = 0, width = 0, offset = 0, stride = 0, first_entry = 0, entries = 0;
  };
  struct Entry {                     // a later node that meets it
    std::size_t column = 0, at = 0;  // at: first number of its block in each row
    std::size_t first_run = 0, runs = 0;
  };

  void place_columns();
  void find_runs(const Column& column, std::size_t entry);
  void times_inverse_pivot(const Column& column, const double* x, double* out) const;

  EliminationOrder order_;
  std::vector<std::size_t> first_;
  std::size_t size_ = 0, numbers_ = 0;
  std::vector<Column> columns_;
  std::vector<Entry> entries_;
  std::vector<RowRun> runs_;      // from the rows of a node to those of a later one
  std::vector<RowBlock> blocks_;  // the entries' in the rows of their column
  AlignedBuffer upper_;           // U; on the diagonal D⁻¹
  AlignedBuffer row_;
  MatrixBuffer inverse_, divided_;  // of one column: D⁻¹, D⁻¹U
  std::size_t widest_ = 0, longest_ = 0;
};

}  // namespace limber::internal
