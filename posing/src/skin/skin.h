// The surface that bodies carry.
#pragma once

#include <span>
#include <vector>

#include "structure.h"

namespace limber::internal {

/// Body poses as affine maps x ↦ A (x − centre) + p: rigid motions, or what a PoseMethod makes of cells.
struct BodyMap {
  Mat3 A = Mat3::Identity();
  Vec3 p = Vec3::Zero();
};

/// Moving least squares [X09 4.3; Kaufmann and others, "Flexible simulation of deformable models using discontinuous
/// Galerkin FEM", 2008]: at a vertex x the place is that of the linear function nearest to where the corners x_i of the
/// cells around are moved, with weights that fall to 0 one and a half cells away:
///   f(x) = Σ_i φ_i(x) T_c(i) x_i,  φ_i(x) = w_i(x) (1, 0) M⁻¹ (1, x_i − x),  M = Σ w_i (1, x_i − x)(1, x_i − x)ᵀ
/// It is linear in the transformations, so that per vertex and body four numbers are left, made once. A group of parts
/// is a surface of its own: nothing bleeds across a joint. Vertices of a rigid part follow it exactly.
class Skin {
 public:
  Skin(const JointedModel& model, const PoseStructure& structure);

  /// @param maps one per body. @param positions one per vertex of the model; those of no part stay at rest
  void positions(std::span<const BodyMap> maps, std::span<Vec3> positions) const;

  std::size_t blended_vertices() const { return blended_.size(); }
  std::size_t weights() const { return bodies_.size(); }

 private:
  struct Carried {
    Index vertex = 0, body = 0;
    Vec3 arm = Vec3::Zero();
  };
  void blend(const PoseStructure& structure, const std::vector<Index>& cells, Index vertex, const Vec3& x);

  std::vector<Vec3> rest_;
  std::vector<Carried> carried_;  // by one body
  std::vector<Index> blended_;    // vertices; their entries below from first_[i] to first_[i + 1]
  std::vector<Index> first_{0}, bodies_;
  std::vector<std::array<float, 4>> factors_;  // of A's columns and p
};

/// Area-weighted unit normals; (0, 0, 1) where a vertex has no area.
void vertex_normals(std::span<const Vec3> positions, std::span<const Triangle> triangles, std::span<Vec3> normals);

}  // namespace limber::internal
