/// @file spans.h
/// Sets of numbers as ascending, disjoint, closed intervals. Private to the articulation module.
#pragma once

#include <algorithm>
#include <vector>

namespace limber::internal {

struct Span {
  double low = 0.0, high = 0.0;
};
using Spans = std::vector<Span>;

/// Sorts and joins what touches, or lies no further apart than `apart`.
inline void normalise(Spans& spans, double apart) {
  std::sort(spans.begin(), spans.end(), [](const Span& a, const Span& b) { return a.low < b.low; });
  std::size_t kept = 0;
  for (const Span& s : spans) {
    if (kept > 0 && s.low <= spans[kept - 1].high + apart)
      spans[kept - 1].high = std::max(spans[kept - 1].high, s.high);
    else
      spans[kept++] = s;
  }
  spans.resize(kept);
}

}  // namespace limber::internal
