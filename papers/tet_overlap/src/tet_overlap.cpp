#include "tet_overlap.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/tet_overlap/tet_overlap_normals.h"
#include "narrow/rest_depth.h"
#include "tuning.h"

namespace limber::internal {
namespace {

// A triangle cut by four planes has seven corners at most; round-off in a sliver may cross a plane at every side, which
// makes 4, 6, 9 and 13 of its 3.
constexpr std::size_t kMostCorners = 13;

struct Polygon {
  std::array<Vec3, kMostCorners> x;
  std::size_t size = 0;

  void push(const Vec3& p) { x[size++] = p; }
  Vec3 area() const {
    Vec3 doubled = Vec3::Zero();
    for (std::size_t i = 2; i < size; ++i) doubled += (x[i - 1] - x[0]).cross(x[i] - x[0]);
    return 0.5 * doubled;
  }
};

// The side of a plane where height ≥ 0 (Sutherland and Hodgman 1974).
Polygon in_front(const Polygon& polygon, const std::array<double, kMostCorners>& height) {
  Polygon front;
  for (std::size_t i = 0; i < polygon.size; ++i) {
    const std::size_t j = (i + 1) % polygon.size;
    if (height[i] >= 0.0) front.push(polygon.x[i]);
    if ((height[i] < 0.0) != (height[j] < 0.0))
      front.push(polygon.x[i] + height[i] / (height[i] - height[j]) * (polygon.x[j] - polygon.x[i]));
  }
  return front;
}

// The part of a triangle that is inside a tetrahedron, turned either way; `weight` is halved for a triangle that lies
// in a face, which has two sides.
Polygon part_inside(const TrianglePoints& triangle, const std::array<Vec3, 4>& tet, double tolerance, double& weight) {
  Polygon polygon;
  for (const Vec3& p : triangle) polygon.push(p);
  for (std::size_t corner = 0; corner < 4; ++corner) {
    const Vec3& x = tet[(corner + 1) % 4];
    const Vec3 across = (tet[(corner + 2) % 4] - x).cross(tet[(corner + 3) % 4] - x);
    const double length = across.norm(), side = across.dot(tet[corner] - x);
    if (!(std::abs(side) > tolerance * length)) return {};  // flat: nothing is inside
    const Vec3 inward = across / (side < 0.0 ? -length : length);
    std::array<double, kMostCorners> height{};
    double low = 0.0, high = 0.0;
    for (std::size_t i = 0; i < polygon.size; ++i) {
      height[i] = inward.dot(polygon.x[i] - x);
      low = std::min(low, height[i]), high = std::max(high, height[i]);
    }
    if (low >= -tolerance && high <= tolerance) {
      weight *= 0.5;
    } else if (low < 0.0) {
      polygon = in_front(polygon, height);
      if (polygon.size < 3) return {};
    }
  }
  return polygon;
}

template <std::size_t N>
std::array<Vec3, N> points(const std::vector<Vec3>& nodes, const std::array<Index, N>& element) {
  std::array<Vec3, N> x;
  for (std::size_t i = 0; i < N; ++i) x[i] = nodes[static_cast<std::size_t>(element[i])];
  return x;
}

}  // namespace

std::vector<Triangle> boundary_faces(const ModalVolume& volume) {
  TetMesh mesh;
  mesh.nodes = volume.rest, mesh.tets = volume.tets;
  BoundarySurface boundary = boundary_surface(mesh);
  for (Triangle& t : boundary.surface.triangles)
    for (Index& v : t) v = boundary.node_of[static_cast<std::size_t>(v)];
  return std::move(boundary.surface.triangles);
}

void TetOverlap::bind(const Body& a, const Body& b, double tolerance) {
  body_[0] = a, body_[1] = b;
  tolerance_ = tolerance, touching_ = collision_tuning().narrow.directionless * tolerance;
  computed_ = false;
}

Vec3 TetOverlap::normal(int out_of, const Vec3& p) {
  if (!computed_) compute();
  const Index i = only_ >= 0 ? only_ : patch_near(1 - out_of, p);
  if (i < 0) return Vec3::Zero();
  const Patch& patch = patch_[static_cast<std::size_t>(i)];
  const double length = patch.out_of_a.norm();
  if (!(length > collision_tuning().narrow.least_patch * patch.area)) return Vec3::Zero();
  return patch.out_of_a / (out_of == 0 ? length : -length);
}

const std::vector<Triangle>& TetOverlap::boundary(int of) {
  std::vector<Triangle>& faces = boundaries_[body_[of].model];
  if (faces.empty()) faces = boundary_faces(volume(of));
  return faces;
}

void TetOverlap::compute() {
  computed_ = true;
  const Aabb a = deform(0), b = deform(1);
  const Aabb region{a.low.cwiseMax(b.low), a.high.cwiseMin(b.high)};
  for (int of = 0; of < 2; ++of) gather(of, region);
  pieces_.clear(), corners_.clear(), boxes_.clear();
  for (int of = 0; of < 2; ++of) cut_boundary(of);
  join_patches();
}

// All nodes in the pair's frame. @return what holds them
Aabb TetOverlap::deform(int of) {
  const Body& body = body_[of];
  std::vector<Vec3>& nodes = nodes_[of];
  nodes.resize(volume(of).rest.size());
  Aabb box;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i] = body.X_PB * deformed_node(volume(of), body.amplitudes, body.skin, static_cast<Index>(i));
    box.include(nodes[i]);
  }
  return box;
}

void TetOverlap::gather(int of, const Aabb& region) {
  const auto near = [&](const auto& elements, std::vector<Boxed>& boxed) {
    boxed.clear();
    for (std::size_t i = 0; i < elements.size(); ++i) {
      Aabb box;
      for (const Vec3& p : points(nodes_[of], elements[i])) box.include(p);
      if (box.overlaps(region)) boxed.push_back({box, static_cast<Index>(i)});
    }
    sort(boxed);
  };
  near(volume(of).tets, tets_[of]);
  near(boundary(of), faces_[of]);
}

void TetOverlap::sort(std::vector<Boxed>& boxed) {
  std::sort(boxed.begin(), boxed.end(), [](const Boxed& s, const Boxed& t) {
    return std::pair(s.box.low.x(), s.item) < std::pair(t.box.low.x(), t.item);
  });
}

// Pairs whose boxes overlap, by a sweep over both sorted lists. @param visit (Index of a, Index of b)
template <class Visit>
void TetOverlap::for_each_overlap(const std::vector<Boxed>& a, const std::vector<Boxed>& b, const Visit& visit) {
  const auto sweep = [](const Boxed& one, const std::vector<Boxed>& others, std::size_t first, const auto& found) {
    for (std::size_t k = first; k < others.size() && others[k].box.low.x() <= one.box.high.x(); ++k)
      if (one.box.overlaps(others[k].box)) found(others[k].item);
  };
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (a[i].box.low.x() <= b[j].box.low.x()) {
      sweep(a[i], b, j, [&](Index other) { visit(a[i].item, other); });
      ++i;
    } else {
      sweep(b[j], a, i, [&](Index other) { visit(other, b[j].item); });
      ++j;
    }
  }
}

// The faces between the tetrahedra of a body cancel in its overlap with another's, so only the boundary is cut.
void TetOverlap::cut_boundary(int of) {
  const std::vector<Triangle>& faces = boundary(of);
  const std::vector<Tet>& tets = volume(1 - of).tets;
  for_each_overlap(faces_[of], tets_[1 - of], [&](Index t, Index tet) {
    double weight = 1.0;
    const Polygon polygon =
        part_inside(points(nodes_[of], faces[static_cast<std::size_t>(t)]),
                    points(nodes_[1 - of], tets[static_cast<std::size_t>(tet)]), tolerance_, weight);
    const Vec3 area = weight * polygon.area();
    if (!(area.norm() > tolerance_ * tolerance_)) return;
    Aabb box;
    for (std::size_t i = 0; i < polygon.size; ++i) box.include(polygon.x[i]);
    boxes_.push_back({box.grown(touching_), static_cast<Index>(pieces_.size())});
    pieces_.push_back({of, corners_.size(), polygon.size, area});
    corners_.insert(corners_.end(), polygon.x.begin(), polygon.x.begin() + static_cast<std::ptrdiff_t>(polygon.size));
  });
}

void TetOverlap::join_patches() {
  sets_.reset(pieces_.size());
  sort(boxes_);
  const auto join = [&](const auto& touch) {
    for_each_overlap(boxes_, boxes_, [&](Index s, Index t) {
      if (sets_.root(s) != sets_.root(t) &&
          touch(corners(pieces_[static_cast<std::size_t>(s)]), corners(pieces_[static_cast<std::size_t>(t)])))
        sets_.join(s, t);
    });
  };
  // Neighbours have a corner in common, mostly; that is quickly seen and leaves few to be asked for their distance.
  join([&](std::span<const Vec3> a, std::span<const Vec3> b) {
    return std::any_of(a.begin(), a.end(), [&](const Vec3& p) {
      return std::any_of(b.begin(), b.end(), [&](const Vec3& q) { return (p - q).norm() <= touching_; });
    });
  });
  join([&](std::span<const Vec3> a, std::span<const Vec3> b) {
    return distance(ConvexSolid{a}, ConvexSolid{b}).distance <= touching_;
  });
  patch_.assign(pieces_.size(), {});
  only_ = -1;
  int patches = 0;
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    const Index root = sets_.root(static_cast<Index>(i));
    Patch& patch = patch_[static_cast<std::size_t>(root)];
    if (patch.area == 0.0) only_ = ++patches == 1 ? root : -1;
    const Piece& piece = pieces_[i];
    patch.area += piece.area.norm();
    patch.out_of_a += piece.of == 0 ? piece.area : Vec3(-piece.area);
  }
}

// The patch of the piece of a body's boundary that is nearest to a point; −1 if there is none.
Index TetOverlap::patch_near(int of, const Vec3& p) {
  double least = std::numeric_limits<double>::infinity();
  Index nearest = -1;
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    if (pieces_[i].of != of) continue;
    const std::span<const Vec3> x = corners(pieces_[i]);
    for (std::size_t c = 2; c < x.size(); ++c) {
      const double d = (closest_on_triangle(p, {x[0], x[c - 1], x[c]}).point - p).norm();
      if (d < least) least = d, nearest = static_cast<Index>(i);
    }
  }
  return nearest < 0 ? -1 : sets_.root(nearest);
}

}  // namespace limber::internal

namespace limber {

std::unique_ptr<OverlapNormals> tet_overlap_normals() { return std::make_unique<internal::TetOverlap>(); }

}  // namespace limber
