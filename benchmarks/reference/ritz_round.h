/// @file ritz_round.h
/// Vibration of a free cylinder or ellipsoid by Ritz's method with polynomials; quadrature by Gauss's rules is exact.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "limber/model/material.h"

namespace limber::testing {

struct RoundBody {
  Vec3 half = Vec3::Ones();  ///< half axes, m; a cylinder's axis is z
  bool is_ellipsoid = false;
};

/// Lowest elastic eigenvalues, from above, ascending.
/// @param degree of the polynomials: powers i, j, k of x, y, z with i/degree[0] + j/degree[1] + k/degree[2] ≤ 1
class RitzRound {
 public:
  using Degree = std::array<int, 3>;

  RitzRound(const RoundBody& body, const Material& material, const Degree& degree) : degree_(degree) {
    set_points(body);
    // Each mirror plane maps the body onto itself: displacements fall into eight kinds that do not mix.
    for (int kind = 0; kind < 8; ++kind) add_eigenvalues(body, material, kind);
    std::sort(eigenvalues_.begin(), eigenvalues_.end());
    eigenvalues_.erase(eigenvalues_.begin(), eigenvalues_.begin() + 6);  // rigid motions
  }

  const std::vector<double>& eigenvalues() const { return eigenvalues_; }

 private:
  struct Point {
    Vec3 at;  ///< in half axes
    double weight = 0.0;
  };
  struct Rule {
    Eigen::VectorXd at, weight;
  };

  /// Of Gauss and Legendre on [-1, 1]; Golub and Welsch.
  static Rule gauss(int n) {
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(n, n);
    for (int i = 1; i < n; ++i) J(i, i - 1) = J(i - 1, i) = i / std::sqrt(4.0 * i * i - 1.0);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(J);
    return {solver.eigenvalues(), 2.0 * solver.eigenvectors().row(0).transpose().cwiseAbs2()};
  }

  void set_points(const RoundBody& body) {
    const int most = *std::max_element(degree_.begin(), degree_.end()), around = 2 * most + 2;
    const Rule along = gauss(2 * most + 2), out = gauss(most + 2);
    for (Eigen::Index i = 0; i < along.at.size(); ++i)
      for (Eigen::Index j = 0; j < out.at.size(); ++j)
        for (int k = 0; k < around; ++k) {
          const double z = along.at[i], rim = body.is_ellipsoid ? std::sqrt(1.0 - z * z) : 1.0;
          const double r = 0.5 * rim * (1.0 + out.at[j]), angle = 2.0 * std::numbers::pi * (k + 0.5) / around;
          points_.push_back({Vec3(r * std::cos(angle), r * std::sin(angle), z),
                             along.weight[i] * 0.5 * rim * out.weight[j] * r * 2.0 * std::numbers::pi / around});
        }
  }

  /// Legendre's polynomials and their slopes at x.
  static Eigen::MatrixX2d legendre(int most, double x) {
    Eigen::MatrixX2d p = Eigen::MatrixX2d::Zero(most + 1, 2);
    p(0, 0) = 1.0;
    if (most > 0) p.row(1) << x, 1.0;
    for (int n = 2; n <= most; ++n) {
      p(n, 0) = ((2 * n - 1) * x * p(n - 1, 0) - (n - 1) * p(n - 2, 0)) / n;
      p(n, 1) = p(n - 2, 1) + (2 * n - 1) * p(n - 1, 0);
    }
    return p;
  }

  struct Term {
    int axis;
    Degree power;
  };
  std::vector<Term> terms(int kind) const {
    std::vector<Term> out;
    for (int axis = 0; axis < 3; ++axis)
      for (int i = 0; i <= degree_[0]; ++i)
        for (int j = 0; j <= degree_[1]; ++j)
          for (int k = 0; k <= degree_[2]; ++k) {
            const int odd = i % 2 + 2 * (j % 2) + 4 * (k % 2);
            const int whole = degree_[0] * degree_[1] * degree_[2];
            if (odd == (kind ^ (1 << axis)) &&
                whole / degree_[0] * i + whole / degree_[1] * j + whole / degree_[2] * k <= whole)
              out.push_back({axis, {i, j, k}});
          }
    return out;
  }

  void add_eigenvalues(const RoundBody& body, const Material& m, int kind) {
    const std::vector<Term> of = terms(kind);
    const auto n = static_cast<Eigen::Index>(of.size());
    Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n, n), M = K, G(9, n), U(3, n);
    for (const Point& point : points_) {
      std::array<Eigen::MatrixX2d, 3> p;
      for (std::size_t a = 0; a < 3; ++a) p[a] = legendre(degree_[a], point.at[static_cast<Eigen::Index>(a)]);
      G.setZero(), U.setZero();
      for (Eigen::Index t = 0; t < n; ++t) {
        const Term& term = of[static_cast<std::size_t>(t)];
        const auto value = [&](int slope) {
          double v = 1.0;
          for (int a = 0; a < 3; ++a)
            v *= p[static_cast<std::size_t>(a)](term.power[static_cast<std::size_t>(a)], a == slope ? 1 : 0);
          return slope < 0 ? v : v / body.half[slope];
        };
        U(term.axis, t) = value(-1);
        for (int s = 0; s < 3; ++s) G(3 * term.axis + s, t) = value(s);
      }
      M.noalias() += m.density * point.weight * U.transpose() * U;
      const Eigen::RowVectorXd divergence = G.row(0) + G.row(4) + G.row(8);
      K.noalias() += m.lame_lambda() * point.weight * divergence.transpose() * divergence;
      for (int s = 0; s < 3; ++s)
        for (int t = 0; t < 3; ++t) {
          const Eigen::RowVectorXd twice = G.row(3 * s + t) + G.row(3 * t + s);
          K.noalias() += 0.5 * m.shear_modulus() * point.weight * twice.transpose() * twice;
        }
    }
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(K, M, Eigen::EigenvaluesOnly);
    for (Eigen::Index i = 0; i < std::min<Eigen::Index>(n, 20); ++i) eigenvalues_.push_back(solver.eigenvalues()[i]);
  }

  Degree degree_;
  std::vector<Point> points_;
  std::vector<double> eigenvalues_;
};

}  // namespace limber::testing
