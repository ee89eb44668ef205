// The Stanford bunny with few enough triangles for comparisons of all with all.
#pragma once

#include <algorithm>
#include <filesystem>
#include <optional>
#include <queue>
#include <set>
#include <tuple>
#include <vector>

#include "limber/mesh/read_mesh.h"
#include "limber/mesh/surface_mesh.h"

namespace limber::testing {

/// Halves the shortest edge that can be taken out without changing the topology or turning a triangle over, until
/// `triangles` are left. Sets are ordered, so that the result is the same everywhere.
class EdgeCollapse {
 public:
  explicit EdgeCollapse(const SurfaceMesh& mesh)
      : points_(mesh.vertices), faces_(mesh.triangles), around_(mesh.vertices.size()), left_(mesh.triangles.size()) {
    for (std::size_t t = 0; t < faces_.size(); ++t)
      for (const Index v : faces_[t]) around_[at(v)].insert(t);
    for (std::size_t v = 0; v < points_.size(); ++v) push_edges(static_cast<Index>(v));
  }

  SurfaceMesh reduce(std::size_t triangles) {
    while (left_ > triangles && !edges_.empty()) {
      const auto [squared_length, a, b] = edges_.top();
      edges_.pop();
      const bool now = neighbours(a).contains(b) && squared_length == (points_[at(a)] - points_[at(b)]).squaredNorm();
      if (now && may_collapse(a, b)) collapse(a, b);
    }
    SurfaceMesh mesh;
    std::vector<Index> place(points_.size(), -1);
    for (std::size_t v = 0; v < points_.size(); ++v) {
      if (around_[v].empty()) continue;
      place[v] = static_cast<Index>(mesh.vertices.size());
      mesh.vertices.push_back(points_[v]);
    }
    std::set<std::size_t> kept;
    for (const auto& triangles_of : around_) kept.insert(triangles_of.begin(), triangles_of.end());
    for (const std::size_t t : kept)
      mesh.triangles.push_back({place[at(faces_[t][0])], place[at(faces_[t][1])], place[at(faces_[t][2])]});
    return mesh;
  }

 private:
  static std::size_t at(Index i) { return static_cast<std::size_t>(i); }

  std::set<Index> neighbours(Index v) const {
    std::set<Index> all;
    for (const std::size_t t : around_[at(v)]) all.insert(faces_[t].begin(), faces_[t].end());
    all.erase(v);
    return all;
  }
  void push_edges(Index v) {
    for (const Index w : neighbours(v))
      edges_.emplace((points_[at(v)] - points_[at(w)]).squaredNorm(), std::min(v, w), std::max(v, w));
  }
  Vec3 doubled_area(std::size_t t, Index a, Index b, const Vec3& moved) const {
    std::array<Vec3, 3> x;
    for (std::size_t c = 0; c < 3; ++c)
      x[c] = faces_[t][c] == a || faces_[t][c] == b ? moved : points_[at(faces_[t][c])];
    return (x[1] - x[0]).cross(x[2] - x[0]);
  }
  bool may_collapse(Index a, Index b) const {
    const std::set<Index> of_a = neighbours(a), of_b = neighbours(b);
    std::vector<Index> common;
    std::set_intersection(of_a.begin(), of_a.end(), of_b.begin(), of_b.end(), std::back_inserter(common));
    if (common.size() != 2) return false;
    const Vec3 middle = 0.5 * (points_[at(a)] + points_[at(b)]);
    for (const Index v : {a, b})
      for (const std::size_t t : around_[at(v)]) {
        const Vec3 before = doubled_area(t, -1, -1, middle), after = doubled_area(t, a, b, middle);
        const bool goes = around_[at(a)].contains(t) && around_[at(b)].contains(t);
        if (!goes && !(before.dot(after) > 0.5 * before.norm() * after.norm())) return false;
      }
    return true;
  }
  void collapse(Index a, Index b) {
    points_[at(a)] = 0.5 * (points_[at(a)] + points_[at(b)]);
    const std::set<std::size_t> of_b = around_[at(b)];
    for (const std::size_t t : of_b) {
      if (around_[at(a)].contains(t)) {
        for (const Index v : faces_[t]) around_[at(v)].erase(t);
        --left_;
      } else {
        std::replace(faces_[t].begin(), faces_[t].end(), b, a);
        around_[at(a)].insert(t);
      }
    }
    around_[at(b)].clear();
    push_edges(a);
  }

  using Edge = std::tuple<double, Index, Index>;
  std::vector<Vec3> points_;
  std::vector<Triangle> faces_;
  std::vector<std::set<std::size_t>> around_;  // per vertex its triangles
  std::priority_queue<Edge, std::vector<Edge>, std::greater<>> edges_;
  std::size_t left_;
};

/// 1 m long, about the origin; none where Debian's package glmark2-data is not installed.
inline std::optional<SurfaceMesh> coarse_bunny(std::size_t triangles) {
  const std::filesystem::path file = "/usr/share/glmark2/models/bunny.obj";
  if (!std::filesystem::exists(file)) return std::nullopt;
  Warnings warnings;
  SurfaceMesh bunny = EdgeCollapse(read_surface_mesh(file, warnings)).reduce(triangles);
  for (Vec3& p : bunny.vertices) p *= 0.5;
  return bunny;
}

}  // namespace limber::testing
