#include "contact_indentations.h"

#include <algorithm>

namespace limber {
namespace {

const ResidualCompliance& compliance_of(const BodyStates& states, Index body) {
  return *states.body(body).group->model().data().residual_compliance;
}

Vec3 displacement_in_body(const ResidualCompliance& compliance, std::span<const IndentationLoad> loads, Index vertex) {
  const bool local = compliance.form() == ResidualCompliance::Form::kLocal;
  Vec3 u = Vec3::Zero();
  for (const IndentationLoad& load : loads)
    if (!local || load.vertex == vertex) u += compliance.block(vertex, load.vertex) * load.force;
  return u;
}

}  // namespace

std::size_t VertexNumbers::operator()(Index vertex) {
  const auto v = static_cast<std::size_t>(vertex);
  if (known_.size() <= v) known_.resize(v + 1);
  if (known_[v].round != round_) known_[v] = {round_, count_++};
  return known_[v].number;
}

void ContactIndentations::reserve(std::size_t bodies) {
  if (bodies_.size() < bodies) bodies_.resize(bodies);
  loaded_.reserve(bodies_.size());
}

Vec3 ContactIndentations::displacement(const BodyStates& states, Index body, Corners corners) {
  const Body& b = at(body);
  if (b.loads.empty()) return Vec3::Zero();
  const ResidualCompliance& compliance = compliance_of(states, body);
  Vec3 u = Vec3::Zero();
  for (const VertexShare& s : corners) u += s.share * displacement_in_body(compliance, b.loads, s.vertex);
  return u;
}

void ContactIndentations::add_rows(const BodyStates& states, Index body, const Rows& side, ConstraintRows& rows) {
  Body& b = at(body);
  if (b.made_in != &rows || b.making != rows.makings()) {
    b.made_in = &rows, b.making = rows.makings();
    b.gathers = true;
    b.rows.clear();
    b.of_rows.clear();
    b.vertices.clear();
    rows.add_stored_energy(energy(states, body));
  }
  b.rows.push_back(side);
  find_answers(compliance_of(states, body), side.corners, b);
  for (const Rows& other : b.rows) {
    Mat3 answer = Mat3::Zero();
    for (const VertexShare& s : other.corners) answer += s.share * b.answer[b.of_rows(s.vertex)];
    const Mat3 G = other.axes.transpose() * answer * side.axes;
    const bool itself = &other == &b.rows.back();
    // Both sides of one contact, where a body touches itself: each gives to the other's force as well.
    const bool opposite = !itself && other.first == side.first;
    for (Index p = 0; p < side.count; ++p)
      for (Index q = 0; q < (itself ? p + 1 : other.count); ++q)
        rows.add_flexibility(body, side.first + p, other.first + q, (opposite && p == q ? 2.0 : 1.0) * G(q, p));
  }
}

/// Displacements of the vertices of all sides so far by a unit force on one of these.
void ContactIndentations::find_answers(const ResidualCompliance& compliance, Corners corners, Body& b) {
  for (const VertexShare& s : corners)
    if (b.of_rows(s.vertex) == b.vertices.size()) b.vertices.push_back(s.vertex);
  b.answer.assign(b.vertices.size(), Mat3::Zero());
  const bool local = compliance.form() == ResidualCompliance::Form::kLocal;
  for (const VertexShare& s : corners) {
    if (local) b.answer[b.of_rows(s.vertex)] += s.share * compliance.block(s.vertex, s.vertex);
    for (std::size_t v = 0; v < b.vertices.size() && !local; ++v)
      b.answer[v] += s.share * compliance.block(b.vertices[v], s.vertex);
  }
}

void ContactIndentations::press(Index body, Corners corners, const Vec3& force) {
  Body& b = at(body);
  if (b.gathers) {
    b.gathers = false;
    b.loads.clear();
    b.of_loads.clear();
  }
  b.pressed = true;
  if (force.isZero(0.0)) return;
  for (const VertexShare& s : corners) {
    const std::size_t number = b.of_loads(s.vertex);
    if (number == b.loads.size()) b.loads.push_back({.vertex = s.vertex});
    b.loads[number].force += s.share * force;
  }
}

void ContactIndentations::finish(std::span<const char> asleep, std::span<const Index> touched) {
  stirred_.assign(loaded_.begin(), loaded_.end());
  stirred_.insert(stirred_.end(), touched.begin(), touched.end());
  std::ranges::sort(stirred_);
  stirred_.erase(std::unique(stirred_.begin(), stirred_.end()), stirred_.end());
  loaded_.clear();
  for (const Index body : stirred_) {
    if (static_cast<std::size_t>(body) >= bodies_.size()) continue;
    Body& b = at(body);
    const bool sleeps = static_cast<std::size_t>(body) < asleep.size() && asleep[static_cast<std::size_t>(body)] != 0;
    if (!b.pressed && !sleeps) b.loads.clear(), b.of_loads.clear();
    b.pressed = b.gathers = false;
    b.made_in = nullptr;
    if (!b.loads.empty()) loaded_.push_back(body);
  }
}

void ContactIndentations::list_loaded() {
  loaded_.clear();
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (!bodies_[i].loads.empty()) loaded_.push_back(static_cast<Index>(i));
}

void ContactIndentations::forget(Index body) {
  if (static_cast<std::size_t>(body) < bodies_.size()) at(body) = {};
}

void ContactIndentations::clear() {
  bodies_.clear();
  loaded_.clear();
}

std::span<const IndentationLoad> ContactIndentations::loads(Index body) const {
  if (static_cast<std::size_t>(body) >= bodies_.size()) return {};
  return at(body).loads;
}

double ContactIndentations::energy(const BodyStates& states, Index body) const {
  const std::span<const IndentationLoad> loads = this->loads(body);
  double energy = 0.0;
  for (const IndentationLoad& load : loads)
    energy += 0.5 * load.force.dot(displacement_in_body(compliance_of(states, body), loads, load.vertex));
  return energy;
}

}  // namespace limber
