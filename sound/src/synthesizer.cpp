#include "limber/sound/synthesizer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "limber/core/error.h"
#include "ringing_body.h"
#include "ringing_kernels.h"

namespace limber {
namespace {

/// Bodies fall silent and give way at multiples of this sample alone, so that how render() is called does not show.
constexpr std::int64_t kWindow = 64;

void require(bool holds, const char* field, double value, const char* expected) {
  if (!holds) throw InvalidArgument(std::string(field) + " is " + std::to_string(value) + ", expected " + expected);
}

/// A blow that waits or touches.
struct PendingBlow {
  Blow blow{};
  std::int64_t first = 0, last = 0;  // the samples from which on it acts, and no longer acts
  double begun = 0.0, ended = 0.0;   // s, how long before these samples it began and ended
  internal::ForcedPart forced{};
  Index next = -1;  // of the same body, or free
};

/// One body with the blows on it and its gains.
struct Part {
  internal::RingingBody body;
  Index blows = -1;  // the earliest taken
  std::vector<double> gains, targets;
};

}  // namespace

void SynthesizerOptions::validate() const {
  require(sample_rate >= 8e3 && sample_rate <= 384e3, "SynthesizerOptions: sample_rate", sample_rate, "8000 to 384000");
  require(channels >= 1 && channels <= 16, "SynthesizerOptions: channels", channels, "1 to 16");
  require(max_strikes >= 1, "SynthesizerOptions: max_strikes", max_strikes, "1 or more");
  require(max_modes >= 1, "SynthesizerOptions: max_modes", max_modes, "1 or more");
  require(floor > 0.0 && std::isfinite(floor), "SynthesizerOptions: floor", floor, "a number above 0");
  require(fade > 0.0 && std::isfinite(fade), "SynthesizerOptions: fade", fade, "seconds above 0");
  require(glide > 0.0 && std::isfinite(glide), "SynthesizerOptions: glide", glide, "seconds above 0");
}

struct Synthesizer::Impl {
  explicit Impl(const SynthesizerOptions& given)
      : options(given),
        fade_per_sample(std::exp(-1.0 / (given.fade * given.sample_rate))),
        glide_per_sample(-std::expm1(-1.0 / (given.glide * given.sample_rate))),
        lanes(kWindow * internal::kRingingGroup),
        blows(static_cast<std::size_t>(given.max_strikes)) {
    for (std::size_t i = 0; i < blows.size(); ++i) blows[i].next = static_cast<Index>(i) - 1;
    free = given.max_strikes - 1;
  }

  Part& part(Index body, const char* function) {
    if (body < 0 || body >= static_cast<Index>(parts.size()))
      throw InvalidArgument(std::string(function) + ": body is " + std::to_string(body) + ", expected 0 to " +
                            std::to_string(static_cast<Index>(parts.size()) - 1));
    return parts[body];
  }

  void append(Part& p, Index blow) {
    Index* link = &p.blows;
    while (*link >= 0) link = &blows[*link].next;
    *link = blow;
  }

  /// Blows that begin or end at this sample do so.
  void turn_blows(Part& p, std::int64_t sample) {
    for (Index* link = &p.blows; *link >= 0;) {
      const Index i = *link;
      PendingBlow& b = blows[i];
      const Blow& s = b.blow;
      if (b.first == sample) b.forced = p.body.begin(s.at, s.impulse, s.contact_time, b.begun);
      if (b.last != sample) {
        link = &b.next;
        continue;
      }
      p.body.end(s.at, s.impulse, s.contact_time, b.ended);
      *link = b.next;
      b.next = free, free = i;
    }
  }

  /// The first sample after this one at which a blow begins or ends, or `end`.
  std::int64_t next_turn(const Part& p, std::int64_t sample, std::int64_t end) const {
    for (Index i = p.blows; i >= 0; i = blows[i].next) {
      if (blows[i].first > sample) end = std::min(end, blows[i].first);
      if (blows[i].last > sample) end = std::min(end, blows[i].last);
    }
    return end;
  }

  /// sum[n] += what the forces of this body's blows give.
  void add_forced(const Part& p, std::int64_t sample, std::int64_t end, double* sum) const {
    for (Index i = p.blows; i >= 0; i = blows[i].next) {
      const PendingBlow& b = blows[i];
      if (b.first > sample) continue;
      const double omega = 2.0 * std::numbers::pi / b.blow.contact_time;
      for (std::int64_t n = sample; n < end; ++n) {
        const double turn = omega * (static_cast<double>(n - b.first) / options.sample_rate + b.begun);
        sum[n - sample] += b.forced.along * std::cos(turn) + b.forced.across * std::sin(turn);
      }
    }
  }

  void mix(Part& p, const double* sum, std::int64_t samples, float* out) {
    for (std::int64_t n = 0; n < samples; ++n)
      for (std::size_t c = 0; c < p.gains.size(); ++c) {
        *out++ += static_cast<float>(p.gains[c] * sum[n]);
        p.gains[c] += glide_per_sample * (p.targets[c] - p.gains[c]);
      }
  }

  void render_window(std::int64_t samples, float* out) {
    std::array<double, kWindow> sum{};
    for (Part& p : parts) {
      for (std::int64_t at = now, end = now + samples; at < end;) {
        turn_blows(p, at);
        const std::int64_t next = next_turn(p, at, end);
        if (p.body.active_groups() == 0) {
          p.gains = p.targets;
        } else {
          p.body.advance(static_cast<std::size_t>(next - at), lanes.data(), sum.data());
          add_forced(p, at, next, sum.data());
          mix(p, sum.data(), next - at, out + (at - now) * options.channels);
        }
        at = next;
      }
    }
    now += samples;
    if (now % kWindow == 0) settle();
  }

  void settle() {
    ringing = 0;
    for (Part& p : parts) {
      p.body.settle(options.floor);
      if (!p.body.fading()) ringing += static_cast<Index>(p.body.active_groups()) * ModalSound::kGroup;
    }
    while (ringing > options.max_modes) {
      Part* quietest = nullptr;
      for (Part& p : parts)
        if (p.body.active_groups() > 0 && !p.body.touched() && !p.body.fading() &&
            (!quietest || loudness(p) < loudness(*quietest)))
          quietest = &p;
      if (!quietest) return;
      quietest->body.fade_out(fade_per_sample);
      ringing -= static_cast<Index>(quietest->body.active_groups()) * ModalSound::kGroup;
    }
  }

  static double loudness(const Part& p) {
    double most = 0.0;
    for (const double g : p.gains) most = std::max(most, std::abs(g));
    return most * p.body.level();
  }

  SynthesizerOptions options;
  double fade_per_sample, glide_per_sample;
  AlignedArray<double> lanes;
  std::vector<PendingBlow> blows;
  Index free = -1;
  std::vector<Part> parts;
  std::int64_t now = 0;
  Index ringing = 0;
};

Synthesizer::Synthesizer(const SynthesizerOptions& options) {
  options.validate();
  impl_ = std::make_unique<Impl>(options);
}
Synthesizer::~Synthesizer() = default;
Synthesizer::Synthesizer(Synthesizer&&) noexcept = default;
Synthesizer& Synthesizer::operator=(Synthesizer&&) noexcept = default;

Index Synthesizer::add_body(std::shared_ptr<const ModalSound> sound) {
  if (!sound) throw InvalidArgument("add_body: no sound, expected one");
  if (sound->sample_rate() != impl_->options.sample_rate)
    throw InvalidArgument("add_body: the sound is for " + std::to_string(sound->sample_rate()) +
                          " samples per second, expected " + std::to_string(impl_->options.sample_rate));
  const std::vector<double> ones(static_cast<std::size_t>(impl_->options.channels), 1.0);
  impl_->parts.push_back({.body = internal::RingingBody(std::move(sound)), .gains = ones, .targets = ones});
  return bodies() - 1;
}

Index Synthesizer::bodies() const { return static_cast<Index>(impl_->parts.size()); }

void Synthesizer::set_gains(Index body, std::span<const double> gains) {
  Part& p = impl_->part(body, "set_gains");
  if (gains.size() != p.targets.size())
    throw InvalidArgument("set_gains: " + std::to_string(gains.size()) + " gains, expected " +
                          std::to_string(p.targets.size()) + ", one per channel");
  if (!std::ranges::all_of(gains, [](double g) { return std::isfinite(g); }))
    throw InvalidArgument("set_gains: a gain is not finite");
  std::ranges::copy(gains, p.targets.begin());
}

bool Synthesizer::strike(const Blow& blow) {
  Impl& impl = *impl_;
  Part& p = impl.part(blow.body, "strike");
  for (int corner = 0; corner < 3; ++corner) {
    const Index v = blow.at.vertices[corner];
    require(v >= 0 && v < p.body.sound().vertices(), "strike: vertex", v, "one of the body's");
    require(std::isfinite(blow.at.weights[corner]), "strike: weight", blow.at.weights[corner], "a finite number");
  }
  for (int axis = 0; axis < 3; ++axis)
    require(std::isfinite(blow.impulse[axis]), "strike: impulse", blow.impulse[axis], "finite numbers");
  const double tau = blow.contact_time, rate = impl.options.sample_rate;
  require(tau >= 1e-6 && tau <= 10.0, "strike: contact_time", tau, "1e-6 to 10 s");
  require(blow.delay >= 0.0 && blow.delay <= 3600.0, "strike: delay", blow.delay, "0 to 3600 s");
  if (impl.free < 0) return false;

  const Index i = impl.free;
  PendingBlow& b = impl.blows[i];
  impl.free = b.next;
  const double begin = blow.delay * rate, end = begin + tau * rate;  // in samples from now
  b = {.blow = blow,
       .first = impl.now + static_cast<std::int64_t>(std::ceil(begin)),
       .last = impl.now + static_cast<std::int64_t>(std::ceil(end)),
       .begun = (std::ceil(begin) - begin) / rate,
       .ended = (std::ceil(end) - end) / rate};
  impl.append(p, i);
  return true;
}

void Synthesizer::render(std::span<float> interleaved) {
  const auto channels = static_cast<std::size_t>(impl_->options.channels);
  if (interleaved.size() % channels != 0)
    throw InvalidArgument("render: room for " + std::to_string(interleaved.size()) +
                          " numbers, expected a multiple of " + std::to_string(channels) + " channels");
  std::ranges::fill(interleaved, 0.0f);
  float* out = interleaved.data();
  for (auto left = static_cast<std::int64_t>(interleaved.size() / channels); left > 0;) {
    const std::int64_t window = std::min(left, kWindow - impl_->now % kWindow);
    impl_->render_window(window, out);
    out += window * static_cast<std::int64_t>(channels);
    left -= window;
  }
}

std::int64_t Synthesizer::samples() const { return impl_->now; }
Index Synthesizer::ringing_modes() const { return impl_->ringing; }

bool Synthesizer::silent() const {
  return std::ranges::all_of(impl_->parts, [](const Part& p) { return p.body.active_groups() == 0 && p.blows < 0; });
}

double Synthesizer::level(Index body) const { return impl_->part(body, "level").body.level(); }

}  // namespace limber
