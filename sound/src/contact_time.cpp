#include "limber/sound/contact_time.h"

#include <cmath>
#include <string>

#include "limber/core/error.h"

namespace limber {
namespace {

/// 1/(1/a + 1/b).
double in_series(double a, double b, const char* name) {
  if (!(a > 0.0 && b > 0.0) || (std::isinf(a) && std::isinf(b)))
    throw InvalidArgument("contact_time: the two bodies have " + std::string(name) + " " + std::to_string(a) + " and " +
                          std::to_string(b) + ", expected numbers above 0, at least one of them finite");
  return 1.0 / (1.0 / a + 1.0 / b);
}

}  // namespace

double contact_time(const StrikeSide& a, const StrikeSide& b, double speed) {
  if (!(speed > 0.0 && std::isfinite(speed)))
    throw InvalidArgument("contact_time: speed is " + std::to_string(speed) + " m/s, expected a number above 0");
  const double m = in_series(a.mass, b.mass, "mass"), R = in_series(a.radius, b.radius, "radius"),
               E = in_series(a.modulus, b.modulus, "modulus");
  return 2.87 * std::pow(m * m / (R * E * E * speed), 0.2);
}

}  // namespace limber
