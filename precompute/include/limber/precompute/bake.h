/// @file limber/precompute/bake.h
/// The whole offline pipeline: a tetrahedral mesh and its materials in, an asset and a report out.
///
///   split into bodies → K, M → modes → embed the surfaces → choose the modes → ModalModel
///
/// What `limber-precompute` does after reading its files; call it directly to bake inside another tool.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "limber/core/jobs.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/model/asset.h"
#include "limber/model/material.h"
#include "limber/model/mode_selection.h"
#include "limber/precompute/modal_analysis.h"

namespace limber {

/// Which nodes to hold.
struct FixGroup {
  std::string name;  ///< a node group of the mesh
};
struct FixBox {
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();  ///< m, mesh coordinates, faces included
};
struct FixNodes {
  std::vector<Index> nodes;  ///< 0-based, in order of appearance in the file
};
using FixSelector = std::variant<FixGroup, FixBox, FixNodes>;

/// Reads "group:NAME", "box:x0,y0,z0,x1,y1,z1" or "nodes:I,J,…". @throws InvalidArgument showing the three forms
FixSelector parse_fix_selector(std::string_view text);

/// Nodes that a selector names, ascending. @throws InvalidArgument if a group is unknown (naming the nearest), an index
/// is out of range, or nothing is selected
std::vector<Index> select_nodes(const TetMesh& mesh, const FixSelector& selector);

/// Rayleigh damping: 2ξ_i = mass_proportional + stiffness_proportional · λ_i.
struct RayleighDamping {
  double stiffness_proportional = 0.0;  ///< a₁, s; ≥ 0
  double mass_proportional = 0.0;       ///< a₂, 1/s; ≥ 0
  void validate() const;                ///< @throws InvalidArgument naming the field

  /// The damping with ratio ζ at two frequencies, Hz: a₁ = 2ζ/(ω₁+ω₂), a₂ = 2ζω₁ω₂/(ω₁+ω₂). Less between them, more
  /// outside.
  static RayleighDamping from_ratio(double ratio, double first_hz, double second_hz);
};

struct BakeInput {
  std::string name = {};                      ///< of the body; several bodies become NAME_1, NAME_2, …
  TetMesh mesh = {};                          ///< validated
  std::optional<SurfaceMesh> render = {};     ///< what is drawn; none: the boundary of the mesh
  std::optional<SurfaceMesh> collision = {};  ///< what touches; none: the boundary of the mesh
  Provenance provenance = {};
};

struct BakeOptions {
  MaterialTable materials = {};         ///< by region; "*" is the rest
  std::vector<FixSelector> fixed = {};  ///< their union is held
  RayleighDamping damping = {};
  ModalAnalysisOptions analysis = {};
  SceneLimits limits = {};
  bool volume_block = false;  ///< bake all nodes, so that any initial deformation can be given to the runtime
  void validate() const;      ///< @throws InvalidArgument naming the field
};

struct EmbeddingReport {
  Index vertices = 0;
  Index outside = 0;          ///< vertices outside every tet, moved by the nearest
  double max_distance = 0.0;  ///< the farthest of these, m
};

/// What was made of one body. Masses in kg, lengths in m, input coordinates.
struct BodyReport {
  std::string name;
  FrameMotion motion = FrameMotion::kFree;
  Index nodes = 0, tets = 0;
  double mass = 0.0, volume = 0.0;
  Vec3 center_of_mass = Vec3::Zero();
  Mat3 inertia = Mat3::Zero();  ///< about the centre of mass, input axes, kg·m²
  int zero_modes = 0;           ///< rigid motions and mechanisms
  int mechanisms = 0;
  std::vector<double> frequencies_hz;  ///< elastic, before selection, ascending
  ModeSelection selection;             ///< indices into frequencies_hz
  bool all_modes = false;              ///< frequencies_hz holds every mode the mesh has
  double residual_max = 0.0, residual_bound = 0.0, backward_error_max = 0.0, orthogonality_max = 0.0;
  bool certified = false;
  int solves = 0;
  EmbeddingReport render, collision;
  ModalAnalysis::Seconds seconds;
  double seconds_embed = 0.0;
};

struct BakeResult {
  Asset asset;
  std::vector<BodyReport> bodies;  ///< in the asset's order
};

/// @throws InvalidArgument (options), InputError (mesh and materials do not fit), ComputationError
BakeResult bake(const BakeInput& input, const BakeOptions& options, Warnings& warnings, Jobs& jobs = serial_jobs());

}  // namespace limber
