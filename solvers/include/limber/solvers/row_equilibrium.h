// Impulses f of rows in sets, where gaps follow them linearly and the matrix need not be symmetric:
//
//   u = b + W f,      F_c = P_K(F_c − (u_c + shift_c)/ρ_c) for each unit c
//
// K is the cone of a contact, a ball or an interval (contact_potential.h), shift = μ |u_t| n De Saxcé's, ρ what an
// impulse moves its own unit by.
//
// A primal–dual interior-point method. Coulomb's law is written without the shift, so that nothing in it has a kink:
// each bound of a row and each ball or friction disc is one pair of x ≥ 0 and z ≥ 0 with x ∘ z = 0,
//
//   a bound      x = ±(f − bound),         z its part of ±u
//   a disc       x = (r + μ f_n, f_t),     z = (s, u_t)      in the second-order cone, s ≥ |u_t| free
//
// and all else is linear. A row without bounds has no pair: it is to be met. It yields a little to the change of its
// impulse, so that redundant rows share what they hold (the proximal point method). Newton's steps go to x ∘ z = ν with
// ν → 0, scaled by Nesterov and Todd (1997), with Mehrotra's (1992) predictor and corrector: W and a block for each
// unit are factored once a step. Where W is positive semidefinite and friction fixed the number of steps has a
// polynomial bound; 15 to 30 are usual. It ends where the digits, or EquilibriumTuning::most_steps, do.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "limber/solvers/contact_potential.h"
#include "limber/solvers/unsymmetric_factor.h"

namespace limber::internal {

/// Rows with an interval each, which may be a number, a half line or all numbers: W = G Gᵀ + diag(D).
struct IntervalRows {
  std::size_t dimension = 0;                               ///< of G's rows
  std::span<const double> G = {}, D = {};                  ///< row-major; by row, D empty: all 0
  std::span<const double> b = {}, lower = {}, upper = {};  ///< by row
};

class RowEquilibrium {
 public:
  void clear();
  /// The next rows. @param set with ρ as its compliance, > 0: the answer does not depend on it. @param tolerance of
  /// the gap, > 0
  void add_unit(std::size_t rows, const ContactPotential& set, double tolerance);
  std::size_t size() const { return size_; }
  /// @param W size() × size(), row-major
  void set_matrix(std::span<const double> W);
  /// @param b gaps without impulses. @param f a guess, returned where it meets the law; else what was found. @return
  /// what it leaves of the law, by tolerance
  double solve(std::span<const double> b, std::span<double> f);
  /// The problem of these rows in place of any before, to the digits. @param f as above
  void solve(const IntervalRows& rows, std::span<double> f);

 private:
  using Vec4 = Eigen::Vector4d;
  using Mat4 = Eigen::Matrix4d;
  struct Unit {
    std::size_t first = 0, rows = 1;
    ContactPotential set{};
    double tolerance = 1.0, scale = 1.0;  // 1/√ρ: of impulses and gaps
  };
  struct Bound {  // x = side (f − bound)
    std::size_t row = 0;
    double side = 1.0, bound = 0.0;
    double x = 0.0, z = 0.0, dx = 0.0, dz = 0.0, aim = 0.0;
  };
  struct Disc {  // of `rows` rows from `first`, after a normal row with μ > 0 or by itself
    std::size_t first = 0, rows = 2;
    double friction = 0.0, radius = 0.0;
    Vec4 x = Vec4::Zero(), z = Vec4::Zero(), dx = Vec4::Zero(), dz = Vec4::Zero(), aim = Vec4::Zero();
    Mat4 scaling = Mat4::Identity(), inverse = Mat4::Identity();  // V: V x = V⁻¹ z
  };
  struct Direction {
    double centring = 0.0;  // of ν
    bool corrected = false;
  };

  void to_scale(std::span<const double> b);
  bool is_fixed(const Unit& unit) const;
  void place_pairs();
  bool is_free(const Unit& unit) const;
  void begin_pairs();
  double product() const;
  double product_after(double step) const;
  bool factor();
  void find_direction(const Direction& to);
  Vec4 disc_change(const Disc& disc) const;
  double longest_step() const;
  void take_step(double step);
  double take_nearest();
  void find_gaps(std::span<const double> f);

  std::vector<Unit> units_;
  std::size_t size_ = 0;
  std::vector<double> W_, A_, b_, f_, near_, gap_, left_, change_;  // all to scale
  std::vector<char> fixed_;                                         // by row: its set is one impulse
  std::vector<Bound> bounds_;
  std::vector<Disc> discs_;
  double level_ = 0.0;  // ν
  UnsymmetricFactor factor_;
};

}  // namespace limber::internal
