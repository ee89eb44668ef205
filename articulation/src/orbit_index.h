/// @file orbit_index.h
/// Where the orbits of a one-parameter motion meet a set of surfaces. Private to the articulation module.
///
/// In path coordinates x runs along the axis and θ about it. An orbit is a point of the *orbit plane*: (r, x) for
/// rotations, (y, z) for translations. A triangle can only be met by orbits inside its box in that plane, so a tree
/// over these boxes answers each orbit by a point query. A screw's orbits are told apart by r and x − pitch θ.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "limber/articulation/free_motion.h"
#include "spans.h"

namespace limber::internal {

/// An orbit and where on it t = 0 lies.
struct Orbit {
  std::array<double, 2> plane{};  ///< rotation, screw: r and x; translation: y and z
  double phase = 0.0;             ///< rotation, screw: θ; translation: x
};

/// A part of an orbit inside a body, or a crossing of a sheet (low == high).
struct OrbitPiece {
  double low = 0.0, high = 0.0;  ///< t, rotations: within [−π, π]; ±∞ never
  Index body = -1;
  int sheet = 0;  ///< 0: a solid; +1, −1: a sheet crossed against or along its normal
  /// Tangent of the angle between the orbit and the surface's normal where the piece begins and ends: how much later,
  /// in length, an orbit meets the surface per length that it lies beside.
  double slope_low = 0.0, slope_high = 0.0;
};

/// A box in the orbit plane.
struct OrbitBox {
  std::array<double, 2> low{1e300, 1e300}, high{-1e300, -1e300};
  void add(double first, double second);
  void add(const OrbitBox& other);
  void grow(double by);
  bool overlaps(const OrbitBox& other) const;
};

/// Surfaces in path coordinates.
class PathFrame {
 public:
  explicit PathFrame(const MotionPath& path);
  Vec3 to_path(const Vec3& p) const { return axes_.transpose() * (p - origin_); }
  Vec3 from_path(const Vec3& p) const { return axes_ * p + origin_; }
  Orbit orbit_of(const Vec3& p) const;        ///< p in path coordinates
  OrbitBox plane_point(const Vec3& p) const;  ///< p in path coordinates: its place in the orbit plane, no screw's
  OrbitBox box_of(const Orbit& orbit) const;  ///< a point
  OrbitBox box_of(std::span<const Vec3, 3> corners) const;  ///< of the orbits that meet a triangle
  double speed(const Orbit& orbit) const;                   ///< length per unit of t
  MotionPath::Kind kind() const { return kind_; }
  double pitch() const { return pitch_; }

 private:
  double start_of_helix(const Orbit& orbit) const;

  MotionPath::Kind kind_;
  double pitch_;
  Vec3 origin_;
  Mat3 axes_;  ///< columns x, y, z
};

/// Triangles of a set of bodies that some orbit of interest can meet, as a tree.
class OrbitIndex {
 public:
  struct Face {
    std::array<Vec3, 3> corners;         ///< path coordinates, counter-clockwise seen from outside
    Vec3 normal;                         ///< outward, unit; 0 without an area
    double offset = 0.0;                 ///< normal · corner
    double across = 0.0, heading = 0.0;  ///< length and angle of the normal's part across the axis
    Index body = 0, triangle = 0;
    bool flipped = false;                ///< the second and third corner have changed places
    double bearing = 0.0, sector = 0.0;  ///< rotations, screws: all of it lies within θ = bearing ± sector
    double cosine_low = -1.0, cosine_high = 1.0;  ///< of θ − heading over the sector
    OrbitBox box{};
  };

  OrbitIndex(const PathFrame& frame, std::span<const MotionBody> bodies, std::vector<Face> faces);

  /// Pieces of the orbit inside or on the bodies, ascending in low. An orbit that runs through a crack between
  /// triangles or along a face is answered by one beside it. @param nudge how far beside, length
  void pieces(const Orbit& orbit, double nudge, std::vector<OrbitPiece>& out) const;

  bool meets(const OrbitBox& box) const;  ///< whether some triangle's box overlaps it
  const std::vector<Face>& faces() const { return faces_; }

 private:
  struct Node {
    OrbitBox box;
    Index first = 0, count = 0;  ///< of a leaf
    Index right = -1;            ///< of an inner node; left is the next node
  };
  struct Crossing {
    double t = 0.0;
    Index body = 0;
    int sign = 0;  ///< +1 against the outward normal (entering), −1 along it
    double slope = 0.0;
  };

  Index build(Index first, Index count);
  void crossings(const Orbit& orbit, std::vector<Crossing>& out) const;
  void cross(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const;
  void cross_circle(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const;
  void cross_line(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const;
  void cross_helix(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const;
  void cross_helix_part(const Face& face, const Orbit& orbit, const Span& part, std::vector<Crossing>& out) const;
  void add_solid(std::span<const Crossing> of_body, std::vector<OrbitPiece>& out) const;

  PathFrame frame_;
  std::vector<bool> closed_;
  std::vector<Face> faces_;
  std::vector<Node> nodes_;
};

/// A box around all orbits of the bodies' points.
OrbitBox reach_of(const PathFrame& frame, std::span<const MotionBody> bodies);

/// The triangles of all bodies that orbits within `reach` can meet, turned outward where a closed surface is inside
/// out.
std::vector<OrbitIndex::Face> orbit_faces(const PathFrame& frame, std::span<const MotionBody> bodies,
                                          const OrbitBox& reach);

}  // namespace limber::internal
