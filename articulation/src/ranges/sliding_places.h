/// @file sliding_places.h
/// Where two bodies run along each other on a path, and so do not stop each other. Private to the articulation module.
///
/// A surface *slides* where its normal lies across the motion: what it sweeps it hardly leaves, and its image in the
/// orbit plane (see path_frame.h) is a curve. Two parts that fit touch where the curves of both run side by side: the
/// facets of a pin and of its hole overlap by turns, and none of it is a stop. So an orbit within δ of a curve of
/// either body is a place where they slide, and what crosses there counts for nothing. δ is the caller's for faces that
/// touch a sliding face of the other body as drawn, and round-off's for all others.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "ranges/orbit_box_tree.h"
#include "ranges/orbit_faces.h"
#include "ranges/triangle_crossings.h"

namespace limber::internal {

class SlidingPlaces {
 public:
  /// @param across δ of faces that touch as drawn and of what continues them, length. @param least of the others,
  /// length. @param crease angle below which a face continues another, rad
  SlidingPlaces(const PathFrame& frame, const std::vector<OrbitFace>& moving, const std::vector<OrbitFace>& fixed,
                double across, double least, double crease);

  /// True if the orbit through p, in path coordinates, is such a place.
  bool holds(const Vec3& p) const;
  /// True if all orbits that meet a triangle are, asked at points no further apart than δ; false, too, for a triangle
  /// larger than eight δ.
  bool holds(const OrbitFace& face) const;
  /// Per face as given: true if it slides all over and touches as drawn. Where two such faces cross is such a place.
  const std::vector<char>& moving_along() const { return moving_along_; }
  const std::vector<char>& fixed_along() const { return fixed_along_; }

 private:
  /// A piece of a curve in the orbit plane.
  struct Piece {
    std::array<double, 2> from{}, to{};
    double reach = 0.0;
  };
  struct Curves {
    std::vector<Piece> pieces;
    std::optional<OrbitBoxTree> tree;
  };
  void add_curves(const OrbitFace& face, double reach, Curves& out) const;
  void add_curve(const Vec3& from, const Vec3& to, const Vec3& normal, double reach, Curves& out) const;
  bool near(const Curves& curves, double first, double second) const;

  const PathFrame& frame_;
  double across_;
  Curves moving_, fixed_;
  std::vector<char> moving_along_, fixed_along_;
};

}  // namespace limber::internal
