// A of w = A f + b behind the proximal solver: all of it, or in blocks by body.
#pragma once

#include <cstddef>
#include <span>

#include "limber/core/types.h"

namespace limber {

/// How the projection of a cone (three rows) or of an interval (one) changes with its argument.
struct ProjectionDerivative {
  std::size_t first = 0, rows = 0;
  /// P' = Σ s sᵀ over these columns, orthogonal to each other: none where nothing acts, three where a contact sticks.
  std::size_t columns = 0;
  Vec3 s[3] = {Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  /// C = 1 + e_n shiftᵀ: how De Saxcé's correction follows the velocity. Read by map_step() alone.
  Vec3 shift = Vec3::Zero();
};

class RowCoupling {
 public:
  virtual ~RowCoupling() = default;

  virtual std::size_t rows() const = 0;
  /// Rows [first, first + count), columns likewise, of A as it was given; count ≤ 3.
  virtual Mat3 own_block(std::size_t first, std::size_t count) const = 0;
  /// A ← S⁻¹ A S⁻¹ from A as it was given.
  virtual void scale(std::span<const double> s) = 0;
  /// out = A x. Both padded.
  virtual void multiply(double* out, const double* x) = 0;

  /// dy with (1 + ρ P' A) dy = −d. @return false: not found
  virtual bool convex_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) = 0;
  /// dy with (1 − P' + P'/ρ + P' C A) dy = −d. @return false: not found
  virtual bool map_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) = 0;

  /// Makes solve_shifted() ready, for A as it is scaled. @return false: not found
  virtual bool factor_shifted(double shift) = 0;
  /// x ← (A + shift)⁻¹ x. Padded.
  virtual void solve_shifted(double* x) = 0;

  // Sweeps: A f is kept up to date.
  virtual void begin_sweeps(const double* f) = 0;
  /// A f of rows [first, first + count)
  virtual Vec3 answer(std::size_t first, std::size_t count) const = 0;
  virtual void move(std::size_t first, std::size_t count, const Vec3& change) = 0;
};

}  // namespace limber
