#include "soak_laws.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limber::testing {
namespace {

constexpr double kImpulseDigits = 1e-6;      // of Σ m g Δt
constexpr double kHandDigits = 1e-6;         // of the largest force
constexpr double kIndentationDigits = 1e-3;  // of the bound: compliances are stored in single precision
constexpr double kRise = 1e-2;               // of Σ m g size

bool is_finite(const SoakStep& step) {
  const auto contact_is = [](const ContactEvent& c) { return c.impulse.allFinite() && c.normal.allFinite(); };
  const auto hand_is = [](const SeenHand& h) { return h.force.allFinite() && std::isfinite(h.work); };
  const auto indentation_is = [](const SeenIndentation& d) { return std::isfinite(d.largest); };
  return step.finite && std::isfinite(step.energy) && std::ranges::all_of(step.contacts, contact_is) &&
         std::ranges::all_of(step.hands, hand_is) && std::ranges::all_of(step.indentations, indentation_is);
}

void see_contacts(const SoakStep& step, double& push, double& cone) {
  const double digits = kImpulseDigits * step.weight * step.length;
  for (const ContactEvent& contact : step.contacts) {
    const double along = contact.normal.dot(contact.impulse);
    const double across = (contact.impulse - along * contact.normal).norm();
    push = std::max(push, -along / digits);
    cone = std::max(cone, across / (step.friction * std::max(along, 0.0) + digits));
  }
}

double see_indentations(const SoakStep& step) {
  double worst = 0.0;
  for (const SeenIndentation& indentation : step.indentations) {
    double force = 0.0;
    for (const ContactEvent& contact : step.contacts)
      if (contact.a == indentation.body || contact.b == indentation.body) force += contact.impulse.norm() / step.length;
    const double bound = (1.0 + kIndentationDigits) * indentation.compliance * force;
    if (indentation.largest > 0.0) worst = std::max(worst, indentation.largest / bound);
  }
  return worst;
}

double see_hands(const SoakStep& step) {
  double worst = 0.0;
  for (const SeenHand& hand : step.hands)
    worst = std::max(worst, hand.force.cwiseAbs().maxCoeff() / ((1.0 + kHandDigits) * hand.max_force));
  return worst;
}

}  // namespace

const char* name(SoakLaw law) {
  switch (law) {
    case SoakLaw::kFinite:
      return "finite";
    case SoakLaw::kPush:
      return "push";
    case SoakLaw::kCone:
      return "cone";
    case SoakLaw::kHandForce:
      return "hand force";
    case SoakLaw::kIndentation:
      return "indentation";
    case SoakLaw::kEnergy:
      return "energy";
  }
  return "";
}

double work_of(std::span<const SeenHand> hands) {
  double sum = 0.0;
  for (const SeenHand& hand : hands) sum += hand.work;
  return sum;
}

SoakShares shares_of_laws(const SoakStep& step) {
  SoakShares out;
  const auto share = [&](SoakLaw law) -> double& { return out.by_law[static_cast<std::size_t>(law)]; };
  if (!is_finite(step)) {
    share(SoakLaw::kFinite) = std::numeric_limits<double>::infinity();
    return out;
  }
  see_contacts(step, share(SoakLaw::kPush), share(SoakLaw::kCone));
  share(SoakLaw::kHandForce) = see_hands(step);
  share(SoakLaw::kIndentation) = see_indentations(step);
  share(SoakLaw::kEnergy) = (step.energy - step.energy_before - work_of(step.hands)) / (kRise * step.energy_scale);
  return out;
}

}  // namespace limber::testing
