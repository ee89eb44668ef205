// A ball that a body holds inside: whatever the body touches along a plane, the ball stays on its side of that plane,
// however the body turns meanwhile.
#pragma once

#include <algorithm>
#include <limits>
#include <optional>

#include "convex/convex_core.h"
#include "limber/mesh/winding_number.h"
#include "limber/model/modal_model.h"

namespace limber::internal {

struct InnerBall {
  Vec3 middle = Vec3::Zero();  // body frame, m
  double radius = 0.0;         // m
};

/// About the mean of a core's points.
inline InnerBall inner_ball(const ConvexCore& core) {
  InnerBall ball{.middle = core.middle(), .radius = core.faces.empty() ? 0.0 : std::numeric_limits<double>::infinity()};
  for (const ConvexFace& face : core.faces)
    ball.radius = std::min(ball.radius, face.offset - face.normal.dot(ball.middle));
  ball.radius += core.radius;
  return ball;
}

/// The origin alone, as the body bends; none where it is outside the surface at rest.
inline std::optional<InnerBall> inner_ball(const ModalModel& model) {
  const ModalSurface& surface = model.collision();
  SurfaceMesh rest{.vertices = {}, .triangles = surface.triangles};
  for (const Vec3f& x : surface.rest) rest.vertices.push_back(x.cast<double>());
  return winding_number(rest, Vec3::Zero()) > 0.5 ? std::optional<InnerBall>(InnerBall{}) : std::nullopt;
}

}  // namespace limber::internal
