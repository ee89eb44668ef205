/// @file bake_body.h
/// Bakes one connected body.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "limber/model/sound_modes.h"
#include "limber/precompute/bake.h"

namespace limber::internal {

struct BodyInput {
  std::string name;
  SubMesh part;
  std::vector<Index> fixed;           // of part.mesh
  std::vector<Index> residual_nodes;  // of part.mesh
  std::vector<AttachmentPatch> patches;

  bool answers_loads() const { return !residual_nodes.empty() || !patches.empty(); }
  std::optional<SurfaceMesh> render, collision;
};

struct BakedBody {
  std::shared_ptr<const ModalModel> model;
  std::shared_ptr<const SoundModes> sound;  // null: not asked for
};

/// @param materials one per region of the whole mesh
BakedBody bake_body(const BodyInput& in, std::span<const Material> materials, const BakeOptions& options,
                    BodyReport& report, Warnings& warnings, Jobs& jobs);

}  // namespace limber::internal
