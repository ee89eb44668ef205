#include "parallel_factor.h"

#include <dmumps_c.h>

#include <string>

namespace limber::internal {
namespace {

constexpr int kOutOfWorkspace1 = -8, kOutOfWorkspace2 = -9, kSingular = -10;
constexpr int kNoMemory = -13, kNoMemoryElsewhere = -1;
constexpr int kMostWorkspace = 2000;  // per cent
enum Job { kStart = -1, kEnd = -2, kAnalyse = 1, kFactorise = 2, kSolve = 3 };

}  // namespace

struct ParallelFactor::Mumps {
  DMUMPS_STRUC_C id{};
  std::vector<MUMPS_INT> row, column;  // of the own rows' lower triangle, from 1
  std::vector<DMUMPS_REAL> value;
  std::vector<MUMPS_INT> order, own_rows, solved_rows;  // from 1
  std::vector<DMUMPS_REAL> solution;                    // where MUMPS leaves it
  OwnedVec left, wanted;                                // the solution there, and in own rows
  OwnedScatter scatter;

  // Control parameters carry the numbers that MUMPS's users' guide gives them, from 1.
  MUMPS_INT& control(int number) { return id.icntl[number - 1]; }

  [[noreturn]] void fail() const {
    const int code = id.infog[0];
    if (code == kSingular) throw ComputationError("K − σM is singular; choose a σ that is no eigenvalue");
    if (code == kNoMemory || code == kNoMemoryElsewhere)
      throw ComputationError("the factor does not fit into memory: use more machines, or --engine lobpcg");
    throw ComputationError("factoring: MUMPS failed with INFOG(1) = " + std::to_string(code) +
                           ", INFOG(2) = " + std::to_string(id.infog[1]));
  }

  void run(Job job) {
    id.job = job;
    dmumps_c(&id);
  }

  explicit Mumps(Keeps keeps) {
    id.sym = 2;  // symmetric indefinite: 1 × 1 and 2 × 2 pivots
    id.par = 1;
    id.comm_fortran = static_cast<MUMPS_INT>(MPI_Comm_c2f(PETSC_COMM_WORLD));
    run(kStart);
    for (int stream = 1; stream <= 4; ++stream) control(stream) = 0;  // prints nothing
    control(6) = 0;                                                   // no permutation by values
    control(7) = 1;                                                   // the given order
    control(12) = 1;                                                  // plain symmetric ordering
    control(13) = 1;   // the root front too is factored where its pivots are counted
    control(14) = 20;  // per cent of workspace more than estimated, for pivots that are put off
    control(18) = 3;   // entries are where they were assembled
    control(20) = 10;  // loads too
    control(21) = 1;   // and answers where they fall
    control(28) = 1;   // analyses on the first process
    control(31) = keeps == Keeps::kPivotSigns ? 1 : 0;  // 1: forgets L
  }
  ~Mumps() { run(kEnd); }
  Mumps(const Mumps&) = delete;
  Mumps& operator=(const Mumps&) = delete;

  void take_lower_triangle(Mat A) {
    PetscInt first = 0, end = 0, size = 0;
    check(MatGetOwnershipRange(A, &first, &end));
    check(MatGetSize(A, &size, nullptr));
    for (PetscInt i = first; i < end; ++i) {
      PetscInt count = 0;
      const PetscInt* columns = nullptr;
      const PetscScalar* values = nullptr;
      check(MatGetRow(A, i, &count, &columns, &values));
      for (PetscInt e = 0; e < count; ++e)
        if (columns[e] <= i) {
          row.push_back(i + 1);
          column.push_back(columns[e] + 1);
          value.push_back(values[e]);
        }
      check(MatRestoreRow(A, i, &count, &columns, &values));
      own_rows.push_back(i + 1);
    }
    id.n = size;
    id.nnz_loc = static_cast<MUMPS_INT8>(value.size());
    id.irn_loc = row.data();
    id.jcn_loc = column.data();
    id.a_loc = value.data();
  }

  void analyse() {
    run(kAnalyse);
    if (id.infog[0] < 0) fail();
  }

  void factorise() {
    run(kFactorise);
    while ((id.infog[0] == kOutOfWorkspace1 || id.infog[0] == kOutOfWorkspace2) && control(14) < kMostWorkspace) {
      control(14) *= 2;
      run(kFactorise);
    }
    if (id.infog[0] < 0) fail();
  }

  void prepare_solves() {
    solved_rows.resize(static_cast<std::size_t>(id.info[22]));
    id.isol_loc = solved_rows.data();
    id.lsol_loc = static_cast<MUMPS_INT>(solved_rows.size());
    id.irhs_loc = own_rows.data();
    id.nloc_rhs = id.lrhs_loc = static_cast<MUMPS_INT>(own_rows.size());
  }

  /// Once MUMPS has told, by a solve, which rows it leaves here.
  void prepare_scatter() {
    std::vector<PetscInt> rows(solved_rows.begin(), solved_rows.end());
    for (PetscInt& r : rows) --r;
    const auto own = static_cast<PetscInt>(own_rows.size()), count = static_cast<PetscInt>(rows.size());
    check(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, own, id.n, nullptr, wanted.out()));
    check(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, count, nullptr, left.out()));
    OwnedIndices from, to;
    check(ISCreateStride(PETSC_COMM_SELF, count, 0, 1, from.out()));
    check(ISCreateGeneral(PETSC_COMM_SELF, count, rows.data(), PETSC_COPY_VALUES, to.out()));
    check(VecScatterCreate(left, from, wanted, to, scatter.out()));
  }
};

ParallelFactor::ParallelFactor(OwnedMat A, const std::vector<int>& place_in_order, Keeps keeps, Stages& stages)
    : mumps_(std::make_unique<Mumps>(keeps)) {
  const auto lap = [&](const char* stage) { stages.lap(keeps == Keeps::kPivotSigns ? "certify" : stage); };
  mumps_->take_lower_triangle(A);
  A.reset();
  mumps_->order.assign(place_in_order.begin(), place_in_order.end());
  mumps_->id.perm_in = mumps_->order.data();
  lap("assemble");
  mumps_->analyse();
  lap("analyse");
  if (keeps == Keeps::kEstimate) return;
  mumps_->factorise();
  lap("factor");
  if (keeps == Keeps::kFactor) mumps_->prepare_solves();
}

ParallelFactor::ParallelFactor(ParallelFactor&&) noexcept = default;
ParallelFactor::~ParallelFactor() = default;

int ParallelFactor::negative_pivots() const { return mumps_->id.infog[11]; }

double ParallelFactor::entries() const {
  const bool made = mumps_->id.job != kAnalyse;
  const double entries = mumps_->id.infog[made ? 28 : 19];
  return entries < 0.0 ? -1e6 * entries : entries;  // MUMPS counts in millions where there are many
}

double ParallelFactor::flops() const { return mumps_->id.rinfog[mumps_->id.job != kAnalyse ? 2 : 0]; }

double ParallelFactor::largest_memory() const { return 1e6 * mumps_->id.infog[15]; }

Eigen::MatrixXd ParallelFactor::solve(const Eigen::MatrixXd& B) {
  Eigen::MatrixXd X = B;
  if (X.cols() == 0) return X;
  Mumps& mumps = *mumps_;
  mumps.solution.resize(mumps.solved_rows.size() * static_cast<std::size_t>(X.cols()));
  mumps.id.nrhs = static_cast<MUMPS_INT>(X.cols());
  mumps.id.rhs_loc = X.data();
  mumps.id.sol_loc = mumps.solution.data();
  mumps.run(kSolve);
  if (mumps.id.infog[0] < 0) mumps.fail();
  if (!mumps.scatter) mumps.prepare_scatter();
  for (Eigen::Index c = 0; c < X.cols(); ++c) {
    check(VecPlaceArray(mumps.left, mumps.solution.data() + static_cast<std::size_t>(c) * mumps.solved_rows.size()));
    check(VecPlaceArray(mumps.wanted, X.col(c).data()));
    check(VecScatterBegin(mumps.scatter, mumps.left, mumps.wanted, INSERT_VALUES, SCATTER_FORWARD));
    check(VecScatterEnd(mumps.scatter, mumps.left, mumps.wanted, INSERT_VALUES, SCATTER_FORWARD));
    check(VecResetArray(mumps.wanted));
    check(VecResetArray(mumps.left));
  }
  return X;
}

}  // namespace limber::internal
