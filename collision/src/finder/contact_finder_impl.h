// What finds contacts:
//
//   contact_finder.cpp  the bodies, and what is found in each pair of them
//   near_pairs.cpp      the states of a query, where they place the bodies, and which of these are near each other
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "finder/contact_regions.h"
#include "finder/found_body.h"

namespace limber {

struct ContactFinder::Impl {
  explicit Impl(const ContactFinderOptions& o) : options(o) { options.validate(); }

  ContactFinderOptions options;
  internal::GeometryCache geometries;
  std::vector<internal::FoundBody> bodies;
  std::vector<Index> self_touching;  ///< bodies that find themselves, ascending
  BroadPhase broad_phase;
  internal::Workers workers;

  // Of the query under way.
  ContactQuery query;
  std::vector<Index> to_place;
  std::vector<Aabb> boxes;  ///< by entry of to_place
  std::vector<BodyPair> pairs, merged_pairs;
  struct Found {
    std::vector<ContactPoint> contacts;
    internal::ContactRegions regions;
  };
  std::vector<Found> found;          ///< by chunk of pairs
  internal::ContactRegions regions;  ///< what contacts' regions are kept in

  internal::KeptIds kept;  ///< of the last query

  internal::FoundBody& present(Index body, const char* function) {
    if (!contains(body))
      throw InvalidArgument("ContactFinder::" + std::string(function) + ": index " + std::to_string(body) +
                            " holds no body, expected one that was added");
    return at(body);
  }
  bool contains(Index body) const {
    return body >= 0 && static_cast<std::size_t>(body) < bodies.size() && at(body).present;
  }
  internal::FoundBody& at(Index body) { return bodies[static_cast<std::size_t>(body)]; }
  const internal::FoundBody& at(Index body) const { return bodies[static_cast<std::size_t>(body)]; }
  const BodyState& state(Index body) const { return query.states[static_cast<std::size_t>(body)]; }

  void set_finds_itself(Index body, bool finds);
  bool stays_in_place(Index body, const BodyState& state) const;
  void check_and_list();
  void check_place(Index index);
  void find_near_pairs(Jobs& jobs);
  void make_boxes(Jobs& jobs);
  void make_box(std::size_t entry, internal::Worker& worker);
  void place();
  void merge_self_pairs();
  void check_sleepers_in_pairs();
  void find_in_pairs(Jobs& jobs);
  void find_in_pair(const BodyPair& pair, internal::Worker& worker, Found& into) const;
  internal::RegionSide region_side(Index body) const;
  CollisionBody collision_body(Index body, internal::Worker& worker) const;
  ContactSpacing spacing(const BodyPair& pair, bool by_regions) const;
  void gather(std::vector<ContactPoint>& contacts);
};

}  // namespace limber
