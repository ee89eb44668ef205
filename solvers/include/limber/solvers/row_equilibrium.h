// Impulses f of rows in sets, where gaps follow them linearly and the matrix need not be symmetric:
//
//   u = b + W f,      F_c = P_K(F_c − (u_c + shift_c)/ρ_c) for each unit c
//
// K is the cone of a contact, a ball or an interval (contact_potential.h), shift = μ |u_t| n De Saxcé's, ρ what an
// impulse moves its own unit by. Rounds of the convex problem with the symmetric part of W (convex_contact_solver.h, in
// the least number of unknowns that makes it), each linear about the gaps by all of W under the impulses at hand, from
// which springs yield: the method of multipliers.
#pragma once

#include <span>
#include <vector>

#include "limber/solvers/convex_contact_solver.h"
#include "limber/solvers/pivoted_cholesky.h"

namespace limber::internal {

class RowEquilibrium {
 public:
  void clear() { units_.clear(), size_ = 0; }
  /// The next rows. @param set with ρ as its compliance, > 0: the answer does not depend on it. @param tolerance of
  /// the gap, > 0
  void add_unit(std::size_t rows, const ContactPotential& set, double tolerance);
  std::size_t size() const { return size_; }
  /// @param W size() × size(), row-major
  void factor(std::span<const double> W);
  /// @param b gaps without impulses. @param f a guess; what was found on return. @return what it leaves of the law, by
  /// tolerance
  double solve(std::span<const double> b, std::span<double> f);

 private:
  struct Unit {
    std::size_t first = 0, rows = 1;
    ContactPotential set{};
    double tolerance = 1.0, scale = 1.0;  // 1/√ρ: of impulses and gaps
  };
  void to_scale(std::span<const double> W);
  void find_gaps();
  double take_starts();
  int improve(int most);

  std::vector<Unit> units_;
  std::size_t size_ = 0;
  std::vector<double> W_, b_, f_, gap_;  // all to scale
  MatrixBuffer symmetric_;
  PivotedCholesky cholesky_;
  ConvexContactSolver convex_;
};

}  // namespace limber::internal
