// The vector loops behind PropagatorTable. Raw pointers only: the file that implements them is compiled for several
// instruction sets, so neither Eigen nor a header that includes it may reach it.
#pragma once

#include <cstddef>

namespace limber::internal {

/// One block advances this many modes by coefficients in this order, each an array of kBlockModes.
inline constexpr std::size_t kBlockModes = 8;
enum BlockCoefficient : std::size_t { kZz, kZv, kVz, kVv, kZg, kBlockCoefficients };

/// z, v ← the step of `blocks` blocks under g; all arrays 64-byte aligned.
void advance_blocks(const double* coefficients, std::size_t blocks, double* z, double* v, const double* g);
void advance_blocks_free(const double* coefficients, std::size_t blocks, double* z, double* v);

}  // namespace limber::internal
