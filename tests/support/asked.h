// How long a test is to run: short by default, long in campaigns that set a variable.
#pragma once

#include <cstdlib>

namespace limber::testing {

/// The number in an environment variable; without it, `otherwise`.
inline int asked(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::atoi(text);
}

}  // namespace limber::testing
