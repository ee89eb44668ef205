/// @file petsc_objects.h
/// Objects of PETSc and SLEPc that end with their owner, and their error codes as exceptions.
#pragma once

#include <slepceps.h>

#include <string>
#include <utility>

#include "limber/core/error.h"

namespace limber::internal {

inline void check(PetscErrorCode code) {
  if (code == 0) return;
  const char* text = nullptr;
  char* detail = nullptr;
  PetscErrorMessage(code, &text, &detail);
  throw ComputationError("PETSc: " + std::string(text ? text : "error " + std::to_string(code)) +
                         (detail && *detail ? std::string(": ") + detail : std::string()));
}

template <class T, PetscErrorCode (*destroy)(T*)>
class Owned {
 public:
  Owned() = default;
  Owned(Owned&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
  Owned& operator=(Owned&& other) noexcept {
    std::swap(object_, other.object_);
    return *this;
  }
  ~Owned() { reset(); }

  operator T() const { return object_; }
  /// Where a function of PETSc puts a new object.
  T* out() {
    reset();
    return &object_;
  }
  void reset() {
    if (object_) destroy(&object_);
    object_ = nullptr;
  }

 private:
  T object_ = nullptr;
};

using OwnedMat = Owned<Mat, MatDestroy>;
using OwnedVec = Owned<Vec, VecDestroy>;
using OwnedScatter = Owned<VecScatter, VecScatterDestroy>;
using OwnedIndices = Owned<IS, ISDestroy>;
using OwnedPartitioning = Owned<MatPartitioning, MatPartitioningDestroy>;
using OwnedNullSpace = Owned<MatNullSpace, MatNullSpaceDestroy>;
using OwnedSolver = Owned<EPS, EPSDestroy>;

inline int process() {
  int rank = 0;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  return rank;
}

inline int processes() {
  int size = 1;
  MPI_Comm_size(PETSC_COMM_WORLD, &size);
  return size;
}

}  // namespace limber::internal
