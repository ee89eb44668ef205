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

/// Sorts and joins what touches.
inline void normalise(Spans& spans) {
  std::sort(spans.begin(), spans.end(), [](const Span& a, const Span& b) { return a.low < b.low; });
  std::size_t kept = 0;
  for (const Span& s : spans) {
    if (kept > 0 && s.low <= spans[kept - 1].high)
      spans[kept - 1].high = std::max(spans[kept - 1].high, s.high);
    else
      spans[kept++] = s;
  }
  spans.resize(kept);
}

/// Adds one span to a normalised set, joined with what it touches; what touches at 0 only stays apart.
inline void add_apart_at_0(Spans& spans, Span span) {
  auto first =
      std::lower_bound(spans.begin(), spans.end(), span.low, [](const Span& s, double low) { return s.high < low; });
  if (first != spans.end() && first->high == 0.0 && span.low == 0.0) ++first;
  auto last = first;
  for (; last != spans.end() && last->low <= span.high && !(last->low == 0.0 && span.high == 0.0); ++last)
    span = {std::min(span.low, last->low), std::max(span.high, last->high)};
  if (first == last) {
    spans.insert(first, span);
    return;
  }
  *first = span;
  spans.erase(first + 1, last);
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

/// True if one of the spans holds [low, high]. @pre normalised
inline bool covers(const Spans& spans, double low, double high) {
  const auto after =
      std::upper_bound(spans.begin(), spans.end(), low, [](double x, const Span& s) { return x < s.low; });
  return after != spans.begin() && std::prev(after)->high >= high;
}

}  // namespace limber::internal
