/// @file limber/model/mode_selection.h
/// Which modes a scene can show. A pure function of the modes and the scene's limits, used at bake time and per scene.
///
/// [H03] section 3.2 drops a mode whose answer to the largest force cannot be seen, or whose frequency cannot be shown.
/// Here per node: the largest displacement that a force of size F anywhere loadable can make mode i show anywhere
/// observable is  max_a |w_i(a)| · max_b |w_i(b)| · F · c / λ_i .
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "limber/core/types.h"

namespace limber {

/// Data by which one mode is judged.
struct ModeStrength {
  double eigenvalue = 0.0;      ///< λ, rad²/s²; ≥ 0
  double decay = 0.0;           ///< ξ, 1/s; ≥ 0
  double max_observable = 0.0;  ///< max |w_i(a)| over the vertices that can be seen, kg^−½
  double max_loadable = 0.0;    ///< max |w_i(b)| over the points where forces can act, kg^−½
};

enum class LoadKind {
  kStatic,    ///< c = 1
  kSudden,    ///< c = 2, a force that starts at once
  kResonant,  ///< c = 1/(2ζ√(1−ζ²)), at least 1: a force at the worst frequency
};

struct SceneLimits {
  int max_modes = 64;             ///< the most modes kept, lowest first; ≥ 0. Step time grows linearly in it.
  double max_force = 0.0;         ///< N, the largest force of the scene; 0: no limit is given
  double min_displacement = 0.0;  ///< m, the smallest motion anyone can see; 0: no limit is given
  double frame_rate = 0.0;        ///< Hz; modes whose damped frequency is above half of it are dropped; 0: no limit
  LoadKind load = LoadKind::kSudden;
  bool keep_all = false;  ///< switches off the limits on force and frame rate; max_modes stays
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

enum class DropReason { kTooSmall, kTooFast, kBeyondMaxModes };
/// "below_min_displacement", "above_half_frame_rate", "beyond_max_modes".
std::string_view to_string(DropReason reason);

struct DroppedMode {
  Index mode = 0;
  DropReason reason = DropReason::kTooSmall;
  /// The compared value of its cluster: the largest displacement, m; the lowest damped frequency, Hz; or the rank of
  /// its last mode among the elastic ones that the scene can show, from 1.
  double value = 0.0;
  double limit = 0.0;  ///< with what: min_displacement, half the frame rate or max_modes
};

struct ModeSelection {
  std::vector<Index> kept;  ///< ascending
  std::vector<DroppedMode> dropped;
};

/// @param modes ascending in λ. Modes with λ = 0 (mechanisms) are always kept and do not count towards max_modes.
/// A cluster of equal eigenvalues (relative distance of neighbours below 1e-6) is never cut in two, as any rotation of
/// its modes among each other is as good a basis: it goes only if none of its modes can be seen, and max_modes drops it
/// whole, or keeps it whole where nothing else would be kept. After a cluster beyond max_modes no higher mode is kept.
/// @throws InvalidArgument naming the mode or limit and its value
ModeSelection select_modes(std::span<const ModeStrength> modes, const SceneLimits& limits);

/// m, the largest displacement that SceneLimits::max_force can make a mode show, of the kind SceneLimits::load: what
/// select_modes() compares with min_displacement. Infinite for an undamped mode at resonance.
/// @pre λ > 0
double largest_displacement(const ModeStrength& mode, const SceneLimits& limits);

/// m, the smallest displacement that a camera can show: half a pixel at this distance.
/// @param distance to the nearest body, m; > 0. @param field_of_view from the picture's lower edge to its upper one,
/// rad; in (0, π). @param pixels from edge to edge; ≥ 1
/// @throws InvalidArgument naming the argument and its value
double visible_displacement(double distance, double field_of_view, int pixels);

}  // namespace limber
