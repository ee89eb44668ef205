// One body of a pair over a stretch of a step, as TimeOfImpact sees it: where each part of it is at both ends of the
// stretch, and how far its points may be off the straight lines between these.
//
// A point is at p + R (r + U z). With z_c on the chord from z₀ to z₁, |z − z_c| ≤ e, and w₀, w₁ = r + U z₀, r + U z₁,
// what it is off its own chord is at most
//   s (1 − s) [½h² B |w| + h |ω| Σ u |z₁ − z₀|] + Σ u e        s the part of the stretch that has passed
// with B, |ω| bounds over the stretch (docs/derivations/motion-bounds.md), and e = s (1 − s) ½h² sup|z̈|, or what the
// mode can do at all where that is less. The origin's own parabola is left to the pair, as two bodies have gravity in
// common.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "finder/impact_kernels.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/deformed_surface.h"
#include "limber/collision/time_of_impact.h"
#include "limber/model/shape.h"

namespace limber::internal {

/// How far points are off their chords: `bend` · s (1 − s) + `offset`, m.
struct ChordError {
  double bend = 0.0, offset = 0.0;
};

/// A node or a triangle.
struct PlacedPart {
  Slab slab;
  float bend = 0.0f;
};

/// Its members are many since one stretch is looked at from both ends, by three kinds of body (plane, core, surface),
/// in memory that is kept from pair to pair.
class MovingSide {
 public:
  void start(const MovingBody& body);
  /// The stretch begins where the last one ended, or at `t`.
  void go_to(double t);
  void look_ahead(double until);
  /// After look_ahead(). @param directions of the world; a plane's own need not be the same at both ends
  void set_directions(const std::array<std::array<Vec3, kDirections>, 2>& directions);

  const std::optional<HalfSpace>& plane() const { return plane_; }
  const Vec3& position(int end) const { return state(end).pose.p; }
  const Mat3& rotation(int end) const { return rotation_[place(end)]; }
  Vec3 linear_acceleration() const { return motion_ ? motion_->path().acceleration() : Vec3(Vec3::Zero()); }
  double thickness() const { return core_radius_; }
  double arm() const { return arm_; }  ///< no point was farther from the origin within the stretch, m
  double speed() const;                ///< no point was faster, m/s
  const FrameBounds& frame_bounds() const { return bounds_.frame; }
  double smooth_until(double t) const;
  ChordError error() const { return error(arm_); }
  ChordError error(double arm) const;  ///< of points no farther than `arm` from the origin
  /// A plane is as wide as the other body is far: its points are those abreast of it.
  ChordError plane_error(double reach, double others_speed) const;

  // The tree; a core is one leaf with one item.
  bool leaf(Index node) const { return !surface_ || surface_->node(node).leaf(); }
  Index child(Index node) const { return surface_->node(node).child; }
  Index weight(Index node) const { return surface_ ? surface_->node(node).count : 1; }
  /// Where they are along the directions. The reference holds until the next call.
  const PlacedPart& node(Index node);
  const PlacedPart& item(Index node, Index number);

  /// Corners of one triangle or core, body frame, at both ends.
  struct Item {
    std::array<std::array<Vec3, 3>, 2> point;
    std::size_t count = 0;
  };
  Item points(Index node, Index number);

 private:
  /// Which of two states stands for an end.
  std::size_t place(int end) const { return moves_ && (end == 1) != swapped_ ? 1u : 0u; }
  const MotionState& state(int end) const { return states_[place(end)]; }
  bool skinned() const { return surface_ && surface_->skin() != nullptr; }
  DeformedSurface& shape(int end) { return shapes_[surface_->modes() > 0 ? place(skinned() ? 0 : end) : 0u]; }
  void bind_shape(std::size_t at);
  void evaluate(double t, int end);
  void take_core(const Shape& shape);
  void bound_flexing();
  void bound_skin();
  void bound_turning();
  std::pair<PlacedPart*, bool> part_at(std::size_t key);
  static void fill_below(Slab& slab);
  double surface_radius() const;
  Index item_triangle(Index node, Index number) const {
    return surface_->node_triangles(node)[static_cast<std::size_t>(number)];
  }

  const ExactMotion* motion_ = nullptr;
  bool moves_ = false, swapped_ = false;
  std::shared_ptr<const CollisionSurface> surface_;
  std::array<Vec3, 2> core_{Vec3::Zero(), Vec3::Zero()};
  std::size_t core_count_ = 0;
  double core_radius_ = 0.0;
  std::optional<HalfSpace> plane_;
  double radius_ = 0.0;  // of the rest shape about the body origin

  std::array<MotionState, 2> states_;
  std::array<DeformedSurface, 2> shapes_;
  std::array<Mat3, 2> rotation_{Mat3::Identity(), Mat3::Identity()};
  MotionBounds bounds_;
  double duration_ = 0.0;
  double arm_ = 0.0, flexing_way_ = 0.0, flexing_bend_ = 0.0, flexing_offset_ = 0.0, flexing_speed_ = 0.0;
  bool turns_at_once_ = false;
  double turning_way_ = 0.0, turning_bend_ = 0.0, turning_chord_ = 0.0;
  std::vector<double> change_, shape_rates_;  // with a skin

  std::array<Directions, 2> directions_;  // body frame
  std::vector<PlacedPart> parts_;         // that were asked for
  std::size_t parts_used_ = 0;
  struct Slot {
    std::uint32_t stamp = 0, part = 0;
  };
  std::uint32_t stamp_ = 0;
  std::vector<Slot> slots_;  // by node, then by triangle
};

}  // namespace limber::internal
