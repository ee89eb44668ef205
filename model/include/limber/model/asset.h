/// @file limber/model/asset.h
/// The asset file: a GLB that any glTF 2.0 viewer opens, with modes as morph targets, and an extension block with what
/// the runtime needs. Reader and writer live together; docs/formats/asset.md describes the file byte by byte.
#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "limber/model/joint_spec.h"
#include "limber/model/modal_model.h"
#include "limber/model/sound_modes.h"

namespace limber {

/// A joint between two bodies of an asset, or a body and the world, as they stand in the input: all its coordinates are
/// 0 there.
struct AssetJoint {
  static constexpr Index kWorld = -1;
  Index a = kWorld, b = 0;    ///< numbers of bodies; b moves relative to a. a may be the world
  JointSpec spec{};           ///< its frame in the input's axes and coordinates (ModalModelData::origin_in_input), m
  double patch_radius = 0.0;  ///< of the surface that the joint sits on, on each part; m, ≥ 0
  bool collide = false;       ///< whether a and b have contacts with each other
  std::vector<JointActuation> coordinates{};  ///< motors, drives and friction of the first so many coordinates

  friend bool operator==(const AssetJoint&, const AssetJoint&) = default;
};

/// One or more bodies baked from one input, and what joins them: with joints, a machine (limber/machine/machine.h).
struct Asset {
  std::vector<std::shared_ptr<const ModalModel>> bodies{};
  Provenance provenance{};
  std::vector<AssetJoint> joints{};           ///< closed chains too
  std::vector<std::array<Index, 2>> apart{};  ///< bodies without contacts with each other, though no joint says so
  /// Per body the estimated relative error of each mode's frequency, f_h/f − 1, against the continuum in the same
  /// polyhedron (docs/modal-analysis.md): above −1, or NaN where none is known, as of modes that join a basis for
  /// static loads. Empty, as a whole or for a body: not told.
  std::vector<std::vector<double>> frequency_errors{};
  /// Per body the modes that one hears, at the vertices of its ModalModel::collision(). Empty, as a whole, or null for
  /// a body: none.
  std::vector<std::shared_ptr<const SoundModes>> sounds{};

  const SoundModes* sound(std::size_t body) const { return body < sounds.size() ? sounds[body].get() : nullptr; }
};

/// The file's bytes. Equal assets give equal bytes, and asset_bytes(asset_from_bytes(b, …)) = b for bytes b of this
/// version.
/// @throws InvalidArgument if there is no body, a name repeats or is not UTF-8, a body has more modes than viewers take
/// (kMaxMorphTargets), a joint or a pair names bodies that are not there or the same one twice, or a joint's numbers
/// are not valid, sounds do not fit, or the file would have more than 4 GiB
std::string asset_bytes(const Asset& asset);

/// Writes whole or not at all. @throws InputError (disk), InvalidArgument
void write_asset(const std::filesystem::path& path, const Asset& asset);

/// An asset from bytes in memory. @param name shown in messages, such as `"bell.glb"` with its quotes
/// Trusts nothing: every count, offset, index and number is checked before use, and the content hash must match (a file
/// that another tool rewrote is a picture of the asset, no longer the asset). @throws InputError
Asset asset_from_bytes(std::string_view bytes, const std::string& name);

/// The same from a file. @throws InputError
Asset read_asset(const std::filesystem::path& path);

}  // namespace limber
