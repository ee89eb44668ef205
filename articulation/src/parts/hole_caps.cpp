#include "parts/hole_caps.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "limber/mesh/closed_shells.h"
#include "tuning.h"

namespace limber::internal {
namespace {

/// A loop of vertices in the direction of the surface's triangles.
using Rim = std::vector<Index>;

double area_of(const SurfaceMesh& surface, const Triangle& t) {
  const auto at = [&](int k) -> const Vec3& { return surface.vertices[static_cast<std::size_t>(t[k])]; };
  return 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
}

/// Per vertex, where the edges of the boundary lead. As many lead to each vertex as away from it, since triangles are
/// loops.
std::map<Index, std::vector<Index>> boundary(const SurfaceMesh& surface) {
  std::map<Index, std::vector<Index>> out;
  for (const auto& [from, to] : boundary_of(surface)) out[from].push_back(to);
  return out;
}

/// The boundary as loops that pass no vertex twice: where a walk meets itself, a loop is cut off.
std::vector<Rim> rims(std::map<Index, std::vector<Index>> next) {
  std::vector<Rim> out;
  for (auto& [start, ways] : next)
    while (!ways.empty()) {
      Rim walk{start};
      std::map<Index, std::size_t> place{{start, 0}};
      while (!walk.empty()) {
        auto& onward = next[walk.back()];
        if (onward.empty()) break;  // the walk has come back to its start, and that is used up
        const Index to = onward.back();
        onward.pop_back();
        const auto met = place.find(to);
        if (met == place.end()) {
          place[to] = walk.size();
          walk.push_back(to);
          continue;
        }
        const std::size_t first = met->second;
        out.emplace_back(walk.begin() + static_cast<std::ptrdiff_t>(first), walk.end());
        for (std::size_t i = first + 1; i < walk.size(); ++i) place.erase(walk[i]);
        walk.resize(first + 1);
      }
    }
  return out;
}

/// The fan of least area among those from each corner of a rim, and that area.
std::pair<std::vector<Triangle>, double> least_fan(const SurfaceMesh& surface, const Rim& rim) {
  std::pair<std::vector<Triangle>, double> best{{}, std::numeric_limits<double>::infinity()};
  std::vector<Triangle> fan;
  for (std::size_t corner = 0; corner < rim.size(); ++corner) {
    const auto at = [&](std::size_t i) { return rim[(corner + i) % rim.size()]; };
    fan.clear();
    double area = 0.0;
    for (std::size_t i = 1; i + 1 < rim.size(); ++i) {
      fan.push_back({at(0), at(i + 1), at(i)});
      area += area_of(surface, fan.back());
    }
    if (area < best.second) best = {fan, area};
  }
  return best;
}

}  // namespace

std::optional<std::vector<Triangle>> small_hole_caps(const SurfaceMesh& surface) {
  constexpr double kNoVolume = 1e-9;  // per area^1.5: the round-off of a sheet drawn from both sides
  const PartsTuning& t = tuning().parts;
  double area = 0.0;
  for (const Triangle& triangle : surface.triangles) area += area_of(surface, triangle);
  SurfaceMesh closed = surface;
  double all = 0.0;
  for (const Rim& rim : rims(boundary(surface))) {
    const auto [fan, hole] = least_fan(surface, rim);
    closed.triangles.insert(closed.triangles.end(), fan.begin(), fan.end());
    all += hole;
    if (hole > t.largest_hole * area || all > t.all_holes * area) return std::nullopt;
  }
  if (!(std::abs(enclosed_volume(closed)) > kNoVolume * std::pow(area, 1.5))) return std::nullopt;
  return std::vector<Triangle>(closed.triangles.begin() + static_cast<std::ptrdiff_t>(surface.triangles.size()),
                               closed.triangles.end());
}

}  // namespace limber::internal
