// Which cases there are.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <string_view>
#include <utility>

#include "constants.h"
#include "limber/constraints/contact_constraint.h"
#include "stability_scenes.h"

namespace limber::testing {
namespace {

/// A quantity that is driven to its ends, and whether a scene knows it.
struct Axis {
  std::string_view name;
  std::vector<double> levels;
  void (*set)(StabilityCase& at, double level);
  bool (*in)(StabilityScene scene) = [](StabilityScene) { return true; };
};

bool has_contact(StabilityScene scene) { return scene == StabilityScene::kGround || scene == StabilityScene::kPile; }
bool has_weights(StabilityScene scene) { return scene == StabilityScene::kPile || scene == StabilityScene::kChain; }

const std::vector<Axis>& axes() {
  static const std::vector<Axis> kAxes{
      {"E", {1e2, 1e3, 1e4, 1e6, 1e8, 1e10, 1e12}, [](StabilityCase& c, double x) { c.youngs_modulus = x; }},
      {"nu", {-0.9, -0.5, 0.0, 0.3, 0.45, 0.499}, [](StabilityCase& c, double x) { c.poisson_ratio = x; }},
      {"density", {1.0, 100.0, 1e3, 2e4}, [](StabilityCase& c, double x) { c.density = x; }},
      {"size", {1e-3, 0.1, 1.0, 10.0, 1e3}, [](StabilityCase& c, double x) { c.size = x; }},
      {"sliver_angle", {0.0, 1.0, 0.1}, [](StabilityCase& c, double x) { c.sliver_angle = x; }},
      {"one_tet", {0.0, 1.0}, [](StabilityCase& c, double x) { c.one_tet = x != 0.0; }},
      {"step", {1e-5, 1e-4, 1e-3, 1.0 / 240.0, 1.0 / 60.0, 0.1, 1.0}, [](StabilityCase& c, double x) { c.step = x; }},
      {"varying_step", {0.0, 1.0}, [](StabilityCase& c, double x) { c.varying_step = x != 0.0; }},
      {"pause", {0.0, 3600.0}, [](StabilityCase& c, double x) { c.pause = x; }},
      {"damping", {0.0, 0.02, 1.0, 1e6}, [](StabilityCase& c, double x) { c.damping_ratio = x; }},
      {"modes", {0, 1, 8, 20, kAllModes}, [](StabilityCase& c, double x) { c.modes = static_cast<int>(x); }},
      {"mass_ratio", {1.0, 100.0, 1e4, 1e6}, [](StabilityCase& c, double x) { c.mass_ratio = x; }, has_weights},
      {"friction", {0.0, 0.5, 2.0}, [](StabilityCase& c, double x) { c.friction = x; }, has_contact},
      {"gravity", {0.0, 1.0, 1e3}, [](StabilityCase& c, double x) { c.gravity = x; }},
      {"speed",
       {0.0, 10.0, 100.0, 1e3},
       [](StabilityCase& c, double x) { c.speed = x; },
       [](StabilityScene s) { return s == StabilityScene::kGround; }},
      {"spin",
       {0.0, 10.0, 1e3, 1e4},
       [](StabilityCase& c, double x) { c.spin = x; },
       [](StabilityScene s) { return s == StabilityScene::kFlight; }},
      {"pull",
       {0.0, 1.0, 100.0},
       [](StabilityCase& c, double x) { c.pull = x; },
       [](StabilityScene s) { return s == StabilityScene::kHandle; }},
      {"far_away", {0.0, 1e4, 1e7}, [](StabilityCase& c, double x) { c.far_away = x; }},
      {"recovery_speed",
       {0.0, ContactOptions{}.recovery_speed},
       [](StabilityCase& c, double x) { c.recovery_speed = x; },
       has_contact},
  };
  return kAxes;
}

constexpr std::array kScenes{StabilityScene::kFlight, StabilityScene::kGround, StabilityScene::kPile,
                             StabilityScene::kHandle, StabilityScene::kChain};

}  // namespace

const char* name(StabilityScene scene) {
  constexpr std::array<const char*, kStabilityScenes> kNames{"flight", "ground", "pile", "handle", "chain"};
  return kNames[static_cast<std::size_t>(scene)];
}

const char* name(StabilityFault fault) {
  constexpr std::array<const char*, kStabilityFaults> kNames{"not finite", "energy",   "passed",   "overlap",
                                                             "off target", "momentum", "unsettled"};
  return kNames[static_cast<std::size_t>(fault)];
}

unsigned faults(const StabilityCase& at, const StabilityResult& r) {
  constexpr double kExactRise = 1e-6, kGameRise = 1e-2, kOff = 1e-6, kMomentum = 1e-9, kUnsettled = 0.01;
  const double rounding = kEpsilon * at.far_away / at.size, digits = 16.0 * rounding;  // of a place, in parts of a bar
  const bool recovers = has_contact(at.scene) && at.recovery_speed > 0.0;
  unsigned bits = 0;
  const auto judge = [&](StabilityFault fault, bool at_fault) {
    if (at_fault) bits |= 1u << static_cast<unsigned>(fault);
  };
  judge(StabilityFault::kNotFinite, !r.finite);
  const double rise =
      (at.substeps > 0 ? kGameRise : kExactRise) + (16.0 + r.steps) * r.energy_digits;  // each step rounds it
  judge(StabilityFault::kEnergy, !recovers && (r.total_rise > rise || r.node_total_rise > rise + 2.0 * r.spin_bound));
  judge(StabilityFault::kPassed, r.passed);
  judge(StabilityFault::kOverlap, r.rest_overlap > kMostOverlap);
  judge(StabilityFault::kOffTarget, r.off_target > kOff + digits);
  judge(StabilityFault::kMomentum, r.momentum_error > kMomentum + digits + r.steps * rounding);  // each step rounds it
  judge(StabilityFault::kUnsettled, r.unsettled > kUnsettled * r.steps);
  return bits;
}

std::vector<std::pair<const char*, double>> coordinates(const StabilityCase& c) {
  return {{"E", c.youngs_modulus},
          {"nu", c.poisson_ratio},
          {"density", c.density},
          {"size", c.size},
          {"sliver_angle", c.sliver_angle},
          {"one_tet", c.one_tet},
          {"step", c.step},
          {"varying_step", c.varying_step},
          {"pause", c.pause},
          {"damping", c.damping_ratio},
          {"modes", c.modes},
          {"mass_ratio", c.mass_ratio},
          {"friction", c.friction},
          {"gravity", c.gravity},
          {"speed", c.speed},
          {"spin", c.spin},
          {"pull", c.pull},
          {"far_away", c.far_away},
          {"recovery_speed", c.recovery_speed},
          {"substeps", c.substeps}};
}

StabilityCase simplified(StabilityCase at, const std::function<bool(const StabilityCase&)>& is_alike) {
  const auto usual = coordinates({});
  for (const Axis& axis : axes()) {
    const auto named = [&](const auto& quantity) { return axis.name == quantity.first; };
    StabilityCase simpler = at;
    axis.set(simpler, std::find_if(usual.begin(), usual.end(), named)->second);
    if (coordinates(simpler) != coordinates(at) && is_alike(simpler)) at = simpler;
  }
  return at;
}

std::string text(const StabilityCase& c) {
  const auto usual = coordinates({}), here = coordinates(c);
  std::string out = name(c.scene);
  for (std::size_t i = 0; i < here.size(); ++i)
    if (here[i].second != usual[i].second) out += fmt::format(", {} {:g}", here[i].first, here[i].second);
  return out;
}

bool bullet_can(const StabilityCase& c) {
  const bool alone = c.scene == StabilityScene::kFlight || c.scene == StabilityScene::kGround;
  return alone && c.modes > 0 && c.far_away == 0.0 && c.pause == 0.0;
}

std::vector<StabilityCase> energy_grid(double recovery_speed) {
  std::vector<StabilityCase> grid;
  for (const StabilityScene scene : kScenes)
    for (const double modulus : {1e2, 1e4, 1e6, 1e8, 1e10, 1e12})
      for (const double poisson : {0.3, 0.499})
        for (const double step : {1e-4, 1e-3, 1.0 / 60.0, 0.1})
          for (const double damping : {0.0, 0.02, 2.0})
            for (const int modes : {0, 8, 20, 64})
              for (const double ratio : {1.0, 1e4}) {
                if (scene == StabilityScene::kFlight || (ratio != 1.0 && !has_weights(scene))) continue;
                if (modes == 0 && (modulus != 1e6 || poisson != 0.3 || damping != 0.0)) continue;  // all the same
                grid.push_back({.scene = scene,
                                .youngs_modulus = modulus,
                                .poisson_ratio = poisson,
                                .step = step,
                                .damping_ratio = damping,
                                .modes = modes,
                                .mass_ratio = ratio,
                                .recovery_speed = has_contact(scene) ? recovery_speed : 0.0});
              }
  return grid;
}

std::vector<StabilityCase> extreme_cases(int random) {
  std::vector<StabilityCase> cases;
  std::mt19937 generator(2003);
  for (const StabilityScene scene : kScenes) {
    const StabilityCase usual{.scene = scene, .recovery_speed = ContactOptions{}.recovery_speed};
    for (const Axis& axis : axes())
      for (const double level : axis.levels) {
        if (!axis.in(scene)) continue;
        cases.push_back(usual);
        axis.set(cases.back(), level);
      }
    for (int i = 0; i < random; ++i) {
      cases.push_back(usual);
      for (const Axis& axis : axes())
        if (const auto drawn = generator(); axis.in(scene))
          axis.set(cases.back(), axis.levels[drawn % axis.levels.size()]);
    }
  }
  return cases;
}

}  // namespace limber::testing
