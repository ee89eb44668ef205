/// @file limber/dynamics/inertial_coupling.h
/// How the turning of a free body and its modes feel each other: Coriolis, Euler and centrifugal forces on the
/// deformation, and the change of inertia by it.
///
/// The frame floats with its origin at the mass centre and mean axes (Tisserand): ∫ρ w_i = 0, ∫ρ r × w_i = 0. With
/// x = r + Σ z_i w_i and ω in body axes the kinetic energy is
///
///   T = ½m v² + ½ωᵀJω + ω·Bż + ½ż²      J(z) = ∫ρ (x² 1 − x xᵀ),   B_j(z) = ∫ρ x × w_j = Σ_i z_i b_ij
///
/// with b_ij = ∫ρ w_i × w_j. Its momenta are L = Jω + Bż, about the origin, and π = ż + Bᵀω, the modes' own. In these
///
///   H = ½π² + ½Σλ_i z_i² + G,     G = ½ℓᵀD⁻¹ℓ,   ℓ = L − Bπ,   D = J − BBᵀ,   ω = D⁻¹ℓ
///   L̇ = L × ω,   ż_j = π_j − B_j·ω,   π̇_i = −λ_i z_i + g_i + ω·Σ_j b_ij π_j + ½ ωᵀ(∂D/∂z_i)ω
///
/// D is a polynomial of degree two in z, so two integrals over pairs of modes are all that is needed beside the model's
/// own numbers: ∫ρ w_i w_jᵀ, from the shapes and mass-weighted shapes of the volume block.
///
/// A step splits H in three flows, each half before and half after the next:
///
/// 1. The modes and their stretching, ½π² + ½Σλ_i z_i² − F·z, F_i = ½ω₀ᵀ(∂D/∂z_i)ω₀ at z = 0, ω₀ = J(0)⁻¹L: exactly,
/// under
///    a held F, L turning about a held rate; the two are the discrete gradient of F·z, so the sum is kept.
/// 2. The turning of the rest shape, ½L·ω₀: in closed form (free_rotation.h).
/// 3. The rest, U = G − ½L·ω₀ + F·z, of second order in (z, π): the implicit midpoint rule. Products of amplitudes and
///    momenta stand in it as their means over the step while the modes go alone (mollified impulses, by pairs).
///
/// So
///
/// - momentum is kept to round-off, and energy does not drift: every flow is symmetric, and symplectic or keeps its
/// part
///   of the energy;
/// - no step resonates with modes by U: means vanish where frequencies, or their sums, fit the step;
/// - modes are exact where nothing turns, turning is exact where nothing bends, and a steady centrifugal stretch is
/// exact
///   at any step to first order in it; the plane in which a body bends that spins about an axis of symmetry stays in
///   space to a thousandth of the turn;
/// - the whole is of order two.
///
/// Sources: A. A. Shabana, *Dynamics of Multibody Systems*, chapter 5 (inertia shape integrals); T. M. Wasfy and
/// A. K. Noor, Applied Mechanics Reviews 56 (2003) 553 (floating frames); B. García-Archilla, J. M. Sanz-Serna and
/// R. D. Skeel, SIAM Journal on Scientific Computing 20 (1999) 930 (mollified impulses); Y.-W. Li and X. Wu, SIAM
/// Journal on Scientific Computing 38 (2016) A1876 (exponential integrators by discrete gradients). EXUDYN's
/// ObjectFFRFreducedOrder holds the same terms.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "limber/core/aligned_array.h"
#include "limber/core/quaternion.h"
#include "limber/core/types.h"
#include "limber/dynamics/free_rotation.h"
#include "limber/dynamics/oscillator.h"
#include "limber/model/modal_model.h"

namespace limber {

/// The integrals of one model, and their means over a step of one length; shared by its instances. Holds 27k² numbers
/// for k modes, made in some 9 n k² multiplications for n nodes.
class InertialCoupling {
 public:
  /// D and ℓ less L, with what their derivatives are made of.
  struct Terms {
    explicit Terms(Index modes);
    std::vector<double> of_amplitudes, of_momenta;  ///< products of z and π with nine matrices each
    Mat3 inertia = Mat3::Zero();                    ///< D, kg·m²
    Vec3 relative = Vec3::Zero();                   ///< −Bπ, kg·m²/s
  };

  /// @param step s, > 0. @throws InvalidArgument if the body has fixed nodes, or modes and no volume block
  InertialCoupling(const ModalModelData& body, double step);
  /// Allocates nothing.
  void set_step(double step);

  Index modes() const { return static_cast<Index>(first_.rows()); }
  double step() const { return 2.0 * half_.step(); }
  const PropagatorTable& half_step() const { return half_; }  ///< of the modes alone
  const PrincipalInertia& rest() const { return principal_; }
  const Mat3& rest_inverse() const { return rest_inverse_; }  ///< J(0)⁻¹

  /// At an instant. @param z, momenta k numbers each
  void evaluate(const double* z, const double* momenta, Terms& terms) const;
  /// Their means over a step of which z and momenta are the middle.
  void evaluate_means(const double* z, const double* momenta, Terms& terms) const;
  /// −Bᵀω, added: the rates that momenta do not show. @param terms of evaluate()
  static void add_turning(const Vec3& omega, const Terms& terms, std::span<double> rates);
  /// ∂U/∂π and −∂U/∂z, overwritten. @param L body axes @param terms of evaluate_means() at z @return ∂U/∂L
  Vec3 differentiate(const Vec3& L, const double* z, const Terms& terms, std::span<double> rates,
                     std::span<double> forces) const;
  /// Adds `weight` times F at L to k forces.
  void add_stretching(const Vec3& L, double weight, double* forces) const;
  /// −∂(F·z)/∂L, rad/s.
  Vec3 turn_of_stretch(const Vec3& L, const double* z) const { return turn_of_stretch(first_, L, z); }

 private:
  using Matrix = Eigen::MatrixXd;
  Mat3 first_order(Eigen::Index mode) const;

  Vec3 turn_of_stretch(const Matrix& first, const Vec3& L, const double* z) const;

  Mat3 rest_, rest_inverse_;
  PrincipalInertia principal_;
  std::vector<double> lambda_, decay_;
  PropagatorTable half_;
  Matrix first_;    // k × 6: ∂D/∂z at z = 0, by entry xx, yy, zz, yz, zx, xy
  Matrix turning_;  // 3k × k: transposes of b_ij by axis
  Matrix second_;   // 6k × k: D's second order, by entry
  // Means over the step: first_, and [turning_; second_] for amplitudes and momenta.
  Matrix mean_first_, mean_amplitudes_, mean_momenta_;
};

/// The motion of one body under its coupling. Momenta are its state; the caller keeps them, with amplitudes, in padded
/// rows (PropagatorTable). Nothing allocates but the constructor.
class CoupledMotion {
 public:
  /// Keeps a reference.
  explicit CoupledMotion(const InertialCoupling& coupling);

  /// Momenta from velocities. @param omega body axes, rad/s @param rates ż, k numbers
  /// @param momenta k numbers, overwritten with π @return L, body axes
  Vec3 set_velocities(const double* z, const Vec3& omega, std::span<const double> rates, double* momenta);
  /// Velocities from momenta. @param L body axes
  void set_momenta(const double* z, const Vec3& L, const double* momenta);

  const Vec3& angular_velocity() const { return angular_velocity_; }  ///< ω, body axes, rad/s
  std::span<const double> rates() const { return rates_; }            ///< ż
  double kinetic_energy() const { return kinetic_energy_; }  ///< ½ωᵀJω + ω·Bż: the turning, with its coupling, J

  /// One step. U goes in parts where the body turns by more than a tenth of a radian; one that is bent so far out of
  /// shape that a thousandth of the step does not settle either goes without U over that part, which keeps its momenta.
  /// It is begin_step() and end_step(), its last half of the modes.
  /// @param forces g, held over half a step of the modes: the start's, then the end's @param z, momenta padded rows,
  /// advanced @param q_WB attitude, advanced @param L_W angular momentum, kept
  void begin_step(const double* forces, double* z, double* momenta, Quaternion& q_WB, const Vec3& L_W);
  void end_step(const double* forces, double* z, double* momenta, Quaternion& q_WB, const Vec3& L_W) {
    stretch(forces, z, momenta, q_WB, L_W);
  }

 private:
  /// Rows of modes as PropagatorTable takes them.
  struct PaddedRows {
    AlignedArray<double> z, momenta, loads;
  };

  void stretch(const double* forces, double* z, double* momenta, Quaternion& q_WB, const Vec3& L_W);
  bool couple(double h, double* z, double* momenta, const Vec3& L, Quaternion& turn);

  const InertialCoupling& coupling_;
  Vec3 angular_velocity_ = Vec3::Zero();
  double kinetic_energy_ = 0.0;
  std::vector<double> rates_;
  InertialCoupling::Terms terms_;
  PaddedRows part_;  // the end of half a step of the modes
  // Of the implicit rule: the middle of a part, and how z and π change.
  std::vector<double> middle_z_, middle_momenta_, velocity_, force_, last_velocity_, last_force_;
};

}  // namespace limber
