// Impulses of contacts and limits where gaps follow them by a matrix that is not symmetric, against the law itself.
#include "limber/solvers/row_equilibrium.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <random>
#include <vector>

namespace limber::internal {
namespace {

using Set = ContactPotential::Set;
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Contacts on a few degrees of freedom whose masses differ by up to a ratio, and a part that is not symmetric.
Square random_matrix(std::mt19937& random, Eigen::Index rows, Eigen::Index freedoms, double ratio, double skew) {
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  Eigen::MatrixXd J(rows, freedoms), turns(freedoms, freedoms);
  for (double& x : J.reshaped()) x = number(random);
  for (double& x : turns.reshaped()) x = skew * number(random);
  Eigen::VectorXd root(freedoms);
  for (Eigen::Index k = 0; k < freedoms; ++k) root[k] = std::pow(ratio, -0.5 * (k % 2));
  J = J * root.asDiagonal();
  return J * (Eigen::MatrixXd::Identity(freedoms, freedoms) + 0.5 * (turns - turns.transpose())) * J.transpose();
}

/// |F − P(F − (u + shift)/ρ)| ρ, the largest of all contacts.
double left_of_law(const Square& W, const Eigen::VectorXd& b, const Eigen::VectorXd& f, double friction) {
  const Eigen::VectorXd u = b + W * f;
  double left = 0.0;
  for (Eigen::Index i = 0; i < f.size(); i += 3) {
    const double response = W.diagonal().segment<3>(i).mean();
    const ContactPotential set{.set = Set::kCone, .compliance = response, .bound = friction};
    Vec3 open = u.segment<3>(i);
    open[0] += friction * open.tail<2>().norm();
    left = std::max(left, response * (set.at(open - response * f.segment<3>(i)).impulse - f.segment<3>(i)).norm());
  }
  return left;
}

TEST(RowEquilibrium, MeetsTheLawOfContactsAtAnyRatioOfMasses) {
  constexpr Eigen::Index kContacts = 3, kRows = 3 * kContacts;
  constexpr double kFriction = 0.2, kTolerance = 1e-7;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  for (const double ratio : {1.0, 1e3, 1e6})
    for (int trial = 0; trial < 30; ++trial) {
      const Square W = random_matrix(random, kRows, 12, ratio, 0.2);
      Eigen::VectorXd b(kRows), f = Eigen::VectorXd::Zero(kRows);
      for (double& x : b) x = number(random);
      RowEquilibrium equilibrium;
      for (Eigen::Index i = 0; i < kRows; i += 3)
        equilibrium.add_unit(
            3, {.set = Set::kCone, .compliance = W.diagonal().segment<3>(i).mean(), .bound = kFriction}, kTolerance);
      equilibrium.factor({W.data(), static_cast<std::size_t>(W.size())});
      // Each solve leaves a part of what is left at first.
      for (int i = 0; i < 10; ++i) equilibrium.solve({b.data(), kRows}, {f.data(), kRows});
      EXPECT_LE(left_of_law(W, b, f, kFriction), kTolerance) << ratio << ' ' << trial;
    }
}

TEST(RowEquilibrium, ImpulsesAtTheirBoundsAreThere) {
  const std::vector<double> W{1.0}, b{-5.0};
  std::vector<double> f{0.0};
  RowEquilibrium equilibrium;
  equilibrium.add_unit(1, {.set = Set::kInterval, .compliance = 1.0, .lower = -0.3, .upper = 0.3}, 1e-9);
  equilibrium.factor(W);
  equilibrium.solve(b, f);
  EXPECT_EQ(f[0], 0.3);
}

}  // namespace
}  // namespace limber::internal
