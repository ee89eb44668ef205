/// @file orbit_index.h
/// Crossings of the orbits of a one-parameter motion with a set of surfaces. Private to the articulation module.
///
/// A triangle can only be met by orbits inside its box in the orbit plane (see path_frame.h), so a tree over these
/// boxes answers each orbit by a point query.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "ranges/orbit_faces.h"
#include "ranges/spans.h"

namespace limber::internal {

/// Tangent of the angle whose cosine is given; ∞ for a right angle.
inline double slope_of(double cosine) { return std::sqrt(std::max(1.0 - cosine * cosine, 0.0)) / std::abs(cosine); }

/// A part of an orbit inside a body, or a crossing of a sheet (low == high).
struct OrbitPiece {
  double low = 0.0, high = 0.0;  ///< t, rotations: within [−π, π]; ±∞ never
  Index body = -1;
  int sheet = 0;  ///< 0: a solid; +1, −1: a sheet crossed against or along its normal
  /// Tangent of the angle between the orbit and the surface's normal where the piece begins and ends: how much later,
  /// in length, an orbit meets the surface per length that it lies beside.
  double slope_low = 0.0, slope_high = 0.0;
  bool one_sided_low = false, one_sided_high = false;  ///< of the faces there: see OrbitFace
};

/// Triangles of a set of bodies that some orbit of interest can meet, as a tree.
class OrbitIndex {
 public:
  OrbitIndex(const PathFrame& frame, std::span<const OrbitBody> bodies, const std::vector<OrbitFace>& faces);

  /// The faces that orbits within a distance of this one in the orbit plane can meet: for pieces().
  void gather(const Orbit& orbit, double around, std::vector<Index>& near) const;

  /// Pieces of the orbit inside or on the bodies, ascending in low. An orbit that runs through a crack between
  /// triangles or along a face is answered by one beside it. @param nudge how far beside, length. @param near what
  /// gather() found around it, or around an orbit nearer than its `around` less the nudge
  void pieces(const Orbit& orbit, double nudge, const std::vector<Index>& near, std::vector<OrbitPiece>& out) const;

 private:
  struct Plane {
    Vec3 normal;
    double offset = 0.0;
    double height(const Vec3& p) const { return normal.dot(p) - offset; }
  };
  /// Data for crossing a face; the part that tells that a circle misses it lies in one line of the cache.
  struct alignas(64) Face {
    Face(const OrbitFace& face, MotionPath::Kind kind);
    /// True if a point of the plane lies inside the triangle; on a side counts.
    bool holds(const Vec3& p) const {
      return (sides[0].height(p) >= 0.0) & (sides[1].height(p) >= 0.0) & (sides[2].height(p) >= 0.0);
    }
    Plane plane;
    double low, high;            ///< of `across` times the cosine of θ − heading
    double across, heading;      ///< see OrbitFace
    std::array<Plane, 3> sides;  ///< across the face, inward; for translations across the orbit plane
    double bearing, sector, low_x, high_x;
    Index body;
    bool one_sided, narrow;
    /// As slope_of(); what is too narrow to be a stop slides.
    double slope(double cosine) const { return narrow ? std::numeric_limits<double>::infinity() : slope_of(cosine); }
  };
  struct Crossing {
    double t = 0.0;
    Index body = 0;
    int sign = 0;  ///< +1 against the outward normal (entering), −1 along it
    double slope = 0.0;
    bool one_sided = false;
  };

  void crossings(const Orbit& orbit, const std::vector<Index>& near, std::vector<Crossing>& out) const;
  void cross_circle(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const;
  void cross_line(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const;
  void cross_helix(const Face& face, const Orbit& orbit, std::vector<Crossing>& out) const;
  void cross_helix_part(const Face& face, const Orbit& orbit, const Span& part, std::vector<Crossing>& out) const;
  void add_solid(std::span<const Crossing> of_body, std::vector<OrbitPiece>& out) const;

  PathFrame frame_;
  std::vector<bool> closed_;
  OrbitBoxTree tree_;
  std::vector<Face> faces_;  ///< in the order of the tree
};

}  // namespace limber::internal
