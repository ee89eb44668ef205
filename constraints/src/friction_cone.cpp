#include "limber/constraints/friction_cone.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "aligned_buffer.h"
#include "argument_checks.h"
#include "cone_splitting.h"
#include "coulomb_contact.h"
#include "limber/constraints/contact_qp.h"
#include "proximal_solver.h"
#include "sparse_coupling.h"

namespace limber {
namespace {

using Numbers = std::span<const double>;

struct ConeMemory {
  MatrixBuffer A, G;
  AlignedBuffer b, u, v, zero, D, f, best, trial;
  std::vector<double> scale, mu;  // √a_i, μ_i
  std::vector<Mat3> diagonal;     // A_ii, scaled
  std::vector<int> rows;
  // blocks of G: contact i has 2i and 2i + 1
  struct Block {
    std::size_t first_row, offset, columns;  // rows of the padded G; offset in the padded v; 0 columns: none
  };
  std::vector<Block> blocks;
  std::vector<int> offsets, body_columns;
  // staggered
  std::vector<double> A_normal, b_normal, f_normal;
  ContactQpSolver normal_solver;
};

// Contacts are scaled to a_i = trace A_ii/3 = 1: forces by √a_i, velocities by 1/√a_i. Cones do not change by that, and
// all residuals have one unit. What nothing moves (a_i = 0) keeps its scale and no force.

// u = A f + b with A in full, kept up to date.
class DenseContacts {
 public:
  DenseContacts(const FrictionProblem& problem, ConeMemory& memory) : memory_(memory) {
    m_ = static_cast<std::size_t>(problem.contacts);
    const std::size_t n = 3 * m_;
    A_ = memory.A.need(n, n);
    scales(problem);
    for (std::size_t i = 0; i < n; ++i) {
      double* row = A_.row(i);
      const double* from = problem.A.data() + i * n;
      for (std::size_t j = 0; j < n; ++j) row[j] = from[j] / (memory.scale[i / 3] * memory.scale[j / 3]);
      std::fill(row + n, row + A_.stride, 0.0);
    }
    memory.diagonal.resize(m_);
    for (std::size_t i = 0; i < m_; ++i)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
          memory.diagonal[i](r, c) = A_.row(3 * i + static_cast<std::size_t>(r))[3 * i + static_cast<std::size_t>(c)];
    u_ = memory.u.need(n);
    b_ = memory.b.need(n);
    std::fill_n(b_, padded(n), 0.0);
    for (std::size_t i = 0; i < n; ++i) b_[i] = problem.b[i] / memory.scale[i / 3];
  }

  void refresh(const double* f) { combine_rows(u_, b_, A_, nullptr, f, 3 * m_, 3 * m_); }
  Vec3 velocity(std::size_t i, const double*) const { return triple(u_ + 3 * i); }
  void move(std::size_t i, const Vec3& change) {
    const int rows[3] = {static_cast<int>(3 * i), static_cast<int>(3 * i + 1), static_cast<int>(3 * i + 2)};
    combine_rows(u_, u_, A_, rows, change.data(), 3, 3 * m_);
  }
  const double* b() const { return b_; }
  MatrixView matrix() const { return A_; }

 private:
  void scales(const FrictionProblem& problem) {
    const std::size_t n = 3 * m_;
    memory_.scale.resize(m_);
    for (std::size_t i = 0; i < m_; ++i) {
      double trace = 0.0;
      for (std::size_t c = 3 * i; c < 3 * i + 3; ++c) trace += problem.A[c * n + c];
      memory_.scale[i] = trace > 0.0 ? std::sqrt(trace / 3.0) : 1.0;
    }
  }

  ConeMemory& memory_;
  std::size_t m_;
  MatrixView A_{};
  double* u_ = nullptr;
  double* b_ = nullptr;
};

// The same without A: v = Gᵀf of all bodies is kept, and u_i = b_i + D_i f_i + G_i v.
class BlockContacts {
 public:
  BlockContacts(const BlockFrictionProblem& problem, ConeMemory& memory) : memory_(memory) {
    m_ = static_cast<std::size_t>(problem.contacts);
    place_blocks(problem);
    scales(problem);
    b_ = memory.b.need(3 * m_);
    D_ = memory.D.need(3 * m_);
    for (std::size_t i = 0; i < 3 * m_; ++i) {
      const double s = memory.scale[i / 3];
      b_[i] = problem.b[i] / s;
      D_[i] = problem.D.empty() ? 0.0 : problem.D[i] / (s * s);
    }
    std::fill(b_ + 3 * m_, b_ + padded(3 * m_), 0.0);
    memory.diagonal.resize(m_);
    for (std::size_t i = 0; i < m_; ++i) memory.diagonal[i] = own_block(i);
  }

  void refresh(const double* f) {
    std::fill_n(v_, padded(v_size_), 0.0);
    for (std::size_t i = 0; i < m_; ++i) add_to_motion(i, f + 3 * i);
  }
  Vec3 velocity(std::size_t i, const double* f) const {
    Vec3 u;
    for (std::size_t c = 0; c < 3; ++c) u[static_cast<int>(c)] = b_[3 * i + c] + D_[3 * i + c] * f[3 * i + c];
    for (const ConeMemory::Block* block = &memory_.blocks[2 * i]; block != &memory_.blocks[2 * i] + 2; ++block) {
      if (block->columns == 0) continue;
      double part[3];
      multiply_rows(part, {G_.row(block->first_row), G_.stride}, nullptr, v_ + block->offset, 3, block->columns);
      u += triple(part);
    }
    return u;
  }
  void move(std::size_t i, const Vec3& change) { add_to_motion(i, change.data()); }
  const double* b() const { return b_; }

 private:
  // Each body's part of v begins at a padded place; each block's rows are padded.
  void place_blocks(const BlockFrictionProblem& problem) {
    const auto columns = static_cast<std::size_t>(problem.columns);
    memory_.offsets.assign(columns, -1);
    memory_.blocks.resize(2 * m_);
    std::size_t widest = 0, rows = 0;
    v_size_ = 0;
    for (std::size_t k = 0; k < 2 * m_; ++k) {
      const FrictionBlock& from = problem.blocks[k];
      memory_.blocks[k] = {rows, 0, 0};
      if (!from.values || from.columns == 0) continue;
      const auto first = static_cast<std::size_t>(from.first_column);
      if (memory_.offsets[first] < 0) {
        memory_.offsets[first] = static_cast<int>(v_size_);
        v_size_ += padded(static_cast<std::size_t>(from.columns));
      }
      memory_.blocks[k] = {rows, static_cast<std::size_t>(memory_.offsets[first]),
                           static_cast<std::size_t>(from.columns)};
      widest = std::max(widest, static_cast<std::size_t>(from.columns));
      rows += 3;
    }
    v_ = memory_.v.need(v_size_);
    G_ = memory_.G.need(rows, widest);
    for (std::size_t k = 0; k < 2 * m_; ++k)
      for (std::size_t c = 0; c < 3 && memory_.blocks[k].columns > 0; ++c) {
        double* row = G_.row(memory_.blocks[k].first_row + c);
        std::copy_n(problem.blocks[k].values + c * memory_.blocks[k].columns, memory_.blocks[k].columns, row);
        std::fill(row + memory_.blocks[k].columns, row + G_.stride, 0.0);
      }
  }

  void scales(const BlockFrictionProblem& problem) {
    memory_.scale.assign(m_, 1.0);
    for (std::size_t i = 0; i < m_; ++i) {
      double trace = 0.0;
      for (std::size_t c = 0; c < 3; ++c) trace += problem.D.empty() ? 0.0 : problem.D[3 * i + c];
      for_rows(i, [&](double* row, std::size_t columns, std::size_t) { trace += dot(row, row, columns); });
      if (!(trace > 0.0)) continue;
      memory_.scale[i] = std::sqrt(trace / 3.0);
      for_rows(i, [&](double* row, std::size_t columns, std::size_t) {
        for (std::size_t j = 0; j < columns; ++j) row[j] /= memory_.scale[i];
      });
    }
  }

  template <class Body>
  void for_rows(std::size_t i, const Body& body) const {
    for (std::size_t k = 2 * i; k < 2 * i + 2; ++k)
      for (std::size_t c = 0; c < 3 && memory_.blocks[k].columns > 0; ++c)
        body(G_.row(memory_.blocks[k].first_row + c), memory_.blocks[k].columns, c);
  }

  Mat3 own_block(std::size_t i) const {
    Mat3 A = Vec3(D_[3 * i], D_[3 * i + 1], D_[3 * i + 2]).asDiagonal();
    for (std::size_t k = 2 * i; k < 2 * i + 2; ++k)
      for (std::size_t r = 0; r < 3 && memory_.blocks[k].columns > 0; ++r)
        for (std::size_t c = 0; c < 3; ++c)
          A(static_cast<int>(r), static_cast<int>(c)) +=
              dot(G_.row(memory_.blocks[k].first_row + r), G_.row(memory_.blocks[k].first_row + c),
                  memory_.blocks[k].columns);
    return A;
  }

  void add_to_motion(std::size_t i, const double* force) {
    for (std::size_t k = 2 * i; k < 2 * i + 2; ++k) {
      const ConeMemory::Block& block = memory_.blocks[k];
      if (block.columns == 0) continue;
      double* v = v_ + block.offset;
      combine_rows(v, v, {G_.row(block.first_row), G_.stride}, nullptr, force, 3, block.columns);
    }
  }

  ConeMemory& memory_;
  std::size_t m_ = 0, v_size_ = 0;
  MatrixView G_{};
  double* v_ = nullptr;
  double* b_ = nullptr;
  double* D_ = nullptr;
};

// What every method shares: sweeps and the residual, in scaled numbers.
template <class Contacts>
class Sweeps {
 public:
  Sweeps(Contacts& contacts, ConeMemory& memory, std::size_t m, const FrictionOptions& options, FrictionResult& result)
      : contacts_(contacts), memory_(memory), m_(m), options_(options), result_(result) {
    f_ = memory.f.need(3 * m);
    for (std::size_t i = 0; i < m; ++i) size_ = std::max(size_, triple(contacts.b() + 3 * i).norm());
    if (size_ == 0.0) size_ = 1.0;  // nothing moves: zero is the solution
  }

  double* f() const { return f_; }
  double size() const { return size_; }

  void start(Numbers guess) {
    std::fill_n(f_, padded(3 * m_), 0.0);
    for (std::size_t i = 0; i < m_; ++i) {
      const Vec3 given = triple(guess.data() + 3 * i) * memory_.scale[i];
      if (given.allFinite()) put(i, project_on_cone(given, memory_.mu[i]));
    }
    contacts_.refresh(f_);
  }

  // Every contact solved once, in order. Returns the largest change of a force.
  double sweep() {
    double most = 0.0;
    for (std::size_t i = 0; i < m_; ++i) {
      const Mat3& A = memory_.diagonal[i];
      if (!(A(0, 0) > 0.0)) continue;
      const Vec3 old = triple(f_ + 3 * i);
      const Vec3 b = contacts_.velocity(i, f_) - A * old;
      const Vec3 change = solve_coulomb_contact(A, b, memory_.mu[i]) - old;
      if (change.isZero(0.0)) continue;
      put(i, old + change);
      contacts_.move(i, change);
      most = std::max(most, change.norm());
    }
    ++result_.sweeps;
    return most;
  }

  Vec3 map(std::size_t i) const {
    const Vec3 x = triple(f_ + 3 * i);
    return x - project_on_cone(x - corrected_velocity(contacts_.velocity(i, f_), memory_.mu[i]), memory_.mu[i]);
  }

  double residual() const {
    double worst = 0.0;
    for (std::size_t i = 0; i < m_; ++i) worst = std::max(worst, map(i).norm());
    return worst / size_;
  }

  // Up to `count` sweeps; whether the residual is small enough after them.
  bool run(int count) {
    for (int n = 0; n < count && result_.sweeps < options_.max_sweeps; ++n) {
      // The residual costs as much as a sweep, and is not small where a force still changes much.
      if (sweep() > 10.0 * options_.tolerance * size_) continue;
      contacts_.refresh(f_);
      result_.residual = residual();
      if (result_.residual <= options_.tolerance) return true;
    }
    contacts_.refresh(f_);
    result_.residual = residual();
    return result_.residual <= options_.tolerance;
  }

  void put(std::size_t i, const Vec3& force) { std::copy_n(force.data(), 3, f_ + 3 * i); }

  FrictionResult finish(std::span<double> f) {
    result_.status = result_.residual <= options_.tolerance ? SolveStatus::kSolved : SolveStatus::kIterationLimit;
    for (std::size_t i = 0; i < m_; ++i) {
      const Vec3 force = project_on_cone(triple(f_ + 3 * i), memory_.mu[i]) / memory_.scale[i];
      std::copy_n(force.data(), 3, f.data() + 3 * i);
    }
    return result_;
  }

 private:
  Contacts& contacts_;
  ConeMemory& memory_;
  std::size_t m_;
  const FrictionOptions& options_;
  FrictionResult& result_;
  double* f_ = nullptr;
  double size_ = 0.0;
};

// Alternates the normal and the friction problem.
class Staggered {
 public:
  Staggered(DenseContacts& contacts, Sweeps<DenseContacts>& sweeps, ConeMemory& memory, std::size_t m)
      : contacts_(contacts), sweeps_(sweeps), memory_(memory), m_(m) {
    memory.A_normal.resize(m * m), memory.b_normal.resize(m), memory.f_normal.resize(m);
    for (std::size_t i = 0; i < m; ++i)
      for (std::size_t j = 0; j < m; ++j) memory.A_normal[i * m + j] = contacts.matrix().row(3 * i)[3 * j];
  }

  void solve_normal() {
    double* f = sweeps_.f();
    const std::vector<double>& A = memory_.A_normal;
    for (std::size_t i = 0; i < m_; ++i) memory_.f_normal[i] = f[3 * i];
    for (std::size_t i = 0; i < m_; ++i) {
      double from_normals = 0.0;
      for (std::size_t j = 0; j < m_; ++j) from_normals += A[i * m_ + j] * f[3 * j];
      memory_.b_normal[i] = contacts_.velocity(i, f)[0] - from_normals;
    }
    memory_.normal_solver.solve(ContactQp{.size = static_cast<int>(m_), .A = A, .b = memory_.b_normal},
                                memory_.f_normal);
    for (std::size_t i = 0; i < m_; ++i) f[3 * i] = memory_.f_normal[i];
    contacts_.refresh(f);
  }

  // Sweeps of discs of radius μ n until the forces stand still.
  void solve_friction(double tolerance) {
    constexpr int kMaxSweeps = 200;
    double* f = sweeps_.f();
    double most = 2.0 * tolerance;
    for (int n = 0; n < kMaxSweeps && most > tolerance; ++n) {
      most = 0.0;
      for (std::size_t i = 0; i < m_; ++i) {
        const Eigen::Matrix2d A = memory_.diagonal[i].bottomRightCorner<2, 2>();
        const Eigen::Vector2d old(f[3 * i + 1], f[3 * i + 2]);
        const Eigen::Vector2d b = contacts_.velocity(i, f).tail<2>() - A * old;
        const Eigen::Vector2d force = solve_in_disc(A, b, memory_.mu[i] * f[3 * i]);
        const Eigen::Vector2d change = force - old;
        if (change.isZero(0.0)) continue;
        f[3 * i + 1] = force[0], f[3 * i + 2] = force[1];
        contacts_.move(i, {0.0, change[0], change[1]});
        most = std::max(most, change.norm());
      }
    }
    contacts_.refresh(f);
  }

 private:
  DenseContacts& contacts_;
  Sweeps<DenseContacts>& sweeps_;
  ConeMemory& memory_;
  std::size_t m_;
};

// The alternation need not settle: the best forces on the way are kept.
void solve_staggered(DenseContacts& contacts, Sweeps<DenseContacts>& sweeps, ConeMemory& memory, std::size_t m,
                     const FrictionOptions& options, FrictionResult& result) {
  Staggered staggered(contacts, sweeps, memory, m);
  double* best = memory.best.need(3 * m);
  result.residual = sweeps.residual();
  std::copy_n(sweeps.f(), 3 * m, best);
  while (result.sweeps < options.max_sweeps && result.residual > options.tolerance) {
    staggered.solve_normal();
    staggered.solve_friction(0.01 * options.tolerance * sweeps.size());
    ++result.sweeps;
    if (const double now = sweeps.residual(); now < result.residual) {
      result.residual = now;
      std::copy_n(sweeps.f(), 3 * m, best);
    }
  }
  std::copy_n(best, 3 * m, sweeps.f());
}

constexpr const char* kSolverName = "FrictionSolver::solve";

void check(int contacts, Numbers b, Numbers mu, Numbers f, const FrictionOptions& options) {
  check_option(kSolverName, "contacts", contacts >= 0, contacts, "0 or more");
  const auto m = static_cast<std::size_t>(contacts);
  check_length(kSolverName, "b", b.size(), 3 * m);
  check_length(kSolverName, "mu", mu.size(), m);
  check_length(kSolverName, "f", f.size(), 3 * m);
  check_option(kSolverName, "tolerance", options.tolerance > 0.0, options.tolerance, "> 0");
  check_option(kSolverName, "max_sweeps", options.max_sweeps >= 1, options.max_sweeps, "1 or more");
}

bool take_friction(Numbers b, Numbers mu, ConeMemory& memory) {
  memory.mu.assign(mu.begin(), mu.end());
  return all_finite(b.data(), b.size()) && all_finite(mu.data(), mu.size()) &&
         std::all_of(mu.begin(), mu.end(), [](double x) { return x >= 0.0; });
}

void check_blocks(const BlockFrictionProblem& problem, std::vector<int>& body_columns) {
  const auto m = static_cast<std::size_t>(problem.contacts);
  check_length(kSolverName, "blocks", problem.blocks.size(), 2 * m);
  check_optional_length(kSolverName, "D", problem.D.size(), 3 * m);
  for (const FrictionBlock& block : problem.blocks)
    if (block.values)
      check_option(
          kSolverName, "a block's last column",
          block.first_column >= 0 && block.columns >= 0 && block.columns <= problem.columns - block.first_column,
          block.first_column + block.columns, "at most the number of columns");
  body_columns.assign(static_cast<std::size_t>(problem.columns), 0);
  for (std::size_t k = 0; k < 2 * m; ++k) {
    const FrictionBlock& block = problem.blocks[k];
    if (block.values == nullptr || block.columns == 0) continue;
    int& known = body_columns[static_cast<std::size_t>(block.first_column)];
    if (known == 0) known = block.columns;
    if (known != block.columns)
      throw InvalidArgument("FrictionSolver::solve: block " + std::to_string(k) + " has " +
                            std::to_string(block.columns) + " columns from " + std::to_string(block.first_column) +
                            " on, an earlier one " + std::to_string(known));
  }
}

bool finite_blocks(const BlockFrictionProblem& problem) {
  return std::all_of(problem.blocks.begin(), problem.blocks.end(), [](const FrictionBlock& block) {
    return !block.values || all_finite(block.values, 3 * static_cast<std::size_t>(block.columns));
  });
}

FrictionResult report(const ProximalSolver::Result& result) {
  return {.status = result.status,
          .sweeps = result.sweeps,
          .newton_steps = result.newton_steps,
          .residual = result.residual};
}

FrictionResult refuse_cones(std::span<double> f) {
  std::fill(f.begin(), f.end(), 0.0);
  return {.status = SolveStatus::kInvalidInput};
}

}  // namespace

struct FrictionSolver::Impl {
  ConeMemory memory;
  ProximalSolver proximal;
  SparseCoupling sparse;
  std::vector<std::size_t> nodes;  // by first column; the largest number where there is none

  ConeSplitting splitting;
  std::vector<double> w, unit;

  void place(const BlockFrictionProblem& problem);
  FrictionResult split(const BlockFrictionProblem& problem, std::span<double> f, const FrictionOptions& options);
};

/// The problem's blocks as rows of bodies.
void FrictionSolver::Impl::place(const BlockFrictionProblem& problem) {
  constexpr auto kNone = std::numeric_limits<std::size_t>::max();
  const auto m = static_cast<std::size_t>(problem.contacts);
  const auto acts = [](const FrictionBlock& block) { return block.values != nullptr && block.columns > 0; };
  const auto node_of = [&](const FrictionBlock& block) -> std::size_t& {
    return nodes[static_cast<std::size_t>(block.first_column)];
  };
  /// Whether the block has a side of its own, and not that of the contact's other one.
  const auto is_new = [&](std::size_t k) {
    const FrictionBlock &block = problem.blocks[k], &other = problem.blocks[k - k % 2];
    return acts(block) && (k % 2 == 0 || !acts(other) || other.first_column != block.first_column);
  };
  sparse.begin_structure();
  nodes.assign(static_cast<std::size_t>(problem.columns), kNone);
  for (const FrictionBlock& block : problem.blocks)
    if (acts(block) && node_of(block) == kNone)
      node_of(block) = sparse.add_node(static_cast<std::size_t>(block.columns));
  for (std::size_t i = 0; i < m; ++i) {
    sparse.add_unit(3);
    for (std::size_t k = 2 * i; k < 2 * i + 2; ++k)
      if (is_new(k)) sparse.add_side(node_of(problem.blocks[k]));
  }
  sparse.end_structure();
  std::size_t sides = 0;
  for (std::size_t i = 0; i < m; ++i) {
    for (std::size_t k = 2 * i; k < 2 * i + 2; ++k) {
      const FrictionBlock& block = problem.blocks[k];
      if (!acts(block)) continue;
      if (is_new(k)) ++sides;
      const MatrixView rows = sparse.values(sides - 1);
      const auto columns = static_cast<std::size_t>(block.columns);
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < columns; ++c) rows.row(r)[c] += block.values[r * columns + c];
    }
    for (std::size_t r = 0; r < 3 && !problem.D.empty(); ++r) sparse.compliance(3 * i + r) = problem.D[3 * i + r];
  }
}

FrictionResult FrictionSolver::Impl::split(const BlockFrictionProblem& problem, std::span<double> f,
                                           const FrictionOptions& options) {
  constexpr int kAtATime = 10;
  place(problem);
  const std::size_t n = f.size();
  for (std::size_t i = 0; i < n; i += 3)
    if (!triple(&f[i]).allFinite()) std::fill_n(&f[i], 3, 0.0);
  splitting.begin({.cones = problem.contacts, .friction = memory.mu}, sparse);
  splitting.units_of(problem.b, unit);
  double *x = memory.v.need(n), *Ax = memory.u.need(n);
  std::fill_n(x, padded(n), 0.0);
  w.resize(n);
  FrictionResult result;
  for (;; result.sweeps += kAtATime) {
    std::copy(f.begin(), f.end(), x);
    sparse.scale({});
    sparse.multiply(Ax, x);
    for (std::size_t i = 0; i < n; ++i) w[i] = Ax[i] + problem.b[i];
    result.residual = splitting.residual(f, w, unit);
    if (result.residual <= options.tolerance) return result;
    if (result.sweeps >= options.max_sweeps || !splitting.advance(problem.b, kAtATime, f)) break;
  }
  result.status = SolveStatus::kIterationLimit;
  return result;
}

FrictionSolver::FrictionSolver() : impl_(std::make_unique<Impl>()) {}
FrictionSolver::~FrictionSolver() = default;
FrictionSolver::FrictionSolver(FrictionSolver&&) noexcept = default;
FrictionSolver& FrictionSolver::operator=(FrictionSolver&&) noexcept = default;

FrictionResult FrictionSolver::solve(const FrictionProblem& problem, std::span<double> f,
                                     const FrictionOptions& options) {
  check(problem.contacts, problem.b, problem.mu, f, options);
  const auto m = static_cast<std::size_t>(problem.contacts);
  check_length(kSolverName, "A", problem.A.size(), 9 * m * m);
  if (options.method == FrictionMethod::kSplitting)
    throw InvalidArgument("FrictionSolver::solve: rows in full are not solved by kSplitting, which was asked for");
  ConeMemory& memory = impl_->memory;
  if (!take_friction(problem.b, problem.mu, memory) || !all_finite(problem.A.data(), problem.A.size()))
    return refuse_cones(f);
  if (options.method == FrictionMethod::kProximal) {
    const ProximalSolver::Result result =
        impl_->proximal.solve({.cones = problem.contacts, .A = problem.A, .b = problem.b, .friction = problem.mu}, f,
                              {.tolerance = options.tolerance, .max_sweeps = options.max_sweeps});
    return report(result);
  }
  DenseContacts contacts(problem, memory);
  FrictionResult result;
  Sweeps<DenseContacts> sweeps(contacts, memory, m, options, result);
  sweeps.start(f);
  if (options.method == FrictionMethod::kStaggered)
    solve_staggered(contacts, sweeps, memory, m, options, result);
  else
    sweeps.run(options.max_sweeps);
  return sweeps.finish(f);
}

FrictionResult FrictionSolver::solve(const BlockFrictionProblem& problem, std::span<double> f,
                                     const FrictionOptions& options) {
  check(problem.contacts, problem.b, problem.mu, f, options);
  check_blocks(problem, impl_->memory.body_columns);
  if (options.method == FrictionMethod::kStaggered)
    throw InvalidArgument("FrictionSolver::solve: blocks are not solved by kStaggered, which was asked for");
  ConeMemory& memory = impl_->memory;
  if (!take_friction(problem.b, problem.mu, memory) || !finite_blocks(problem) ||
      !std::all_of(problem.D.begin(), problem.D.end(), [](double x) { return x >= 0.0 && std::isfinite(x); }))
    return refuse_cones(f);
  if (options.method == FrictionMethod::kProximal) {
    impl_->place(problem);
    return report(impl_->proximal.solve({.cones = problem.contacts, .b = problem.b, .friction = problem.mu},
                                        impl_->sparse, f,
                                        {.tolerance = options.tolerance, .max_sweeps = options.max_sweeps}));
  }
  if (options.method == FrictionMethod::kSplitting) return impl_->split(problem, f, options);
  BlockContacts contacts(problem, memory);
  FrictionResult result;
  Sweeps<BlockContacts> sweeps(contacts, memory, static_cast<std::size_t>(problem.contacts), options, result);
  sweeps.start(f);
  sweeps.run(options.max_sweeps);
  return sweeps.finish(f);
}

}  // namespace limber
