#include "sweep_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "sweep_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

HWY_ATTR SweepPiece SweepRow(const SweepBoxes& boxes, std::size_t row, std::size_t from,
                             std::uint32_t* HWY_RESTRICT hits) {
  const hn::CappedTag<float, kSweepPadding> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const std::size_t end = from + kSweepPiece < boxes.count ? from + kSweepPiece : boxes.count;
  const auto high0 = hn::Set(d, boxes.high[0][row]), high1 = hn::Set(d, boxes.high[1][row]),
             high2 = hn::Set(d, boxes.high[2][row]);
  const auto low1 = hn::Set(d, boxes.low[1][row]), low2 = hn::Set(d, boxes.low[2][row]);
  std::size_t found = 0;
  for (std::size_t j = from; j < end; j += hn::Lanes(d)) {
    const auto starts = hn::Le(hn::LoadU(d, boxes.low[0] + j), high0);
    const auto along1 =
        hn::And(hn::Le(hn::LoadU(d, boxes.low[1] + j), high1), hn::Le(low1, hn::LoadU(d, boxes.high[1] + j)));
    const auto along2 =
        hn::And(hn::Le(hn::LoadU(d, boxes.low[2] + j), high2), hn::Le(low2, hn::LoadU(d, boxes.high[2] + j)));
    const auto overlaps = hn::And(starts, hn::And(along1, along2));
    if (!hn::AllFalse(d, overlaps)) {
      const auto columns = hn::Iota(du, static_cast<std::uint32_t>(j));
      found += hn::CompressStore(columns, hn::RebindMask(du, overlaps), du, hits + found);
    }
    if (!hn::AllTrue(d, starts)) return {found, boxes.count};
  }
  return {found, end};
}

}  // namespace limber::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber {

HWY_EXPORT(SweepRow);

SweepPiece sweep_row(const SweepBoxes& boxes, std::size_t row, std::size_t from, std::uint32_t* hits) {
  return HWY_DYNAMIC_DISPATCH(SweepRow)(boxes, row, from, hits);
}

}  // namespace limber
#endif  // HWY_ONCE
