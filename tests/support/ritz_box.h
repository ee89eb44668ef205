/// @file ritz_box.h
/// Vibration of a free parallelepiped by Ritz's method with polynomials, whose integrals over it are exact.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "limber/model/material.h"

namespace limber::testing {

/// Lowest elastic modes of the body A [−1, 1]³, from above.
class RitzBox {
 public:
  using Degree = std::array<int, 3>;

  /// @param A columns: half of the edges. @param degree of the polynomials: powers i, j, k along the edges with
  /// i/degree[0] + j/degree[1] + k/degree[2] ≤ 1
  RitzBox(const Mat3& A, const Material& material, const Degree& degree, int modes) : to_unit_(A.inverse()) {
    std::vector<Mode> found;
    // The body is its own mirror image through its centre, so polynomials of even degree do not mix with odd ones.
    for (int parity = 0; parity < 2; ++parity) add_modes(A, material, degree, parity, found);
    std::stable_sort(found.begin(), found.end(),
                     [](const Mode& a, const Mode& b) { return a.eigenvalue < b.eigenvalue; });
    modes_.assign(found.begin() + 6, found.begin() + 6 + modes);
  }

  int modes() const { return static_cast<int>(modes_.size()); }
  double eigenvalue(int mode) const { return modes_[static_cast<std::size_t>(mode)].eigenvalue; }

  /// All modes at a point, mass-normalised: 3 × modes.
  Eigen::MatrixXd shapes(const Vec3& x) const {
    Eigen::MatrixXd u = Eigen::MatrixXd::Zero(3, modes());
    const Vec3 at = to_unit_ * x;
    for (int m = 0; m < modes(); ++m) {
      const Mode& mode = modes_[static_cast<std::size_t>(m)];
      for (std::size_t f = 0; f < mode.powers.size(); ++f) {
        double value = 1.0;
        for (int axis = 0; axis < 3; ++axis)
          value *= legendre(mode.powers[f][static_cast<std::size_t>(axis)], at[axis]);
        u.col(m) += value * mode.coefficients.segment<3>(3 * static_cast<Eigen::Index>(f));
      }
    }
    return u;
  }

 private:
  using Powers = std::vector<Degree>;
  struct Mode {
    double eigenvalue = 0.0;
    Powers powers;
    Eigen::VectorXd coefficients;
  };

  static double legendre(int n, double x) {
    double before = 1.0, value = n == 0 ? 1.0 : x;
    for (int k = 1; k < n; ++k) {
      const double next = ((2 * k + 1) * x * value - k * before) / (k + 1);
      before = value;
      value = next;
    }
    return value;
  }

  // Over [−1, 1]: P_a P_b, P_a' P_b and P_a' P_b'.
  static double product(int a, int b) { return a == b ? 2.0 / (2 * a + 1) : 0.0; }
  static double slope_and_value(int a, int b) { return a > b && (a - b) % 2 == 1 ? 2.0 : 0.0; }
  static double slopes(int a, int b) {
    const int least = std::min(a, b);
    return (a + b) % 2 == 0 ? least * (least + 1) : 0.0;
  }

  /// ∫ ∂_s f_a ∂_t f_b over the cube.
  static Mat3 gradients(const std::array<int, 3>& a, const std::array<int, 3>& b) {
    Mat3 T = Mat3::Ones();
    for (int s = 0; s < 3; ++s)
      for (int t = 0; t < 3; ++t)
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const bool first = static_cast<int>(axis) == s, second = static_cast<int>(axis) == t;
          T(s, t) *= first && second ? slopes(a[axis], b[axis])
                     : first         ? slope_and_value(a[axis], b[axis])
                     : second        ? slope_and_value(b[axis], a[axis])
                                     : product(a[axis], b[axis]);
        }
    return T;
  }

  static void add_modes(const Mat3& A, const Material& m, const Degree& degree, int parity, std::vector<Mode>& found) {
    Powers powers;
    const int whole = degree[0] * degree[1] * degree[2];
    for (int i = 0; i <= degree[0]; ++i)
      for (int j = 0; j <= degree[1]; ++j)
        for (int k = 0; k <= degree[2]; ++k)
          if ((i + j + k) % 2 == parity &&
              whole / degree[0] * i + whole / degree[1] * j + whole / degree[2] * k <= whole)
            powers.push_back({i, j, k});
    const auto n = static_cast<Eigen::Index>(powers.size());
    const Mat3 B = A.inverse();
    const double volume = std::abs(A.determinant());
    Eigen::MatrixXd K(3 * n, 3 * n);
    Eigen::VectorXd shrink(3 * n);  // one over the root of the mass, which is diagonal
    for (Eigen::Index a = 0; a < n; ++a) {
      const auto& p = powers[static_cast<std::size_t>(a)];
      shrink.segment<3>(3 * a).setConstant(
          1.0 / std::sqrt(m.density * volume * product(p[0], p[0]) * product(p[1], p[1]) * product(p[2], p[2])));
      for (Eigen::Index b = 0; b < n; ++b) {
        const Mat3 G = volume * B.transpose() * gradients(p, powers[static_cast<std::size_t>(b)]) * B;
        K.block<3, 3>(3 * a, 3 * b) =
            m.lame_lambda() * G + m.shear_modulus() * G.transpose() + m.shear_modulus() * G.trace() * Mat3::Identity();
      }
    }
    K = shrink.asDiagonal() * K * shrink.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(K);
    for (Eigen::Index i = 0; i < std::min<Eigen::Index>(3 * n, 40); ++i)
      found.push_back({solver.eigenvalues()[i], powers, shrink.asDiagonal() * solver.eigenvectors().col(i)});
  }

  Mat3 to_unit_;
  std::vector<Mode> modes_;
};

}  // namespace limber::testing
