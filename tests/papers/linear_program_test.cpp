// The simplex against Clp and GLPK, and by the optimality conditions.
#include "limber/hauser/linear_program.h"

#include <glpk.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <coin/ClpSimplex.hpp>
#include <limits>
#include <random>
#include <vector>

#include "contact_problems.h"
#include "counted_new.h"
#include "limber/core/error.h"
#include "limber/hauser/contact_qp.h"
#include "limber/hauser/energy_guard.h"

namespace limber {
namespace {

using testing::ContactSample;
using testing::make_contacts;
using testing::Touching;

struct Sample {
  int rows = 0, columns = 0;
  std::vector<double> A = {}, b = {}, c = {};
  LinearProgram program() const { return {.rows = rows, .columns = columns, .A = A, .b = b, .c = c}; }
};

struct Oracle {
  bool feasible = false;
  double objective = 0.0;
};

Oracle clp(const Sample& s) {
  std::vector<int> starts, index;
  std::vector<double> lower(s.b.size()), upper(s.b.size(), COIN_DBL_MAX);
  for (std::size_t i = 0; i < s.b.size(); ++i) lower[i] = -s.b[i];
  const auto n = static_cast<std::size_t>(s.columns), r = static_cast<std::size_t>(s.rows);
  std::vector<double> values;
  for (std::size_t j = 0; j <= n; ++j) starts.push_back(static_cast<int>(j * r));
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = 0; i < r; ++i) index.push_back(static_cast<int>(i)), values.push_back(s.A[i * n + j]);
  ClpSimplex model;
  model.setLogLevel(0);
  model.setPrimalTolerance(1e-10);
  model.setDualTolerance(1e-10);
  model.loadProblem(s.columns, s.rows, starts.data(), index.data(), values.data(), nullptr, nullptr, s.c.data(),
                    lower.data(), upper.data());
  model.dual();
  return {model.status() == 0, model.objectiveValue()};
}

Oracle glpk(const Sample& s) {
  glp_term_out(GLP_OFF);
  glp_prob* problem = glp_create_prob();
  glp_set_obj_dir(problem, GLP_MIN);
  glp_add_rows(problem, s.rows);
  glp_add_cols(problem, s.columns);
  std::vector<int> index(static_cast<std::size_t>(s.columns) + 1);
  std::vector<double> row(index.size());
  for (int j = 1; j <= s.columns; ++j) {
    index[static_cast<std::size_t>(j)] = j;
    glp_set_col_bnds(problem, j, GLP_LO, 0.0, 0.0);
    glp_set_obj_coef(problem, j, s.c[static_cast<std::size_t>(j) - 1]);
  }
  for (int i = 1; i <= s.rows; ++i) {
    glp_set_row_bnds(problem, i, GLP_LO, -s.b[static_cast<std::size_t>(i) - 1], 0.0);
    std::copy_n(s.A.begin() + (i - 1) * s.columns, s.columns, row.begin() + 1);  // GLPK counts from 1
    glp_set_mat_row(problem, i, s.columns, index.data(), row.data());
  }
  glp_smcp parameters;
  glp_init_smcp(&parameters);
  parameters.tol_bnd = parameters.tol_dj = 1e-10;
  glp_simplex(problem, &parameters);
  const Oracle oracle{glp_get_status(problem) == GLP_OPT, glp_get_obj_val(problem)};
  glp_delete_prob(problem);
  return oracle;
}

/// Programs of every kind that the solver is to stand: contacts, degenerate ones, small integers (ties), rectangular.
Sample make_sample(int number, std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::uniform_int_distribution<int> digit(-2, 3), size(1, 12);
  if (number % 4 < 2) {
    const ContactSample contacts =
        make_contacts(size(random), (number / 4) % 12, static_cast<Touching>(number % 3), random);
    Sample s{.rows = contacts.contacts, .columns = contacts.contacts, .A = contacts.A, .b = contacts.b};
    for (int j = 0; j < s.columns; ++j) s.c.push_back(number % 8 < 4 ? 1.0 : std::abs(normal(random)));
    return s;
  }
  Sample s{.rows = size(random), .columns = size(random)};
  for (int i = 0; i < s.rows * s.columns; ++i) s.A.push_back(number % 4 == 2 ? digit(random) : normal(random) + 0.5);
  for (int i = 0; i < s.rows; ++i) s.b.push_back(number % 4 == 2 ? digit(random) : normal(random));
  for (int j = 0; j < s.columns; ++j)
    s.c.push_back(number % 4 == 2 ? std::abs(digit(random)) : std::abs(normal(random)));
  return s;
}

// Ours and the oracles' own tolerances; the oracles work to 1e-10 in each row.
constexpr double kObjective = 1e-9;

TEST(LinearProgram, TenThousandProgramsAgreeWithClpOrGlpk) {
  std::mt19937 random(1);
  LinearProgramSolver solver;
  int infeasible = 0;
  for (int n = 0; n < 10'000; ++n) {
    const Sample s = make_sample(n, random);
    std::vector<double> f(static_cast<std::size_t>(s.columns));
    const auto result = solver.solve(s.program(), f);
    const Oracle oracle = n % 2 == 0 ? clp(s) : glpk(s);
    ASSERT_EQ(result.status == SolveStatus::kSolved, oracle.feasible)
        << n << ": slack " << result.slack << ", pivots " << result.pivots;
    infeasible += !oracle.feasible;
    if (!oracle.feasible) {
      EXPECT_EQ(result.status, SolveStatus::kRelaxed) << n;
      EXPECT_GT(result.slack, 0.0) << n;
      continue;
    }
    EXPECT_NEAR(result.objective, oracle.objective, kObjective * std::max(1.0, std::abs(oracle.objective))) << n;
    EXPECT_LE(result.pivots, 10 * (s.rows + s.columns)) << n;
    EXPECT_GE(*std::min_element(f.begin(), f.end()), 0.0) << n;
  }
  EXPECT_GT(infeasible, 500);  // the generator covers them
  EXPECT_LT(infeasible, 5000);
}

TEST(LinearProgram, LargeRankDeficientContactsAgreeWithClp) {
  std::mt19937 random(2);
  LinearProgramSolver solver;
  for (int n = 0; n < 60; ++n) {
    const ContactSample contacts = make_contacts(20 + 2 * n, 8 * (n % 5), static_cast<Touching>(n % 3), random);
    Sample s{.rows = contacts.contacts, .columns = contacts.contacts, .A = contacts.A, .b = contacts.b};
    s.c.assign(s.b.size(), 1.0);
    std::vector<double> f(s.b.size());
    const auto result = solver.solve(s.program(), f);
    const Oracle oracle = clp(s);
    ASSERT_TRUE(oracle.feasible) << n;
    ASSERT_EQ(result.status, SolveStatus::kSolved) << n << ": slack " << result.slack << " after " << result.pivots;
    EXPECT_NEAR(result.objective, oracle.objective, kObjective * std::max(1.0, oracle.objective)) << n;
  }
}

TEST(LinearProgram, TwoUnequalContactsPushWhereItIsCheap) {
  LinearProgramSolver solver;
  Sample s{.rows = 2, .columns = 2, .A = {1, 9, 9, 100}, .b = {-1, 0}};
  std::vector<double> f(2);
  solver.solve(s.program(), f);
  EXPECT_THAT(f, ::testing::ElementsAre(0.0, ::testing::DoubleEq(1.0 / 9.0)));
  s.A = {1.75, 2.5, 2.5, 4};
  solver.solve(s.program(), f);
  EXPECT_THAT(f, ::testing::ElementsAre(0.0, ::testing::DoubleEq(0.4)));
  // Three contacts of equal mass: the third, not approaching, is pushed
  Sample three{.rows = 3, .columns = 3, .A = {1, .8, .95, .8, 1, .95, .95, .95, 1}, .b = {-1, -1, 0}};
  std::vector<double> g(3);
  solver.solve(three.program(), g);
  constexpr double kRoundOff = 1e-15;
  EXPECT_THAT(g, ::testing::Pointwise(::testing::DoubleNear(kRoundOff), {0.0, 0.0, 1.0 / 0.95}));
}

TEST(LinearProgram, InfeasibleRowsBuyTheLeastSlack) {
  // Two walls that come together by ½: whatever f, the sum of the rows is −½.
  LinearProgramSolver solver;
  const Sample s{.rows = 2, .columns = 2, .A = {1, -1, -1, 1}, .b = {-1, 0.5}};
  std::vector<double> f(2);
  const auto result = solver.solve(s.program(), f);
  EXPECT_EQ(result.status, SolveStatus::kRelaxed);
  EXPECT_NEAR(std::max(0.0, 1.0 - f[0] + f[1]) + std::max(0.0, -0.5 + f[0] - f[1]), 0.5, 1e-12);
  EXPECT_LE(result.slack, 0.5 + 1e-12);
}

TEST(LinearProgram, SlackBoughtIsTheLeastThatClpFinds) {
  // Clp on min Σt, A f + t + b ≥ 0. Every row's largest entry is 1.5, so that all are priced alike.
  std::mt19937 random(6);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  LinearProgramSolver solver;
  int infeasible = 0;
  for (int n = 0; n < 500; ++n) {
    const int r = 2 + n % 9, columns = 1 + n % 7;
    Sample s{.rows = r, .columns = columns}, with_slack{.rows = r, .columns = columns + r};
    for (int i = 0; i < r; ++i) {
      for (int j = 0; j < columns; ++j) s.A.push_back(j == i % columns ? -1.5 : uniform(random));
      s.b.push_back(uniform(random));
      with_slack.A.insert(with_slack.A.end(), s.A.end() - columns, s.A.end());
      for (int j = 0; j < r; ++j) with_slack.A.push_back(j == i ? 1.0 : 0.0);
    }
    s.c.assign(static_cast<std::size_t>(columns), 1.0);
    with_slack.b = s.b, with_slack.c.assign(static_cast<std::size_t>(columns), 0.0);
    with_slack.c.resize(static_cast<std::size_t>(columns + r), 1.0);
    std::vector<double> f(s.c.size());
    if (solver.solve(s.program(), f).status == SolveStatus::kSolved) continue;
    ++infeasible;
    double slack = 0.0;
    for (std::size_t i = 0; i < s.b.size(); ++i) {
      double w = s.b[i];
      for (std::size_t j = 0; j < f.size(); ++j) w += s.A[i * f.size() + j] * f[j];
      slack += std::max(0.0, -w);
    }
    const Oracle oracle = clp(with_slack);
    ASSERT_TRUE(oracle.feasible);
    EXPECT_NEAR(slack, oracle.objective, kObjective * std::max(1.0, oracle.objective)) << n;
  }
  EXPECT_GT(infeasible, 100);
}

TEST(LinearProgram, CanAddEnergyAndTheGuardTakesItOut) {
  std::mt19937 random(4);
  LinearProgramSolver program;
  ContactQpSolver complementary;
  EnergyGuardReport report;
  int gains = 0, differ = 0;
  constexpr int kSamples = 1000;
  for (int n = 0; n < kSamples; ++n) {
    const ContactSample s = make_contacts(2 + n % 12, (n / 12) % 20, static_cast<Touching>(n % 2), random);
    std::vector<double> f_lp(s.b.size()), f_lcp(s.b.size()), f(s.b.size());
    ASSERT_EQ(program.solve({.rows = s.contacts, .columns = s.contacts, .A = s.A, .b = s.b}, f_lp).status,
              SolveStatus::kSolved);
    complementary.solve(ContactQp{.size = s.contacts, .A = s.A, .b = s.b}, f_lcp);
    const auto guarded = guard_energy(ImpulseWork{.A = s.A, .b = s.b}, f_lp, f_lcp, f);
    report.add(guarded);
    double size = 1e-3;
    for (std::size_t i = 0; i < f.size(); ++i) size += std::abs(f_lcp[i] * s.b[i]) + std::abs(f_lp[i] * s.b[i]);
    gains += guarded.energy_program > 1e-9 * size;
    differ += std::abs(guarded.energy_program - guarded.energy_complementary) > 1e-9 * size;
    EXPECT_LE(guarded.energy, 1e-12 * size) << n;
    EXPECT_LE(guarded.energy_complementary, 1e-12 * size) << n;
  }
  // A few per cent and about half in published and in our own larger runs: here only that both happen.
  EXPECT_GT(gains, kSamples / 200);
  EXPECT_LT(gains, kSamples / 4);
  EXPECT_GT(differ, kSamples / 10);
  EXPECT_GE(report.clamped, gains);
  RecordProperty("energy_gains_per_1000", gains);
  RecordProperty("differ_per_1000", differ);
}

TEST(LinearProgram, NumbersThatAreNotFiniteAreAResultNotAnException) {
  LinearProgramSolver solver;
  Sample s{.rows = 1, .columns = 1, .A = {std::numeric_limits<double>::quiet_NaN()}, .b = {-1}, .c = {1}};
  std::vector<double> f = {5.0};
  EXPECT_EQ(solver.solve(s.program(), f).status, SolveStatus::kInvalidInput);
  EXPECT_EQ(f[0], 0.0);
  s.A = {1}, s.c = {-1};
  EXPECT_EQ(solver.solve(s.program(), f).status, SolveStatus::kInvalidInput);
  s.b = {1, 2};
  EXPECT_THROW(solver.solve(s.program(), f), InvalidArgument);
}

TEST(LinearProgram, SameBitsEveryTimeAndNoAllocationOnceWarm) {
  std::mt19937 random(5);
  LinearProgramSolver solver, other;
  const ContactSample large = make_contacts(40, 20, Touching::kDuplicates, random);
  const ContactSample small = make_contacts(25, 30, Touching::kPlane, random);
  const auto program = [](const ContactSample& s) {
    return LinearProgram{.rows = s.contacts, .columns = s.contacts, .A = s.A, .b = s.b};
  };
  std::vector<double> f(25), g(25), h(40);
  solver.solve(program(small), f);
  other.solve(program(large), h);
  other.solve(program(small), g);
  EXPECT_EQ(f, g);
  const long before = testing::allocations();
  other.solve(program(large), h);
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace limber
