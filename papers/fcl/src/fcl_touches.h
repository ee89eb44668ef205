// All contacts of two bodies by FCL: see fcl_contact_source.h for which these are.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "fcl_body.h"
#include "limber/dynamics/contact_source.h"

namespace limber::internal {

class FclTouches {
 public:
  /// A way out of the second body, or the way to it: gap = normal · (p − foot).
  struct Direction {
    FclFoot foot{};
    Vec3 normal = Vec3::Zero();
    double gap = 0.0;
  };

  /// Adds all contacts with gap ≤ reach; ids are made of features alone.
  void find(const FclBody& a, const FclBody& b, double reach, const Vec3& origin, std::vector<ContactPoint>& contacts);

 private:
  struct Touch {
    FeatureSide a{}, b{};  ///< world
    Vec3 normal = Vec3::Zero();
    double gap = 0.0;
    std::uint64_t id = 0;
  };
  /// Of the vertices of one body with the other; `first`: the vertices are a's.
  void touch_by_vertices(const FclBody& of, const FclBody& other, bool first);
  void touch_outside(const FclBody& of, Index v, const FclBody& other, bool first);
  void touch_inside(const FclBody& of, Index v, const FclBody& other, const FclFoot& nearest, bool first);
  void touch_plane(const FclBody& of, const HalfSpace& plane, bool first);
  void touch_by_edges(const FclBody& a, const FclBody& b);
  void touch_by_edges(const FclBody& a, Index e, const FclBody& b, Index f);
  bool is_minimum(const FclBody& other, const FclFoot& foot) const;
  void add(const FclBody& of, Index v, const Direction& d, std::uint64_t rank, bool first);
  void keep_a_crossing();
  void add_deepest(const FclBody& a, const FclBody& b, const Direction& d);

  const FclBody* a_ = nullptr;
  const FclBody* b_ = nullptr;
  double reach_ = 0.0;
  std::vector<Touch> touches_, crossings_;  ///< crossings: of edges on far sides
  std::vector<FclFoot> feet_;
  std::vector<Direction> directions_;
  std::vector<std::pair<Index, Index>> triangle_pairs_, edge_pairs_;
  std::vector<Index> triangles_;
};

}  // namespace limber::internal
