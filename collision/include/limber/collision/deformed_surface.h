/// @file limber/collision/deformed_surface.h
/// One body's surface in one state: boxes and vertices made when someone asks for them, and kept until the next state.
/// A box is made from the amplitudes alone (James and Pai's BD-tree, 2004, with boxes).
///
///   DeformedSurface body;
///   body.bind(surface, z);                 // O(k)
///   const Aabb box = body.bounds(0);       // of the whole body, from the amplitudes alone
///   const Vec3& p = body.vertex(17);       // r + U z, of this vertex only
///
/// Where the surface bends by a modal skin a vertex is where the skin has it, and a box is that of r + Ũ z, turned and
/// carried by each handle that a vertex below hangs on: weights are no less than 0 and sum to 1, so that every vertex
/// is within the box of all of these.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "limber/collision/aabb.h"
#include "limber/collision/collision_surface.h"
#include "limber/core/aligned_array.h"
#include "limber/core/types.h"

namespace limber {

/// Scratch of one thread: reuse it, a warm one allocates nothing. All points are in the body frame, in m.
class DeformedSurface {
 public:
  /// Work since the last bind().
  struct Counters {
    long boxes = 0;     ///< nodes whose box was asked for, siblings counted together
    long vertices = 0;  ///< made one by one, in double
  };

  DeformedSurface();
  ~DeformedSurface();
  DeformedSurface(DeformedSurface&&) noexcept;
  DeformedSurface& operator=(DeformedSurface&&) noexcept;

  /// A new state; forgets the last one. O(k). Allocates only for a surface larger than any before.
  /// @param surface not null; kept until the next bind()  @param z its k amplitudes, read here only
  /// @throws InvalidArgument if z has another size, is not finite, or moves a vertex by more than 1e30 m
  void bind(const std::shared_ptr<const CollisionSurface>& surface, std::span<const double> z);

  const CollisionSurface& surface() const { return *surface_; }
  std::span<const double> amplitudes() const;
  /// The handles in this state; null for a surface without a skin.
  const SkinPose* skin() const;
  /// How far vertices may come while amplitudes change: SkinExtent::find(). @pre with a skin
  double skin_extent(std::span<const double> change, std::span<double> shape);

  /// Encloses all triangles below a node, in whichever precision vertex() has. @pre bound; node exists
  Aabb bounds(Index node);
  /// r + Σ z_i u_i, or by the skin, in double. @pre bound; the vertex exists. The reference holds until the next
  /// bind().
  const Vec3& vertex(Index v);
  /// Corners of a triangle.
  std::array<Vec3, 3> triangle(Index t);

  const Counters& counters() const { return counters_; }

 private:
  friend class internal::BoxReader;
  struct Scratch;
  void reserve(const CollisionSurface& surface);
  void begin_state();
  void make_box(Index node);
  void make_triangle_boxes(Index leaf);
  void carry_box(Index node);
  void set_skin(std::span<const double> z, bool same_surface);

  std::shared_ptr<const CollisionSurface> surface_;
  std::unique_ptr<Scratch> scratch_;
  Counters counters_;
};

}  // namespace limber
