/// @file limber/scene/scene_model.h
/// Models as lean as a scene allows, and the manifest of what was left out.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limber/model/asset.h"
#include "limber/model/mode_selection.h"
#include "limber/scene/scene_file.h"

namespace limber {

/// What a scene does without in one model.
struct ModelManifest {
  std::string asset, body;                    ///< key of Scene::assets, name of the body in it
  std::string file;                           ///< as the scene names it
  Index modes_in_asset = 0, modes = 0;        ///< before and after
  std::vector<DroppedMode> dropped;           ///< why each mode went; indices of the asset
  bool volume_block_dropped = false;          ///< nothing in a scene reads it
  std::size_t bytes_in_asset = 0, bytes = 0;  ///< of the shapes in memory (surfaces, bases, volume), before and after
  /// Multiply-adds to reconstruct every render vertex once: 3 V k, before and after.
  std::size_t multiply_adds_in_asset = 0, multiply_adds = 0;
};

/// The models of a scene's bodies, one per asset body in use, and the shapes of its bodies and statics, one per file.
struct SceneModels {
  std::vector<std::shared_ptr<const ModalModel>> of_body;     ///< per Scene::bodies
  std::vector<std::shared_ptr<const Shape>> shape_of_body;    ///< the same; null: none
  std::vector<std::shared_ptr<const Shape>> shape_of_static;  ///< per Scene::statics
  std::vector<ModelManifest> manifest;                        ///< in order of first use
  Warnings warnings;                                          ///< of the files of shapes
};

/// Reads the assets and the files of shapes, and makes the models. @throws InputError (file, or a body's part that the
/// asset does not have)
SceneModels load_models(const Scene& scene);

/// The same with assets that are in memory; shapes are still read from their files. @param assets one per key of
/// Scene::assets
SceneModels make_models(const Scene& scene, const std::map<std::string, Asset>& assets);

/// A model with some of the modes and without its volume block. @param kept ascending, in range
/// @param damping factor on the decays of all modes, ≥ 0 @throws InvalidArgument
std::shared_ptr<const ModalModel> reduce_model(const ModalModel& model, std::span<const Index> kept,
                                               double damping = 1.0);

/// Bytes of a model's surfaces, bases and volume block in memory.
std::size_t shape_bytes(const ModalModelData& data);

}  // namespace limber
