// The vector loops behind SkinPose. Raw pointers only: the file that implements them is compiled for several
// instruction sets, so neither Eigen nor a header that includes it may reach it.
#pragma once

#include <cstddef>

namespace limber::internal {

/// products[r] = Σ_i rows[r · k + i] z[i] for r < count. Each sum is made of eight side by side.
void rows_times(const float* rows, std::size_t count, std::size_t k, const double* z, double* products);

/// Three rows of k numbers, one after another: out += A in, A row-major 3 × 3.
void add_product(const double* A, const float* in, std::size_t k, double* out);
void add_product(const double* A, const double* in, std::size_t k, double* out);

/// The same with a single row: out += vᵀ in, v of 3.
void add_row(const double* v, const float* in, std::size_t k, double* out);
void add_row(const double* v, const double* in, std::size_t k, double* out);

}  // namespace limber::internal
