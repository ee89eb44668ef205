/// @file limber/precompute/bake.h
/// The whole offline pipeline: a tetrahedral mesh and its materials in, an asset and a report out.
///
///   split into bodies → K, M → modes → embed the surfaces → choose the modes → ModalModel
///
/// What `limber-precompute` does after reading its files; call it directly to bake inside another tool.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "limber/core/jobs.h"
#include "limber/mesh/grouped_surface.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/model/asset.h"
#include "limber/model/material.h"
#include "limber/model/mode_selection.h"
#include "limber/precompute/material_regions.h"
#include "limber/precompute/modal_analysis.h"

namespace limber {

/// Which nodes of a mesh are meant: to be held, or to be loaded.
struct NodesOfGroup {
  std::string name;  ///< a node group of the mesh
};
struct NodesInBox {
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();  ///< m, mesh coordinates, faces included
};
struct NodesByIndex {
  std::vector<Index> nodes;  ///< 0-based, in order of appearance in the file
};
using NodeSelector = std::variant<NodesOfGroup, NodesInBox, NodesByIndex>;

/// Reads "group:NAME", "box:x0,y0,z0,x1,y1,z1" or "nodes:I,J,…". @throws InvalidArgument showing the three forms
NodeSelector parse_node_selector(std::string_view text);

/// Nodes that a selector names, ascending. @throws InvalidArgument if a group is unknown (naming the nearest), an index
/// is out of range, or nothing is selected
std::vector<Index> select_nodes(const TetMesh& mesh, const NodeSelector& selector);

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
  /// The surface that the mesh fills, where regions are told by its faces: names of the materials' table that no region
  /// of the mesh has, and NearFaces.
  std::optional<GroupedSurface> named_faces = {};
  Provenance provenance = {};
};

/// A patch of the collision surface that something is attached to: all vertices within a distance, or the nearest one,
/// weighted by the area between them, as JointAttachment (limber/engine/world.h) takes them.
struct AttachmentPatch {
  Vec3 center = Vec3::Zero();  ///< m, mesh coordinates
  double radius = 0.0;         ///< m, ≥ 0
};

/// Static response of the modes that are not kept (limber/model/residual_compliance.h).
struct ResidualOptions {
  /// At these nodes static loads are answered exactly: up to three further modes per node join the basis.
  std::vector<NodeSelector> nodes = {};
  /// Forces and moments that act on these patches as wholes, as those of joints do, are answered exactly: up to six
  /// further modes per patch. On the body that has the node nearest to the centre.
  std::vector<AttachmentPatch> patches = {};
  /// Store the residual compliance of the collision surface: three solves per vertex.
  bool surface = false;
  /// Bytes up to which all pairs of the surface's vertices are stored; above, single vertices alone.
  double max_full_bytes = 32e6;
  void validate() const;  ///< @throws InvalidArgument naming the field
};

/// A modal skin, the map that bends far (limber/model/modal_skin.h): of free bodies and of those held at three points
/// or more; bodies that turn about a point or a line get none.
struct SkinOptions {
  bool make = false;
  /// Handles, the ground not among them; 0: the fewest of 8, 12, … 24 with which no node turns by more than 13° apart
  /// from its handles in the mean, when each of the lowest three modes by itself has the energy that turns the softest
  /// by 120° (free bodies, whose ends turn to both sides: 60°). If even 24 do not suffice, 24.
  Index handles = 0;
  void validate() const;  ///< @throws InvalidArgument naming the field
};

/// Modes that one hears (limber/model/sound_modes.h), at the vertices of the surface that touches. Each decays by the
/// loss factors of its body's materials, weighted by its elastic energy in them:
///
///   ξ = ½ η √λ,   η = Σ_r η_r U_r / Σ_r U_r
///
/// or, where a material has none, by BakeOptions::damping.
struct SoundOptions {
  bool make = false;
  Index modes = 1000;                                ///< most, lowest first; ≥ 1
  double lowest_hz = 20.0, highest_hz = 20e3;        ///< what one hears; 0 < lowest < highest
  std::optional<double> loss_factor = std::nullopt;  ///< η of the whole body in place of its materials'; above 0, to 1
  void validate() const;                             ///< @throws InvalidArgument naming the field
};

/// Nodes per tet (limber/precompute/fem.h). Ten bend where four are far too stiff, at three to four times the work per
/// tet.
enum class Elements {
  kAsGiven,    ///< as the mesh has them
  kLinear,     ///< four: mid-edge nodes that the mesh has are left out
  kQuadratic,  ///< ten: edges get nodes in their middles, which are held where both ends of the edge are
};

struct BakeOptions {
  MaterialTable materials = {};              ///< by region of the mesh, or by faces; "*" is the rest
  std::vector<MaterialRegion> regions = {};  ///< count over these, later ones over earlier
  std::vector<NodeSelector> fixed = {};      ///< their union is held
  Elements elements = Elements::kAsGiven;
  RayleighDamping damping = {};
  ModalAnalysisOptions analysis = {};
  SceneLimits limits = {};
  ResidualOptions residual = {};
  SkinOptions skin = {};
  SoundOptions sound = {};
  /// Most triangles of the collision surface, by edge collapse; 0: as it is.
  Index collision_triangles = 0;
  bool volume_block = false;  ///< bake all nodes, so that any initial deformation can be given to the runtime
  void validate() const;      ///< @throws InvalidArgument naming the field
};

struct EmbeddingReport {
  Index vertices = 0;
  Index outside = 0;          ///< vertices outside every tet, moved by the nearest
  double max_distance = 0.0;  ///< the farthest of these, m
};

/// Result of ResidualOptions.
struct ResidualReport {
  Index modes = 0;                                 ///< joined the basis; among the kept, not among frequencies_hz
  std::vector<CapturedLoad> captured{};            ///< nodes, then patches; input coordinates
  std::optional<ResidualCompliance::Form> form{};  ///< of the stored compliance; none: not asked for
  Index vertices = 0;
  std::size_t bytes = 0;
  double seconds = 0.0;
};

/// Result of SkinOptions.
struct SkinReport {
  static constexpr std::array<double, 4> kDegrees{30.0, 60.0, 90.0, 120.0};
  /// A mode by itself, turned so far that some node turns by kDegrees[i].
  struct Mode {
    Index mode = 0;                                ///< of the body's
    std::array<double, kDegrees.size()> energy{};  ///< elastic energy of the shape over the mode's ½ λ z²
  };
  Index handles = 0;        ///< 0: none was made
  bool ground = false;      ///< the last handle holds the fixed nodes
  double spread = 0.0;      ///< rad, the largest: what SkinOptions::handles bounds
  std::vector<Mode> modes;  ///< the lowest three that turn anything
  std::size_t bytes = 0;
  double seconds = 0.0;
};

/// Result of SoundOptions.
struct SoundReport {
  Index modes = 0;                               ///< kept; 0 where none was asked for
  Index audible = 0;                             ///< that the mesh has from lowest_hz to highest_hz
  Index overdamped = 0;                          ///< of these, left out as they do not swing
  double lowest_hz = 0.0, highest_hz = 0.0;      ///< of those kept
  double lowest_loss = 0.0, highest_loss = 0.0;  ///< 2ξ/√λ of those kept
  std::size_t bytes = 0;
  double seconds = 0.0;
};

/// The tets of one body, as they were analysed.
struct BodyMeshReport {
  Index nodes = 0, tets = 0;
  Index nodes_per_tet = 4;  ///< 4 or 10
};

/// A solid's mass and how it is spread. Input coordinates.
struct SolidReport {
  double mass = 0.0;                   ///< kg
  double volume = 0.0;                 ///< m³
  Vec3 center_of_mass = Vec3::Zero();  ///< m
  Mat3 inertia = Mat3::Zero();         ///< about the centre of mass, input axes, kg·m²
};

/// What one body has of a region. A tet is in it by its centroid.
struct RegionReport {
  std::string name;
  Index tets = 0;
  double volume = 0.0, mass = 0.0;  ///< m³, kg
};

/// Elastic modes of one body, before and after selection.
struct BodyModesReport {
  std::vector<double> frequencies_hz;  ///< before selection, ascending
  /// f_h/f − 1 of each of frequencies_hz against the continuum in the tets' own polyhedron, estimated by recovered
  /// stresses (docs/modal-analysis.md).
  std::vector<double> frequency_errors;
  std::vector<double> kept_errors;  ///< the asset's: of the modes kept, mechanisms and those of static loads too
  ModeSelection selection;          ///< indices into frequencies_hz
  bool all = false;                 ///< frequencies_hz holds every mode the mesh has
};

struct BodySurfacesReport {
  EmbeddingReport render, collision;
  Index collision_triangles = 0;
  double collision_error = 0.0;  ///< what leaving out triangles moved the collision surface by, estimated, m
};

struct BodySeconds {
  EigenSeconds modes;
  double embed = 0.0, estimate = 0.0;
};

/// Result of one body.
struct BodyReport {
  std::string name;
  BodyMeshReport mesh;
  SolidReport solid;
  std::vector<RegionReport> regions;  ///< in the order of their first tets
  BodyFreedom freedom;
  BodyModesReport modes;
  EigenAccuracy accuracy;
  int solves = 0;  ///< right-hand sides solved
  BodySurfacesReport surfaces;
  ResidualReport residual;
  SkinReport skin;
  SoundReport sound;
  BodySeconds seconds;
};

struct BakeResult {
  Asset asset;
  std::vector<BodyReport> bodies;  ///< in the asset's order
};

/// @throws InvalidArgument (options), InputError (mesh and materials do not fit), ComputationError
BakeResult bake(const BakeInput& input, const BakeOptions& options, Warnings& warnings, Jobs& jobs = serial_jobs());

/// The modes of a band alone, one slice for each body, for ModalAnalysisOptions::slices of a bake of the same input.
/// @throws as bake()
std::vector<SpectrumSlice> bake_slices(const BakeInput& input, const BakeOptions& options, const FrequencyBand& band,
                                       Warnings& warnings, Jobs& jobs = serial_jobs());

/// eigenproblem_bytes() of the input's bodies. @throws as bake()
std::string bake_eigenproblems(const BakeInput& input, const BakeOptions& options, Warnings& warnings,
                               Jobs& jobs = serial_jobs());

}  // namespace limber
