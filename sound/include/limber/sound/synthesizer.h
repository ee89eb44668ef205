/// @file limber/sound/synthesizer.h
/// Bodies that ring: samples of what one hears of blows.
///
/// Each mode is a damped oscillator under the force of a blow, a raised cosine of duration τ and impulse j [van den
/// Doel, Kry and Pai, FoleyAutomatic, SIGGRAPH 2001]:
///
///   q̈ + 2ξ q̇ + λ q = wᵀ j (1 − cos Ωt)/τ,   0 ≤ t ≤ τ,   Ω = 2π/τ                       (1)
///
/// With s = −ξ + iω and c of ModalSound, one hears Σ gain q̇ = Σ Re z of
///
///   z(t) = wᵀj c/τ [ (s cos Ωt − Ω sin Ωt)/(s² + Ω²) − 1/s + Ω²/(s (s² + Ω²)) e^{st} ]   (2)
///
/// while bodies touch. The last term turns on by z ← e^{s/rate} z from sample to sample; the others are one cosine for
/// all modes together. As Ωτ = 2π, the same with the other sign, from t = τ on, takes the force away. So blows are
/// exact at any instant between samples, for any τ, and what one hears begins and ends smoothly.
///
/// A body falls silent as the bound Σ|z| on all that is still to come is below `floor`: it ends with a step no larger
/// than that. Where more than `max_modes` modes ring, the quietest bodies are damped by hand, so to say, z decaying by
/// e^{−t/fade}.
///
///   Synthesizer synthesizer({.sample_rate = 48e3});
///   Index bell = synthesizer.add_body(std::make_shared<ModalSound>(modes, gains, 48e3));
///   synthesizer.strike({.body = bell, .impulse = {0, 0, -0.1}, .contact_time = 1e-3});
///   synthesizer.render(interleaved);
///
/// strike(), set_gains() and render() allocate nothing and take no lock. Samples depend on calls and the samples
/// between them alone: the same bits, however they are cut into render() calls. For one thread at a time.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "limber/core/types.h"
#include "limber/sound/modal_sound.h"

namespace limber {

struct SynthesizerOptions {
  double sample_rate = 48e3;  ///< 1/s, 8,000 to 384,000
  int channels = 2;           ///< of the output, 1 to 16
  int max_strikes = 256;      ///< that wait or touch at a time, ≥ 1
  Index max_modes = 4096;     ///< that ring at a time, ≥ 1
  /// What is inaudible, in the unit of the gains; > 0. By monopole_gains(): 20 µPa at one metre, 0 dB of sound
  /// pressure level, the threshold of hearing at 1 kHz.
  double floor = 20e-6;
  double fade = 3e-3;     ///< s, > 0: time constant of bodies that give way to louder ones
  double glide = 5e-3;    ///< s, > 0: time constant by which channels' gains follow set_gains()
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

/// One blow.
struct Blow {
  Index body = 0;
  StruckPoint at{};
  Vec3 impulse = Vec3::Zero();  ///< on the body, body frame, N·s
  double contact_time = 1e-3;   ///< τ, s, 1e-6 to 10: contact_time.h
  double delay = 0.0;           ///< s, 0 to 3600, from the first sample of the coming render() to the touch
};

class Synthesizer {
 public:
  /// @throws InvalidArgument as SynthesizerOptions::validate()
  explicit Synthesizer(const SynthesizerOptions& options = {});
  ~Synthesizer();
  Synthesizer(Synthesizer&&) noexcept;
  Synthesizer& operator=(Synthesizer&&) noexcept;

  /// Adds a silent body whose gains are 1 on all channels, and returns its number, counted from 0. Allocates.
  /// @throws InvalidArgument for null and another sample rate
  Index add_body(std::shared_ptr<const ModalSound> sound);
  Index bodies() const;

  /// How loud a body is on each channel: distance and direction are the caller's. Near 1/r, r in metres.
  /// A silent body takes them at once, one that rings in `glide`.
  /// @param gains one per channel. @throws InvalidArgument for another count, and numbers that are not finite
  void set_gains(Index body, std::span<const double> gains);

  /// Takes a blow. @return false where max_strikes wait or touch: it is not heard
  /// @throws InvalidArgument for a body or vertex that is none and numbers out of range
  bool strike(const Blow& blow);

  /// Replaces `interleaved`, [sample][channel], by the coming samples.
  /// @throws InvalidArgument for a length that is no multiple of the channels
  void render(std::span<float> interleaved);

  std::int64_t samples() const;    ///< rendered so far
  Index ringing_modes() const;     ///< as of the last 64th sample
  bool silent() const;             ///< nothing rings, touches or waits: all further samples are 0
  double level(Index body) const;  ///< a bound on what it still gives at unit gain, as of the last 64th sample

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
