#include "limber/mesh/mend_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <utility>

#include "geometry/edge_sides.h"
#include "geometry/near_points.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "limber/mesh/corner_tree.h"
#include "limber/mesh/unused_vertices.h"

namespace limber {
namespace {

using internal::edge_sides;
using internal::EdgeSide;
using internal::for_each_edge;

bool is_flat(const SurfaceMesh& surface, const Triangle& t, double tolerance) {
  const Vec3 a = surface.vertices[t[1]] - surface.vertices[t[0]], b = surface.vertices[t[2]] - surface.vertices[t[0]];
  const double longest = std::sqrt(std::max({a.squaredNorm(), b.squaredNorm(), (a - b).squaredNorm()}));
  return a.cross(b).norm() <= tolerance * longest;
}

/// Sides of edges that have one triangle.
std::vector<EdgeSide> open_sides(const SurfaceMesh& surface) {
  std::vector<EdgeSide> open;
  for_each_edge(edge_sides(surface), [&](std::span<const EdgeSide> at) {
    if (at.size() == 1) open.push_back(at.front());
  });
  return open;
}

// Welds -------------------------------------------------------------------------------------------------------------

Index weld_open_edges(SurfaceMesh& surface, double tolerance) {
  std::vector<char> loose(surface.vertices.size(), 0);
  for (const EdgeSide& side : open_sides(surface)) loose[side.low] = loose[side.high] = 1;
  for (const Triangle& t : surface.triangles)
    if (is_flat(surface, t, tolerance))
      for (const Index v : t) loose[v] = 1;
  std::vector<Index> which;
  std::vector<Vec3> places;
  for (std::size_t v = 0; v < loose.size(); ++v) {
    if (!loose[v]) continue;
    which.push_back(static_cast<Index>(v));
    places.push_back(surface.vertices[v]);
  }
  const std::vector<Index> near = internal::representatives(places, tolerance);
  std::vector<Index> of(surface.vertices.size());
  for (std::size_t v = 0; v < of.size(); ++v) of[v] = static_cast<Index>(v);
  Index welded = 0;
  for (std::size_t i = 0; i < which.size(); ++i) {
    of[which[i]] = which[near[i]];
    welded += near[i] != static_cast<Index>(i) ? 1 : 0;
  }
  for (Triangle& t : surface.triangles)
    for (Index& v : t) v = of[v];
  std::erase_if(surface.triangles, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  return welded;
}

// Doubled triangles -------------------------------------------------------------------------------------------------

/// Triangles over the same vertices that hang together, and what is at their rim.
struct Sheet {
  bool at_one = false;   ///< an edge with one other triangle, which needs this sheet
  bool at_more = false;  ///< an edge that others close without it
  bool free = false;     ///< an edge of no other triangle
};

/// Per triangle the first triangle over the same vertices.
std::vector<Index> first_alike(const SurfaceMesh& surface) {
  std::vector<std::pair<Triangle, Index>> by_vertices;
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    Triangle key = surface.triangles[i];
    std::sort(key.begin(), key.end());
    by_vertices.emplace_back(key, static_cast<Index>(i));
  }
  std::sort(by_vertices.begin(), by_vertices.end());
  std::vector<Index> first(by_vertices.size());
  for (std::size_t i = 0; i < by_vertices.size(); ++i) {
    const bool alike = i > 0 && by_vertices[i].first == by_vertices[i - 1].first;
    first[by_vertices[i].second] = alike ? first[by_vertices[i - 1].second] : by_vertices[i].second;
  }
  return first;
}

/// The doubled triangles at one edge, each by its first, and how many others there are.
struct Meeting {
  std::vector<Index> doubled;
  std::size_t single = 0;
};

template <class Visit>
void for_each_meeting(const SurfaceMesh& surface, const std::vector<Index>& first, const std::vector<char>& is_doubled,
                      const Visit& visit) {
  Meeting meeting;
  for_each_edge(edge_sides(surface), [&](std::span<const EdgeSide> at) {
    meeting.doubled.clear();
    meeting.single = 0;
    for (const EdgeSide& side : at)
      if (!is_doubled[side.triangle])
        ++meeting.single;
      else if (first[side.triangle] == side.triangle)
        meeting.doubled.push_back(side.triangle);
    if (!meeting.doubled.empty()) visit(meeting);
  });
}

bool same_sense(const Triangle& a, const Triangle& b) {
  const auto at = std::find(b.begin(), b.end(), a[0]) - b.begin();
  return b[static_cast<std::size_t>(at + 1) % 3] == a[1];
}

/// Whether a triangle that stands several times stays.
bool stays(const SurfaceMesh& surface, Index triangle, Index first, const Sheet& sheet, std::vector<char>& has_back) {
  if (sheet.at_more && !sheet.at_one) return false;
  if (triangle == first) return true;
  const bool by_itself = sheet.free && !sheet.at_one;
  if (!by_itself || has_back[first] || same_sense(surface.triangles[triangle], surface.triangles[first])) return false;
  has_back[first] = 1;
  return true;
}

Index drop_doubled(SurfaceMesh& surface) {
  const std::vector<Index> first = first_alike(surface);
  std::vector<char> is_doubled(first.size(), 0);
  for (std::size_t i = 0; i < first.size(); ++i)
    if (first[i] != static_cast<Index>(i)) is_doubled[i] = is_doubled[first[i]] = 1;
  DisjointSets sets(first.size());
  for_each_meeting(surface, first, is_doubled, [&](const Meeting& m) {
    if (m.single == 0 && m.doubled.size() == 2) sets.join(m.doubled[0], m.doubled[1]);
  });
  std::vector<Sheet> sheets(first.size());  // by the root of each set
  for_each_meeting(surface, first, is_doubled, [&](const Meeting& m) {
    for (const Index t : m.doubled) {
      Sheet& sheet = sheets[sets.root(t)];
      if (m.single == 1) sheet.at_one = true;
      if (m.single > 1) sheet.at_more = true;
      if (m.single == 0 && m.doubled.size() == 1) sheet.free = true;
    }
  });
  std::vector<Triangle> kept;
  std::vector<char> has_back(first.size(), 0);
  for (std::size_t i = 0; i < first.size(); ++i)
    if (!is_doubled[i] || stays(surface, static_cast<Index>(i), first[i], sheets[sets.root(first[i])], has_back))
      kept.push_back(surface.triangles[i]);
  const auto dropped = static_cast<Index>(surface.triangles.size() - kept.size());
  surface.triangles = std::move(kept);
  return dropped;
}

// Flat triangles and T-junctions ------------------------------------------------------------------------------------

Index drop_flat(SurfaceMesh& surface, double tolerance) {
  return static_cast<Index>(
      std::erase_if(surface.triangles, [&](const Triangle& t) { return is_flat(surface, t, tolerance); }));
}

/// Vertices on one edge of a triangle, in the order in which the triangle runs.
using EdgeVertices = std::vector<Index>;

/// Cuts a triangle at vertices on its edges 0–1, 1–2, 2–0.
void cut(const Triangle& t, const std::array<EdgeVertices, 3>& on, std::vector<Triangle>& out) {
  for (std::size_t a = 0; a < 3; ++a) {
    if (on[a].empty()) continue;
    // At the middle one of this edge's, so that the halves of the work are small soon; the new edge between is whole.
    const auto middle = on[a].begin() + static_cast<std::ptrdiff_t>(on[a].size() / 2);
    const Index from = t[a], to = t[(a + 1) % 3], far = t[(a + 2) % 3];
    cut({from, *middle, far}, {EdgeVertices(on[a].begin(), middle), EdgeVertices{}, on[(a + 2) % 3]}, out);
    cut({*middle, to, far}, {EdgeVertices(middle + 1, on[a].end()), on[(a + 1) % 3], EdgeVertices{}}, out);
    return;
  }
  out.push_back(t);
}

/// A vertex on an open side.
struct OnSide {
  std::size_t side;
  double along;  ///< 0 at the lower vertex, 1 at the higher
  Index vertex;
};

/// Vertices of open edges that lie on other open edges, between their ends; side by side, in order along each.
std::vector<OnSide> find_junctions(const SurfaceMesh& surface, const std::vector<EdgeSide>& open, double tolerance) {
  std::vector<OnSide> found;
  if (open.empty()) return found;
  std::vector<CornerTree<2>::Corners> ends;
  std::vector<Index> loose;
  for (const EdgeSide& side : open) {
    ends.push_back({surface.vertices[side.low], surface.vertices[side.high]});
    loose.insert(loose.end(), {side.low, side.high});
  }
  std::sort(loose.begin(), loose.end());
  loose.erase(std::unique(loose.begin(), loose.end()), loose.end());
  CornerTree<2> tree;
  tree.build(ends);
  const double squared = tolerance * tolerance;
  for (const Index v : loose) {
    const Vec3& p = surface.vertices[v];
    tree.search(
        p, [&] { return squared; }, [](std::size_t) { return true; },
        [&](Index place) {
          const auto number = static_cast<std::size_t>(tree.element(place));
          const EdgeSide& side = open[number];
          const Triangle& own = surface.triangles[side.triangle];
          if (std::find(own.begin(), own.end(), v) != own.end()) return;
          const Vec3 &a = tree.corners(place)[0], edge = tree.corners(place)[1] - a;
          const double along = edge.dot(p - a) / edge.squaredNorm();
          if (along > 0.0 && along < 1.0 && (a + along * edge - p).squaredNorm() <= squared)
            found.push_back({number, along, v});
        });
  }
  std::sort(found.begin(), found.end(), [](const OnSide& a, const OnSide& b) {
    return std::tie(a.side, a.along, a.vertex) < std::tie(b.side, b.along, b.vertex);
  });
  return found;
}

Index split_junctions(SurfaceMesh& surface, double tolerance) {
  const std::vector<EdgeSide> open = open_sides(surface);
  const std::vector<OnSide> junctions = find_junctions(surface, open, tolerance);
  if (junctions.empty()) return 0;
  std::vector<std::array<EdgeVertices, 3>> on(surface.triangles.size());
  for (const OnSide& junction : junctions) {
    const EdgeSide& side = open[junction.side];
    const Index from = side.forward ? side.low : side.high;
    const Triangle& t = surface.triangles[side.triangle];
    on[side.triangle][static_cast<std::size_t>(std::find(t.begin(), t.end(), from) - t.begin())].push_back(
        junction.vertex);
  }
  for (const EdgeSide& side : open) {
    if (side.forward) continue;
    const Triangle& t = surface.triangles[side.triangle];
    EdgeVertices& vertices =
        on[side.triangle][static_cast<std::size_t>(std::find(t.begin(), t.end(), side.high) - t.begin())];
    std::reverse(vertices.begin(), vertices.end());
  }
  std::vector<Triangle> out;
  for (std::size_t i = 0; i < on.size(); ++i) cut(surface.triangles[i], on[i], out);
  surface.triangles = std::move(out);
  return static_cast<Index>(junctions.size());
}

// Orientation -------------------------------------------------------------------------------------------------------

/// Triangles beside each other across edges of two.
struct Neighbours {
  struct One {
    Index triangle;
    bool opposed;  ///< runs through the edge the same way
  };
  std::vector<std::vector<One>> of;
};

Neighbours neighbours(const SurfaceMesh& surface) {
  Neighbours out{std::vector<std::vector<Neighbours::One>>(surface.triangles.size())};
  for_each_edge(edge_sides(surface), [&](std::span<const EdgeSide> at) {
    if (at.size() != 2) return;
    const bool opposed = at[0].forward == at[1].forward;
    out.of[at[0].triangle].push_back({at[1].triangle, opposed});
    out.of[at[1].triangle].push_back({at[0].triangle, opposed});
  });
  return out;
}

/// Turns the lesser part of the triangles that hang together with one, if that makes all of them run alike.
Index turn_part(Index start, const Neighbours& neighbours, std::vector<signed char>& sense, SurfaceMesh& surface) {
  std::vector<Index> part = {start};
  sense[start] = 1;
  bool one_sided = false;
  std::size_t against = 0;
  for (std::size_t i = 0; i < part.size(); ++i)
    for (const auto& [other, opposed] : neighbours.of[part[i]]) {
      const auto needed = static_cast<signed char>(opposed ? -sense[part[i]] : sense[part[i]]);
      if (sense[other] == 0) {
        sense[other] = needed;
        against += needed < 0 ? 1u : 0u;
        part.push_back(other);
      } else if (sense[other] != needed) {
        one_sided = true;
      }
    }
  if (one_sided || against == 0) return 0;
  const signed char lesser = 2 * against <= part.size() ? -1 : 1;
  Index turned = 0;
  for (const Index t : part) {
    if (sense[t] != lesser) continue;
    std::swap(surface.triangles[t][1], surface.triangles[t][2]);
    ++turned;
  }
  return turned;
}

Index turn_by_neighbours(SurfaceMesh& surface) {
  const Neighbours beside = neighbours(surface);
  std::vector<signed char> sense(surface.triangles.size(), 0);  // 0: not seen yet
  Index turned = 0;
  for (std::size_t i = 0; i < sense.size(); ++i)
    if (sense[i] == 0) turned += turn_part(static_cast<Index>(i), beside, sense, surface);
  return turned;
}

}  // namespace

double weld_tolerance(const SurfaceMesh& surface) {
  Eigen::AlignedBox3d box;
  double largest = 0.0;
  for (const Vec3& v : surface.vertices) {
    box.extend(v);
    largest = std::max(largest, v.cwiseAbs().maxCoeff());
  }
  return box.isEmpty() ? 0.0 : std::ldexp(std::max(largest, box.diagonal().norm()), 5 - 23);
}

Index weld_within(SurfaceMesh& surface, double tolerance) {
  const std::vector<Index> of = internal::representatives(surface.vertices, tolerance);
  std::vector<Index> new_index(of.size());
  std::vector<Vec3> kept;
  for (std::size_t i = 0; i < of.size(); ++i) {
    const bool stays = of[i] == static_cast<Index>(i);
    new_index[i] = stays ? static_cast<Index>(kept.size()) : new_index[of[i]];
    if (stays) kept.push_back(surface.vertices[i]);
  }
  const auto gone = static_cast<Index>(surface.vertices.size() - kept.size());
  for (Triangle& t : surface.triangles)
    for (Index& v : t) v = new_index[v];
  surface.vertices = std::move(kept);
  return gone;
}

std::string SurfaceMending::text() const {
  std::ostringstream out;
  out.precision(2);
  const auto note = [&](Index count, const char* what, const char* done) {
    if (count > 0)
      out << (out.tellp() > 0 ? ", " : "") << count << ' ' << what << (count == 1 ? "" : "s") << ' ' << done;
  };
  note(doubled, "doubled triangle", "dropped");
  note(turned, "triangle", "turned");
  note(flat, "flat triangle", "dropped");
  note(split, "T-junction", "split");
  note(welded, "open corner", "welded within ");
  if (welded > 0) out << tolerance << " m";
  return out.str();
}

SurfaceMending mend_surface(SurfaceMesh& surface, double tolerance) {
  if (!(tolerance >= 0.0 && std::isfinite(tolerance)))
    throw InvalidArgument("mend_surface: tolerance is " + std::to_string(tolerance) +
                          " m, expected a finite length of 0 or more");
  SurfaceMending done;
  done.tolerance = tolerance;
  weld(surface);
  done.welded = weld_open_edges(surface, tolerance);
  done.doubled = drop_doubled(surface);
  done.flat = drop_flat(surface, tolerance);
  done.split = split_junctions(surface, tolerance);
  done.doubled += drop_doubled(surface);  // those that were cut differently
  done.turned = turn_by_neighbours(surface);
  Warnings unread;
  drop_unused_vertices(surface, "", unread);
  return done;
}

}  // namespace limber
