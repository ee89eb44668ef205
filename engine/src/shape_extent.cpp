#include "shape_extent.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limber::internal {
namespace {

template <class Points>
ShapeExtent extent_of_points(const Points& points) {
  double radius = 0.0;
  Vec3 low = points.front().template cast<double>(), high = low;
  for (const auto& point : points) {
    const Vec3 p = point.template cast<double>();
    radius = std::max(radius, p.norm());
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return {radius, (high - low).minCoeff()};
}

struct ExtentOf {
  ShapeExtent operator()(const HalfSpace&) const { return {}; }
  ShapeExtent operator()(const Sphere& ball) const { return {ball.radius, 2.0 * ball.radius}; }
  ShapeExtent operator()(const Capsule& c) const { return {c.radius + c.half_length, 2.0 * c.radius}; }
  ShapeExtent operator()(const Box& box) const { return {box.half_extents.norm(), 2.0 * box.half_extents.minCoeff()}; }
  ShapeExtent operator()(const ConvexHull& hull) const { return extent_of_points(hull.points); }
  ShapeExtent operator()(const TriangleMesh& mesh) const { return extent_of_points(mesh.vertices); }
  ShapeExtent operator()(const HeightField& field) const {
    const auto [low, high] = std::ranges::minmax(field.heights);
    const Vec3 side((field.columns - 1) * field.spacing_x, (field.rows - 1) * field.spacing_y,
                    static_cast<double>(high) - low);
    const double height = std::max(std::abs(low), std::abs(high));
    return {Vec3(side.x(), side.y(), height).norm(), side.minCoeff()};
  }
};

}  // namespace

ShapeExtent extent_of(const Shape& shape) { return std::visit(ExtentOf{}, shape); }

ShapeExtent extent_of(std::span<const ShapePart> parts) {
  ShapeExtent sum = {0.0, std::numeric_limits<double>::infinity()};
  for (const ShapePart& part : parts) {
    const ShapeExtent own = extent_of(*part.shape);
    sum = {std::max(sum.radius, part.pose.p.norm() + own.radius), std::min(sum.thickness, own.thickness)};
  }
  return sum;
}

ShapeExtent extent_of(const ModalModel& model) { return extent_of_points(model.collision().rest); }

}  // namespace limber::internal
