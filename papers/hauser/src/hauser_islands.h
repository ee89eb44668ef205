// An island's step by [H03]'s rules, where contacts are among its constraints.
#pragma once

#include <memory>
#include <vector>

#include "held_reaction.h"
#include "island/island_impl.h"
#include "limber/hauser/contact_rule.h"
#include "penalty_contact.h"
#include "row_newton.h"
#include "touch_program.h"
#include "touch_times.h"

namespace limber::internal {

/// Of islands that contacts without a cone act in.
class ProgramIslands final : public IslandParts {
 public:
  ProgramIslands(const ContactRule& rule, std::shared_ptr<ProgramReport> programs)
      : rule_(rule), programs_(std::move(programs)) {}

 protected:
  IslandReport find(const StepPart& part) override;
  void taken() override { programs_->add(found_); }
  double next_cut(const StepPart& part, int cuts) override;
  void refuse_impulses(IslandReport& report) override;

 private:
  ContactRule rule_;
  std::shared_ptr<ProgramReport> programs_;  // of all steps taken
  ProgramReport found_;                      // of the part at hand
  HeldReaction reaction_;
  TouchProgram touch_;
  TouchTimes times_;
  std::vector<ExactMotion> motions_;  // of the members, where a step may be cut
  RowNewton newton_;
};

/// Of all islands: those without contacts, and contacts with a cone, are limber's own solver's.
class HauserIslands final : public IslandSolver {
 public:
  HauserIslands(const ContactRule& rule, std::shared_ptr<ProgramReport> programs)
      : rule_(rule), by_programs_(rule, std::move(programs)), own_(make_island_solver()), at_(own_.get()) {}

  IslandReport step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                    std::span<Constraint* const> constraints, const IslandOptions& options) override;

 private:
  std::span<Constraint* const> choose(std::span<Constraint* const> constraints);
  IslandOptions adapted(IslandOptions options) const;

  ContactRule rule_;
  ProgramIslands by_programs_;
  std::unique_ptr<IslandSolver> own_;
  IslandSolver* at_;  // one of the two, that of the step at hand
  std::vector<Constraint*> constraints_;
  std::vector<std::unique_ptr<PenaltyContact>> springs_;
};

}  // namespace limber::internal
