#include "limber/model/shape.h"

#include <cmath>
#include <string>

#include "limber/core/error.h"

namespace limber {
namespace {

[[noreturn]] void refuse(const char* shape, const std::string& seen, const char* expected) {
  throw InvalidArgument(std::string(shape) + ": " + seen + ", expected " + expected);
}

void require_positive(const char* shape, const char* member, double value) {
  if (!(value > 0.0 && std::isfinite(value)))
    refuse(shape, std::string(member) + " is " + std::to_string(value), "a finite number above 0");
}

void require_finite(const char* shape, const std::vector<Vec3>& points) {
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!points[i].allFinite()) refuse(shape, "point " + std::to_string(i) + " is not finite", "finite coordinates");
}

struct Check {
  void operator()(const HalfSpace& s) const {
    constexpr double kUnit = 1e-6;
    if (!(std::abs(s.normal.norm() - 1.0) <= kUnit))
      refuse("HalfSpace", "normal has length " + std::to_string(s.normal.norm()), "1");
    if (!std::isfinite(s.offset)) refuse("HalfSpace", "offset is not finite", "a finite number");
  }
  void operator()(const Sphere& s) const { require_positive("Sphere", "radius", s.radius); }
  void operator()(const Capsule& s) const {
    require_positive("Capsule", "radius", s.radius);
    if (!(s.half_length >= 0.0 && std::isfinite(s.half_length)))
      refuse("Capsule", "half_length is " + std::to_string(s.half_length), "a finite number of at least 0");
  }
  void operator()(const Box& s) const {
    for (int i = 0; i < 3; ++i) require_positive("Box", "half_extents", s.half_extents[i]);
  }
  void operator()(const ConvexHull& s) const {
    if (s.points.size() < 4) refuse("ConvexHull", std::to_string(s.points.size()) + " points", "at least 4");
    require_finite("ConvexHull", s.points);
  }
  void operator()(const TriangleMesh& s) const {
    if (s.triangles.empty()) refuse("TriangleMesh", "no triangles", "at least one");
    require_finite("TriangleMesh", s.vertices);
    for (std::size_t t = 0; t < s.triangles.size(); ++t)
      for (const Index v : s.triangles[t])
        if (v < 0 || static_cast<std::size_t>(v) >= s.vertices.size())
          refuse("TriangleMesh", "triangle " + std::to_string(t) + " has vertex " + std::to_string(v),
                 ("0 to " + std::to_string(static_cast<long>(s.vertices.size()) - 1)).c_str());
  }
  void operator()(const HeightField& s) const {
    if (s.columns < 2 || s.rows < 2)
      refuse("HeightField", std::to_string(s.columns) + " columns and " + std::to_string(s.rows) + " rows",
             "at least 2 of each");
    require_positive("HeightField", "spacing_x", s.spacing_x);
    require_positive("HeightField", "spacing_y", s.spacing_y);
    if (s.heights.size() != static_cast<std::size_t>(s.columns) * static_cast<std::size_t>(s.rows))
      refuse("HeightField", std::to_string(s.heights.size()) + " heights", "columns times rows");
    for (const float height : s.heights)
      if (!std::isfinite(height)) refuse("HeightField", "a height is not finite", "finite heights");
  }
};

}  // namespace

void validate(const Shape& shape) { std::visit(Check{}, shape); }

}  // namespace limber
