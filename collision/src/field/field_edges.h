// Edges of one surface on edges of another's where a distance field has them near.
#pragma once

#include <vector>

#include "field/field_pair.h"
#include "tuning.h"

namespace limber::internal {

/// See field_contacts.h. Everything in the frame of a.
class FieldEdges {
 public:
  /// @param reach gaps up to here are wanted, and those that the expected motion brings there @param passed see
  /// unhindered()
  void begin(const FieldView& a_in_b, const FieldView& b_in_a, float reach, float passed);
  /// Edges of a vertex on those that its foot lies on: where they cross, or come nearest, is next to the vertex.
  void find_at_end(int of, const SampleFoot& sample);
  /// An inside vertex leaves along a direction, out of b into a.
  void set_exit(int of, Index vertex, const Vec3f& direction);
  /// Edges of one side, in clusters that the other's field has near. @param ends bounds of all samples
  void find(int of, const SampleBounds& ends, std::span<const std::uint32_t> clusters);
  /// Appends the contacts of all edges found since begin(), each once.
  void finish(std::vector<FoundContact>& found);

 private:
  struct Piercing {
    int of;
    Index edge, face;
    Vec3f point;
    Index loop;
  };
  /// The nearest points of an edge of a and one of b.
  struct EdgePair {
    Index e, f;
    float s, t;
    Vec3f on_e, on_f, direction;  ///< unit, from f to e
    float distance;
    bool leads_out = true;  ///< of edges that have crossed: against the direction both surfaces part there
  };
  /// An edge in the frame of a: its first end, and the way to its second.
  struct Segment {
    Index edge;
    Vec3f from, along;
  };
  struct WayOut {
    int of;
    Index vertex;
    Vec3f along;
  };
  struct Crossed {
    std::uint64_t facets;
    Index piercing;
  };

  Vec3f vertex(int of, Index v) const;
  bool touches(const EdgePair& pair) const;
  void turn(EdgePair& pair, float out_of_b) const;
  Segment segment(int of, Index edge) const;
  template <class Visit>
  void for_edges_of_face(int of, Index face, const Visit& visit) const;
  static bool nearest_of_edges(const Segment& e, const Segment& f, EdgePair& pair);
  bool in_normal_cone(int of, Index edge, const Vec3f& direction) const;
  void add_separated(int of, const Segment& edge, const Segment& other);
  bool goes_through_face(int of, Index edge, Index near, const Vec3f& from, const Vec3f& to);
  Vec3f expected_motion(const EdgePair& pair) const;
  bool comes_near(const EdgePair& pair, const Vec3f& motion) const;
  bool unhindered(EdgePair& pair, const Vec3f& motion) const;
  void find_loops();
  void cross_loop(std::size_t first, std::size_t end);
  void find_crossings(std::size_t first, std::size_t end);
  static bool is_next_to(const Pointshell& body, Index edge, Index face);
  void cross(int of, const Segment& edge, const Segment& other, std::size_t first, std::size_t end);
  bool goes_through(Index edge, int of, Index other, std::size_t first, std::size_t end) const;
  void find_ways_out(std::size_t first, std::size_t end);
  static bool leaves_along(const EdgePair& crossing, const Vec3f& way);
  float width(const Vec3f& way) const;
  void add(const EdgePair& pair, const Vec3f& normal);
  FeatureSide on_edge(int of, Index edge, float along, const Vec3f& point) const;

  FieldView view_[2];
  float reach_ = 0.0f, passed_ = 0.0f;
  std::vector<FieldHit> hits_;
  std::vector<Segment> met_;  ///< edges at the foot of one sample
  std::vector<Piercing> piercings_;
  std::vector<Crossed> crossed_;
  DisjointSets loops_;
  std::vector<EdgePair> crossings_;  ///< of one loop
  std::vector<WayOut> ways_out_;     ///< of one loop, of each vertex once
  std::vector<Vec3f> shared_;        ///< points of one loop and vertices inside next to it, frame of a
  std::vector<std::uint32_t> stamp_[2];
  std::vector<Vec3f> exit_[2];
  std::uint32_t generation_ = 0;
  std::vector<FoundContact> contacts_;
};

}  // namespace limber::internal
