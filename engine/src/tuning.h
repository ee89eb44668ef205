/// @file
/// Numbers of the engine that choose a path or a cap, all of them and each once. [path] marks those that choose a path
/// or cap one: scripts/count counts them. Defaults of options stand in the public headers.
#pragma once

namespace limber::internal {

/// Contacts found again where the foreseen step ends elsewhere.
struct LookTuning {
  int most = 3;  ///< looks of a step, each at least twice as far. [path] Bounds the work
  /// A look is rough until contacts are off by no more than this part of what recovery parts in the step, or of the
  /// thinnest body.
  double rough_of_recovery = 0.25, rough_of_thickness = 1e-4;
  double rounded = 1e-9;  ///< of the way to the bodies: a gap that closes by less closes by rounding. [path]
};

/// Fast bodies: those that could pass something within a step, taken part by part.
struct FastTuning {
  double slow = 0.5;     ///< of the look-ahead: what moves less far within a step passes nothing. [path]
  double touch = 0.05;   ///< of the smallest look-ahead at hand, at which bodies touch. [path]
  double nearer = 0.45;  ///< of that: what came to a touch is apart for those that come after
  double least = 1e-3;   ///< of that: bodies that touch and are nearer are looked at no more. [path]
  double most_turn =
      0.5;             ///< rad, that a body may turn by while contacts hold it: beyond, other parts would touch. [path]
  int most_parts = 4;  ///< of a cluster's step. [path] Bounds the work
};

struct EngineTuning {
  LookTuning looks{};
  FastTuning fast{};
  int bodies_per_job = 64;  ///< that a thread advances at a time. Decides time alone
};
inline constexpr EngineTuning kEngineTuning{};

}  // namespace limber::internal
