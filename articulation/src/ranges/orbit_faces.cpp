#include "ranges/orbit_faces.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>

#include "constants.h"
#include "tuning.h"

namespace limber::internal {
namespace {

using Kind = MotionPath::Kind;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// A vertex in path coordinates.
struct Corner {
  Vec3 p;
  OrbitBox plane;           ///< a point
  double angle = kUnknown;  ///< about the axis, once it was asked for
};

/// A triangle in reach, as little of it as tells whether it matters.
struct Candidate {
  Index body = 0, triangle = 0;
  Triangle corners{};
};

/// Numbers for those vertices of a surface that are asked for, without a look at the others.
class VertexNumbers {
 public:
  /// The number given to a vertex before, or that of make(), which is kept. @param vertices how many there are
  template <class Make>
  Index number(Index vertex, std::size_t vertices, Make&& make) {
    if (numbers_.size() < vertices) numbers_.resize(vertices, -1);
    Index& known = numbers_[static_cast<std::size_t>(vertex)];
    if (known < 0) known = make(), used_.push_back(vertex);
    return known;
  }
  void forget() {
    for (const Index v : used_) numbers_[static_cast<std::size_t>(v)] = -1;
    used_.clear();
  }

 private:
  std::vector<Index> numbers_, used_;  ///< −1 where there is none
};

/// The bodies of one side along a path.
class SideOnPath {
 public:
  SideOnPath(const PathFrame& frame, std::span<const OrbitBody> bodies) : frame_(frame), bodies_(bodies) {
    around_.reserve(bodies.size());
    for (const OrbitBody& body : bodies) around_.push_back(frame.box_around(body.box));
  }

  /// Box around the bodies that may come within `reach`, by their boxes.
  OrbitBox rough_reach(const OrbitBox& reach) const {
    OrbitBox out;
    for (const OrbitBox& box : around_)
      if (box.overlaps(reach)) out.add(box);
    return out;
  }

  /// The same by the leaves of their trees.
  OrbitBox close_reach(const OrbitBox& reach) const;

  /// Finds the triangles that orbits within `reach` can meet.
  void select(const OrbitBox& reach);
  const OrbitBoxTree& tree() const { return *tree_; }

  /// Faces of select() that pass, in the order of the tree.
  template <class Passes>
  std::vector<OrbitFace> faces(Passes&& passes) {
    std::vector<OrbitFace> out;
    const std::vector<Index>& order = tree_->order();
    for (std::size_t place = 0; place < order.size(); ++place) {
      const OrbitBox& box = tree_->box(static_cast<Index>(place));
      if (!passes(box)) continue;
      out.push_back(face_of(candidates_[static_cast<std::size_t>(order[place])]));
      out.back().box = box;
    }
    return out;
  }

 private:
  /// Calls use(body, box around the orbits, triangles) for leaves of the bodies' trees that may come within `reach`.
  template <class Use>
  void visit(const OrbitBox& reach, Use&& use) const;
  void add_candidate(Index body, Index triangle, VertexNumbers& numbers, const OrbitBox& reach,
                     std::vector<OrbitBox>& boxes);
  OrbitFace face_of(const Candidate& candidate);
  void set_sector(OrbitFace& face);
  double angle(const OrbitFace& face, std::size_t corner);
  void add_helices(const Candidate& candidate, std::vector<OrbitBox>& boxes);

  const PathFrame& frame_;
  std::span<const OrbitBody> bodies_;
  std::vector<OrbitBox> around_;
  std::vector<Corner> corners_;
  std::vector<Candidate> candidates_;
  std::optional<OrbitBoxTree> tree_;
};

template <class Use>
void SideOnPath::visit(const OrbitBox& reach, Use&& use) const {
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    if (bodies_[b].triangles() == 0 || !around_[b].overlaps(reach)) continue;
    OrbitBox around;
    const CornerTree<3>& tree = *bodies_[b].tree;
    tree.any_leaf(
        [&](std::size_t node) {
          around = frame_.box_around(tree.box(node));
          return around.overlaps(reach);
        },
        [&](Index first, Index end) {
          use(static_cast<Index>(b), around, tree.elements(first, end));
          return false;
        });
  }
}

OrbitBox SideOnPath::close_reach(const OrbitBox& reach) const {
  OrbitBox out;
  visit(reach, [&](Index, const OrbitBox& around, std::span<const Index>) { out.add(around); });
  return out;
}

void SideOnPath::select(const OrbitBox& reach) {
  thread_local VertexNumbers numbers;
  std::vector<OrbitBox> boxes;
  Index last = -1;
  visit(reach, [&](Index body, const OrbitBox&, std::span<const Index> triangles) {
    if (body != last) numbers.forget();
    last = body;
    for (const Index t : triangles) add_candidate(body, t, numbers, reach, boxes);
  });
  numbers.forget();
  tree_.emplace(boxes);
}

void SideOnPath::add_candidate(Index body, Index triangle, VertexNumbers& numbers, const OrbitBox& reach,
                               std::vector<OrbitBox>& boxes) {
  const OrbitBody& of = bodies_[static_cast<std::size_t>(body)];
  const std::vector<Vec3>& vertices = of.surface->vertices;
  Candidate candidate{body, triangle};
  for (std::size_t i = 0; i < 3; ++i) {
    const Index v = of.triangle(static_cast<std::size_t>(triangle))[i];
    candidate.corners[i] = numbers.number(v, vertices.size(), [&] {
      const Vec3 p = frame_.to_path(vertices[static_cast<std::size_t>(v)]);
      corners_.push_back({p, frame_.plane_point(p)});
      return static_cast<Index>(corners_.size() - 1);
    });
  }
  const auto corner = [&](std::size_t i) -> const Corner& {
    return corners_[static_cast<std::size_t>(candidate.corners[i])];
  };
  OrbitBox box = corner(0).plane;
  box.add(corner(1).plane), box.add(corner(2).plane);
  if (frame_.kind() != Kind::kTranslation) box.low[0] = 0.0;  // faces pass nearer to the axis than their corners
  if (frame_.kind() == Kind::kScrew) return add_helices(candidate, boxes);
  if (!box.overlaps(reach)) return;
  if (frame_.kind() == Kind::kRotation) box.low[0] = least_radius(corner(0).p, corner(1).p, corner(2).p);
  if (!box.overlaps(reach)) return;
  candidates_.push_back(candidate);
  boxes.push_back(box);
}

OrbitFace SideOnPath::face_of(const Candidate& candidate) {
  const OrbitBody& body = bodies_[static_cast<std::size_t>(candidate.body)];
  const auto number = static_cast<std::size_t>(candidate.triangle);
  OrbitFace f;
  f.body = candidate.body;
  f.triangle = candidate.triangle;
  f.cap = number >= body.surface->triangles.size();
  f.flipped = body.inside_out;
  f.vertices = candidate.corners;
  if (f.flipped) std::swap(f.vertices[1], f.vertices[2]);
  for (std::size_t i = 0; i < 3; ++i) f.corners[i] = corners_[static_cast<std::size_t>(f.vertices[i])].p;
  f.normal = (f.corners[1] - f.corners[0]).cross(f.corners[2] - f.corners[0]).stableNormalized();
  f.offset = f.normal.dot(f.corners[0]);
  f.across = f.normal.tail<2>().norm();
  f.heading = std::atan2(f.normal.z(), f.normal.y());
  if (frame_.kind() != Kind::kTranslation) {
    f.box.low[0] = least_radius(f.corners[0], f.corners[1], f.corners[2]);
    set_sector(f);
  }
  return f;
}

double SideOnPath::angle(const OrbitFace& face, std::size_t corner) {
  double& known = corners_[static_cast<std::size_t>(face.vertices[corner])].angle;
  if (std::isnan(known)) known = std::atan2(face.corners[corner].z(), face.corners[corner].y());
  return known;
}

/// The angles about the axis that a triangle covers: middle and half width.
void SideOnPath::set_sector(OrbitFace& face) {
  face.sector.bearing = 0.0, face.sector.half = kPi;
  if (face.box.low[0] > 0.0) {
    const double start = angle(face, 0);
    const auto [low, high] = std::minmax({0.0, wrapped(angle(face, 1) - start), wrapped(angle(face, 2) - start)});
    constexpr double kMargin = 1e-9;  // rad: above round-off
    if (high - low < kPi)
      face.sector.bearing = start + 0.5 * (low + high), face.sector.half = 0.5 * (high - low) + kMargin;
  }
  const double off = std::abs(wrapped(face.sector.bearing - face.heading));
  if (off > face.sector.half) face.sector.cosine_high = std::cos(off - face.sector.half);
  if (off + face.sector.half < kPi) face.sector.cosine_low = std::cos(off + face.sector.half);
}

/// A screw's face: the helices that can meet it as a box from 0 to a turn, or one that reaches beyond
/// and a copy of the face one turn lower.
void SideOnPath::add_helices(const Candidate& candidate, std::vector<OrbitBox>& boxes) {
  const OrbitFace face = face_of(candidate);
  const double turn = 2.0 * kPi * std::abs(frame_.pitch()), half = std::abs(frame_.pitch()) * face.sector.half;
  const auto [low_x, high_x] = std::minmax({face.corners[0].x(), face.corners[1].x(), face.corners[2].x()});
  const double low = low_x - frame_.pitch() * face.sector.bearing - half,
               high = high_x - frame_.pitch() * face.sector.bearing + half;
  const double down = high - low < turn ? turn * std::floor(low / turn) : low;
  OrbitBox box = frame_.box_of(face.corners);
  box.low[1] = low - down;
  box.high[1] = high - low < turn ? high - down : turn;
  candidates_.push_back(candidate);
  boxes.push_back(box);
  if (box.high[1] <= turn || high - low >= turn) return;
  box.low[1] -= turn;
  box.high[1] -= turn;
  candidates_.push_back(candidate);
  boxes.push_back(box);
}

/// +1, −1: the motion leaves the outside of a triangle, or its inside, at all corners; 0: neither, or it lies along the
/// motion to within a degree, which may be noise. @param normal unit. All in path coordinates
int side_of_motion(const PathFrame& frame, const Vec3& normal, const std::array<Vec3, 3>& corners) {
  const double least = tuning().ranges.against.one_sided;
  double low = kUnknown, high = kUnknown;
  for (const Vec3& corner : corners) {
    const double along = normal.dot(frame.direction(corner));
    low = std::fmin(low, along), high = std::fmax(high, along);
  }
  return low >= least ? 1 : high <= -least ? -1 : 0;
}

/// @param faces of one side, whose vertices are numbered together. @param crease angle below which a face continues
/// another, rad
void set_one_sided(const PathFrame& frame, double crease, std::vector<OrbitFace>& faces) {
  const double continues = std::cos(crease);
  std::vector<int> sides;
  for (OrbitFace& face : faces) {
    sides.push_back(side_of_motion(frame, face.normal, face.corners));
    face.one_sided = sides.back() != 0;
  }
  if (std::all_of(sides.begin(), sides.end(), [](int side) { return side == 0; })) return;
  const FacesAround around(faces);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (const Index vertex : faces[f].vertices) {
      if (!faces[f].one_sided) break;
      const auto others = around.of(vertex);
      faces[f].one_sided = std::none_of(others.begin(), others.end(), [&](Index other) {
        const auto o = static_cast<std::size_t>(other);
        return sides[o] != sides[f] && faces[o].normal.dot(faces[f].normal) > continues;
      });
    }
}

}  // namespace

FacesAround::FacesAround(const std::vector<OrbitFace>& faces) {
  Index vertices = 0;
  for (const OrbitFace& f : faces)
    vertices = std::max(vertices, *std::max_element(f.vertices.begin(), f.vertices.end()) + 1);
  first_.assign(static_cast<std::size_t>(vertices) + 1, 0);
  for (const OrbitFace& f : faces)
    for (const Index v : f.vertices) ++first_[static_cast<std::size_t>(v) + 1];
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  faces_.resize(3 * faces.size());
  std::vector<Index> next(first_.begin(), first_.end() - 1);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (const Index v : faces[f].vertices)
      faces_[static_cast<std::size_t>(next[static_cast<std::size_t>(v)]++)] = static_cast<Index>(f);
}

/// Tree of a surface's own triangles and its caps, numbered one after the other.
std::shared_ptr<const CornerTree<3>> tree_of(const SurfaceMesh& surface, std::span<const Triangle> caps) {
  constexpr std::size_t kLeaf = 8;  // triangles: bounds of orbits cost more than boxes
  std::vector<CornerTree<3>::Corners> all;
  all.reserve(surface.triangles.size() + caps.size());
  for (const auto triangles : {std::span(surface.triangles), caps})
    for (const Triangle& t : triangles)
      all.push_back({surface.vertices[static_cast<std::size_t>(t[0])], surface.vertices[static_cast<std::size_t>(t[1])],
                     surface.vertices[static_cast<std::size_t>(t[2])]});
  auto tree = std::make_shared<CornerTree<3>>();
  if (!all.empty()) tree->build(all, kLeaf);
  return tree;
}

OrbitBody orbit_body(const MotionBody& body) {
  OrbitBody out{body.surface, body.closed};
  out.caps = body.caps;
  if (body.closed && body.caps.empty()) {
    out.inside_out = enclosed_volume(*body.surface) < 0.0;
  } else if (body.closed) {
    SurfaceMesh with_caps = *body.surface;
    with_caps.triangles.insert(with_caps.triangles.end(), body.caps.begin(), body.caps.end());
    out.inside_out = enclosed_volume(with_caps) < 0.0;
  }
  for (const Vec3& p : body.surface->vertices) out.box.extend(p);
  out.tree = tree_of(*body.surface, body.caps);
  return out;
}

std::pair<std::vector<OrbitFace>, std::vector<OrbitFace>> faces_that_meet(const PathFrame& frame,
                                                                          std::span<const OrbitBody> moving,
                                                                          std::span<const OrbitBody> fixed,
                                                                          double margin, double crease) {
  constexpr double kEverywhere = 1e300;
  const auto grown = [&](OrbitBox box) {
    box.grow(margin);
    return box;
  };
  SideOnPath a(frame, moving), b(frame, fixed);
  const OrbitBox everywhere{{-kEverywhere, -kEverywhere}, {kEverywhere, kEverywhere}};
  const OrbitBox near_a = b.rough_reach(grown(a.rough_reach(everywhere)));
  const OrbitBox reach_a = a.close_reach(grown(near_a)), reach_b = b.close_reach(grown(reach_a));
  a.select(grown(reach_b));
  b.select(grown(reach_a));
  const double turn = frame.kind() == Kind::kScrew ? 2.0 * kPi * std::abs(frame.pitch()) : 0.0;
  const auto meets = [&](const OrbitBoxTree& other) {
    return [&, turn](OrbitBox box) {
      box.grow(margin);
      const auto found = [](Index) { return true; };
      if (other.any_overlapping(box, found)) return true;
      if (turn == 0.0) return false;
      box.low[1] += turn, box.high[1] += turn;
      if (other.any_overlapping(box, found)) return true;
      box.low[1] -= 2.0 * turn, box.high[1] -= 2.0 * turn;
      return other.any_overlapping(box, found);
    };
  };
  std::pair<std::vector<OrbitFace>, std::vector<OrbitFace>> out{a.faces(meets(b.tree())), b.faces(meets(a.tree()))};
  set_one_sided(frame, crease, out.first);
  set_one_sided(frame, crease, out.second);
  return out;
}

}  // namespace limber::internal
