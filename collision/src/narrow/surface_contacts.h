// Contacts of two triangulated surfaces by their features, apart or overlapping; see narrow_phase.h for what counts.
#pragma once

#include <limits>
#include <vector>

#include "limber/collision/tree_traversal.h"
#include "limber/core/disjoint_sets.h"
#include "narrow/pair_surface.h"
#include "tuning.h"

namespace limber::internal {

// Answers where a vertex that is inside a surface is to leave it.
class OverlapRule {
 public:
  struct Exit {
    FeatureSide at{};            // on the surface
    Vec3 normal = Vec3::Zero();  // unit, out of the surface
  };
  virtual ~OverlapRule() = default;
  // @param nearest the surface's point nearest to p, which is inside @return false: take that one
  virtual bool exit(PairSurface& surface, const Vec3& p, const PairSurface::Nearest& nearest, Exit& exit) = 0;
};

// Answers whether a vertex is inside another part of its own body, and where it is to leave that.
class SelfOverlapRule {
 public:
  virtual ~SelfOverlapRule() = default;
  // @param near a point of the surface next to it, on that part @return false: it is not inside
  virtual bool exit_of(Index v, PairSurface& surface, const FeatureSide& near, OverlapRule::Exit& exit) = 0;
};

// How far apart two surfaces may be to have contacts, m.
struct ContactReach {
  double margin = 0.0;        // of gaps
  double beside = 0.0;        // how near their boxes are to come to each other on the way
  Vec3 way_A = Vec3::Zero();  // of b as seen from a
  double passed = 0.0;        // by how much a plane may have been passed and still keeps the bodies apart, at least

  // Whether boxes are looked at all around, as gaps go.
  bool all_around() const { return beside >= margin; }
};

class SurfaceContacts {
 public:
  // Appends all contacts of a and b, in the pair's frame. Both are bound with one tolerance; those found twice (two
  // vertices) are appended twice. @param X_AB frame of b's body in that of a's @param rule_a of vertices inside a;
  // null: the nearest point
  void find(PairSurface& a, PairSurface& b, const RigidTransform& X_AB, const ContactReach& reach, OverlapRule* rule_a,
            OverlapRule* rule_b, std::vector<FeatureContact>& contacts);
  // Of a surface with itself. @param places of points inside; null: parts that have passed through each other are not
  // told from others
  void find_self(PairSurface& a, double margin, SelfOverlapRule* places, std::vector<FeatureContact>& contacts);

 private:
  // An edge of one side that goes through a face of the other.
  struct Piercing {
    int of;
    Index edge, face;
    std::array<double, 2> heights;  // of the edge's ends over the face
    Vec3 point;
    Index loop;  // where the surfaces intersect; see find_loops()
  };
  // A pair of intersecting triangles, by side, and an edge of one that goes through the other.
  struct Crossed {
    TrianglePair triangles;
    Index piercing;
  };
  struct Seed {
    Index vertex;
    Index near;  // a triangle of the other surface next to it; −1: none is known
  };
  // Which vertices of one side are inside the other.
  struct Inside {
    std::vector<Seed> seeds;
    std::vector<std::uint32_t> visited;  // generation_: looked at, outside; generation_ + 1: inside
    std::vector<Vec3> exit_normal;       // of those inside: out of the other
  };
  struct EdgePair {
    Index e, f;   // of side 0 and 1
    double s, t;  // along each
    Vec3 on_e, on_f;
    Vec3 direction;  // unit, from f to e
    double distance;
  };

  // Where the surfaces go through each other.
  struct Intersection {
    std::vector<Piercing> piercings;
    std::vector<Crossed> crossed;
    DisjointSets loops;
    std::vector<EdgePair> crossings;  // of one loop
    std::vector<Vec3> ways_out;       // of one loop: normals out of b
  };

  void begin(PairSurface& a, PairSurface& b, double margin, bool self, std::vector<FeatureContact>& contacts);
  void find_pairs(const RigidTransform& X_AB, const ContactReach& reach);
  void test_pair(Index s, Index t);

  void test_vertices(int of, Index s, Index t);
  void vertex_against_face(int of, Index v, Index t);
  void add_vertex(int of, Index v, PairSurface::Minimum minimum);
  bool rests_on_faces(int of, Index v, const PairSurface::Minimum& minimum);
  enum class Touch { kNone, kRim, kArea };
  Touch touch(int of, Index v, const FeatureSide& at, Index t);
  double nearness(int of, Index v, Index t);

  void test_edges(Index s, Index t);
  EdgePair nearest_of_edges(Index e, Index f);
  void add_separated_edges(EdgePair pair);
  double shorter_edge(const EdgePair& pair);
  void add_edges(const EdgePair& pair, const Vec3& normal);

  Vec3 unhindered(int of, Index v, const PairSurface::Minimum& minimum);
  Vec3 unhindered(const EdgePair& pair);

  void find_piercings(int of, Index s, Index t);
  void find_piercing(int of, Index e, Index t);
  void spread_inside(int of, OverlapRule* rule);
  void add_inside(int of, Index v, const PairSurface::Nearest& nearest, OverlapRule* rule);
  bool leave_behind(int of, Index v, OverlapRule::Exit& exit);
  bool find_supporting_face(int of, Index v, Index near, bool aligned, OverlapRule::Exit& exit);
  bool flush(int of, Index v, const FeatureSide& at);
  bool enters(int of, Index v, Index near);
  void find_enclosed(int of, OverlapRule* rule);
  void spread_inside_itself(SelfOverlapRule& places);
  void cross_edges();
  void find_loops();
  void cross_edges_of_loop(std::size_t first, std::size_t end);
  void find_crossings(const Piercing& piercing);
  void find_ways_out(std::size_t first, std::size_t end);
  double width_of_loop(std::size_t first, std::size_t end, const Vec3& n) const;
  void push_out_of_faces();

  void add(int of, const FeatureSide& mine, const FeatureSide& other, const Vec3& out_of_other, double gap);

  PairSurface* side_[2] = {nullptr, nullptr};
  const NarrowTuning* tuning_ = nullptr;
  double margin_ = 0.0, passed_ = 0.0, tolerance_ = 0.0, directionless_ = 0.0;
  bool self_ = false, overlap_ = false;
  std::vector<FeatureContact>* contacts_ = nullptr;
  std::vector<TrianglePair> pairs_;
  Intersection cut_;
  Inside inside_[2];
  std::uint32_t generation_ = 0;
};

}  // namespace limber::internal
