/// @file number_text.h
/// Numbers as sentences for people show them. Private to the articulation module.
#pragma once

#include <cstdio>
#include <numbers>
#include <string>

#include "limber/core/types.h"

namespace limber::internal {

/// "0.05", "1.234e-07".
inline std::string number_text(double x, int digits = 4) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, x);
  return text;
}

inline std::string degrees_text(double radians) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f°", radians * 180.0 / std::numbers::pi);
  return text;
}

inline std::string point_text(const Vec3& p) {
  return "(" + number_text(p.x()) + ", " + number_text(p.y()) + ", " + number_text(p.z()) + ")";
}

}  // namespace limber::internal
