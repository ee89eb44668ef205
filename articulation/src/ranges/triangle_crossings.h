/// @file triangle_crossings.h
/// When two triangles cross while one of them follows a path. Private to the articulation module.
///
/// Two triangles begin and cease to cross where a corner of one comes to lie on the other or an edge meets an edge.
/// With n·q = c the plane of a fixed triangle, and (d, m) and (e, k) the unit direction and moment q × direction of a
/// moving and a fixed edge, these are the roots of
///
///   n·φ_t(p) − c = 0,   n·φ_{−t}(q) − c = 0,   φ_t(m)·e + φ_t(d)·k = 0                                    (1)
///
/// (the last: the reciprocal product of two lines is 0 where they meet). For rotations all are a + b cos t + c sin t,
/// for translations a + d t, in closed form; a screw's have terms t cos t and t sin t, and roots that are bracketed.
/// Between two roots that follow each other the triangles cross throughout or not at all.
#pragma once

#include <array>
#include <vector>

#include "ranges/orbit_faces.h"

namespace limber::internal {

/// A triangle and what (1) asks of it, path coordinates.
struct MeetingFace {
  MeetingFace() = default;
  explicit MeetingFace(const OrbitFace& face);
  std::array<Vec3, 3> corners, directions;  ///< of the edges from corner i to the next
  std::array<Vec3, 3> units, moments;       ///< of the edges: unit directions, and their moments
  std::array<Vec3, 3> sides;                ///< unit, in the triangle's plane, inward from the edges
  std::array<double, 3> radii{};            ///< of the corners about the axis
  Vec3 normal = Vec3::Zero();               ///< unit; 0 without an area
  double offset = 0.0, across = 0.0;        ///< of the plane; length of the normal's part across the axis
};

/// From `low` to `high` two triangles cross.
struct TriangleCrossing {
  double low = 0.0, high = 0.0;   ///< t; rotations: low within (−π, π], high − low ≤ 2π
  Vec3 first, last;               ///< where they meet at either end, as the fixed triangle stands
  std::array<Vec3, 2> at_middle;  ///< the ends of their common segment halfway between
};

/// True if two triangles cross at t = 0. @param segment out: the ends of what they share
bool cross_as_drawn(const OrbitFace& a, const OrbitFace& b, std::array<Vec3, 2>& segment);

class TriangleCrossings {
 public:
  /// @param slack by which a meeting may miss a triangle, length: such roots part an interval in two and do no harm
  TriangleCrossings(const PathFrame& frame, double slack) : frame_(frame), slack_(slack) {}

  /// Appends the crossings of two triangles, ascending.
  /// @param window of t outside of which they are known not to meet; rotations: not looked at
  void find(const MeetingFace& moving, const MeetingFace& fixed, const Interval& window,
            std::vector<TriangleCrossing>& out);

 private:
  struct Meeting {
    double t = 0.0;
    Vec3 point;
  };
  /// A position on the path. Rotations are found by cosine and sine; t is computed for those that count.
  struct Position {
    double t = 0.0, cosine = 1.0, sine = 0.0;
  };
  Position position(double t) const;
  Vec3 turned(const Vec3& direction, const Position& at) const;
  Vec3 moved(const Vec3& p, const Position& at, double sense = 1.0) const;
  double t_of(const Position& at) const;
  bool one_side(const MeetingFace& moving, const MeetingFace& fixed, const Interval& window) const;
  /// a + d t + (b + e t) cos t + (c + f t) sin t.
  struct Height {
    double a = 0.0, b = 0.0, c = 0.0, d = 0.0, e = 0.0, f = 0.0;
    double at(double t) const;
    double rate(double t) const;
  };
  Height height(const Vec3& point, const MeetingFace& over, double sense) const;
  Height product(const Vec3& direction, const Vec3& moment, const Vec3& e, const Vec3& k) const;
  void roots(const Height& height, const Interval& window);
  void bracketed_roots(const Height& height, double low, double high);
  void corners_on_faces(const MeetingFace& moving, const MeetingFace& fixed, const Interval& window);
  void edges_on_edges(const MeetingFace& moving, const MeetingFace& fixed, const Interval& window);
  bool crosses(const MeetingFace& moving, const MeetingFace& fixed, double t, std::array<Vec3, 2>& segment) const;
  bool over(const Vec3& p, const MeetingFace& face) const;

  const PathFrame& frame_;
  double slack_;
  std::vector<Position> roots_;
  std::vector<Meeting> meetings_;
};

}  // namespace limber::internal
