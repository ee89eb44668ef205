/// @file limber/collision/narrow_phase.h
/// All contacts of two bodies that are near each other.
///
/// What is a contact, for features (vertices, edges, faces) of two surfaces A and B and gaps up to the margin:
///
///  - vertex–surface: a vertex v of A and a point q of B that is a local minimum of the distance from v, on a face, an
///    edge or a vertex of B (v lies in that feature's Voronoi region), and the same with A and B exchanged;
///  - edge–edge: the nearest points of two edges, inside both, where the direction between them lies in the normal cone
///    of each edge; for creases the cone is widened (by 12° at a right angle, 17° on a knife's edge, 0 on a plane), so
///    that bodies that rest on each other face to face keep the crossings of their outlines while they rock. Pairs that
///    only the widening lets in are no local minima of the distance.
///
/// Solids that all but touch (nearer than a hundredth of the edges at hand) have the normals of the faces that lie on
/// each other: flush stacks press straight down. A vertex whose own surface runs through the plane of the contact has
/// that of a face nearby which it does not run through, if there is one; below that face's plane only where its surface
/// enters the other body. Rims that touch without an area in common have none.
///
/// Features that are apart and would pass each other within the expected motion (CollisionBody::displacement) may have
/// the normal of one of their faces in place of the direction between them, if the motion goes less far through that: a
/// body that slides along a floor of many boxes is not stopped by their sides.
///
/// Every local minimum of the distance between the two surfaces is among these, so a pair that is within the margin has
/// at least one. Of closed surfaces only the outer side counts, of open modal sheets both, of open rigid ones the
/// front.
///
/// Where surfaces intersect, the vertices of each inside the other are contacts too, of negative gap, with the nearest
/// point of the other surface (see OverlapMethod): they are found by spreading over the mesh from where triangles
/// intersect, so deep ones are found as well, and whole bodies that lie within others. Inside and outside are told by
/// angle-weighted pseudonormals (Bærentzen and Aanæs, IEEE TVCG 11(3), 2005). Edges that have crossed give edge–edge
/// contacts of negative gap: surfaces intersect along closed loops, and of each loop the crossings count whose normal
/// is within 26° of that of a vertex inside next to it or, if there is none, of the crossing along which the loop is
/// least wide.
///
/// Balls and capsules are a point and a segment with a radius: their gaps are those of the core less the radius.
/// Against a half-space all vertices (of a ball or capsule: centres) count. Convex rigid shapes against each other have
/// one normal, of the nearest points or of least penetration, and the contacts of the two faces clipped against each
/// other.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "limber/collision/aabb.h"
#include "limber/core/rigid_transform.h"
#include "limber/dynamics/contact_source.h"
#include "limber/model/modal_model.h"
#include "limber/model/shape.h"
#include "limber/model/skin_pose.h"

namespace limber {

class CollisionSurface;
class DeformedSurface;

/// A rigid shape made ready to touch others. Immutable; shared by all bodies and threads.
class RigidGeometry {
 public:
  /// @throws InvalidArgument if the shape is not valid (see validate(Shape))
  explicit RigidGeometry(const Shape& shape);
  ~RigidGeometry();
  RigidGeometry(RigidGeometry&&) noexcept;
  RigidGeometry& operator=(RigidGeometry&&) noexcept;

  const Shape& shape() const;
  /// In the body frame, m. A half-space's is infinite, but on the side of its normal if that is an axis.
  Aabb bounds() const;
  /// Of an open mesh or a height field none of whose faces looks back: the way it looks, the direction of the sum of
  /// its area vectors, unit. It is the top of something solid, and all that it is above of is inside. Zero for the
  /// rest.
  const Vec3& up() const;
  /// The triangles of a box, hull, mesh or height field; null for the other shapes.
  const std::shared_ptr<const CollisionSurface>& surface() const;

 private:
  friend class NarrowPhase;
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

/// The volume block of a modal body made ready for the overlap methods that need one. Immutable; shared by all its
/// instances.
class RestVolume {
 public:
  /// @throws InvalidArgument if the model has no volume block
  explicit RestVolume(std::shared_ptr<const ModalModel> model);
  ~RestVolume();
  RestVolume(RestVolume&&) noexcept;
  RestVolume& operator=(RestVolume&&) noexcept;

 private:
  friend class NarrowPhase;
  struct Impl;
  std::unique_ptr<const Impl> impl_;
};

/// A body as the narrow phase sees it: either a surface that deforms, bound to its amplitudes, or a rigid geometry.
struct CollisionBody {
  Index index = -1;  ///< for ContactSide::body
  RigidTransform X_WB{};
  DeformedSurface* surface = nullptr;
  const RigidGeometry* geometry = nullptr;
  const RestVolume* volume = nullptr;  ///< optional, of the surface's model
  /// How it is expected to move before the contacts are looked for again, world: of its origin, m, and the rotation
  /// vector, rad. Decides the normals of features that are apart and would be passed.
  Vec3 displacement = Vec3::Zero(), rotation = Vec3::Zero();
  /// How far any of its points may come beside that displacement, m, ≥ 0. Features of two surfaces whose boxes stay
  /// farther apart than both reaches all along both displacements are no contacts. Infinite: not known.
  double reach = std::numeric_limits<double>::infinity();
  /// By how much it may stand in another body and still be kept apart by the plane that it stands in, m, ≥ 0: what a
  /// solver leaves of overlaps. Bodies that slide over flush boxes are then not stopped by their sides.
  double left_alone = 0.0;
};

/// Depth and normal of a vertex that is inside another modal body.
enum class OverlapMethod {
  kNearestPoint,  ///< of the deformed surface: exact, but jumps where two sides are equally near
  /// In the rest shape: the vertex is carried back through the tetrahedron that holds it, and the direction to the
  /// nearest point of the rest surface forward again, n ∝ F⁻ᵀN. As steady as the rest shape allows however deep the
  /// overlap; bodies without a volume block take kNearestPoint.
  kRestDepth,
};

/// Normals of overlaps found in another way, for two modal bodies with volume blocks. Vertices of each inside the other
/// leave it where the line along the normal first goes out of its surface: gap = −that length.
class OverlapNormals {
 public:
  struct Body {
    std::shared_ptr<const ModalModel> model{};  ///< with a volume block
    std::span<const double> amplitudes{};
    const SkinPose* skin = nullptr;  ///< null: the body bends by its modes alone
    RigidTransform X_PB{};           ///< pose in the frame of the pair
  };
  virtual ~OverlapNormals() = default;
  /// The pair that normal() is asked about until the next call; a surface's amplitudes last until then. Called for
  /// every pair that is near, so work belongs into normal(). @param tolerance a length that is round-off here, m
  virtual void bind(const Body& a, const Body& b, double tolerance) = 0;
  /// Unit, out of one body (0: a, 1: b) towards the other, for a point of the other that is inside; the frame of the
  /// pair. Zero: not known, and the nearest point serves.
  virtual Vec3 normal(int out_of, const Vec3& p) = 0;
};

struct NarrowPhaseOptions {
  OverlapMethod overlap = OverlapMethod::kRestDepth;
  /// Makes what gives the normals of overlaps in place of `overlap`, once for each thread; empty: nothing does.
  std::function<std::unique_ptr<OverlapNormals>()> normals{};
};

/// Finds contacts; holds the scratch of one thread, and allocates nothing once warm. Contacts are appended, in an order
/// that depends on nothing but the arguments; ids are made of the two features, so that they are the same in every
/// query and differ among the contacts of one pair.
///
/// All is computed in the frame of one of the two bodies: bodies far from the world's origin lose no digits but those
/// of their poses.
class NarrowPhase {
 public:
  explicit NarrowPhase(const NarrowPhaseOptions& options = {});
  ~NarrowPhase();
  NarrowPhase(NarrowPhase&&) noexcept;
  NarrowPhase& operator=(NarrowPhase&&) noexcept;

  /// All contacts of a and b with gap ≤ margin that their motions may bring together. Two half-spaces have none.
  /// @param origin positions come out relative to it, world @pre a.index < b.index, poses finite
  void find_contacts(const CollisionBody& a, const CollisionBody& b, double margin, const Vec3& origin,
                     std::vector<ContactPoint>& contacts);

  /// Where a modal body touches itself: contacts of triangles that have no vertex in common, as of two bodies. Vertices
  /// that are inside another part are those that another point of the material coincides with, and leave it as
  /// kRestDepth says; told with CollisionBody::volume alone.
  void find_self_contacts(const CollisionBody& body, double margin, const Vec3& origin,
                          std::vector<ContactPoint>& contacts);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
