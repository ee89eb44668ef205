#include "running/held_points.h"

#include <algorithm>

#include "running/frame_movement.h"
#include "running/step_times.h"
#include "running/surface_place.h"

namespace limber::internal {

void HeldPoints::plan(const SceneHandle& handle, BodyId body, const std::string& name) {
  planned_.push_back({.handle = &handle, .body = body});
  reports_.push_back({.body = name});
}

void HeldPoints::begin(double step, std::int64_t steps) {
  step_ = step;
  for (std::size_t i = planned_.size(); i-- > 0;) {
    Planned& p = planned_[i];
    p.first = step_at_or_after(p.handle->start, step);
    p.end = step_at_or_after(p.handle->start + p.handle->duration, step);
    reports_[i].step = p.first;
    if (p.first < steps) continue;
    planned_.erase(planned_.begin() + static_cast<std::ptrdiff_t>(i));
    reports_.erase(reports_.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

/// At the end of step n, and how it goes on.
HandleTarget HeldPoints::target(const Planned& planned, const Vec3& taken, std::int64_t n) const {
  const double since = static_cast<double>(n + 1 - planned.first) * step_;
  const FrameState state = frame_at(planned.handle->movement, {.q = {}, .p = taken}, since);
  return {.position = state.pose.p, .velocity = state.velocity};
}

void HeldPoints::hold(World& world, std::int64_t n) {
  for (std::size_t i = 0; i < planned_.size(); ++i) {
    Planned& p = planned_[i];
    if (n == p.first) {
      const SurfacePoint at = find_place(p.handle->at, world, p.body, p.handle->where);
      reports_[i].point = world.position(p.body, at);
      p.id = world.add_handle(p.body, at, p.handle->options);
    }
    if (n == p.end && world.contains(p.id)) world.remove_handle(p.id);
    // One that stays where it is says nothing, so that its body may sleep.
    const bool led = !std::holds_alternative<std::monostate>(p.handle->movement);
    if (led && world.contains(p.id)) world.set_handle_target(p.id, target(p, reports_[i].point, n));
  }
}

void HeldPoints::note(const World& world, std::int64_t n) {
  for (std::size_t i = 0; i < planned_.size(); ++i) {
    if (n < planned_[i].first || n >= planned_[i].end) continue;
    const HandleView view = world.handle(planned_[i].id);
    HandleReport& report = reports_[i];
    report.force = view.force;
    report.largest_force = std::max(report.largest_force, view.force.norm());
    report.largest_error = std::max(report.largest_error, view.error);
  }
}

void HeldPoints::save_state(StateWriter& state) const {
  for (std::size_t i = 0; i < planned_.size(); ++i)
    state(planned_[i].id.index, planned_[i].id.generation, reports_[i].point);
}

void HeldPoints::restore_state(StateReader& state) {
  for (std::size_t i = 0; i < planned_.size(); ++i)
    state(planned_[i].id.index, planned_[i].id.generation, reports_[i].point);
}

}  // namespace limber::internal
