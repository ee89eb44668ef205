/// @file limber/collision/manifold_finder.h
/// Finds where bodies touch in bounded time: the ContactSource of game contact. Usable without a world:
///
///   ManifoldFinder finder;
///   finder.add_body(0, {.shape = std::make_shared<Shape>(Box{})}, {});
///   finder.add_body(1, {.shape = std::make_shared<Shape>(HalfSpace{})}, {});
///   const std::array states{BodyState{.pose = X_WB}, BodyState{}};
///   std::vector<ContactPoint> contacts;
///   finder.find_contacts({.states = states, .margin = 1e-3}, contacts, serial_jobs());
///
/// Pairs that the broad phase finds near live on from query to query in a contact graph, each with its *manifold*: the
/// contacts of the two, at most four to a patch of like normals, each named by its features. A pair that hardly moved
/// since its manifold was made keeps it, and only the gaps are measured again from the anchors (contact recycling, as
/// in Box3D, 2026). Manifolds come straight from features: the direction by separating axes (Gottschalk, Lin, Manocha,
/// *OBBTree*, 1996) or by the nearest points, the faces that meet along it clipped against each other (Ericson,
/// *Real-Time Collision Detection*, 2005, 5.5).
///
/// Contacts are *speculative*: those are found whose gap the motion that BodyState::displacement and reach tell may
/// close, and a solver gives way to them by their gap. Two bodies that
/// come or turn farther against each other than the thinner is thick are followed along the expected motion to where
/// they first touch (TimeOfImpact), and on along what they touch, up to four times: contacts are those of these places,
/// with gaps as they are now. What turns has one more there, of a ball inside of it, whose row holds however far it
/// turns. Pairs of distance fields are not followed: there doubt and the expected ends are read, and the motion of a
/// contact's own two points counts, turn and bending included.
///
/// No seam shows. Where a face keeps two convex shapes apart all along the expected motion, contacts with other faces
/// that close on the way are none; where a body rests on one thing and comes to another that reaches to the same plane
/// and no farther, that plane's normal is the contacts'; of meshes and height fields only edges and vertices where the
/// surface is convex or ends are touched otherwise than along a face's normal. Where bodies overlap, convex shapes
/// leave each other along the direction of least depth, and what has its middle in a mesh goes out to the nearest
/// point.
///
/// Pairs in which a surface deforms are looked up in distance fields, in bounded time and single precision, and have
/// all their contacts. Fields are made by add_body(), in up to some tenths of a second for each model. NarrowPhase
/// finds the contacts of pairs that fields do not resolve: open surfaces, thin walls, modal skins, a body beside a much
/// larger one (docs/collision.md).
#pragma once

#include <cstdint>
#include <memory>

#include "limber/collision/narrow_phase.h"
#include "limber/dynamics/contact_source.h"

namespace limber {

struct ManifoldFinderOptions {
  /// A manifold is kept until the smaller body of a pair has moved by so much in the frame of the larger one, a share
  /// of the pair's size, or turned by `recycle_turn`, rad, or bent by as much as it may move. The size is the least
  /// extent of either body's box at rest. In [0, 0.1] each; 0: a manifold is made anew as soon as anything moves.
  double recycle_distance = 0.01;
  double recycle_turn = 0.01;
  /// Share of a pair's size up to which overlapping faces keep two bodies apart, and by which the faces of neighbours
  /// may differ in height and still are one. In [0, 0.1].
  double flush = 5e-3;
  /// Of pairs in which a surface deforms and that distance fields do not resolve.
  NarrowPhaseOptions narrow_phase{};
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

/// Used by one thread at a time; it spreads the work over the Jobs of the query itself.
///
/// What find_contacts() refuses, before anything is changed (InvalidArgument naming body and member): a pose that is
/// not finite or whose quaternion is not of length 1 within 1e-6, a displacement, reach or margin that is not finite or
/// a negative one of the latter two, another number of amplitudes than the body has modes, amplitudes that are not
/// finite, the same of the expected end where doubt is finite, and `states` that do not reach to every body. States of
/// bodies that sleep are looked at when they fall asleep and when something comes near.
///
/// Ids: equal for the same features of the same two body indices, whatever happened between; made by mixing 64 bits.
class ManifoldFinder final : public ContactSource {
 public:
  /// Of the last query.
  struct Counts {
    std::int64_t pairs = 0;     ///< near each other
    std::int64_t recycled = 0;  ///< of these, kept their manifold, which may be empty
  };

  /// @throws InvalidArgument see ManifoldFinderOptions::validate()
  explicit ManifoldFinder(const ManifoldFinderOptions& options = {});
  ~ManifoldFinder() override;
  ManifoldFinder(ManifoldFinder&&) noexcept;
  ManifoldFinder& operator=(ManifoldFinder&&) noexcept;

  void add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) override;
  void remove_body(Index body) override;
  void set_filter(Index body, const CollisionFilter& filter) override;
  void exclude_pair(Index a, Index b, bool excluded) override;
  void find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) override;
  /// The graph, with its manifolds.
  void save_state(StateWriter& state) const override;
  void restore_state(StateReader& state) override;

  const Counts& counts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
