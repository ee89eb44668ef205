// What the forces of three rows are bound to: Coulomb's cone of a contact, or a ball, as a moment that resists rolling.
#pragma once

#include <span>
#include <vector>

#include "coulomb_contact.h"
#include "row_coupling.h"

namespace limber {

struct ForceSet {
  double mu = 0.0;      ///< ≥ 0: {|x_t| ≤ μ x_n}, vectors (normal, tangent, tangent)
  double radius = 0.0;  ///< > 0: {|x| ≤ radius} in its place, with mu = 0 and no shift

  /// The point of the set nearest to x.
  Vec3 project(const Vec3& x) const;
  /// A derivative of that (at the kinks one of them), of the rows from `first` on.
  ProjectionDerivative derivative(const Vec3& x, std::size_t first) const;
  /// A force nearer to what the three rows ask for while all others are held: that of a cone exactly, in a ball a step
  /// down along the gradient. @param A of the rows, symmetric positive definite. @param velocity A force + b
  Vec3 improve(const Mat3& A, const Vec3& force, const Vec3& velocity) const;
};

/// Those of the first triples of rows, as many as `friction` has numbers, for forces that are multiplied by `scale`, a
/// number by row, the same in a triple.
/// @param radius empty: none is a ball
void make_force_sets(std::span<const double> friction, std::span<const double> radius, std::span<const double> scale,
                     std::vector<ForceSet>& sets);

}  // namespace limber
