#include "game_rows.h"

#include <algorithm>
#include <cmath>

#include "../tuning.h"

namespace limber::internal {
namespace {

using Hold = GameRow::Hold;
constexpr double kRecoverySpeed = kConstraintsTuning.small_steps.recovery_speed;

/// A block of a row or of coordinates.
using Block = Eigen::Matrix<double, 8, 1>;
Eigen::Map<const Block> block(const double* at) { return Eigen::Map<const Block>(at); }

}  // namespace

void GameRows::make(const BodyStates& states, const GameBodies& bodies, std::span<Constraint* const> constraints,
                    int number) {
  before_.swap(rows_);
  rows_.clear(), groups_.clear(), numbers_.clear(), led_.clear();
  const SubstepPlan& plan = bodies.plan();
  length_ = plan.length();
  coordinates_ = 8 * bodies.motion().size();
  scales_.assign(bodies.bodies().size(), {});
  goes_on_ = number > 0;
  any_bounded_ = false;
  for (Constraint* constraint : constraints) {
    constraint->begin_part({.length = length_, .left = length_ * (plan.count - number), .whole = plan.step});
    add_group(states, bodies, constraint);
  }
  hold_as_before(plan.step);
  scale_turns();
}

void GameRows::add_group(const BodyStates& states, const GameBodies& bodies, Constraint* constraint) {
  made_.clear();
  constraint->add_rows(states, StepTime::kStart, length_, made_);
  const auto count = static_cast<std::size_t>(made_.size());
  groups_.push_back({.constraint = constraint, .first = rows_.size(), .count = count, .sides = {}});
  if (count == 0) return;
  GameGroup& group = groups_.back();
  for (std::size_t s = 0; s < 2; ++s) add_side(bodies, group, s);
  yields_.assign(count, 0.0);
  for (const ConstraintRows::Flexibility& f : made_.flexibility())
    if (f.i == f.j) yields_[static_cast<std::size_t>(f.i)] += f.value;
  for (std::size_t i = 0; i < count; ++i) add_row(bodies, group, i, yields_[i]);
}

void GameRows::add_side(const GameBodies& bodies, GameGroup& group, std::size_t s) {
  GameSide& side = group.sides[s];
  side.frame = bodies.of(made_.row(0).sides[s].body);
  if (side.frame < 0) return;
  const GameBody& body = bodies.body(side.frame);
  side.body = body.first;
  side.coordinates = 8 * body.blocks;
  side.at = numbers_.size();
  numbers_.resize(numbers_.size() + group.count * static_cast<std::size_t>(side.coordinates));
  for (std::size_t i = 0; i < group.count; ++i) {
    const ConstraintRows::Side& from = made_.row(static_cast<Index>(i)).sides[s];
    write_side(body, from, &numbers_[side.at + i * static_cast<std::size_t>(side.coordinates)]);
    if (body.led >= 0) led_.push_back({group.first + i, side.frame, from.linear, from.angular});
  }
  stiffen(body, group, s);
}

void GameRows::write_side(const GameBody& body, const ConstraintRows::Side& from, double* to) const {
  const double linear = body.root_mass > 0.0 ? length_ / body.root_mass : 0.0;
  const Vec3 turn = body.turn_scale * (length_ * from.angular);
  for (int i = 0; i < 3; ++i) to[i] = linear * body.goes[i] * from.linear[i], to[3 + i] = turn[i];
  const std::span<const double> modal = made_.modal(from);
  for (std::size_t m = 0; m < modal.size(); ++m) to[8 + m] = modal[m] * static_cast<double>(body.modes->roots()[m]);
}

double GameRows::last_force(const GameGroup& group, std::size_t i) const {
  const std::size_t at = group.first + i;
  return goes_on_ && at < before_.size() ? before_[at].force : made_.row(static_cast<Index>(i)).law.last_force;
}

template <class Force>
GameRows::Pull GameRows::pull(const GameGroup& group, std::size_t s, const Force& force) const {
  Pull sum;
  double directions = 0.0;
  for (std::size_t i = 0; i < group.count; ++i) {
    const ConstraintRows::Side& row = made_.row(static_cast<Index>(i)).sides[s];
    sum.force += force(i) * row.linear;
    sum.arm += row.linear.cross(row.angular);  // across each direction: r again in all but one
    directions += row.linear.squaredNorm();
  }
  if (!(directions > 1.5)) return {};
  sum.arm /= directions - 1.0;
  return sum;
}

/// A force F at an arm r that pulls outward turns a body back by k = r·F (1 − f fᵀ), f its direction. In units of the
/// body's inertia, about the axes of its coordinates.
void GameRows::stiffen(const GameBody& body, const GameGroup& group, std::size_t s) {
  const Pull at = pull(group, s, [&](std::size_t i) { return last_force(group, i); });
  const double outward = at.force.dot(at.arm);
  if (!(outward > 0.0)) return;
  const Vec3 along = body.turn_scale * at.force;
  const double by = 1.0 / at.force.squaredNorm();
  Turns& stiffness = scales_[static_cast<std::size_t>(group.sides[s].frame)];
  for (int axis = 0; axis < 3; ++axis)
    stiffness[static_cast<std::size_t>(axis)] +=
        outward * std::max(0.0, body.turn_scale.row(axis).squaredNorm() - by * along[axis] * along[axis]);
}

/// The second derivative of the gaps times their forces, by a turn, is r·F 1 − ½(r Fᵀ + F rᵀ): no more than |r| |F| in
/// any direction.
void GameRows::resist(const GameBody& body, const GameGroup& group, std::size_t s) {
  const Pull at = pull(group, s, [&](std::size_t i) { return rows_[group.first + i].closing; });
  const double most = at.force.norm() * at.arm.norm();
  Turns& stiffness = scales_[static_cast<std::size_t>(group.sides[s].frame)];
  for (int axis = 0; axis < 3; ++axis)
    stiffness[static_cast<std::size_t>(axis)] += 4.0 * most * body.turn_scale.row(axis).squaredNorm();
}

/// From stiffnesses.
void GameRows::scale_turns() {
  for (Turns& scale : scales_)
    for (double& turn : scale) turn = turn > 0.0 ? std::sqrt(1.0 + 0.25 * length_ * length_ * turn) : 1.0;
  for (const GameGroup& group : groups_)
    for (const GameSide& side : group.sides) {
      if (side.frame < 0) continue;
      const Turns& scale = scales_[static_cast<std::size_t>(side.frame)];
      const double by[3] = {1.0 / scale[0], 1.0 / scale[1], 1.0 / scale[2]};
      double* row = &numbers_[side.at];
      for (std::size_t i = 0; i < group.count; ++i, row += side.coordinates)
        for (std::size_t k = 0; k < 3; ++k) row[3 + k] *= by[k];
    }
}

void GameRows::add_row(const GameBodies& bodies, const GameGroup& group, std::size_t i, double yields) {
  const RowParameters& law = made_.row(static_cast<Index>(i)).law;
  const double h = length_;
  GameRow& row = rows_.emplace_back(GameRow{.lower = law.lower / h,
                                            .upper = law.upper / h,
                                            .target = h * law.end_rate,
                                            .compliance = h * law.compliance + yields,
                                            .rate = h * law.end_rate,
                                            .force = law.last_force});
  for (const GameSide& side : group.sides) {
    const double* numbers = this->numbers(side, static_cast<std::int32_t>(i));
    for (std::int32_t b = 1; b < side.coordinates / 8; ++b)
      for (int l = 0; l < 8; ++l)
        row.target +=
            numbers[8 * b + l] * static_cast<double>(bodies.shapes()[static_cast<std::size_t>(side.body + b)].v[l]);
  }
  const bool from_below = law.lower == 0.0, from_above = law.upper == 0.0,
             gives_way = row.is_bounded() && !from_below && !from_above;
  any_bounded_ = any_bounded_ || row.is_bounded();
  row.keeps_place = !law.goes_on && !gives_way && row.compliance == 0.0;
  row.gives_way = !law.goes_on && gives_way && row.compliance == 0.0;
  if (row.compliance > 0.0) {
    row.target += law.offset - law.gap;
  } else if (row.keeps_place) {
    const double inside = from_below ? std::max(law.gap, 0.0) : from_above ? std::min(law.gap, 0.0) : 0.0;
    row.target -= inside;
    row.error = law.gap - inside;
  } else if (!law.goes_on) {  // a hand of limited force, which pulls until its point is where it is wanted
    row.target -= std::clamp(law.gap, -h * kRecoverySpeed, h * kRecoverySpeed);
  }
}

/// Rows with bounds begin as they ended the last substep.
void GameRows::hold_as_before(double step) {
  const bool known = goes_on_ && before_.size() == rows_.size();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    GameRow& row = rows_[i];
    row.left =
        known ? before_[i].left : row.error - std::clamp(row.error, -step * kRecoverySpeed, step * kRecoverySpeed);
    if (known)
      row.hold = before_[i].hold;
    else if (row.is_bounded())
      row.hold = row.force <= row.lower ? Hold::kLower : row.force >= row.upper ? Hold::kUpper : Hold::kMet;
    if (row.hold != Hold::kMet)
      row.force = row.hold == Hold::kLower ? row.lower : row.upper;
    else if (known)
      row.force = before_[i].force;
  }
}

void GameRows::linearise_again(const BodyStates& states, const GameBodies& bodies) {
  scales_.assign(bodies.bodies().size(), {});
  for (const GameGroup& group : groups_) {
    made_.clear();
    group.constraint->add_rows(states, StepTime::kStart, length_, made_);
    for (std::size_t s = 0; s < 2; ++s) {
      const GameSide& side = group.sides[s];
      if (side.frame < 0) continue;
      const GameBody& body = bodies.body(side.frame);
      double* row = &numbers_[side.at];
      for (std::size_t i = 0; i < group.count; ++i, row += side.coordinates)
        write_side(body, made_.row(static_cast<Index>(i)).sides[s], row);
      resist(body, group, s);
    }
  }
  scale_turns();
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

void GameRows::scale(std::span<const RowBody> at, const std::vector<Block8>& y, std::vector<double>& x) const {
  x.resize(coordinates_);
  for (const RowBody& body : at) {
    double* to = &x[static_cast<std::size_t>(8 * body.first)];
    for (std::int32_t b = 0; b < body.blocks; ++b)
      for (int l = 0; l < 8; ++l) to[8 * b + l] = static_cast<double>(y[static_cast<std::size_t>(body.first + b)].v[l]);
    for (std::size_t k = 0; k < 3; ++k) to[3 + k] *= scales_[static_cast<std::size_t>(body.frame)][k];
  }
}

void GameRows::add_energy_slopes(const GameBodies& bodies, std::span<const RowBody> at, const std::vector<Block8>& y,
                                 std::span<const double> more, std::vector<double>& slopes) {
  for (const RowBody& body : at) {
    slope_.resize(static_cast<std::size_t>(8 * body.blocks));
    bodies.write_energy_slopes(body.frame, y, slope_.data());
    for (std::size_t l = 0; l < 6 && !more.empty(); ++l)
      slope_[l] += more[static_cast<std::size_t>(8 * body.first) + l];
    unscale(body, slope_.data());
    double* to = &slopes[static_cast<std::size_t>(8 * body.first)];
    for (std::size_t l = 0; l < slope_.size(); ++l) to[l] += slope_[l];
  }
}

void GameRows::scale_pushes(std::span<const RowBody> at, const std::vector<Block8>& pushes,
                            std::vector<double>& x) const {
  x.assign(coordinates_, 0.0);
  for (const RowBody& body : at) {
    const auto frame = static_cast<std::size_t>(body.frame);
    double* to = &x[static_cast<std::size_t>(8 * body.first)];
    for (std::size_t l = 0; l < 6; ++l)
      to[l] = static_cast<double>(pushes[frame].v[l]) * (l < 3 ? 1.0 : scales_[frame][l - 3]);
  }
}

void GameRows::multiply(const GameGroup& group, std::span<const double> x, double* product) const {
  for (std::size_t i = 0; i < group.count; ++i) {
    double sum = 0.0;
    for (const GameSide& side : group.sides) {
      const double *row = numbers(side, static_cast<std::int32_t>(i)), *from = x.data() + 8 * side.body;
      for (std::int32_t k = 0; k < side.coordinates; k += 8) sum += block(row + k).dot(block(from + k));
    }
    product[i] = sum;
  }
}

void GameRows::add_transposed(const GameGroup& group, const double* forces, std::span<double> x) const {
  for (const GameSide& side : group.sides)
    for (std::int32_t k = 0; k < side.coordinates; k += 8) {
      Eigen::Map<Block> to(x.data() + 8 * side.body + k);
      const double* row = numbers(side, 0) + k;
      const std::int32_t next = side.coordinates;
      std::size_t i = 0;
      for (; i + 3 <= group.count; i += 3, row += 3 * next)  // those of a ball joint in one pass
        to += forces[i] * block(row) + forces[i + 1] * block(row + next) + forces[i + 2] * block(row + 2 * next);
      for (; i < group.count; ++i, row += next) to += forces[i] * block(row);
    }
}

}  // namespace limber::internal
