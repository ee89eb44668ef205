// One claim for all solvers: the same bits on every instruction set that has fused multiply-add.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "contact_problems.h"
#include "instruction_sets.h"
#include "limber/core/types.h"
#include "limber/solvers/convex_contact_solver.h"
#include "limber/solvers/least_squares.h"
#include "limber/solvers/row_equilibrium.h"

namespace limber {
namespace {

/// Of one body's contacts with friction, as an island solves for them.
std::vector<double> convex_impulses(const testing::FrictionSample& s) {
  internal::ConvexContactSolver solver;
  solver.begin_structure();
  const std::size_t body = solver.add_node(static_cast<std::size_t>(s.columns));
  std::vector<std::size_t> sides;
  for (int i = 0; i < s.contacts; ++i) {
    solver.add_unit(3, {.compliance = 1e-3, .bound = 0.5});
    sides.push_back(solver.add_side(body));
  }
  solver.end_structure();
  std::size_t at = 0;
  for (std::size_t u = 0; u < sides.size(); ++u)
    for (std::size_t r = 0; r < 3; ++r, ++at) {
      std::copy_n(s.G.data() + at * static_cast<std::size_t>(s.columns), s.columns, solver.values(sides[u]).row(r));
      solver.start(u)[static_cast<int>(r)] = s.b[at];
    }
  EXPECT_EQ(solver.solve({}).status, SolveStatus::kSolved);
  std::vector<double> impulses;
  for (std::size_t u = 0; u < sides.size(); ++u)
    for (int r = 0; r < 3; ++r) impulses.push_back(solver.impulse(u)[r]);
  return impulses;
}

TEST(ConstraintSolvers, SameBitsOnEveryInstructionSet) {
  std::mt19937 random(1);
  const auto s = testing::make_contacts(37, 20, testing::Touching::kAround, random);
  const auto t = testing::make_friction(7, 20, random);
  const std::vector<double> metric(26, 0.5);
  const std::vector<double> none(s.b.size(), 0.0), any(s.b.size(), kUnbounded);
  std::vector<std::vector<double>> results;
  for_each_instruction_set([&](std::int64_t target) {
    std::vector<double> all, f(s.b.size());
    const auto keep = [&](const std::vector<double>& x) { all.insert(all.end(), x.begin(), x.end()); };
    internal::RowEquilibrium equilibrium;
    equilibrium.solve(
        {.dimension = static_cast<std::size_t>(s.dimension), .G = s.G, .b = s.b, .lower = none, .upper = any}, f);
    keep(f);
    LeastSquaresSolver least_squares;
    least_squares.factor(s.G, metric, s.contacts);
    least_squares.solve(s.b, f), keep(f);
    keep(convex_impulses(t));
    if (has_fused_multiply_add(target)) results.push_back(all);
  });
  for (const auto& result : results) EXPECT_EQ(result, results.front());
}

}  // namespace
}  // namespace limber
