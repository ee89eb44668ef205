#include "game_rows.h"

#include <algorithm>
#include <cmath>

#include "../tuning.h"
#include "limber/core/cross_matrix.h"

namespace limber::internal {
namespace {

using Hold = GameRow::Hold;
constexpr double kRecoverySpeed = kConstraintsTuning.small_steps.recovery_speed;

/// By component, as cross_component().
double inner(const Vec3& u, const Vec3& v) { return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]; }

}  // namespace

void GameRows::make(const BodyStates& states, const GameBodies& bodies, std::span<Constraint* const> constraints,
                    int number) {
  const SubstepPlan& plan = bodies.plan();
  length_ = plan.length(), per_length_ = 1.0 / length_;
  blocks_ = bodies.motion().size();
  stiffness_.assign(bodies.bodies().size(), {});
  led_.clear();
  if (number == 0) rows_.clear(), groups_.clear(), numbers_.clear();
  any_bounded_ = false;
  for (std::size_t g = 0; g < constraints.size(); ++g) {
    constraints[g]->begin_part({.length = length_, .left = length_ * (plan.count - number), .whole = plan.step});
    linearise(states, constraints[g]);
    if (number == 0) add_group(bodies, constraints[g]);
    write_sides(bodies, groups_[g], false);
    for (const ConstraintRows::Flexibility& f : made_.flexibility())
      if (f.i == f.j) made_.row(f.i).law.compliance += f.value / length_;
    for (std::size_t i = 0; i < groups_[g].count; ++i) write_row(bodies, groups_[g], i);
    if (number == 0) hold(groups_[g], plan.step);
  }
  weigh_turns();
}

void GameRows::linearise_again(const BodyStates& states, const GameBodies& bodies) {
  stiffness_.assign(bodies.bodies().size(), {});
  led_.clear();
  for (const GameGroup& group : groups_) {
    linearise(states, group.constraint);
    write_sides(bodies, group, true);
  }
  weigh_turns();
}

void GameRows::linearise(const BodyStates& states, Constraint* constraint) {
  made_.clear();
  constraint->add_rows(states, StepTime::kStart, length_, made_);
}

void GameRows::add_group(const GameBodies& bodies, Constraint* constraint) {
  GameGroup group{.constraint = constraint,
                  .first = static_cast<std::uint32_t>(rows_.size()),
                  .count = static_cast<std::uint32_t>(made_.size()),
                  .sides = {}};
  for (Index i = 0; i < made_.size(); ++i) rows_.push_back({.force = made_.row(i).law.last_force});
  for (std::size_t s = 0; s < 2 && group.count > 0; ++s) {
    GameSide& side = group.sides[s];
    side.frame = bodies.of(made_.row(0).sides[s].body);
    if (side.frame < 0) continue;
    const GameBody& body = bodies.body(side.frame);
    side.body = body.first;
    side.blocks = body.blocks;
    side.at = static_cast<std::int32_t>(numbers_.size());
    numbers_.resize(numbers_.size() + group.count * static_cast<std::size_t>(side.blocks));
  }
  groups_.push_back(group);
}

/// @param closing for GameRow::closing, else for the forces of the substep before
void GameRows::write_sides(const GameBodies& bodies, const GameGroup& group, bool closing) {
  for (std::size_t s = 0; s < 2; ++s) {
    const GameSide& side = group.sides[s];
    if (side.frame < 0) continue;
    const GameBody& body = bodies.body(side.frame);
    const Vec3& shift = body.shift;
    const Mat3 turn = length_ * body.turn_scale;
    Double8* row_of_body = &numbers_[static_cast<std::size_t>(side.at)];
    Pull pull;
    for (std::size_t i = 0; i < group.count; ++i, row_of_body += side.blocks) {
      double* to = row_of_body->v;
      const ConstraintRows::Side& from = made_.row(static_cast<Index>(i)).sides[s];
      const GameRow& row = rows_[group.first + i];
      const double by = closing ? row.closing : row.force;
      for (int k = 0; k < 3; ++k) {
        pull.force[k] += by * from.linear[k];
        pull.arm[k] += cross_component(from.linear, from.angular, k);  // across each direction: r again in all but one
        to[k] = shift[k] * from.linear[k];
        to[3 + k] = turn(k, 0) * from.angular[0] + turn(k, 1) * from.angular[1] + turn(k, 2) * from.angular[2];
      }
      pull.directions += inner(from.linear, from.linear);
      if (body.modes != nullptr) {
        const std::span<const double> modal = made_.modal(from);
        for (std::size_t m = 0; m < modal.size(); ++m)
          to[8 + m] = modal[m] * static_cast<double>(body.modes->roots()[m]);
        std::fill(to + 8 + modal.size(), to + 8 * side.blocks, 0.0);
      }
      if (body.led >= 0) led_.push_back({group.first + i, side.frame, from.linear, from.angular});
    }
    if (!(pull.directions > 1.5)) continue;
    const double per = 1.0 / (pull.directions - 1.0);
    for (int k = 0; k < 3; ++k) pull.arm[k] *= per;
    closing ? resist(body, pull, stiffness_[static_cast<std::size_t>(side.frame)])
            : stiffen(body, pull, stiffness_[static_cast<std::size_t>(side.frame)]);
  }
}

/// A force F at an arm r that pulls outward turns a body back by k = r·F (1 − f fᵀ), f its direction. In units of the
/// body's inertia, about the axes of its coordinates.
void GameRows::stiffen(const GameBody& body, const Pull& at, Turns& stiffness) {
  const double outward = inner(at.force, at.arm);
  if (!(outward > 0.0)) return;
  const double by = 1.0 / inner(at.force, at.force);
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3 row = body.turn_scale.row(axis);
    const double along = inner(row, at.force);
    stiffness[static_cast<std::size_t>(axis)] += outward * std::max(0.0, inner(row, row) - by * along * along);
  }
}

/// The second derivative of the gaps times their forces, by a turn, is r·F 1 − ½(r Fᵀ + F rᵀ): no more than |r| |F| in
/// any direction.
void GameRows::resist(const GameBody& body, const Pull& at, Turns& stiffness) {
  const double most = at.force.norm() * at.arm.norm();
  for (int axis = 0; axis < 3; ++axis)
    stiffness[static_cast<std::size_t>(axis)] += 4.0 * most * body.turn_scale.row(axis).squaredNorm();
}

/// From stiffnesses.
void GameRows::weigh_turns() {
  weights_.resize(stiffness_.size());
  for (std::size_t frame = 0; frame < stiffness_.size(); ++frame) {
    weights_[frame] = kOnes;
    for (std::size_t k = 0; k < 3; ++k) {
      stiffness_[frame][k] *= 0.25 * length_ * length_;
      weights_[frame].v[3 + k] = 1.0 / (1.0 + stiffness_[frame][k]);
    }
  }
}

void GameRows::write_row(const GameBodies& bodies, const GameGroup& group, std::size_t i) {
  const RowParameters& law = made_.row(static_cast<Index>(i)).law;
  const double h = length_, per = per_length_;
  GameRow& row = rows_[group.first + i];
  row.lower = per * law.lower, row.upper = per * law.upper;
  row.target = row.rate = h * law.end_rate;
  row.compliance = h * law.compliance;
  for (const GameSide& side : group.sides)
    for (std::ptrdiff_t b = 1; b < side.blocks; ++b) {
      const Double8& of_row = numbers_.data()[side.at + static_cast<std::ptrdiff_t>(i) * side.blocks + b];
      const Block8& shape = bodies.shapes().data()[side.body + b];
      row.target += Eigen::Map<const Eigen::Matrix<double, 8, 1>>(of_row.v).dot(
          Eigen::Map<const Eigen::Matrix<float, 8, 1>>(shape.v).cast<double>());
    }
  const bool bounded = row.is_bounded(), from_below = law.lower == 0.0, from_above = law.upper == 0.0,
             gives_way = bounded && !from_below && !from_above;
  any_bounded_ = any_bounded_ || bounded;
  row.keeps_place = !law.goes_on && !gives_way && row.compliance == 0.0;
  row.gives_way = !law.goes_on && gives_way && row.compliance == 0.0;
  row.error = 0.0;
  if (row.compliance > 0.0) {
    row.target += law.offset - law.gap;
  } else if (row.keeps_place) {
    const double inside = from_below ? std::max(law.gap, 0.0) : from_above ? std::min(law.gap, 0.0) : 0.0;
    row.target -= inside;
    row.error = law.gap - inside;
  } else if (!law.goes_on) {  // a hand of limited force, which pulls until its point is where it is wanted
    row.target -= std::clamp(law.gap, -h * kRecoverySpeed, h * kRecoverySpeed);
  }
  if (row.hold != Hold::kMet) row.force = row.hold == Hold::kLower ? row.lower : row.upper;
}

/// Of a step's first substep. In the others rows with bounds begin as they ended the last one.
void GameRows::hold(const GameGroup& group, double step) {
  for (GameRow& row : of(group)) {
    row.left = row.error - std::clamp(row.error, -step * kRecoverySpeed, step * kRecoverySpeed);
    if (!row.is_bounded() || (row.force > row.lower && row.force < row.upper)) continue;
    row.hold = row.force <= row.lower ? Hold::kLower : Hold::kUpper;
    row.force = row.hold == Hold::kLower ? row.lower : row.upper;
  }
}

void GameRows::add_what_leads(const GameBodies& bodies) {
  for (const Led& led : led_) {
    const FrameShift& shift = bodies.shifts()[static_cast<std::size_t>(led.frame)];
    for (int i = 0; i < 3; ++i)
      rows_[led.row].target -= led.linear[i] * static_cast<double>(shift.carried[i]) +
                               led.angular[i] * static_cast<double>(shift.carried_turn[i]);
  }
}

// Products ------------------------------------------------------------------------------------------------------------

void GameRows::widen(std::span<const RowBody> at, const std::vector<Block8>& y, std::vector<Double8>& to) const {
  to.resize(blocks_);
  for (const RowBody& body : at)
    for (auto b = static_cast<std::size_t>(body.first), end = b + static_cast<std::size_t>(body.blocks); b < end; ++b)
      for (std::size_t l = 0; l < 8; ++l) to[b].v[l] = static_cast<double>(y[b].v[l]);
}

void GameRows::add_energy_slopes(const GameBodies& bodies, std::span<const RowBody> at, const std::vector<Block8>& y,
                                 std::span<const Double8> more, std::vector<Double8>& slopes) {
  for (const RowBody& body : at) {
    slope_.resize(8 * static_cast<std::size_t>(body.blocks));
    bodies.write_energy_slopes(body.frame, y, slope_.data());
    for (std::size_t l = 0; l < 6 && !more.empty(); ++l) slope_[l] += more[static_cast<std::size_t>(body.first)].v[l];
    for (std::size_t l = 3; l < 6; ++l) slope_[l] *= weights_[static_cast<std::size_t>(body.frame)].v[l];
    double* to = slopes[static_cast<std::size_t>(body.first)].v;
    for (std::size_t l = 0; l < slope_.size(); ++l) to[l] += slope_[l];
  }
}

void GameRows::widen_pushes(std::span<const RowBody> at, const std::vector<Block8>& pushes,
                            std::vector<Double8>& to) const {
  to.assign(blocks_, {});
  for (const RowBody& body : at)
    for (std::size_t l = 0; l < 6; ++l)
      to[static_cast<std::size_t>(body.first)].v[l] =
          static_cast<double>(pushes[static_cast<std::size_t>(body.frame)].v[l]);
}

void GameRows::multiply(std::span<const Double8> y, std::vector<double>& product) const {
  product.resize(rows_.size());
  multiply_rows(arrays(), y.data(), product.data());
}

void GameRows::add_answer(std::span<const double> forces, std::span<Double8> y) const {
  add_answer_of_rows(arrays(), forces.data(), y.data());
}

}  // namespace limber::internal
