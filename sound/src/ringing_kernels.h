// The vector loop of the synthesizer. Raw pointers only: the file that implements it is compiled for several
// instruction sets.
#pragma once

#include <cstddef>
#include <cstdint>

namespace limber::internal {

inline constexpr std::size_t kRingingGroup = 8;  // modes side by side: [re × 8 | im × 8]

/// For each of `samples` samples n:  lanes[n][·] += Re z of every group in `active`;  z ← fade · p · z.
/// p and z: groups as above, 64-byte aligned. lanes: [samples][8], 64-byte aligned. Groups are added in the order of
/// `active`, so results do not depend on how samples are cut into calls.
void ring(const double* p, double* z, const std::int32_t* active, std::size_t count, double fade, std::size_t samples,
          double* lanes);

}  // namespace limber::internal
