// Weights of a patch's contacts among the few that are kept of it: φ_r(x) ≥ 0, Σ_r φ_r = 1, Σ_r φ_r x_r = x, so that
// forces at x go to the kept ones with their sum and their torque. Of all such weights those with the least
// Σ_r φ_r |x − x_r|²: the barycentric ones of the kept points' Delaunay triangles.
#pragma once

#include <array>
#include <vector>

#include "convex/convex_polygon.h"

namespace limber::internal {

class PatchWeights {
 public:
  struct Weight {
    std::size_t kept = 0;  ///< its place among the kept ones
    double value = 0.0;
  };

  /// @param kept one or more points
  void set(const std::vector<PlanePoint>& kept);
  /// Those above 0. A point outside the hull of the kept ones has the weights of the nearest point of that hull. Where
  /// kept points lie on one circle, such as the corners of a rectangle, their triangles have equal parts.
  const std::vector<Weight>& find(PlanePoint p);

 private:
  using Triple = std::array<std::size_t, 3>;

  void find_on_line(double t);
  Triple first_triangle(const PlanePoint& p) const;
  std::array<double, 3> barycentric(const Triple& t, const PlanePoint& p) const;
  double outside_circle(const Triple& t, const std::array<double, 3>& of_r, std::size_t r) const;
  void add(const Triple& t, const std::array<double, 3>& values);

  std::vector<PlanePoint> kept_, scratch_, hull_;
  std::vector<std::pair<double, std::size_t>> line_;  // where all lie on one: how far along it
  PlanePoint origin_, along_;
  double size_ = 0.0;
  std::vector<Weight> weights_;
};

}  // namespace limber::internal
