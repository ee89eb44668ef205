// [H03]'s rules for contacts as one call, against closed forms and against what its parts promise.
#include "limber/solvers/hauser/contact_program.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "contact_problems.h"
#include "limber/core/types.h"

namespace limber {
namespace {

constexpr ContactProgramRule kLeastSum{}, kHeuristic{.least_sum = false},
    kNoSlip{.least_sum = false, .stops_slip = true};

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
    const ContactProblem problem{.cones = 4,
                                 .A = sample.A,
                                 .b = sample.b,
                                 .friction = friction,
                                 .lower = lower,
                                 .upper = upper,
                                 .gap_before = {}};
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

/// Two balls' worth of contacts on a line: the program of least sum takes one of the answers of least total impulse,
/// which may press harder on one side than the complementary answer; the guard allows it no energy.
TEST(ContactProgram, TheGuardLetsNoEnergyIn) {
  std::mt19937 random(6);
  long refused = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const testing::ContactSample sample = testing::make_contacts(10, 4, testing::Touching::kAround, random);
    std::vector<double> lower(10, 0.0), upper(10, kUnbounded);
    const ContactProblem problem{
        .A = sample.A, .b = sample.b, .friction = {}, .lower = lower, .upper = upper, .gap_before = {}};
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
