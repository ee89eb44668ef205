#include "ranges/sliding_places.h"

#include <algorithm>
#include <cmath>

#include "constants.h"
#include "limber/core/disjoint_sets.h"
#include "limber/mesh/closest_point.h"
#include "limber/mesh/corner_tree.h"
#include "tuning.h"

namespace limber::internal {
namespace {

using Kind = MotionPath::Kind;

/// Cosine between normal and motion up to which a surface slides.
double most_along() { return 1.0 / std::hypot(1.0, tuning().ranges.against.slope); }

double squared_distance(const SegmentPoints& p, const SegmentPoints& q) {
  const Vec3 d = p[1] - p[0], e = q[1] - q[0], w = q[0] - p[0], n = d.cross(e);
  const double n2 = n.squaredNorm();
  if (n2 > 0.0) {
    const double s = w.cross(e).dot(n) / n2, t = w.cross(d).dot(n) / n2;
    if (s >= 0.0 && s <= 1.0 && t >= 0.0 && t <= 1.0) return (w + t * e - s * d).squaredNorm();
  }
  double least = kInfinity;
  for (std::size_t i = 0; i < 2; ++i) {
    least = std::min(least, (closest_on_segment(p[i], q).point - p[i]).squaredNorm());
    least = std::min(least, (closest_on_segment(q[i], p).point - q[i]).squaredNorm());
  }
  return least;
}

/// True if two triangles cross, or come within a distance of each other.
bool touch(const OrbitFace& a, const OrbitFace& b, double reach) {
  const double most = reach * reach;
  for (std::size_t i = 0; i < 3; ++i) {
    if ((closest_on_triangle(a.corners[i], b.corners).point - a.corners[i]).squaredNorm() <= most) return true;
    if ((closest_on_triangle(b.corners[i], a.corners).point - b.corners[i]).squaredNorm() <= most) return true;
    for (std::size_t j = 0; j < 3; ++j)
      if (squared_distance({a.corners[i], a.corners[(i + 1) % 3]}, {b.corners[j], b.corners[(j + 1) % 3]}) <= most)
        return true;
  }
  std::array<Vec3, 2> segment;
  return cross_as_drawn(a, b, segment);
}

/// Faces that slide somewhere.
std::vector<std::size_t> sliding(const PathFrame& frame, const std::vector<OrbitFace>& faces) {
  std::vector<std::size_t> out;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    if (faces[f].cap || faces[f].one_sided) continue;
    double low = kInfinity, high = -kInfinity;
    for (const Vec3& p : faces[f].corners) {
      const double along = faces[f].normal.dot(frame.direction(p));
      low = std::min(low, along), high = std::max(high, along);
    }
    if (low < most_along() && high > -most_along()) out.push_back(f);
  }
  return out;
}

bool slides_all_over(const PathFrame& frame, const OrbitFace& face) {
  return std::all_of(face.corners.begin(), face.corners.end(),
                     [&](const Vec3& p) { return std::abs(face.normal.dot(frame.direction(p))) < most_along(); });
}

/// Of the sliding faces of either side, those that touch one of the other as drawn.
void mark_touching(const std::vector<OrbitFace>& moving, const std::vector<std::size_t>& of_m,
                   const std::vector<OrbitFace>& fixed, const std::vector<std::size_t>& of_f, double reach,
                   std::vector<char>& moving_touch, std::vector<char>& fixed_touch) {
  if (of_m.empty() || of_f.empty()) return;
  const auto box_of = [](const OrbitFace& face) {
    Eigen::AlignedBox3d box;
    for (const Vec3& p : face.corners) box.extend(p);
    return box;
  };
  std::vector<CornerTree<3>::Corners> corners;
  std::vector<Eigen::AlignedBox3d> boxes;
  for (const std::size_t f : of_f) corners.push_back(fixed[f].corners), boxes.push_back(box_of(fixed[f]));
  CornerTree<3> tree;
  tree.build(corners);
  for (std::size_t i = 0; i < of_m.size(); ++i) {
    Eigen::AlignedBox3d box = box_of(moving[of_m[i]]);
    box.min().array() -= reach, box.max().array() += reach;
    tree.any_leaf([&](std::size_t node) { return tree.box(node).intersects(box); },
                  [&](Index first, Index end) {
                    for (const Index e : tree.elements(first, end)) {
                      const auto k = static_cast<std::size_t>(e);
                      if ((moving_touch[i] && fixed_touch[k]) || !box.intersects(boxes[k])) continue;
                      if (touch(moving[of_m[i]], fixed[of_f[k]], reach)) moving_touch[i] = fixed_touch[k] = 1;
                    }
                    return false;
                  });
  }
}

/// A surface that touches somewhere slides wherever it goes on without a crease.
void mark_what_continues(const std::vector<OrbitFace>& faces, const std::vector<std::size_t>& which, double crease,
                         std::vector<char>& touch) {
  std::vector<OrbitFace> sliding;
  sliding.reserve(which.size());
  for (const std::size_t f : which) sliding.push_back(faces[f]);
  const FacesAround around(sliding);
  DisjointSets patches(sliding.size());
  for (std::size_t f = 0; f < sliding.size(); ++f)
    for (const Index vertex : sliding[f].vertices)
      for (const Index other : around.of(vertex))
        if (sliding[static_cast<std::size_t>(other)].normal.dot(sliding[f].normal) > std::cos(crease))
          patches.join(other, static_cast<Index>(f));
  std::vector<char> touched(sliding.size(), 0);
  const auto patch = [&](std::size_t f) { return static_cast<std::size_t>(patches.root(static_cast<Index>(f))); };
  for (std::size_t f = 0; f < sliding.size(); ++f)
    if (touch[f]) touched[patch(f)] = 1;
  for (std::size_t f = 0; f < sliding.size(); ++f) touch[f] = touched[patch(f)];
}

}  // namespace

SlidingPlaces::SlidingPlaces(const PathFrame& frame, const std::vector<OrbitFace>& moving,
                             const std::vector<OrbitFace>& fixed, double across, double least, double crease)
    : frame_(frame), across_(across), moving_along_(moving.size(), 0), fixed_along_(fixed.size(), 0) {
  const std::vector<std::size_t> of_m = sliding(frame, moving), of_f = sliding(frame, fixed);
  std::vector<char> moving_touch(of_m.size(), 0), fixed_touch(of_f.size(), 0);
  mark_touching(moving, of_m, fixed, of_f, across, moving_touch, fixed_touch);
  mark_what_continues(moving, of_m, crease, moving_touch);
  mark_what_continues(fixed, of_f, crease, fixed_touch);
  for (std::size_t i = 0; i < of_m.size(); ++i) add_curves(moving[of_m[i]], moving_touch[i] ? across : least, moving_);
  for (std::size_t i = 0; i < of_f.size(); ++i) add_curves(fixed[of_f[i]], fixed_touch[i] ? across : least, fixed_);
  for (std::size_t i = 0; i < of_m.size(); ++i)
    moving_along_[of_m[i]] = moving_touch[i] && slides_all_over(frame, moving[of_m[i]]);
  for (std::size_t i = 0; i < of_f.size(); ++i)
    fixed_along_[of_f[i]] = fixed_touch[i] && slides_all_over(frame, fixed[of_f[i]]);
  for (Curves* curves : {&moving_, &fixed_}) {
    std::vector<OrbitBox> boxes;
    boxes.reserve(curves->pieces.size());
    for (const Piece& p : curves->pieces) {
      OrbitBox box;
      box.add(p.from[0], p.from[1]);
      box.add(p.to[0], p.to[1]);
      box.grow(p.reach);
      boxes.push_back(box);
    }
    curves->tree.emplace(boxes);
  }
}

// Its edges, the ways to the axis, and the line on which it turns from running ahead to falling behind.
void SlidingPlaces::add_curves(const OrbitFace& face, double reach, Curves& out) const {
  for (std::size_t i = 0; i < 3; ++i) add_curve(face.corners[i], face.corners[(i + 1) % 3], face.normal, reach, out);
  if (frame_.kind() == Kind::kTranslation) return;
  // A face that the axis passes through comes nearer to it than its edges do.
  const double along = face.normal.x();
  if (face.box.low[0] == 0.0 && along != 0.0) {
    const Vec3 on_axis(face.offset / along, 0.0, 0.0);
    constexpr double kAlmost = 1e-9;  // of the way: on the axis itself nothing has an angle
    for (const Vec3& corner : face.corners)
      add_curve(corner, on_axis + kAlmost * (corner - on_axis), face.normal, reach, out);
  }
  std::array<Vec3, 2> ends;
  std::size_t count = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3 &p = face.corners[i], &q = face.corners[(i + 1) % 3];
    const double from = face.normal.dot(frame_.velocity(p)), to = face.normal.dot(frame_.velocity(q));
    if ((from > 0.0) != (to > 0.0) && count < 2) ends[count++] = p + from / (from - to) * (q - p);
  }
  if (count == 2) add_curve(ends[0], ends[1], face.normal, reach, out);
}

void SlidingPlaces::add_curve(const Vec3& from, const Vec3& to, const Vec3& normal, double reach, Curves& out) const {
  const auto angle = [](const Vec3& p) { return std::atan2(p.z(), p.y()); };
  const auto turned = [](const Vec3& p, const Vec3& q) {
    return std::atan2(p.y() * q.z() - p.z() * q.y(), p.y() * q.y() + p.z() * q.z());
  };
  const double start = frame_.kind() == Kind::kScrew ? angle(from) : 0.0;
  const auto at = [&](const Vec3& p) {
    if (frame_.kind() != Kind::kScrew) return frame_.plane_point(p).low;
    const Orbit orbit = frame_.orbit_of(p);
    return std::array<double, 2>{orbit.plane[0], p.x() - frame_.pitch() * (start + wrapped(angle(p) - start))};
  };
  const double span = frame_.kind() == Kind::kTranslation ? 0.0 : std::abs(turned(from, to));
  const int count = 1 + static_cast<int>(span / tuning().ranges.against.curve_turn);
  for (int i = 0; i < count; ++i) {
    const Vec3 p = from + (to - from) * i / count, q = from + (to - from) * (i + 1) / count;
    if (std::abs(normal.dot(frame_.direction(0.5 * (p + q)))) > most_along()) continue;
    Piece piece{at(p), at(q), reach};
    if (frame_.kind() == Kind::kScrew) {
      const double turn = 2.0 * kPi * std::abs(frame_.pitch());
      const double down = turn * std::floor(std::min(piece.from[1], piece.to[1]) / turn);
      piece.from[1] -= down, piece.to[1] -= down;
    }
    out.pieces.push_back(piece);
  }
}

bool SlidingPlaces::near(const Curves& curves, double first, double second) const {
  OrbitBox point;
  point.add(first, second);
  return curves.tree->any_overlapping(point, [&](Index place) {
    const Piece& p = curves.pieces[static_cast<std::size_t>(curves.tree->order()[static_cast<std::size_t>(place)])];
    const Eigen::Vector2d from(p.from[0], p.from[1]), to(p.to[0], p.to[1]), u(first, second), along = to - from;
    const double length2 = along.squaredNorm();
    const double s = length2 > 0.0 ? std::clamp(along.dot(u - from) / length2, 0.0, 1.0) : 0.0;
    return (from + s * along - u).squaredNorm() <= p.reach * p.reach;
  });
}

bool SlidingPlaces::holds(const Vec3& p) const {
  if (moving_.pieces.empty() || fixed_.pieces.empty()) return false;
  if (frame_.kind() != Kind::kScrew) {
    const std::array<double, 2> at = frame_.plane_point(p).low;
    return near(moving_, at[0], at[1]) && near(fixed_, at[0], at[1]);
  }
  const OrbitBox box = frame_.box_of(frame_.orbit_of(p));
  const double turn = 2.0 * kPi * std::abs(frame_.pitch());
  const auto near_helix = [&](const Curves& curves) {
    for (const double turned : {0.0, turn, -turn})
      if (near(curves, box.low[0], box.low[1] + turned)) return true;
    return false;
  };
  return near_helix(moving_) && near_helix(fixed_);
}

bool SlidingPlaces::holds(const OrbitFace& face) const {
  constexpr int kMost = 8;
  double longest = 0.0;
  for (std::size_t i = 0; i < 3; ++i) longest = std::max(longest, (face.corners[(i + 1) % 3] - face.corners[i]).norm());
  const double parts = longest / across_;
  if (!(parts <= kMost)) return false;
  const int n = std::max(1, static_cast<int>(std::ceil(parts)));
  const Vec3 u = (face.corners[1] - face.corners[0]) / n, v = (face.corners[2] - face.corners[0]) / n;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; i + j <= n; ++j)
      if (!holds(Vec3(face.corners[0] + i * u + j * v))) return false;
  return true;
}

}  // namespace limber::internal
