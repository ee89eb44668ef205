#include "argument_checks.h"

#include <cmath>
#include <string>

#include "limber/core/error.h"

namespace limber::internal {
namespace {

bool finite(const Quaternion& q) { return std::isfinite(q.w + q.x + q.y + q.z); }

}  // namespace

void require_finite(const Vec3& v, const char* function, const char* what) {
  if (!v.allFinite())
    throw InvalidArgument(std::string("World::") + function + ": " + what + " is (" + std::to_string(v.x()) + ", " +
                          std::to_string(v.y()) + ", " + std::to_string(v.z()) + "), expected finite numbers");
}

void require_finite(std::span<const double> values, const char* function, const char* what) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i]))
      throw InvalidArgument(std::string("World::") + function + ": " + what + "[" + std::to_string(i) + "] is " +
                            std::to_string(values[i]) + ", expected a finite number");
}

void require_pose(const RigidTransform& X, const char* function) {
  require_finite(X.p, function, "the pose's position");
  if (!finite(X.q) || !(std::abs(X.q.norm() - 1.0) <= 1e-3))
    throw InvalidArgument(std::string("World::") + function + ": the pose's quaternion has norm " +
                          std::to_string(X.q.norm()) + ", expected 1; call normalized() on it");
}

void require_count(std::size_t seen, std::size_t expected, const char* function, const char* what) {
  if (seen != expected)
    throw InvalidArgument(std::string("World::") + function + ": " + what + " has " + std::to_string(seen) +
                          " elements, expected " + std::to_string(expected));
}

}  // namespace limber::internal
