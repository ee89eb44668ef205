#include "convex/convex_core.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "tuning.h"

namespace limber::internal {
namespace {

struct HullFace {
  Triangle corners;
  Vec3 normal;
  double offset;
};

using HalfEdge = std::array<Index, 2>;

// A convex hull grown point by point, the farthest from the middle first, so that points on the faces of the final hull
// come when the faces are there.
class HullBuilder {
 public:
  explicit HullBuilder(std::span<const Vec3> points) : points_(points) {
    Vec3 low = points[0], high = points[0];
    for (const Vec3& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
    thickness_ = collision_tuning().convex.hull_thickness * (high - low).norm();
    middle_ = 0.5 * (low + high);
  }

  std::vector<HullFace> build() {
    start();
    std::vector<Index> order(points_.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Index>(i);
    std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) {
      return (point(a) - middle_).squaredNorm() > (point(b) - middle_).squaredNorm();
    });
    for (const Index p : order) add(p);
    return std::move(faces_);
  }

 private:
  const Vec3& point(Index i) const { return points_[static_cast<std::size_t>(i)]; }

  template <class Measure>
  Index farthest(const Measure& measure) const {
    Index best = 0;
    for (Index i = 1; i < static_cast<Index>(points_.size()); ++i)
      if (measure(point(i)) > measure(point(best))) best = i;
    return best;
  }

  void start() {
    const Index a = farthest([&](const Vec3& p) { return (p - middle_).norm(); });
    const Index b = farthest([&](const Vec3& p) { return (p - point(a)).norm(); });
    const Vec3 axis = (point(b) - point(a)).normalized();
    const Index c = farthest([&](const Vec3& p) { return axis.cross(p - point(a)).norm(); });
    const Vec3 n = axis.cross(point(c) - point(a));
    const Index d = farthest([&](const Vec3& p) { return std::abs(n.dot(p - point(a))); });
    if (!(std::abs(n.dot(point(d) - point(a))) > thickness_ * n.norm()) || !(n.norm() > thickness_))
      throw InvalidArgument("ConvexHull: the points lie in one plane, expected a hull with volume");
    const bool below = n.dot(point(d) - point(a)) < 0.0;
    const Triangle base = below ? Triangle{a, b, c} : Triangle{a, c, b};
    push(base);
    for (std::size_t i = 0; i < 3; ++i) push({base[(i + 1) % 3], base[i], d});
  }

  void push(const Triangle& t) {
    const Vec3 n = (point(t[1]) - point(t[0])).cross(point(t[2]) - point(t[0])).normalized();
    faces_.push_back({t, n, n.dot(point(t[0]))});
  }

  void add(Index p) {
    const auto visible = [&](const HullFace& f) { return f.normal.dot(point(p)) - f.offset > thickness_; };
    std::set<HalfEdge> rim;
    for (const HullFace& f : faces_)
      if (visible(f))
        for (std::size_t i = 0; i < 3; ++i) rim.insert({f.corners[i], f.corners[(i + 1) % 3]});
    if (rim.empty()) return;
    std::erase_if(faces_, visible);
    for (const auto& [a, b] : rim)
      if (!rim.contains({b, a})) push({a, b, p});
  }

  std::span<const Vec3> points_;
  double thickness_ = 0.0;
  Vec3 middle_;
  std::vector<HullFace> faces_;
};

// Numbers of the faces that lie in one plane with a neighbour.
std::vector<Index> flat_groups(const std::vector<HullFace>& faces) {
  std::map<HalfEdge, Index> owner;
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (std::size_t i = 0; i < 3; ++i)
      owner[{faces[f].corners[i], faces[f].corners[(i + 1) % 3]}] = static_cast<Index>(f);
  DisjointSets groups(faces.size());
  const double same = collision_tuning().convex.hull_same_direction;
  for (const auto& [edge, f] : owner) {
    const auto twin = owner.find({edge[1], edge[0]});
    if (twin == owner.end()) continue;
    const Vec3 &n = faces[static_cast<std::size_t>(f)].normal,
               &m = faces[static_cast<std::size_t>(twin->second)].normal;
    if ((n - m).norm() < same) groups.join(f, twin->second);
  }
  return groups.labels();
}

void add_edge_direction(ConvexCore& core, const Vec3& d) {
  const Vec3 unit = d.normalized();
  const double same = collision_tuning().convex.hull_same_direction;
  if (std::none_of(core.edge_directions.begin(), core.edge_directions.end(),
                   [&](const Vec3& e) { return e.cross(unit).norm() < same; }))
    core.edge_directions.push_back(unit);
}

// The rim of a group of triangles becomes one face.
void add_face(ConvexCore& core, const std::vector<HullFace>& faces, const std::vector<Index>& group, Index label) {
  std::map<Index, Index> next;
  Vec3 normal = Vec3::Zero();
  std::set<HalfEdge> edges;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    if (group[f] != label) continue;
    normal = faces[f].normal;
    for (std::size_t i = 0; i < 3; ++i) edges.insert({faces[f].corners[i], faces[f].corners[(i + 1) % 3]});
  }
  for (const auto& [a, b] : edges)
    if (!edges.contains({b, a})) next[a] = b;
  ConvexFace face{normal, -1e300, static_cast<Index>(core.loops.size()), static_cast<Index>(next.size())};
  Index v = next.begin()->first;
  for (Index i = 0; i < face.count; ++i, v = next[v]) {
    core.loops.push_back(v);
    face.offset = std::max(face.offset, normal.dot(core.points[static_cast<std::size_t>(v)]));
    add_edge_direction(core, core.points[static_cast<std::size_t>(next[v])] - core.points[static_cast<std::size_t>(v)]);
  }
  core.faces.push_back(face);
}

// Numbers the edges, as they come in the loops.
void number_edges(ConvexCore& core) {
  std::map<HalfEdge, Index> known;
  for (const ConvexFace& f : core.faces) {
    const auto loop = core.loop(f);
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const auto [from, to] = std::minmax(loop[i], loop[(i + 1) % loop.size()]);
      core.loop_edges.push_back(known.try_emplace({from, to}, static_cast<Index>(known.size())).first->second);
    }
  }
}

ConvexCore hull_of(std::vector<Vec3> points) {
  ConvexCore core{std::move(points)};
  const std::vector<HullFace> faces = HullBuilder(core.points).build();
  const std::vector<Index> group = flat_groups(faces);
  const Index count = 1 + *std::max_element(group.begin(), group.end());
  for (Index label = 0; label < count; ++label) add_face(core, faces, group, label);
  number_edges(core);
  for (const Vec3& p : core.points) core.extent = std::max(core.extent, p.norm());
  return core;
}

// Only the points that are corners.
ConvexCore without_inner_points(const ConvexCore& core) {
  const std::set<Index> used(core.loops.begin(), core.loops.end());
  ConvexCore r = core;
  std::map<Index, Index> renamed;
  r.points.clear();
  for (const Index v : used) {
    renamed[v] = static_cast<Index>(r.points.size());
    r.points.push_back(core.points[static_cast<std::size_t>(v)]);
  }
  for (Index& v : r.loops) v = renamed[v];
  return r;
}

}  // namespace

ConvexCore convex_core(const Sphere& shape) { return {{Vec3::Zero()}, shape.radius}; }

ConvexCore convex_core(const Capsule& shape) {
  if (shape.half_length == 0.0) return {{Vec3::Zero()}, shape.radius};
  return {{-shape.half_length * Vec3::UnitZ(), shape.half_length * Vec3::UnitZ()},
          shape.radius,
          {},
          {},
          {},
          {Vec3::UnitZ()}};
}

ConvexCore convex_core(const Box& shape) {
  std::vector<Vec3> corners;
  corners.reserve(8);
  for (int i = 0; i < 8; ++i)
    corners.push_back(
        shape.half_extents.cwiseProduct(Vec3(i & 1 ? 1.0 : -1.0, i & 2 ? 1.0 : -1.0, i & 4 ? 1.0 : -1.0)));
  ConvexCore core = hull_of(std::move(corners));
  core.half_extents = shape.half_extents;
  return core;
}

ConvexCore convex_core(const ConvexHull& shape) { return without_inner_points(hull_of(shape.points)); }

TriangleMesh triangulated(const ConvexCore& core) {
  TriangleMesh mesh{core.points, {}};
  for (const ConvexFace& f : core.faces) {
    const auto loop = core.loop(f);
    for (std::size_t i = 2; i < loop.size(); ++i) mesh.triangles.push_back({loop[0], loop[i - 1], loop[i]});
  }
  return mesh;
}

}  // namespace limber::internal
