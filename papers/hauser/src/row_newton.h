// Newton's method for the impulses of islands with contacts by [H03]'s rules: A ΔF + gap(F) = … within the rows'
// bounds, with the Jacobian of the step's start for all iterations.
#pragma once

#include <span>
#include <vector>

#include "bounded_rows.h"
#include "island/island_step.h"
#include "limber/solvers/secant_iteration.h"

namespace limber::internal {

class RowNewton {
 public:
  /// Finds step.f, with the step predicted and measured under it.
  /// @param programs gets those of the last iteration
  SolveStatus solve(IslandStep& step, const ContactRule& rule, IslandReport& report, ProgramReport& programs);

 private:
  void factor(const IslandStep& step);
  SolveStatus iterate(IslandStep& step, const ContactRule& rule, IslandReport& report);
  SolveStatus improve(const IslandStep& step, const ContactRule& rule);
  void respond(std::span<const double> impulses, std::vector<double>& gaps);
  double largest_change(const IslandStep& step) const;
  void take(IslandStep& step, std::span<const double> whole);
  SolveStatus take_best(IslandStep& step, IslandReport& report);

  std::vector<double> F_, next_, change_;  // N·s, whole, by row; the next ones, and what they make of the gaps
  std::vector<double> J_, metric_, x_, b_;
  BoundedRows bounded_;
  ProgramReport programs_;  // of the last iteration
  SecantIteration secants_;
};

}  // namespace limber::internal
