/// @file
/// Numbers of the engine, all of them and each once. Defaults of options stand in the public headers.
#pragma once

namespace limber::internal {

struct EngineTuning {
  /// Part of a body's thickness by which contacts are found beyond where its own motion takes it [1e-3 to 0.1].
  double speculative_margin = 0.01;
  int bodies_per_job = 64;  ///< that a thread advances at a time. Decides time alone
};
inline constexpr EngineTuning kEngineTuning{};

}  // namespace limber::internal
