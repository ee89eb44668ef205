#include "coarsen.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

#include "flat_tets.h"

namespace limber::internal {
namespace {

constexpr Index kOutside = -1;  ///< the cone over the boundary, a node of links

/// Squared distances to planes, of unit normals.
struct Quadric {
  Mat3 A = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  double c = 0.0, planes = 0.0;

  void add_plane(const Vec3& normal, const Vec3& point) {
    const double offset = -normal.dot(point);
    A += normal * normal.transpose();
    b += offset * normal;
    c += offset * offset;
    planes += 1.0;
  }
  void add(const Quadric& other) {
    A += other.A;
    b += other.b;
    c += other.c;
    planes += other.planes;
  }
  double mean_square_at(const Vec3& x) const { return (x.dot(A * x) + 2.0 * b.dot(x) + c) / planes; }
};

using Face = std::array<Index, 3>;
using Pair = std::array<Index, 2>;
using ShortEdge = std::tuple<double, Index, Index>;  ///< length, nodes

/// Surroundings of a node or an edge: nodes and pairs of them, ascending, each once.
struct Link {
  std::vector<Index> nodes;
  std::vector<Pair> pairs;

  void finish() {
    for (Pair& p : pairs) std::sort(p.begin(), p.end());
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  }
};

class Collapser {
 public:
  Collapser(TetMesh& mesh, const Coarsening& options)
      : mesh_(mesh),
        options_(options),
        origin_(mesh.nodes[static_cast<std::size_t>(mesh.tets[0][0])]),
        tets_at_(mesh.nodes.size()),
        quadric_(mesh.nodes.size()),
        alive_(mesh.tets.size(), 1),
        changed_(mesh.nodes.size(), 1) {
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
      for (const Index n : mesh.tets[t]) tets_at_[n].push_back(static_cast<Index>(t));
    for (std::size_t n = 0; n < mesh.nodes.size(); ++n)
      for (const Face& f : boundary_faces(static_cast<Index>(n))) quadric_[n].add_plane(normal(f), place(f[0]));
  }

  void run() {
    while (pass()) {
    }
    std::size_t kept = 0;
    for (std::size_t t = 0; t < alive_.size(); ++t)
      if (alive_[t]) mesh_.tets[kept++] = mesh_.tets[t];
    mesh_.tets.resize(kept);
    mesh_.tet_region.resize(std::min(mesh_.tet_region.size(), kept));
    drop_unused_nodes(mesh_);
  }

 private:
  /// From a point of the mesh: about a far origin quadrics would cancel.
  Vec3 place(Index node) const { return mesh_.nodes[static_cast<std::size_t>(node)] - origin_; }
  double length(Index a, Index b) const { return (place(a) - place(b)).norm(); }
  Vec3 normal(const Face& f) const { return (place(f[1]) - place(f[0])).cross(place(f[2]) - place(f[0])).normalized(); }
  Vec3 middle(Index a, Index b) const { return origin_ + 0.5 * (place(a) + place(b)); }

  /// Boundary triangles around a node, that node first, seen from outside.
  std::vector<Face> boundary_faces(Index node) const {
    constexpr int kOutward[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    std::vector<std::pair<Face, Face>> faces;  // its nodes in order, and as seen from outside
    faces.reserve(3 * tets_at_[node].size());
    for (const Index t : tets_at_[node])
      for (const auto& f : kOutward) {
        const Tet& tet = mesh_.tets[t];
        Face outward{tet[f[0]], tet[f[1]], tet[f[2]]};
        const auto at = std::find(outward.begin(), outward.end(), node);
        if (at == outward.end()) continue;
        std::rotate(outward.begin(), at, outward.end());
        Face key = outward;
        std::sort(key.begin(), key.end());
        faces.emplace_back(key, outward);
      }
    std::sort(faces.begin(), faces.end());
    std::vector<Face> boundary;
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const bool as_before = i > 0 && faces[i - 1].first == faces[i].first;
      const bool as_after = i + 1 < faces.size() && faces[i + 1].first == faces[i].first;
      if (!as_before && !as_after) boundary.push_back(faces[i].second);
    }
    return boundary;
  }

  Link link_of(Index node, const std::vector<Face>& boundary) const {
    Link link;
    for (const Index t : tets_at_[node]) {
      Face others{};
      std::size_t count = 0;
      for (const Index n : mesh_.tets[t])
        if (n != node) others[count++] = n;
      link.nodes.insert(link.nodes.end(), others.begin(), others.end());
      for (std::size_t i = 0; i < 3; ++i) link.pairs.push_back({others[i], others[(i + 1) % 3]});
    }
    for (const Face& f : boundary) {
      link.nodes.push_back(kOutside);
      link.pairs.push_back({f[1], kOutside});
      link.pairs.push_back({f[2], kOutside});
    }
    link.finish();
    return link;
  }

  /// Lk(a) ∩ Lk(b) = Lk(ab), and no triangle is in both.
  bool link_condition(Index a, Index b, const std::vector<Face>& at_a, const std::vector<Face>& at_b) const {
    Link of_edge;
    for (const Index t : tets_at_[a]) {
      const Tet& tet = mesh_.tets[t];
      if (std::find(tet.begin(), tet.end(), b) == tet.end()) continue;
      Pair others{};
      std::size_t count = 0;
      for (const Index n : tet)
        if (n != a && n != b) others[count++] = n;
      of_edge.nodes.insert(of_edge.nodes.end(), others.begin(), others.end());
      of_edge.pairs.push_back(others);
    }
    for (const Face& f : at_a)
      if (f[1] == b || f[2] == b) {
        const Index third = f[1] == b ? f[2] : f[1];
        of_edge.nodes.push_back(kOutside);
        of_edge.pairs.push_back({third, kOutside});
      }
    of_edge.finish();
    const Link link_a = link_of(a, at_a), link_b = link_of(b, at_b);
    std::vector<Index> nodes;
    std::set_intersection(link_a.nodes.begin(), link_a.nodes.end(), link_b.nodes.begin(), link_b.nodes.end(),
                          std::back_inserter(nodes));
    std::vector<Pair> pairs;
    std::set_intersection(link_a.pairs.begin(), link_a.pairs.end(), link_b.pairs.begin(), link_b.pairs.end(),
                          std::back_inserter(pairs));
    return nodes == of_edge.nodes && pairs == of_edge.pairs && !share_a_triangle(a, b, at_a, at_b);
  }

  bool share_a_triangle(Index a, Index b, const std::vector<Face>& at_a, const std::vector<Face>& at_b) const {
    std::vector<Face> around_a, around_b;
    const auto list = [&](Index node, const std::vector<Face>& boundary, std::vector<Face>& out) {
      for (const Index t : tets_at_[node]) {
        Face f{};
        std::size_t count = 0;
        for (const Index n : mesh_.tets[t])
          if (n != node) f[count++] = n;
        out.push_back(f);
      }
      for (const Face& f : boundary) out.push_back({f[1], f[2], kOutside});
      for (Face& f : out) std::sort(f.begin(), f.end());
      std::sort(out.begin(), out.end());
    };
    list(a, at_a, around_a);
    list(b, at_b, around_b);
    std::vector<Face> both;
    std::set_intersection(around_a.begin(), around_a.end(), around_b.begin(), around_b.end(), std::back_inserter(both));
    return !both.empty();
  }

  /// The tets that a move of `gone` onto `stays` leaves behind are sound.
  bool leaves_sound_tets(Index gone, Index stays) const {
    return std::all_of(tets_at_[gone].begin(), tets_at_[gone].end(), [&](Index t) {
      Tet moved = mesh_.tets[t];
      if (std::find(moved.begin(), moved.end(), stays) != moved.end()) return true;
      std::replace(moved.begin(), moved.end(), gone, stays);
      const double after = shape(mesh_, moved);
      return after > 0.0 && after >= std::min(options_.least_shape, shape(mesh_, mesh_.tets[t]));
    });
  }

  /// No edge that a move of `gone` onto `stays` makes is too long.
  bool leaves_short_edges(Index gone, Index stays) const {
    std::vector<Index> neighbours;
    for (const Index t : tets_at_[gone]) {
      const Tet& tet = mesh_.tets[t];
      if (std::find(tet.begin(), tet.end(), stays) == tet.end())
        neighbours.insert(neighbours.end(), tet.begin(), tet.end());
    }
    std::sort(neighbours.begin(), neighbours.end());
    neighbours.erase(std::unique(neighbours.begin(), neighbours.end()), neighbours.end());
    return std::all_of(neighbours.begin(), neighbours.end(),
                       [&](Index n) { return n == gone || length(n, stays) <= options_.longest(middle(n, stays)); });
  }

  bool collapse(Index gone, Index stays) {
    const std::vector<Face> at_gone = boundary_faces(gone);
    const std::vector<Face> at_stays = boundary_faces(stays);
    if (!at_gone.empty()) {
      const double bound = options_.deviation(mesh_.nodes[stays]);
      if (at_stays.empty() || quadric_[gone].mean_square_at(place(stays)) > bound * bound) return false;
    }
    if (!leaves_sound_tets(gone, stays) || !link_condition(gone, stays, at_gone, at_stays) ||
        !leaves_short_edges(gone, stays))
      return false;
    for (const Index t : tets_at_[gone]) {
      Tet& tet = mesh_.tets[t];
      for (const Index n : tet) changed_[n] = 1;
      if (std::find(tet.begin(), tet.end(), stays) != tet.end()) {
        alive_[t] = 0;
        for (const Index n : tet)
          if (n != gone) std::erase(tets_at_[n], t);
        continue;
      }
      std::replace(tet.begin(), tet.end(), gone, stays);
      tets_at_[stays].push_back(t);
    }
    tets_at_[gone].clear();
    if (!at_gone.empty()) quadric_[stays].add(quadric_[gone]);
    return true;
  }

  /// Brings the list of edges that are too short up to date with what the last pass has changed.
  void list_short_edges() {
    const auto is_stale = [&](Index a, Index b) { return changed_[a] || changed_[b]; };
    std::erase_if(short_edges_, [&](const ShortEdge& e) { return is_stale(std::get<1>(e), std::get<2>(e)); });
    std::vector<Pair> edges;
    for (std::size_t t = 0; t < alive_.size(); ++t) {
      if (!alive_[t]) continue;
      for (const auto& [i, j] : kTetEdges) {
        const auto [a, b] = std::minmax(mesh_.tets[t][i], mesh_.tets[t][j]);
        if (is_stale(a, b)) edges.push_back({a, b});
      }
    }
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    for (const auto& [a, b] : edges)
      if (const double l = length(a, b); l < options_.shortest(middle(a, b))) short_edges_.emplace_back(l, a, b);
    std::sort(short_edges_.begin(), short_edges_.end());
  }

  /// An edge that could not go can only if what is around its nodes has changed since.
  bool pass() {
    list_short_edges();
    const std::vector<char> changed_before = std::exchange(changed_, std::vector<char>(changed_.size(), 0));
    bool any = false;
    for (const auto& [l, a, b] : short_edges_) {
      if (!(changed_before[a] || changed_before[b] || changed_[a] || changed_[b])) continue;
      // An edge may have gone with another; one that was made since is the next pass's.
      if (!are_neighbours(a, b)) continue;
      any = collapse(b, a) || collapse(a, b) || any;
    }
    return any;
  }

  bool are_neighbours(Index a, Index b) const {
    return std::any_of(tets_at_[a].begin(), tets_at_[a].end(), [&](Index t) {
      return std::find(mesh_.tets[t].begin(), mesh_.tets[t].end(), b) != mesh_.tets[t].end();
    });
  }

  TetMesh& mesh_;
  const Coarsening& options_;
  Vec3 origin_;
  std::vector<std::vector<Index>> tets_at_;
  std::vector<Quadric> quadric_;
  std::vector<char> alive_;
  std::vector<char> changed_;  ///< per node: the tets around it, in this pass
  std::vector<ShortEdge> short_edges_;
};

}  // namespace

void coarsen(TetMesh& mesh, const Coarsening& options) { Collapser(mesh, options).run(); }

}  // namespace limber::internal
