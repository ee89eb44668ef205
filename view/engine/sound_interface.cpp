// The synthesizer as plain C functions, for the thread that plays: what web/sound_worklet.js calls. sound_render() and
// sound_strike() allocate nothing.
#include <emscripten.h>

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "limber/sound/modal_sound.h"
#include "limber/sound/synthesizer.h"

namespace {

using limber::Index;

constexpr int kChannels = 2;
constexpr int kMostSamples = 128;  // Web Audio renders so many at a time

double rate = 0.0;
std::optional<limber::Synthesizer> synthesizer;
std::vector<std::shared_ptr<const limber::ModalSound>> kinds;
std::array<float, kChannels * kMostSamples> heard;

limber::Vec3 vector(const double* n) { return {n[0], n[1], n[2]}; }

}  // namespace

extern "C" {

EMSCRIPTEN_KEEPALIVE void sound_open(double sample_rate) {
  rate = sample_rate;
  synthesizer.emplace(limber::SynthesizerOptions{.sample_rate = rate, .channels = kChannels});
}

/// Three arrays of `modes` numbers one after the other, λ, ξ and gains, and shapes as SoundModes has them.
EMSCRIPTEN_KEEPALIVE void sound_add_kind(int modes, int vertices, const double* numbers, const float* shapes) {
  limber::SoundModes m;
  m.eigenvalues.assign(numbers, numbers + modes);
  m.decays.assign(numbers + modes, numbers + 2 * modes);
  m.vertices = static_cast<Index>(vertices);
  m.shapes.assign(shapes,
                  shapes + std::size_t{3} * static_cast<std::size_t>(modes) * static_cast<std::size_t>(vertices));
  const std::vector<double> gains(numbers + 2 * modes, numbers + 3 * modes);
  kinds.push_back(std::make_shared<limber::ModalSound>(m, gains, rate));
}

EMSCRIPTEN_KEEPALIVE void sound_add_body(int kind) { synthesizer->add_body(kinds[static_cast<std::size_t>(kind)]); }

/// 14 numbers: body, vertices, weights and impulse (3 each), contact time, delay, gains of both channels.
EMSCRIPTEN_KEEPALIVE int sound_strike(const double* n) {
  limber::Blow blow{.body = static_cast<Index>(n[0]), .impulse = vector(n + 7), .contact_time = n[10], .delay = n[11]};
  for (std::size_t i = 0; i < 3; ++i) {
    blow.at.vertices[i] = static_cast<Index>(n[1 + i]);
    blow.at.weights[i] = n[4 + i];
  }
  synthesizer->set_gains(blow.body, {n + 12, std::size_t{kChannels}});
  return synthesizer->strike(blow) ? 1 : 0;
}

/// At most 128 samples, left and right by turns.
EMSCRIPTEN_KEEPALIVE const float* sound_render(int samples) {
  synthesizer->render({heard.data(), std::size_t{kChannels} * static_cast<std::size_t>(samples)});
  return heard.data();
}

}  // extern "C"
