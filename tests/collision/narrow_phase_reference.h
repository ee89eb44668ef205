// All contacts of two closed surfaces by their definition in narrow_phase.h, with OverlapMethod::kNearestPoint: every
// pair of features is looked at, distances are in long double, insides are winding numbers.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "contact_bodies.h"
#include "contact_reference.h"
#include "narrow_phase_bodies.h"

namespace limber::testing {

struct Near {
  Vec3 point;
  double distance;
};

/// Local minima of the distance from p over a surface: feet that no triangle at the foot improves.
inline std::vector<Near> local_minima(const PlainSurface& s, const Vec3& p, double reach) {
  std::vector<Near> all, minima;
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    const auto x = s.corners(t);
    const double radius = std::max((x[1] - x[0]).norm(), (x[2] - x[0]).norm());
    if ((p - x[0]).norm() > reach + radius + 1e-9) continue;
    const auto d = hull_distance({&p, 1}, x);
    all.push_back({d.b, d.distance});
  }
  for (const Near& n : all) {
    if (n.distance > reach) continue;
    bool least = true;
    for (std::size_t t = 0; t < s.triangles.size() && least; ++t) {
      const auto x = s.corners(t);
      const double radius = std::max((x[1] - x[0]).norm(), (x[2] - x[0]).norm());
      if ((n.point - x[0]).norm() > radius + 1e-9 || hull_distance({&n.point, 1}, x).distance > 1e-10) continue;
      least = hull_distance({&p, 1}, x).distance > n.distance - 1e-12;
    }
    const bool known =
        std::any_of(minima.begin(), minima.end(), [&](const Near& m) { return (m.point - n.point).norm() < 1e-9; });
    if (least && !known) minima.push_back(n);
  }
  return minima;
}

/// A contact that there is, may be, or is not told by the definition to more than round-off.
struct Expected {
  enum class Kind { kVertexApart, kEdgesApart, kVertexInside, kEdgesCrossed } kind;
  Vec3 p, q;  // on a and b
  Vec3 normal;
  double gap;
  bool must = true;
};

/// Of one pair of bodies in one place.
class PairReference {
 public:
  PairReference(const PlainSurface& a, const PlainSurface& b, double margin) : side_{&a, &b}, margin_(margin) {
    for (int of = 0; of < 2; ++of) {
      make_edges(of);
      for (const Vec3& v : side_[of]->vertices) inside_[of].push_back(winding_number(*side_[1 - of], v) > 0.5);
    }
    for (int of = 0; of < 2; ++of) add_vertices(of);
    add_edges_apart();
    find_piercings(0), find_piercings(1);
    join_loops();
    add_edges_crossed();
  }

  const std::vector<Expected>& contacts() const { return contacts_; }
  /// Edge pairs that are local minima of the distance, among all that the widened cones of creases let in.
  int edge_minima() const { return edge_minima_; }

 private:
  // Round-off of what is compared with a threshold.
  static constexpr double kUnsure = 1e-9;
  // How far a contact's direction may lean out of a crease's normal cone; see narrow_phase.h.
  static constexpr double kWidening = 0.15;
  // Crossings go along a way out within 26°.
  static constexpr double kSameWay = 0.9;

  struct Edge {
    std::array<Vec3, 2> x;
    std::array<Index, 2> vertices;
    std::vector<Index> triangles;
    Vec3 normal = Vec3::Zero();  // sum of the faces'
    std::vector<Vec3> inward;    // into each face, unit, across the edge
  };
  struct Crossing {
    std::size_t e, f;
    HullDistance feet;
    Vec3 normal;  // out of b: along it a leaves
    bool unsure;
  };
  struct Piercing {
    int of;
    std::size_t edge;
    Index face;
    Vec3 point;
    std::size_t loop;
  };
  enum class Answer { kNo, kUnsure, kYes };

  static Answer sure(double above_zero) {
    return above_zero > kUnsure ? Answer::kYes : above_zero < -kUnsure ? Answer::kNo : Answer::kUnsure;
  }

  void make_edges(int of) {
    const PlainSurface& s = *side_[of];
    std::map<std::pair<Index, Index>, std::size_t> known;
    for (std::size_t t = 0; t < s.triangles.size(); ++t) {
      const auto x = s.corners(t);
      const Vec3 n = (x[1] - x[0]).cross(x[2] - x[0]).normalized();
      for (std::size_t i = 0; i < 3; ++i) {
        const Index v = s.triangles[t][i], w = s.triangles[t][(i + 1) % 3];
        const auto [at, is_new] = known.try_emplace(std::minmax(v, w), edges_[of].size());
        if (is_new) edges_[of].push_back({{x[i], x[(i + 1) % 3]}, {v, w}, {}, Vec3::Zero(), {}});
        Edge& e = edges_[of][at->second];
        e.triangles.push_back(static_cast<Index>(t));
        e.normal += n;
        e.inward.push_back(n.cross(x[(i + 1) % 3] - x[i]).normalized());
      }
    }
  }

  // A little on the way from p to q.
  static bool leaves_outside(const PlainSurface& s, const Vec3& p, const Vec3& q) {
    return winding_number(s, p + 1e-6 * (q - p) / (q - p).norm()) < 0.5;
  }

  // @param out_of_other unit, from q on the other body to p
  void add(Expected::Kind kind, int of, const Vec3& p, const Vec3& q, const Vec3& out_of_other, double gap, bool must) {
    if (of == 0)
      contacts_.push_back({kind, p, q, out_of_other, gap, must});
    else
      contacts_.push_back({kind, q, p, -out_of_other, gap, must});
  }

  void add_vertices(int of) {
    const PlainSurface &mine = *side_[of], &other = *side_[1 - of];
    for (std::size_t v = 0; v < mine.vertices.size(); ++v) {
      const Vec3& p = mine.vertices[v];
      if (inside_[of][v]) {
        HullDistance nearest;
        for (std::size_t t = 0; t < other.triangles.size(); ++t) {
          const auto x = other.corners(t);
          const double radius = std::max((x[1] - x[0]).norm(), (x[2] - x[0]).norm());
          if ((p - x[0]).norm() - radius > nearest.distance) continue;
          if (const HullDistance d = hull_distance({&p, 1}, x); d.distance < nearest.distance) nearest = d;
        }
        const Vec3 out = (nearest.b - p) / nearest.distance;
        way_out_[of][v] = of == 0 ? out : Vec3(-out);
        add(Expected::Kind::kVertexInside, of, p, nearest.b, out, -nearest.distance, true);
        continue;
      }
      // A minimum that is seen through the vertex' own body may be left out.
      for (const Near& n : local_minima(other, p, margin_))
        if (leaves_outside(other, n.point, p))
          add(Expected::Kind::kVertexApart, of, p, n.point, (p - n.point) / n.distance, n.distance,
              leaves_outside(mine, p, n.point));
    }
  }

  // Nearest points within the length of both.
  static bool feet_inside(const Edge& e, const Edge& f, HullDistance& feet) {
    feet = hull_distance(e.x, f.x);
    const auto inside = [](const Edge& edge, const Vec3& p) {
      return (p - edge.x[0]).norm() > kUnsure && (p - edge.x[1]).norm() > kUnsure;
    };
    return inside(e, feet.a) && inside(f, feet.b);
  }

  // Whether a direction that leads away from a body lies in the widened normal cone of an edge of it.
  static Answer in_cone(const Edge& e, const Vec3& d) {
    Vec3 sum = Vec3::Zero();
    double worst = -1.0;
    for (const Vec3& w : e.inward) sum += w, worst = std::max(worst, w.dot(d));
    return std::min(sure(kWidening * sum.norm() - worst), sure(e.normal.dot(d)));
  }

  void add_edges_apart() {
    for (const Edge& e : edges_[0])
      for (const Edge& f : edges_[1]) {
        if ((0.5 * (e.x[0] + e.x[1]) - 0.5 * (f.x[0] + f.x[1])).norm() >
            margin_ + 0.5 * (e.x[1] - e.x[0]).norm() + 0.5 * (f.x[1] - f.x[0]).norm())
          continue;
        HullDistance d;
        if (!feet_inside(e, f, d) || d.distance > margin_ || d.distance < kUnsure) continue;
        const Vec3 n = (d.a - d.b) / d.distance;
        const bool minimum = is_minimum(0, d.b, d.a, d.distance) && is_minimum(1, d.a, d.b, d.distance) &&
                             leaves_outside(*side_[0], d.a, d.b) && leaves_outside(*side_[1], d.b, d.a);
        edge_minima_ += minimum ? 1 : 0;
        const Answer answer = std::min(in_cone(e, -n), in_cone(f, n));
        if (minimum || answer != Answer::kNo)
          add(Expected::Kind::kEdgesApart, 0, d.a, d.b, n, d.distance, minimum || answer == Answer::kYes);
      }
  }

  bool is_minimum(int of, const Vec3& p, const Vec3& q, double d) const {
    const auto minima = local_minima(*side_[of], p, d + 1e-12);
    return std::any_of(minima.begin(), minima.end(), [&](const Near& n) { return (n.point - q).norm() < 1e-9; });
  }

  // Edges through faces.
  void find_piercings(int of) {
    const PlainSurface& other = *side_[1 - of];
    for (std::size_t i = 0; i < edges_[of].size(); ++i)
      for (std::size_t t = 0; t < other.triangles.size(); ++t) {
        const auto x = other.corners(t);
        const auto& [p, q] = edges_[of][i].x;
        if (((p.cwiseMin(q) - x[0].cwiseMax(x[1]).cwiseMax(x[2])).array() > 0.0).any() ||
            ((x[0].cwiseMin(x[1]).cwiseMin(x[2]) - p.cwiseMax(q)).array() > 0.0).any())
          continue;
        const Vec3 n = (x[1] - x[0]).cross(x[2] - x[0]).normalized();
        const double hp = n.dot(p - x[0]), hq = n.dot(q - x[0]);
        Answer through = std::min(sure(-std::min(hp, hq)), sure(std::max(hp, hq)));
        if (through == Answer::kNo) continue;
        const Vec3 point = p + hp / (hp - hq) * (q - p);
        for (std::size_t c = 0; c < 3; ++c)
          through = std::min(through, sure(n.cross(x[(c + 1) % 3] - x[c]).normalized().dot(point - x[c])));
        if (through == Answer::kUnsure) unsure_ = true;
        if (through == Answer::kYes) piercings_.push_back({of, i, static_cast<Index>(t), point, piercings_.size()});
      }
  }

  // Piercings that have a pair of triangles in common belong to one loop of intersection.
  void join_loops() {
    std::map<std::pair<Index, Index>, std::size_t> known;
    const auto root = [&](std::size_t i) {
      while (piercings_[i].loop != i) i = piercings_[i].loop;
      return i;
    };
    for (std::size_t i = 0; i < piercings_.size(); ++i) {
      const Piercing& p = piercings_[i];
      for (const Index t : edges_[p.of][p.edge].triangles) {
        const auto pair = p.of == 0 ? std::pair(t, p.face) : std::pair(p.face, t);
        const auto [at, is_new] = known.try_emplace(pair, i);
        if (!is_new) piercings_[root(i)].loop = root(at->second);
      }
    }
    for (std::size_t i = 0; i < piercings_.size(); ++i) loops_[root(i)].push_back(i);
  }

  void add_edges_crossed() {
    for (const auto& [root, members] : loops_) {
      const std::vector<Crossing> crossings = crossings_of(members);
      const std::vector<Vec3> ways = ways_out(members, crossings);
      for (const Crossing& c : crossings) {
        Answer answer = Answer::kNo;
        for (const Vec3& way : ways) answer = std::max(answer, sure(way.dot(c.normal) - kSameWay));
        if (answer == Answer::kNo) continue;
        add(Expected::Kind::kEdgesCrossed, 0, c.feet.a, c.feet.b, c.normal, -c.feet.distance,
            answer == Answer::kYes && !c.unsure && !unsure_);
      }
    }
  }

  // Of each piercing edge with the edges of the face, such that both bodies end there along the normal.
  std::vector<Crossing> crossings_of(const std::vector<std::size_t>& members) const {
    std::set<std::pair<std::size_t, std::size_t>> pairs;
    for (const std::size_t i : members) {
      const Piercing& p = piercings_[i];
      for (std::size_t f = 0; f < edges_[1 - p.of].size(); ++f) {
        const auto& around = edges_[1 - p.of][f].triangles;
        if (std::find(around.begin(), around.end(), p.face) == around.end()) continue;
        pairs.insert(p.of == 0 ? std::pair(p.edge, f) : std::pair(f, p.edge));
      }
    }
    std::vector<Crossing> crossings;
    for (const auto& [e, f] : pairs) {
      HullDistance d;
      if (!feet_inside(edges_[0][e], edges_[1][f], d) || d.distance < kUnsure) continue;
      const Vec3 n = (d.b - d.a) / d.distance;
      const Answer answer = std::min(in_cone(edges_[0][e], -n), in_cone(edges_[1][f], n));
      if (answer != Answer::kNo) crossings.push_back({e, f, d, n, answer == Answer::kUnsure});
    }
    return crossings;
  }

  // Those of vertices inside next to the loop; without any, that of the crossing along which the loop is least wide.
  std::vector<Vec3> ways_out(const std::vector<std::size_t>& members, const std::vector<Crossing>& crossings) const {
    std::vector<Vec3> ways;
    for (const std::size_t i : members) {
      const Piercing& p = piercings_[i];
      for (const Index v : edges_[p.of][p.edge].vertices)
        if (const auto way = way_out_[p.of].find(static_cast<std::size_t>(v)); way != way_out_[p.of].end())
          ways.push_back(way->second);
    }
    if (!ways.empty() || crossings.empty()) return ways;
    const auto width = [&](const Crossing& c) {
      double low = std::numeric_limits<double>::infinity(), high = -low;
      for (const std::size_t i : members) {
        const double height = c.normal.dot(piercings_[i].point);
        low = std::min(low, height), high = std::max(high, height);
      }
      return std::max(high - low, c.feet.distance);
    };
    return {std::min_element(crossings.begin(), crossings.end(), [&](const Crossing& c, const Crossing& d) {
              return width(c) < width(d);
            })->normal};
  }

  const PlainSurface* side_[2];
  double margin_;
  std::vector<Edge> edges_[2];
  std::vector<bool> inside_[2];
  std::map<std::size_t, Vec3> way_out_[2];  // of vertices inside: the way a goes
  std::vector<Piercing> piercings_;
  std::map<std::size_t, std::vector<std::size_t>> loops_;
  std::vector<Expected> contacts_;
  int edge_minima_ = 0;
  bool unsure_ = false;
};

/// What contacts lack of the reference and have besides.
struct Comparison {
  std::vector<std::string> missed, extra;
  double worst_gap = 0.0, worst_normal = 0.0;  ///< errors, m and (where |gap| > 1e-6 m) radians · |gap|
  int of_kind[4] = {0, 0, 0, 0};               ///< found, by Expected::Kind
  bool overlap = false;
};

inline Comparison compare(const std::vector<ContactPoint>& contacts, const PairReference& reference, const Body& a,
                          const Body& b) {
  static constexpr const char* kNames[] = {"vertex apart", "edges apart", "vertex inside", "crossed edges"};
  Comparison r;
  const auto matches = [&](const ContactPoint& c, const Expected& e) {
    return (point_a(c, a) - e.p).norm() < kGap && (point_b(c, b) - e.q).norm() < kGap && c.gap * e.gap >= 0.0;
  };
  const auto text = [&](Expected::Kind kind, double gap) {
    return std::string(kNames[static_cast<int>(kind)]) + ", gap " + std::to_string(gap);
  };
  for (const Expected& e : reference.contacts()) {
    const auto c = std::find_if(contacts.begin(), contacts.end(), [&](const ContactPoint& x) { return matches(x, e); });
    if (c == contacts.end()) {
      if (e.must) r.missed.push_back(text(e.kind, e.gap));
      continue;
    }
    ++r.of_kind[static_cast<int>(e.kind)];
    r.worst_gap = std::max(r.worst_gap, std::abs(c->gap - e.gap));
    if (std::abs(e.gap) > 1e-6)
      r.worst_normal = std::max(r.worst_normal, (c->normal - e.normal).norm() * std::abs(e.gap));
  }
  for (const ContactPoint& c : contacts) {
    r.overlap = r.overlap || c.gap < -kGap;
    if (std::abs(c.gap) < kGap) continue;
    const auto& all = reference.contacts();
    if (std::none_of(all.begin(), all.end(), [&](const Expected& e) { return matches(c, e); })) {
      const bool edges = is_kind(key_of(c, 0), Feature::Kind::kEdge) && is_kind(key_of(c, 1), Feature::Kind::kEdge);
      r.extra.push_back(text(edges ? (c.gap < 0.0 ? Expected::Kind::kEdgesCrossed : Expected::Kind::kEdgesApart)
                                   : (c.gap < 0.0 ? Expected::Kind::kVertexInside : Expected::Kind::kVertexApart),
                             c.gap));
    }
  }
  return r;
}

}  // namespace limber::testing
