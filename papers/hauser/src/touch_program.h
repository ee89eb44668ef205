// [H03]'s second method: the impulses of least sum that stop what touches, then the forces of least sum that hold what
// rests, by velocities and accelerations as they are at the step's start.
#pragma once

#include <span>
#include <vector>

#include "held_reaction.h"
#include "island/island_step.h"
#include "limber/hauser/contact_rule.h"

namespace limber::internal {

class TouchProgram {
 public:
  /// Changes the bodies' velocities by step.touch_impulse, and makes the contacts' rows ask for the forces found.
  void solve(IslandStep& step, HeldReaction& reaction, const ContactRule& rule, ProgramReport& report);
  /// Rows of contacts get what was found, and nothing else.
  void hold_forces(ConstraintRows& rows, double length) const;

 private:
  void choose_touching(const IslandStep& step, const HeldReaction& reaction, bool resting);
  void assemble(const IslandStep& step);
  void find_bias(const IslandStep& step);
  double speed(const IslandStep& step, const HeldReaction& reaction, Index row) const;
  double acceleration(const IslandStep& step, const HeldReaction& reaction, Index row) const;
  void solve_touching(const IslandStep& step, const ContactRule& rule, std::vector<double>& into,
                      ProgramReport& report);
  static void apply(IslandStep& step);

  std::vector<double> force_;    // N, by row, held over the step
  std::vector<Index> touching_;  // rows, three for each contact with friction
  std::vector<double> J_, metric_, mu_, A_, b_, f_, lower_, upper_, bias_;
  ContactProgramSolver programs_;
};

}  // namespace limber::internal
