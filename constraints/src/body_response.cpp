#include "limber/constraints/body_response.h"

#include <algorithm>

namespace limber {

BodyResponse body_response(const BodyGroup& group, const Quaternion& q_WB, const ModalStep& modes) {
  const FrameConstants& c = group.frame_constants();
  BodyResponse body{.modes = group.model().modes(),
                    .position_modes = modes.position_response(),
                    .velocity_modes = modes.velocity_response()};
  switch (c.motion) {
    case FrameMotion::kFree:
      body.translations = 3;
      body.inverse_mass = 1.0 / c.mass;
      [[fallthrough]];
    case FrameMotion::kPoint:
      body.rotations = 3;
      body.axes = to_matrix(q_WB * c.principal.q_BP);
      body.inverse_moments = c.principal.moments.cwiseInverse();
      break;
    case FrameMotion::kLine:
      body.rotations = 1;
      body.axes.col(0) = q_WB * c.line_axis;
      body.inverse_moments.x() = 1.0 / c.line_axis.dot(c.inertia * c.line_axis);
      break;
    case FrameMotion::kKinematic:
      break;
  }
  return body;
}

void BodyResponse::add_row(const Vec3& linear, const Vec3& angular, std::span<const double> modal, double* row) const {
  for (int i = 0; i < translations; ++i) *row++ += linear[i];
  for (int i = 0; i < rotations; ++i) *row++ += axes.col(i).dot(angular);
  for (const double shape : modal) *row++ += shape;
}

void BodyResponse::write_position_metric(double step, double theta, double* metric) const {
  write_frame_metric(metric);
  const int frame = translations + rotations;
  for (int i = 0; i < frame; ++i) metric[i] *= theta * step;
  std::copy(position_modes.begin(), position_modes.end(), metric + frame);
}

void BodyResponse::write_velocity_metric(double* metric) const {
  write_frame_metric(metric);
  std::copy(velocity_modes.begin(), velocity_modes.end(), metric + translations + rotations);
}

void BodyResponse::write_frame_metric(double* metric) const {
  metric = std::fill_n(metric, translations, inverse_mass);
  metric = std::copy_n(inverse_moments.data(), rotations, metric);
  std::fill_n(metric, modes, 0.0);
}

}  // namespace limber
