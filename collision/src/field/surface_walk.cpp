#include "field/surface_walk.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace limber::internal {
namespace {

// Steps of a walk at most: a cell of the field is seldom wider than so many triangles.
constexpr int kMostSteps = 12;

constexpr unsigned edge_bits(unsigned corner) { return 1u << corner | 1u << (corner + 1) % 3; }

int corner_of_edge(unsigned corners) { return corners == edge_bits(0) ? 0 : corners == edge_bits(1) ? 1 : 2; }

Vec3f unit(const Vec3f& v) {
  const float n = v.norm();
  return n > 0.0f ? Vec3f(v / n) : Vec3f(Vec3f::Zero());
}

Vec3f unit_normal(const TrianglePointsf& x) { return unit((x[1] - x[0]).cross(x[2] - x[0])); }

}  // namespace

Vec3f face_normal(const DeformedPointshell& body, Index t) { return unit_normal(corners_of(body, t)); }

SurfaceFoothold foot_on(const DeformedPointshell& body, Index t, const Vec3f& p) {
  const TrianglePointsf x = corners_of(body, t);
  const Vec3f ab = x[1] - x[0], ac = x[2] - x[0], ap = p - x[0], bp = p - x[1], cp = p - x[2];
  const float d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  const float va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  float v = 0.0f, w = 0.0f;
  SurfaceFoothold foot;
  foot.triangle = t;
  if (d1 <= 0.0f && d2 <= 0.0f) {
    foot.corners = 1u;
  } else if (d3 >= 0.0f && d4 <= d3) {
    foot.corners = 2u, v = 1.0f;
  } else if (d6 >= 0.0f && d5 <= d6) {
    foot.corners = 4u, w = 1.0f;
  } else if (vc <= 0.0f && d1 >= 0.0f && d3 <= 0.0f) {
    foot.corners = edge_bits(0), v = d1 / (d1 - d3);
  } else if (vb <= 0.0f && d2 >= 0.0f && d6 <= 0.0f) {
    foot.corners = edge_bits(2), w = d2 / (d2 - d6);
  } else if (va <= 0.0f && d4 >= d3 && d5 >= d6) {
    foot.corners = edge_bits(1), w = (d4 - d3) / ((d4 - d3) + (d5 - d6)), v = 1.0f - w;
  } else {
    const float sum = va + vb + vc;
    foot.corners = kFootOnFace, v = vb / sum, w = vc / sum;
  }
  foot.weight = {1.0f - v - w, v, w};
  foot.point = x[0] + v * ab + w * ac;
  foot.squared_distance = (foot.point - p).squaredNorm();
  return foot;
}

SurfaceFoothold walk_to_foot(const DeformedPointshell& body, const SurfaceFoothold& start, const Vec3f& p,
                             std::span<const Index> seen) {
  const CollisionSurface& surface = body.shell().surface();
  SurfaceFoothold best = start;
  for (int step = 0; step < kMostSteps && best.corners != kFootOnFace; ++step) {
    SurfaceFoothold next = best;
    const auto look_at = [&](Index t) {
      if (t < 0 || t == best.triangle || std::ranges::find(seen, t) != seen.end()) return;
      // Nearer by more than round-off, so that a walk cannot go in circles.
      const SurfaceFoothold foot = foot_on(body, t, p);
      if (foot.squared_distance < next.squared_distance * (1.0f - 1e-6f)) next = foot;
    };
    if (std::has_single_bit(best.corners)) {
      const auto corner = static_cast<std::size_t>(std::countr_zero(best.corners));
      for (const Index t : surface.vertex_triangles(surface.triangle(best.triangle)[corner])) look_at(t);
    } else {
      look_at(surface.neighbour(best.triangle, corner_of_edge(best.corners)));
    }
    if (next.triangle == best.triangle) break;
    best = next;
  }
  return best;
}

Vec3f normal_at(const DeformedPointshell& body, const SurfaceFoothold& foot) {
  const CollisionSurface& surface = body.shell().surface();
  const Vec3f n = face_normal(body, foot.triangle);
  if (foot.corners == kFootOnFace) return n;
  if (!std::has_single_bit(foot.corners)) {
    const Index other = surface.neighbour(foot.triangle, corner_of_edge(foot.corners));
    return other < 0 ? n : Vec3f(n + face_normal(body, other));
  }
  const Index v = surface.triangle(foot.triangle)[static_cast<std::size_t>(std::countr_zero(foot.corners))];
  Vec3f sum = Vec3f::Zero();
  for (const Index t : surface.vertex_triangles(v)) {
    const Triangle& at = surface.triangle(t);
    const auto corner = static_cast<std::size_t>(std::ranges::find(at, v) - at.begin());
    const TrianglePointsf x = corners_of(body, t);
    const Vec3f one = x[(corner + 1) % 3] - x[corner], two = x[(corner + 2) % 3] - x[corner];
    sum += std::atan2(one.cross(two).norm(), one.dot(two)) * unit_normal(x);
  }
  return sum;
}

Pierced walk_to_face(const DeformedPointshell& body, Index start, const Vec3f& from, const Vec3f& to) {
  const Vec3f way = to - from;
  Index t = start, last = -1;
  for (int step = 0; step < kMostSteps; ++step) {
    const TrianglePointsf x = corners_of(body, t);
    // Six times the volumes of the line with each edge: all of one sign where it goes through the face.
    std::array<float, 3> volume;
    for (std::size_t c = 0; c < 3; ++c) volume[c] = way.dot((x[c] - from).cross(x[(c + 1) % 3] - from));
    const float sum = volume[0] + volume[1] + volume[2];
    const float sign = sum < 0.0f ? -1.0f : 1.0f;
    const auto least = static_cast<std::size_t>(
        std::min_element(volume.begin(), volume.end(), [&](float a, float b) { return sign * a < sign * b; }) -
        volume.begin());
    if (sign * volume[least] >= 0.0f) {
      const Vec3f n = (x[1] - x[0]).cross(x[2] - x[0]);
      const float rate = n.dot(way);
      if (rate == 0.0f) return {};
      return {t, n.dot(x[0] - from) / rate};
    }
    const Index next = body.shell().surface().neighbour(t, static_cast<int>(least));
    if (next < 0 || next == last) return {};
    last = t, t = next;
  }
  return {};
}

bool lies_in_front(const DeformedPointshell& body, Index v, const Vec3f& n, float leaning) {
  const Vec3f p = body.vertex(v);
  return std::ranges::all_of(body.shell().surface().vertex_neighbours(v), [&](Index w) {
    const Vec3f d = body.vertex(w) - p;
    return n.dot(d) >= -leaning * d.norm();
  });
}

FeatureKey key_of(const CollisionSurface& surface, const SurfaceFoothold& foot) {
  if (foot.corners == kFootOnFace) return feature_key(Feature::Kind::kFace, foot.triangle);
  if (std::has_single_bit(foot.corners))
    return feature_key(Feature::Kind::kVertex,
                       surface.triangle(foot.triangle)[static_cast<std::size_t>(std::countr_zero(foot.corners))]);
  return feature_key(Feature::Kind::kEdge, surface.edge_of(foot.triangle, corner_of_edge(foot.corners)));
}

}  // namespace limber::internal
