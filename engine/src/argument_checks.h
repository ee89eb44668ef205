// Checks of the arguments of World's functions. Each throws InvalidArgument with the function's name.
#pragma once

#include <cstddef>
#include <span>

#include "limber/core/rigid_transform.h"

namespace limber::internal {

void require_finite(const Vec3& v, const char* function, const char* what);
void require_finite(std::span<const double> values, const char* function, const char* what);
void require_pose(const RigidTransform& X, const char* function);
void require_count(std::size_t seen, std::size_t expected, const char* function, const char* what);

}  // namespace limber::internal
