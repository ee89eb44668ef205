/// Nearest points of a triangulated surface. Private to the module.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber {

/// A binary tree of boxes along the axes over the triangles of one surface.
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

  /// How often the surface winds around p, by a ray; of one that its caps close 1 inside and 0 outside.
  int winding(const Vec3& p) const;

  /// Whether the surface crosses the segment from p to q, its ends included.
  bool crosses(const Vec3& p, const Vec3& q) const;

  const Vec3& normal(Index triangle) const { return normals_[static_cast<std::size_t>(triangle)]; }
  const Eigen::AlignedBox3d& box() const { return nodes_.front().box; }

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    Eigen::AlignedBox3d normals;  ///< around the unit normals
    Index first = 0,
          count = 0;  ///< count > 0: a leaf with these of placed_; else first is the left child, right next to it
    /// Whether some unit normal m of it may have direction·m ≤ cosine.
    bool may_face(const Vec3& direction, double cosine) const;
  };
  /// A triangle where the tree needs it.
  struct Placed {
    Vec3 a, b, c, normal;
    Index triangle;
  };
  void split(Index node, Index begin, Index end, std::vector<Index>& order, const std::vector<Placed>& placed,
             const std::vector<Vec3>& centres);
  /// Calls nearer(placed, point, barycentric, squared distance) for triangles that face and may be nearer than the
  /// limit, which it may lower, until it returns false. Near nodes come first.
  template <class Nearer>
  void search(const Vec3& p, double& squared_limit, const Vec3& direction, double cosine, Nearer&& nearer) const;
  static Placed placed(const SurfaceMesh& surface, const Triangle& triangle, Index number);
  /// Whether the line p + t·direction meets the triangle at t in [0, longest]; then `leaving` tells which way.
  static bool meets(const Placed& triangle, const Vec3& p, const Vec3& direction, double longest, bool& leaving);
  /// Calls hit(leaving) for each triangle that the line p + t·direction meets at t in [0, longest], until it returns
  /// true; returns whether it did.
  template <class Hit>
  bool cast(const Vec3& p, const Vec3& direction, double longest, Hit&& hit) const;

  std::vector<Node> nodes_;
  std::vector<Placed> placed_;  ///< leaf after leaf
  std::vector<Placed> caps_;
  std::vector<Vec3> normals_;  ///< per triangle; zero where it has no area
};

/// The point of a triangle nearest to p, in barycentric coordinates.
Vec3 nearest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

}  // namespace limber
