// One claim for all solvers: the same bits on every instruction set that has fused multiply-add.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "contact_problems.h"
#include "instruction_sets.h"
#include "limber/constraints/contact_qp.h"
#include "limber/constraints/friction_cone.h"
#include "limber/constraints/least_squares.h"
#include "limber/constraints/linear_program.h"

namespace limber {
namespace {

TEST(ConstraintSolvers, SameBitsOnEveryInstructionSet) {
  std::mt19937 random(1);
  const auto s = testing::make_contacts(37, 20, testing::Touching::kAround, random);
  const auto t = testing::make_friction(7, 20, 0.5, random);
  const std::vector<double> metric(26, 0.5);
  std::vector<std::vector<double>> results;
  for_each_instruction_set([&](std::int64_t target) {
    std::vector<double> all, f(s.b.size()), g(t.b.size());
    const auto keep = [&](const std::vector<double>& x) { all.insert(all.end(), x.begin(), x.end()); };
    ContactQpSolver qp;
    qp.solve(ContactQp{.size = s.contacts, .A = s.A, .b = s.b}, f), keep(f);
    f.assign(f.size(), 0.0);
    qp.solve(FactoredContactQp{.size = s.contacts, .dimension = s.dimension, .G = s.G, .b = s.b}, f), keep(f);
    LinearProgramSolver lp;
    lp.solve({.rows = s.contacts, .columns = s.contacts, .A = s.A, .b = s.b}, f), keep(f);
    LeastSquaresSolver least_squares;
    least_squares.factor(s.G, metric, s.contacts);
    least_squares.solve(s.b, f), keep(f);
    FrictionSolver friction;
    friction.solve(FrictionProblem{.contacts = t.contacts, .A = t.A, .b = t.b, .mu = t.mu}, g), keep(g);
    if (has_fused_multiply_add(target)) results.push_back(all);
  });
  for (const auto& result : results) EXPECT_EQ(result, results.front());
}

}  // namespace
}  // namespace limber
