#include "eigen/cholesky_solver.h"

#include <cholmod.h>
#include <metis.h>

#include <algorithm>
#include <cassert>
#include <cstring>
#include <numeric>
#include <string>

#include "limber/core/error.h"

namespace limber::internal {
namespace {

constexpr Eigen::Index kBlock = 32;  // right-hand sides at once: wider gains little and needs more memory

cholmod_sparse view(const SparseMatrix& A) {
  cholmod_sparse s{};
  s.nrow = s.ncol = A.size;
  s.nzmax = A.row.size();
  // CHOLMOD does not write through these.
  s.p = const_cast<Index*>(A.column_start.data());
  s.i = const_cast<Index*>(A.row.data());
  s.x = const_cast<double*>(A.value.data());
  s.stype = -1;  // reads the lower triangle
  s.itype = CHOLMOD_INT;
  s.xtype = CHOLMOD_REAL;
  s.dtype = CHOLMOD_DOUBLE;
  s.sorted = s.packed = 1;
  return s;
}

[[noreturn]] void fail(const cholmod_common& common, Index size) {
  if (common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE)
    throw ComputationError("the Cholesky factor of " + std::to_string(size) +
                           " unknowns does not fit into memory: use a coarser mesh");
  throw ComputationError("CHOLMOD failed with status " + std::to_string(common.status));
}

}  // namespace

std::vector<Index> order_nodes(const SparseMatrix& K, Index block) {
  idx_t nodes = K.size / block;
  std::vector<idx_t> start{0}, neighbour;
  for (Index i = 0; i < nodes; ++i) {
    for (Index e = K.column_start[block * i]; e < K.column_start[block * i + 1]; e += block)
      if (K.row[e] != block * i) neighbour.push_back(K.row[e] / block);
    start.push_back(static_cast<idx_t>(neighbour.size()));
  }
  std::vector<idx_t> order(nodes), place(nodes);
  if (neighbour.empty()) {
    std::iota(order.begin(), order.end(), 0);
    return order;
  }
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = 1;  // the same order on every run
  const int status = METIS_NodeND(&nodes, start.data(), neighbour.data(), nullptr, options, order.data(), place.data());
  if (status != METIS_OK) throw ComputationError("METIS failed with status " + std::to_string(status));
  return order;
}

struct CholeskySolver::Factor {
  cholmod_common common{};
  cholmod_factor* L = nullptr;
  cholmod_dense *X = nullptr, *Y = nullptr, *E = nullptr;  // the solution and workspace, kept between solves

  Factor() {
    cholmod_start(&common);
    common.print = 0;
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_GIVEN;
    common.supernodal = CHOLMOD_SUPERNODAL;
  }
  ~Factor() {
    cholmod_free_dense(&X, &common);
    cholmod_free_dense(&Y, &common);
    cholmod_free_dense(&E, &common);
    cholmod_free_factor(&L, &common);
    cholmod_finish(&common);
  }
  Factor(const Factor&) = delete;
  Factor& operator=(const Factor&) = delete;
};

CholeskySolver::CholeskySolver(const SparseMatrix& A, std::span<const Index> order)
    : factor_(std::make_unique<Factor>()) {
  assert(order.size() == static_cast<std::size_t>(A.size));
  Factor& f = *factor_;
  cholmod_sparse a = view(A);
  std::vector<Index> permutation(order.begin(), order.end());
  f.L = cholmod_analyze_p(&a, permutation.data(), nullptr, 0, &f.common);
  if (f.L == nullptr) fail(f.common, A.size);
  cholmod_factorize(&a, f.L, &f.common);
  if (f.common.status < 0) fail(f.common, A.size);
}

CholeskySolver::~CholeskySolver() = default;
CholeskySolver::CholeskySolver(CholeskySolver&&) noexcept = default;
CholeskySolver& CholeskySolver::operator=(CholeskySolver&&) noexcept = default;

bool CholeskySolver::definite() const { return factor_->L->minor == factor_->L->n; }

double CholeskySolver::fill() const { return factor_->common.lnz; }

Eigen::MatrixXd CholeskySolver::solve(const Eigen::Ref<const Eigen::MatrixXd>& B) {
  assert(definite());
  Factor& f = *factor_;
  Eigen::MatrixXd result(B.rows(), B.cols());
  for (Eigen::Index first = 0; first < B.cols(); first += kBlock) {
    const Eigen::Index count = std::min(kBlock, B.cols() - first);
    cholmod_dense b{};
    b.nrow = B.rows();
    b.ncol = count;
    b.d = B.outerStride();
    b.nzmax = b.d * count;
    b.x = const_cast<double*>(B.col(first).data());  // only read
    b.xtype = CHOLMOD_REAL;
    b.dtype = CHOLMOD_DOUBLE;
    if (!cholmod_solve2(CHOLMOD_A, f.L, &b, nullptr, &f.X, nullptr, &f.Y, &f.E, &f.common))
      fail(f.common, static_cast<Index>(B.rows()));
    result.middleCols(first, count) =
        Eigen::Map<const Eigen::MatrixXd>(static_cast<const double*>(f.X->x), B.rows(), count);
  }
  return result;
}

}  // namespace limber::internal
