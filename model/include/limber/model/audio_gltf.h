/// @file limber/model/audio_gltf.h
/// Modes that one hears as other programs exchange them: the draft glTF extension KHR_audio_rigid_bodies (K. Hiner,
/// glTF_PhysicalAudio, as of August 2026).
///
/// Of it: `modalModels` with `frequencies` (damped, Hz), `decayRates` (1/s), `positions`, `shapes` (mass-normalised,
/// mode after mode), `indices` and `massProperties`, and nodes that name theirs. Not of it: acoustic materials and
/// surfaces, which rubbing needs, and `gain`. Numbers are single precision there.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "limber/core/types.h"
#include "limber/model/asset.h"
#include "limber/model/sound_modes.h"

namespace limber {

/// A GLB in which each body of an asset is a node with its render surface at rest and, where it has a sound, its modal
/// model, sampled at the surface that touches. Any viewer shows it.
/// @throws InvalidArgument if no body has a sound of one mode or more, and as asset_bytes()
std::string audio_glb_bytes(const Asset& asset);

/// A modal model of a file: its modes at sample points, and the surface that these span.
struct AudioModel {
  std::string name{};                 ///< of the model, or of the first node that names it; may be empty
  SoundModes modes{};                 ///< λ = (2πf)² + d²; rigid to blows, as the file does not tell
  std::vector<Vec3f> rest{};          ///< m, the node's axes
  std::vector<Triangle> triangles{};  ///< may be empty
  double mass = 0.0;                  ///< kg; 0: not told
};

/// All modal models of a GLB, whoever wrote it, their modes by frequency. Modes that do not decay are left out with a
/// warning. Other parts of the file are not looked at.
/// @param name shown in messages, such as `"bell.glb"`
/// @throws InputError if it is no GLB, has no such extension, or breaks the draft's requirements on accessors
std::vector<AudioModel> audio_models_from_glb(std::string_view bytes, const std::string& name, Warnings& warnings);

}  // namespace limber
