#include "limber/constraints/constraint_rows.h"

#include <algorithm>

namespace limber {

void ConstraintRows::clear() {
  size_ = 0;
  modal_.clear();
  flexibility_.clear();
  stored_energy_ = 0.0;
  ++makings_;
}

/// Rows are written where they stay: a copy of what was written a moment ago would wait for it.
Index ConstraintRows::add(const RowSide& a, const RowSide& b, const RowParameters& law) {
  Row& row = add();
  row.law = law;
  write(a, row.sides[0]);
  write(b, row.sides[1]);
  join(row);
  return size() - 1;
}

/// Those of one body: each has all of its modes, or none.
void ConstraintRows::join_sides(Row& row) {
  auto& [a, b] = row.sides;
  a.linear += b.linear, a.angular += b.angular;
  if (a.modal_count == 0)
    a.modal_begin = b.modal_begin, a.modal_count = b.modal_count;
  else
    for (std::size_t i = 0; i < b.modal_count; ++i) modal_[a.modal_begin + i] += modal_[b.modal_begin + i];
  b = {};
}

void IslandBodies::set(std::span<const ConstrainedBody> table, std::span<const Index> members) {
  members_.assign(members.begin(), members.end());
  bodies_.clear();
  responses_.clear();
  steps_ = {};
  first_.clear();
  degrees_of_freedom_ = 0;
  for (const Index member : members) {
    const ConstrainedBody& body = table[static_cast<std::size_t>(member)];
    bodies_.push_back(body);
    responses_.push_back(body_response(*body.group, body.group->frame(body.slot).pose().q, body.group->modal_step()));
    first_.push_back(degrees_of_freedom_);
    degrees_of_freedom_ += responses_.back().size();
  }
}

void IslandBodies::set_modal_steps(std::span<const ModalStep> steps) {
  steps_ = steps;
  place(StepTime::kStart);
}

void IslandBodies::place(StepTime when) {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    BodyGroup* const group = bodies_[i].group;
    const Index slot = bodies_[i].slot;
    const RigidFrame& frame = when == StepTime::kStart ? group->frame(slot) : group->predicted_frame(slot);
    responses_[i] = body_response(*group, frame.pose().q, modal_step(static_cast<Index>(i)));
  }
}

Index IslandBodies::local(Index body) const {
  const auto found = std::lower_bound(members_.begin(), members_.end(), body);
  return found != members_.end() && *found == body ? static_cast<Index>(found - members_.begin()) : -1;
}

void IslandBodies::write_jacobian(const ConstraintRows& rows, std::span<double> J) const {
  std::fill(J.begin(), J.end(), 0.0);
  const auto width = static_cast<std::size_t>(degrees_of_freedom_);
  for (Index i = 0; i < rows.size(); ++i)
    for (const ConstraintRows::Side& side : rows.row(i).sides) {
      const Index b = local(side.body);
      if (b < 0) continue;
      response(b).add_row(side.linear, side.angular, rows.modal(side),
                          J.data() + static_cast<std::size_t>(i) * width + static_cast<std::size_t>(first(b)));
    }
}

void IslandBodies::write_position_metric(double step, double theta, std::span<double> metric) const {
  for (Index b = 0; b < count(); ++b) response(b).write_position_metric(step, theta, metric.data() + first(b));
}

void IslandBodies::write_velocity_metric(std::span<double> metric) const {
  for (Index b = 0; b < count(); ++b) response(b).write_velocity_metric(metric.data() + first(b));
}

void IslandBodies::write_frame_metric(std::span<double> metric) const {
  for (Index b = 0; b < count(); ++b) response(b).write_frame_metric(metric.data() + first(b));
}

}  // namespace limber
