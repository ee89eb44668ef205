// What the rows of an island yield beyond the bodies' kept modes, as factors by body: G_b/Δt = L_b L_bᵀ, so that a body
// has the columns of L_b as further degrees of freedom, of unit weight (convex_contact_solver.h).
#pragma once

#include <array>
#include <span>
#include <vector>

#include "limber/constraints/constraint_rows.h"
#include "limber/solvers/pivoted_cholesky.h"

namespace limber {

class ResidualFactor {
 public:
  /// Memory grows to the largest island seen. Of the rows' flexibility, that of bodies alone is read.
  void set(const IslandBodies& bodies, const ConstraintRows& rows, double step);
  /// Columns of a body's factor.
  std::size_t rank(Index local) const { return bodies_[static_cast<std::size_t>(local)].rank; }
  /// A row's numbers in them; none where the body does not yield to the row.
  std::span<const double> row(Index local, std::size_t at) const;

 private:
  struct Body {
    std::vector<std::size_t> rows;  // of the island
    std::vector<double> values;     // row by row, `rank` each
    std::size_t rank = 0;
  };
  /// A row's number among those of a body.
  struct Own {
    Index local = -1;
    std::size_t number = 0;
  };
  std::size_t number_in(Index local, std::size_t at);
  void factor(Body& body, std::span<const ConstraintRows::Flexibility> pairs);

  std::vector<Body> bodies_;
  std::vector<std::array<Own, 2>> own_;                          // by row, which has two sides
  std::vector<std::vector<ConstraintRows::Flexibility>> pairs_;  // by body, rows by number
  internal::MatrixBuffer matrix_;
  internal::PivotedCholesky cholesky_;
};

}  // namespace limber
