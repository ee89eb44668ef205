// Contacts in friction cones beside rows with an interval each, in islands of many rows, by operator splitting.
//
// The problem is that of proximal_solver.h: f in C, û(f) in the normal cone of −C at f. It is split into what couples
// rows, f ↦ A f + b + s, and what binds each of them alone, C (Douglas and Rachford, Trans. AMS 82 (1956) 421):
//
//   z = P_C(x),   y = ρ (x − z),   f = (A + ρ)⁻¹ (ρ z − y − b − s),   x ← x + α (f − z).                          (1)
//
// −y comes to be û, so that De Saxcé's shift s = μ|y_t| follows in every iteration (Carpentier, Le Lidec and Montaut,
// "From Compliant to Rigid Contact Simulation", RSS 2024). A + ρ is factored once, in the bodies' degrees of freedom;
// an iteration costs a substitution there and back. It converges linearly, from everywhere in practice, without the
// steps in wrong directions that Newton's method takes where hundreds of contacts slide and stick; b may change on the
// way, as gaps are measured anew.
#pragma once

#include <span>
#include <vector>

#include "aligned_buffer.h"
#include "proximal_solver.h"
#include "row_coupling.h"

namespace limber {

class ConeSplitting {
 public:
  /// Begins a problem. Memory grows to the largest seen.
  /// @param rows its cones, friction, radius, lower and upper, which stay where they are; A and b are not read
  void begin(const BoundedRows& rows, RowCoupling& coupling);
  /// Units for residual(): the largest |b| of all, each by √A_ii of its row.
  void units_of(std::span<const double> b, std::vector<double>& unit) const;
  /// How far forces are from the solution: the largest |a f − P_C(a f − û)| of a cone or row, a the mean of its A_ii,
  /// so that a force counts by what it moves its own row. @param w A f + b. @param unit by row, of w: what counts as 1
  /// @return infinite where numbers are not
  double residual(std::span<const double> f, std::span<const double> w, std::span<const double> unit) const;
  /// So many times (1). @param b the rows' constants as they are now. @param f impulses, in the first call a guess;
  /// within bounds and cones on return. @return false: A + ρ could not be factored, f is as it was
  bool advance(std::span<const double> b, int iterations, std::span<double> f);

 private:
  void scale_rows();
  double clamped(std::size_t row, double force) const;
  void project(const double* from, double* to) const;
  void start(std::span<const double> f);
  void iterate();

  BoundedRows rows_{};
  RowCoupling* coupling_ = nullptr;
  std::size_t cones_ = 0, n_ = 0;
  bool factored_ = false;
  // Scaled to A_ii = 1 as in proximal_solver.cpp: forces by `scale_`, velocities by its inverse.
  std::vector<double> scale_;
  std::vector<ForceSet> sets_;
  AlignedBuffer memory_;
  double *b_ = nullptr, *x_ = nullptr, *z_ = nullptr, *f_ = nullptr;
};

}  // namespace limber
