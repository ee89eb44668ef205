#include "limber/model/mode_selection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>

#include "limber/core/error.h"
#include "text.h"

namespace limber {
namespace {

using internal::shown;

constexpr double kClusterDistance = 1e-6;  // relative, between neighbours

void check_limit(double value, const char* field, const char* unit) {
  if (!(std::isfinite(value) && value >= 0.0))
    throw InvalidArgument("SceneLimits: " + std::string(field) + " is " + shown(value) + " " + unit +
                          ", expected 0 (no limit) or more");
}

void check_modes(std::span<const ModeStrength> modes) {
  for (std::size_t i = 0; i < modes.size(); ++i) {
    const ModeStrength& m = modes[i];
    const auto refuse = [&](const std::string& what) {
      throw InvalidArgument("select_modes: mode " + std::to_string(i) + ": " + what);
    };
    for (const auto& [value, field] : {std::pair{m.eigenvalue, "eigenvalue"},
                                       {m.decay, "decay"},
                                       {m.max_observable, "max_observable"},
                                       {m.max_loadable, "max_loadable"}})
      if (!(std::isfinite(value) && value >= 0.0))
        refuse(std::string(field) + " is " + shown(value) + ", expected 0 or more and finite");
    if (i > 0 && m.eigenvalue < modes[i - 1].eigenvalue)
      refuse("eigenvalue is below that of the mode before, expected ascending order");
  }
}

/// c: the largest displacement under a force of the given kind over the static one.
double amplification(const ModeStrength& mode, LoadKind load) {
  if (load == LoadKind::kStatic) return 1.0;
  if (load == LoadKind::kSudden) return 2.0;
  const double zeta = mode.decay / std::sqrt(mode.eigenvalue);
  // Above ζ = 1/√2 the answer has no peak: it is largest at frequency 0.
  return zeta < std::numbers::sqrt2 / 2.0 ? 1.0 / (2.0 * zeta * std::sqrt(1.0 - zeta * zeta)) : 1.0;
}

/// Hz; 0 for an overdamped mode, which does not swing.
double damped_frequency(const ModeStrength& mode) {
  return std::sqrt(std::max(0.0, mode.eigenvalue - mode.decay * mode.decay)) / (2.0 * std::numbers::pi);
}

struct Verdict {
  DropReason reason;
  double value, limit;
};

/// Modes [first, last) of equal eigenvalue: any rotation of them among each other is as good a basis, so they share one
/// fate.
struct Cluster {
  std::size_t first, last;
  Index size() const { return static_cast<Index>(last - first); }
};

Cluster cluster_from(std::span<const ModeStrength> modes, std::size_t first) {
  std::size_t last = first + 1;
  while (last < modes.size() &&
         modes[last].eigenvalue - modes[last - 1].eigenvalue < kClusterDistance * modes[last].eigenvalue)
    ++last;
  return {first, last};
}

/// Why the scene cannot show any mode of a cluster; nothing if it can show one.
std::optional<Verdict> invisible(std::span<const ModeStrength> cluster, const SceneLimits& limits) {
  if (limits.keep_all) return std::nullopt;
  double displacement = 0.0, frequency = std::numeric_limits<double>::infinity();
  for (const ModeStrength& mode : cluster) {
    displacement = std::max(displacement, largest_displacement(mode, limits));
    frequency = std::min(frequency, damped_frequency(mode));
  }
  if (limits.max_force > 0.0 && displacement < limits.min_displacement)
    return Verdict{DropReason::kTooSmall, displacement, limits.min_displacement};
  if (limits.frame_rate > 0.0 && frequency > 0.5 * limits.frame_rate)
    return Verdict{DropReason::kTooFast, frequency, 0.5 * limits.frame_rate};
  return std::nullopt;
}

}  // namespace

void SceneLimits::validate() const {
  if (max_modes < 1)
    throw InvalidArgument("SceneLimits: max_modes is " + std::to_string(max_modes) + ", expected 1 or more");
  check_limit(max_force, "max_force", "N");
  check_limit(min_displacement, "min_displacement", "m");
  check_limit(frame_rate, "frame_rate", "Hz");
}

std::string_view to_string(DropReason reason) {
  switch (reason) {
    case DropReason::kTooSmall:
      return "below_min_displacement";
    case DropReason::kTooFast:
      return "above_half_frame_rate";
    case DropReason::kBeyondMaxModes:
      return "beyond_max_modes";
  }
  throw InvalidArgument("DropReason: unknown value " + std::to_string(static_cast<int>(reason)));
}

ModeSelection select_modes(std::span<const ModeStrength> modes, const SceneLimits& limits) {
  limits.validate();
  check_modes(modes);
  ModeSelection out;
  std::size_t first = 0;
  for (; first < modes.size() && modes[first].eigenvalue == 0.0; ++first) out.kept.push_back(static_cast<Index>(first));

  Index rank = 0;  // of the cluster's last mode, among the elastic ones that the scene can show
  while (first < modes.size()) {
    const Cluster cluster = cluster_from(modes, first);
    std::optional<Verdict> verdict = invisible(modes.subspan(cluster.first, cluster.last - cluster.first), limits);
    if (!verdict) {
      rank += cluster.size();
      const bool first_shown = rank == cluster.size();
      if (rank > limits.max_modes && !first_shown)
        verdict =
            Verdict{DropReason::kBeyondMaxModes, static_cast<double>(rank), static_cast<double>(limits.max_modes)};
    }
    for (std::size_t i = cluster.first; i < cluster.last; ++i) {
      if (verdict)
        out.dropped.push_back({static_cast<Index>(i), verdict->reason, verdict->value, verdict->limit});
      else
        out.kept.push_back(static_cast<Index>(i));
    }
    first = cluster.last;
  }
  return out;
}

double largest_displacement(const ModeStrength& mode, const SceneLimits& limits) {
  const double reach = mode.max_observable * mode.max_loadable;
  // An undamped mode at resonance grows without bound, unless no force reaches it or nobody sees it.
  return reach > 0.0 ? reach * limits.max_force * amplification(mode, limits.load) / mode.eigenvalue : 0.0;
}

double visible_displacement(double distance, double field_of_view, int pixels) {
  const auto refuse = [](const char* name, double value, const char* expected) {
    throw InvalidArgument("visible_displacement: " + std::string(name) + " is " + shown(value) + ", expected " +
                          expected);
  };
  if (!(distance > 0.0 && std::isfinite(distance))) refuse("distance", distance, "a finite number above 0 m");
  if (!(field_of_view > 0.0 && field_of_view < std::numbers::pi))
    refuse("field_of_view", field_of_view, "an angle between 0 and pi");
  if (pixels < 1) refuse("pixels", pixels, "1 or more");
  return distance * std::tan(0.5 * field_of_view) / pixels;
}

}  // namespace limber
