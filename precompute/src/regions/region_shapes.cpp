#include "regions/region_shapes.h"

#include <algorithm>
#include <cmath>

#include "limber/core/error.h"
#include "limber/mesh/winding_number.h"

namespace limber::internal {
namespace {

const GroupedSurface& required(const std::optional<GroupedSurface>& faces) {
  if (!faces || faces->surface.triangles.empty())
    throw InputError("materials: a region is given by faces, but the input is no surface with named faces");
  return *faces;
}

bool names(const SurfaceGroup& group, const std::string& name) { return group.name == name || group.material == name; }

bool holds(const Everywhere&, const Vec3&) { return true; }
bool holds(const InsideBox& b, const Vec3& p) {
  return (p.array() >= b.low.array()).all() && (p.array() <= b.high.array()).all();
}
bool holds(const InsideBall& b, const Vec3& p) { return (p - b.center).norm() <= b.radius; }
bool holds(const InsideHalfSpace& h, const Vec3& p) { return (p - h.point).dot(h.normal) <= 0.0; }
bool holds(const InsideShells& s, const Vec3& p) { return std::abs(winding_number(s.surface, p)) > 0.5; }

}  // namespace

NearestFaces::NearestFaces(const std::optional<GroupedSurface>& faces)
    : faces_(required(faces)), locator_(faces_.surface.vertices, faces_.surface.triangles) {}

NearFace NearestFaces::at(const Vec3& p) const {
  const SurfaceLocation found = locator_.nearest(p);
  const auto after =
      std::upper_bound(faces_.groups.begin(), faces_.groups.end(), found.triangle,
                       [](Index triangle, const SurfaceGroup& g) { return triangle < g.first + g.count; });
  return {&*after, found.distance};
}

ShapeTest::ShapeTest(const MaterialRegion& region, const std::optional<GroupedSurface>& faces) : shape_(region.shape) {
  if (const auto* near = std::get_if<NearFaces>(&shape_)) {
    const auto& groups = required(faces).groups;
    if (std::none_of(groups.begin(), groups.end(), [&](const SurfaceGroup& g) { return names(g, near->name); }))
      throw InputError("materials: region \"" + region.name + "\" is given by faces \"" + near->name +
                       "\", but the surface has no group and no material of that name");
  }
  if (const auto* shells = std::get_if<InsideShells>(&shape_))
    for (const Vec3& v : shells->surface.vertices) box_.extend(v);
}

bool ShapeTest::holds(const Vec3& p, const std::optional<NearFace>& face) const {
  if (const auto* near = std::get_if<NearFaces>(&shape_))
    return names(*face->group, near->name) && face->distance <= near->depth;
  if (std::holds_alternative<InsideShells>(shape_) && !box_.contains(p)) return false;
  return std::visit(
      [&](const auto& shape) {
        if constexpr (std::is_same_v<std::decay_t<decltype(shape)>, NearFaces>)
          return false;  // answered above
        else
          return internal::holds(shape, p);
      },
      shape_);
}

}  // namespace limber::internal
