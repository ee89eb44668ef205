// 19_play_a_bar: what does a glockenspiel's bar sound like?
//   bake:  scripts/make-bar 0.2032 0.0254 0.00635 24 3 1 > steel_bar.mesh
//          limber-precompute steel_bar.mesh --material steel --elements quadratic --modes 2 --sound
//          --loss-factor 0.002 -o steel_bar.glb
//   run:   19_play_a_bar steel_bar.glb steel_bar.wav
//   see:   a bar of 8 x 1 x 1/4 inch at its calculated pitch, its loudest pressure at one metre, and how long it rings;
//          steel_bar.wav plays three blows, by a hard, a wooden and a rubber mallet
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <vector>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/model/asset.h"
#include "limber/sound/radiation.h"
#include "limber/sound/synthesizer.h"
#include "limber/sound/wav.h"

int main(int argc, char** argv) try {
  const limber::Asset asset = limber::read_asset(argc > 1 ? argv[1] : "steel_bar.glb");
  const limber::SoundModes* modes = asset.sound(0);
  if (!modes) throw limber::InputError("the asset has no sound, expected one baked with --sound");
  const limber::ModalSurface& surface = asset.bodies[0]->collision();

  constexpr double kRate = 48e3;
  const auto gains = limber::monopole_gains(*modes, surface.rest, surface.triangles);
  limber::Synthesizer synthesizer({.sample_rate = kRate, .channels = 1});
  const limber::Index bar = synthesizer.add_body(std::make_shared<limber::ModalSound>(*modes, gains, kRate));

  // The middle of the upper face.
  limber::Index middle = 0;
  const auto distance = [&](limber::Index v) { return (surface.rest[v] - limber::Vec3f(0, 0, 0.003175f)).norm(); };
  for (limber::Index v = 1; v < surface.vertices(); ++v)
    if (distance(v) < distance(middle)) middle = v;
  const limber::StruckPoint at{.vertices = {middle, middle, middle}};
  const double mallets[] = {5e-5, 4e-4, 1.5e-3};  // s of contact
  for (int i = 0; i < 3; ++i)
    synthesizer.strike({.body = bar, .at = at, .impulse = {0, 0, -0.02}, .contact_time = mallets[i], .delay = 1.0 * i});

  std::vector<float> samples;  // Pa
  while (!synthesizer.silent()) {
    samples.resize(samples.size() + 4800);
    synthesizer.render(std::span(samples).last(4800));
  }
  float loudest = 0.0f;
  for (const float p : samples) loudest = std::max(loudest, std::abs(p));
  std::printf("lowest mode %.1f Hz, builders calculate 816.8 Hz\n", std::sqrt(modes->eigenvalues[0]) / 6.283185307);
  std::printf("%d modes to 20 kHz, loudest %.3g Pa, rings %.2f s\n", modes->modes(), loudest,
              static_cast<double>(samples.size()) / kRate);
  for (float& p : samples) p *= 0.9f / loudest;
  limber::write_file(argc > 2 ? argv[2] : "steel_bar.wav", limber::wav_bytes(samples, 1, static_cast<int>(kRate)));
} catch (const std::exception& e) {
  std::fprintf(stderr, "19_play_a_bar: %s\n", e.what());
  return 1;
}
