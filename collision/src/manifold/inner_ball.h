// A ball that a body holds inside: whatever the body touches along a plane, the ball stays on its side of that plane,
// however the body turns meanwhile.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "convex/convex_core.h"
#include "limber/model/modal_model.h"

namespace limber::internal {

struct InnerBall {
  Vec3 middle = Vec3::Zero();  // body frame, m
  double radius = 0.0;         // m
};

/// About the mean of a core's points.
inline InnerBall inner_ball(const ConvexCore& core) {
  InnerBall ball;
  for (const Vec3& p : core.points) ball.middle += p / static_cast<double>(core.points.size());
  ball.radius = core.faces.empty() ? 0.0 : std::numeric_limits<double>::infinity();
  for (const ConvexFace& face : core.faces)
    ball.radius = std::min(ball.radius, face.offset - face.normal.dot(ball.middle));
  ball.radius += core.radius;
  return ball;
}

/// The origin alone, as the body bends; none where it is outside the surface at rest, by the solid angle that this
/// spans (Van Oosterom, Strackee 1983).
inline std::optional<InnerBall> inner_ball(const ModalModel& model) {
  const auto& surface = model.collision();
  double sum = 0.0;
  for (const Triangle& t : surface.triangles) {
    std::array<Vec3, 3> x;
    for (std::size_t c = 0; c < 3; ++c) x[c] = surface.rest[static_cast<std::size_t>(t[c])].template cast<double>();
    const double a = x[0].norm(), b = x[1].norm(), c = x[2].norm();
    sum += 2.0 * std::atan2(x[0].dot(x[1].cross(x[2])),
                            a * b * c + x[0].dot(x[1]) * c + x[1].dot(x[2]) * a + x[2].dot(x[0]) * b);
  }
  return sum > 2.0 * std::numbers::pi ? std::optional<InnerBall>(InnerBall{}) : std::nullopt;
}

}  // namespace limber::internal
