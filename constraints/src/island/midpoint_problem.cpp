#include "midpoint_problem.h"
#include "../tuning.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {

bool MidpointProblem::measure(const IslandStep& step, MidpointMotion& motion, std::span<const double> impulses) {
  motion.take_rows(step, now_);
  bool met = motion.find_residual(now_, impulses, residual_, modal_residual_);
  find_off(step, impulses);
  gap_change_.setZero(off_.size());
  find_responses(step, motion);
  worst_contact_ = 0.0;
  step.for_units(
      [&](std::size_t first, std::size_t count) { met = is_met(step, first, count, impulses, motion) && met; });
  return met;
}

void MidpointProblem::find_off(const IslandStep& step, std::span<const double> impulses) {
  off_.resize(static_cast<Eigen::Index>(now_.size()));
  for (std::size_t i = 0; i < now_.size(); ++i)
    off_[static_cast<Eigen::Index>(i)] = step.gap[i] - step.law(i).offset + step.law(i).compliance * impulses[i];
  for (const ConstraintRows::Flexibility& g : step.rows.flexibility()) {
    off_[g.i] += g.value / step.length() * impulses[static_cast<std::size_t>(g.j)];
    if (g.i != g.j) off_[g.j] += g.value / step.length() * impulses[static_cast<std::size_t>(g.i)];
  }
}

/// By responses as they were measured last. Of a soft row with compliance c the force is off, too: the share a/(a + c)
/// of its distance is that of the gap, with a what an impulse moves the gap by.
double MidpointProblem::largest_distance(const IslandStep& step, std::span<const double> impulses) {
  find_off(step, impulses);
  double largest = 0.0;
  step.for_units([&](std::size_t first, std::size_t count) {
    const RowParameters& law = step.law(first);
    const double moved = 1.0 - law.compliance / response_[first];
    largest = std::max(largest,
                       moved * distance_from_law(step, first, count, impulses) / std::max(law.tolerance, law.digits));
  });
  return largest;
}

/// The natural residual, a distance, as in rounds.
double MidpointProblem::distance_from_law(const IslandStep& step, std::size_t first, std::size_t count,
                                          std::span<const double> impulses) const {
  const RowParameters& law = step.law(first);
  Vec3 impulse = Vec3::Zero(), open = Vec3::Zero();
  for (std::size_t r = 0; r < count; ++r) {
    impulse[static_cast<int>(r)] = impulses[first + r];
    open[static_cast<int>(r)] = off_[static_cast<Eigen::Index>(first + r)];
  }
  if (law.friction > 0.0) open[0] += law.friction * open.tail<2>().norm();
  ContactPotential natural = set_of(law);
  natural.compliance = response_[first];
  return response_[first] * (natural.natural(open, impulse) - impulse).norm();
}

/// Whether the law is met, with the modes where they are wanted.
bool MidpointProblem::is_met(const IslandStep& step, std::size_t first, std::size_t count,
                             std::span<const double> impulses, const MidpointMotion& motion) {
  const RowParameters& law = step.law(first);
  const double least = std::max(law.digits, kConstraintsTuning.midpoint.met * law.tolerance);
  bool bent_as_wanted = true;
  for (std::size_t r = 0; r < count; ++r)
    bent_as_wanted = bent_as_wanted && std::abs(bent(motion, now_[first + r], modal_residual_)) <= least;
  const double left = distance_from_law(step, first, count, impulses);
  if (law.contact) worst_contact_ = std::max(worst_contact_, left / law.tolerance);
  return bent_as_wanted && left <= least;
}

/// Where the bodies are.
void MidpointProblem::find_responses(const IslandStep& step, const MidpointMotion& motion) {
  response_.resize(now_.size());
  for (std::size_t i = 0; i < now_.size(); ++i)
    response_[i] = motion.mobility(now_[i]) + motion.through_modes(now_[i], now_[i]) + step.law(i).compliance;
  for (const ConstraintRows::Flexibility& g : step.rows.flexibility())
    if (g.i == g.j) response_[static_cast<std::size_t>(g.i)] += g.value / step.length();
  step.for_units([&](std::size_t first, std::size_t count) {
    double& response = response_[first];
    for (std::size_t r = 1; r < count; ++r) response += response_[first + r];
    response = response > 0.0 ? response / static_cast<double>(count) : 1.0;
  });
}

bool MidpointProblem::linearise(const IslandStep& step, MidpointMotion& motion, std::span<const double> impulses) {
  rows_ = now_;
  motion.find_derivative(step, impulses, K_);
  motion.condense(K_, rows_);
  stiffen(step, motion);
  const auto n = static_cast<std::size_t>(K_.rows());
  if (!factor_.factor(numbers(K_), n)) return false;
  aim(motion);
  return std::isfinite(stopped_.sum());
}

void MidpointProblem::aim(const MidpointMotion& motion) {
  motion.condense(modal_residual_, residual_);
  stopped_ = -residual_;
  factor_.solve(numbers(stopped_), 1);
}

/// Rows without bounds stand in as springs γ for what they hold: forces that pull a body away from its place, as a
/// pushed rod's do, would else make its matrix singular. With a the gap that an impulse on the row alone makes, γ is
/// 1/a and more where forces are large.
void MidpointProblem::stiffen(const IslandStep& step, const MidpointMotion& motion) {
  const Eigen::Index m = off_.size();
  stiffness_.setZero(m);
  const double harder = 1.0 + motion.force_to_inertia(K_);
  for (Eigen::Index i = 0; i < m; ++i) {
    const MidpointRow& row = rows_[static_cast<std::size_t>(i)];
    const double by_frames = motion.mobility(row), a = by_frames + motion.through_modes(row, row);
    if (!(by_frames > 0.0) || !is_equality(step.law(static_cast<std::size_t>(i)))) continue;
    stiffness_[i] = harder / a;
    row.for_sides([&](const MidpointRow::Side& pushed) {
      row.for_sides([&](const MidpointRow::Side& measured) {
        K_.block<6, 6>(6 * pushed.body, 6 * measured.body).noalias() +=
            stiffness_[i] * pushed.force * measured.gap.transpose();
      });
    });
  }
}

/// E x of one row.
double MidpointProblem::gap_of(Index row, const Vector& x) const {
  double sum = 0.0;
  at(row).for_sides([&](const MidpointRow::Side& side) { sum += side.gap.dot(x.segment<6>(6 * side.body)); });
  return sum;
}

/// What modal loads make of a row's gap.
double MidpointProblem::bent(const MidpointMotion& motion, const MidpointRow& row, const Vector& load) {
  double sum = 0.0;
  row.for_sides([&](const MidpointRow::Side& side) {
    const Index first = motion.first_mode(side.body);
    for (std::size_t k = 0; k < side.modal_gap.size(); ++k) {
      const Index mode = first + static_cast<Index>(k);
      sum += side.modal_gap[k] * motion.modal_response()[mode] * load[mode];
    }
  });
  return sum;
}

void MidpointProblem::reduce(const IslandStep& step, const MidpointMotion& motion, std::span<const Index> rows,
                             RowMatrix& to) {
  const auto m = static_cast<Eigen::Index>(rows.size());
  auto moved = moved_.resize(K_.rows(), m), made = made_.resize(m, m), through = through_.resize(m, m),
       A = to.resize(m, m);
  moved.setZero(), made.setZero();
  for (Eigen::Index j = 0; j < m; ++j)
    at(rows[j]).for_sides([&](const MidpointRow::Side& side) { moved.block<6, 1>(6 * side.body, j) += side.force; });
  factor_.solve(moved_.numbers(), rows.size());
  for (Eigen::Index i = 0; i < m; ++i)
    at(rows[i]).for_sides([&](const MidpointRow::Side& side) {
      made.row(i).noalias() += side.gap.transpose() * moved.middleRows<6>(6 * side.body);
    });
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index j = 0; j < m; ++j) through(i, j) = motion.through_modes(at(rows[i]), at(rows[j]));
    through(i, i) += step.law(static_cast<std::size_t>(rows[i])).compliance;
  }
  add_flexibility(step, rows, through);
  A = made + through;
  for (Eigen::Index i = 0; i < m; ++i)
    for (Eigen::Index j = 0; j < m; ++j)
      if (const double softer = through(i, j) * stiffness_[rows[j]]; softer != 0.0) A.row(i) -= softer * made.row(j);
}

/// What bodies yield beyond their modes.
void MidpointProblem::add_flexibility(const IslandStep& step, std::span<const Index> rows, Eigen::Ref<Matrix> to) {
  if (step.rows.flexibility().empty()) return;
  place_.assign(now_.size(), -1);
  for (std::size_t k = 0; k < rows.size(); ++k) place_[static_cast<std::size_t>(rows[k])] = static_cast<Index>(k);
  for (const ConstraintRows::Flexibility& g : step.rows.flexibility()) {
    const Index i = place_[static_cast<std::size_t>(g.i)], j = place_[static_cast<std::size_t>(g.j)];
    if (i < 0 || j < 0) continue;
    to(i, j) += g.value / step.length();
    if (i != j) to(j, i) += g.value / step.length();
  }
}

void MidpointProblem::find_open(const MidpointMotion& motion, std::span<const Index> rows, RowVector& to) const {
  const auto m = static_cast<Eigen::Index>(rows.size());
  auto open = to.resize(m);
  for (Eigen::Index i = 0; i < m; ++i)
    open[i] = off_[rows[i]] + gap_of(rows[i], stopped_) - bent(motion, at(rows[i]), modal_residual_);
  for (Eigen::Index j = 0; j < m; ++j) open -= stiffness_[rows[j]] * gap_of(rows[j], stopped_) * through_.view().col(j);
}

void MidpointProblem::answer(const MidpointMotion& motion, std::span<const Index> rows, const RowVector& change,
                             MidpointChange& to) {
  const Eigen::Index m = off_.size();
  to.motion = stopped_;
  to.motion.noalias() += moved_.view() * change.view();
  gap_change_.resize(m), to.impulses.setZero(m);
  for (Eigen::Index i = 0; i < m; ++i) gap_change_[i] = gap_of(static_cast<Index>(i), to.motion);
  to.load = -modal_residual_;
  for (std::size_t j = 0; j < rows.size(); ++j) {
    const double by = change[static_cast<Eigen::Index>(j)] - stiffness_[rows[j]] * gap_change_[rows[j]];
    to.impulses[rows[j]] = by;
    at(rows[j]).for_sides([&](const MidpointRow::Side& side) {
      const Index first = motion.first_mode(side.body);
      for (std::size_t k = 0; k < side.modal_force.size(); ++k)
        to.load[first + static_cast<Index>(k)] += by * side.modal_force[k];
    });
  }
  for (Eigen::Index i = 0; i < m; ++i) gap_change_[i] += bent(motion, at(static_cast<Index>(i)), to.load);
  motion.add_turned(to.motion, to.load);
}

}  // namespace limber::internal
