/// @file limber/model/morph_targets.h
/// Modes as glTF morph targets: how large, how named, and how normals follow. Shared by asset files and recordings.
///
///   shown position of vertex v = rest_v + Σ_i a_i P_i,v       P_i = s_i · shape_i, weight a_i = z_i / s_i
///   shown normal               ∝ n_v + Σ_i a_i N_i,v          N_i: first-order change of the unit normal along P_i
#pragma once

#include <span>
#include <string>
#include <vector>

#include "limber/model/modal_basis.h"

namespace limber {

/// Viewers hold at most this many morph targets of a mesh (Filament, Bevy and WebGL 2 array textures).
inline constexpr Index kMaxMorphTargets = 256;
/// Up to this many modes the targets carry normals too; beyond, twice the size is too dear.
inline constexpr Index kMaxTargetsWithNormals = 32;

/// "mode07_412Hz": number (0-based, with as many digits as the last one's) and frequency.
std::string mode_target_name(Index mode, Index modes, double frequency_hz);

/// s, kg^½·m: the power of two for which the largest displacement of a mode at weight 1 is nearest (in ratio) to a
/// tenth of the surface's bounding-box diagonal. A power of two, so that shape · s keeps every bit. 1 where the mode
/// does not move the surface.
double visible_mode_scale(const ModalSurface& surface, Index mode);

/// rest positions, 3 per vertex.
std::vector<float> rest_positions(const ModalSurface& surface);

/// scale · shape of one mode, 3 per vertex. Numbers that float32 would hold with fewer digits, below 1.2e-38 before or
/// after scaling, become 0.
std::vector<float> mode_displacements(const ModalSurface& surface, Index mode, double scale);

/// Area-weighted unit normals of a surface. (0, 0, 1) where a vertex has no area.
/// @param positions 3 per vertex @param triangles indices below positions.size() / 3
std::vector<float> unit_normals(std::span<const float> positions, std::span<const Triangle> triangles);

/// First-order change of unit_normals(positions) along displacements: (I − n nᵀ) dA / |A|, A the vertex's summed area
/// vector.
std::vector<float> normal_changes(std::span<const float> positions, std::span<const float> displacements,
                                  std::span<const Triangle> triangles);

}  // namespace limber
