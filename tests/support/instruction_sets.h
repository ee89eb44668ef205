// Running a claim on every instruction set that this machine and the build have.
#pragma once

#include <hwy/targets.h>

#include <functional>

namespace limber {

/// Whether an instruction set of hwy's list has fused multiply-add; on those, limber promises the same bits.
inline bool has_fused_multiply_add(std::int64_t target) {
#if HWY_ARCH_X86
  if (target == HWY_SSSE3 || target == HWY_SSE4) return false;
#endif
  return target != HWY_EMU128 && target != HWY_SCALAR;  // plain C++
}

/// Calls claim(target) with the dispatch of limber's vector code fixed to each target in turn, then sets it free again.
inline void for_each_instruction_set(const std::function<void(std::int64_t target)>& claim) {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    claim(target);
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace limber
