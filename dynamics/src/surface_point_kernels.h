// The vector loops behind surface_point.h. Raw pointers only: the file that implements them is compiled for several
// instruction sets, so neither Eigen nor a header that includes it may reach it.
#pragma once

#include <cstddef>

namespace limber::internal {

/// Up to nine rows of U, one per corner and axis, in the order corner 0 x, y, z, corner 1 x, …
struct SurfaceRows {
  const float* row[9];
  double weight[9];   ///< of each row
  std::size_t count;  ///< 3 per corner
};

/// g_i += Σ_r weight_r row_r[i]
void add_rows(const SurfaceRows& rows, std::size_t modes, double* g);

/// u_axis = Σ_i z_i Σ_corner weight row[i]
void rows_times(const SurfaceRows& rows, std::size_t modes, const double* z, double* u);

}  // namespace limber::internal
