// What two surfaces that hardly move against each other need not search again: the tests of their features that may
// find a contact. A list of them is made for a larger margin and holds until the bodies, or the margin, have used that
// up. It leaves out nothing but tests that find nothing (docs/derivations/collision.md), so contacts are, to the bit,
// those of a search.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "limber/collision/collision_surface.h"
#include "limber/core/rigid_transform.h"
#include "narrow/list_room.h"

namespace limber::internal {

// Tests of the features of two triangles against each other, a bit each.
using FeatureTests = std::uint32_t;
inline constexpr FeatureTests kAllTests = ~FeatureTests{0};
// A corner of a triangle of side `of` against the other triangle.
inline FeatureTests vertex_test(int of, int corner) { return FeatureTests{1} << (3 * of + corner); }
inline FeatureTests edge_test(int c, int d) { return FeatureTests{1} << (6 + 3 * c + d); }
// Whether an edge of a triangle of side `of` goes through the other.
inline FeatureTests piercing_test(int of, int corner) { return FeatureTests{1} << (15 + 3 * of + corner); }

struct ListedTests {
  Index s, t;
  FeatureTests tests;
};

using TestRoom = ListRoom<ListedTests, 64>;

class PairMemory {
 public:
  explicit PairMemory(TestRoom& room) : room_(room) {}
  // The pair as a query finds it, in the frame of a.
  struct State {
    const CollisionSurface &a, &b;
    RigidTransform X_AB;
    std::span<const double> z_a, z_b;
    double margin;
  };
  enum class Advice {
    kSearch,  // bodies that move: a list would not last
    kList,    // make a list, of what comes within reach()
    kLook,    // at the list
  };
  // Once a query.
  Advice advise(const State& now);

  double reach() const { return margin_ + slack_; }
  double slack() const { return slack_; }  // how far points of one body may move against those of the other
  std::span<const ListedTests> list() const { return list_; }
  void keep(std::span<const ListedTests> list);

  // For the next pair. @param modes of a body, at most
  void forget() { known_ = listed_ = false; }
  void reserve(std::size_t modes) { z_a_.reserve(modes), z_b_.reserve(modes); }

 private:
  double farthest_move(const State& now) const;

  TestRoom& room_;
  bool known_ = false, listed_ = false;
  RigidTransform X_AB_{};
  std::vector<double> z_a_, z_b_;
  double margin_ = 0.0, slack_ = 0.0;
  std::vector<ListedTests> list_;
};

}  // namespace limber::internal
