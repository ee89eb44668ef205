/// @file limber/dynamics/free_rotation.h
/// The torque-free rotation of a rigid body in closed form: its attitude at any time, without stepping.
///
///   L̇_W = 0,   R_WB' = R_WB [I⁻¹ R_WBᵀ L_W]ₓ                        (1)
///
/// In principal axes the angular momentum is a triple of Jacobi elliptic functions,
///   l = (l₁ cn u, l₂ sn u, l₃ dn u),   u = p t + u₀,
/// and the attitude follows from it by the shortest turn that takes l to the fixed direction of L and by one angle Ψ
/// about that direction, which is a linear function of time less twice the argument of one theta function:
///   Ψ(t) = σ t − 2 arg θ₄(πu/2K + iκ | q²).
/// All of it is evaluated by theta series in q or, past m = ½, in the complementary nome: four terms at most, no loss
/// near the separatrix, no special case for symmetric bodies (q = 0 leaves the sines). Derivation:
/// docs/derivations/rigid-frame.md. That the angle about L is a theta function is due to Jacobi (1850); see R. van Zon
/// and J. Schofield, J. Comput. Phys. 225 (2007) 145, for another modern form.
///
/// Accuracy: the attitude is that of a body whose momentum and moments differ by a few ε from those given. Its error is
/// a few ε at first and then at most 4ε (|L|/I_min) t/√(1−m): near the separatrix (rotation about the intermediate
/// axis) the equations themselves amplify round-off. Momentum and energy do not drift.
#pragma once

#include <array>
#include <tuple>

#include "limber/core/quaternion.h"
#include "limber/core/types.h"

namespace limber {

/// Principal moments and axes of an inertia tensor.
struct PrincipalInertia {
  Vec3 moments = Vec3::Ones();  ///< ascending, kg·m²; > 0
  Quaternion q_BP;              ///< R_BP: columns are the principal axes in the body frame, right-handed
};

/// @param inertia symmetric positive definite, kg·m². @throws InvalidArgument if it is not, or not finite.
PrincipalInertia principal_inertia(const Mat3& inertia);

/// The motion (1) from one attitude and angular momentum on. Plain data of fixed size: copying is cheap, nothing
/// allocates.
class FreeRotation {
 public:
  /// At rest, identity.
  FreeRotation() = default;

  /// @param q_WB attitude at t = 0, a unit quaternion.
  /// @param momentum_W angular momentum, world axes, kg·m²/s; zero: at rest. Any finite size.
  FreeRotation(const PrincipalInertia& body, const Quaternion& q_WB, const Vec3& momentum_W);

  /// R_WB at time t (s, finite, negative for the past), up to its sign. Does not allocate or throw.
  Quaternion attitude(double t) const;

  /// Elliptic parameter m in [0, 1]: 0 for a symmetric body or a steady turn, 1 on the separatrix.
  double parameter() const { return parameter_; }

 private:
  friend struct StateFields;
  template <class Self>
  static auto state_fields(Self& s) {
    auto& t = s.theta_;
    return std::tie(s.q_WF_, s.q_QB_, s.parameter_, s.complementary_, s.spin_, s.angle_, s.rate_, t.l1, t.l2, t.l3,
                    t.nome, t.log_nome, t.tilt, t.cosine, t.sine);
  }

  static constexpr int kTerms = 5;
  struct Orbit;  // the elliptic parameters of one motion, needed only while the series are made

  void set_up_steady(const Vec3& l, double rate);
  void set_up_series_in_nome(const Orbit& orbit);
  void set_up_series_in_complementary_nome(const Orbit& orbit);

  /// The theta functions of the motion.
  struct ThetaSeries {
    double l1 = 0.0, l2 = 0.0, l3 = 1.0;          // factors of the quotients
    double nome = 0.0;                            // q, or q'
    double log_nome = 0.0;                        // complementary: ln q'
    double tilt = 0.0;                            // complementary: phase per period of the Gaussian factor, rad
    std::array<double, kTerms> cosine{}, sine{};  // coefficients of the complex one
  };

  /// Direction of L in the sorted principal frame Q, and e^{iΨ/2} up to a positive factor.
  struct Phase {
    double l1, l2, l3;
    double real, imaginary;
  };
  Phase phase(double t) const;
  Phase phase_in_nome(double t) const;
  Phase phase_in_complementary_nome(double t) const;

  Quaternion q_WF_;             // frame F: z along L, turned so that Ψ fits the attitude at t = 0
  Quaternion q_QB_;             // sorted principal frame Q: the axis that L circles is +z
  double parameter_ = 0.0;      // m
  bool complementary_ = false;  // series in q' = exp(−πK/K'), used for m > ½
  double spin_ = 0.0;           // σ/2, rad/s
  double angle_ = 0.0;          // argument of the series at t = 0: v = πu/2K, or u/2K
  double rate_ = 0.0;           // its rate, 1/s
  ThetaSeries theta_;
};

}  // namespace limber
