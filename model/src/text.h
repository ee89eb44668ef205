// Numbers in messages, short and whole.
#pragma once

#include <cstdio>
#include <string>

namespace limber::internal {

inline std::string shown(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

}  // namespace limber::internal
