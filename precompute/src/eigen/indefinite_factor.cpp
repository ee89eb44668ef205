#include "eigen/indefinite_factor.h"

#include <dmumps_c.h>

#include <mutex>
#include <string>
#include <vector>

#include "limber/core/error.h"

namespace limber::internal {
namespace {

constexpr int kUseWorld = -987654;  // MUMPS's name for MPI_COMM_WORLD, which the sequential library has alone
constexpr int kOutOfWorkspace1 = -8, kOutOfWorkspace2 = -9;
constexpr int kSingular = -10;
enum Job { kStart = -1, kEnd = -2, kAnalyse = 1, kFactorise = 2, kSolve = 3 };

// MUMPS keeps state in Fortran modules: one call at a time.
std::mutex& mumps_mutex() {
  static std::mutex mutex;
  return mutex;
}

[[noreturn]] void fail(const DMUMPS_STRUC_C& id) {
  if (id.infog[0] == kSingular) throw ComputationError("K − σM is singular; choose a σ that is no eigenvalue");
  throw ComputationError("factoring K − σM: MUMPS failed with INFOG(1) = " + std::to_string(id.infog[0]) +
                         ", INFOG(2) = " + std::to_string(id.infog[1]));
}

}  // namespace

struct IndefiniteFactor::Mumps {
  DMUMPS_STRUC_C id{};
  std::vector<Index> entry;            // which entries of the matrix are in its lower triangle
  std::vector<MUMPS_INT> row, column;  // theirs, from 1
  std::vector<DMUMPS_REAL> value;
  std::vector<MUMPS_INT> place_in_order;  // from 1

  // Control parameters carry the numbers that MUMPS's users' guide gives them, from 1.
  MUMPS_INT& control(int number) { return id.icntl[number - 1]; }

  void run(Job job) {
    const std::scoped_lock lock(mumps_mutex());
    id.job = job;
    dmumps_c(&id);
  }

  Mumps() {
    id.sym = 2;  // symmetric indefinite: 1 × 1 and 2 × 2 pivots
    id.par = 1;
    id.comm_fortran = kUseWorld;
    run(kStart);
    for (int stream = 1; stream <= 4; ++stream) control(stream) = 0;  // prints nothing
  }
  ~Mumps() { run(kEnd); }
  Mumps(const Mumps&) = delete;
  Mumps& operator=(const Mumps&) = delete;

  void take_lower_triangle(const SparseMatrix& K) {
    for (Index j = 0; j < K.size; ++j)
      for (Index e = K.column_start[j]; e < K.column_start[j + 1]; ++e)
        if (K.row[e] >= j) {
          entry.push_back(e);
          row.push_back(K.row[e] + 1);
          column.push_back(j + 1);
        }
    value.resize(entry.size());
    id.n = K.size;
    id.nnz = static_cast<MUMPS_INT8>(entry.size());
    id.irn = row.data();
    id.jcn = column.data();
    id.a = value.data();
  }

  void take_order(std::span<const Index> node_order) {
    place_in_order.resize(3 * node_order.size());
    MUMPS_INT place = 0;
    for (const Index node : node_order)
      for (int axis = 0; axis < 3; ++axis) place_in_order[3 * node + axis] = ++place;
    id.perm_in = place_in_order.data();
  }

  void analyse(Keeps keeps) {
    control(6) = 0;    // no permutation by values: one analysis serves all σ
    control(7) = 1;    // the given order
    control(12) = 1;   // plain symmetric ordering
    control(13) = 1;   // the root front too is factored where its pivots are counted
    control(14) = 50;  // per cent of workspace more than estimated, for pivots that are put off
    control(31) = keeps == Keeps::kFactor ? 0 : 1;  // 1: forgets L
    run(kAnalyse);
    if (id.infog[0] < 0) fail(id);
  }

  int negative_pivots() {
    run(kFactorise);
    while ((id.infog[0] == kOutOfWorkspace1 || id.infog[0] == kOutOfWorkspace2) && control(14) < 2000) {
      control(14) *= 2;
      run(kFactorise);
    }
    if (id.infog[0] < 0) fail(id);
    return id.infog[11];
  }
};

IndefiniteFactor::IndefiniteFactor(const SparseMatrix& A, std::span<const Index> node_order, Keeps keeps)
    : mumps_(std::make_unique<Mumps>()) {
  mumps_->take_lower_triangle(A);
  mumps_->take_order(node_order);
  mumps_->analyse(keeps);
}

IndefiniteFactor::~IndefiniteFactor() = default;

int IndefiniteFactor::factor(const SparseMatrix& A) {
  for (std::size_t i = 0; i < mumps_->entry.size(); ++i) mumps_->value[i] = A.value[mumps_->entry[i]];
  return mumps_->negative_pivots();
}

Eigen::MatrixXd IndefiniteFactor::solve(const Eigen::Ref<const Eigen::MatrixXd>& B) {
  Eigen::MatrixXd X = B;
  DMUMPS_STRUC_C& id = mumps_->id;
  id.rhs = X.data();
  id.nrhs = static_cast<MUMPS_INT>(X.cols());
  id.lrhs = static_cast<MUMPS_INT>(X.rows());
  mumps_->run(kSolve);
  if (id.infog[0] < 0) fail(id);
  return X;
}

}  // namespace limber::internal
