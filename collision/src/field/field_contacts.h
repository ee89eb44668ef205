// Contacts of two bodies of which one deforms, by samples of one surface in the distance field of the other.
//
//  - vertex–surface: each vertex of either surface that the other's field has within the margin. The field names a
//    triangle; the foot is walked to from there on the deformed surface, so that gaps and normals are those of the
//    triangles (Barbič and James 2008 take them of the field).
//  - edge–edge: an edge goes through the other surface, or comes nearest to it between its ends, where the field along
//  it
//    says so. Faces there are found by walking, and the edge is tested against theirs in closed form, by the definition
//    of NarrowPhase: nearest points inside both, directions in the normal cones of both, and of edges that have crossed
//    those that go the way out of their loop of intersection.
//  - One way out of a patch: a vertex inside whose own surface runs through the plane of its nearest point is no
//  witness
//    of that way out. It leaves along the direction of its patch, the inside vertices that edges join:
//      n ∝ −Σ a_v,   a_v its area vector outwards
//    ([H03]'s −∮_{∂A∩B} n_A dA), where the straight line along n first leaves the other surface.
//
// Half-spaces, balls, capsules and boxes have their distances in closed form. All contacts are kept.
#pragma once

#include <cstdint>
#include <vector>

#include "field/contact_planes.h"
#include "field/field_edges.h"
#include "limber/collision/narrow_phase.h"

namespace limber::internal {

/// A body as contacts by fields see it: a shell, or a rigid half-space, ball or capsule.
struct FieldBody {
  const DeformedPointshell* shell = nullptr;  ///< one of the two
  const RigidGeometry* geometry = nullptr;
};

/// Where b is in the frame of a.
struct FieldMotion {
  RigidTransform X_AB{}, end{};  ///< now, and as expected at the step's end
  Vec3 fall = Vec3::Zero();      ///< frame of a, m: one of the two may do that beside it (ContactQuery::fall)
  double passed = 0.0;           ///< m: planes that were passed by so much still keep a and b apart
  Parting* parting = nullptr;    ///< from query to query, see part()
};

/// Holds the scratch of one thread, and allocates nothing once warm. The same contacts in the same order whatever was
/// asked before.
class FieldContacts {
 public:
  /// Whether the fields of both resolve what touches: shells do (Pointshell::resolved()), and no grid's cells are
  /// longer than an eighth of the other body's longest side. Other pairs are NarrowPhase's.
  static bool serves(const FieldBody& a, const FieldBody& b);

  /// All contacts of gap ≤ reach + closing(), ascending by id: the two features, as NarrowPhase names them, but for
  /// vertices a face of no number in place of the feature met, so that what slides keeps its id. Until the next call.
  /// @pre serves(a, b), reach ≥ 0, m
  std::span<const FoundContact> find(const FieldBody& a, const FieldBody& b, const FieldMotion& motion, double reach);
  std::span<const FoundContact> find(const FieldBody& a, const FieldBody& b, const RigidTransform& X_AB, double reach) {
    return find(a, b, FieldMotion{X_AB, X_AB}, reach);
  }
  /// What the expected motion of the two points of a contact, and a fall, close of its gap, m; negative: it opens.
  static double closing(const FieldBody& a, const FieldBody& b, const FieldMotion& motion, const FoundContact& contact);

 private:
  void find_on_shape(const FieldBody& body, const FieldBody& shape, bool shape_is_a);
  void find_shape_in_field(const FieldBody& body, const Capsule& shape, const RigidTransform& X_BS, bool shape_is_a);
  void find_between(const FieldBody& a, const FieldBody& b);
  void find_samples(int of, std::span<const std::uint32_t> clusters, const SampleBounds& bounds);
  static void settle_foot(const FieldView& view, const FieldHit& hit, SampleFoot& sample);
  void leave_by_patches(const FieldView& view);
  void add_sample(int of, const SampleFoot& sample, const Vec3f& n);
  double comes_near(int of) const;
  void settle();

  double reach_ = 0.0;
  FieldView view_[2];  ///< of a in b's field, and of b in a's
  const FieldBody* bodies_[2] = {};
  FieldMotion motion_{};
  std::vector<std::uint32_t> near_, other_near_;  ///< clusters
  std::vector<float> bounds_[2];                  ///< of samples: distances, motions, slopes
  std::vector<FieldHit> hits_;
  std::vector<SampleFoot> samples_;  ///< of one side
  std::vector<FeatureKey> feet_;     ///< of a ball or capsule
  PatchExits patches_;
  FieldEdges edges_;
  std::vector<FoundContact> found_;
};

}  // namespace limber::internal
