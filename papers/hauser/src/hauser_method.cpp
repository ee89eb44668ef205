#include "limber/hauser/hauser_method.h"

#include <cmath>
#include <string>
#include <vector>

#include "hauser_islands.h"
#include "limber/core/error.h"

namespace limber {

void ContactRule::validate() const {
  const auto number = [](double value, const char* name, bool zero) {
    if (!(value >= 0.0) || std::isinf(value) || (value == 0.0 && !zero))
      throw InvalidArgument(std::string("ContactRule: ") + name + " is " + std::to_string(value) +
                            ", expected a finite number " + (zero ? "of at least 0" : "above 0"));
  };
  number(penalty_frequency, "penalty_frequency", false);
  number(penalty_damping, "penalty_damping", true);
}

/// Each solver adds to a report of its own, as islands are solved by several threads.
struct HauserMethod::Shared {
  std::vector<std::shared_ptr<ProgramReport>> reports;
};

HauserMethod::HauserMethod(const ContactRule& rule) : rule_(rule), shared_(std::make_shared<Shared>()) {
  rule.validate();
}

IslandSolverFactory HauserMethod::islands() const {
  return [rule = rule_, shared = shared_]() -> std::unique_ptr<IslandSolver> {
    shared->reports.push_back(std::make_shared<ProgramReport>());
    return std::make_unique<internal::HauserIslands>(rule, shared->reports.back());
  };
}

ContactOptions HauserMethod::contacts(ContactOptions options) const {
  // Loads that many contacts could share in many ways then have one answer that changes little where gaps change by a
  // picometre; what rests sinks by less than this part of g Δt², 8e-6 m at 60 steps a second.
  constexpr double kCompliance = 3e-3;
  const bool by_gaps = rule_.method == ContactMethod::kGapProgram ||
                       (rule_.method == ContactMethod::kComplementary && !rule_.has_cone());
  options.solver = ContactSolver::kExact;
  if (by_gaps) options.compliance = kCompliance;
  if (rule_.method != ContactMethod::kComplementary || !rule_.has_cone()) options.rolling_friction = 0.0;
  return options;
}

ProgramReport HauserMethod::programs() const {
  ProgramReport sum;
  for (const auto& report : shared_->reports) sum.add(*report);
  return sum;
}

}  // namespace limber
