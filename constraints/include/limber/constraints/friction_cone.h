/// @file limber/constraints/friction_cone.h
/// Contacts with Coulomb friction: forces in cones, speeds in their duals.
///
/// Contact i has the force f_i = (n, t₁, t₂) along its normal and two tangents, and the relative velocity
/// u = A f + b. With K_μ = {|f_t| ≤ μ f_n}, K*_μ = {μ|u_t| ≤ u_n} its dual and De Saxcé's correction
///
///   û_i = u_i + μ_i |u_t,i| e_n,      K_μ ∋ f_i ⊥ û_i ∈ K*_μ                                              (1)
///
/// says: apart (f = 0, u_n ≥ 0), sticking (u = 0, f inside the cone) or sliding (u_n = 0, f_t = −μ f_n u_t/|u_t|)
/// (De Saxcé and Feng 1998; Acary and Brogliato 2008). At gap level the normal rows of b and A may be gaps over Δt.
/// μ = 0 is a contact without friction.
///
/// (1) is not convex: contacts strongly coupled by large friction may not converge by any method here (figures:
/// docs/reports/contact-solvers.md). The status then is kIterationLimit, and the forces are in their cones all the
/// same. For programs of your own: islands (island_solver.h) use private solvers with the same fixed point.
///
/// Methods, all with (1) as fixed point where they converge:
/// - kBlockGaussSeidel: one contact after the other, each solved exactly; memory and time linear in contacts × bodies.
/// - kProximal: convex problems with the correction held, by the proximal point method, which settles for any rank and
///   number of contacts; the correction follows, and Newton's method on both ends it. Sweeps where that does not settle.
///   In full by an LU of the rows, in blocks by a sparse one of the bodies' degrees of freedom.
/// - kSplitting: operator splitting, in blocks alone. One factor for all iterations, which converge linearly and do not
///   get stuck where hundreds of contacts slide and stick: a part in 1e5 soon, the last digits slowly.
/// - kStaggered: alternates the normal problem under fixed friction and the friction problem under fixed normal forces
///   (Kaufman et al. 2008); each half is convex.
#pragma once

#include <memory>
#include <span>

#include "limber/constraints/solve_status.h"

namespace limber {

/// All rows in full: for islands of tens of contacts.
struct FrictionProblem {
  int contacts = 0;                 ///< m ≥ 0
  std::span<const double> A = {};   ///< 3m × 3m, symmetric positive semidefinite; row 3i + (0 normal, 1, 2 tangents)
  std::span<const double> b = {};   ///< 3m, velocity without the forces
  std::span<const double> mu = {};  ///< m, friction coefficients, each ≥ 0
};

/// The rows of a contact that belong to one body: 3 × columns of J M^{−½}.
struct FrictionBlock {
  int first_column = 0;            ///< of the body's degrees of freedom among all
  int columns = 0;                 ///< the body's degrees of freedom
  const double* values = nullptr;  ///< 3 × columns, row-major; null: no body here
};

/// A = G Gᵀ + diag(D) with few blocks per row of G: for islands of hundreds of contacts; A is never formed.
struct BlockFrictionProblem {
  int contacts = 0;                            ///< m ≥ 0
  int columns = 0;                             ///< degrees of freedom of all bodies
  std::span<const FrictionBlock> blocks = {};  ///< 2m: of contact i, 2i and 2i + 1
  std::span<const double> D = {};              ///< 3m, each ≥ 0; empty: all 0
  std::span<const double> b = {};              ///< 3m
  std::span<const double> mu = {};             ///< m
};

enum class FrictionMethod { kProximal, kBlockGaussSeidel, kStaggered, kSplitting };

struct FrictionOptions {
  FrictionMethod method = FrictionMethod::kProximal;
  double tolerance = 1e-9;  ///< of the residual below; > 0
  int max_sweeps = 500;     ///< sweeps over all contacts, alternations, or iterations; ≥ 1
};

struct FrictionResult {
  SolveStatus status = SolveStatus::kSolved;
  int sweeps = 0;        ///< sweeps, alternations, or iterations
  int newton_steps = 0;  ///< kProximal: those that were taken
  double residual = 0.0;  ///< max_i |f_i − P_K(f_i − û_i/a_i)|·√a_i over max_i(|b_i|/√a_i), a_i = trace A_ii / 3
};

/// The solver and its memory, which grows to the largest problem seen; after that a solve allocates nothing. One thread
/// at a time. The same call gives the same bits.
class FrictionSolver {
 public:
  FrictionSolver();
  ~FrictionSolver();
  FrictionSolver(FrictionSolver&&) noexcept;
  FrictionSolver& operator=(FrictionSolver&&) noexcept;

  /// @param f 3m; on entry a guess, such as the last step's forces, or zero; on return the solution (in its cones
  /// whatever the status), or zero for kInvalidInput.
  /// @throws InvalidArgument if a span's length does not fit, or an option is out of range
  FrictionResult solve(const FrictionProblem& problem, std::span<double> f, const FrictionOptions& options = {});
  /// The same solution without A. kProximal factors a matrix of the bodies' degrees of freedom with a block where two
  /// bodies touch. @throws InvalidArgument as above, for two blocks of one first column but different
  /// widths, or for kStaggered
  FrictionResult solve(const BlockFrictionProblem& problem, std::span<double> f, const FrictionOptions& options = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
