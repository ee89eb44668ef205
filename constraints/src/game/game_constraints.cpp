#include "game_constraints.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

// Rows are in single precision: what is added to their products so that rows that say the same have an answer.
constexpr double kRounded = 1e-6;

bool is_soft(const GameRow& row) { return row.compliance > 0.0; }
bool is_unbounded(const RowLaw& law) { return law.lower == -kUnbounded && law.upper == kUnbounded; }
/// Whether the gap itself counts, and not its rate alone.
bool keeps_place(const RowLaw& law) { return !law.goes_on && !law.slides && law.radius == 0.0; }

double dot(const Block8& a, const Block8& b) {
  double sum = 0.0;
  for (int i = 0; i < 8; ++i) sum += static_cast<double>(a.v[i]) * static_cast<double>(b.v[i]);
  return sum;
}

}  // namespace

void GameConstraints::make_rows(const BodyStates& states, const GameBodies& bodies,
                                std::span<Constraint* const> constraints, int number) {
  rows_.clear(), groups_.clear(), blocks_.clear();
  wants_push_ = false;
  const SubstepPlan& plan = bodies.plan();
  const double h = plan.length(), left = h * (plan.count - number);
  for (Constraint* constraint : constraints) {
    constraint->begin_part({.length = h, .left = left, .whole = plan.step, .ahead = h});
    add_rows(states, bodies, constraint, h);
  }
}

void GameConstraints::begin_substep(GameBodies& bodies) {
  for (const GameRow& row : rows_) {
    apply(row, row.force, bodies.motion());
    wants_push_ = wants_push_ || row.error != 0.0;
  }
}

void GameConstraints::add_rows(const BodyStates& states, const GameBodies& bodies, Constraint* constraint, double h) {
  made_.clear();
  constraint->add_rows(states, StepTime::kStart, h, made_);
  const auto count = static_cast<std::size_t>(made_.size());
  gaps_.assign(count, 0.0);
  constraint->gaps(states, StepTime::kStart, gaps_);
  yields_.assign(count, 0.0);
  for (const ConstraintRows::Flexibility& f : made_.flexibility())
    if (f.i == f.j) yields_[static_cast<std::size_t>(f.i)] += f.value;
  Group group{.constraint = constraint, .first = rows_.size(), .count = count};
  for (std::size_t i = 0; i < count; ++i) {
    add_row(bodies, made_.row(static_cast<Index>(i)), gaps_[i], yields_[i]);
    const GameRow& row = rows_.back();
    const bool locks = is_unbounded(row.law) && !is_soft(row) && row.mass > 0.0;
    if (locks && group.together < kMostTogether)
      group.equal[static_cast<std::size_t>(group.together++)] = group.first + i;
  }
  lock_together(group);
  groups_.push_back(group);
}

void GameConstraints::add_row(const GameBodies& bodies, const ConstraintRows::Row& from, double gap, double yields) {
  GameRow row{.sides = {}, .law = from.law};
  for (std::size_t s = 0; s < 2; ++s) add_side(bodies, from.sides[s], row.sides[s]);
  find_target(bodies, row, gap, yields);
  rows_.push_back(row);
}

void GameConstraints::add_side(const GameBodies& bodies, const ConstraintRows::Side& from, GameRow::Side& side) {
  side.frame = bodies.of(from.body);
  if (side.frame < 0) return;
  const GameBody& body = bodies.body(side.frame);
  side.rows = static_cast<std::int32_t>(blocks_.size());
  side.body = body.first;
  side.blocks = body.blocks;
  blocks_.resize(blocks_.size() + static_cast<std::size_t>(body.blocks));
  Block8* to = &blocks_[static_cast<std::size_t>(side.rows)];
  bodies.write_frame_row(body, from.linear, from.angular, to[0]);
  const std::span<const double> modal = made_.modal(from);
  for (std::size_t m = 0; m < modal.size(); ++m)
    to[1 + m / 8].v[m % 8] = static_cast<float>(modal[m]) * body.modes->roots()[m];
}

void GameConstraints::find_target(const GameBodies& bodies, GameRow& row, double gap, double yields) const {
  const double h = bodies.plan().length();
  const RowLaw& law = row.law;
  double frames = 0.0, modes = 0.0, bent = 0.0;
  for (std::size_t s = 0; s < 2; ++s) {
    const GameRow::Side& side = row.sides[s];
    for (std::int32_t k = 0; k < side.blocks; ++k) {
      const Block8& part = blocks_[static_cast<std::size_t>(side.rows + k)];
      (k == 0 ? frames : modes) += dot(part, part);
      if (k > 0) bent += dot(part, bodies.shapes()[static_cast<std::size_t>(side.body + k)]);
    }
  }
  row.compliance = h * law.compliance + yields;
  row.mass = frames + modes + row.compliance > 0.0 ? 1.0 / (frames + modes + row.compliance) : 0.0;
  row.push_mass = frames > 0.0 ? 1.0 / frames : 0.0;
  row.wanted = bent + h * law.end_rate;
  if (is_soft(row)) {
    row.wanted += law.offset - gap;
    return;
  }
  row.force = law.last_force;
  if (!keeps_place(law)) return;
  const bool from_below = law.lower == 0.0, from_above = law.upper == 0.0;
  if (from_below || from_above) {
    const double inside = from_below ? std::max(gap, 0.0) : std::min(gap, 0.0);
    row.wanted -= inside;
    row.error = gap - inside;
  } else {
    row.error = gap;
  }
  const double own = frames + modes > 0.0 ? frames / (frames + modes) : 0.0;
  row.wanted -= (1.0 - own) * row.error;
  row.error *= own;
}

void GameConstraints::lock_together(Group& group) const {
  const int n = group.together;
  if (n == 0) return;
  Together products(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j)
      products(i, j) = products(j, i) =
          coupling(rows_[group.equal[static_cast<std::size_t>(i)]], rows_[group.equal[static_cast<std::size_t>(j)]]);
  products.diagonal() *= 1.0 + kRounded;
  group.inverse = products.ldlt().solve(Together::Identity(n, n));
}

double GameConstraints::coupling(const GameRow& row, const GameRow& other) const {
  double sum = 0.0;
  for (const GameRow::Side& side : row.sides)
    for (const GameRow::Side& of_other : other.sides) {
      if (side.frame < 0 || side.frame != of_other.frame) continue;
      for (std::int32_t k = 0; k < side.blocks; ++k)
        sum +=
            dot(blocks_[static_cast<std::size_t>(side.rows + k)], blocks_[static_cast<std::size_t>(of_other.rows + k)]);
    }
  return sum;
}

double GameConstraints::read(const GameRow& row, const std::vector<Block8>& x) const {
  double sum = 0.0;
  for (const GameRow::Side& side : row.sides)
    for (std::int32_t k = 0; k < side.blocks; ++k)
      sum += dot(blocks_[static_cast<std::size_t>(side.rows + k)], x[static_cast<std::size_t>(side.body + k)]);
  return sum;
}

void GameConstraints::apply(const GameRow& row, double force, std::vector<Block8>& x) const {
  const auto by = static_cast<float>(force);
  if (by == 0.0f) return;
  for (const GameRow::Side& side : row.sides)
    for (std::int32_t k = 0; k < side.blocks; ++k) {
      const Block8& part = blocks_[static_cast<std::size_t>(side.rows + k)];
      Block8& to = x[static_cast<std::size_t>(side.body + k)];
      for (int l = 0; l < 8; ++l) to.v[l] += by * part.v[l];
    }
}

/// What is left to be moved.
double GameConstraints::open(const GameRow& row, const GameBodies& bodies) const {
  return row.wanted - read(row, bodies.motion()) - row.compliance * row.force;
}

void GameConstraints::sweep(GameBodies& bodies, bool backward) {
  for (std::size_t i = 0; i < groups_.size(); ++i) solve(groups_[backward ? groups_.size() - 1 - i : i], bodies);
}

void GameConstraints::solve(Group& group, GameBodies& bodies) {
  solve_together(group, bodies);
  const auto end = group.equal.begin() + group.together;
  for (std::size_t at = group.first; at < group.first + group.count;) {
    if (std::find(group.equal.begin(), end, at) != end)
      ++at;
    else
      at += solve_bounded(at, bodies);
  }
}

void GameConstraints::solve_together(Group& group, GameBodies& bodies) {
  const int n = group.together;
  if (n == 0) return;
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostTogether, 1> left(n);
  for (int i = 0; i < n; ++i) left[i] = open(rows_[group.equal[static_cast<std::size_t>(i)]], bodies);
  const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostTogether, 1> change = group.inverse * left;
  for (int i = 0; i < n; ++i) {
    GameRow& row = rows_[group.equal[static_cast<std::size_t>(i)]];
    row.force += change[i];
    apply(row, change[i], bodies.motion());
  }
}

/// @return how many rows were solved for
std::size_t GameConstraints::solve_bounded(std::size_t at, GameBodies& bodies) {
  GameRow& row = rows_[at];
  const double h = bodies.plan().length();
  if (row.law.radius > 0.0) {
    solve_vector(at, 3, row.law.radius / h, bodies);
    return 3;
  }
  const double wanted = row.force + open(row, bodies) * row.mass;
  const double change = std::clamp(wanted, row.law.lower / h, row.law.upper / h) - row.force;
  row.force += change;
  apply(row, change, bodies.motion());
  if (!(row.law.friction > 0.0)) return 1;
  solve_vector(at + 1, 2, row.law.friction * row.force, bodies);
  return 3;
}

/// Rows whose forces are a vector no longer than `radius`, by one step for all.
void GameConstraints::solve_vector(std::size_t first, std::size_t count, double radius, GameBodies& bodies) {
  double trace = 0.0, square = 0.0;
  std::array<double, 3> wanted{};
  for (std::size_t i = 0; i < count; ++i) trace += rows_[first + i].mass > 0.0 ? 1.0 / rows_[first + i].mass : 0.0;
  if (!(trace > 0.0)) return;
  for (std::size_t i = 0; i < count; ++i) {
    wanted[i] = rows_[first + i].force + open(rows_[first + i], bodies) / trace;
    square += wanted[i] * wanted[i];
  }
  const double share = square > radius * radius ? radius / std::sqrt(square) : 1.0;
  for (std::size_t i = 0; i < count; ++i) {
    GameRow& row = rows_[first + i];
    const double change = share * wanted[i] - row.force;
    row.force += change;
    apply(row, change, bodies.motion());
  }
}

void GameConstraints::push_apart(GameBodies& bodies, bool backward) {
  const double most = bodies.plan().length();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    GameRow& row = rows_[backward ? rows_.size() - 1 - i : i];
    if (row.error == 0.0) continue;
    double moved = 0.0;
    for (const GameRow::Side& side : row.sides)
      if (side.frame >= 0)
        moved +=
            dot(blocks_[static_cast<std::size_t>(side.rows)], bodies.pushes()[static_cast<std::size_t>(side.frame)]);
    const double change = (std::clamp(-row.error, -most, most) - moved) * row.push_mass;
    row.push += change;
    for (const GameRow::Side& side : row.sides)
      for (int l = 0; l < 8 && side.frame >= 0; ++l)
        bodies.pushes()[static_cast<std::size_t>(side.frame)].v[l] +=
            static_cast<float>(change) * blocks_[static_cast<std::size_t>(side.rows)].v[l];
  }
}

void GameConstraints::end_substep(const BodyStates& states, GameBodies& bodies) {
  for (const GameRow& row : rows_) apply(row, -row.force, bodies.answers());
  for (const Group& group : groups_) {
    impulses_.clear();
    for (std::size_t i = 0; i < group.count; ++i)
      impulses_.push_back(bodies.plan().length() * rows_[group.first + i].force);
    group.constraint->accept(states, impulses_);
  }
}

double GameConstraints::residual(const GameBodies& bodies) const {
  double largest = 0.0;
  for (const GameRow& row : rows_)
    if (is_unbounded(row.law)) largest = std::max(largest, std::abs(open(row, bodies)));
  return largest;
}

bool GameConstraints::all_finite() const {
  return std::ranges::all_of(rows_, [](const GameRow& row) { return std::isfinite(row.force); });
}

}  // namespace limber::internal
