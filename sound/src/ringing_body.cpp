#include "ringing_body.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "ringing_kernels.h"

namespace limber::internal {

static_assert(ModalSound::kGroup == Index{kRingingGroup});

RingingBody::RingingBody(std::shared_ptr<const ModalSound> sound)
    : sound_(std::move(sound)), z_(static_cast<std::size_t>(sound_->groups()) * 2 * kRingingGroup) {
  active_.reserve(static_cast<std::size_t>(sound_->groups()));
}

void RingingBody::kick(const StruckPoint& at, const Vec3& impulse, double contact_time, double age, double sign) {
  const double omega = 2.0 * std::numbers::pi / contact_time, square = omega * omega;
  for (Index k = 0; k < sound_->modes(); ++k) {
    const std::complex<double> s = sound_->exponent(k);
    const double strength = sign * sound_->excitation(k, at, impulse) * square / contact_time;
    const std::complex<double> d = strength * sound_->output(k) / (s * (s * s + square)) * std::exp(s * age);
    double* group = z_.data() + static_cast<std::size_t>(k / ModalSound::kGroup) * 2 * kRingingGroup;
    group[k % ModalSound::kGroup] += d.real(), group[kRingingGroup + k % ModalSound::kGroup] += d.imag();
  }
}

ForcedPart RingingBody::begin(const StruckPoint& at, const Vec3& impulse, double contact_time, double age) {
  active_.resize(static_cast<std::size_t>(sound_->groups()));
  std::iota(active_.begin(), active_.end(), 0);
  fade_ = 1.0;
  ++touches_;
  kick(at, impulse, contact_time, age, 1.0);
  // −c/s has no real part: a force that is held moves nothing.
  ForcedPart forced;
  const double omega = 2.0 * std::numbers::pi / contact_time;
  for (Index k = 0; k < sound_->modes(); ++k) {
    const std::complex<double> s = sound_->exponent(k);
    const std::complex<double> r =
        sound_->excitation(k, at, impulse) / contact_time * sound_->output(k) / (s * s + omega * omega);
    forced.along += (r * s).real(), forced.across -= omega * r.real();
  }
  return forced;
}

void RingingBody::end(const StruckPoint& at, const Vec3& impulse, double contact_time, double age) {
  kick(at, impulse, contact_time, age, -1.0);
  --touches_;
}

void RingingBody::advance(std::size_t samples, double* lanes, double* sum) {
  std::fill_n(lanes, samples * kRingingGroup, 0.0);
  ring(sound_->propagators(), z_.data(), active_.data(), active_.size(), fade_, samples, lanes);
  for (std::size_t n = 0; n < samples; ++n, lanes += kRingingGroup)
    sum[n] = ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}

void RingingBody::settle(double floor) {
  const double share = floor / std::max<Index>(sound_->groups(), 1);
  level_ = 0.0;
  std::size_t left = 0;
  for (const std::int32_t g : active_) {
    double* group = z_.data() + static_cast<std::size_t>(g) * 2 * kRingingGroup;
    double sum = 0.0;
    for (std::size_t lane = 0; lane < kRingingGroup; ++lane)
      sum += std::sqrt(group[lane] * group[lane] + group[kRingingGroup + lane] * group[kRingingGroup + lane]);
    if (touches_ == 0 && sum <= share) {
      std::fill_n(group, 2 * kRingingGroup, 0.0);
    } else {
      active_[left++] = g;
      level_ += sum;
    }
  }
  active_.resize(left);
  if (left == 0) fade_ = 1.0;
}

}  // namespace limber::internal
