#pragma once

#include "limber/core/types.h"

namespace limber::internal {

/// One of the equal parts that a step is taken in (WorldOptions::substeps).
struct Substep {
  int index = 0;                ///< in its step, from 0
  double length = 0.0;          ///< s
  Vec3 gravity = Vec3::Zero();  ///< m/s², world
};

}  // namespace limber::internal
