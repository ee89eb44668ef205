// The rows of an island whose impulses have bounds, in one iteration of Newton's method: w = A f + b with
// contacts in friction cones and rows with an interval each. The one place where a contact method is chosen.
#pragma once

#include <span>
#include <vector>

#include "limber/constraints/contact_qp.h"
#include "proximal_solver.h"

namespace limber {

/// The solver and its memory, which grows to the largest problem seen.
class BoundedRowSolver {
 public:
  /// Begins a step of an island. @param newton_steps for all its problems in blocks that are solved patiently
  void begin(int newton_steps) { newton_steps_left_ = newton_steps; }
  bool tired() const { return newton_steps_left_ <= 0; }
  /// @param rows A f + b: gaps less offsets at the step's end. @param f n whole impulses, with what is held over the
  /// step; on entry a guess, on return within bounds and cones
  SolveStatus solve(const BoundedRows& rows, std::span<double> f);
  /// The same for an A in blocks; rows.A is not read.
  /// @param patient as for an A in full, with short steps where long ones do not settle, until tired()
  SolveStatus solve(const BoundedRows& rows, RowCoupling& coupling, std::span<double> f, bool patient);

 private:
  template <class Solve>
  SolveStatus solve_twice(const Solve& solve, std::span<double> f);
  SolveStatus solve_cones(const BoundedRows& rows, std::span<double> f);

  int newton_steps_left_ = 0;
  ContactQpSolver qp_;         // without cones
  ProximalSolver proximal_;    // with
  std::vector<double> other_;  // impulses of a second attempt
};

}  // namespace limber
