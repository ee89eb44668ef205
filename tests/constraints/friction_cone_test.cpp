// Friction by three methods: worked examples, the conditions of the cones, and each other.
#include "limber/constraints/friction_cone.h"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "contact_problems.h"
#include "counted_new.h"
#include "limber/constraints/contact_qp.h"
#include "limber/core/error.h"
#include "limber/core/types.h"

namespace limber {
namespace {

using testing::FrictionSample;
using testing::make_friction;
using testing::make_stack;

constexpr FrictionMethod kMethods[] = {FrictionMethod::kProximal, FrictionMethod::kBlockGaussSeidel,
                                       FrictionMethod::kStaggered};
constexpr double kStep = 9.81 / 60.0;  // m/s that gravity adds in a step
// The residual asked for, times the few units by which velocities differ from it.
constexpr double kVelocity = 1e-8;

FrictionProblem problem_of(const FrictionSample& s) { return {.contacts = s.contacts, .A = s.A, .b = s.b, .mu = s.mu}; }

struct SolvedCones {
  FrictionResult result = {};
  std::vector<double> f = {};
  Eigen::VectorXd u = {};
  Vec3 force(int i) const { return Eigen::Map<const Vec3>(f.data() + 3 * i); }
  Vec3 velocity(int i) const { return u.segment<3>(3 * i); }
};

Eigen::VectorXd velocities(const FrictionSample& s, const std::vector<double>& f) {
  const auto n = static_cast<Eigen::Index>(f.size());
  return Eigen::Map<const Eigen::MatrixXd>(s.A.data(), n, n) * Eigen::Map<const Eigen::VectorXd>(f.data(), n) +
         Eigen::Map<const Eigen::VectorXd>(s.b.data(), n);
}

SolvedCones solve(const FrictionSample& s, FrictionSolver& solver, const FrictionOptions& options) {
  SolvedCones solved{.f = std::vector<double>(s.b.size())};
  solved.result = solver.solve(problem_of(s), solved.f, options);
  solved.u = velocities(s, solved.f);
  return solved;
}

/// The blocks of a sample whose bodies have `columns` columns each.
std::vector<FrictionBlock> blocks_of(const FrictionSample& s, int columns, std::vector<double>& values) {
  std::vector<FrictionBlock> blocks(static_cast<std::size_t>(2 * s.contacts));
  values.assign(s.G.size(), 0.0);
  double* next = values.data();
  for (int i = 0; i < s.contacts; ++i) {
    int found = 0;
    for (int first = 0; first < s.columns; first += columns) {
      double size = 0.0;
      double* block = next;
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < columns; ++c) {
          *next = s.G[static_cast<std::size_t>((3 * i + r) * s.columns + first + c)];
          size += std::abs(*next++);
        }
      if (size > 0.0)
        blocks[static_cast<std::size_t>(2 * i + found++)] = {first, columns, block};
      else
        next = block;
    }
  }
  return blocks;
}

/// Coulomb's law at every contact: the largest violation, in units of velocity with unit effective mass.
double violation_of_coulomb(const FrictionSample& s, const SolvedCones& solved) {
  double worst = 0.0;
  for (int i = 0; i < s.contacts; ++i) {
    const double mu = s.mu[static_cast<std::size_t>(i)];
    const Vec3 f = solved.force(i), u = solved.velocity(i);
    const double ft = f.tail<2>().norm(), ut = u.tail<2>().norm();
    worst = std::max({worst, -f[0], -u[0], ft - mu * f[0]});
    worst = std::max(worst, std::min(f[0], std::abs(u[0])));  // touching or without force
    worst = std::max(worst, std::min(mu * f[0] - ft, ut));    // sticking or at the cone
    if (mu > 0.0)
      worst = std::max(worst, (f.tail<2>().dot(u.tail<2>()) + ft * ut) / std::max(1e-3, ft + ut));  // opposed
  }
  return worst;
}

TEST(FrictionCone, BlockOnASlopeSticksBelowTheFrictionAngleAndSlidesAbove) {
  FrictionSolver solver;
  for (const FrictionMethod method : kMethods)
    for (const double slope : {0.0, 0.2, 0.4, 0.6, 1.0}) {
      const double mu = 0.5;
      const FrictionSample s = make_stack(1, slope, mu);
      const SolvedCones solved = solve(s, solver, {.method = method, .tolerance = 1e-11, .max_sweeps = 5000});
      const bool sticks = std::tan(slope) < mu;
      const double speed = sticks ? 0.0 : kStep * (std::sin(slope) - mu * std::cos(slope));
      Vec3 sum = Vec3::Zero();
      for (int i = 0; i < 4; ++i) {
        sum += solved.force(i);
        EXPECT_NEAR(solved.velocity(i)[0], 0.0, kVelocity);
        EXPECT_NEAR(solved.velocity(i)[1], speed, kVelocity) << slope << " method " << static_cast<int>(method);
        EXPECT_NEAR(solved.velocity(i)[2], 0.0, kVelocity);
      }
      EXPECT_NEAR(sum[0], kStep * std::cos(slope), kVelocity);
      EXPECT_NEAR(sum[1], speed - kStep * std::sin(slope), kVelocity);
    }
}

TEST(FrictionCone, TallBlockTipsWhereItsCentreLeavesTheBase) {
  // A unit cube with enough friction tips about its lower edge for slopes above 45°, and rests below.
  FrictionSolver solver;
  for (const double slope : {0.7, 0.85}) {
    const FrictionSample s = make_stack(1, slope, 5.0);
    const SolvedCones solved = solve(s, solver, {.tolerance = 1e-11, .max_sweeps = 5000});
    EXPECT_EQ(solved.result.status, SolveStatus::kSolved);
    EXPECT_EQ(solved.velocity(0)[0] > 1e-4, slope > std::atan(1.0));  // the upper edge
    EXPECT_NEAR(solved.velocity(1).norm(), 0.0, kVelocity);           // the lower one holds
  }
}

TEST(FrictionCone, DirectionsAreAllAlike) {
  // The same contact with its tangents turned: the force turns with them.
  std::mt19937 random(1);
  FrictionSolver solver;
  for (int n = 0; n < 40; ++n) {
    const FrictionSample s = make_friction(1 + n % 2, 6, 0.3, random);
    FrictionSample turned = s;
    const auto size = static_cast<Eigen::Index>(s.b.size());
    Eigen::MatrixXd R = Eigen::MatrixXd::Identity(size, size);
    const double c = std::cos(0.1 + n), d = std::sin(0.1 + n);
    R.block<2, 2>(1, 1) << c, -d, d, c;
    Eigen::Map<Eigen::MatrixXd> A(turned.A.data(), size, size);
    A = (R * A * R.transpose()).eval();
    Eigen::Map<Eigen::VectorXd> b(turned.b.data(), size);
    b = (R * b).eval();
    for (const FrictionMethod method : {FrictionMethod::kProximal, FrictionMethod::kBlockGaussSeidel}) {
      const FrictionOptions options{.method = method, .tolerance = 1e-11, .max_sweeps = 5000};
      const SolvedCones first = solve(s, solver, options), second = solve(turned, solver, options);
      ASSERT_EQ(first.result.status, SolveStatus::kSolved);
      const Eigen::VectorXd f = Eigen::Map<const Eigen::VectorXd>(first.f.data(), size);
      EXPECT_LT((R * f - Eigen::Map<const Eigen::VectorXd>(second.f.data(), size)).norm(), kVelocity * (1.0 + f.norm()))
          << n;
    }
  }
}

TEST(FrictionCone, ProximalMethodObeysCoulombsLaw) {
  std::mt19937 random(2);
  FrictionSolver solver;
  int solved_count = 0;
  constexpr int kSamples = 200;
  for (int n = 0; n < kSamples; ++n) {
    const double mu = n % 4 == 0 ? 0.0 : 0.2 * (n % 7);
    const FrictionSample s = make_friction(1 + n % 16, n % 24, mu, random);
    const SolvedCones solved = solve(s, solver, {.tolerance = 1e-10, .max_sweeps = 2000});
    solved_count += solved.result.status == SolveStatus::kSolved;
    if (solved.result.status != SolveStatus::kSolved) continue;
    EXPECT_LT(violation_of_coulomb(s, solved), 1e-6) << n << " m " << s.contacts << " mu " << mu;
  }
  // Points and normals at random with friction up to 1.2 are far harder than what rests on something: there the law may
  // have no solution that these iterations reach, and the result says so.
  RecordProperty("solved_of_200", solved_count);
  EXPECT_GE(solved_count, kSamples * 98 / 100);
}

/// The sample with every contact twice.
FrictionSample twice(const FrictionSample& s) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> G(s.G.data(), 3 * s.contacts, s.columns);
  const Eigen::Map<const Eigen::VectorXd> b(s.b.data(), 3 * s.contacts);
  return testing::friction_sample_of(G.replicate(2, 1), b.replicate(2, 1), s.mu.front());
}

/// A stack at rest whose every other box is heavier by a factor.
FrictionSample stack_of_uneven_boxes(int boxes, double mass_ratio) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const FrictionSample s = make_stack(boxes, 0.02, 0.5);
  Eigen::MatrixXd G = Eigen::Map<const RowMajor>(s.G.data(), 3 * s.contacts, s.columns);
  for (int box = 1; box < boxes; box += 2) G.middleCols(6 * box, 6) /= std::sqrt(mass_ratio);
  return testing::friction_sample_of(G, Eigen::Map<const Eigen::VectorXd>(s.b.data(), 3 * s.contacts), 0.5);
}

TEST(FrictionCone, RedundantContactsAndUnevenMassesSettle) {
  // The matrices are singular, and for uneven masses nearly so where they are not.
  constexpr int kSamples = 60;
  constexpr double kRatio = 1e4;
  std::mt19937 random(8);
  FrictionSolver solver;
  int settled = 0;
  for (int n = 0; n < kSamples; ++n) {
    const FrictionSample s = twice(make_friction(1 + n % 10, n % 24, 0.1 * (n % 8), random));
    const SolvedCones solved = solve(s, solver, {.tolerance = 1e-9});
    settled += solved.result.status == SolveStatus::kSolved;
    EXPECT_LT(violation_of_coulomb(s, solved), 1e-6) << n;
  }
  EXPECT_EQ(settled, kSamples);
  for (int boxes = 1; boxes <= 10; ++boxes) {
    const FrictionSample s = stack_of_uneven_boxes(boxes, kRatio);
    const SolvedCones solved = solve(s, solver, {.tolerance = 1e-9});
    EXPECT_EQ(solved.result.status, SolveStatus::kSolved) << boxes << " residual " << solved.result.residual;
    EXPECT_LT(solved.u.cwiseAbs().maxCoeff(), kVelocity) << boxes;  // it stands
  }
}

TEST(FrictionCone, ForcesNeverAddEnergy) {
  std::mt19937 random(3);
  FrictionSolver solver;
  for (int n = 0; n < 100; ++n) {
    const FrictionSample s = make_friction(1 + n % 12, n % 20, 0.6, random);
    for (const FrictionMethod method : {FrictionMethod::kProximal, FrictionMethod::kBlockGaussSeidel}) {
      const SolvedCones solved = solve(s, solver, {.method = method, .tolerance = 1e-10, .max_sweeps = 2000});
      double energy = 0.0, size = 0.0;
      for (std::size_t i = 0; i < s.b.size(); ++i) {
        energy += 0.5 * solved.f[i] * (s.b[i] + solved.u[static_cast<Eigen::Index>(i)]);
        size += std::abs(solved.f[i] * s.b[i]);
      }
      EXPECT_LE(energy, kVelocity * size) << n;
    }
  }
}

TEST(FrictionCone, BlocksGiveTheFixedPointOfTheFullMatrix) {
  std::mt19937 random(4);
  FrictionSolver solver;
  for (int n = 0; n < 20; ++n) {
    FrictionSample s = make_friction(1 + n % 5, 18, 0.4, random);
    // In every other problem rows yield by themselves besides, those of a contact by different amounts.
    std::vector<double> yields(s.b.size());
    for (std::size_t i = 0; i < yields.size() && n % 2 == 1; ++i) {
      yields[i] = 0.1 * static_cast<double>(1 + i % 4) * s.A[i * yields.size() + i];
      s.A[i * yields.size() + i] += yields[i];
    }
    const FrictionOptions options{
        .method = FrictionMethod::kBlockGaussSeidel, .tolerance = 1e-12, .max_sweeps = 20'000};
    const SolvedCones full = solve(s, solver, options);
    std::vector<double> values, f(s.b.size());
    const auto blocks = blocks_of(s, s.columns, values);
    const BlockFrictionProblem problem{
        .contacts = s.contacts, .columns = s.columns, .blocks = blocks, .D = yields, .b = s.b, .mu = s.mu};
    const SolvedCones exact = solve(s, solver, {.tolerance = 1e-12, .max_sweeps = 20'000});
    for (const FrictionMethod method :
         {FrictionMethod::kBlockGaussSeidel, FrictionMethod::kProximal, FrictionMethod::kSplitting}) {
      std::fill(f.begin(), f.end(), 0.0);
      ASSERT_EQ(solver.solve(problem, f, {.method = method, .tolerance = 1e-12, .max_sweeps = 20'000}).status,
                SolveStatus::kSolved)
          << n;
      for (std::size_t i = 0; i < f.size(); ++i) {
        EXPECT_NEAR(f[i], full.f[i], kVelocity * 10.0) << n;
        EXPECT_NEAR(f[i], exact.f[i], kVelocity * 10.0) << n;
      }
    }
  }
}

TEST(FrictionCone, WithoutFrictionItIsTheComplementaryProblem) {
  std::mt19937 random(5);
  FrictionSolver solver;
  ContactQpSolver normal_solver;
  for (int n = 0; n < 30; ++n) {
    const FrictionSample s = make_friction(2 + n % 8, 12, 0.0, random);
    const SolvedCones solved = solve(s, solver, {.tolerance = 1e-11, .max_sweeps = 5000});
    ASSERT_EQ(solved.result.status, SolveStatus::kSolved);
    const auto m = static_cast<std::size_t>(s.contacts);
    std::vector<double> A(m * m), b(m), f(m);
    for (std::size_t i = 0; i < m; ++i) {
      b[i] = s.b[3 * i];
      for (std::size_t j = 0; j < m; ++j) A[i * m + j] = s.A[3 * i * 3 * m + 3 * j];
    }
    normal_solver.solve(ContactQp{.size = s.contacts, .A = A, .b = b}, f);
    for (std::size_t i = 0; i < m; ++i) {
      double w = b[i];
      for (std::size_t j = 0; j < m; ++j) w += A[i * m + j] * f[j];
      EXPECT_NEAR(solved.velocity(static_cast<int>(i))[0], w, kVelocity) << n;
    }
  }
}

TEST(FrictionCone, AStackOfTenStandsStillOnASlope) {
  FrictionSolver solver;
  const FrictionSample s = make_stack(10, 0.02, 0.5);
  const SolvedCones solved = solve(s, solver, {.tolerance = 1e-9, .max_sweeps = 2000});
  EXPECT_EQ(solved.result.status, SolveStatus::kSolved) << solved.result.residual;
  EXPECT_LT(solved.u.cwiseAbs().maxCoeff(), kVelocity);
  // Once its forces are known, a step costs one look at them.
  std::vector<double> f = solved.f;
  EXPECT_LE(solver.solve(problem_of(s), f, {.tolerance = 2e-9}).sweeps, 2);
}

TEST(FrictionCone, HundredsOfContactsInBlocks) {
  FrictionSolver solver;
  // Eighty boxes in one layer of stacks of four: 320 contacts
  const FrictionSample s = make_stack(4, 0.1, 0.5);
  const int stacks = 20;
  std::vector<double> values, b, mu;
  const auto one = blocks_of(s, 6, values);
  std::vector<FrictionBlock> blocks;
  for (int k = 0; k < stacks; ++k) {
    for (FrictionBlock block : one) {
      block.first_column += k * s.columns;
      blocks.push_back(block);
    }
    b.insert(b.end(), s.b.begin(), s.b.end());
    mu.insert(mu.end(), s.mu.begin(), s.mu.end());
  }
  std::vector<double> f(b.size());
  const BlockFrictionProblem problem{
      .contacts = stacks * s.contacts, .columns = stacks * s.columns, .blocks = blocks, .b = b, .mu = mu};
  for (const FrictionOptions& options :
       {FrictionOptions{.method = FrictionMethod::kBlockGaussSeidel, .tolerance = 1e-6, .max_sweeps = 3000},
        FrictionOptions{.method = FrictionMethod::kSplitting, .tolerance = 1e-6}, FrictionOptions{.tolerance = 1e-9}}) {
    std::fill(f.begin(), f.end(), 0.0);
    const auto result = solver.solve(problem, f, options);
    EXPECT_EQ(result.status, SolveStatus::kSolved) << result.residual << " after " << result.sweeps;
    double weight = 0.0;
    for (std::size_t i = 0; i < f.size(); i += 3) weight += i / 3 % 16 < 4 ? f[i] : 0.0;  // on the ground
    EXPECT_NEAR(weight, 4.0 * stacks * kStep * std::cos(0.1), 1e-3);
  }
}

TEST(FrictionCone, StaggeredProjectionsAgreeWhereTheySettle) {
  std::mt19937 random(6);
  FrictionSolver solver;
  int settled = 0;
  constexpr int kSamples = 60;
  for (int n = 0; n < kSamples; ++n) {
    const FrictionSample s = make_friction(1 + n % 6, 18, 0.3, random);
    const SolvedCones staggered =
        solve(s, solver, {.method = FrictionMethod::kStaggered, .tolerance = 1e-10, .max_sweeps = 500});
    if (staggered.result.status != SolveStatus::kSolved) continue;
    ++settled;
    EXPECT_LT(violation_of_coulomb(s, staggered), 1e-6) << n;
  }
  RecordProperty("settled_of_60", settled);
  EXPECT_GE(settled, kSamples * 9 / 10);
}

TEST(FrictionCone, BadNumbersAreAResultNotAnException) {
  FrictionSolver solver;
  FrictionSample s = make_stack(1, 0.1, 0.5);
  s.b[3] = std::numeric_limits<double>::quiet_NaN();
  const SolvedCones solved = solve(s, solver, {});
  EXPECT_EQ(solved.result.status, SolveStatus::kInvalidInput);
  EXPECT_THAT(solved.f, ::testing::Each(0.0));
  s = make_stack(1, 0.1, -0.5);
  EXPECT_EQ(solve(s, solver, {}).result.status, SolveStatus::kInvalidInput);
  s.mu.pop_back();
  std::vector<double> f(12);
  EXPECT_THROW(solver.solve(problem_of(s), f), InvalidArgument);
}

TEST(FrictionCone, SameBitsEveryTimeAndNoAllocationOnceWarm) {
  std::mt19937 random(7);
  FrictionSolver solver, other;
  const FrictionSample large = make_friction(12, 10, 0.5, random), small = make_friction(4, 20, 0.5, random);
  for (const FrictionMethod method : kMethods) {
    const FrictionOptions options{.method = method, .max_sweeps = 50};
    const SolvedCones first = solve(small, solver, options);
    solve(large, other, options);
    EXPECT_EQ(solve(small, other, options).f, first.f);
    std::vector<double> f(large.b.size());
    const long before = testing::allocations();
    other.solve(problem_of(large), f, options);
    EXPECT_EQ(testing::allocations(), before) << static_cast<int>(method);
  }
}

TEST(FrictionCone, BlocksGiveTheSameBitsEveryTimeAndDoNotAllocateOnceWarm) {
  FrictionSolver solver;
  const FrictionSample large = make_stack(6, 0.1, 0.5), small = make_stack(2, 0.3, 0.4);
  std::vector<double> large_values, small_values;
  const auto large_blocks = blocks_of(large, 6, large_values), small_blocks = blocks_of(small, 6, small_values);
  const auto solve_blocks = [&](const FrictionSample& s, const std::vector<FrictionBlock>& blocks,
                                const FrictionOptions& options, std::vector<double>& f) {
    std::ranges::fill(f, 0.0);
    solver.solve({.contacts = s.contacts, .columns = s.columns, .blocks = blocks, .b = s.b, .mu = s.mu}, f, options);
  };
  for (const FrictionMethod method :
       {FrictionMethod::kProximal, FrictionMethod::kBlockGaussSeidel, FrictionMethod::kSplitting}) {
    const FrictionOptions options{.method = method, .max_sweeps = 50};
    std::vector<double> first(small.b.size()), again(small.b.size()), f(large.b.size());
    solve_blocks(small, small_blocks, options, first);
    solve_blocks(large, large_blocks, options, f);
    const long before = testing::allocations();
    solve_blocks(small, small_blocks, options, again);
    solve_blocks(large, large_blocks, options, f);
    EXPECT_EQ(testing::allocations(), before) << static_cast<int>(method);
    EXPECT_EQ(first, again) << static_cast<int>(method);
  }
}

TEST(FrictionCone, EachMethodRefusesTheFormThatItDoesNotSolve) {
  FrictionSolver solver;
  const FrictionSample s = make_stack(1, 0.1, 0.5);
  std::vector<double> values, f(s.b.size());
  const auto blocks = blocks_of(s, 6, values);
  EXPECT_THROW(solver.solve(problem_of(s), f, {.method = FrictionMethod::kSplitting}), InvalidArgument);
  EXPECT_THROW(
      solver.solve(
          BlockFrictionProblem{.contacts = s.contacts, .columns = s.columns, .blocks = blocks, .b = s.b, .mu = s.mu}, f,
          {.method = FrictionMethod::kStaggered}),
      InvalidArgument);
}

}  // namespace
}  // namespace limber
