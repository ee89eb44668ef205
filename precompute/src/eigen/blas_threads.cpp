#include "eigen/blas_threads.h"

#include <cblas.h>

namespace limber::internal {

BlasThreads::BlasThreads(int threads) : before_(openblas_get_num_threads()) {
  openblas_set_num_threads(threads > 0 ? threads : openblas_get_num_procs());
}

BlasThreads::~BlasThreads() { openblas_set_num_threads(before_); }

}  // namespace limber::internal
