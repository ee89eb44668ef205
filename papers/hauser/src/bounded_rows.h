// Rows with bounds beside rows without, of islands whose contacts [H03]'s rules solve for: the latter are eliminated,
// the former are [H03]'s programs.
#pragma once

#include <span>
#include <vector>

#include "island/island_step.h"
#include "limber/hauser/contact_rule.h"
#include "limber/hauser/equality_elimination.h"

namespace limber::internal {

class BoundedRows {
 public:
  /// Sorts the rows: equalities, then contacts with friction, three each, then the others with bounds.
  void sort(const IslandStep& step);
  /// All rows in that order.
  std::span<const Index> order() const { return order_; }
  int contacts() const { return static_cast<int>(friction_.size()); }

  /// A = J D Jᵀ with the rows' compliance and flexibility. @param J rows × degrees of freedom. @param metric D
  void assemble(const IslandStep& step, std::span<const double> J, std::span<const double> metric);
  /// @param b gaps without impulses, less what is asked for, by row. @param F whole impulses: a guess, and the answer
  SolveStatus solve(const IslandStep& step, const ContactRule& rule, std::span<const double> b, std::span<double> F,
                    ProgramReport& report);
  /// F within their bounds and cones.
  void keep_within(const IslandStep& step, const ContactRule& rule, std::span<double> F) const;

 private:
  SolveStatus solve_bounded(const IslandStep& step, const ContactRule& rule, std::span<const double> F,
                            ProgramReport& report);

  std::vector<Index> order_, place_;  // of the rows, and of each its place
  std::size_t first_bounded_ = 0;     // in that order
  std::vector<double> friction_;      // of the contacts
  std::vector<double> G_, A_, b_;     // J D^½ and the problem, in that order
  struct {
    std::vector<double> A, b, lower, upper, gap_before, F;
  } bounded_;  // the problem reduced to rows with bounds
  std::vector<double> F_equal_;
  EqualityElimination elimination_;
  ContactProgramSolver programs_;
};

}  // namespace limber::internal
