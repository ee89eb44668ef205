#include "limber/collision/spatial_index.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "broad/box_tree.h"
#include "finder/geometry_cache.h"
#include "finder/surface_pool.h"
#include "finder/world_bounds.h"
#include "hierarchy/branch_and_bound.h"
#include "limber/collision/tree_traversal.h"
#include "limber/core/error.h"
#include "limber/mesh/winding_number.h"
#include "query/convex_cast.h"

namespace limber {

using internal::BoxTree;
using internal::ConvexCast;
using internal::enters_box;
using internal::GeometryCache;
using internal::SurfacePool;
using internal::Touch;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct IndexedBody {
  bool present = false, placed = false;
  std::uint32_t layers = 1;
  std::shared_ptr<const CollisionSurface> surface{};  // what is met; null: a round shape or a half-space
  std::shared_ptr<const RigidGeometry> rigid{};       // null: the surface bends
  std::shared_ptr<const CollisionSurface> loaded{};   // what `at` is of; null: none
  RigidTransform in_loaded{};                         // where the body is in the frame of that
  RigidTransform pose{};
  std::vector<double> z{};
  Index leaf = -1;
  Aabb loose{};  // in the tree

  bool bends() const { return !rigid; }
  const HalfSpace* half_space() const { return rigid ? std::get_if<HalfSpace>(&rigid->shape()) : nullptr; }
};

bool same_pose(const RigidTransform& X, const RigidTransform& Y) {
  return X.p == Y.p && X.q.w == Y.q.w && X.q.vector() == Y.q.vector();
}

/// A sphere is a capsule of no length.
struct RoundShape {
  SegmentPoints core;
  double radius;
};
RoundShape round_shape(const Shape& shape) {
  if (const auto* ball = std::get_if<Sphere>(&shape)) return {{Vec3::Zero(), Vec3::Zero()}, ball->radius};
  const auto& capsule = std::get<Capsule>(shape);
  return {{-capsule.half_length * Vec3::UnitZ(), capsule.half_length * Vec3::UnitZ()}, capsule.radius};
}

/// What moves, or stands, when a shape asks; first in its own frame, then in that of the body that is asked.
struct Mover {
  std::vector<Vec3> points, points_B;
  double radius = 0.0;
  RigidTransform pose{};
  Vec3 way = Vec3::Zero();
  double tolerance = 0.0;

  void set(const Shape& shape, const RigidTransform& at, const Vec3& by, double relative);
  /// @return its box there
  Aabb carry(const RigidTransform& X_BW);
};

void Mover::set(const Shape& shape, const RigidTransform& at, const Vec3& by, double relative) {
  validate(shape);
  pose = at, way = by;
  points.clear();
  radius = 0.0;
  if (const auto* box = std::get_if<Box>(&shape)) {
    for (int i = 0; i < 8; ++i)
      points.push_back(box->half_extents.cwiseProduct(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1)));
  } else if (const auto* hull = std::get_if<ConvexHull>(&shape)) {
    points.assign(hull->points.begin(), hull->points.end());
  } else if (std::holds_alternative<Sphere>(shape) || std::holds_alternative<Capsule>(shape)) {
    const RoundShape round = round_shape(shape);
    points.assign(round.core.begin(), round.core.end());
    radius = round.radius;
  } else {
    throw InvalidArgument("SpatialIndex: the shape that asks is not convex, expected a sphere, capsule, box or hull");
  }
  double size = 0.0;
  for (const Vec3& p : points) size = std::max(size, (p - points.front()).norm());
  tolerance = relative * (size + 2.0 * radius);
}

Aabb Mover::carry(const RigidTransform& X_BW) {
  const RigidTransform X = X_BW * pose;
  points_B.clear();
  Aabb box;
  for (const Vec3& p : points) points_B.push_back(X * p), box.include(points_B.back());
  return box.grown(radius + tolerance);
}

void require_finite(const Vec3& v, const char* what) {
  if (!v.allFinite()) throw InvalidArgument(std::string("SpatialIndex: ") + what + " is not finite");
}
void require_way(const Vec3& way) {
  require_finite(way, "way");
  if (way.isZero(0.0)) throw InvalidArgument("SpatialIndex: way is zero, expected a length");
}
void require_pose(const RigidTransform& X) {
  constexpr double kUnit = 1e-6;
  require_finite(X.p, "position");
  if (!(std::abs(X.q.norm() - 1.0) <= kUnit)) throw InvalidArgument("SpatialIndex: the quaternion's length is not 1");
}

/// Turned to the side that the way comes from.
Vec3 against(const Vec3& normal, const Vec3& way) { return normal.dot(way) > 0.0 ? Vec3(-normal) : normal; }
Vec3 unit_or_zero(const Vec3& v) {
  const double length = v.norm();
  return length > 0.0 ? Vec3(v / length) : Vec3(Vec3::Zero());
}

}  // namespace

struct SpatialIndex::Impl {
  std::vector<IndexedBody> bodies;
  std::vector<Index> endless;  // half-spaces
  BoxTree tree;
  std::vector<Index> stack;
  GeometryCache cache;
  SurfacePool pool;
  DeformedSurface whole;  // for boxes of bodies
  Mover mover;
  ConvexCast cast;
  SurfaceMesh shell;  // of a body that a shape may lie in

  /// It keeps what is made of the model, so that the next body of that model finds it.
  std::shared_ptr<const CollisionSurface> surface_of(const std::shared_ptr<const ModalModel>& model, bool skin) {
    const auto made = cache.get(model, skin);
    return {made, made->surface.get()};
  }
  IndexedBody& body(Index b, const char* function);
  void place(Index b);
  DeformedSurface& surface(Index b) {
    const IndexedBody& body = bodies[static_cast<std::size_t>(b)];
    // Boxes from amplitudes alone: they, and so the order in which triangles are met, depend on the state only.
    return pool.get(b, body.surface, body.bends() ? std::span<const double>(body.z) : std::span<const double>());
  }
  bool admits(Index b, const Filter& filter) const {
    const IndexedBody& body = bodies[static_cast<std::size_t>(b)];
    return body.placed && (body.layers & filter.mask) != 0 && (!filter.accepts || filter.accepts(b));
  }
  template <class Enters, class Visit>
  void visit(const Enters& enters, const Visit& visit_body, const Filter& filter);
  template <class Enters, class Ask>
  std::optional<Hit> nearest(double Hit::*measure, double limit, const Enters& enters, const Ask& ask,
                             const Filter& filter);

  std::optional<Hit> meet(Index b, const Ray& ray, double limit);
  std::optional<Hit> touch(Index b, double limit);
  std::optional<Touch> touch_half_space(const HalfSpace& plane, const Vec3& way, double limit) const;
  std::optional<Touch> touch_surface(Index b, const Aabb& box_B, const Vec3& way_B, double limit, Hit& hit);
  bool is_inside(Index b, const Vec3& p_B);
  std::optional<Hit> nearest_on(Index b, const Vec3& point, double limit);
  void tell_place(Hit& hit);
};

SpatialIndex::SpatialIndex() : impl_(std::make_unique<Impl>()) {}
SpatialIndex::~SpatialIndex() = default;
SpatialIndex::SpatialIndex(SpatialIndex&&) noexcept = default;
SpatialIndex& SpatialIndex::operator=(SpatialIndex&&) noexcept = default;

// -- Bodies -----------------------------------------------------------------------------------------------------------

IndexedBody& SpatialIndex::Impl::body(Index b, const char* function) {
  if (b < 0 || static_cast<std::size_t>(b) >= bodies.size() || !bodies[static_cast<std::size_t>(b)].present)
    throw InvalidArgument(std::string("SpatialIndex::") + function + ": index " + std::to_string(b) + " holds no body");
  return bodies[static_cast<std::size_t>(b)];
}

void SpatialIndex::add_body(Index body, const BodyGeometry& geometry, std::uint32_t layers,
                            const std::shared_ptr<const ModalModel>& loaded, const RigidTransform& in_loaded) {
  Impl& m = *impl_;
  const auto i = static_cast<std::size_t>(body);
  if (body < 0 || (i < m.bodies.size() && m.bodies[i].present))
    throw InvalidArgument("SpatialIndex::add_body: index " + std::to_string(body) +
                          " is negative or holds a body, expected a free one");
  if ((geometry.model == nullptr) == (geometry.shape == nullptr))
    throw InvalidArgument("SpatialIndex::add_body: body " + std::to_string(body) +
                          " has a model and a shape or none, expected one of them");
  IndexedBody made{.present = true, .layers = layers, .in_loaded = in_loaded};
  if (geometry.model) {
    made.surface = made.loaded = m.surface_of(geometry.model, geometry.skin);
  } else {
    made.rigid = m.cache.get(geometry.shape);
    made.surface = made.rigid->surface();
    if (loaded && loaded->data().touchable) made.loaded = m.surface_of(loaded, geometry.skin);
  }
  if (i >= m.bodies.size()) m.bodies.resize(i + 1);
  m.bodies[i] = std::move(made);
}

void SpatialIndex::remove_body(Index b) {
  Impl& m = *impl_;
  IndexedBody& body = m.body(b, "remove_body");
  if (body.leaf >= 0) m.tree.remove(body.leaf);
  std::erase(m.endless, b);
  body = {};
  m.pool.start_query();
}

void SpatialIndex::set_state(Index b, const RigidTransform& pose, std::span<const double> z) {
  IndexedBody& body = impl_->body(b, "set_state");
  require_pose(pose);
  const auto modes = static_cast<std::size_t>(body.loaded ? body.loaded->modes() : 0);
  if (body.loaded && z.size() != modes)
    throw InvalidArgument("SpatialIndex::set_state: body " + std::to_string(b) + " has " + std::to_string(z.size()) +
                          " amplitudes, expected " + std::to_string(modes));
  if (body.placed && same_pose(pose, body.pose) && std::ranges::equal(z, body.z)) return;
  body.pose = pose;
  body.z.assign(z.begin(), z.end());
  impl_->place(b);
}

void SpatialIndex::Impl::place(Index b) {
  IndexedBody& body = bodies[static_cast<std::size_t>(b)];
  pool.start_query();
  if (body.half_space() != nullptr) {
    if (!body.placed) endless.insert(std::ranges::lower_bound(endless, b), b);
    body.placed = true;
    return;
  }
  if (body.bends()) whole.bind(body.surface, body.z);
  const Aabb box = internal::world_box(body.bends() ? whole.bounds(0) : body.rigid->bounds(), body.pose);
  body.placed = true;
  if (body.leaf >= 0 && body.loose.contains(box.low) && body.loose.contains(box.high)) return;
  if (body.leaf >= 0) tree.remove(body.leaf);
  constexpr double kLoose = 0.1;  // of the box: what moves on by less stays where it is in the tree
  body.loose = box.grown(kLoose * box.half_extents().maxCoeff());
  body.leaf = tree.insert(b, body.loose);
}

// -- Searches over bodies ---------------------------------------------------------------------------------------------

template <class Enters, class Visit>
void SpatialIndex::Impl::visit(const Enters& enters, const Visit& visit_body, const Filter& filter) {
  for (const Index b : endless)
    if (admits(b, filter)) visit_body(b);
  tree.visit(
      enters,
      [&](Index b, const Aabb&) {
        if (admits(b, filter)) visit_body(b);
      },
      stack);
}

/// The least by a measure, at most `limit`; of equal ones the lowest body.
template <class Enters, class Ask>
std::optional<SpatialIndex::Hit> SpatialIndex::Impl::nearest(double Hit::*measure, double limit, const Enters& enters,
                                                             const Ask& ask, const Filter& filter) {
  std::optional<Hit> best;
  const auto least = [&] { return best ? (*best).*measure : limit; };
  visit([&](const Aabb& box) { return enters(box, least()); },
        [&](Index b) {
          const double was = least();
          const std::optional<Hit> hit = ask(b, was);
          if (!hit) return;
          if (!best || (*hit).*measure < was || ((*hit).*measure == was && b < best->body)) best = hit;
        },
        filter);
  if (best) tell_place(*best);
  return best;
}

/// `at` of a body that wears a shape.
void SpatialIndex::Impl::tell_place(Hit& hit) {
  const IndexedBody& body = bodies[static_cast<std::size_t>(hit.body)];
  if (body.bends() || !body.loaded) return;
  const Index key = -2 - hit.body;  // beside the surface that is met
  DeformedSurface& loaded = pool.get(key, body.loaded, body.z);
  const auto near = limber::nearest_point(loaded, body.in_loaded * (body.pose.inverse() * hit.position));
  if (near) hit.at = SurfacePoint{.triangle = near->triangle, .weight = near->weight};
}

// -- Rays -------------------------------------------------------------------------------------------------------------

std::optional<SpatialIndex::Hit> SpatialIndex::Impl::meet(Index b, const Ray& ray, double limit) {
  const IndexedBody& body = bodies[static_cast<std::size_t>(b)];
  const Vec3 from = body.pose.inverse() * ray.from, way = body.pose.q.conjugate() * ray.way;
  Hit hit{.body = b, .fraction = kInfinity};
  Vec3 normal = Vec3::Zero();
  if (const HalfSpace* plane = body.half_space()) {
    const double closing = -plane->normal.dot(way), height = plane->normal.dot(from) - plane->offset;
    if (closing != 0.0 && height / closing >= 0.0) hit.fraction = height / closing, normal = plane->normal;
  } else if (body.surface) {
    DeformedSurface& surface = this->surface(b);
    Index met = -1;
    internal::branch_and_bound(
        surface, [&](const Aabb& box) { return enters_box(from, way, limit, box); },
        [&](Index t, double best) {
          const auto found = internal::meet(from, way, surface.triangle(t));
          if (!found || !(found->fraction < best)) return best;
          met = t;
          hit.fraction = found->fraction;
          if (body.bends()) hit.at = SurfacePoint{.triangle = t, .weight = found->weight};
          return hit.fraction;
        },
        std::nextafter(limit, kInfinity));
    if (met >= 0) normal = unit_normal(surface.triangle(met));
  } else {
    const RoundShape round = round_shape(body.rigid->shape());
    if (const auto fraction = internal::meet_capsule(from, way, round.core, round.radius)) {
      hit.fraction = *fraction;
      const Vec3 p = from + *fraction * way;
      normal = unit_or_zero(p - closest_on_segment(p, round.core).point);
    }
  }
  if (!(hit.fraction <= limit)) return {};
  hit.position = ray.from + hit.fraction * ray.way;
  hit.normal = body.pose.q * against(normal, way);
  hit.distance = hit.fraction * ray.way.norm();
  return hit;
}

std::optional<SpatialIndex::Hit> SpatialIndex::cast_ray(const Ray& ray, const Filter& filter) {
  require_finite(ray.from, "from");
  require_way(ray.way);
  return impl_->nearest(
      &Hit::fraction, 1.0,
      [&](const Aabb& box, double limit) { return enters_box(ray.from, ray.way, limit, box) <= limit; },
      [&](Index b, double limit) { return impl_->meet(b, ray, limit); }, filter);
}

void SpatialIndex::cast_ray(const Ray& ray, std::vector<Hit>& hits, const Filter& filter) {
  require_finite(ray.from, "from");
  require_way(ray.way);
  hits.clear();
  impl_->visit([&](const Aabb& box) { return enters_box(ray.from, ray.way, 1.0, box) <= 1.0; },
               [&](Index b) {
                 if (const auto hit = impl_->meet(b, ray, 1.0)) hits.push_back(*hit);
               },
               filter);
  std::sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& b) {
    return a.fraction != b.fraction ? a.fraction < b.fraction : a.body < b.body;
  });
  for (Hit& hit : hits) impl_->tell_place(hit);
}

// -- Shapes -----------------------------------------------------------------------------------------------------------

bool SpatialIndex::Impl::is_inside(Index b, const Vec3& p_B) {
  DeformedSurface& surface = this->surface(b);
  if (!surface.surface().closed() || !surface.bounds(0).contains(p_B)) return false;
  shell.vertices.clear();
  shell.triangles.clear();
  for (Index v = 0; v < surface.surface().vertices(); ++v) shell.vertices.push_back(surface.vertex(v));
  for (Index t = 0; t < surface.surface().triangles(); ++t) shell.triangles.push_back(surface.surface().triangle(t));
  constexpr double kInside = 0.5;  // between 0 and 1
  return winding_number(shell, p_B) > kInside;
}

std::optional<Touch> SpatialIndex::Impl::touch_half_space(const HalfSpace& plane, const Vec3& way, double limit) const {
  const auto height = [&](const Vec3& p) { return plane.normal.dot(p) - plane.offset; };
  const Vec3 low = *std::min_element(mover.points_B.begin(), mover.points_B.end(),
                                     [&](const Vec3& p, const Vec3& q) { return height(p) < height(q); });
  const double gap = height(low) - mover.radius, closing = -plane.normal.dot(way);
  const double fraction = gap <= 0.0 ? 0.0 : gap / closing;
  if (gap > 0.0 && !(closing > 0.0 && fraction <= limit)) return {};
  const Vec3 at = low + fraction * way;
  return Touch{fraction, at - height(at) * plane.normal, gap > 0.0 ? plane.normal : Vec3(Vec3::Zero())};
}

std::optional<Touch> SpatialIndex::Impl::touch_surface(Index b, const Aabb& box, const Vec3& way, double limit,
                                                       Hit& hit) {
  DeformedSurface& surface = this->surface(b);
  const Vec3 middle = box.center(), half = box.half_extents();
  std::optional<Touch> first;
  internal::branch_and_bound(
      surface,
      [&](const Aabb& node) {
        return enters_box(middle, way, limit, {node.low - half, node.high + half});
      },
      [&](Index t, double best) {
        const TrianglePoints corners = surface.triangle(t);
        const std::optional<Touch> found = cast.touch({corners, 0.0}, best);
        if (!found || !(found->fraction < best)) return best;
        first = found;
        if (bodies[static_cast<std::size_t>(b)].bends())
          hit.at = SurfacePoint{.triangle = t, .weight = closest_on_triangle(found->point, corners).weight};
        return found->fraction;
      },
      std::nextafter(limit, kInfinity));
  const Vec3& inner = mover.points_B.front();
  if ((!first || first->fraction > 0.0) && is_inside(b, inner)) {
    const auto near = limber::nearest_point(surface, inner);
    if (bodies[static_cast<std::size_t>(b)].bends())
      hit.at = SurfacePoint{.triangle = near->triangle, .weight = near->weight};
    first = Touch{0.0, near->point_B, Vec3::Zero()};
  }
  return first;
}

std::optional<SpatialIndex::Hit> SpatialIndex::Impl::touch(Index b, double limit) {
  const IndexedBody& body = bodies[static_cast<std::size_t>(b)];
  const Aabb box = mover.carry(body.pose.inverse());
  const Vec3 way = body.pose.q.conjugate() * mover.way;
  cast.start({mover.points_B, mover.radius}, way, mover.tolerance);
  Hit hit{.body = b};
  std::optional<Touch> first;
  if (const HalfSpace* plane = body.half_space()) {
    first = touch_half_space(*plane, way, limit);
  } else if (body.surface) {
    first = touch_surface(b, box, way, limit, hit);
  } else {
    const RoundShape round = round_shape(body.rigid->shape());
    first = cast.touch({round.core, round.radius}, limit);
  }
  if (!first) return {};
  hit.position = body.pose * first->point;
  hit.normal = body.pose.q * first->normal;
  hit.fraction = first->fraction;
  hit.distance = first->fraction * mover.way.norm();
  return hit;
}

bool SpatialIndex::may_ask(const Shape& shape) {
  return std::holds_alternative<Sphere>(shape) || std::holds_alternative<Capsule>(shape) ||
         std::holds_alternative<Box>(shape) || std::holds_alternative<ConvexHull>(shape);
}

std::optional<SpatialIndex::Hit> SpatialIndex::cast_shape(const Shape& shape, const RigidTransform& pose,
                                                          const Vec3& way, const Filter& filter) {
  constexpr double kTouching = 1e-7;  // of the shape's size
  Impl& m = *impl_;
  require_pose(pose);
  require_way(way);
  m.mover.set(shape, pose, way, kTouching);
  const Aabb box = m.mover.carry({});
  const Vec3 middle = box.center(), half = box.half_extents();
  return m.nearest(
      &Hit::fraction, 1.0,
      [&](const Aabb& b, double limit) {
        return enters_box(middle, way, limit, {b.low - half, b.high + half}) <= limit;
      },
      [&](Index b, double limit) { return m.touch(b, limit); }, filter);
}

void SpatialIndex::find_overlaps(const Shape& shape, const RigidTransform& pose, std::vector<Index>& bodies,
                                 const Filter& filter) {
  Impl& m = *impl_;
  require_pose(pose);
  m.mover.set(shape, pose, Vec3::Zero(), 0.0);
  const Aabb box = m.mover.carry({});
  bodies.clear();
  m.visit([&](const Aabb& b) { return b.overlaps(box); },
          [&](Index b) {
            if (m.touch(b, 0.0)) bodies.push_back(b);
          },
          filter);
  std::sort(bodies.begin(), bodies.end());
}

// -- Points -----------------------------------------------------------------------------------------------------------

std::optional<SpatialIndex::Hit> SpatialIndex::Impl::nearest_on(Index b, const Vec3& point, double limit) {
  const IndexedBody& body = bodies[static_cast<std::size_t>(b)];
  const Vec3 p = body.pose.inverse() * point;
  Hit hit{.body = b};
  Vec3 near;
  if (const HalfSpace* plane = body.half_space()) {
    near = p - (plane->normal.dot(p) - plane->offset) * plane->normal;
  } else if (body.surface) {
    const auto found = limber::nearest_point(surface(b), p, std::nextafter(limit, kInfinity));
    if (!found) return {};
    near = found->point_B;
    if (body.bends()) hit.at = SurfacePoint{.triangle = found->triangle, .weight = found->weight};
  } else {
    const RoundShape round = round_shape(body.rigid->shape());
    const Vec3 core = closest_on_segment(p, round.core).point, out = unit_or_zero(p - core);
    // From the core itself all ways across are as short.
    const Vec3 axis = unit_or_zero(round.core[1] - round.core[0]);
    near = core + round.radius * (!out.isZero() ? out : axis.isZero() ? Vec3(Vec3::UnitX()) : axis.unitOrthogonal());
  }
  hit.distance = (p - near).norm();
  if (!(hit.distance <= limit)) return {};
  hit.position = body.pose * near;
  hit.normal = body.pose.q * unit_or_zero(p - near);
  return hit;
}

std::optional<SpatialIndex::Hit> SpatialIndex::nearest_point(const Vec3& point, double max_distance,
                                                             const Filter& filter) {
  require_finite(point, "point");
  if (!(max_distance > 0.0 && std::isfinite(max_distance)))
    throw InvalidArgument("SpatialIndex::nearest_point: max_distance is " + std::to_string(max_distance) +
                          ", expected a finite number above 0");
  return impl_->nearest(
      &Hit::distance, max_distance, [&](const Aabb& box, double limit) { return distance_to_box(point, box) <= limit; },
      [&](Index b, double limit) { return impl_->nearest_on(b, point, limit); }, filter);
}

}  // namespace limber
