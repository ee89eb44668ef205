// The rows of an island whose impulses have bounds, in one iteration of Newton's method: w = A f + b with
// contacts in friction cones and rows with an interval each. The one place where a contact method is chosen.
#pragma once

#include <span>
#include <vector>

#include "cone_splitting.h"
#include "dense_coupling.h"
#include "limber/constraints/contact_qp.h"
#include "proximal_solver.h"

namespace limber {

/// How contacts in friction cones are solved for, and how patiently.
enum class ConeMethod {
  kSplitBetween,  ///< Newton's method; where it does not settle, splitting, and Newton's method from there
  kShortSteps,    ///< Newton's method; where it does not settle, once more with short proximal steps
  kOnce,          ///< Newton's method with few steps, whatever they come to
};

/// The solver and its memory, which grows to the largest problem seen.
class BoundedRowSolver {
 public:
  /// Begins a step of an island. @param newton_steps for all its problems but those solved by kOnce. Once they are
  /// used up a problem still gets a few
  void begin(int newton_steps) { most_newton_steps_ = newton_steps, newton_steps_ = 0; }
  bool tired() const { return newton_steps_ >= most_newton_steps_; }
  int newton_steps() const { return newton_steps_; }
  /// @param rows A f + b: gaps less offsets at the step's end. @param f n whole impulses, with what is held over the
  /// step; on entry a guess, on return within bounds and cones
  SolveStatus solve(const BoundedRows& rows, std::span<double> f);
  /// The same for contacts beside other rows and an A in blocks; rows.A is not read. For an A in full: kSplitBetween.
  SolveStatus solve(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f, ConeMethod method);

 private:
  SolveStatus solve_cones(const BoundedRows& rows, std::span<double> f);
  ProximalSolver::Result attempt(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f,
                                 ProximalSolver::Options options);

  int most_newton_steps_ = 0, newton_steps_ = 0;
  ContactQpSolver qp_;       // without cones
  ProximalSolver proximal_;  // with
  DenseCoupling full_;       // A of those in full
  ConeSplitting splitting_;
  std::vector<double> other_;  // impulses of a second attempt
};

}  // namespace limber
