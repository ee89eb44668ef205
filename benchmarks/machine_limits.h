// The most that one thread of this machine can do, by plain loops.
#pragma once

#include <cstddef>

namespace limber {

/// Single-precision operations per second by fused multiply-adds in registers (two operations each), with the widest
/// vectors that the machine has. Measured at the first call, 0.1 s.
double peak_float_operations_per_second();

/// Bytes per second of reading an array of this size over and over, 0.1 s. Sizes: to 16 KiB the first-level
/// cache, from 256 MiB on the memory.
double read_bytes_per_second(std::size_t bytes);

}  // namespace limber
