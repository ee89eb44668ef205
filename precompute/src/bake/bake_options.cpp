#include <cmath>
#include <numbers>

#include "limber/core/error.h"
#include "limber/precompute/bake.h"

namespace limber {

RayleighDamping RayleighDamping::from_ratio(double ratio, double first_hz, double second_hz) {
  if (!(ratio >= 0.0) || !(first_hz > 0.0) || !(second_hz > 0.0) || !std::isfinite(ratio + first_hz + second_hz))
    throw InvalidArgument("damping ratio " + std::to_string(ratio) + " at " + std::to_string(first_hz) + " and " +
                          std::to_string(second_hz) + " Hz: expected a ratio of 0 or more and frequencies above 0");
  const double w1 = 2.0 * std::numbers::pi * first_hz, w2 = 2.0 * std::numbers::pi * second_hz;
  return {.stiffness_proportional = 2.0 * ratio / (w1 + w2), .mass_proportional = 2.0 * ratio * w1 * w2 / (w1 + w2)};
}

void RayleighDamping::validate() const {
  const auto check = [](double value, const char* field) {
    if (!(value >= 0.0) || !std::isfinite(value))
      throw InvalidArgument(std::string("Rayleigh damping: ") + field + " is " + std::to_string(value) +
                            ", expected 0 or more");
  };
  check(stiffness_proportional, "a1 (stiffness-proportional, s)");
  check(mass_proportional, "a2 (mass-proportional, 1/s)");
}

void ResidualOptions::validate() const {
  for (const AttachmentPatch& patch : patches)
    if (!patch.center.allFinite() || !(patch.radius >= 0.0 && std::isfinite(patch.radius)))
      throw InvalidArgument("ResidualOptions::patches: a centre is not finite, or a radius not a finite number >= 0");
  if (!(max_full_bytes >= 0.0))
    throw InvalidArgument("ResidualOptions::max_full_bytes is " + std::to_string(max_full_bytes) +
                          ", expected 0 or more");
}

void SkinOptions::validate() const {
  if (handles < 0 || handles >= ModalSkin::kMaxHandles)
    throw InvalidArgument("SkinOptions::handles is " + std::to_string(handles) + ", expected 0 to " +
                          std::to_string(ModalSkin::kMaxHandles - 1));
}

void SoundOptions::validate() const {
  if (modes < 1) throw InvalidArgument("SoundOptions::modes is " + std::to_string(modes) + ", expected 1 or more");
  if (!(lowest_hz > 0.0 && lowest_hz < highest_hz && std::isfinite(highest_hz)))
    throw InvalidArgument("SoundOptions: from " + std::to_string(lowest_hz) + " to " + std::to_string(highest_hz) +
                          " Hz, expected two frequencies above 0, the lower one first");
  if (loss_factor && !(*loss_factor > 0.0 && *loss_factor <= 1.0))
    throw InvalidArgument("SoundOptions::loss_factor is " + std::to_string(*loss_factor) +
                          ", expected above 0 and at most 1");
}

void BakeOptions::validate() const {
  if (materials.empty() && regions.empty()) throw InvalidArgument("bake: no material is given");
  damping.validate();
  analysis.validate();
  limits.validate();
  residual.validate();
  skin.validate();
  sound.validate();
  if (collision_triangles < 0)
    throw InvalidArgument("BakeOptions::collision_triangles is " + std::to_string(collision_triangles) +
                          ", expected 0 or more");
}

}  // namespace limber
