#include "limber/sound/modal_sound.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "limber/core/error.h"

namespace limber {

ModalSound::ModalSound(const SoundModes& modes, std::span<const double> gains, double sample_rate)
    : sample_rate_(sample_rate), contact_modulus_(modes.contact_modulus), vertices_(modes.vertices) {
  modes.validate();
  if (!(sample_rate >= 8e3 && sample_rate <= 384e3))
    throw InvalidArgument("ModalSound: sample_rate is " + std::to_string(sample_rate) + ", expected 8000 to 384000");
  if (static_cast<Index>(gains.size()) != modes.modes())
    throw InvalidArgument("ModalSound: " + std::to_string(gains.size()) + " gains, expected " +
                          std::to_string(modes.modes()) + ", one per mode");
  if (!std::ranges::all_of(gains, [](double g) { return std::isfinite(g); }))
    throw InvalidArgument("ModalSound: a gain is not finite");

  const double nyquist = std::numbers::pi * sample_rate;  // rad/s
  std::vector<Index> heard;
  for (Index k = 0; k < modes.modes(); ++k) {
    const double xi = modes.decays[k], omega = std::sqrt(modes.eigenvalues[k] - xi * xi);
    if (!(omega < nyquist)) continue;
    heard.push_back(k);
    exponents_.emplace_back(-xi, omega);
    outputs_.push_back(gains[k] * std::complex<double>(1.0, xi / omega));
  }

  propagators_ = AlignedArray<double>(static_cast<std::size_t>(groups()) * 2 * kGroup);
  for (Index k = 0; k < this->modes(); ++k) {
    const std::complex<double> p = std::exp(exponents_[k] / sample_rate);
    double* group = propagators_.data() + static_cast<std::size_t>(k / kGroup) * 2 * kGroup;
    group[k % kGroup] = p.real(), group[kGroup + k % kGroup] = p.imag();
  }
  shapes_.reserve(heard.size() * static_cast<std::size_t>(vertices_) * 3);
  for (Index v = 0; v < vertices_; ++v)
    for (const Index k : heard) {
      const Vec3f w = modes.shape(k, v);
      shapes_.insert(shapes_.end(), {w.x(), w.y(), w.z()});
    }
}

double ModalSound::excitation(Index mode, const StruckPoint& at, const Vec3& impulse) const {
  double sum = 0.0;
  for (int corner = 0; corner < 3; ++corner) {
    const float* w = shapes_.data() + (static_cast<std::size_t>(at.vertices[corner]) * exponents_.size() + mode) * 3;
    sum += at.weights[corner] * (w[0] * impulse.x() + w[1] * impulse.y() + w[2] * impulse.z());
  }
  return sum;
}

}  // namespace limber
