/// @file limber/model/modal_model.h
/// One deformable body, baked: everything the runtime needs and nothing that changes.
///
///   K w_i = λ_i M w_i,  WᵀMW = I                    modes
///   z̈_i + 2ξ_i ż_i + λ_i z_i = g_i = w_iᵀ f        their motion; ξ_i = (a₁λ_i + a₂)/2
///   p_WP = X_WB · (r + Σ_i z_i w_i(r))              a material point in the world
///
/// The body frame B has the axes of the input mesh; its origin is the point the body turns about (see FrameMotion).
/// Amplitudes z are in kg^½·m, shapes w in kg^−½. Source: [H03] sections 3.1–3.3.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "limber/core/types.h"
#include "limber/model/modal_basis.h"
#include "limber/model/modal_skin.h"
#include "limber/model/residual_compliance.h"
#include "limber/model/vertex_rows.h"

namespace limber {

/// How the body frame moves, decided by which nodes were fixed at bake time.
enum class FrameMotion {
  kFree,       ///< no fixed node: six degrees of freedom; origin at the centre of mass
  kPoint,      ///< fixed at one point: turns about it; origin at that point
  kLine,       ///< fixed along a line: turns about it; origin on the line, axis `line_axis`
  kKinematic,  ///< fixed at three points or more: moves only as the caller says; origin at the centre of mass
};

/// Text of a FrameMotion in files and reports: "free", "point", "line", "kinematic".
std::string_view to_string(FrameMotion motion);

/// Optional: all nodes of the tetrahedral mesh, for initial states z₀ = WᵀM d₀, overlap normals and depth.
struct ModalVolume {
  std::vector<Vec3> rest;  ///< nodes, body frame, m
  std::vector<Tet> tets;
  ModalBasis basis;             ///< W at every node, kg^−½
  ModalBasis mass_times_basis;  ///< M W at every node, kg^½: z₀ = (MW)ᵀ d₀
};

/// A node or patch that forces were foreseen at, and the share of what it gives way by statically that those modes show
/// which were chosen by frequency:
///
///   c = tr Σ u uᵀ/λ / tr (K⁺)_nn
///
/// With these alone the static answer there is off by 1 − c; the further modes that the bake adds for it
/// (`--residual NODES`) make it exact. Told by the bake: models made for a scene, with fewer modes, hold none.
struct CapturedLoad {
  Vec3 at = Vec3::Zero();  ///< body frame, m
  double share = 1.0;      ///< c, 0 to 1
};

/// Origin of an asset; every field may be empty.
struct Provenance {
  std::string tool{};        ///< "limber-precompute 0.1.0"
  std::string input{};       ///< file name of the input mesh, without folders
  std::string input_hash{};  ///< SHA-256 of its bytes, hexadecimal
  std::string options{};     ///< the options that made it, as one line
};

/// The plain data of a body. Fill it, then make a ModalModel of it, which checks it: beside counts, ranges and indices
/// what every solid fulfils (a principal moment is at most the sum of the others) and what mass-normalised modes do
/// (|∫ρ w_i| ≤ √mass, and like it for the moments), so that a wrong unit is told at once.
struct ModalModelData {
  std::string name;  ///< of the body; not empty, at most 200 bytes, no control characters
  FrameMotion motion = FrameMotion::kFree;
  Vec3 line_axis = Vec3::UnitX();       ///< kLine: unit vector, body frame
  double mass = 0.0;                    ///< kg; > 0
  double volume = 0.0;                  ///< m³; > 0
  Vec3 center_of_mass = Vec3::Zero();   ///< body frame, m; zero for kFree and kKinematic
  Vec3 origin_in_input = Vec3::Zero();  ///< body origin in the input mesh's coordinates, m
  /// Inertia of the rest shape about the body origin, body axes, kg·m²; symmetric positive definite.
  Mat3 inertia = Mat3::Zero();

  std::vector<double> eigenvalues;  ///< λ, rad²/s², ascending, ≥ 0 (0: a mechanism)
  std::vector<double> decays;       ///< ξ, 1/s, ≥ 0, per mode
  std::vector<Vec3> participation;  ///< ∫ρ w_i dV, kg^½: zero for kFree
  std::vector<Mat3> moments;  ///< ∫ρ x w_iᵀ dV, kg^½·m, x from the body origin: element (a, b) is ∫ρ x_a w_ib
  /// s_i, kg^½·m: the amplitude that a glTF viewer shows at weight 1 of the asset's morph target i, which is s_i w_i;
  /// an amplitude z_i is the weight z_i/s_i.
  /// Powers of two whose reciprocals are finite. Empty: chosen by visible_mode_scale() when the ModalModel is made.
  std::vector<double> mode_scales;

  ModalSurface render;                    ///< what is drawn; at least one triangle
  std::optional<ModalSurface> collision;  ///< what touches; none: the render surface
  std::optional<ModalVolume> volume_block;
  /// Optional: of the collision surface's vertices (of the render surface's where that is what touches).
  std::optional<ResidualCompliance> residual_compliance;
  std::vector<CapturedLoad> captured;  ///< may be empty
  /// Optional: what shows large bends without swelling.
  std::optional<ModalSkin> skin;
  /// True: contacts may act on the collision surface. False, for a body that meets nothing (no part of an asset file):
  /// the vertex rows are not made, and World tells a contact source of it only by a shape in its place.
  bool touchable = true;
};

/// How far a surface's vertices lie from the body origin and how far a mode can take them.
struct SurfaceExtent {
  double radius = 0.0;        ///< max over vertices of |rest|, m
  std::vector<double> shape;  ///< per mode the max over vertices of |U_i|, kg^−½
};

/// Immutable and checked; shared by all instances through std::shared_ptr<const ModalModel>.
class ModalModel {
 public:
  /// @throws InvalidArgument naming the field, the value seen and what was expected.
  explicit ModalModel(ModalModelData data);

  const ModalModelData& data() const { return data_; }
  const std::string& name() const { return data_.name; }
  Index modes() const { return static_cast<Index>(data_.eigenvalues.size()); }
  const ModalSurface& render() const { return data_.render; }
  const ModalSurface& collision() const { return data_.collision ? *data_.collision : data_.render; }
  /// The basis of collision() once more, vertex by vertex; of no vertices where nothing touches it.
  const VertexRows& collision_rows() const { return collision_rows_; }

  const SurfaceExtent& collision_extent() const { return collision_extent_; }
  const SurfaceExtent& render_extent() const { return data_.collision ? render_extent_ : collision_extent_; }

  /// The share of each collision() vertex's static compliance that the modes show, 0 to 1:
  ///
  ///   c_v = 1 − tr G_vv / tr (G_vv + Σ u_v u_vᵀ/λ),   G the residual compliance
  ///
  /// Where contacts and handles act without a residual, 1 − c_v is what their static answer is off by.
  /// @throws InvalidArgument for a model without a residual compliance
  std::vector<double> captured_shares() const;

  /// Undamped frequency of a mode, √λ/2π, Hz.
  double frequency_hz(Index mode) const;

 private:
  ModalModelData data_;
  VertexRows collision_rows_;
  SurfaceExtent collision_extent_, render_extent_;  // the second: where it is another surface
};

}  // namespace limber
