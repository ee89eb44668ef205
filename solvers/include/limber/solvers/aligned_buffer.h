// Memory for the kernels: 64-byte aligned, padded, growing only.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "limber/solvers/matrix_view.h"

namespace limber::internal {

class AlignedBuffer {
 public:
  /// At least n numbers. What was there is lost if the buffer grows; new memory is zero.
  double* need(std::size_t n) {
    const std::size_t blocks = padded(n) / kPad;
    if (blocks > blocks_.size()) blocks_.assign(std::max(blocks, blocks_.size() + blocks_.size() / 2), Block{});
    return data();
  }
  /// n numbers that are zero, and their padding.
  double* zeros(std::size_t n) {
    double* to = need(n);
    std::fill_n(to, padded(n), 0.0);
    return to;
  }
  double* data() { return blocks_.empty() ? nullptr : blocks_.front().values; }
  const double* data() const { return blocks_.empty() ? nullptr : blocks_.front().values; }

 private:
  struct alignas(64) Block {
    double values[kPad] = {};
  };
  std::vector<Block> blocks_;
};

/// A matrix of `rows` padded rows.
class MatrixBuffer {
 public:
  MatrixView need(std::size_t rows, std::size_t columns) {
    const std::size_t stride = padded(columns);
    return {memory_.need(rows * stride), stride};
  }

 private:
  AlignedBuffer memory_;
};

}  // namespace limber::internal
