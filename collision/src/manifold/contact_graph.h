// Pairs of bodies that are near each other, from query to query, each with its manifold.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <tuple>
#include <vector>

#include "limber/collision/broad_phase.h"
#include "limber/core/rigid_transform.h"
#include "narrow/list_room.h"
#include "narrow/pair_surface.h"

namespace limber::internal {

/// A contact of a manifold. Of what is round the points are those of the core, which do not move as it rolls.
struct KeptPoint {
  std::uint64_t id = 0;
  FeatureSide a, b;            ///< each in its body's frame at rest; deforming sides are found by triangle and weight
  Vec3 normal = Vec3::Zero();  ///< unit, out of b into a, in the frame of the body it turns with
  bool turns_with_b = false;   ///< otherwise with a
  double round_a = 0.0, round_b = 0.0;  ///< radii about the points, m
  double ahead = 0.0;                   ///< share of the expected way after which it was found; 0: where they are

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.id, s.a.key, s.a.triangle, s.a.weight, s.a.point, s.b.key, s.b.triangle, s.b.weight, s.b.point,
                    s.normal, s.turns_with_b, s.round_a, s.round_b, s.ahead);
  }
};

struct LivePair {
  bool known = false;               ///< a manifold was made
  RigidTransform X_LS{};            ///< then: the smaller body in the frame of the larger one
  double reach = 0.0;               ///< gaps up to here were asked for, m
  double apart = 0.0;               ///< so far at least those without contacts were from each other, m; 0: nearer
  Vec3 parting = Vec3::Zero();      ///< of pairs by fields, see Parting; zero: not looked for yet
  std::array<double, 2> bent{};     ///< how far a and b had bent until then
  std::vector<KeptPoint> points{};  ///< ascending in id

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.known, s.X_LS, s.reach, s.apart, s.parting, s.bent, s.points);
  }
};

class ContactGraph {
 public:
  /// Finds or makes the pairs of a query, ascending; others are near no more.
  void match(std::span<const BodyPair> pairs);
  std::size_t size() const { return matched_.size(); }
  LivePair& at(std::size_t i) { return slots_[matched_[i]]; }  ///< of the i-th of the last match()
  const LivePair& at(std::size_t i) const { return slots_[matched_[i]]; }
  void forget(Index body);
  void forget_all();
  /// Room in a pair's manifold, which is emptied. From any thread.
  void make_room(LivePair& pair, std::size_t points) {
    pair.points.clear();
    if (pair.points.capacity() < points) room_->exchange(pair.points, points);
  }

  /// All that lives.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (const Entry& entry : known_) visit(entry.pair, slots_[entry.slot]);
  }
  std::size_t living() const { return known_.size(); }
  /// @pre pair is above all that live
  LivePair& append(const BodyPair& pair);

 private:
  struct Entry {
    BodyPair pair;
    std::uint32_t slot;
  };
  std::uint32_t take();
  void give_back(std::uint32_t slot);

  std::unique_ptr<ListRoom<KeptPoint, 4>> room_ = std::make_unique<ListRoom<KeptPoint, 4>>();
  std::vector<LivePair> slots_;
  std::vector<std::uint32_t> free_, matched_;
  std::vector<Entry> known_, next_;  // ascending
};

}  // namespace limber::internal
