// Two bodies as contacts by fields see them, and what is found between them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "field/surface_walk.h"
#include "limber/core/disjoint_sets.h"

namespace limber::internal {

/// Part of lengths that is noise in single precision, after some sums: directions between points nearer than that.
inline constexpr float kNoise = 1e-5f;

/// What is known of a plane between two bodies that touch nowhere.
struct Parting {
  Vec3 direction = Vec3::Zero();  ///< along which they are farthest apart, out of b, frame of a; zero: nobody knows
  /// m: they are so far apart now, a fall taken off; 0: not parted
  double gap = 0.0;
};

/// One body's surface as the other's field sees it.
struct FieldView {
  const DeformedPointshell* mine = nullptr;
  const DeformedPointshell* other = nullptr;
  FieldQuery query{};                                  ///< in the other's frame
  Eigen::Matrix3f turn = Eigen::Matrix3f::Identity();  ///< from my frame to the other's
  Vec3f shift = Vec3f::Zero();

  /// All but what the query is asked of: enough for apart() and part().
  /// @param X_FS, end where I am in the field's frame, and am expected to be at the step's end
  /// @param fall one of us may do that beside it, field's frame, m
  void place(const DeformedPointshell& me, const DeformedPointshell& field, const RigidTransform& X_FS,
             const RigidTransform& end, const Vec3& fall, double reach);
  /// The rest. @pre place()
  void see_field();
  /// Whether the boxes of both are farther apart than the query's reach along an axis of the field's frame.
  /// @param parting out, if they are: the gap now. Or null
  bool apart(Parting* parting) const;
  Vec3f placed(const Vec3f& p) const { return turn * p + shift; }
  Vec3f turned_back(const Vec3f& direction) const { return turn.transpose() * direction; }
  /// What the turn is expected to change by.
  auto turning() const { return Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(&query.turn[0][0]); }
  /// How a point of mine is expected to move in the other's frame, its modes aside; and a vertex.
  Vec3f carried(const Vec3f& p) const { return turning() * p + Eigen::Map<const Vec3f>(query.shift); }
  Vec3f motion(Index v) const { return carried(mine->vertex(v)) + turn * mine->swing(v); }
};

/// Makes room; what a buffer holds beyond is left as it is.
template <class T>
void grow(std::vector<T>& buffer, std::size_t size) {
  if (buffer.size() < size) buffer.resize(size);
}

/// The key of a surface that a vertex meets, whatever the feature there: a face, of no number.
inline const FeatureKey kAnyFace = feature_key(Feature::Kind::kFace, 0x3fffffff);

struct FoundContact {
  FeatureSide of[2] = {{.key = kAnyFace}, {.key = kAnyFace}};  ///< of a and b, each in its body's frame
  Vec3 normal = Vec3::Zero();                                  ///< unit, frame of a, out of b into a
  double gap = 0.0;                                            ///< m: normal · (p_a − p_b)

  std::uint64_t id() const { return std::uint64_t{of[0].key} << 32 | of[1].key; }
};

FeatureSide at_vertex(const DeformedPointshell& body, Index v);
FeatureSide on_foot(const SurfaceFoothold& foot);

/// A vertex and where it meets the other surface, in the field's frame.
struct SampleFoot {
  Index vertex = -1;
  Vec3f at = Vec3f::Zero();
  SurfaceFoothold foot{};
  Vec3f normal = Vec3f::Zero();  ///< unit, out of the field's surface
  float gap = 0.0f;              ///< m
};

/// Patches of inside vertices that edges join, each with one way out: against the area vector of its part inside.
class PatchExits {
 public:
  void find(const FieldView& view, std::span<const SampleFoot> samples);
  /// Unit, in the field's frame, for an inside vertex's surface to move along; zero of a patch whose area vectors all
  /// but cancel.
  const Vec3f& way(std::size_t sample) {
    return patches_[static_cast<std::size_t>(joined_.root(static_cast<Index>(sample)))].way;
  }
  /// first_exit() of points in the field's frame.
  bool leaves(const Vec3f& from, const Vec3f& to, FieldHit& exit) const;

 private:
  struct Patch {
    Vec3f way = Vec3f::Zero();
    float area = 0.0f;
  };
  Index& sample_of(Index vertex);
  Vec3f area_inside(Index triangle, Index corner);
  float part_inside(Index triangle, std::size_t edge, const Vec3f& from, const Vec3f& to);

  FieldView view_;
  FieldQuery query_{};   ///< of points in the field's frame
  DisjointSets joined_;  ///< samples
  std::vector<Patch> patches_;
  std::vector<Index> sample_of_;  ///< per vertex; −1: not inside. All −1 between calls
  /// Per edge from an inside vertex, how far along it is inside, as a part of it; −1: not known. All −1 between calls.
  std::vector<float> part_inside_;
};

}  // namespace limber::internal
