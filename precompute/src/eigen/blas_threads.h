/// @file blas_threads.h
/// How many threads the BLAS uses, for the length of a scope.
#pragma once

namespace limber::internal {

/// Sets OpenBLAS's thread count and gives the former one back. Left to itself OpenBLAS takes every core even for small
/// blocks, and on a busy machine that is slower by orders of magnitude than one thread.
class BlasThreads {
 public:
  /// @param threads ≥ 1, or 0 for one per processor
  explicit BlasThreads(int threads);
  ~BlasThreads();
  BlasThreads(const BlasThreads&) = delete;
  BlasThreads& operator=(const BlasThreads&) = delete;

 private:
  int before_;
};

}  // namespace limber::internal
