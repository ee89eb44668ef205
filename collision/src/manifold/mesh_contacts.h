// Contacts of a convex shape with a rigid mesh: of the triangles near it, one by one, such that nothing is felt of the
// edges within a plane or a hollow.
#pragma once

#include <span>
#include <vector>

#include "manifold/mesh_facets.h"
#include "narrow/convex_contacts.h"
#include "narrow/pair_surface.h"
#include "narrow/primitive_contacts.h"

namespace limber::internal {

/// A plane that a body rests on, above normal · x = offset, in the frame at hand: a contact of it with something else.
/// What reaches to this height and no farther is touched along the normal alone.
struct SupportPlane {
  Vec3 normal = Vec3::Zero();
  double offset = 0.0;
  double tolerance = 0.0;  ///< m
};

class MeshContacts {
 public:
  struct Query {
    const ConvexCore& core;
    PairSurface& mesh;  ///< in the frame of the convex body
    const MeshFacets& facets;
    double reach = 0.0;
    Passing passing{};
    std::span<const SupportPlane> planes{};  ///< that the convex body rests on beside the mesh
  };
  /// Appends, in the frame of the convex body, which is a of each. The mesh's faces are called by facet.
  void find(const Query& query, std::vector<FeatureContact>& found);

 private:
  /// Which directions lead out of a triangle: its normal, and those of the Voronoi cones of its active edges and
  /// vertices. Remembers what is nearest along the last one that it allowed.
  class Cone final : public DirectionFilter {
   public:
    bool allows(const Vec3& out) override;
    PairSurface* mesh = nullptr;
    Index triangle = -1;
    FeatureKey nearest = 0;
  };

  void rest_on_own_faces(const Query& query, std::size_t first);
  void find_rounded(const Query& query);
  void find_polytope(const Query& query);
  bool leave_as_a_whole(const Query& query);
  void on_triangle(const Query& query, Index t);
  void name(const Query& query, Index t, std::size_t first);
  static FeatureKey named(const MeshFacets& facets, FeatureKey key);

  CoreContacts core_contacts_;
  ConvexContacts convex_;
  ConvexCore triangle_;
  Cone cone_;
  std::vector<Index> triangles_;
  std::vector<SupportPlane> own_planes_;
  std::vector<FeatureContact>* found_ = nullptr;
};

}  // namespace limber::internal
