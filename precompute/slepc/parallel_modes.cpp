#include "parallel_modes.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <vector>

#include "parallel_inverse.h"

namespace limber::internal {
namespace {

constexpr double kTolerance = 1e-8;  // of Krylov–Schur; one step of subspace iteration follows
constexpr int kMostRestarts = 1000;
constexpr int kSearches = 3;          // for missing modes
constexpr double kClusterGap = 1e-6;  // as in elastic_modes.cpp

struct Pairs {
  Eigen::VectorXd lambda;
  Eigen::MatrixXd W, MW;
};

Eigen::Index elastic_size(const DistributedBody& body) { return body.size() - body.N().cols(); }

/// y = f(x) on own rows. An exception would have to pass through C.
template <class F>
PetscErrorCode on_columns(Vec x, Vec y, F f) {
  const PetscScalar* from = nullptr;
  PetscScalar* to = nullptr;
  PetscInt size = 0;
  PetscCall(VecGetLocalSize(x, &size));
  PetscCall(VecGetArrayRead(x, &from));
  PetscCall(VecGetArray(y, &to));
  PetscErrorCode code{};
  try {
    Eigen::Map<Eigen::VectorXd>(to, size) = f(Eigen::Map<const Eigen::VectorXd>(from, size));
  } catch (const std::exception&) {
    code = PETSC_ERR_LIB;
  }
  PetscCall(VecRestoreArray(y, &to));
  PetscCall(VecRestoreArrayRead(x, &from));
  return code;
}

PetscErrorCode multiply_by_mass(Mat M, Vec x, Vec y) {
  DistributedBody* body = nullptr;
  PetscCall(MatShellGetContext(M, &body));
  return on_columns(x, y, [&](const auto& own) { return body->mass_times(own); });
}

PetscErrorCode multiply_by_stiffness(Mat K, Vec x, Vec y) {
  DistributedBody* body = nullptr;
  PetscCall(MatShellGetContext(K, &body));
  return on_columns(x, y, [&](const auto& own) { return body->stiffness_times(own); });
}

PetscErrorCode apply_inverse(PC pc, Vec x, Vec y) {
  ParallelInverse* inverse = nullptr;
  PetscCall(PCShellGetContext(pc, &inverse));
  return on_columns(x, y, [&](const auto& own) { return inverse->apply(own); });
}

OwnedMat shell(DistributedBody& body, PetscErrorCode (*multiply)(Mat, Vec, Vec)) {
  OwnedMat A;
  check(MatCreateShell(PETSC_COMM_WORLD, body.own_size(), body.own_size(), body.size(), body.size(), &body, A.out()));
  check(MatShellSetOperation(A, MATOP_MULT, reinterpret_cast<void (*)(void)>(multiply)));
  check(MatSetOption(A, MAT_SYMMETRIC, PETSC_TRUE));
  return A;
}

OwnedVec vector_of(const Eigen::Ref<const Eigen::VectorXd>& x, PetscInt size) {
  OwnedVec v;
  check(VecCreateMPI(PETSC_COMM_WORLD, static_cast<PetscInt>(x.size()), size, v.out()));
  PetscScalar* value = nullptr;
  check(VecGetArray(v, &value));
  Eigen::Map<Eigen::VectorXd>(value, x.size()) = x;
  check(VecRestoreArray(v, &value));
  return v;
}

void deflate(EPS eps, const Eigen::MatrixXd& columns, PetscInt size) {
  std::vector<OwnedVec> vectors;  // which the solver copies
  std::vector<Vec> raw;
  for (const auto& column : columns.colwise()) raw.push_back(vectors.emplace_back(vector_of(column, size)));
  if (!raw.empty()) check(EPSSetDeflationSpace(eps, static_cast<PetscInt>(raw.size()), raw.data()));
}

/// At most `count` of those that converged.
Eigen::MatrixXd vectors_of(EPS eps, const DistributedBody& body, Eigen::Index count) {
  PetscInt converged = 0;
  check(EPSGetConverged(eps, &converged));
  Eigen::MatrixXd X(body.own_size(), std::min<Eigen::Index>(converged, count));
  for (Eigen::Index c = 0; c < X.cols(); ++c) {
    const OwnedVec x = vector_of(X.col(c), body.size());
    check(EPSGetEigenvector(eps, static_cast<PetscInt>(c), x, nullptr));
    const PetscScalar* value = nullptr;
    check(VecGetArrayRead(x, &value));
    X.col(c) = Eigen::Map<const Eigen::VectorXd>(value, X.rows());
    check(VecRestoreArrayRead(x, &value));
  }
  return X;
}

struct Transformation {
  ST st = nullptr;
  PC pc = nullptr;  // applied once a step
};

Transformation transformation_of(EPS eps, STType type) {
  Transformation of;
  KSP ksp = nullptr;
  check(EPSGetST(eps, &of.st));
  check(STSetType(of.st, type));
  check(STGetKSP(of.st, &ksp));
  check(KSPSetType(ksp, KSPPREONLY));
  check(KSPGetPC(ksp, &of.pc));
  return of;
}

/// The `count` modes nearest to −s that are orthogonal to those found.
Eigen::MatrixXd krylov_schur(ParallelInverse& inverse, const Eigen::MatrixXd& found, Eigen::Index count,
                             Eigen::Index subspace, std::uint64_t seed) {
  DistributedBody& body = inverse.body();
  const OwnedMat K = shell(body, multiply_by_stiffness), M = shell(body, multiply_by_mass);
  OwnedSolver eps;
  check(EPSCreate(PETSC_COMM_WORLD, eps.out()));
  check(EPSSetOperators(eps, K, M));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetType(eps, EPSKRYLOVSCHUR));
  check(EPSSetTarget(eps, -inverse.shift()));
  check(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  check(EPSSetPurify(eps, PETSC_FALSE));
  check(EPSSetDimensions(eps, static_cast<PetscInt>(count), static_cast<PetscInt>(subspace), PETSC_DEFAULT));
  check(EPSSetTolerances(eps, kTolerance, kMostRestarts));
  const auto [st, pc] = transformation_of(eps, STSINVERT);
  check(STSetMatMode(st, ST_MATMODE_SHELL));
  check(PCSetType(pc, PCSHELL));
  check(PCShellSetContext(pc, &inverse));
  check(PCShellSetApply(pc, apply_inverse));
  deflate(eps, found, body.size());
  const OwnedVec start = vector_of(body.start_vector(seed), body.size());
  Vec start_raw = start;
  check(EPSSetInitialSpace(eps, 1, &start_raw));
  check(EPSSolve(eps));
  return vectors_of(eps, body, count);
}

/// The `count` lowest, by LOBPCG with smoothed aggregation, which is told how rigid bodies move.
Eigen::MatrixXd lobpcg(DistributedBody& body, Eigen::Index count) {
  const OwnedMat K = body.shifted_stiffness(0.0), pinned = body.pinned_stiffness(), M = shell(body, multiply_by_mass);
  const OwnedVec coordinates = body.own_coordinates();
  OwnedNullSpace rigid;
  check(MatNullSpaceCreateRigidBody(coordinates, rigid.out()));
  check(MatSetNearNullSpace(pinned, rigid));
  OwnedSolver eps;
  check(EPSCreate(PETSC_COMM_WORLD, eps.out()));
  check(EPSSetOperators(eps, K, M));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetType(eps, EPSLOBPCG));
  check(EPSSetWhichEigenpairs(eps, EPS_SMALLEST_REAL));
  check(EPSSetDimensions(eps, static_cast<PetscInt>(count), PETSC_DEFAULT, PETSC_DEFAULT));
  check(EPSSetTolerances(eps, kTolerance, kMostRestarts));
  deflate(eps, body.N(), body.size());
  const auto [st, pc] = transformation_of(eps, STPRECOND);
  check(STSetPreconditionerMat(st, pinned));
  check(PCSetType(pc, PCGAMG));
  check(EPSSolve(eps));
  return vectors_of(eps, body, count);
}

/// One step of subspace iteration and Rayleigh–Ritz, as internal::refined() does it.
Pairs refined_pairs(ParallelInverse& inverse, const Eigen::MatrixXd& X) {
  DistributedBody& body = inverse.body();
  const auto dot = DistributedBody::dot;
  const Eigen::MatrixXd MX = body.mass_times(X);
  Eigen::MatrixXd Y = inverse.apply_accurately(MX), MY = body.mass_times(Y);
  const Eigen::VectorXd shrink = dot(Y, MY).diagonal().cwiseSqrt().cwiseInverse();
  Y *= shrink.asDiagonal();
  MY *= shrink.asDiagonal();
  const Eigen::MatrixXd B = dot(Y, MY);
  const Eigen::MatrixXd A = dot(Y, MX * shrink.asDiagonal()) - inverse.shift() * B;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz((A + A.transpose()) / 2.0,
                                                                       (B + B.transpose()) / 2.0);
  const Eigen::MatrixXd& S = ritz.eigenvectors();
  Pairs pairs{.lambda = Eigen::VectorXd(S.cols()), .W = Y * S, .MW = MY * S};
  for (Eigen::Index i = 0; i < S.cols(); ++i) pairs.lambda[i] = S.col(i).dot(A * S.col(i)) / S.col(i).dot(B * S.col(i));
  return pairs;
}

/// Rayleigh–Ritz with forces formed tet by tet.
Pairs ritz_pairs(DistributedBody& body, const Eigen::MatrixXd& X) {
  const Eigen::MatrixXd MX = body.mass_times(X);
  const Eigen::MatrixXd A = DistributedBody::dot(X, body.stiffness_times(X)), B = DistributedBody::dot(X, MX);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz((A + A.transpose()) / 2.0,
                                                                       (B + B.transpose()) / 2.0);
  return {.lambda = ritz.eigenvalues(), .W = X * ritz.eigenvectors(), .MW = MX * ritz.eigenvectors()};
}

[[noreturn]] void fail_for_few_modes(const DistributedBody& body, Eigen::Index wanted) {
  throw ComputationError("the body has only " + std::to_string(elastic_size(body)) + " elastic modes, of which " +
                         std::to_string(wanted) + " are wanted: use --engine arpack");
}

Pairs first_pairs(ParallelInverse& inverse, Eigen::Index count) {
  const DistributedBody& body = inverse.body();
  const Eigen::Index subspace = 8 + count * 8 / 5;
  if (subspace > elastic_size(body) / 2) fail_for_few_modes(body, count);
  return refined_pairs(inverse, krylov_schur(inverse, Eigen::MatrixXd(body.own_size(), 0), count, subspace, 0));
}

Pairs with_others(ParallelInverse& inverse, const Pairs& pairs, Eigen::Index missing, int search) {
  const Eigen::Index count = missing + 4;
  const Eigen::MatrixXd more =
      krylov_schur(inverse, pairs.W, count, 4 * count + 20, ~static_cast<std::uint64_t>(search));
  Eigen::MatrixXd all(pairs.W.rows(), pairs.W.cols() + more.cols());
  all << pairs.W, more;
  return refined_pairs(inverse, all);
}

double gap_after(const Eigen::VectorXd& lambda, Eigen::Index i) { return (lambda[i] - lambda[i - 1]) / lambda[i - 1]; }

/// How many of the pairs lie below the widest gap from `first` on, where that ends a cluster; −1: none does.
Eigen::Index end_at_gap(const Eigen::VectorXd& lambda, Eigen::Index first) {
  Eigen::Index best = -1;
  for (Eigen::Index i = std::max<Eigen::Index>(first, 1); i < lambda.size(); ++i)
    if (gap_after(lambda, i) > (best < 0 ? kClusterGap : gap_after(lambda, best))) best = i;
  return best;
}

int count_below(DistributedBody& body, double lambda) {
  return ParallelFactor(body.shifted_stiffness(-lambda), body.elimination_order(), ParallelFactor::Keeps::kPivotSigns,
                        body.stages())
      .negative_pivots();
}

[[noreturn]] void fail_to_complete(Eigen::Index found, Eigen::Index counted) {
  throw ComputationError("the certificate of completeness fails: " + std::to_string(found) +
                         " eigenvalues were found below a bound that has " + std::to_string(counted) + " of them");
}

void describe(const ParallelFactor& factor, ParallelModes& modes) {
  modes.factor_entries = factor.entries();
  modes.factor_flops = factor.flops();
  modes.factor_memory = factor.largest_memory();
}

/// Keeps those between the ends.
void take(const Pairs& pairs, ParallelModes& modes) {
  const double *begin = pairs.lambda.data(), *end = begin + pairs.lambda.size();
  const Eigen::Index first = std::upper_bound(begin, end, modes.low) - begin,
                     count = std::lower_bound(begin, end, modes.high) - begin - first;
  modes.lambda = pairs.lambda.segment(first, count);
  modes.W = pairs.W.middleCols(first, count);
}

}  // namespace

ParallelModes lowest_parallel_modes(DistributedBody& body, int wanted) {
  ParallelModes modes;
  modes.below_low = static_cast<int>(body.N().cols());
  Pairs pairs;
  Eigen::Index missing = wanted + 6 + wanted / 16;
  for (int search = 0;; ++search) {
    {
      ParallelInverse inverse(body);
      describe(inverse.factor(), modes);
      pairs = search == 0 ? first_pairs(inverse, missing) : with_others(inverse, pairs, missing, search);
      for (Eigen::Index extra = wanted / 16 + 6; end_at_gap(pairs.lambda, wanted) < 0; extra *= 2)
        pairs = first_pairs(inverse, wanted + 2 * extra);
      body.stages().lap("iterate");
    }
    // The factor is gone before the next one is made: only one has to fit.
    const Eigen::Index end = end_at_gap(pairs.lambda, wanted);
    modes.high = (pairs.lambda[end - 1] + pairs.lambda[end]) / 2.0;
    modes.below_high = count_below(body, modes.high);
    missing = modes.below_high - modes.below_low - end;
    if (missing == 0) break;
    if (missing < 0 || search == kSearches) fail_to_complete(modes.below_low + end, modes.below_high);
  }
  take(pairs, modes);
  return modes;
}

ParallelModes estimated_factor(DistributedBody& body) {
  ParallelModes modes;
  modes.W.resize(body.own_size(), 0);
  describe(ParallelFactor(body.pinned_stiffness(), body.elimination_order(), ParallelFactor::Keeps::kEstimate,
                          body.stages()),
           modes);
  return modes;
}

ParallelModes lowest_modes_without_factor(DistributedBody& body, int wanted) {
  ParallelModes modes;
  const Eigen::Index count = wanted + 6 + wanted / 16;
  if (3 * count > elastic_size(body)) fail_for_few_modes(body, count);
  const Pairs pairs = ritz_pairs(body, lobpcg(body, count));
  body.stages().lap("iterate");
  const Eigen::Index end = end_at_gap(pairs.lambda, std::min<Eigen::Index>(wanted, pairs.lambda.size() - 1));
  if (end < wanted)
    throw ComputationError("LOBPCG found " + std::to_string(pairs.lambda.size()) + " modes of " +
                           std::to_string(count) + " in " + std::to_string(kMostRestarts) + " steps");
  modes.high = (pairs.lambda[end - 1] + pairs.lambda[end]) / 2.0;
  modes.below_low = static_cast<int>(body.N().cols());
  modes.below_high = modes.below_low + static_cast<int>(end);
  take(pairs, modes);
  return modes;
}

ParallelModes parallel_modes_between(DistributedBody& body, double low, double high) {
  ParallelModes modes{.low = low, .high = high};
  modes.below_low = low > 0.0 ? count_below(body, low) : static_cast<int>(body.N().cols());
  modes.below_high = count_below(body, high);
  const Eigen::Index count = modes.below_high - modes.below_low;
  modes.W.resize(body.own_size(), 0);
  if (count == 0) return modes;
  ParallelInverse inverse(body, (low + high) / 2.0);
  describe(inverse.factor(), modes);
  Pairs pairs = first_pairs(inverse, count);
  for (int search = 0;; ++search) {
    take(pairs, modes);
    body.stages().lap("iterate");
    if (modes.lambda.size() == count) return modes;
    if (modes.lambda.size() > count || search == kSearches)
      fail_to_complete(modes.below_low + modes.lambda.size(), modes.below_high);
    pairs = with_others(inverse, pairs, count - modes.lambda.size(), search);
  }
}

}  // namespace limber::internal
