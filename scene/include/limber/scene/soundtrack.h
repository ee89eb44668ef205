/// @file limber/scene/soundtrack.h
/// A played scene as one hears it at its microphones.
///
/// Every blow of the run (RunOptions::keep_blows) rings the modes that the body's asset has for sound (Asset::sounds)
/// at the nearest point of the surface that touches. A blow of a contact lasts as long as Hertz's collision of the two
/// bodies (limber/sound/contact_time.h); those without a sound are rigid in it. Each microphone hears p = g q̇/r
/// (limber/sound/radiation.h) with its distance r from the last blow, no less than the radius of the ball that has the
/// body's surface. Directions, walls and the time that sound takes are left out; bodies that roll are silent.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "limber/model/asset.h"
#include "limber/scene/run.h"
#include "limber/scene/scene_file.h"

namespace limber {

struct SoundtrackOptions {
  double sample_rate = 48e3;  ///< 1/s, 8,000 to 384,000
  double tail = 10.0;         ///< s, ≥ 0: after the scene's end, the most that bodies may go on ringing
  void validate() const;      ///< @throws InvalidArgument naming the field and its value
};

struct Soundtrack {
  std::vector<float> samples;      ///< Pa, [sample][channel], from the scene's start
  int channels = 0;                ///< Scene::microphones
  double sample_rate = 0.0;        ///< 1/s
  double loudest = 0.0;            ///< the largest sample, Pa
  std::int64_t blows = 0;          ///< on bodies that have a sound
  std::int64_t silent_bodies = 0;  ///< without one
};

/// @param assets one per key of Scene::assets. @param run of this scene
/// @throws InvalidArgument for options, a body that its asset does not have, and a run of another scene
Soundtrack make_soundtrack(const Scene& scene, const std::map<std::string, Asset>& assets, const RunResult& run,
                           const SoundtrackOptions& options = {});

}  // namespace limber
