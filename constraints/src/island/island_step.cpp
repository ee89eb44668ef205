#include "island_step.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace limber::internal {

void IslandLoads::clear(const IslandBodies& bodies) {
  frames.assign(static_cast<std::size_t>(bodies.count()), {});
  modes.assign(static_cast<std::size_t>(bodies.degrees_of_freedom()), 0.0);
  for (Index local = 0; local < bodies.count(); ++local) {
    const BodyResponse& r = bodies.response(local);
    frames[static_cast<std::size_t>(local)].modal = {modes.data() + bodies.first(local) + r.size() - r.modes,
                                                     static_cast<std::size_t>(r.modes)};
  }
}

void IslandLoads::add(const IslandBodies& bodies, const ConstraintRows& rows, std::span<const double> values,
                      double frame_scale, double modal_scale) {
  for (Index i = 0; i < rows.size(); ++i) {
    const double value = values[static_cast<std::size_t>(i)];
    if (value == 0.0) continue;
    for (const ConstraintRows::Side& side : rows.row(i).sides) {
      const Index local = bodies.local(side.body);
      if (local < 0) continue;
      ConstraintLoad& load = frames[static_cast<std::size_t>(local)];
      load.impulse += frame_scale * value * side.linear;
      load.moment += frame_scale * value * side.angular;
      const std::span<const double> shapes = rows.modal(side);
      double* sum = modal(local);
      for (std::size_t k = 0; k < shapes.size(); ++k) sum[k] += modal_scale * value * shapes[k];
    }
  }
}

void IslandStep::begin(const StepPart& of, bool contacts_react) {
  part = of;
  bodies.set(part.table, part.members);
  rows.clear();
  first_row.clear();
  const BodyStates states(part.table);
  const PartOfStep now{.length = length(), .left = part.left, .whole = part.whole_step};
  for (Constraint* constraint : part.constraints) {
    constraint->begin_part(now);
    first_row.push_back(rows.size());
    constraint->add_rows(states, StepTime::kStart, length(), rows);
  }
  first_row.push_back(rows.size());
  const auto m = static_cast<std::size_t>(rows.size());
  start_gap.resize(m), gap.resize(m);
  for (std::vector<double>* impulses : {&f, &reaction, &end_reaction, &touch_impulse, &end_impulse})
    impulses->assign(m, 0.0);
  end_work = end_modal_gain = 0.0;
  find_kind(contacts_react);
  measure(StepTime::kStart, start_gap);
  gap = start_gap;
  set_modal_steps();
}

bool IslandStep::any_law(bool (*holds)(const RowParameters&)) const {
  for (Index i = 0; i < rows.size(); ++i)
    if (holds(rows.row(i).law)) return true;
  return false;
}

void IslandStep::find_kind(bool contacts_react) {
  contacts_alone = !any_law([](const RowParameters& law) { return !law.contact; });
  touches = any_law([](const RowParameters& law) { return law.contact; });
  mean = !contacts_react && !touches;
  loads_at_start = !contacts_react && !mean;
  theta = 1.0;
}

/// Makes the modes go through a part of a step.
void IslandStep::set_modal_steps() {
  if (length() == part.whole_step) return;
  const auto count = static_cast<std::size_t>(bodies.count());
  if (loads.steps.size() < count) loads.steps.resize(count);
  for (Index local = 0; local < bodies.count(); ++local) {
    const ModalModelData& data = bodies.body(local).group->model().data();
    loads.steps[static_cast<std::size_t>(local)].set(data.eigenvalues, data.decays, length(),
                                                     std::numbers::pi / part.whole_step);
  }
  bodies.set_modal_steps(std::span(loads.steps).first(count));
}

void IslandStep::measure(StepTime when, std::vector<double>& into) const {
  const BodyStates states(part.table);
  for (std::size_t i = 0; i < part.constraints.size(); ++i) {
    const auto begin = static_cast<std::size_t>(first_row[i]), end = static_cast<std::size_t>(first_row[i + 1]);
    part.constraints[i]->gaps(states, when, std::span(into).subspan(begin, end - begin));
  }
}

void IslandStep::predict() {
  set_loads();
  predict_under_loads();
}

void IslandStep::set_loads() {
  loads.clear(bodies);
  loads.add(bodies, rows, f, theta, 1.0);
  loads.add(bodies, rows, reaction, 0.5 * length(), length());
}

void IslandStep::predict_under_loads() {
  move_under_loads();
  measure(StepTime::kEnd, gap);
}

void IslandStep::move_under_loads() {
  for (Index local = 0; local < bodies.count(); ++local) {
    const ConstrainedBody& body = bodies.body(local);
    ConstraintLoad& load = loads.frames[static_cast<std::size_t>(local)];
    if (loads_at_start) load_start(local, load);
    body.group->predict(body.slot, held_gravity(local), load, bodies.modal_step(local));
  }
}

/// The frame's part. Modes of a free body do not feel gravity; those of one that is held somewhere have it over the
/// whole part, as they have contact forces.
void IslandStep::load_start(Index local, ConstraintLoad& load) const {
  const ConstrainedBody& body = bodies.body(local);
  const FrameConstants& c = body.group->frame_constants();
  const Vec3 weight = c.mass * gravity_of(local), arm = body.group->frame(body.slot).pose().q * c.center_of_mass;
  load.moment += length() * arm.cross(weight);
  if (c.motion == FrameMotion::kFree)
    load.impulse += length() * (weight + body.group->held_force(body.slot));
  else
    load.torque -= arm.cross(weight);
}

/// What is left of gravity and held forces for the whole part, where those come at its start.
Vec3 IslandStep::held_gravity(Index local) const {
  const ConstrainedBody& body = bodies.body(local);
  if (!loads_at_start || body.group->frame_constants().motion != FrameMotion::kFree) return gravity_of(local);
  return -body.group->held_force(body.slot) / body.group->frame_constants().mass;
}

void IslandStep::linearise(StepTime when, ConstraintRows& to) const {
  to.clear();
  const BodyStates states(part.table);
  for (Constraint* constraint : part.constraints) constraint->add_rows(states, when, length(), to);
}

}  // namespace limber::internal
