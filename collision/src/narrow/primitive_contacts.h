// Contacts of a surface with shapes that have no triangles: half-space, ball, capsule.
#pragma once

#include <vector>

#include "convex/convex_core.h"
#include "narrow/pair_surface.h"

namespace limber::internal {

// A point or a segment with a radius, in the pair's frame.
struct RoundedCore {
  SegmentPoints ends{};
  bool segment = false;  // false: a ball about ends[0]
  double radius = 0.0;
};

// Every vertex of the surface with height ≤ margin over normal · x = offset.
void half_space_contacts(PairSurface& surface, const Vec3& normal, double offset, double margin,
                         std::vector<Index>& scratch, std::vector<FeatureContact>& contacts);

// Every point of a convex core, in its frame, with height ≤ margin over normal · x = offset.
void half_space_contacts(const ConvexCore& core, const Vec3& normal, double offset, double margin,
                         std::vector<FeatureContact>& contacts);

// Contacts of a surface and a rounded core; a of each is the surface's.
class CoreContacts {
 public:
  void find(PairSurface& surface, const RoundedCore& core, double margin, std::vector<FeatureContact>& contacts);

 private:
  void end_against_face(int end, Index t);
  void vertex_against_core(Index v);
  void edge_against_core(Index e);
  void end_inside(int end);
  void add(const FeatureSide& of_surface, FeatureKey of_core, const Vec3& core_point, const Vec3& normal);

  PairSurface* surface_ = nullptr;
  RoundedCore core_{};
  double reach_ = 0.0;
  std::vector<FeatureContact>* contacts_ = nullptr;
  std::vector<Index> triangles_;
};

}  // namespace limber::internal
