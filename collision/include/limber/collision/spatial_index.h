/// @file limber/collision/spatial_index.h
/// Questions about where bodies are, in the state they are told in: rays, casts of shapes, overlaps, nearest points.
/// World has one of its own. Without a world:
///
///   SpatialIndex index;
///   index.add_body(0, {.model = bunny});
///   index.set_state(0, X_WB, z);
///   if (const auto hit = index.cast_ray({.from = eye, .way = 100.0 * gaze})) mark(hit->position);
///
/// A tree of boxes over the bodies (loose ones, so that what moves a little stays in its place) leads to those that may
/// answer; the tree of each surface, whose boxes follow from the amplitudes, to the triangles. A body that bends is met
/// where it is bent to. Sources: Ericson, *Real-Time Collision Detection* (2005), 5.3 and 6.2; van den Bergen, *Ray
/// Casting against General Convex Objects* (2004) for casts, here by the distances of nearest points.
///
/// Surfaces are met from either side. Spheres, capsules, half-spaces and closed surfaces are solid to shapes: a cast
/// that begins in one ends there, and a shape within one overlaps it. Open meshes and height fields are sheets.
///
/// The answer of several that are equally near is the one of the lowest body and triangle: what was asked and told
/// before changes no answer. Queries allocate nothing once warm. Used by one thread at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "limber/core/rigid_transform.h"
#include "limber/dynamics/contact_source.h"
#include "limber/dynamics/surface_point.h"

namespace limber {

/// The points from + f way with 0 ≤ f ≤ 1.
struct Ray {
  Vec3 from = Vec3::Zero();  ///< world, m
  Vec3 way = Vec3::UnitX();  ///< m; not zero
};

/// Which bodies may answer. They need a layer of the mask, and to be accepted where `accepts` is given.
template <class Body>
struct QueryFilter {
  std::uint32_t mask = 0xffffffffu;
  std::function<bool(Body)> accepts{};  ///< asked once its boxes are met, before its surface is
};

/// A place on a body that answers.
template <class Body>
struct QueryHit {
  Body body{};
  /// The place as loads and handles take it, on the model's collision surface; of a body that wears a shape the point
  /// of that surface nearest to `position`. None for static bodies and for models that are not touchable.
  std::optional<SurfacePoint> at{};
  Vec3 position = Vec3::Zero();  ///< on the body, world, m
  /// Unit, world, towards where the query came from; zero where a cast begins within the body, and where a nearest
  /// point is the point asked for.
  Vec3 normal = Vec3::Zero();
  double fraction = 0.0;  ///< of the way, in [0, 1]; 0 for nearest points
  double distance = 0.0;  ///< m: along the way, or from the point
};

class SpatialIndex {
 public:
  using Filter = QueryFilter<Index>;
  using Hit = QueryHit<Index>;

  SpatialIndex();
  ~SpatialIndex();
  SpatialIndex(SpatialIndex&&) noexcept;
  SpatialIndex& operator=(SpatialIndex&&) noexcept;

  /// @param body any index ≥ 0 that holds none @param geometry as a ContactSource takes it
  /// @param loaded of a body that wears a shape: the model that QueryHit::at is of; null: none
  /// @param in_loaded where the shape is in that model's frame, as a part of a compound is
  /// @throws InvalidArgument for an index that holds a body, or a bad geometry
  void add_body(Index body, const BodyGeometry& geometry, std::uint32_t layers = 1,
                const std::shared_ptr<const ModalModel>& loaded = nullptr, const RigidTransform& in_loaded = {});
  // These throw InvalidArgument for an index that holds no body.
  void remove_body(Index body);
  /// Where a body is; it answers from then on. @param z its amplitudes, k numbers; of one that wears a shape, those of
  /// `loaded`, by which `at` is found
  void set_state(Index body, const RigidTransform& pose, std::span<const double> z);

  // All throw InvalidArgument for what is not finite, for a way that is zero, and for a shape that is not a sphere,
  // capsule, box or hull.

  /// The first place that a ray meets.
  std::optional<Hit> cast_ray(const Ray& ray, const Filter& filter = {});
  /// The first place on each body that a ray meets; replaces `hits`, by fraction.
  void cast_ray(const Ray& ray, std::vector<Hit>& hits, const Filter& filter = {});
  /// Whether a shape may ask the next two: spheres, capsules, boxes and hulls.
  static bool may_ask(const Shape& shape);
  /// Where a shape that is moved, without turning, first touches: to a gap of less than 1e-7 of its size.
  /// @param pose of the shape at the start, world
  std::optional<Hit> cast_shape(const Shape& shape, const RigidTransform& pose, const Vec3& way,
                                const Filter& filter = {});
  /// Bodies that a shape touches or lies in; replaces `bodies`, ascending.
  void find_overlaps(const Shape& shape, const RigidTransform& pose, std::vector<Index>& bodies,
                     const Filter& filter = {});
  /// The nearest place of any surface, from outside or inside, no farther than `max_distance`, m, > 0 and finite.
  std::optional<Hit> nearest_point(const Vec3& point, double max_distance, const Filter& filter = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
