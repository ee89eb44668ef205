#include "island_work.h"

#include <algorithm>

namespace limber::internal {
namespace {

/// What it takes to lift all bodies of the island by a distance within a step. Rows that push overlapping bodies apart
/// may do no more, however hard they press against each other.
double largest_recovery_work(const IslandStep& step, double distance) {
  const double speed = distance / step.length();
  double work = 0.0;
  for (Index local = 0; local < step.bodies.count(); ++local)
    work += step.bodies.body(local).group->frame_constants().mass *
            (0.5 * speed * speed + step.gravity_of(local).norm() * distance);
  return work;
}

/// N, over the step.
double force(const IslandStep& step, std::size_t row) { return step.f[row] / step.length() + step.reaction[row]; }

double given(const IslandStep& step, std::size_t row) {
  return std::max(0.0, force(step, row) * step.law(row).prescribed_displacement);
}

/// A hand, a motor or a spring whose force is at its limit: what it moves does not go where it is wanted.
bool is_at_limit(const IslandStep& step, std::size_t row) {
  const RowParameters& law = step.law(row);
  constexpr double kAlmost = 1.0 - 1e-9;  // reactions and impulses are added up
  const double impulse = step.f[row] + step.length() * step.reaction[row];
  return law.lower < 0.0 && (law.prescribed_displacement != 0.0 || law.stiffness > 0.0) &&
         (impulse <= kAlmost * law.lower || impulse >= kAlmost * law.upper);
}

/// The force times the way of its point. RowParameters::prescribed_displacement is that way where a spring keeps its
/// length, or where a hard row's gap is met.
double limited_work(const IslandStep& step, std::size_t row) {
  const RowParameters& law = step.law(row);
  const double missed = step.gap[row] - (law.stiffness > 0.0 ? step.start_gap[row] : law.offset);
  return force(step, row) * (law.prescribed_displacement + missed);
}

/// Of what pushes apart what overlaps.
double recovery_work(const IslandStep& step) {
  double work = 0.0, recovery = 0.0;
  for (std::size_t i = 0; i < step.size(); ++i) {
    if (step.law(i).lower != 0.0) continue;
    work += given(step, i);
    recovery = std::max(recovery, step.law(i).prescribed_displacement);
  }
  return std::min(work, largest_recovery_work(step, recovery));
}

}  // namespace

double agent_work(const IslandStep& step) {
  double work = step.rows.stored_energy() + recovery_work(step);
  for (std::size_t i = 0; i < step.size(); ++i) {
    const RowParameters& law = step.law(i);
    if (is_at_limit(step, i)) {
      work += limited_work(step, i);
      continue;
    }
    if (law.lower != 0.0) work += given(step, i);
    // A spring with one bound pushes on one side alone.
    const double before = law.lower == 0.0 ? std::min(step.start_gap[i], 0.0) : step.start_gap[i];
    const double after = law.lower == 0.0 ? std::min(step.gap[i], 0.0) : step.gap[i];
    work += 0.5 * law.stiffness * (before * before - after * after);
  }
  for (const ConstraintRows::Flexibility& g : step.rows.flexibility()) {
    const auto i = static_cast<std::size_t>(g.i), j = static_cast<std::size_t>(g.j);
    work -= (i == j ? 0.5 : 1.0) * g.value * force(step, i) * force(step, j);
  }
  return work;
}

double load_work(const IslandStep& step) {
  double work = 0.0;
  for (Index local = 0; local < step.bodies.count(); ++local) {
    const auto& [group, slot, pose] = step.bodies.body(local);
    const FrameConstants& c = group->frame_constants();
    const RigidFrame &start = group->frame(slot), &end = group->predicted_frame(slot);
    work += group->held_force(slot).dot(end.pose().p - start.pose().p) +
            0.5 * step.length() * group->held_torque(slot).dot(start.angular_velocity(c) + end.angular_velocity(c));
    const std::span<const double> g = group->held_modal_forces(slot), z0 = group->amplitudes(slot),
                                  z1 = group->predicted_amplitudes(slot);
    for (std::size_t i = 0; i < g.size(); ++i) work += g[i] * (z1[i] - z0[i]);
  }
  return work;
}

bool is_workless(const IslandStep& step) {
  if (step.rows.stored_energy() > 0.0) return false;  // indentations that let go
  for (std::size_t i = 0; i < step.size(); ++i) {
    const RowParameters& law = step.law(i);
    if (step.touch_impulse[i] != 0.0) return false;
    if (step.f[i] == 0.0 && step.reaction[i] == 0.0) continue;
    if (!is_equality(law) || law.compliance > 0.0 || law.prescribed_displacement != 0.0) return false;
  }
  return true;
}

}  // namespace limber::internal
