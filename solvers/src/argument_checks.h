// What the solvers ask of their arguments: lengths that fit (else InvalidArgument: a slip of the caller's) and finite
// numbers (else a status: a scene can bring them about).
#pragma once

#include <cstddef>
#include <string>

#include "limber/core/error.h"

namespace limber::internal {

inline void check_length(const char* function, const char* name, std::size_t seen, std::size_t expected) {
  if (seen != expected)
    throw InvalidArgument(std::string(function) + ": " + name + " has " + std::to_string(seen) + " numbers, expected " +
                          std::to_string(expected));
}

/// An argument that may be left out, by an empty span.
inline void check_optional_length(const char* function, const char* name, std::size_t seen, std::size_t expected) {
  if (seen != 0) check_length(function, name, seen, expected);
}

inline void check_option(const char* function, const char* name, bool in_range, double seen, const char* expected) {
  if (!in_range)
    throw InvalidArgument(std::string(function) + ": " + name + " is " + std::to_string(seen) + ", expected " +
                          expected);
}

}  // namespace limber::internal
