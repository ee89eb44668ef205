#include "coulomb_contact.h"

#include <algorithm>
#include <cmath>

namespace limber {
namespace {

using Vec2 = Eigen::Vector2d;
using Mat2 = Eigen::Matrix2d;

// The eigenvectors of a symmetric 2 × 2 matrix: (S + α)⁻¹ for every α at the price of one.
struct Eigen2 {
  Vec2 value;
  Mat2 vectors;  // columns

  explicit Eigen2(const Mat2& S) {
    const double mean = 0.5 * (S(0, 0) + S(1, 1)), half = 0.5 * (S(0, 0) - S(1, 1)), off = S(0, 1);
    const double radius = std::sqrt(half * half + off * off);
    value = {mean - radius, mean + radius};
    const Vec2 large = half >= 0.0 ? Vec2(half + radius, off) : Vec2(off, radius - half);  // no cancellation
    const double size = large.norm();
    const Vec2 second = size > 0.0 ? Vec2(large / size) : Vec2(0.0, 1.0);
    vectors.col(0) = Vec2(-second[1], second[0]);
    vectors.col(1) = second;
  }
};

// Sliding: f_t(α) = −(S + α)⁻¹c opposes the velocity α f_t, and the normal force n(α) = n₀ + k·f_t follows it. The α ≥
// 0 sought has μ n = |f_t|. μ n/|f_t| is nearly linear in α (as in trust-region methods), so Newton's steps on it are
// few; a bracket keeps them safe.
class Sliding {
 public:
  Sliding(const Mat2& S, const Vec2& c, double n0, const Vec2& k, double mu)
      : eigen_(S), c_(eigen_.vectors.transpose() * c), k_(eigen_.vectors.transpose() * k), n0_(n0), mu_(mu) {}

  Vec2 solve() {
    constexpr int kMaxSteps = 100;
    double low = 0.0, high = std::max(eigen_.value[1], 1e-300), alpha = 0.0;
    while (excess(high) < 0.0 && high < 1e300) low = high, high *= 8.0;
    alpha = low;
    for (int step = 0; step < kMaxSteps; ++step) {
      const double value = excess(alpha);
      (value < 0.0 ? low : high) = alpha;
      const double newton = alpha - value / slope_;
      const double next = newton > low && newton < high ? newton : 0.5 * (low + high);
      if (std::abs(next - alpha) <= 1e-15 * std::abs(alpha) || value == 0.0) break;
      alpha = next;
    }
    return eigen_.vectors * force(alpha);
  }

 private:
  Vec2 force(double alpha) const {
    return {-c_[0] / (std::max(eigen_.value[0], 0.0) + alpha), -c_[1] / (std::max(eigen_.value[1], 0.0) + alpha)};
  }
  // μ n/|f_t| − 1, and its slope.
  double excess(double alpha) {
    const double s0 = std::max(eigen_.value[0], 0.0) + alpha, s1 = std::max(eigen_.value[1], 0.0) + alpha;
    if (s0 <= 0.0) {
      slope_ = 0.0;
      return -1.0;
    }
    const Vec2 f(-c_[0] / s0, -c_[1] / s1), df(-f[0] / s0, -f[1] / s1);
    const double n = n0_ + k_.dot(f), dn = k_.dot(df), size = f.norm();
    slope_ = mu_ * (dn - n * f.dot(df) / (size * size)) / size;
    return mu_ * n / size - 1.0;
  }

  Eigen2 eigen_;
  Vec2 c_, k_;
  double n0_, mu_, slope_ = 0.0;
};

}  // namespace

Vec3 solve_coulomb_contact(const Mat3& A, const Vec3& b, double mu) {
  if (b[0] >= 0.0) return Vec3::Zero();
  const double n_alone = -b[0] / A(0, 0);
  if (mu == 0.0) return {n_alone, 0.0, 0.0};
  // The normal force eliminated: u_n = 0 makes it n = n_alone + k·f_t, and leaves S f_t + c for the tangents.
  const Vec2 k = -A.block<1, 2>(0, 1).transpose() / A(0, 0);
  const Mat2 S = A.bottomRightCorner<2, 2>() + A.bottomLeftCorner<2, 1>() * k.transpose();
  const Vec2 c = b.tail<2>() + A.bottomLeftCorner<2, 1>() * n_alone;
  const double det = S(0, 0) * S(1, 1) - S(0, 1) * S(1, 0);
  if (det > 0.0) {
    const Vec2 t = Vec2(S(0, 1) * c[1] - S(1, 1) * c[0], S(1, 0) * c[0] - S(0, 0) * c[1]) / det;
    const double n = n_alone + k.dot(t);
    if (t.norm() <= mu * n) return {n, t[0], t[1]};
  }
  if (c.norm() == 0.0) return {n_alone, 0.0, 0.0};
  const Vec2 t = Sliding(S, c, n_alone, k, mu).solve();
  return {t.norm() / mu, t[0], t[1]};
}

Eigen::Vector2d solve_in_disc(const Eigen::Matrix2d& A, const Eigen::Vector2d& b, double radius) {
  if (radius <= 0.0 || b.norm() == 0.0) return Vec2::Zero();
  const double det = A(0, 0) * A(1, 1) - A(0, 1) * A(1, 0);
  if (det > 0.0) {
    Vec2 t = Vec2(A(0, 1) * b[1] - A(1, 1) * b[0], A(1, 0) * b[0] - A(0, 0) * b[1]) / det;
    if (t.norm() <= radius) return t;
  }
  const Vec2 t = Sliding(A, b, radius, Vec2::Zero(), 1.0).solve();
  return t * (radius / t.norm());
}

}  // namespace limber
