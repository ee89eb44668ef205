/// @file
/// Numbers of the engine, all of them and each once. Defaults of options stand in the public headers.
#pragma once

namespace limber::internal {

struct EngineTuning {
  int bodies_per_job = 64;  ///< that a thread advances at a time. Decides time alone
};
inline constexpr EngineTuning kEngineTuning{};

}  // namespace limber::internal
