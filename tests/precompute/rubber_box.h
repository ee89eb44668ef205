// What the tests of precompute bake: a rubber box of 3 × 2 × 2 cells; and steel.
#pragma once

#include <utility>

#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber::testing {

inline const Material kRubber{.youngs_modulus = 5e6, .poisson_ratio = 0.4, .density = 1100.0};
inline const Material kSteel{.youngs_modulus = 2e11, .poisson_ratio = 0.3, .density = 7850.0};
inline const Vec3 kBoxSize{0.3, 0.2, 0.1};  // m

inline TetMesh box() { return tet_box(3, 2, 2, kBoxSize); }

inline BakeOptions rubber(int modes = 12) {
  BakeOptions o;
  o.materials = {{"*", kRubber}};
  o.analysis.modes = modes;
  o.limits.max_modes = modes;
  return o;
}

inline BakeResult bake_box(const BakeOptions& options, TetMesh mesh = box()) {
  Warnings warnings;
  return bake({.name = "box", .mesh = std::move(mesh)}, options, warnings);
}

}  // namespace limber::testing
