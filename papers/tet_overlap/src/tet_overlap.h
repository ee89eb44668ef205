// Normals from the overlap of two deformed volumes; tet_overlap_normals.h has the definition.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <vector>

#include "limber/collision/aabb.h"
#include "limber/collision/narrow_phase.h"
#include "limber/core/disjoint_sets.h"
#include "limber/model/modal_model.h"

namespace limber::internal {

// Faces of a volume block that belong to one tetrahedron, seen from outside, by node.
std::vector<Triangle> boundary_faces(const ModalVolume& volume);

// The region A ∩ B of two volumes falls into patches; each has the normal along which a translation of one body makes
// it shrink fastest. What is held grows to the largest pair seen.
class TetOverlap final : public OverlapNormals {
 public:
  // O(1): the overlap is computed when a normal is asked for first.
  void bind(const Body& a, const Body& b, double tolerance) override;

  // Of the patch nearest to the point. Zero where the boundaries of the patch have no direction.
  Vec3 normal(int out_of, const Vec3& p) override;

 private:
  struct Boxed {
    Aabb box;
    Index item;
  };
  struct Patch {
    Vec3 out_of_a = Vec3::Zero();  // ∮ n dA over ∂A ∩ B less that over ∂B ∩ A, m²
    double area = 0.0;             // of both, m²
  };

  // What of a boundary face is inside one tetrahedron of the other body: a convex polygon.
  struct Piece {
    int of;                      // whose boundary
    std::size_t first, corners;  // in corners_
    Vec3 area;                   // ∫ n dA, m²
  };

  const ModalVolume& volume(int of) const { return *body_[of].model->data().volume_block; }
  const std::vector<Triangle>& boundary(int of);
  void compute();
  Aabb deform(int of);
  void gather(int of, const Aabb& region);
  void cut_boundary(int of);
  void join_patches();
  Index patch_near(int of, const Vec3& p);
  std::span<const Vec3> corners(const Piece& piece) const { return {corners_.data() + piece.first, piece.corners}; }
  static void sort(std::vector<Boxed>& boxed);
  template <class Visit>
  static void for_each_overlap(const std::vector<Boxed>& a, const std::vector<Boxed>& b, const Visit& visit);

  Body body_[2];
  std::map<std::weak_ptr<const ModalModel>, std::vector<Triangle>, std::owner_less<>> boundaries_;  // of models seen
  double tolerance_ = 0.0;
  double touching_ = 0.0;  // pieces nearer than this belong to one patch, m
  bool computed_ = false;
  Index only_ = -1;  // the one patch, if there is one only
  std::vector<Vec3> nodes_[2];
  std::vector<Boxed> tets_[2], faces_[2];  // that come near the other body, by the low side of their boxes
  std::vector<Piece> pieces_;
  std::vector<Vec3> corners_;
  std::vector<Boxed> boxes_;  // of the pieces
  DisjointSets sets_;         // of pieces that touch: the patches
  std::vector<Patch> patch_;  // at the roots
};

}  // namespace limber::internal
