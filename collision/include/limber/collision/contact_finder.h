/// @file limber/collision/contact_finder.h
/// Finds where bodies touch: the ContactSource that limber comes with. Usable without a world:
///
///   ContactFinder finder;
///   finder.add_body(0, {.model = bunny}, {});
///   finder.add_body(1, {.shape = std::make_shared<Shape>(HalfSpace{})}, {});
///   const std::array states{BodyState{.pose = X_WB, .amplitudes = z}, BodyState{}};
///   std::vector<ContactPoint> contacts;
///   finder.find_contacts({.states = states, .margin = 1e-3}, contacts, serial_jobs());
///
/// A query takes a box about each awake body from its amplitudes alone, O(k); pairs of near boxes (BroadPhase); all
/// contacts of each pair (NarrowPhase), with vertices made only where the two are near. Bodies that sleep cost nothing
/// until one that is awake comes near. A model or shape that many bodies share is made ready once. docs/collision.md
/// tells it in full.
#pragma once

#include <memory>

#include "limber/collision/deformed_surface.h"
#include "limber/collision/narrow_phase.h"
#include "limber/dynamics/contact_source.h"

namespace limber {

/// Used by one thread at a time; it spreads the work over the Jobs of the query itself.
///
/// What find_contacts() refuses (InvalidArgument naming body and member, found before anything is changed): a pose that
/// is not finite or whose quaternion is not of length 1 within 1e-6, another number of amplitudes than the body has
/// modes, amplitudes that are not finite or move a vertex beyond 1e30 m, a reach or margin that is negative or not
/// finite, and `states` that do not reach to every body. States of bodies that sleep are looked at when they fall
/// asleep and when something comes near.
///
/// Ids: equal for the same features of the same two body indices, whatever happened between; made by mixing 64 bits, so
/// that two contacts of different pairs have the same one with probability 2⁻⁶⁴.
class ContactFinder final : public ContactSource {
 public:
  /// @param options of overlaps. OverlapMethod::kRestDepth needs a volume block of the body that a vertex is in
  explicit ContactFinder(const NarrowPhaseOptions& options = {});
  ~ContactFinder() override;
  ContactFinder(ContactFinder&&) noexcept;
  ContactFinder& operator=(ContactFinder&&) noexcept;

  void add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) override;
  void remove_body(Index body) override;
  void set_filter(Index body, const CollisionFilter& filter) override;
  void exclude_pair(Index a, Index b, bool excluded) override;
  void find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) override;
  void restore_state(StateReader& state) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
