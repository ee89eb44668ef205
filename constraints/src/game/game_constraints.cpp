#include "game_constraints.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "../tuning.h"

namespace limber::internal {
namespace {

constexpr SmallStepTuning kTuning = kConstraintsTuning.small_steps;
// What a force may be beyond a bound, and a row open beyond one, for round-off: of the bound, and m or rad.
constexpr double kRounded = 1e-9;

using Hold = GameRow::Hold;

/// Of one block of coordinates.
Eigen::Map<Eigen::Array<double, 8, 1>, Eigen::Aligned64> eight(std::vector<Double8>& from, std::int32_t block) {
  return Eigen::Map<Eigen::Array<double, 8, 1>, Eigen::Aligned64>(from[static_cast<std::size_t>(block)].v);
}
Eigen::Map<Eigen::Array<float, 8, 1>, Eigen::Aligned32> eight(std::vector<Block8>& from, std::int32_t block) {
  return Eigen::Map<Eigen::Array<float, 8, 1>, Eigen::Aligned32>(from[static_cast<std::size_t>(block)].v);
}

/// Of one body.
double* numbers_of(std::vector<Double8>& of_all, const RowBody& body) {
  return of_all[static_cast<std::size_t>(body.first)].v;
}

/// A force within its row's bounds.
double cut_off(GameRow& row, double force) {
  row.cut = force < row.lower - kRounded * std::abs(row.lower) || force > row.upper + kRounded * std::abs(row.upper);
  return row.cut ? std::clamp(force, row.lower, row.upper) : force;
}

/// The s in [0, 1] at which (1 − s)² before + 2 (1 − s) s² both + s⁴ after is least, by bisection of its slope.
double least_open(const GameConstraints::Closing& sums) {
  const auto slope = [&](double s) {
    return -2.0 * (1.0 - s) * sums.before + (4.0 - 6.0 * s) * s * sums.both + 4.0 * s * s * s * sums.after;
  };
  if (slope(1.0) <= 0.0) return 1.0;
  double low = 0.0, high = 1.0;
  for (int i = 0; i < std::numeric_limits<double>::digits; ++i)
    (slope(0.5 * (low + high)) < 0.0 ? low : high) = 0.5 * (low + high);
  return high;
}

}  // namespace

void GameConstraints::make_rows(const BodyStates& states, const GameBodies& bodies,
                                std::span<Constraint* const> constraints, int number) {
  rows_.make(states, bodies, constraints, number);
  if (number == 0) system_.find_graph(bodies, rows_);
}

// Velocities ----------------------------------------------------------------------------------------------------------

void GameConstraints::solve(GameBodies& bodies) {
  if (rows_.groups().empty()) return;
  rows_.add_what_leads(bodies);
  if (std::ranges::any_of(rows_.groups(), [](const GameGroup& group) { return group.constraint->counts_work(); })) {
    slopes_.assign(rows_.blocks(), {});
    rows_.add_energy_slopes(bodies, system_.bodies(), bodies.free_motion(), {}, slopes_);
  } else {
    slopes_.clear();
  }
  rows_.widen(system_.bodies(), bodies.motion(), motion_);
  int round = 0;
  do {
    system_.factor(rows_, false);
    solve_once();
  } while (let_go(++round < kTuning.most_rounds));
  take(bodies.motion());
}

/// The forces with which the rows that hold are met, within their bounds. Only what is found last acts on the motion,
/// whose single precision would lose what rounds find whose rows contradict.
void GameConstraints::solve_once() {
  const std::span<GameRow> rows = rows_.rows();
  moved_.assign(rows_.blocks(), {});
  forces_.assign(rows.size(), 0.0);
  if (rows_.any_bounded() && std::ranges::any_of(rows, [](const GameRow& r) { return r.hold != Hold::kMet; })) {
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (rows[i].hold != Hold::kMet) forces_[i] = rows[i].force;
    rows_.add_answer(forces_, moved_);
    rows_.multiply(moved_, forces_);
  }
  rows_.multiply(motion_, products_);
  right_.resize(system_.size());
  asked_.resize(system_.size());
  system_.for_met(rows_, [&](std::size_t i, std::size_t k) {
    right_[k] = rows[i].target - products_[i] - forces_[i];
    asked_[k] = rows[i].force;
  });
  system_.solve_fully(rows_, asked_, right_);
  forces_.assign(rows.size(), 0.0);
  system_.for_met(rows_, [&](std::size_t i, std::size_t k) {
    forces_[i] = rows[i].force = rows[i].is_bounded() ? cut_off(rows[i], right_[k]) : right_[k];
  });
  rows_.add_answer(forces_, moved_);
}

/// Rows whose forces were cut off stay at that bound, and those at a bound that would go beyond their gaps may take
/// hold. @return whether any did: the others are to be solved for again, as their forces stand against those
bool GameConstraints::let_go(bool takes_hold) {
  if (!rows_.any_bounded()) return false;
  bool changed = false;
  rows_.multiply(moved_, forces_);
  for (std::size_t i = 0; i < forces_.size(); ++i) {
    GameRow& row = rows_.rows()[i];
    if (!row.is_bounded()) continue;
    const Hold before = row.hold;
    if (row.hold == Hold::kMet) {
      if (!row.cut) continue;
      row.hold = row.force == row.lower ? Hold::kLower : Hold::kUpper;
    } else if (takes_hold) {
      const double open = row.target - products_[i] - forces_[i] - row.compliance * row.force,
                   rounded = kRounded * rows_.length();
      if (row.hold == Hold::kLower ? open > rounded : open < -rounded) row.hold = Hold::kMet;
    }
    changed = changed || row.hold != before;
  }
  return changed;
}

/// Adds moved_ to the motion. Twice the energy of what the rows took so, by component.
void GameConstraints::take(std::vector<Block8>& motion) {
  taken_.assign(system_.components(), 0.0);
  limits_.assign(system_.components(), {});
  for (const RowBody& body : system_.bodies()) {
    double& sum = taken_[static_cast<std::size_t>(body.component)];
    sum += rows_.stored(body, moved_[static_cast<std::size_t>(body.first)]);
    for (std::int32_t b = body.first; b < body.first + body.blocks; ++b) sum += eight(moved_, b).square().sum();
  }
  for (std::size_t i = 0; i < forces_.size(); ++i) forces_[i] = rows_.rows()[i].force;
  limit_change(motion_, moved_);
  for (const RowBody& body : system_.bodies())
    for (std::int32_t b = body.first; b < body.first + body.blocks; ++b)
      eight(motion, b) += eight(moved_, b).cast<float>();
}

/// By forces_: leaves as much of y + change as has the energy of limits_ and what the targets' rates give. Rows
/// that meet them give no more, but for the weights of turns.
void GameConstraints::limit_change(std::vector<Double8>& y, std::vector<Double8>& change) {
  const std::span<const GameGroup> groups = rows_.groups();
  for (std::size_t g = 0; g < groups.size(); ++g) {
    double given = 0.0;
    for (std::size_t i = groups[g].first; i < groups[g].first + groups[g].count; ++i)
      given += forces_[i] * rows_.rows()[i].target;
    limits_[system_.component(g)].most += 2.0 * given;
  }
  for (const RowBody& body : system_.bodies()) {
    Limit& limit = limits_[static_cast<std::size_t>(body.component)];
    for (std::int32_t b = body.first; b < body.first + body.blocks; ++b) {
      limit.most += eight(y, b).square().sum();
      limit.has += (eight(y, b) + eight(change, b)).square().sum();
    }
  }
  for (Limit& limit : limits_) {
    const bool within = limit.has <= (1.0 + kTuning.motion_digits) * limit.most;
    limit.share = within ? 1.0 : std::sqrt(std::max(0.0, limit.most) / limit.has);
    limit.has *= limit.share * limit.share;
  }
  for (const RowBody& body : system_.bodies()) {
    const double share = limits_[static_cast<std::size_t>(body.component)].share;
    if (share == 1.0) continue;
    for (std::int32_t b = body.first; b < body.first + body.blocks; ++b)
      eight(change, b) = share * (eight(y, b) + eight(change, b)) - eight(y, b);
  }
}

// Places --------------------------------------------------------------------------------------------------------------

void GameConstraints::close(const BodyStates& states, GameBodies& bodies, bool pushed) {
  if (rows_.groups().empty()) return;
  for (const RowBody& body : system_.bodies())
    for (std::int32_t b = body.first; b < body.first + body.blocks; ++b)
      eight(bodies.answers(), b) -= eight(moved_, b).cast<float>();
  if (rows_.any_bounded() &&
      std::ranges::any_of(rows_.rows(), [](const GameRow& row) { return row.gives_way && row.hold == Hold::kMet; }))
    system_.factor(rows_, true);
  measure(states, bodies, pushed);
  asked_ = right_;
  system_.solve<kColumns>(right_);
  find_shares();
  displace(bodies);
  if (!slopes_.empty()) rows_.add_energy_slopes(bodies, system_.bodies(), bodies.motion(), speed_, slopes_);
}

/// As they are now.
void GameConstraints::find_gaps(const BodyStates& states) {
  gaps_.resize(rows_.rows().size());
  for (const GameGroup& group : rows_.groups())
    group.constraint->gaps(states, StepTime::kStart, std::span(gaps_).subspan(group.first, group.count));
}

/// What the rows that hold are short of: in their rates, by the way they turned, and in places.
void GameConstraints::measure(const BodyStates& states, const GameBodies& bodies, bool pushed) {
  const double most = kTuning.recovery_speed * rows_.length();
  rows_.widen(system_.bodies(), bodies.motion(), motion_);
  rows_.multiply(motion_, products_);
  forces_.assign(rows_.rows().size(), 0.0);
  if (pushed) {
    rows_.widen_pushes(system_.bodies(), bodies.pushes(), pushes_);
    rows_.multiply(pushes_, forces_);
  }
  find_gaps(states);
  right_.assign(kColumns * system_.size(), 0.0);
  system_.for_met(rows_, [&](std::size_t i, std::size_t k) {
    const GameRow& row = rows_.rows()[i];
    double* right = right_.data() + kColumns * k;
    right[kRate] = row.target - products_[i] - row.compliance * row.force;
    if (!row.keeps_place) return;
    const double place = row.error + forces_[i], straight = place - right[kRate];  // the gap as the rows foretell it
    right[kCurve] = straight - (gaps_[i] - row.rate);
    right[kPlace] = -std::clamp(place, -most, most);
  });
}

/// By component, how much of what curves is closed by velocities: as much as takes no more energy than there is.
void GameConstraints::find_shares() {
  const std::span<const GameGroup> groups = rows_.groups();
  given_.assign(taken_.size(), 0.0);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    double& given = given_[system_.component(g)];
    const std::size_t first = system_.first(g);
    for (std::size_t k = first; k < first + system_.met(g).size(); ++k)
      given += asked_[kColumns * k + kCurve] * right_[kColumns * k + kCurve];
  }
  for (std::size_t c = 0; c < given_.size(); ++c)
    given_[c] = given_[c] > taken_[c] ? std::sqrt(taken_[c] / given_[c]) : 1.0;
}

/// By what close() has found.
void GameConstraints::displace(GameBodies& bodies) {
  const std::span<const GameGroup> groups = rows_.groups();
  speed_.assign(rows_.blocks(), {});
  place_.assign(rows_.blocks(), {});
  forces_.assign(rows_.rows().size(), 0.0);
  products_.assign(rows_.rows().size(), 0.0);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const double share = given_[system_.component(g)];
    const double* found = right_.data() + kColumns * system_.first(g);
    for (const std::int32_t at : system_.met(g)) {
      const std::size_t i = groups[g].first + static_cast<std::size_t>(at);
      GameRow& row = rows_.rows()[i];
      const double force = std::clamp(row.force + found[kRate] + share * found[kCurve], row.lower, row.upper);
      forces_[i] = force - row.force;
      row.force = force;
      products_[i] = found[kPlace] + (1.0 - share) * found[kCurve];
      found += kColumns;
    }
  }
  rows_.add_answer(forces_, speed_);
  rows_.add_answer(products_, place_);
  limit_speeds(bodies);
  move(bodies, true);
}

/// What the rows took before, they may give.
void GameConstraints::limit_speeds(const GameBodies& bodies) {
  for (Limit& limit : limits_) limit = {.most = std::max(0.0, limit.most - limit.has)};
  for (const RowBody& body : system_.bodies()) bodies.write_motion(body.frame, numbers_of(motion_, body));
  limit_change(motion_, speed_);
}

/// By speed_ and place_. @param speeds whether there are any
void GameConstraints::move(GameBodies& bodies, bool speeds) {
  for (const RowBody& body : system_.bodies())
    bodies.displace(body.frame, numbers_of(speed_, body), numbers_of(place_, body));
  end_moving(bodies, speeds);
}

void GameConstraints::end_moving(GameBodies& bodies, bool speeds) {
  bodies.end_displacing(speeds);
  for (const RowBody& body : system_.bodies()) bodies.tell(body.frame);
}

void GameConstraints::end_substep(const BodyStates& states, GameBodies& bodies, bool last) {
  if (!slopes_.empty()) rows_.multiply(slopes_, products_);
  for (const GameGroup& group : rows_.groups()) {
    const std::span<const GameRow> rows = rows_.of(group);
    forces_.resize(rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) forces_[i] = rows_.length() * rows[i].force;
    group.constraint->accept(states, forces_);
    if (!group.constraint->counts_work()) continue;
    double work = 0.0;  // energies are squares, so each force takes the mean of the slopes before and after
    for (std::size_t i = 0; i < rows.size(); ++i) work += 0.5 * rows[i].force * products_[group.first + i];
    group.constraint->accept_work(work);
  }
  if (last && !rows_.groups().empty()) close_step(states, bodies);
}

/// By rows made anew: those of the substep's start may even open what turns by a radian within it. Newton's method, as
/// of least displacement: a chain all but straight is closed by its heavy end, not by links thrown out sideways.
void GameConstraints::close_step(const BodyStates& states, GameBodies& bodies) {
  for (GameRow& row : rows_.rows()) row.closing = 0.0;
  find_errors(states);
  for (int round = 0; residual_ > kRounded && round < kTuning.most_closings; ++round) {
    rows_.linearise_again(states, bodies);
    system_.factor(rows_, true);
    close_errors(bodies);
    find_errors(states);
    if (residual_ > kRounded && find_closing_shares()) {
      shorten_closing(bodies);
      find_errors(states);
    }
  }
}

/// By component, what share of the last closing leaves least open: with s of it (1 − s) before + s² after, to second
/// order. @return whether any is less than all
bool GameConstraints::find_closing_shares() {
  closings_.assign(taken_.size(), {});
  const std::span<const GameGroup> groups = rows_.groups();
  for (std::size_t g = 0; g < groups.size(); ++g) {
    Closing& closing = closings_[system_.component(g)];
    for (const std::int32_t i : system_.met(g)) {
      const GameRow& row = rows_.of(groups[g])[static_cast<std::size_t>(i)];
      if (!row.keeps_place) continue;
      const double after = row.hold == Hold::kMet ? row.error : 0.0;
      closing.before += row.error_before * row.error_before;
      closing.both += row.error_before * after;
      closing.after += after * after;
    }
  }
  given_.resize(closings_.size());
  std::ranges::transform(closings_, given_.begin(), least_open);
  return std::ranges::any_of(given_, [](double share) { return share < 1.0; });
}

/// By the shares in `given_`.
void GameConstraints::shorten_closing(GameBodies& bodies) {
  for (const RowBody& body : system_.bodies()) {
    const double back = given_[static_cast<std::size_t>(body.component)] - 1.0;
    double* place = numbers_of(place_, body);
    if (back == 0.0) continue;
    for (std::int32_t l = 0; l < 8 * body.blocks; ++l) place[l] *= back;
    bodies.displace(body.frame, numbers_of(speed_, body), place);
  }
  end_moving(bodies, false);
}

/// Limits hold where they are passed.
void GameConstraints::find_errors(const BodyStates& states) {
  residual_ = 0.0;
  find_gaps(states);
  for (std::size_t i = 0; i < gaps_.size(); ++i) {
    GameRow& row = rows_.rows()[i];
    if (!row.keeps_place) continue;
    row.error_before = std::exchange(row.error, gaps_[i] - row.left);
    if (row.is_bounded()) {
      const bool from_below = row.lower == 0.0, passed = from_below ? row.error < 0.0 : row.error > 0.0;
      row.hold = passed ? Hold::kMet : from_below ? Hold::kLower : Hold::kUpper;
    }
    if (row.hold == Hold::kMet) residual_ = std::max(residual_, std::abs(row.error));
  }
}

void GameConstraints::close_errors(GameBodies& bodies) {
  right_.resize(system_.size());
  asked_.assign(system_.size(), 0.0);
  system_.for_met(rows_, [&](std::size_t i, std::size_t k) {
    const GameRow& row = rows_.rows()[i];
    right_[k] = row.keeps_place ? -row.error : 0.0;
  });
  system_.solve_fully(rows_, asked_, right_);
  speed_.assign(rows_.blocks(), {});
  place_.assign(rows_.blocks(), {});
  forces_.assign(rows_.rows().size(), 0.0);
  system_.for_met(rows_, [&](std::size_t i, std::size_t k) { forces_[i] = rows_.rows()[i].closing = right_[k]; });
  rows_.add_answer(forces_, place_);
  move(bodies, false);
}

bool GameConstraints::all_finite() const {
  return std::ranges::all_of(rows_.rows(), [](const GameRow& row) { return std::isfinite(row.force); });
}

}  // namespace limber::internal
