/// @file limber/precompute/sparse_matrix.h
/// Compressed sparse columns as a plain struct: what the assembly makes and the solvers read.
#pragma once

#include <vector>

#include "limber/core/types.h"

namespace limber {

/// n × n, both triangles stored, rows ascending within a column.
struct SparseMatrix {
  Index size = 0;
  std::vector<Index> column_start;  ///< n + 1
  std::vector<Index> row;           ///< per entry
  std::vector<double> value;        ///< per entry
};

}  // namespace limber
