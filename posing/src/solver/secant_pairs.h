// Second derivative by the steps since a matrix was made.
#pragma once

#include <vector>

#include "solver/elastic_system.h"

namespace limber::internal {

/// Limited-memory BFGS over an inverse H⁻¹ that is kept (Byrd, Nocedal and Schnabel, "Representations of quasi-Newton
/// matrices and their use in limited memory methods", Mathematical Programming 63, 1994, theorem 2.2): with steps S,
/// changes Y of the gradient along them and Z = H⁻¹Y,
///   B⁻¹ = H⁻¹ + (S Z) ( R⁻ᵀ(D + YᵀZ)R⁻¹  −R⁻ᵀ ; −R⁻¹  0 ) (S Z)ᵀ,  R the upper triangle of SᵀY, D its diagonal
/// B is positive definite, and what H gets wrong along the last steps B gets right.
class SecantPairs {
 public:
  void clear();
  /// @param s, y, z a step, the gradient's change along it, and H⁻¹y. If y does not push back, it is no pair of a
  /// convex energy and left out.
  void add(const VectorX& s, const VectorX& y, const VectorX& z);
  /// @param u in: −H⁻¹ r; out: −B⁻¹ r
  void correct(const VectorX& r, VectorX& u) const;

 private:
  struct Pair {
    VectorX s{}, y{}, z{};
  };
  std::vector<Pair> pairs_{};  // the oldest first
  MatrixX sy_{}, yz_{};        // products of pairs
};

}  // namespace limber::internal
