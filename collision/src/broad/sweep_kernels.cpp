#include "broad/sweep_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "broad/sweep_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_ATTR std::size_t SweepRowsOn(const SweepBoxes& boxes, std::size_t last, SweepCursor& cursor,
                                 SweepHit* HWY_RESTRICT hits) {
  const hn::CappedTag<float, kSweepPadding> d;
  std::size_t found = 0, column = cursor.column;
  for (std::size_t row = cursor.row; row < last; ++row, column = row + 1) {
    const auto high0 = hn::Set(d, boxes.high[0][row]), high1 = hn::Set(d, boxes.high[1][row]),
               high2 = hn::Set(d, boxes.high[2][row]);
    const auto low1 = hn::Set(d, boxes.low[1][row]), low2 = hn::Set(d, boxes.low[2][row]);
    for (bool more = true; more; column += hn::Lanes(d)) {
      if (found + kSweepPadding > kSweepHits) {
        cursor = {row, column};
        return found;
      }
      const auto starts = hn::Le(hn::LoadU(d, boxes.low[0] + column), high0);
      const auto along1 = hn::And(hn::Le(hn::LoadU(d, boxes.low[1] + column), high1),
                                  hn::Le(low1, hn::LoadU(d, boxes.high[1] + column)));
      const auto along2 = hn::And(hn::Le(hn::LoadU(d, boxes.low[2] + column), high2),
                                  hn::Le(low2, hn::LoadU(d, boxes.high[2] + column)));
      const auto overlaps = hn::And(starts, hn::And(along1, along2));
      if (!hn::AllFalse(d, overlaps)) {
        std::uint8_t bytes[8] = {};
        hn::StoreMaskBits(d, overlaps, bytes);
        for (unsigned lanes = bytes[0] | static_cast<unsigned>(bytes[1]) << 8; lanes != 0; lanes &= lanes - 1) {
          const auto lane = static_cast<unsigned>(hwy::Num0BitsBelowLS1Bit_Nonzero32(lanes));
          hits[found++] = {static_cast<std::uint32_t>(row), static_cast<std::uint32_t>(column) + lane};
        }
      }
      more = hn::AllTrue(d, starts);
    }
  }
  cursor = {last, last + 1};
  return found;
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(SweepRowsOn);

std::size_t sweep_rows_on(const SweepBoxes& boxes, std::size_t last, SweepCursor& cursor, SweepHit* hits) {
  return HWY_DYNAMIC_DISPATCH(SweepRowsOn)(boxes, last, cursor, hits);
}

}  // namespace limber::internal
#endif  // HWY_ONCE
