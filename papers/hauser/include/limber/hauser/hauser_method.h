/// @file limber/hauser/hauser_method.h
/// Whole scenes by [H03]'s rules: islands whose contacts are solved for by a ContactRule, in place of limber's own
/// solver.
///
///   HauserMethod method({.method = ContactMethod::kGapProgram});
///   world.set_island_solver(method.islands());
///   world.set_contact_source(&finder, method.contacts());
///
/// Newton's method for the impulses, with the Jacobian of the step's start: equality rows are eliminated, contacts and
/// rows with bounds are the rule's problem (contact_program.h). Loads come half at the step's start and half at its
/// end. Everything else of a step, its cuts and its energy guard, is as island_solver.h says; so are islands without
/// contacts.
#pragma once

#include <memory>

#include "limber/constraints/contact_constraint.h"
#include "limber/constraints/island_solver.h"
#include "limber/hauser/contact_rule.h"

namespace limber {

/// Copies share what programs() tells.
class HauserMethod {
 public:
  /// @throws InvalidArgument see ContactRule::validate()
  explicit HauserMethod(const ContactRule& rule);

  /// Makes island solvers by the rule. They may outlive this object. Called by one thread at a time.
  IslandSolverFactory islands() const;
  /// The options that contacts need beside these solvers: ContactSolver::kExact, whose place they take; the compliance
  /// that makes the forces of redundant contacts unique under kGapProgram, and under kComplementary without the cone;
  /// no rolling resistance but beside the cone.
  ContactOptions contacts(ContactOptions options = {}) const;
  /// Of the linear programs of all steps that islands() solvers have taken so far. Not while a step is under way.
  ProgramReport programs() const;
  const ContactRule& rule() const { return rule_; }

 private:
  struct Shared;
  ContactRule rule_;
  std::shared_ptr<Shared> shared_;
};

}  // namespace limber
