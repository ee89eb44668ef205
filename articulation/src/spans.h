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

/// Sorts and joins what touches; what touches at 0 only stays apart on request.
inline void normalise(Spans& spans, bool apart_at_0 = false) {
  std::sort(spans.begin(), spans.end(), [](const Span& a, const Span& b) { return a.low < b.low; });
  std::size_t kept = 0;
  for (const Span& s : spans) {
    const bool meets = kept > 0 && s.low <= spans[kept - 1].high;
    if (meets && !(apart_at_0 && s.low == 0.0 && spans[kept - 1].high == 0.0))
      spans[kept - 1].high = std::max(spans[kept - 1].high, s.high);
    else
      spans[kept++] = s;
  }
  spans.resize(kept);
}

/// @pre both normalised
inline Spans intersection(const Spans& a, const Spans& b) {
  Spans out;
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    const Span both{std::max(a[i].low, b[j].low), std::min(a[i].high, b[j].high)};
    if (both.low <= both.high) out.push_back(both);
    (a[i].high < b[j].high ? i : j)++;
  }
  return out;
}

/// Whether one of the spans holds [low, high]. @pre normalised
inline bool covers(const Spans& spans, double low, double high) {
  const auto after =
      std::upper_bound(spans.begin(), spans.end(), low, [](double x, const Span& s) { return x < s.low; });
  return after != spans.begin() && std::prev(after)->high >= high;
}

}  // namespace limber::internal
