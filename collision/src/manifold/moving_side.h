// One body of a pair over a stretch of its way, as TimeOfImpact sees it: where each part of it is at both ends of the
// stretch, and how far its points may be off the straight lines between these.
//
// A point is at p + R (r + U z), p and z go straight on, R turns evenly. With w₀, w₁ = r + U z₀, r + U z₁ at the ends,
// what it is off its own chord is at most
//   s (1 − s) [½ φ² |w| + φ Σ u |z₁ − z₀|]          s the part of the stretch that has passed, φ the angle of it
// or, where that is less, 2 sin(φ/2) |w|. A skin is taken as it is at the start, and all that it can do as a whole.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "limber/collision/collision_surface.h"
#include "limber/collision/deformed_surface.h"
#include "limber/collision/narrow_phase.h"
#include "limber/core/rigid_transform.h"
#include "manifold/slab_kernels.h"

namespace limber::internal {

/// One body of a pair, a modal surface or a rigid geometry but a half-space; at time t
///   p(t) = p + t displacement,  R(t) = exp(t [rotation]ₓ) R,  z(t) = z + t rates.
struct MovingBody {
  std::shared_ptr<const CollisionSurface> surface{};  ///< modal bodies
  const RigidGeometry* geometry = nullptr;            ///< rigid ones
  RigidTransform pose{};                              ///< X_WB
  Vec3 displacement = Vec3::Zero();                   ///< world, m
  Vec3 rotation = Vec3::Zero();                       ///< world, rad
  std::span<const double> amplitudes{}, rates{};      ///< as many of each; no rates: they stay
};

/// How far points are off their chords: `bend` · s (1 − s) + `offset`, m.
struct ChordError {
  double bend = 0.0, offset = 0.0;
};

/// A node or a triangle.
struct PlacedPart {
  Slab slab;
  float bend = 0.0f;
};

/// Parts that were placed along the directions at hand, by node, then by triangle.
class PlacedParts {
 public:
  void reserve(std::size_t keys) {
    if (slots_.size() < keys) slots_.resize(keys);
  }
  void forget_all();
  /// And whether it has been placed. The reference holds until the next call.
  std::pair<PlacedPart*, bool> at(std::size_t key);

 private:
  struct Slot {
    std::uint32_t stamp = 0, part = 0;
  };
  std::vector<PlacedPart> parts_;  // that were asked for
  std::size_t used_ = 0;
  std::uint32_t stamp_ = 0;
  std::vector<Slot> slots_;
};

class MovingSide {
 public:
  void start(const MovingBody& body);
  /// The stretch begins where the last one ended, or at `t`.
  void go_to(double t);
  void look_ahead(double until);
  /// After look_ahead(). @param directions of the world
  void set_directions(const std::array<Vec3, kDirections>& directions);

  const Vec3& position(int end) const { return at(end).pose.p; }
  const Mat3& rotation(int end) const { return at(end).rotation; }
  double thickness() const { return core_.radius; }
  double arm() const { return bounds_.arm; }
  ChordError error() const { return error(bounds_.arm); }
  ChordError error(double arm) const;  ///< of points no farther than `arm` from the origin

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
  /// The body at one end of the stretch.
  struct End {
    double time = 0.0;
    RigidTransform pose{};
    Mat3 rotation = Mat3::Identity();
    std::vector<double> amplitudes{};
    DeformedSurface shape{};
  };
  /// Points with a radius about them, of balls and capsules.
  struct Core {
    std::array<Vec3, 2> points{Vec3::Zero(), Vec3::Zero()};
    std::size_t count = 0;
    double radius = 0.0;
  };
  /// Over the stretch.
  struct Bounds {
    double arm = 0.0;              // no point was farther from the origin, m
    double offset = 0.0;           // of a skin, m
    double bend = 0.0, way = 0.0;  // of the turning: ½ φ², φ Σ u |z₁ − z₀|
    double chord = 0.0;            // 2 sin(φ/2)
    bool turns_at_once = false;    // the turning is bounded by all that it can do
  };

  /// Which of two states stands for an end.
  std::size_t place(int end) const { return moves_ && (end == 1) != swapped_ ? 1u : 0u; }
  const End& at(int end) const { return ends_[place(end)]; }
  bool skinned() const { return surface_ && surface_->skin() != nullptr; }
  DeformedSurface& shape(int end) { return ends_[flexes_ ? place(skinned() ? 0 : end) : 0u].shape; }
  void evaluate(double t, int end);
  void bind_shape(std::size_t place);
  void take_core(const Shape& shape);
  double radius() const;
  void bound_flexing();
  void bound_skin();
  Index item_triangle(Index node, Index number) const {
    return surface_->node_triangles(node)[static_cast<std::size_t>(number)];
  }

  MovingBody body_;
  bool moves_ = false, flexes_ = false, swapped_ = false;
  std::shared_ptr<const CollisionSurface> surface_;
  Core core_;
  std::array<End, 2> ends_;
  Bounds bounds_;
  std::vector<double> change_, shape_rates_;  // with a skin
  std::array<Directions, 2> directions_;      // body frame
  PlacedParts parts_;
};

}  // namespace limber::internal
