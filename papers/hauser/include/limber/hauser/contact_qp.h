/// @file limber/hauser/contact_qp.h
/// The complementary contact problem, and any problem with one bound on each force, by an active-set method.
///
///   0 ≤ f ⊥ w = A f + b ≥ 0      which for symmetric A ≥ 0 is      min ½fᵀA f + bᵀf,  f ≥ 0            (1)
///   with bounds, lo ≤ f ≤ hi:    w_i ≥ 0 where f_i = lo_i,  w_i ≤ 0 where f_i = hi_i,  else w_i = 0      (2)
///
/// (2) holds contacts (0, ∞), equality rows (−∞, ∞), motors with a largest force, and friction under a fixed normal
/// force. At velocity level the solution never adds energy: f·w = 0, so ΔE = −½fᵀA f.
///
/// Method: the free forces (strictly between their bounds) are solved for exactly by a Cholesky factor of their block,
/// which is updated as forces enter and leave (Lawson and Hanson, *Solving Least Squares Problems*, chapter 23, in the
/// form for bounds). A force whose row depends on those of the free ones never enters, so A may have any rank: more
/// contacts than degrees of freedom, the same contact twice. w is unique; f then is one of many.
/// Where b has no solution at all (b outside the range of A, rows that contradict each other), 1e-6 of the diagonal is
/// added to it as compliance, or more, and the result says so.
#pragma once

#include <memory>
#include <span>

#include "limber/solvers/solve_status.h"

namespace limber {

/// The problem with A in full.
struct ContactQp {
  int size = 0;                        ///< m ≥ 0
  std::span<const double> A = {};      ///< m × m, symmetric positive semidefinite
  std::span<const double> b = {};      ///< m
  std::span<const double> lower = {};  ///< m, may hold −∞; empty: all 0
  std::span<const double> upper = {};  ///< m, may hold +∞; empty: all +∞
};

/// The problem with A = G Gᵀ + diag(D): cheaper where there are more rows than degrees of freedom. For contacts G is
/// J M^{−½} and D the residual compliance.
struct FactoredContactQp {
  int size = 0;                        ///< m ≥ 0
  int dimension = 0;                   ///< d ≥ 0, degrees of freedom
  std::span<const double> G = {};      ///< m × d, row-major
  std::span<const double> D = {};      ///< m, each ≥ 0; empty: all 0
  std::span<const double> b = {};      ///< m
  std::span<const double> lower = {};  ///< as in ContactQp
  std::span<const double> upper = {};
};

struct ContactQpResult {
  SolveStatus status = SolveStatus::kSolved;
  int iterations = 0;  ///< forces that entered or left the free set
  int free = 0;        ///< forces strictly between their bounds
  /// Of (2): max_i |√A_ii f_i − clamp(√A_ii f_i − w_i/√A_ii)| over max_i(|b_i|/√A_ii, √A_ii|f_i|); ≤ 1e-11 if solved.
  double residual = 0.0;
  double slack = 0.0;  ///< largest violation of (2) among the w_i, in their unit; 0 unless relaxed
};

/// The solver and its memory, which grows to the largest problem seen; after that a solve allocates nothing. One thread
/// at a time. The same call gives the same bits: nothing is remembered between calls.
class ContactQpSolver {
 public:
  ContactQpSolver();
  ~ContactQpSolver();
  ContactQpSolver(ContactQpSolver&&) noexcept;
  ContactQpSolver& operator=(ContactQpSolver&&) noexcept;

  /// @param f m; on entry a guess, such as the last step's solution (forces strictly between their bounds start free),
  /// or zero; on return the solution, or zero for kInvalidInput.
  /// @throws InvalidArgument if a span's length does not fit
  ContactQpResult solve(const ContactQp& problem, std::span<double> f);
  ContactQpResult solve(const FactoredContactQp& problem, std::span<double> f);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
