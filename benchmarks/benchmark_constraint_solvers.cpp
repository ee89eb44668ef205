// Time of the dense contact and constraint solvers beside Clp, GLPK and a textbook projected Gauss–Seidel. See
// README.md.
#include <benchmark/benchmark.h>
#include <glpk.h>

#include <algorithm>
#include <cmath>
#include <coin/ClpSimplex.hpp>
#include <functional>
#include <random>
#include <vector>

#include "contact_problems.h"
#include "cpu_time.h"
#include "limber/hauser/contact_qp.h"
#include "limber/hauser/linear_program.h"
#include "limber/solvers/least_squares.h"

namespace limber {
namespace {

using testing::ContactSample;
using testing::make_contacts;
using testing::Touching;

constexpr int kModes = 32;  // 38 degrees of freedom
constexpr double kResidual = 1e-10;

/// The same problems for every solver: half with all points on one plane, half with points all around.
const std::vector<ContactSample>& samples(int contacts) {
  static std::vector<std::pair<int, std::vector<ContactSample>>> made;
  for (const auto& [m, list] : made)
    if (m == contacts) return list;
  std::mt19937 random(static_cast<unsigned>(contacts));
  std::vector<ContactSample> list;
  for (int n = 0; n < 10; ++n) {
    // A body that leaves its contacts needs no solver: only problems where one approaches
    ContactSample s = make_contacts(contacts, kModes, n % 2 == 0 ? Touching::kPlane : Touching::kAround, random);
    while (*std::min_element(s.b.begin(), s.b.end()) >= 0.0)
      s = make_contacts(contacts, kModes, n % 2 == 0 ? Touching::kPlane : Touching::kAround, random);
    list.push_back(std::move(s));
  }
  made.emplace_back(contacts, std::move(list));
  return made.back().second;
}

/// Mean over the samples of the least time of each: counter `us`. `solve` gets a sample and room for its forces and
/// says whether it succeeded; samples where it did not are counted and left out of the mean.
void time_solves(benchmark::State& state,
                 const std::function<bool(const ContactSample&, std::vector<double>&)>& solve) {
  const auto& list = samples(static_cast<int>(state.range(0)));
  double total = 0.0;
  int solved = 0;
  for (auto _ : state) {
    total = 0.0, solved = 0;
    for (const ContactSample& s : list) {
      std::vector<double> f(s.b.size());
      const double start = thread_seconds();
      const bool good = solve(s, f);
      const double once = thread_seconds() - start;
      if (!good) continue;
      const int repeats = 1 + static_cast<int>(50e-6 / (once + 1e-7)), passes = once > 5e-3 ? 1 : 20;
      LeastTime time;
      for (int pass = 0; pass < passes; ++pass)
        time.measure([&] {
          for (int r = 0; r < repeats; ++r) benchmark::DoNotOptimize(solve(s, f));
        });
      total += time.seconds() / repeats;
      ++solved;
    }
  }
  state.counters["us"] = solved > 0 ? 1e6 * total / solved : 0.0;
  state.counters["failed"] = static_cast<double>(list.size()) - solved;
}

LinearProgram program_of(const ContactSample& s) {
  return {.rows = s.contacts, .columns = s.contacts, .A = s.A, .b = s.b};
}

void qp(benchmark::State& state) {
  ContactQpSolver solver;
  time_solves(state, [&](const ContactSample& s, std::vector<double>& f) {
    std::fill(f.begin(), f.end(), 0.0);
    return solver.solve(ContactQp{.size = s.contacts, .A = s.A, .b = s.b}, f).residual < kResidual;
  });
}

void qp_factored(benchmark::State& state) {
  ContactQpSolver solver;
  time_solves(state, [&](const ContactSample& s, std::vector<double>& f) {
    std::fill(f.begin(), f.end(), 0.0);
    return solver.solve(FactoredContactQp{.size = s.contacts, .dimension = s.dimension, .G = s.G, .b = s.b}, f)
               .residual < kResidual;
  });
}

/// From the solution for speeds 1 % different: what a resting contact sees from step to step.
void qp_warm(benchmark::State& state) {
  ContactQpSolver solver;
  ContactSample near;
  std::vector<double> guess;
  const ContactSample* made_for = nullptr;
  time_solves(state, [&](const ContactSample& s, std::vector<double>& f) {
    if (made_for != &s) {
      made_for = &s;
      near = s;
      for (std::size_t i = 0; i < s.b.size(); ++i) near.b[i] *= 1.0 + 0.01 * std::sin(static_cast<double>(i));
      guess.assign(f.size(), 0.0);
      solver.solve(ContactQp{.size = s.contacts, .A = s.A, .b = near.b}, guess);
    }
    f = guess;
    return solver.solve(ContactQp{.size = s.contacts, .A = s.A, .b = s.b}, f).residual < kResidual;
  });
}

void lp(benchmark::State& state) {
  LinearProgramSolver solver;
  time_solves(state, [&](const ContactSample& s, std::vector<double>& f) {
    return solver.solve(program_of(s), f).status == SolveStatus::kSolved;
  });
}

/// The model is made before the clock starts: the time of the solve alone, presolve off as for all small problems.
void clp(benchmark::State& state) {
  const ContactSample* made_for = nullptr;
  ClpSimplex model;
  std::vector<double> lower, upper, cost;
  time_solves(state, [&](const ContactSample& s, std::vector<double>&) {
    const int m = s.contacts;
    if (made_for != &s) {
      made_for = &s;
      std::vector<int> starts, index;
      for (int j = 0; j <= m; ++j) starts.push_back(j * m);
      for (int j = 0; j < m * m; ++j) index.push_back(j % m);
      lower.clear();
      for (const double b : s.b) lower.push_back(-b);
      upper.assign(s.b.size(), COIN_DBL_MAX), cost.assign(s.b.size(), 1.0);
      model = ClpSimplex();
      model.setLogLevel(0);
      model.loadProblem(m, m, starts.data(), index.data(), s.A.data(), nullptr, nullptr, cost.data(), lower.data(),
                        upper.data());
    }
    model.allSlackBasis(true);
    model.dual();
    return model.status() == 0;
  });
}

void glpk(benchmark::State& state) {
  glp_term_out(GLP_OFF);
  const ContactSample* made_for = nullptr;
  glp_prob* problem = nullptr;
  time_solves(state, [&](const ContactSample& s, std::vector<double>&) {
    if (made_for != &s) {
      made_for = &s;
      if (problem) glp_delete_prob(problem);
      problem = glp_create_prob();
      glp_add_rows(problem, s.contacts), glp_add_cols(problem, s.contacts);
      std::vector<int> index(s.b.size() + 1);
      std::vector<double> row(s.b.size() + 1);
      for (int j = 1; j <= s.contacts; ++j) {
        index[static_cast<std::size_t>(j)] = j;
        glp_set_col_bnds(problem, j, GLP_LO, 0.0, 0.0), glp_set_obj_coef(problem, j, 1.0);
      }
      for (int i = 1; i <= s.contacts; ++i) {
        glp_set_row_bnds(problem, i, GLP_LO, -s.b[static_cast<std::size_t>(i) - 1], 0.0);
        std::copy_n(s.A.begin() + (i - 1) * s.contacts, s.contacts, row.begin() + 1);
        glp_set_mat_row(problem, i, s.contacts, index.data(), row.data());
      }
    }
    glp_std_basis(problem);
    glp_simplex(problem, nullptr);
    return glp_get_status(problem) == GLP_OPT;
  });
  glp_delete_prob(problem);
}

/// f_i ← max(0, f_i − w_i/A_ii) until the complementarity, scaled as ContactQpResult::residual, is `residual`.
bool projected_gauss_seidel(const ContactSample& s, std::vector<double>& f, double residual) {
  constexpr int kMaxSweeps = 20'000;
  const std::size_t m = s.b.size();
  std::fill(f.begin(), f.end(), 0.0);
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    double change = 0.0, size = 0.0;
    for (std::size_t i = 0; i < m; ++i) {
      const double* row = s.A.data() + i * m;
      double w = s.b[i];
      for (std::size_t j = 0; j < m; ++j) w += row[j] * f[j];
      const double root = std::sqrt(row[i]), next = std::max(0.0, f[i] - w / row[i]);
      change = std::max(change, std::abs(next - f[i]) * root);
      f[i] = next;
      size = std::max({size, std::abs(s.b[i]) / root, next * root});
    }
    if (change <= residual * size) return true;
  }
  return false;
}

void gauss_seidel(benchmark::State& state) {
  time_solves(state,
              [](const ContactSample& s, std::vector<double>& f) { return projected_gauss_seidel(s, f, kResidual); });
}
void gauss_seidel_1e4(benchmark::State& state) {
  time_solves(state, [](const ContactSample& s, std::vector<double>& f) { return projected_gauss_seidel(s, f, 1e-4); });
}

/// range(0) dragged points (three rows each) over range(1) degrees of freedom.
struct Handles {
  int rows, columns;
  std::vector<double> J, metric, r, f;

  explicit Handles(const benchmark::State& state)
      : rows(3 * static_cast<int>(state.range(0))), columns(static_cast<int>(state.range(1))) {
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    J.resize(static_cast<std::size_t>(rows * columns)), r.resize(static_cast<std::size_t>(rows)), f.resize(r.size());
    for (double& x : J) x = normal(random);
    for (double& x : r) x = normal(random);
    for (int j = 0; j < columns; ++j) metric.push_back(1.0 / (1.0 + j));
  }
};

void time_handles(benchmark::State& state, const std::function<void()>& solve) {
  LeastTime time;
  const int repeats = 1 + 300 / static_cast<int>(state.range(0));
  for (auto _ : state)
    time.measure([&] {
      for (int r = 0; r < repeats; ++r) solve();
    });
  state.counters["us"] = 1e6 * time.seconds() / repeats;
}

void handles(benchmark::State& state) {
  Handles h(state);
  LeastSquaresSolver solver;
  time_handles(state, [&] {
    solver.factor(h.J, h.metric, h.rows);
    solver.solve(h.r, h.f);
  });
}

void handles_new_target(benchmark::State& state) {
  Handles h(state);
  LeastSquaresSolver solver;
  solver.factor(h.J, h.metric, h.rows);
  time_handles(state, [&] { solver.solve(h.r, h.f); });
}

void contact_counts(benchmark::internal::Benchmark* b) {
  b->ArgName("contacts")->Iterations(1);
  for (int m = 1; m <= 128; m *= 2) b->Arg(m);
}
void handle_counts(benchmark::internal::Benchmark* b) {
  b->ArgNames({"points", "dof"});
  for (const int k : {32, 40, 64})
    for (const int points : {10, 100, 300}) b->Args({points, k});
}

BENCHMARK(qp)->Apply(contact_counts);
BENCHMARK(qp_factored)->Apply(contact_counts);
BENCHMARK(qp_warm)->Apply(contact_counts);
BENCHMARK(lp)->Apply(contact_counts);
BENCHMARK(clp)->Apply(contact_counts);
BENCHMARK(glpk)->Apply(contact_counts);
BENCHMARK(gauss_seidel)->Apply(contact_counts);
BENCHMARK(gauss_seidel_1e4)->Apply(contact_counts);
BENCHMARK(handles)->Apply(handle_counts);
BENCHMARK(handles_new_target)->Apply(handle_counts);

}  // namespace
}  // namespace limber
