#include "limber/constraints/handle.h"

#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "limber/core/cross_matrix.h"
#include "limber/core/error.h"
#include "tuning.h"

namespace limber {
namespace {

std::vector<Vec3> all_directions() { return {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()}; }

}  // namespace

void HandleOptions::validate() const {
  const auto number = [](double value, bool open, const char* name, const char* expected) {
    if (!(value >= 0.0) || (open && value == 0.0) || (std::isinf(value) && !open))
      throw InvalidArgument(std::string("HandleOptions: ") + name + " is " + std::to_string(value) + ", expected " +
                            expected);
  };
  number(max_force, true, "max_force", "more than 0");
  number(stiffness, false, "stiffness", "a finite number of at least 0");
  number(damping, false, "damping", "a finite number of at least 0");
  if (damping > 0.0 && stiffness == 0.0)
    throw InvalidArgument("HandleOptions: damping has no effect without a stiffness; give both");
  if (directions.size() > 3)
    throw InvalidArgument("HandleOptions: " + std::to_string(directions.size()) + " directions, expected at most 3");
  for (std::size_t i = 0; i < directions.size(); ++i)
    for (std::size_t j = 0; j <= i; ++j)
      if (!(std::abs(directions[i].dot(directions[j]) - (i == j ? 1.0 : 0.0)) <= 1e-6))
        throw InvalidArgument("HandleOptions: directions " + std::to_string(j) + " and " + std::to_string(i) +
                              " are not orthonormal");
}

Handle::Handle(MaterialFrame point, const Vec3& start, const HandleOptions& options)
    : point_(std::move(point)), options_(options), now_(start), then_(start), next_{.position = start} {
  options_.validate();
  if (options_.directions.empty()) options_.directions = all_directions();
}

void Handle::set_target(const HandleTarget& target) { next_ = target; }

/// The target goes to where it is wanted at an even speed.
void Handle::begin_part(const PartOfStep& part) {
  step_ = part.length, left_ = part.left, whole_ = part.whole;
  then_ = step_ == left_ ? next_.position : Vec3(now_ + step_ / left_ * (next_.position - now_));
}

void Handle::add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) {
  const FrameInstant at = point_.at(states, when);
  const Vec3& p = at.position;
  const Vec3& target = when == StepTime::kStart ? now_ : then_;
  if (when == StepTime::kStart) from_ = p;
  const double arm = (p - at.origin).norm();
  for (std::size_t i = 0; i < options_.directions.size(); ++i) {
    const Vec3& n = options_.directions[i];
    const double gap = n.dot(p - target);
    RowParameters law{.lower = -step * options_.max_force,
                      .upper = step * options_.max_force,
                      .tolerance = distance_tolerance(internal::kConstraintsTuning.rows.hand_tolerance, arm, p),
                      .digits = digits_of(arm + p.norm() + target.norm()),
                      .last_force = last_force_[i]};
    law.gap = gap;
    law.prescribed_displacement = n.dot(then_ - target);
    law.end_rate = n.dot(then_ - now_) / step;
    if (options_.stiffness > 0.0) {
      law.make_spring(options_.stiffness, options_.damping, step, gap);
    } else {
      law.holds = true;
      law.prescribed_displacement -= gap;  // the hand takes the point to where it is wanted
    }
    rows.add(point_.side(at, n, modal_), {}, law);
  }
}

void Handle::gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const {
  const Vec3 off = point_.position(states, when) - (when == StepTime::kStart ? now_ : then_);
  for (std::size_t i = 0; i < gaps.size(); ++i) gaps[i] = options_.directions[i].dot(off);
}

void Handle::add_force_derivative(const BodyStates& states, std::span<const double> impulses,
                                  ForceDerivative& sum) const {
  Vec3 impulse = Vec3::Zero();
  for (std::size_t i = 0; i < impulses.size(); ++i) impulse += impulses[i] * options_.directions[i];
  const Index body = point_.body();
  const Vec3 arm = point_.position(states, StepTime::kEnd) - states.origin(body, StepTime::kEnd);
  sum.add_bending(body, impulse, point_.displacements(states, shapes_));
  sum.add(body, ForceDerivative::Of::kMoment, body, ForceDerivative::By::kTurn,
          0.5 * cross_matrix(impulse) * cross_matrix(arm));
}

void Handle::accept(const BodyStates& states, std::span<const double> impulses) {
  if (left_ == whole_) force_ = Vec3::Zero(), work_ = 0.0;   // the step's first part
  const Vec3 p = point_.position(states, StepTime::kStart);  // the state has been taken: the step's end
  part_work_ = 0.0;
  for (std::size_t i = 0; i < impulses.size(); ++i) {
    last_force_[i] = impulses[i] / step_;
    force_ += impulses[i] / whole_ * options_.directions[i];
    part_work_ += last_force_[i] * options_.directions[i].dot(p - from_);
  }
  work_ += part_work_;
  now_ = then_;
  if (step_ == left_) next_.position += whole_ * next_.velocity;
}

double Handle::error(const BodyStates& states) const {
  const Vec3 apart = point_.position(states, StepTime::kStart) - now_;
  Vec3 off = Vec3::Zero();
  for (const Vec3& direction : options_.directions) off += direction.dot(apart) * direction;
  return off.norm();
}

}  // namespace limber
