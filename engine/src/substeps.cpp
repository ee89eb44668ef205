#include "substeps.h"

#include <algorithm>
#include <cmath>

#include "limber/dynamics/body_group.h"

namespace limber::internal {

void Substeps::hold_force(Index body, const SurfacePoint& at, const Vec3& newtons_W) {
  if (parts_ > 1) forces_.push_back({body, at, newtons_W, 0, 0.0});
}

bool Substeps::keep_impulse(Index body, const SurfacePoint& at, const Vec3& newton_seconds_W, double delay) {
  const int part = std::min(static_cast<int>(delay / length()), parts_ - 1);
  if (part == 0) return true;
  const double rest = std::clamp(delay - part * length(), 0.0, std::nextafter(length(), 0.0));
  impulses_.push_back({body, at, newton_seconds_W, part, rest});
  return false;
}

void Substeps::lead(Index body, const KinematicFrame& target) {
  forget_frame(body);
  const ConstrainedBody& at = constraints_->states().body(body);
  leads_.push_back({body, at.group->frame(at.slot).parent(), target});
}

void Substeps::forget_frame(Index body) {
  std::erase_if(leads_, [&](const Lead& lead) { return lead.body == body; });
}

void Substeps::forget(Index body) {
  forget_frame(body);
  for (std::vector<Load>* loads : {&forces_, &impulses_})
    std::erase_if(*loads, [&](const Load& load) { return load.body == body; });
}

void Substeps::begin(int part) {
  const BodyStates states = constraints_->states();
  const auto at = [&](Index body) -> const ConstrainedBody& { return states.body(body); };
  const double done = static_cast<double>(part + 1) / parts_;
  for (const Lead& lead : leads_)
    at(lead.body).group->set_parent(at(lead.body).slot, between(lead.start, lead.target, done, step_));
  if (parts_ == 1) return;
  lead_handles(part);
  if (part == 0) return;
  for (const Load& force : forces_) at(force.body).group->apply_force(at(force.body).slot, force.at, force.load);
  for (const Load& impulse : impulses_) {
    if (impulse.part != part) continue;
    at(impulse.body).group->apply_impulse(at(impulse.body).slot, impulse.at, impulse.load, impulse.delay);
    constraints_->disturb(impulse.body);
  }
}

/// Targets go straight to where they are at the step's end.
void Substeps::lead_handles(int part) {
  const std::vector<ConstraintStage::Entry>& entries = constraints_->entries();
  if (part == 0) {
    handles_.clear();
    for (const ConstraintStage::Entry& entry : entries)
      handles_.push_back(entry.handle ? HandlePath{entry.handle->target_now(), entry.handle->target()}
                                      : HandlePath{Vec3::Zero(), {}});
  }
  for (std::size_t i = 0; i < handles_.size(); ++i) {
    if (!entries[i].handle) continue;
    const auto& [start, target] = handles_[i];
    const double done = static_cast<double>(part + 1) / parts_;
    const Vec3 place = part + 1 == parts_ ? target.position : Vec3(start + done * (target.position - start));
    entries[i].handle->set_target({.position = place});
  }
}

void Substeps::finish() {
  forces_.clear();
  impulses_.clear();
  leads_.clear();
  if (parts_ == 1) return;
  for (std::size_t i = 0; i < handles_.size(); ++i) {
    const auto& [start, target] = handles_[i];
    if (constraints_->entries()[i].handle)
      constraints_->entries()[i].handle->set_target(
          {.position = target.position + step_ * target.velocity, .velocity = target.velocity});
  }
}

}  // namespace limber::internal
