// Random problems of contacts with Coulomb's friction, gaps u = b + W f: of dense matrices and of heaps of boxes, with
// redundant contacts, masses of three decades and μ from 0 to 10. Each has an answer, or answers as close as wanted:
// u = 0, nothing moves, is within reach.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace limber::testing {

/// Rows of a contact: normal and two tangents; the normal alone where μ = 0.
struct ConeProblem {
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> W;
  Eigen::VectorXd b;
  std::vector<double> friction;  ///< by contact

  /// Numbers of all contacts, with two tangents each, in place of those that rows have.
  Eigen::VectorXd of_rows(const Eigen::VectorXd& all) const {
    std::vector<double> kept;
    for (std::size_t c = 0; c < friction.size(); ++c)
      for (int r = 0; r < (friction[c] > 0.0 ? 3 : 1); ++r) kept.push_back(all[3 * static_cast<Eigen::Index>(c) + r]);
    return Eigen::Map<const Eigen::VectorXd>(kept.data(), static_cast<Eigen::Index>(kept.size()));
  }
};

class ConeProblems {
 public:
  explicit ConeProblems(unsigned seed) : random_(seed) {}

  /// One of five kinds in turn. @param contacts ≥ 1
  ConeProblem make(int kind, int contacts) {
    Eigen::VectorXd gap = Eigen::VectorXd::Zero(3 * contacts);
    for (int c = 0; c < contacts; ++c)
      if (part() < 0.3) gap[3 * c] = 0.3 * part();
    return kind < 3 ? dense(kind, contacts, gap) : boxes(kind == 4, contacts, gap);
  }
  double part() { return std::uniform_real_distribution<double>(0.0, 1.0)(random_); }

 private:
  double normal() { return std::normal_distribution<double>()(random_); }
  double friction() {
    constexpr double kAll[] = {0.0, 0.01, 0.1, 0.3, 0.5, 0.8, 1.0, 2.0, 5.0, 10.0};
    return kAll[static_cast<int>(10.0 * part()) % 10];
  }

  /// Rows without any order: as many degrees of freedom as rows, a third of them, or few, with each contact twice.
  ConeProblem dense(int kind, int contacts, const Eigen::VectorXd& gap) {
    const int rows = 3 * contacts, few = 6 + static_cast<int>(30.0 * part());
    Eigen::MatrixXd J(rows, kind == 0 ? rows : kind == 1 ? std::max(6, contacts) : few);
    for (double& x : J.reshaped()) x = normal();
    std::vector<double> mu(static_cast<std::size_t>(contacts));
    for (double& m : mu) m = friction();
    for (int c = 0; kind == 2 && c + 1 < contacts; c += 2) {
      J.middleRows<3>(3 * c + 3) = J.middleRows<3>(3 * c);
      mu[static_cast<std::size_t>(c + 1)] = mu[static_cast<std::size_t>(c)];
    }
    Eigen::VectorXd v(J.cols());
    for (double& x : v) x = normal();
    return problem(J, Eigen::VectorXd::Ones(J.cols()), v, mu, gap);
  }

  /// Faces of cubes of size 1, four contacts each, on each other in a tower, or on any below or the ground.
  ConeProblem boxes(bool tower, int contacts, const Eigen::VectorXd& gap) {
    const int bodies = std::max(1, contacts / 4);
    std::vector<Eigen::Vector3d> place(static_cast<std::size_t>(bodies));
    Eigen::VectorXd mobility(6 * bodies), v(6 * bodies);
    for (int i = 0; i < bodies; ++i) {
      const double mass = std::pow(10.0, 3.0 * part() - 1.5);
      place[static_cast<std::size_t>(i)] = {0.3 * normal(), 0.3 * normal(), tower ? i + 0.5 : 0.5 + i / 3};
      mobility.segment<3>(6 * i).setConstant(1.0 / mass);
      mobility.segment<3>(6 * i + 3).setConstant(6.0 / mass);
      for (int k = 0; k < 3; ++k) v[6 * i + k] = (k == 2 ? -0.16 : 0.0) + 0.1 * normal();
      for (int k = 3; k < 6; ++k) v[6 * i + k] = 0.3 * normal();
    }
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3 * contacts, 6 * bodies);
    std::vector<double> mu(static_cast<std::size_t>(contacts));
    int above = 0, below = -1;
    Eigen::Vector3d axes[3];
    for (int c = 0; c < contacts; ++c) {
      if (c % 4 == 0) {
        above = c / 4 % bodies, below = tower ? above - 1 : static_cast<int>(part() * (above + 1)) - 1;
        const double lean = tower ? 0.05 : 0.3;
        axes[0] = Eigen::Vector3d(lean * normal(), lean * normal(), 1.0).normalized();
        axes[1] = axes[0].cross(Eigen::Vector3d::UnitX()).normalized(), axes[2] = axes[0].cross(axes[1]);
        mu[static_cast<std::size_t>(c)] = friction();
      } else {
        mu[static_cast<std::size_t>(c)] = mu[static_cast<std::size_t>(c - 1)];
      }
      const Eigen::Vector3d& up = place[static_cast<std::size_t>(above)];
      const Eigen::Vector3d at = up + Eigen::Vector3d(c % 2 == 0 ? 0.5 : -0.5, c % 4 < 2 ? 0.5 : -0.5, -0.5);
      for (int r = 0; r < 3; ++r) {
        J.block<1, 3>(3 * c + r, 6 * above) += axes[r].transpose();
        J.block<1, 3>(3 * c + r, 6 * above + 3) += (at - up).cross(axes[r]).transpose();
        if (below < 0) continue;
        J.block<1, 3>(3 * c + r, 6 * below) -= axes[r].transpose();
        J.block<1, 3>(3 * c + r, 6 * below + 3) -=
            (at - place[static_cast<std::size_t>(below)]).cross(axes[r]).transpose();
      }
    }
    return problem(J, mobility, v, mu, gap);
  }

  static ConeProblem problem(const Eigen::MatrixXd& J, const Eigen::VectorXd& mobility, const Eigen::VectorXd& v,
                             const std::vector<double>& mu, const Eigen::VectorXd& gap) {
    ConeProblem p{.W = {}, .b = {}, .friction = mu};
    const Eigen::VectorXd b = J * v + gap;
    Eigen::MatrixXd rows(p.of_rows(b).size(), J.cols());
    for (Eigen::Index k = 0; k < J.cols(); ++k) rows.col(k) = p.of_rows(J.col(k)) * std::sqrt(mobility[k]);
    p.W = rows * rows.transpose();
    p.b = p.of_rows(b);
    return p;
  }

  std::mt19937 random_;
};

}  // namespace limber::testing
