// C++20 that limber uses and the standard library of emscripten 3.1 (libc++ 14) lacks: included before every source
// of the page's engine, and of nothing else.
#pragma once

#include <version>

#if defined(__EMSCRIPTEN__) && !defined(__cpp_lib_ranges)
#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <iterator>
#include <string>
#include <utility>

namespace std {

#ifndef __cpp_lib_bit_cast
template <class To, class From>
constexpr To bit_cast(const From& from) noexcept {
  return __builtin_bit_cast(To, from);
}
#endif

/// Numbers as strtod() takes them, but for what the true one refuses: spaces, a plus sign, hexadecimal digits.
inline from_chars_result from_chars(const char* first, const char* last, double& value) {
  const char* end = first;
  while (end != last && (std::isalnum(static_cast<unsigned char>(*end)) != 0 || *end == '.' || *end == '-' ||
                         (*end == '+' && end != first)))
    ++end;
  const std::string text(first, end);
  if (text.empty() || text.find_first_of("xX") != std::string::npos) return {first, errc::invalid_argument};
  char* read = nullptr;
  const double found = std::strtod(text.c_str(), &read);
  if (read == text.c_str()) return {first, errc::invalid_argument};
  const char* const after = first + (read - text.c_str());
  if (found > 1.7976931348623157e308 || found < -1.7976931348623157e308) return {after, errc::result_out_of_range};
  value = found;
  return {after, errc()};
}
/// The first of 15, 16 and 17 digits that read back to the same bits.
inline to_chars_result to_chars(char* first, char* last, double value) {
  int length = 0;
  for (const int digits : {15, 16, 17}) {
    length = std::snprintf(first, static_cast<size_t>(last - first), "%.*g", digits, value);
    if (std::strtod(first, nullptr) == value) break;
  }
  return {first + length, errc()};
}

// Errors are lines put together by +, which libc++ writes out anew at each place. These are chosen over its templates.
#define LIMBER_OUT_OF_LINE [[gnu::noinline]] inline
LIMBER_OUT_OF_LINE string operator+(string&& a, const char* b) { return std::move(a.append(b)); }
LIMBER_OUT_OF_LINE string operator+(string&& a, const string& b) { return std::move(a.append(b)); }
LIMBER_OUT_OF_LINE string operator+(string&& a, string&& b) { return std::move(a.append(b)); }
LIMBER_OUT_OF_LINE string operator+(const string& a, const char* b) { return string(a) + b; }
LIMBER_OUT_OF_LINE string operator+(const string& a, const string& b) { return string(a) + b; }
LIMBER_OUT_OF_LINE string operator+(const char* a, const string& b) { return string(a) + b; }
LIMBER_OUT_OF_LINE string operator+(const char* a, string&& b) { return std::move(b.insert(0, a)); }
#undef LIMBER_OUT_OF_LINE

/// Shell's sort: libc++ sorts by some 5 kB of code for each type, a ninth of the package.
template <class I, class Less>
requires random_access_iterator<I>
constexpr void sort(I first, I last, Less less) {
  const auto size = last - first;
  auto gap = size - size + 1;
  while (gap < size / 3) gap = 3 * gap + 1;
  for (; gap > 0; gap /= 3)
    for (auto at = gap; at < size; ++at) {
      auto moved = std::move(first[at]);
      auto hole = at;
      for (; hole >= gap && less(moved, first[hole - gap]); hole -= gap) first[hole] = std::move(first[hole - gap]);
      first[hole] = std::move(moved);
    }
}
template <class I>
requires random_access_iterator<I>
constexpr void sort(I first, I last) { std::sort(first, last, std::less<>()); }

namespace ranges {

template <class R, class P>
constexpr bool all_of(R&& r, P p) {
  return std::all_of(std::begin(r), std::end(r), p);
}
template <class R, class P>
constexpr bool any_of(R&& r, P p) {
  return std::any_of(std::begin(r), std::end(r), p);
}
template <class R, class P>
constexpr bool none_of(R&& r, P p) {
  return std::none_of(std::begin(r), std::end(r), p);
}
template <class R, class T>
constexpr auto find(R&& r, const T& value) {
  return std::find(std::begin(r), std::end(r), value);
}
template <class R, class T>
constexpr auto count(R&& r, const T& value) {
  return std::count(std::begin(r), std::end(r), value);
}
template <class R, class S>
constexpr bool equal(R&& r, S&& s) {
  return std::equal(std::begin(r), std::end(r), std::begin(s), std::end(s));
}
template <class R, class S>
constexpr bool includes(R&& r, S&& s) {
  return std::includes(std::begin(r), std::end(r), std::begin(s), std::end(s));
}
template <class R, class T>
constexpr void fill(R&& r, const T& value) {
  std::fill(std::begin(r), std::end(r), value);
}
template <class R, class O>
constexpr O copy(R&& r, O out) {
  return std::copy(std::begin(r), std::end(r), out);
}
template <class R, class O, class P>
constexpr O copy_if(R&& r, O out, P p) {
  return std::copy_if(std::begin(r), std::end(r), out, p);
}
template <class R, class O, class F>
constexpr O transform(R&& r, O out, F f) {
  return std::transform(std::begin(r), std::end(r), out, f);
}
struct Identity {
  template <class T>
  constexpr T&& operator()(T&& x) const {
    return std::forward<T>(x);
  }
};
template <class R, class Less = std::less<>, class Projection = Identity>
constexpr void sort(R&& r, Less less = {}, Projection of = {}) {
  std::sort(std::begin(r), std::end(r),
            [&](const auto& a, const auto& b) { return less(std::invoke(of, a), std::invoke(of, b)); });
}
template <class R, class T, class Less = std::less<>>
constexpr auto lower_bound(R&& r, const T& value, Less less = {}) {
  return std::lower_bound(std::begin(r), std::end(r), value, less);
}
template <class R, class T, class Less = std::less<>>
constexpr bool binary_search(R&& r, const T& value, Less less = {}) {
  return std::binary_search(std::begin(r), std::end(r), value, less);
}
template <class R>
constexpr auto minmax(R&& r) {
  const auto found = std::minmax_element(std::begin(r), std::end(r));
  using T = std::decay_t<decltype(*found.first)>;
  struct Both {
    T min, max;
  };
  return Both{*found.first, *found.second};
}
template <class R>
constexpr auto unique(R&& r) {
  return std::pair(std::unique(std::begin(r), std::end(r)), std::end(r));
}

}  // namespace ranges
}  // namespace std
#endif
