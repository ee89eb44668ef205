// Newton's step of bodies under impulses in the middle of a step, from where they are: what impulses make of the gaps.
// Modes and bodies are eliminated. With r the bodies' residual, K its derivative, F and E the rows' forces and gaps, B
// what modes make of gaps, c the rows' compliance, γ springs that stand in for rows, ΔQ = Δf + γ E Δx:
//   Δx = (K + F γ E)⁻¹ (F ΔQ − r),    gaps = open + A ΔQ,    A = E' (K + F γ E)⁻¹ F + B + c,  E' = (1 − B γ − c γ) E
#pragma once

#include <span>
#include <vector>

#include "limber/solvers/unsymmetric_factor.h"
#include "midpoint_change.h"

namespace limber::internal {

class MidpointProblem {
 public:
  /// Measures what is left of all equations where the bodies have been placed. @return whether they are met to their
  /// digits
  bool measure(const IslandStep& step, MidpointMotion& motion, std::span<const double> impulses);
  /// After measure(): all derivatives where the bodies are. @return whether there is an answer
  bool linearise(const IslandStep& step, MidpointMotion& motion, std::span<const double> impulses);
  /// After measure(): the residual of the bodies by the derivatives of the last linearise().
  void aim(const MidpointMotion& motion);
  /// A for some rows. All rows with γ must be among them.
  void reduce(const IslandStep& step, const MidpointMotion& motion, std::span<const Index> rows, RowMatrix& A);
  /// Of the same rows, after aim().
  void find_open(const MidpointMotion& motion, std::span<const Index> rows, RowVector& open) const;
  /// What ΔQ of these rows makes of everything. @param to but for its size
  void answer(const MidpointMotion& motion, std::span<const Index> rows, const RowVector& change, MidpointChange& to);

  /// Whether contacts meet their law to their tolerance, as measured last.
  bool touches_law() const { return worst_contact_ <= 1.0; }
  /// How far the worst of all rows is from its law where the bodies have been placed, by tolerance.
  double largest_distance(const IslandStep& step, std::span<const double> impulses);

  /// gap − offset + compliance × impulse, of all rows
  const Vector& off() const { return off_; }
  /// What an impulse makes of the row's own gap, > 0; of a contact's or a vector's rows, at their first, all of them.
  double response(std::size_t row) const { return response_[row]; }
  const Vector& gap_change() const { return gap_change_; }  // of all rows, without their compliance

 private:
  void find_off(const IslandStep& step, std::span<const double> impulses);
  double distance_from_law(const IslandStep& step, std::size_t first, std::size_t count,
                           std::span<const double> impulses) const;
  void find_responses(const IslandStep& step, const MidpointMotion& motion);
  bool is_met(const IslandStep& step, std::size_t first, std::size_t count, std::span<const double> impulses,
              const MidpointMotion& motion);
  void stiffen(const IslandStep& step, const MidpointMotion& motion);
  void add_flexibility(const IslandStep& step, std::span<const Index> rows, Eigen::Ref<Matrix> to);
  const MidpointRow& at(Index row) const { return rows_[static_cast<std::size_t>(row)]; }
  double gap_of(Index row, const Vector& x) const;
  static double bent(const MidpointMotion& motion, const MidpointRow& row, const Vector& load);

  std::vector<MidpointRow> rows_, now_;  // where the derivatives are of, and where the bodies are
  Vector residual_, modal_residual_, off_;
  double worst_contact_ = 0.0;    // what is left of their law, by tolerance
  Vector stiffness_;              // γ
  std::vector<double> response_;  // by row
  Matrix K_;
  RowMatrix moved_, made_, through_;
  std::vector<Index> place_;  // by row: among those that reduce() is for
  Vector stopped_, gap_change_;
  UnsymmetricFactor factor_;
};

}  // namespace limber::internal
