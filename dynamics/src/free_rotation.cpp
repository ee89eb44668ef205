#include "limber/dynamics/free_rotation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "limber/core/error.h"

namespace limber {
namespace {

using std::numbers::pi;

// Below this m the nome is under 1e-21 and every series is its first term.
constexpr double kNegligibleParameter = 1e-20;
// Keeps 1/K and q' = exp(−πK/K') in range on the separatrix itself: shifts a momentum by less than 1e-120 of its size.
constexpr double kSmallestComplement = 1e-240;

double square(double x) { return x * x; }

/// 0/0 = 0: what a vanishing coefficient multiplies does not matter.
double ratio(double a, double b) { return a == 0.0 ? 0.0 : a / b; }

/// Complete elliptic integral of the first kind from the complementary parameter 1 − m > 0, by the arithmetic-geometric
/// mean.
double complete_integral(double complement) {
  double a = 1.0, b = std::sqrt(complement);
  while (std::abs(a - b) > 1e-8 * a) {
    const double mean = 0.5 * (a + b);
    b = std::sqrt(a * b);
    a = mean;
  }
  return pi / (a + b);  // one more mean: the error is squared
}

/// Carlson's R_F(x, y, 1) by duplication; x, y ≥ 0, not both 0. [DLMF 19.36.1]
double carlson_rf(double x, double y) {
  double z = 1.0, mean, dx, dy, dz;
  const auto measure = [&] {
    mean = (x + y + z) / 3.0;
    dx = 1.0 - x / mean, dy = 1.0 - y / mean, dz = -dx - dy;
    return std::max({std::abs(dx), std::abs(dy), std::abs(dz)});
  };
  while (measure() > 2e-3) {  // false for NaN, which then goes through
    const double shift = std::sqrt(x * y) + std::sqrt(x * z) + std::sqrt(y * z);
    x = 0.25 * (x + shift), y = 0.25 * (y + shift), z = 0.25 * (z + shift);
  }
  const double e2 = dx * dy - dz * dz, e3 = dx * dy * dz;
  const double series = 1.0 - e2 / 10 + e3 / 14 + e2 * e2 / 24 - 3 * e2 * e3 / 44 - 5 * e2 * e2 * e2 / 208 +
                        3 * e3 * e3 / 104 + e2 * e2 * e3 / 16;
  return series / std::sqrt(mean);
}

/// The amplitude integral u of given s = sn u ≥ 0 and c² = cn² u on the quarter period, for parameter m and 1 − m.
double inverse_sn(double s, double c2, double m, double complement) {
  return s == 0.0 ? 0.0 : s * carlson_rf(c2, complement + m * c2);
}

/// |v| of any finite v. Eigen's stableNorm() sums in an order that depends on where v lies in memory.
double safe_norm(const Vec3& v) {
  const double largest = v.cwiseAbs().maxCoeff();
  return largest == 0.0 ? 0.0 : largest * (v / largest).norm();
}

/// The shortest turn that takes the unit vector l (l₃ > −1) to e₃, times √(2 + 2 l₃).
Quaternion turn_to_z(double l1, double l2, double l3) { return {1.0 + l3, l2, -l1, 0.0}; }

}  // namespace

PrincipalInertia principal_inertia(const Mat3& inertia) {
  if (!inertia.allFinite()) throw InvalidArgument("principal_inertia: the inertia tensor is not finite");
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(inertia);
  const Vec3& moments = solver.eigenvalues();
  if (!(moments[0] > 0.0))
    throw InvalidArgument("principal_inertia: smallest principal moment is " + std::to_string(moments[0]) +
                          " kg m^2, expected > 0");
  Mat3 axes = solver.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) = -axes.col(0);
  return {moments, quaternion_from_matrix(axes)};
}

/// Everything is in units of |L|: l = L/|L|, rates are per |L|.
struct FreeRotation::Orbit {
  double l1, l2, l3;     // amplitudes of cn, sn, dn
  double m, complement;  // parameter and 1 − m
  double K, K_prime;     // quarter periods
  double u0;             // phase at t = 0
  double y;              // sn⁻¹ of complementary parameter: where the theta function of the attitude has its zero
  double p;              // u' = p
  double psi_rate;       // Ψ' where u = 0
};

FreeRotation::FreeRotation(const PrincipalInertia& body, const Quaternion& q_WB, const Vec3& momentum_W) {
  const double L = safe_norm(momentum_W);
  q_WF_ = q_WB;
  if (L == 0.0) return;

  // Sort the axes: L circles the largest or the smallest moment, told apart by the sign of L² − 2TB.
  const double A = body.moments[0], B = body.moments[1], C = body.moments[2];
  const Vec3 l_P = (q_WB * body.q_BP).conjugate() * (momentum_W / L);
  const double ab = (B - A) / (A * B), bc = (C - B) / (B * C), ac = (C - A) / (A * C);
  const bool circles_largest = square(l_P.z()) * bc > square(l_P.x()) * ab;
  constexpr double kHalf = std::numbers::sqrt2 / 2;
  Quaternion q_PQ = circles_largest ? Quaternion{} : Quaternion{kHalf, 0.0, -kHalf, 0.0};
  Vec3 l = circles_largest ? l_P : Vec3(l_P.z(), l_P.y(), -l_P.x());
  if (l.z() < 0.0) {  // a half turn about the first axis puts L on the positive side
    q_PQ = q_PQ * Quaternion{0.0, 1.0, 0.0, 0.0};
    l = Vec3(l.x(), -l.y(), -l.z());
  }
  q_QB_ = (body.q_BP * q_PQ).conjugate();
  l.normalize();

  // a1, a2: |1/I1 − 1/I3|, |1/I2 − 1/I3|; a12 their difference, free of cancellation.
  const double I3 = circles_largest ? C : A;
  const double sign = circles_largest ? 1.0 : -1.0;
  const double a1 = ac, a2 = circles_largest ? bc : ab, a12 = circles_largest ? ab : bc;
  const double l1_squared = square(l.x()), l2_squared = square(l.y()), l3_squared = square(l.z());
  const double N = a1 * l1_squared + a2 * l2_squared;
  constexpr double kVanishing = 1e-240;  // squares below this are steady turns about a principal axis
  if (N <= kVanishing * a1 || l1_squared + l3_squared <= kVanishing) {
    const bool intermediate = N > kVanishing * a1;
    set_up_steady(l, L / (intermediate ? B : I3));
  } else {
    Orbit o{};
    o.l1 = std::sqrt(N / a1);
    o.l2 = std::sqrt(ratio(N, a2));
    o.l3 = std::sqrt(l3_squared + l2_squared * (a12 / a1));
    const double gap = ratio(l1_squared * a12, a2);
    o.m = a12 == 0.0 ? 0.0 : std::min(1.0, (l2_squared * (a12 / a1) + gap) / square(o.l3));
    o.complement = a12 == 0.0 ? 1.0 : std::clamp((l3_squared - gap) / square(o.l3), kSmallestComplement, 1.0);
    o.p = sign * L * o.l3 * std::sqrt(a1 * a2);
    o.psi_rate = L * (1.0 / I3 + sign * N / (1.0 + o.l3));
    parameter_ = o.m;

    if (o.m < kNegligibleParameter) o.m = 0.0, o.complement = 1.0;
    o.K = complete_integral(o.complement);
    const double s = l.y() / o.l2, c = l.x() / o.l1, r2 = s * s + c * c;
    const double quarter = inverse_sn(std::abs(s) / std::sqrt(r2), c * c / r2, o.m, o.complement);
    o.u0 = std::copysign(c >= 0.0 ? quarter : 2.0 * o.K - quarter, s);
    if (o.m > 0.0) {
      o.K_prime = complete_integral(o.m);
      const double x = square(o.l1 / o.l3);  // dc(y | 1 − m) = 1/l₃
      o.y = inverse_sn(std::sqrt(x / (x + o.m)), o.m / (x + o.m), o.complement, o.m);
    }
    complementary_ = o.m > 0.5;
    if (complementary_)
      set_up_series_in_complementary_nome(o);
    else
      set_up_series_in_nome(o);
  }

  // F makes the formula for the attitude hold at t = 0.
  const Phase start = phase(0.0);
  const Quaternion turn = Quaternion{start.real, 0.0, 0.0, start.imaginary} * turn_to_z(start.l1, start.l2, start.l3);
  q_WF_ = normalized(q_WB * q_QB_.conjugate() * turn.conjugate());
}

void FreeRotation::set_up_steady(const Vec3& l, double rate) {
  theta_.l1 = theta_.l2 = std::hypot(l.x(), l.y());
  theta_.l3 = l.z();
  angle_ = std::atan2(l.y(), l.x());
  spin_ = 0.5 * rate;
}

void FreeRotation::set_up_series_in_nome(const Orbit& o) {
  const double log_nome = o.m > 0.0 ? -pi * o.K_prime / o.K : 0.0;
  const double q = theta_.nome = o.m > 0.0 ? std::exp(log_nome) : 0.0;
  const double to_angle = pi / (2.0 * o.K);
  angle_ = to_angle * o.u0;
  rate_ = to_angle * o.p;
  // The theta functions at v = 0, θ₂ less its factor 2q^¼, which cancels in every quotient.
  const double q4 = square(square(q));
  const double theta2 = 1.0 + q * q * (1.0 + q4), theta3 = 1.0 + 2.0 * q * (1.0 + q * q * q + q4 * q4),
               theta4 = 1.0 - 2.0 * q * (1.0 - q * q * q + q4 * q4);
  theta_.l1 = o.l1 * theta4 / theta2;
  theta_.l2 = o.l2 * theta3 / theta2;
  theta_.l3 = o.l3 * theta4 / theta3;
  // θ₄(v + iκ | q²) = 1 + Σ_n cosine_n cos 2nv + i sine_n sin 2nv, n from 1.
  double value = 1.0, slope = 0.0;
  const double kappa = to_angle * o.y;
  for (int n = 1; n <= 3 && o.m > 0.0; ++n) {
    const double parity = n % 2 == 0 ? 1.0 : -1.0;
    const double growing = std::exp(2.0 * n * n * log_nome + 2.0 * n * kappa);
    const double falling = std::exp(2.0 * n * n * log_nome - 2.0 * n * kappa);
    const auto i = static_cast<std::size_t>(n);
    theta_.cosine[i] = parity * (growing + falling);
    theta_.sine[i] = -parity * (growing - falling);
    value += theta_.cosine[i];
    slope += 2.0 * n * theta_.sine[i];
  }
  spin_ = 0.5 * o.psi_rate + rate_ * slope / value;
}

void FreeRotation::set_up_series_in_complementary_nome(const Orbit& o) {
  theta_.log_nome = -pi * o.K / o.K_prime;
  theta_.nome = std::exp(theta_.log_nome);
  angle_ = o.u0 / (2.0 * o.K);
  rate_ = o.p / (2.0 * o.K);
  const double q = theta_.nome, q4 = square(square(q));
  const double theta2 = 2.0 * (1.0 + q * q * (1.0 + q4)), theta3 = 1.0 + 2.0 * q * (1.0 + q * q * q + q4 * q4),
               theta4 = 1.0 - 2.0 * q * (1.0 - q * q * q + q4 * q4);
  theta_.l1 = o.l1 * theta2 / theta4;
  theta_.l2 = o.l2 * theta3 / theta4;
  theta_.l3 = o.l3 * theta2 / theta3;
  // θ₄(v + iκ | q²) ∝ e^{−i tilt·(u/2K)} Σ_n √q'^{(n+½)²} cos((2n+1)(iw − μ)), w = πu/4K'.
  const double mu = pi * o.y / (4.0 * o.K_prime);
  theta_.tilt = pi * o.y / (2.0 * o.K_prime);
  const double root = std::sqrt(q);
  double value = 0.0, slope = 0.0, power = 1.0;  // power: √q'^{n(n+1)}
  for (std::size_t n = 0; n < kTerms; ++n) {
    const double odd = 2.0 * static_cast<double>(n) + 1.0;
    theta_.cosine[n] = std::cos(odd * mu);
    theta_.sine[n] = std::sin(odd * mu);
    value += power * theta_.cosine[n];
    slope += power * odd * theta_.sine[n];
    power *= std::pow(root, odd + 1.0);
  }
  const double per_u = pi / (4.0 * o.K_prime) * slope / value - theta_.tilt / (2.0 * o.K);
  spin_ = 0.5 * o.psi_rate + o.p * per_u;
}

FreeRotation::Phase FreeRotation::phase(double t) const {
  return complementary_ ? phase_in_complementary_nome(t) : phase_in_nome(t);
}

FreeRotation::Phase FreeRotation::phase_in_nome(double t) const {
  const double v = angle_ + rate_ * t;
  const double c1 = std::cos(v), s1 = std::sin(v);
  // Multiples of v by angle addition.
  const double c2 = c1 * c1 - s1 * s1, s2 = 2.0 * s1 * c1;
  const double c3 = c2 * c1 - s2 * s1, s3 = s2 * c1 + c2 * s1;
  const double c4 = c2 * c2 - s2 * s2, s4 = 2.0 * s2 * c2;
  const double c5 = c3 * c2 - s3 * s2, s5 = s3 * c2 + c3 * s2;
  const double c6 = c3 * c3 - s3 * s3, s6 = 2.0 * s3 * c3;
  const double q = theta_.nome, q2 = q * q, q4 = q2 * q2, q6 = q4 * q2, q9 = q4 * q4 * q;
  const double theta1 = s1 - q2 * s3 + q6 * s5;
  const double theta2 = c1 + q2 * c3 + q6 * c5;
  const double even = 1.0 + 2.0 * q4 * c4, odd = 2.0 * (q * c2 + q9 * c6);
  const double theta3 = even + odd, inverse_theta4 = 1.0 / (even - odd);
  const double re = 1.0 + theta_.cosine[1] * c2 + theta_.cosine[2] * c4 + theta_.cosine[3] * c6;
  const double im = theta_.sine[1] * s2 + theta_.sine[2] * s4 + theta_.sine[3] * s6;
  const double c = std::cos(spin_ * t), s = std::sin(spin_ * t);
  return {theta_.l1 * theta2 * inverse_theta4, theta_.l2 * theta1 * inverse_theta4, theta_.l3 * theta3 * inverse_theta4,
          c * re + s * im, s * re - c * im};
}

FreeRotation::Phase FreeRotation::phase_in_complementary_nome(double t) const {
  const double periods = angle_ + rate_ * t;  // u/2K: half the period of sn, the whole of θ₄
  const double whole = std::nearbyint(periods);
  const double r = periods - whole;  // in [−½, ½]
  const double parity = std::fmod(whole, 2.0) == 0.0 ? 1.0 : -1.0;
  const double sign = r < 0.0 ? -1.0 : 1.0;
  // e = e^{−2|w|} and g = √q' e^{2|w|} are both in [√q', 1]: no exponential grows.
  const double root = std::sqrt(theta_.nome);
  const double e = std::exp(theta_.log_nome * std::abs(r));
  const double g = root / e;
  const double E = e * e, G = g * g;  // e^{−2w'}, q' e^{2w'}
  const double q = theta_.nome, q2 = q * q, q4 = q2 * q2, q6 = q4 * q2, q9 = q4 * q4 * q;
  // θ₁', θ₂' less e^{w'} q'^¼ and θ₃', θ₄' of imaginary argument iw'.
  const double theta1 = (1.0 - q * G + q4 * G * G - q9 * G * G * G) - E * (1.0 - q2 * E + q6 * E * E);
  const double theta2 = (1.0 + q * G + q4 * G * G + q9 * G * G * G) + E * (1.0 + q2 * E + q6 * E * E);
  const double odd = G + q * E + q6 * G * G * G + q9 * E * E * E, even = 1.0 + q2 * G * G + q4 * E * E;
  const double inverse = 1.0 / theta2;
  // The complex theta function in √q'.
  double re = 0.0, im = 0.0, rising = 1.0, falling = e, power = 1.0;
  for (std::size_t n = 0; n < kTerms; ++n) {
    re += (rising + falling) * theta_.cosine[n];
    im += (rising - falling) * theta_.sine[n];
    // rising: √q'^{n²} gⁿ, falling: √q'^{n(n+1)} e^{n+1}
    rising *= power * root * g;
    falling *= power * q * e;
    power *= q;
  }
  im *= sign;
  const double angle = spin_ * t + theta_.tilt * r;
  const double c = std::cos(angle), s = std::sin(angle);
  return {parity * theta_.l1 * e * (even - odd) * inverse, parity * sign * theta_.l2 * theta1 * inverse,
          theta_.l3 * e * (even + odd) * inverse, c * re + s * im, s * re - c * im};
}

Quaternion FreeRotation::attitude(double t) const {
  const Phase f = phase(t);
  const Quaternion turn = Quaternion{f.real, 0.0, 0.0, f.imaginary} * turn_to_z(f.l1, f.l2, f.l3);
  return normalized(q_WF_ * turn * q_QB_);
}

}  // namespace limber
