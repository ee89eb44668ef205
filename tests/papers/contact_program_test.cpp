// [H03]'s rules for contacts as one call, against closed forms and against what its parts promise.
#include "limber/hauser/contact_program.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "contact_problems.h"
#include "limber/core/types.h"
#include "linear_program_vertices.h"

namespace limber {
namespace {

constexpr ContactProgramRule kLeastSum{}, kHeuristic{.least_sum = false},
    kNoSlip{.least_sum = false, .stops_slip = true};

using Numbers = std::span<const double>;

/// @param friction of the contacts that come first, three rows each
ContactProblem problem_of(const testing::ContactSample& sample, Numbers lower, Numbers upper, Numbers friction = {}) {
  return {.cones = static_cast<int>(friction.size()),
          .A = sample.A,
          .b = sample.b,
          .friction = friction,
          .lower = lower,
          .upper = upper,
          .gap_before = {}};
}

/// A unit mass on one contact that comes down with `down` and slides with `slip`.
struct OneContact {
  std::vector<double> A{1, 0, 0, 0, 1, 0, 0, 0, 1}, b, friction{0.5}, lower{0, 0, 0}, upper{0, 0, 0}, f{0, 0, 0};
  OneContact(double down, const Eigen::Vector2d& slip) : b{-down, slip.x(), slip.y()} {}
  void solve(const ContactProgramRule& rule) {
    ContactProgramSolver solver;
    ProgramReport report;
    const ContactProblem problem{
        .cones = 1, .A = A, .b = b, .friction = friction, .lower = lower, .upper = upper, .gap_before = {}};
    EXPECT_EQ(solver.solve(problem, rule, f, report), SolveStatus::kSolved);
  }
};

TEST(ContactProgram, FrictionStopsASlipThatItCanAndOnlySlowsAFasterOne) {
  for (const ContactProgramRule& rule : {kLeastSum, kHeuristic, kNoSlip}) {
    OneContact slow(2.0, {0.3, -0.4});
    slow.solve(rule);
    EXPECT_NEAR(slow.f[0], 2.0, 1e-12);
    EXPECT_NEAR(slow.f[1], -0.3, 1e-12);
    EXPECT_NEAR(slow.f[2], 0.4, 1e-12);
    OneContact fast(2.0, {3.0, -4.0});
    fast.solve(rule);
    EXPECT_NEAR(fast.f[1], -0.6, 1e-12);  // μ f_n against the slip
    EXPECT_NEAR(fast.f[2], 0.8, 1e-12);
    OneContact leaving(-1.0, {3.0, -4.0});
    leaving.solve(rule);
    EXPECT_EQ(leaving.f, std::vector<double>(3, 0.0));
  }
}

/// Friction that turns a body about a contact changes its normals, which the heuristic does not look at again; the
/// solve without slip does.
TEST(ContactProgram, TheSolveWithoutSlipLeavesNoNormalOpen) {
  std::mt19937 random(4);
  int mended = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const testing::ContactSample sample = testing::make_contacts(12, 6, testing::Touching::kPlane, random);
    std::vector<double> friction(4, 5.0), lower(12, 0.0), upper(12, 0.0);
    const ContactProblem problem = problem_of(sample, lower, upper, friction);
    const Eigen::Map<const Eigen::MatrixXd> A(sample.A.data(), 12, 12);
    const Eigen::Map<const Eigen::VectorXd> b(sample.b.data(), 12);
    const auto worst_normal = [&](const ContactProgramRule& rule) {
      ContactProgramSolver solver;
      ProgramReport report;
      Eigen::VectorXd f = Eigen::VectorXd::Zero(12);
      EXPECT_EQ(solver.solve(problem, rule, {f.data(), 12}, report), SolveStatus::kSolved);
      const Eigen::VectorXd w = A * f + b;
      double least = 0.0;
      for (int c = 0; c < 4; ++c) least = std::min(least, w[3 * c]);
      return least;
    };
    EXPECT_GE(worst_normal(kNoSlip), -1e-9);
    mended += worst_normal(kHeuristic) < -1e-3 ? 1 : 0;
  }
  EXPECT_GE(mended, 10);
}

/// Small ones are looked at vertex by vertex.
TEST(ContactProgram, TheLeastSumIsThatOfTheBestVertex) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 120; ++trial) {
    const int n = 1 + trial % 5;
    const testing::ContactSample sample =
        testing::make_contacts(n, 6, trial % 2 == 0 ? testing::Touching::kPlane : testing::Touching::kAround, random);
    const Eigen::Map<const Eigen::MatrixXd> A(sample.A.data(), n, n);
    const Eigen::Map<const Eigen::VectorXd> b(sample.b.data(), n);
    const std::vector<double> lower(static_cast<std::size_t>(n), 0.0), upper(static_cast<std::size_t>(n), kUnbounded);
    Eigen::VectorXd f = Eigen::VectorXd::Zero(n);
    ContactProgramSolver solver;
    ProgramReport report;
    const ContactProblem problem = problem_of(sample, lower, upper);
    EXPECT_EQ(solver.solve(problem, {.guard = ProgramGuard::kNone}, {f.data(), static_cast<std::size_t>(n)}, report),
              SolveStatus::kSolved);
    EXPECT_GE((A * f + b).minCoeff(), -1e-9);
    EXPECT_NEAR(f.sum(), testing::least_sum_of_all_vertices(A, b), 1e-8 * (1.0 + f.sum())) << trial;
  }
}

/// Where friction stayed below μ f_n there is no slip, what slid keeps its friction, and normals are complementary.
TEST(ContactProgram, TheSolveWithoutSlipLeavesNoneWhereItSticks) {
  constexpr double kMu = 0.6;
  std::mt19937 random(9);
  int stuck = 0, sliding = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const testing::ContactSample sample = testing::make_contacts(9, 6, testing::Touching::kPlane, random);
    const std::vector<double> friction(3, kMu), lower(9, 0.0), upper(9, 0.0);
    const ContactProblem problem = problem_of(sample, lower, upper, friction);
    Eigen::VectorXd first = Eigen::VectorXd::Zero(9), f = first;
    ContactProgramSolver solver;
    ProgramReport report;
    solver.solve(problem, kHeuristic, {first.data(), 9}, report);
    solver.solve(problem, kNoSlip, {f.data(), 9}, report);
    const Eigen::VectorXd w = Eigen::Map<const Eigen::MatrixXd>(sample.A.data(), 9, 9) * f +
                              Eigen::Map<const Eigen::VectorXd>(sample.b.data(), 9);
    for (int n = 0; n < 9; n += 3) {
      EXPECT_GE(f[n], 0.0);
      EXPECT_NEAR(f[n] * w[n], 0.0, 1e-9);
      const bool sticks = first[n] > 0.0 && first.segment<2>(n + 1).norm() < (1.0 - 1e-9) * kMu * first[n];
      ++(sticks ? stuck : sliding);
      const Eigen::Vector2d rest = sticks ? w.segment<2>(n + 1) : Eigen::Vector2d((f - first).segment<2>(n + 1));
      EXPECT_NEAR(rest.norm(), 0.0, 1e-9) << trial;
    }
  }
  EXPECT_GT(stuck, 20);
  EXPECT_GT(sliding, 20);
}

/// Two balls' worth of contacts on a line: the program of least sum takes one of the answers of least total impulse,
/// which may press harder on one side than the complementary answer; the guard allows it no energy.
TEST(ContactProgram, TheGuardLetsNoEnergyIn) {
  std::mt19937 random(6);
  long refused = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const testing::ContactSample sample = testing::make_contacts(10, 4, testing::Touching::kAround, random);
    std::vector<double> lower(10, 0.0), upper(10, kUnbounded);
    const ContactProblem problem = problem_of(sample, lower, upper);
    const auto energy = [&](ProgramGuard guard) {
      ContactProgramSolver solver;
      ProgramReport report;
      Eigen::VectorXd f = Eigen::VectorXd::Zero(10);
      EXPECT_EQ(solver.solve(problem, {.guard = guard}, {f.data(), 10}, report), SolveStatus::kSolved);
      refused += guard == ProgramGuard::kClamp ? report.guard.clamped : 0;
      const Eigen::Map<const Eigen::MatrixXd> A(sample.A.data(), 10, 10);
      const Eigen::Map<const Eigen::VectorXd> b(sample.b.data(), 10);
      return f.dot(b) + 0.5 * f.dot(A * f);
    };
    EXPECT_LE(energy(ProgramGuard::kClamp), 1e-9);
    EXPECT_LE(energy(ProgramGuard::kComplementary), 1e-9);
  }
  EXPECT_GT(refused, 0);
}

}  // namespace
}  // namespace limber
