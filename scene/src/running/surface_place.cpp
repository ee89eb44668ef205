#include "running/surface_place.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "limber/core/error.h"
#include "limber/mesh/closest_point.h"

namespace limber::internal {
namespace {

using Weights = std::array<double, 3>;

/// The render surface of a body in the axes in which a place is told.
struct PlacedSurface {
  std::vector<float> positions;  // 3 per vertex, less `origin`
  Vec3 origin = Vec3::Zero();
  const std::vector<Triangle>* triangles = nullptr;

  Vec3 vertex(Index v) const {
    const float* p = positions.data() + 3 * static_cast<std::size_t>(v);
    return {p[0], p[1], p[2]};
  }
  TrianglePoints corners(const Triangle& t) const { return {vertex(t[0]), vertex(t[1]), vertex(t[2])}; }
};

PlacedSurface place_surface(const World& world, BodyId body, PlaceFrame frame) {
  const ModalModel& model = world.model(body);
  PlacedSurface s;
  s.triangles = &model.render().triangles;
  s.positions.resize(3 * static_cast<std::size_t>(model.render().vertices()));
  if (frame == PlaceFrame::kWorld) {
    s.origin = world.body(body).pose.p;
    world.reconstruct(body, s.positions, {}, 1.0, s.origin);
    return s;
  }
  std::size_t i = 0;
  for (const Vec3f& p : model.render().rest)
    for (int a = 0; a < 3; ++a) s.positions[i++] = p[a];
  if (frame == PlaceFrame::kInput) s.origin = model.data().origin_in_input;  // the axes are the same
  return s;
}

SurfacePoint render_point(std::size_t triangle, const Weights& w) {
  return {.surface = SurfacePoint::Surface::kRender, .triangle = static_cast<Index>(triangle), .weight = w};
}

SurfacePoint find(const NearestTo& place, const World& world, BodyId body, const std::string&) {
  const PlacedSurface s = place_surface(world, body, place.frame);
  const Vec3 p = place.point - s.origin;
  SurfacePoint best;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < s.triangles->size(); ++t) {
    const SurfaceFoot foot = closest_on_triangle(p, s.corners((*s.triangles)[t]));
    const double distance2 = (foot.point - p).squaredNorm();
    if (distance2 >= nearest) continue;
    nearest = distance2;
    best = render_point(t, foot.weight);
  }
  return best;
}

/// Hit of a ray on a triangle, seen from either side: its parameter, negative if it does not.
struct Hit {
  double parameter = -1.0;
  Weights weights{};
};

Hit meet(const TrianglePoints& x, const Vec3& from, const Vec3& direction) {
  // Cramer's rule for  from + t d = x0 + v e1 + w e2.
  const Vec3 e1 = x[1] - x[0], e2 = x[2] - x[0], n = direction.cross(e2);
  const double det = e1.dot(n);
  if (det == 0.0) return {};
  const Vec3 d = from - x[0];
  const Vec3 m = d.cross(e1);
  const double v = d.dot(n) / det, w = direction.dot(m) / det;
  // A ray through a shared edge must not slip between its two triangles.
  constexpr double kEdge = 1e-9;
  if (v < -kEdge || w < -kEdge || v + w > 1.0 + kEdge) return {};
  const double vi = std::max(v, 0.0), wi = std::max(w, 0.0), scale = 1.0 / std::max(1.0, vi + wi);
  return {e2.dot(m) / det, {1.0 - scale * (vi + wi), scale * vi, scale * wi}};
}

SurfacePoint find(const AlongRay& place, const World& world, BodyId body, const std::string& where) {
  const PlacedSurface s = place_surface(world, body, place.frame);
  const Vec3 from = place.from - s.origin;
  Hit first;
  SurfacePoint at;
  for (std::size_t t = 0; t < s.triangles->size(); ++t) {
    const Hit hit = meet(s.corners((*s.triangles)[t]), from, place.direction);
    if (hit.parameter < 0.0 || (first.parameter >= 0.0 && hit.parameter >= first.parameter)) continue;
    first = hit;
    at = render_point(t, hit.weights);
  }
  if (first.parameter >= 0.0) return at;
  throw InputError(where + ".at.ray: misses the body \"" + world.model(body).name() + "\" as it is at " +
                   std::to_string(world.time()) + " s, expected a ray that meets its surface");
}

SurfacePoint find(const OnTriangle& place, const World& world, BodyId body, const std::string& where) {
  const auto count = world.model(body).render().triangles.size();
  if (static_cast<std::size_t>(place.triangle) >= count)
    throw InputError(where + ".at.triangle: is " + std::to_string(place.triangle) + ", but the body's surface has " +
                     std::to_string(count) + " triangles, counted from 0");
  return render_point(static_cast<std::size_t>(place.triangle), place.weights);
}

SurfacePoint find(const AtVertex& place, const World& world, BodyId body, const std::string& where) {
  const ModalSurface& render = world.model(body).render();
  for (std::size_t t = 0; t < render.triangles.size(); ++t)
    for (std::size_t i = 0; i < 3; ++i)
      if (render.triangles[t][i] == place.vertex) {
        Weights w{};
        w[i] = 1.0;
        return render_point(t, w);
      }
  throw InputError(where + ".at.vertex: is " + std::to_string(place.vertex) +
                   ", expected a vertex of a triangle of the body's surface, which has " +
                   std::to_string(render.vertices()) + " vertices, counted from 0");
}

}  // namespace

SurfacePoint find_place(const SurfacePlace& place, const World& world, BodyId body, const std::string& where) {
  return std::visit([&](const auto& told) { return find(told, world, body, where); }, place);
}

}  // namespace limber::internal
