// The complementary contact solver against enumeration of all contact sets, its own conditions, and worked examples.
#include "limber/hauser/contact_qp.h"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "constants.h"
#include "contact_problems.h"
#include "counted_new.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::ContactSample;
using testing::kInfinity;
using testing::make_contacts;
using testing::Touching;

constexpr double kResidual = 1e-10;  // what the solver promises of its conditions, relative

struct SolvedQp {
  ContactQpResult result = {};
  std::vector<double> f;
};

SolvedQp solve_dense(const ContactSample& s, ContactQpSolver& solver, std::vector<double> guess = {}) {
  SolvedQp solved{.f = std::move(guess)};
  solved.f.resize(static_cast<std::size_t>(s.contacts));
  solved.result = solver.solve(ContactQp{.size = s.contacts, .A = s.A, .b = s.b}, solved.f);
  return solved;
}

SolvedQp solve_factored(const ContactSample& s, ContactQpSolver& solver, std::vector<double> D = {}) {
  SolvedQp solved{.f = std::vector<double>(static_cast<std::size_t>(s.contacts))};
  solved.result = solver.solve(
      FactoredContactQp{.size = s.contacts, .dimension = s.dimension, .G = s.G, .D = D, .b = s.b}, solved.f);
  return solved;
}

Eigen::VectorXd speeds(const ContactSample& s, const std::vector<double>& f) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(s.A.data(), s.contacts, s.contacts) *
             Eigen::Map<const Eigen::VectorXd>(f.data(), s.contacts) +
         Eigen::Map<const Eigen::VectorXd>(s.b.data(), s.contacts);
}

/// max_i |min(f_i, w_i)| with rows scaled to unit diagonal, relative to the larger of b and f.
double complementarity(const ContactSample& s, const std::vector<double>& f) {
  const Eigen::VectorXd w = speeds(s, f);
  double worst = 0.0, size = 0.0;
  for (int i = 0; i < s.contacts; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double root = std::sqrt(s.A[at * static_cast<std::size_t>(s.contacts) + at]);
    worst = std::max(worst, std::abs(std::min(f[at] * root, w[i] / root)));
    size = std::max({size, std::abs(s.b[at]) / root, f[at] * root});
  }
  return worst / size;
}

/// The forces of the contact set with the least violation, over all 2^m sets: independent of any pivoting.
Eigen::VectorXd best_of_all_sets(const ContactSample& s) {
  const int m = s.contacts;
  const Eigen::Map<const Eigen::MatrixXd> A(s.A.data(), m, m);
  const Eigen::Map<const Eigen::VectorXd> b(s.b.data(), m);
  Eigen::VectorXd best = Eigen::VectorXd::Zero(m);
  double least = kInfinity;
  for (unsigned set = 0; set < 1u << m; ++set) {
    std::vector<int> P;
    for (int i = 0; i < m; ++i)
      if (set >> i & 1u) P.push_back(i);
    Eigen::VectorXd f = Eigen::VectorXd::Zero(m);
    if (!P.empty()) {
      const Eigen::MatrixXd App = A(P, P);
      const Eigen::VectorXd solution = App.completeOrthogonalDecomposition().solve(Eigen::VectorXd(-b(P)));
      f(P) = solution;
    }
    const double violation = f.cwiseMin(A * f + b).cwiseAbs().maxCoeff();
    if (violation < least) least = violation, best = f;
  }
  return best;
}

TEST(ContactQp, TwoUnequalContactsGiveTheComplementaryForces) {
  ContactQpSolver solver;
  const ContactSample first{.contacts = 2, .A = {1, 9, 9, 100}, .b = {-1, 0}};
  EXPECT_THAT(solve_dense(first, solver).f, ::testing::ElementsAre(1.0, 0.0));
  // A rod of 1 kg and length 2 m that falls and turns, touched at ½ and 1 from its centre: f = (1/1.75, 0).
  const ContactSample rod{.contacts = 2, .A = {1.75, 2.5, 2.5, 4}, .b = {-1, 0}};
  EXPECT_THAT(solve_dense(rod, solver).f, ::testing::ElementsAre(::testing::DoubleEq(1.0 / 1.75), 0.0));
}

TEST(ContactQp, AgreesWithEveryContactSetTried) {
  std::mt19937 random(1);
  ContactQpSolver solver;
  for (int n = 0; n < 300; ++n) {
    const auto kind = static_cast<Touching>(n % 3);
    const ContactSample s = make_contacts(1 + n % 8, n % 5, kind, random);
    const SolvedQp dense = solve_dense(s, solver), factored = solve_factored(s, solver);
    ASSERT_EQ(dense.result.status, SolveStatus::kSolved) << n;
    const Eigen::VectorXd f = best_of_all_sets(s);
    // w is unique even where f is not
    const Eigen::VectorXd w = speeds(s, std::vector<double>(f.data(), f.data() + f.size()));
    const double size = 1.0 + w.cwiseAbs().maxCoeff();
    EXPECT_LT((speeds(s, dense.f) - w).cwiseAbs().maxCoeff(), kResidual * size) << n;
    EXPECT_LT((speeds(s, factored.f) - w).cwiseAbs().maxCoeff(), kResidual * size) << n;
  }
}

TEST(ContactQp, RankDeficientSetsMeetTheirConditions) {
  std::mt19937 random(2);
  ContactQpSolver solver;
  for (int n = 0; n < 400; ++n) {
    const auto kind = static_cast<Touching>(n % 3);
    const int m = 4 + n % 125;
    const ContactSample s = make_contacts(m, (n / 3) % 3 * 20, kind, random);
    for (const SolvedQp& solved : {solve_dense(s, solver), solve_factored(s, solver)}) {
      ASSERT_EQ(solved.result.status, SolveStatus::kSolved) << n;
      EXPECT_LT(complementarity(s, solved.f), kResidual) << n;
      EXPECT_LT(solved.result.residual, kResidual) << n;
      EXPECT_LE(solved.result.iterations, 10 * m) << n;
    }
  }
}

TEST(ContactQp, NearlyEqualContactsAndUnequalMassesMeetTheirConditions) {
  // Twice the same points to 1e-4 … 1e-10, with rows over eight decades: what a fine mesh and mass ratios bring about.
  std::mt19937 random(8);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  ContactQpSolver solver;
  for (int n = 0; n < 400; ++n) {
    const ContactSample exact = make_contacts(2 + n % 60, n % 30, Touching::kDuplicates, random);
    Eigen::MatrixXd G = Eigen::Map<const RowMajor>(exact.G.data(), exact.contacts, exact.dimension);
    const double difference = std::pow(10.0, -4 - n % 7), spread = n % 3 * 2.0;
    for (double& x : G.reshaped()) x += difference * normal(random);
    for (int i = 0; i < exact.contacts; ++i) G.row(i) *= std::pow(10.0, spread * uniform(random));
    Eigen::VectorXd y(exact.dimension);
    for (double& x : y) x = normal(random);
    const ContactSample s = testing::sample_of(G, G * y);
    EXPECT_LT(complementarity(s, solve_dense(s, solver).f), kResidual) << n;
    EXPECT_LT(complementarity(s, solve_factored(s, solver).f), kResidual) << n;
  }
}

TEST(ContactQp, NeverAddsEnergyAtVelocityLevel) {
  std::mt19937 random(3);
  ContactQpSolver solver;
  for (int n = 0; n < 300; ++n) {
    const ContactSample s = make_contacts(2 + n % 40, n % 33, static_cast<Touching>(n % 3), random);
    const std::vector<double> f = solve_factored(s, solver).f;
    const Eigen::VectorXd w = speeds(s, f);
    double energy = 0.0, size = 0.0;
    for (std::size_t i = 0; i < f.size(); ++i) {
      energy += 0.5 * f[i] * (s.b[i] + w[static_cast<int>(i)]);
      size += f[i] * std::abs(s.b[i]);
    }
    EXPECT_LE(energy, kResidual * size) << n;
  }
}

TEST(ContactQp, AGuessNearTheSolutionTakesFewIterations) {
  std::mt19937 random(4);
  ContactQpSolver solver;
  const ContactSample s = make_contacts(60, 40, Touching::kAround, random);
  const SolvedQp cold = solve_dense(s, solver);
  const SolvedQp warm = solve_dense(s, solver, cold.f);
  EXPECT_GT(cold.result.iterations, 10);
  EXPECT_EQ(warm.result.iterations, 0);
  for (std::size_t i = 0; i < cold.f.size(); ++i) EXPECT_NEAR(warm.f[i], cold.f[i], 1e-9);
  ContactSample changed = s;
  for (double& b : changed.b) b *= 1.0 + 0.01 * std::sin(1e3 * b);
  std::vector<double> guess = cold.f;
  EXPECT_LT(solve_dense(changed, solver, guess).result.iterations, cold.result.iterations);
}

TEST(ContactQp, BoundsHoldMotorsAndEqualities) {
  // One body of 2 kg on a line, 4 m/s: an equality row stops it; a motor of at most 3 N·s takes what it can.
  ContactQpSolver solver;
  const std::vector<double> A = {0.5}, b = {4.0};
  std::vector<double> f = {0.0};
  solver.solve(
      ContactQp{
          .size = 1, .A = A, .b = b, .lower = std::vector<double>{-kInfinity}, .upper = std::vector<double>{kInfinity}},
      f);
  EXPECT_DOUBLE_EQ(f[0], -8.0);
  f[0] = 0.0;
  const auto result = solver.solve(
      ContactQp{.size = 1, .A = A, .b = b, .lower = std::vector<double>{-3.0}, .upper = std::vector<double>{3.0}}, f);
  EXPECT_DOUBLE_EQ(f[0], -3.0);
  EXPECT_EQ(result.status, SolveStatus::kSolved);
}

TEST(ContactQp, BoxProblemsMeetTheirConditions) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  ContactQpSolver solver;
  for (int n = 0; n < 300; ++n) {
    const ContactSample s = make_contacts(3 + n % 60, n % 30, static_cast<Touching>(n % 3), random);
    std::vector<double> lower(s.b.size()), upper(s.b.size()), f(s.b.size());
    for (std::size_t i = 0; i < lower.size(); ++i) {
      const double kind = uniform(random);
      lower[i] = kind < 0.2 ? -kInfinity : kind < 0.6 ? -0.3 * uniform(random) : 0.0;
      upper[i] = kind < 0.2 ? kInfinity : kind < 0.8 ? 0.3 * uniform(random) : kInfinity;
    }
    const auto result =
        solver.solve(ContactQp{.size = s.contacts, .A = s.A, .b = s.b, .lower = lower, .upper = upper}, f);
    ASSERT_EQ(result.status, SolveStatus::kSolved) << n;
    const Eigen::VectorXd w = speeds(s, f);
    const double size = 1.0 + w.cwiseAbs().maxCoeff();
    for (std::size_t i = 0; i < f.size(); ++i) {
      const double wi = w[static_cast<int>(i)];
      EXPECT_GE(f[i], lower[i]);
      EXPECT_LE(f[i], upper[i]);
      EXPECT_TRUE(f[i] == lower[i] || wi < kResidual * size) << n;
      EXPECT_TRUE(f[i] == upper[i] || wi > -kResidual * size) << n;
    }
  }
}

TEST(ContactQp, ContradictingRowsAreRelaxedAndSaidSo) {
  // Squeezed between two walls that both come closer: no force opens both.
  ContactQpSolver solver;
  std::vector<double> f(2);
  const std::vector<double> A = {1, -1, -1, 1}, b = {-1, 0.5};
  const auto result = solver.solve(ContactQp{.size = 2, .A = A, .b = b}, f);
  EXPECT_EQ(result.status, SolveStatus::kRelaxed);
  // The forces balance and the shortfall of ½ is shared: w = (−¼, −¼).
  EXPECT_NEAR(result.slack, 0.25, 1e-5);
  EXPECT_NEAR(f[0] - f[1], 0.75, 1e-5);
  // A gap that nothing can move
  const std::vector<double> none = {0.0}, closed = {-1.0};
  std::vector<double> g(1);
  const auto immovable = solver.solve(ContactQp{.size = 1, .A = none, .b = closed}, g);
  EXPECT_EQ(immovable.status, SolveStatus::kRelaxed);
  EXPECT_DOUBLE_EQ(immovable.slack, 1.0);
}

TEST(ContactQp, DependentRowsWithoutACommonSolutionAreSolvedIfBoundsAllow) {
  // The same contact seen twice with different speeds: the faster one decides.
  ContactQpSolver solver;
  const ContactSample s{.contacts = 2, .A = {1, 1, 1, 1}, .b = {-1, -0.9}};
  EXPECT_THAT(solve_dense(s, solver).f, ::testing::ElementsAre(1.0, 0.0));
  const SolvedQp from_the_other = solve_dense(s, solver, {0.0, 0.5});
  EXPECT_EQ(from_the_other.result.status, SolveStatus::kSolved);
  EXPECT_THAT(from_the_other.f, ::testing::ElementsAre(1.0, 0.0));
}

TEST(ContactQp, ResidualComplianceSharesTheLoadOfEqualContacts) {
  ContactQpSolver solver;
  const ContactSample s{.contacts = 4, .dimension = 1, .G = {1, 1, 1, 1}, .b = {-1, -1, -1, -1}};
  const SolvedQp solved = solve_factored(s, solver, {0.1, 0.1, 0.1, 0.1});
  for (const double f : solved.f) EXPECT_NEAR(f, 1.0 / 4.1, 1e-14);
}

TEST(ContactQp, NumbersThatAreNotFiniteAreAResultNotAnException) {
  ContactQpSolver solver;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  ContactSample s{.contacts = 2, .A = {1, nan, nan, 1}, .b = {-1, -1}};
  const SolvedQp in_A = solve_dense(s, solver, {1.0, 1.0});
  EXPECT_EQ(in_A.result.status, SolveStatus::kInvalidInput);
  EXPECT_THAT(in_A.f, ::testing::Each(0.0));
  s.A = {1, 0, 0, 1}, s.b = {kInfinity, 0};
  EXPECT_EQ(solve_dense(s, solver).result.status, SolveStatus::kInvalidInput);
  s.b = {0};
  EXPECT_THROW(solve_dense(s, solver), InvalidArgument);
}

TEST(ContactQp, SameBitsEveryTimeAndNoAllocationOnceWarm) {
  std::mt19937 random(6);
  ContactQpSolver solver, other;
  const ContactSample large = make_contacts(80, 20, Touching::kPlane, random);
  const ContactSample small = make_contacts(20, 40, Touching::kAround, random);
  const std::vector<double> first = solve_factored(small, solver).f, first_dense = solve_dense(small, solver).f;
  solve_dense(large, other), solve_factored(large, other);  // other memory, other history
  EXPECT_EQ(solve_factored(small, other).f, first);
  EXPECT_EQ(solve_dense(small, other).f, first_dense);
  std::vector<double> f(large.b.size());
  const long before = testing::allocations();
  other.solve(ContactQp{.size = large.contacts, .A = large.A, .b = large.b}, f);
  std::fill(f.begin(), f.end(), 0.0);
  other.solve(FactoredContactQp{.size = large.contacts,
                                .dimension = large.dimension,
                                .G = large.G,
                                .D = {},
                                .b = large.b,
                                .lower = {},
                                .upper = {}},
              f);
  EXPECT_EQ(testing::allocations(), before);
}

TEST(ContactQp, NoContactsIsSolved) {
  ContactQpSolver solver;
  EXPECT_EQ(solve_dense({}, solver).result.status, SolveStatus::kSolved);
}

}  // namespace
}  // namespace limber
