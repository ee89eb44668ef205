// How long a test is to run: short by default, long in campaigns that set a variable.
#pragma once

#include <cstdlib>
#include <vector>

namespace limber::testing {

/// The number in an environment variable; without it, `otherwise`.
inline int asked(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::atoi(text);
}

#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

/// What a test goes through: all of it; under sanitizers, which judge the code and not its figures and take ten times
/// the time, the first alone.
template <class T>
std::vector<T> all_or_first(std::vector<T> all) {
  if (kSanitized) all.resize(1);
  return all;
}

/// How many trials a test makes, or in how many it sees what it looks for: all; under sanitizers a tenth.
template <class Number>
constexpr Number all_or_tenth(Number all) {
  return kSanitized ? (all + 9) / 10 : all;
}

}  // namespace limber::testing
