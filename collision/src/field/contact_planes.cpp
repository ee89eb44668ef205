#include "field/contact_planes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tuning.h"

namespace limber::internal {
namespace {

float shortest_edge_at(const DeformedPointshell& body, Index v) {
  float shortest = std::numeric_limits<float>::infinity();
  for (const Index w : body.shell().surface().vertex_neighbours(v))
    shortest = std::min(shortest, (body.vertex(w) - body.vertex(v)).squaredNorm());
  return std::sqrt(shortest);
}

float shortest_edge_of(const DeformedPointshell& body, Index t) {
  const TrianglePointsf x = corners_of(body, t);
  return std::sqrt(std::min({(x[1] - x[0]).squaredNorm(), (x[2] - x[1]).squaredNorm(), (x[0] - x[2]).squaredNorm()}));
}

// Of a foot from the nearest side of its face.
float from_rim(const DeformedPointshell& body, const SurfaceFoothold& foot) {
  const TrianglePointsf x = corners_of(body, foot.triangle);
  const float twice_area = (x[1] - x[0]).cross(x[2] - x[0]).norm();
  float least = std::numeric_limits<float>::infinity();
  for (std::size_t c = 0; c < 3; ++c)
    least = std::min(least, foot.weight[c] * twice_area / (x[(c + 2) % 3] - x[(c + 1) % 3]).norm());
  return least;
}

// The faces at the corners of a face, some more than once.
template <class Visit>
void for_faces_around(const CollisionSurface& surface, Index t, const Visit& visit) {
  for (const Index corner : surface.triangle(t))
    for (const Index face : surface.vertex_triangles(corner)) visit(face);
}

// Whether a face lies behind a plane through a point, leaning out of it by no more than a sine.
bool lies_behind(const DeformedPointshell& body, Index t, const Vec3f& p, const Vec3f& n, float leaning) {
  return std::ranges::all_of(corners_of(body, t), [&](const Vec3f& x) {
    const Vec3f d = x - p;
    return n.dot(d) <= leaning * d.norm();
  });
}

}  // namespace

Vec3f expected_motion(const FieldView& view, Index vertex, const SurfaceFoothold& foot) {
  Vec3f motion = view.motion(vertex);
  const Triangle& t = view.other->shell().surface().triangle(foot.triangle);
  for (std::size_t c = 0; c < 3; ++c)
    if (foot.weight[c] != 0.0f) motion -= foot.weight[c] * view.other->swing(t[c]);
  return motion;
}

void rest_on_face(const FieldView& view, SampleFoot& sample) {
  const NarrowTuning& tuning = collision_tuning().narrow;
  const DeformedPointshell& other = *view.other;
  const auto touching = static_cast<float>(tuning.touching);
  const float distance = std::abs(sample.gap);
  const auto leans = static_cast<float>(sample.gap < 0.0f ? tuning.steep : tuning.flat);
  if (distance > touching * shortest_edge_of(other, sample.foot.triangle) ||
      lies_in_front(*view.mine, sample.vertex, view.turned_back(sample.normal), leans) ||
      distance > touching * shortest_edge_at(*view.mine, sample.vertex))
    return;
  const float reach =
      touching * std::min(shortest_edge_of(other, sample.foot.triangle), shortest_edge_at(*view.mine, sample.vertex));
  float least = reach;
  const Index near = sample.foot.triangle;
  for_faces_around(other.shell().surface(), near, [&](Index t) {
    const Vec3f n = face_normal(other, t);
    const SurfaceFoothold foot = foot_on(other, t, sample.at);
    const float gap = n.dot(sample.at - foot.point);
    if (!(std::abs(gap) < least) || foot.squared_distance > reach * reach ||
        !lies_in_front(*view.mine, sample.vertex, view.turned_back(n), static_cast<float>(tuning.leaning)))
      return;
    sample.foot = foot, sample.normal = n, sample.gap = gap;
    least = std::abs(gap);
  });
}

bool unhindered(const FieldView& view, SampleFoot& sample, float passed) {
  const DeformedPointshell& other = *view.other;
  const Vec3f motion = expected_motion(view, sample.vertex, sample.foot);
  const Vec3f out = sample.at - sample.foot.point;
  Vec3f best = sample.normal;
  float end = sample.gap + best.dot(motion);
  if (!(end < 0.0f) || from_rim(other, sample.foot) > passed) return true;
  const auto leaning = static_cast<float>(collision_tuning().narrow.leaning);
  const float noise = kNoise * (out.norm() + motion.norm());  // faces of one plane differ by it
  const auto try_normal = [&](const Vec3f& n) {
    const float gap = n.dot(out);
    if (!(gap >= -passed) || !(gap + n.dot(motion) > end + noise)) return;
    if (!lies_behind(other, sample.foot.triangle, sample.foot.point, n, leaning) ||
        !lies_in_front(*view.mine, sample.vertex, view.turned_back(n), leaning))
      return;
    best = n, end = gap + n.dot(motion);
  };
  bool rim = false;
  for_faces_around(other.shell().surface(), sample.foot.triangle, [&](Index t) {
    if (t == sample.foot.triangle || foot_on(other, t, sample.foot.point).squared_distance > passed * passed) return;
    rim = true;
    try_normal(face_normal(other, t));
  });
  if (!rim) return true;
  try_normal(face_normal(other, sample.foot.triangle));
  for (const Index t : view.mine->shell().surface().vertex_triangles(sample.vertex))
    try_normal(-(view.turn * face_normal(*view.mine, t)));
  if (best == sample.normal) return true;
  sample.normal = best, sample.gap = best.dot(out);
  return end < -passed;
}

}  // namespace limber::internal
