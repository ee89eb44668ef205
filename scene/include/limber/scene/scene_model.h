/// @file limber/scene/scene_model.h
/// Models as lean as a scene allows, and the manifest of what was left out.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "limber/model/asset.h"
#include "limber/model/mode_selection.h"
#include "limber/scene/scene_file.h"

namespace limber {

/// Parts that a scene may do without, each by itself.
enum class LeftOut {
  kModes,             ///< modes that Scene::limits say nobody can see
  kVolume,            ///< the volume block: only bodies that touch themselves read it
  kVertexRows,        ///< shapes vertex by vertex, of bodies that meet nothing (ModalModelData::touchable)
  kResidual,          ///< residual compliance of bodies that meet nothing, or where contacts do not use it
  kSkin,              ///< the modal skin where all bodies bend by their modes alone
  kCollisionSurface,  ///< where the rows and the compliance of its vertices go, no joint is on it and nobody reaches in
  kDrawnSurface,      ///< where nothing is drawn, nobody reaches in and no load asks for a place on it
};
inline constexpr int kLeftOut = 7;
/// "modes", "volume", "vertex_rows", "residual_compliance", "modal_skin", "collision_surface", "drawn_surface".
std::string_view to_string(LeftOut what);

/// Use of a scene beside its own contents.
struct SceneUse {
  bool drawn = true;            ///< World::reconstruct, recordings
  bool reached_into = true;     ///< a program or a person uses points of the bodies' surfaces
  std::vector<LeftOut> keep{};  ///< what is not to be left out, though the scene could do without
};

/// One thing that is left out of a model. Motion is the same to round-off but for kModes.
struct ModelSaving {
  LeftOut what = LeftOut::kModes;
  std::string why;
  std::size_t bytes = 0;  ///< that the lean model would have more of
};

/// Parts that a scene does without in one model.
struct ModelManifest {
  std::string asset, body;              ///< key of Scene::assets, name of the body in it
  std::string file;                     ///< as the scene names it
  Index modes_in_asset = 0, modes = 0;  ///< before and after
  std::vector<DroppedMode> dropped;     ///< why each mode went; indices of the asset
  std::vector<ModelSaving> left_out;    ///< in the order of LeftOut
  /// m, the most by which a vertex is elsewhere without the dropped modes, while a force of at most
  /// SceneLimits::max_force acts on one point: Σ of largest_displacement(). None where that is not given.
  std::optional<double> dropped_displacement;
  std::size_t bytes_in_asset = 0, bytes = 0;  ///< in memory (shape_bytes), before and after
  /// Multiply-adds to reconstruct every render vertex once: 3 V k, before and after.
  std::size_t multiply_adds_in_asset = 0, multiply_adds = 0;

  bool leaves_out(LeftOut what) const;
};

/// The models of a scene's bodies, one per asset body in use, and the shapes of its bodies, statics and
/// sensors, one per file.
struct SceneModels {
  std::vector<std::shared_ptr<const ModalModel>> of_body;        ///< per Scene::bodies
  std::vector<std::shared_ptr<const Shape>> shape_of_body;       ///< the same; null: none
  std::vector<std::shared_ptr<const SoundModes>> sound_of_body;  ///< the same; null: one does not hear it
  std::vector<std::shared_ptr<const Shape>> shape_of_static;     ///< per Scene::statics
  std::vector<std::shared_ptr<const Shape>> shape_of_sensor;     ///< per Scene::sensors
  std::vector<ModelManifest> manifest;                           ///< in order of first use
  Warnings warnings;                                             ///< of the files of shapes
};

/// Reads the assets and the files of shapes, and makes the models. @throws InputError (file, or a body's part that the
/// asset does not have)
SceneModels load_models(const Scene& scene, const SceneUse& use = {});

/// The same with assets that are in memory; shapes are still read from their files. @param assets one per key of
/// Scene::assets
SceneModels make_models(const Scene& scene, const std::map<std::string, Asset>& assets, const SceneUse& use = {});

/// A model with some of the modes and without its volume block. @param kept ascending, in range
/// @param damping factor on the decays of all modes, ≥ 0. @param stiffness factor on Young's modulus, > 0: damping
/// ratios stay @throws InvalidArgument
std::shared_ptr<const ModalModel> reduce_model(const ModalModel& model, std::span<const Index> kept,
                                               double damping = 1.0, double stiffness = 1.0);

/// Makes a body of an asset rigid: leaves out all its modes, as reduce_model() does, and their frequencies' errors.
/// @throws InvalidArgument if the asset has no such body
void make_rigid(Asset& asset, std::size_t body);

/// Bytes of a model's surfaces, bases, vertex rows, volume block, residual compliance and skin in memory.
std::size_t shape_bytes(const ModalModelData& data);

}  // namespace limber
