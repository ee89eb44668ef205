/// @file limber/scene/recording.h
/// A trajectory as a GLB that any glTF viewer plays: a mesh with its modes as morph targets per model, a node per body,
/// keys for place, attitude and weights. docs/formats/recording.md describes the file.
///
/// Signed (the default): target k is A_k φ_k, weight z_k/A_k in [−1, 1], with A_k the largest |z_k| recorded.
/// Unsigned, for viewers that clamp weights at 0: the base is P − Σ A_k φ_k, target k is 2 A_k φ_k, weight
/// ½ + z_k/(2A_k) in [0, 1]. Both show the same shapes; base normals are made unit again, and each vertex's normal
/// targets divided by the same number, so that both are lit alike too.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limber/core/types.h"
#include "limber/scene/run.h"

namespace limber {

struct RecordingOptions {
  bool unsigned_weights = false;
  double slow_motion = 1.0;  ///< seconds shown per second simulated; > 0
  /// A mode whose largest recorded displacement is below this part of the render surface's bounding-box diagonal is
  /// left out: at the default it is lost in the float32 rest positions anyway. ≥ 0
  double invisible = 1e-7;
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

/// Recorded modes of one model.
struct RecordedModel {
  std::string name;
  Index modes = 0;              ///< of the model
  std::vector<Index> recorded;  ///< those that are targets, ascending
  std::vector<double> scales;   ///< A_k of these, kg^½·m
  std::vector<Index> too_fast;  ///< recorded ones above half the key rate: right at the keys, wrong between them
};

struct Recording {
  std::string glb;                    ///< the file's bytes; the same trajectory gives the same bytes
  std::vector<RecordedModel> models;  ///< in order of first use
  Warnings warnings;                  ///< modes or turns too fast for the key rate, targets beyond what viewers hold
};

/// @throws InvalidArgument if the trajectory is empty or its times are not ascending
Recording make_recording(const Trajectory& trajectory, const RecordingOptions& options = {});

/// Bodies where they stand in their input, and an animation per mode of each that swings it once from rest to either
/// side, two seconds long: by its modal skin where it has one, which sliders of the asset's morph targets cannot show.
/// Each mode swings with the energy that bends the softest by 60°, and as far as its slider (mode_scales) at least.
/// @return the file's bytes. Animations are called as the asset's morph targets, after the body's name where there are
/// several bodies
std::string make_mode_clips(std::span<const std::shared_ptr<const ModalModel>> models);

}  // namespace limber
