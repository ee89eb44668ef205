#include "contact_dents.h"

namespace limber {
namespace {

/// What a force at `j` does at `i`, body frame.
Mat3 flexibility(const ModalModel& model, const SurfacePoint& i, const SurfacePoint& j) {
  const ResidualCompliance& compliance = *model.data().residual_compliance;
  const std::vector<Triangle>& triangles = model.collision().triangles;
  const Triangle &at_i = triangles[static_cast<std::size_t>(i.triangle)],
                 &at_j = triangles[static_cast<std::size_t>(j.triangle)];
  Mat3 G = Mat3::Zero();
  for (std::size_t p = 0; p < 3; ++p)
    for (std::size_t q = 0; q < 3; ++q)
      if (const double weight = i.weight[p] * j.weight[q]; weight != 0.0)
        G += weight * compliance.block(at_i[p], at_j[q]);
  return G;
}

const ModalModel& model_of(const BodyStates& states, Index body) { return states.body(body).group->model(); }

Vec3 displacement_in_body(const ModalModel& model, std::span<const DentLoad> loads, const SurfacePoint& at) {
  Vec3 u = Vec3::Zero();
  for (const DentLoad& load : loads) u += flexibility(model, at, load.at) * load.force;
  return u;
}

}  // namespace

void ContactDents::reserve(std::size_t bodies) {
  if (bodies_.size() < bodies) bodies_.resize(bodies);
}

bool ContactDents::yields(const BodyStates& states, Index body) {
  return !states.is_static(body) && model_of(states, body).data().residual_compliance.has_value();
}

Vec3 ContactDents::displacement(const BodyStates& states, Index body, const SurfacePoint& at) const {
  return states.pose(body, StepTime::kStart).q * displacement_in_body(model_of(states, body), this->at(body).loads, at);
}

void ContactDents::add_rows(const BodyStates& states, Index body, const Rows& side, ConstraintRows& rows) {
  Body& b = at(body);
  // A step may be done again before any force is taken: then rows are counted from the first one again.
  if (!b.gathers || side.first <= b.rows.back().first) {
    b.gathers = true;
    b.rows.clear();
    rows.add_stored_energy(energy(states, body));
  }
  b.rows.push_back(side);
  const ModalModel& model = model_of(states, body);
  for (const Rows& other : b.rows) {
    const Mat3 G = side.axes.transpose() * flexibility(model, side.at, other.at) * other.axes;
    const bool itself = &other == &b.rows.back();
    for (Index p = 0; p < side.count; ++p)
      for (Index q = 0; q < (itself ? p + 1 : other.count); ++q)
        rows.add_flexibility(body, side.first + p, other.first + q, G(p, q));
  }
}

void ContactDents::press(Index body, const DentLoad& load) {
  Body& b = at(body);
  if (b.gathers) {
    b.gathers = false;
    b.loads.clear();
  }
  b.pressed = true;
  if (!load.force.isZero(0.0)) b.loads.push_back(load);
}

void ContactDents::finish(std::span<const char> asleep) {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    Body& b = bodies_[i];
    const bool sleeps = i < asleep.size() && asleep[i] != 0;
    if (!b.pressed && !sleeps) b.loads.clear();
    b.pressed = b.gathers = false;
  }
}

void ContactDents::forget(Index body) {
  if (static_cast<std::size_t>(body) < bodies_.size()) at(body) = {};
}

void ContactDents::clear() { bodies_.clear(); }

std::span<const DentLoad> ContactDents::loads(Index body) const {
  if (static_cast<std::size_t>(body) >= bodies_.size()) return {};
  return at(body).loads;
}

double ContactDents::energy(const BodyStates& states, Index body) const {
  const std::span<const DentLoad> loads = this->loads(body);
  double energy = 0.0;
  for (const DentLoad& load : loads)
    energy += 0.5 * load.force.dot(displacement_in_body(model_of(states, body), loads, load.at));
  return energy;
}

}  // namespace limber
