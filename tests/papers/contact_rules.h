/// @file contact_rules.h
/// Every rule for contacts, for tests of what must hold under all of them.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "limber/hauser/contact_rule.h"

namespace limber::testing {

/// Each method with each friction model, and programs with each guard.
inline std::vector<ContactRule> all_contact_rules() {
  std::vector<ContactRule> rules;
  for (const ContactMethod method : {ContactMethod::kPenalty, ContactMethod::kVelocityProgram,
                                     ContactMethod::kGapProgram, ContactMethod::kComplementary})
    for (const FrictionModel friction :
         {FrictionModel::kCone, FrictionModel::kHeuristic, FrictionModel::kHeuristicNoSlip})
      for (const ProgramGuard guard : {ProgramGuard::kNone, ProgramGuard::kClamp, ProgramGuard::kComplementary}) {
        const ContactRule rule{.method = method, .friction = friction, .guard = guard};
        if (rule.is_program() || guard == ProgramGuard::kClamp) rules.push_back(rule);
      }
  return rules;
}

/// Such as "gap program, heuristic, clamped".
inline std::string name(const ContactRule& rule) {
  constexpr std::array kMethods{"penalty", "velocity program", "gap program", "complementary"};
  constexpr std::array kFriction{"cone", "heuristic", "heuristic and no slip"};
  constexpr std::array kGuards{"as it is", "clamped", "or complementary"};
  return std::string(kMethods[static_cast<std::size_t>(rule.method)]) + ", " +
         kFriction[static_cast<std::size_t>(rule.friction)] + ", " + kGuards[static_cast<std::size_t>(rule.guard)];
}

}  // namespace limber::testing
