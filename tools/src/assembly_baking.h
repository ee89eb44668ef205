/// @file assembly_baking.h
/// limber-precompute on an assembly: every component a body, and the joints between them as a scene.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "limber/articulation/joints_file.h"
#include "limber/precompute/bake.h"
#include "limber/precompute/tetrahedralise.h"
#include "program.h"

namespace limber::tools {

struct AssemblyOptions {
  /// None: the file's groups where joints are to be found and no shell has triangles of two, else shared vertices.
  std::optional<ComponentRule> components{};
  std::string joints_file{};          ///< empty: the joints are detected
  std::vector<std::string> rigid{};   ///< components without modes; "*": all
  std::vector<std::string> ground{};  ///< components that stand still; none: the first
  bool free = false;                  ///< none stands still
  bool joint_compliance = true;       ///< parts that bend also answer what their joints do to them as a whole
  double scale = 1.0;                 ///< metres per unit of the file
  TetrahedralisationOptions tets{};
};

struct BakedAssembly {
  Asset asset;  ///< a body per component, of its name, and the joints
  std::vector<BodyReport> bodies;
  JointsFile joints;  ///< lengths in the file's unit
};

/// @param bake its materials are named by components; "*" is the rest
BakedAssembly bake_assembly(Program& program, const std::string& path, const AssemblyOptions& options,
                            const BakeOptions& bake, Jobs& jobs);

/// A scene in which the machine stands as drawn, z up, and moves by its joints under gravity.
/// @param asset file name, relative to the scene's folder
std::string machine_scene(const std::string& name, const std::string& asset);

}  // namespace limber::tools
