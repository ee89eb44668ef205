/// @file triangle_tree.h
/// Questions to a triangulated surface that depend on which way its triangles look. Private to the articulation module.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "limber/mesh/corner_tree.h"
#include "limber/mesh/surface_mesh.h"

namespace limber::internal {

/// mesh's tree over the triangles of one surface, with a box around the unit normals below each node.
class TriangleTree {
 public:
  /// @param caps that close the surface's holes, over its vertices: for winding(), and for nothing else
  explicit TriangleTree(const SurfaceMesh& surface, std::span<const Triangle> caps = {});

  struct Nearest {
    Index triangle = -1;              ///< −1: none
    Vec3 point = Vec3::Zero();        ///< on the triangle
    Vec3 barycentric = Vec3::Zero();  ///< of the point; ≥ 0, sum 1
    double distance = 0.0;
    bool found() const { return triangle >= 0; }
  };

  /// The nearest point within `limit` on a triangle whose unit normal m has direction·m ≤ cosine.
  Nearest nearest(const Vec3& p, double limit, const Vec3& direction, double cosine) const;

  /// The distance of some such point, if there is one. Quicker than looking for the nearest.
  std::optional<double> some_within(const Vec3& p, double limit, const Vec3& direction, double cosine) const;

  /// How often the surface winds around p, by a ray; of one that its caps close 1 inside and 0 outside. A ray costs the
  /// logarithm of the number of triangles, which limber::winding_number() costs itself; that one in turn needs no caps
  /// and answers for surfaces with any holes.
  int winding(const Vec3& p) const;

  /// True if the surface crosses the segment from p to q, its ends included.
  bool crosses(const Vec3& p, const Vec3& q) const;

  const Vec3& normal(Index triangle) const { return normals_[static_cast<std::size_t>(triangle)]; }
  const Eigen::AlignedBox3d& box() const { return box_; }

 private:
  using Corners = CornerTree<3>::Corners;

  /// Calls nearer(place, foot, squared distance) for triangles that face and may be nearer than the limit, which it may
  /// lower, until it returns false. Near nodes come first.
  template <class Nearer>
  void search(const Vec3& p, double& squared_limit, const Vec3& direction, double cosine, Nearer&& nearer) const;
  /// Calls hit(leaving) for each triangle that the line p + t·direction meets at t in [0, longest], until it returns
  /// true; returns whether it did.
  template <class Hit>
  bool cast(const Vec3& p, const Vec3& direction, double longest, Hit&& hit) const;

  CornerTree<3> tree_;
  std::vector<Eigen::AlignedBox3d> normals_of_nodes_;
  std::vector<Vec3> normals_at_;  ///< per place of the tree
  std::vector<Vec3> normals_;     ///< per triangle; zero where it has no area
  std::vector<Corners> caps_;
  Eigen::AlignedBox3d box_;
};

}  // namespace limber::internal
