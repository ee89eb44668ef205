/// @file limber/hauser/contact_program.h
/// Contacts by [H03]'s rules: a linear program for the normals (linear_program.h) and its guard (energy_guard.h), a
/// heuristic for friction after it.
#pragma once

#include <span>
#include <vector>

#include "limber/hauser/contact_qp.h"
#include "limber/hauser/energy_guard.h"
#include "limber/hauser/linear_program.h"

namespace limber {

/// What happens to a linear program's answer that would add energy (energy_guard.h). It judges the normals' work; what
/// heuristic friction adds is left to the caller's.
enum class ProgramGuard {
  kNone,           ///< it stays, as in [H03]
  kClamp,          ///< the largest part of it that adds none, blended with the complementary answer
  kComplementary,  ///< the complementary answer takes its place
};

struct ContactProgramRule {
  bool least_sum = true;    ///< normals by the linear program; else complementary
  bool stops_slip = false;  ///< after friction once more all together, without slip where it stayed below μ f_n
  ProgramGuard guard = ProgramGuard::kClamp;
};

/// The results of a step's linear programs; at gap level those of the last iteration.
struct ProgramReport {
  EnergyGuardReport guard{};  ///< of solves with at least one force, whatever ProgramGuard does with the answer
  long different = 0;         ///< of guard.solves: another energy than the complementary answer, by 1e-6 of it
  long relaxed = 0;           ///< programs without a solution: slack was bought
  void add(const ProgramReport& other);
};

/// w = A f + b of contacts and rows with an interval each; impulses and gaps, impulses and speeds, or forces and
/// accelerations.
struct ContactProblem {
  int cones = 0;                          ///< the first 3 × cones rows: normal and two tangents each
  std::span<const double> A = {};         ///< n × n, symmetric positive semidefinite
  std::span<const double> b = {};         ///< n
  std::span<const double> friction = {};  ///< μ ≥ 0 of each cone
  std::span<const double> lower = {};     ///< n; those of cones are not read
  std::span<const double> upper = {};     ///< n
  std::span<const double> gap_before;     ///< n, gap level only: gaps at the step's start, less their offsets
  double step = 0.0;                      ///< s, gap level only
};

class ContactProgramSolver {
 public:
  /// @param f n, on return within bounds. @param report gets the normals' program, if the rule has one
  SolveStatus solve(const ContactProblem& problem, const ContactProgramRule& rule, std::span<double> f,
                    ProgramReport& report);

 private:
  void choose_rows(const ContactProblem& problem);
  SolveStatus solve_normals(const ContactProblem& problem, const ContactProgramRule& rule, std::span<double> f,
                            ProgramReport& report);
  void guard(const ContactProblem& problem, const ContactProgramRule& rule, ProgramReport& report);
  void solve_rest(const ContactProblem& problem, std::span<double> f);
  void add_friction(const ContactProblem& problem, std::span<double> f);
  SolveStatus stop_slip(const ContactProblem& problem, std::span<double> f);
  void take_part(const ContactProblem& problem, std::span<const std::size_t> part, std::span<const double> f);

  std::vector<std::size_t> one_sided_, rest_;  // rows of normals and stops; with an interval
  std::vector<double> A_, b_, gap_, lower_, upper_, f_program_, f_complementary_, last_, product_;
  ContactQpSolver qp_;
  LinearProgramSolver program_;
};

}  // namespace limber
