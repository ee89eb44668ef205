#include "limber/model/sound_modes.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "limber/core/error.h"

namespace limber {
namespace {

[[noreturn]] void refuse_sound(const std::string& what) { throw InvalidArgument("SoundModes: " + what); }

}  // namespace

void SoundModes::validate() const {
  const std::size_t count = eigenvalues.size();
  if (vertices < 0) refuse_sound("vertices is " + std::to_string(vertices) + ", expected 0 or more");
  if (decays.size() != count)
    refuse_sound(std::to_string(decays.size()) + " decays, expected " + std::to_string(count) + ", one per mode");
  if (shapes.size() != count * static_cast<std::size_t>(vertices) * 3)
    refuse_sound(std::to_string(shapes.size()) + " numbers of shapes, expected three per mode and vertex");
  for (std::size_t k = 0; k < count; ++k) {
    const std::string mode = " of mode " + std::to_string(k) + " is ";
    const double lambda = eigenvalues[k], xi = decays[k];
    if (!std::isfinite(lambda) || (k > 0 && lambda < eigenvalues[k - 1]))
      refuse_sound("the eigenvalue" + mode + std::to_string(lambda) + ", expected a number not below the one before");
    if (!(xi > 0.0 && xi * xi < lambda))
      refuse_sound("the decay" + mode + std::to_string(xi) + " 1/s, expected above 0 and below " +
                   std::to_string(std::sqrt(std::max(lambda, 0.0))) + ", where it would no longer swing");
  }
  if (!std::ranges::all_of(shapes, [](float w) { return std::isfinite(w); })) refuse_sound("a shape is not finite");
  if (!(contact_modulus > 0.0))
    refuse_sound("contact_modulus is " + std::to_string(contact_modulus) + " Pa, expected above 0");
}

}  // namespace limber
