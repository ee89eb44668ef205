#include "game_constraints.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace limber::internal {
namespace {

// Rounds in which rows may take hold as well as let go; after that they let go alone, so that rounds end.
constexpr int kMostRounds = 4;
// Steps of conjugate gradients where the factor has left something out.
constexpr int kMostGradients = 8;
// m/s and rad/s: what is out of place comes together this fast.
constexpr double kRecoverySpeed = 1.0;
// What a force may be beyond a bound, and a row open beyond one, for round-off: of the bound, and m or rad.
constexpr double kRounded = 1e-9;

using Hold = GameRow::Hold;

bool is_bounded(const GameRow& row) { return row.lower != -kUnbounded || row.upper != kUnbounded; }

double dot(const double* a, const double* b, std::int32_t count) {
  double sum[4] = {};
  for (std::int32_t i = 0; i < count; i += 4)
    for (int l = 0; l < 4; ++l) sum[l] += a[i + l] * b[i + l];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

}  // namespace

// Rows ----------------------------------------------------------------------------------------------------------------

void GameConstraints::make_rows(const BodyStates& states, const GameBodies& bodies,
                                std::span<Constraint* const> constraints, int number) {
  std::swap(rows_, before_);
  rows_.clear(), groups_.clear(), numbers_.clear(), led_.clear();
  const SubstepPlan& plan = bodies.plan();
  const double h = plan.length(), left = h * (plan.count - number);
  length_ = h;
  scales_.assign(bodies.bodies().size(), {});
  goes_on_ = number > 0;
  for (Constraint* constraint : constraints) {
    constraint->begin_part({.length = h, .left = left, .whole = plan.step, .ahead = h});
    add_rows(states, bodies, constraint, h);
  }
  hold_as_before(number);
  scale_turns();
  if (number == 0) find_graph(bodies);
  for (Group& group : groups_) {
    const std::int32_t frame = std::max(group.sides[0].frame, group.sides[1].frame);
    group.component = frame < 0 ? 0 : roots_[static_cast<std::size_t>(frame)];
  }
}

void GameConstraints::add_rows(const BodyStates& states, const GameBodies& bodies, Constraint* constraint, double h) {
  made_.clear();
  constraint->add_rows(states, StepTime::kStart, h, made_);
  const auto count = static_cast<std::size_t>(made_.size());
  yields_.assign(count, 0.0);
  for (const ConstraintRows::Flexibility& f : made_.flexibility())
    if (f.i == f.j) yields_[static_cast<std::size_t>(f.i)] += f.value;
  groups_.push_back({.constraint = constraint, .first = rows_.size(), .count = count, .sides = {}});
  add_sides(bodies, groups_.back());
  for (std::size_t i = 0; i < count; ++i) add_row(bodies, groups_.back(), i);
}

void GameConstraints::add_sides(const GameBodies& bodies, Group& group) {
  for (std::size_t s = 0; s < 2 && group.count > 0; ++s) {
    Side& side = group.sides[s];
    side.frame = bodies.of(made_.row(0).sides[s].body);
    if (side.frame < 0) continue;
    const GameBody& body = bodies.body(side.frame);
    side.body = body.first;
    side.coordinates = 8 * body.blocks;
    side.at = numbers_.size();
    numbers_.resize(numbers_.size() + group.count * static_cast<std::size_t>(side.coordinates));
    for (std::size_t i = 0; i < group.count; ++i) {
      const ConstraintRows::Side& from = made_.row(static_cast<Index>(i)).sides[s];
      write_side(bodies, from, &numbers_[side.at + i * static_cast<std::size_t>(side.coordinates)]);
      if (body.led >= 0) led_.push_back({group.first + i, side.frame, from.linear, from.angular});
    }
    stiffen(bodies, group, s);
  }
}

double GameConstraints::last_force(const Group& group, std::size_t i) const {
  const std::size_t at = group.first + i;
  return goes_on_ && at < before_.size() ? before_[at].force : made_.row(static_cast<Index>(i)).law.last_force;
}

/// A force F at an arm r that pulls outward turns a body back by k = r·F (1 − f fᵀ), f its direction. In units of the
/// body's inertia, about the axes of its coordinates.
void GameConstraints::stiffen(const GameBodies& bodies, const Group& group, std::size_t s) {
  Vec3 force = Vec3::Zero(), arms = Vec3::Zero();
  double directions = 0.0;
  for (std::size_t i = 0; i < group.count; ++i) {
    const ConstraintRows::Side& row = made_.row(static_cast<Index>(i)).sides[s];
    force += last_force(group, i) * row.linear;
    arms += row.linear.cross(row.angular);  // those across each direction: r again in all but one
    directions += row.linear.squaredNorm();
  }
  const double size = force.norm(), outward = directions > 1.5 ? force.dot(arms) / (directions - 1.0) : 0.0;
  if (!(outward > 0.0)) return;
  const std::int32_t frame = group.sides[s].frame;
  const Mat3& turn = bodies.body(frame).turn_scale;
  const Vec3 along = turn * (force / size);
  for (int axis = 0; axis < 3; ++axis)
    scales_[static_cast<std::size_t>(frame)][static_cast<std::size_t>(3 + axis)] +=
        outward * std::max(0.0, turn.row(axis).squaredNorm() - along[axis] * along[axis]);
}

/// The turn of a stretched link comes as by the trapezoidal rule: I + ¼h²k in place of I. Without that a link that
/// turns to and fro faster than 2 radians a substep would be thrown about.
void GameConstraints::scale_turns() {
  unscales_ = scales_;
  for (std::size_t frame = 0; frame < scales_.size(); ++frame)
    for (std::size_t k = 0; k < 8; ++k) {
      const double stiffness = scales_[frame][k];
      unscales_[frame][k] = std::sqrt(1.0 + 0.25 * length_ * length_ * stiffness);
      scales_[frame][k] = 1.0 / unscales_[frame][k];
    }
  for (const Group& group : groups_)
    for (const Side& side : group.sides) {
      if (side.frame < 0) continue;
      for (std::size_t i = 0; i < group.count; ++i) {
        double* numbers = &numbers_[side.at + i * static_cast<std::size_t>(side.coordinates)];
        for (std::size_t k = 3; k < 6; ++k) numbers[k] *= scales_[static_cast<std::size_t>(side.frame)][k];
      }
    }
}

void GameConstraints::write_side(const GameBodies& bodies, const ConstraintRows::Side& from, double* to) const {
  const GameBody& body = bodies.body(bodies.of(from.body));
  const double h = bodies.plan().length();
  const Vec3 turn = h * (body.turn_scale * from.angular);
  for (int i = 0; i < 3; ++i) {
    to[i] = body.root_mass > 0.0 ? h / body.root_mass * from.linear[i] : 0.0;
    to[3 + i] = turn[i];
  }
  const std::span<const double> modal = made_.modal(from);
  for (std::size_t m = 0; m < modal.size(); ++m) to[8 + m] = modal[m] * static_cast<double>(body.modes->roots()[m]);
}

void GameConstraints::add_row(const GameBodies& bodies, const Group& group, std::size_t i) {
  const RowLaw& law = made_.row(static_cast<Index>(i)).law;
  const double h = bodies.plan().length();
  GameRow row{.lower = law.lower / h,
              .upper = law.upper / h,
              .compliance = h * law.compliance + yields_[i],
              .gap = law.gap,
              .rate = h * law.end_rate,
              .force = law.last_force};
  row.target = row.rate;
  for (const Side& side : group.sides) {
    const double* numbers = numbers_.data() + side.at + i * static_cast<std::size_t>(side.coordinates);
    for (std::int32_t k = 8; k < side.coordinates; ++k)
      row.target +=
          numbers[k] * static_cast<double>(bodies.shapes()[static_cast<std::size_t>(side.body + k / 8)].v[k % 8]);
  }
  const bool from_below = law.lower == 0.0, from_above = law.upper == 0.0,
             gives_way = is_bounded(row) && !from_below && !from_above;
  row.keeps_place = !law.goes_on && !gives_way && row.compliance == 0.0;
  row.gives_way = !law.goes_on && gives_way && row.compliance == 0.0;
  if (row.compliance > 0.0) {
    row.target += law.offset - row.gap;
  } else if (row.keeps_place) {
    const double inside = from_below ? std::max(row.gap, 0.0) : from_above ? std::min(row.gap, 0.0) : 0.0;
    row.target -= inside;
    row.error = row.gap - inside;
  } else if (!law.goes_on) {  // a hand of limited force, which pulls until its point is where it is wanted
    row.target -= std::clamp(row.gap, -h * kRecoverySpeed, h * kRecoverySpeed);
  }
  rows_.push_back(row);
}

/// Rows with bounds begin as they ended the last substep.
void GameConstraints::hold_as_before(int number) {
  const bool known = number > 0 && before_.size() == rows_.size();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    GameRow& row = rows_[i];
    if (known) {
      row.hold = before_[i].hold;
      row.force = before_[i].force;
    } else if (is_bounded(row)) {
      row.hold = row.force <= row.lower ? Hold::kLower : row.force >= row.upper ? Hold::kUpper : Hold::kMet;
    }
    row.force = row.hold == Hold::kLower ? row.lower : row.hold == Hold::kUpper ? row.upper : 0.0;
  }
}

void GameConstraints::find_graph(const GameBodies& bodies) {
  incident_.clear();
  graph_.clear();
  for (std::size_t g = 0; g < groups_.size(); ++g)
    for (const Side& side : groups_[g].sides)
      if (side.frame >= 0) incident_.push_back({side.frame, static_cast<std::int32_t>(g)});
  std::ranges::sort(incident_);
  frames_.clear();
  for (const auto& [frame, group] : incident_)
    if (frames_.empty() || frames_.back() != frame) frames_.push_back(frame);
  for (std::size_t i = 0; i < incident_.size(); ++i)
    for (std::size_t j = i + 1; j < incident_.size() && incident_[j][0] == incident_[i][0]; ++j)
      if (incident_[i][1] != incident_[j][1]) graph_.push_back({incident_[i][1], incident_[j][1]});
  std::ranges::sort(graph_);
  graph_.erase(std::unique(graph_.begin(), graph_.end()), graph_.end());
  factor_.set_graph(groups_.size(), graph_);
  find_components(bodies);
}

void GameConstraints::find_components(const GameBodies& bodies) {
  roots_.resize(bodies.bodies().size());
  std::iota(roots_.begin(), roots_.end(), 0);
  const auto root = [&](std::int32_t frame) {
    while (roots_[static_cast<std::size_t>(frame)] != frame) {
      std::int32_t& up = roots_[static_cast<std::size_t>(frame)];
      up = roots_[static_cast<std::size_t>(up)];
      frame = up;
    }
    return frame;
  };
  for (const Group& group : groups_) {
    const std::int32_t a = group.sides[0].frame, b = group.sides[1].frame;
    if (a >= 0 && b >= 0) roots_[static_cast<std::size_t>(std::max(root(a), root(b)))] = std::min(root(a), root(b));
  }
  for (std::size_t frame = 0; frame < roots_.size(); ++frame) roots_[frame] = root(static_cast<std::int32_t>(frame));
}

/// What moves a led body in the substep whatever acts.
void GameConstraints::add_what_leads(const GameBodies& bodies) {
  for (const Led& led : led_) {
    const FrameShift& shift = bodies.shifts()[static_cast<std::size_t>(led.frame)];
    for (int i = 0; i < 3; ++i)
      rows_[led.row].target -= led.linear[i] * static_cast<double>(shift.carried[i]) +
                               led.angular[i] * static_cast<double>(shift.carried_turn[i]);
  }
}

// The matrix ----------------------------------------------------------------------------------------------------------

/// @param closing places: what a hand of limited force asks for may contradict them
void GameConstraints::list_met(bool closing) {
  met_.clear(), sizes_.clear();
  for (Group& group : groups_) {
    group.first_met = met_.size();
    for (std::size_t i = 0; i < group.count; ++i)
      if (const GameRow& row = rows_[group.first + i]; row.hold == Hold::kMet && !(closing && row.gives_way))
        met_.push_back(static_cast<std::int32_t>(i));
    group.met = static_cast<std::int32_t>(met_.size() - group.first_met);
    sizes_.push_back(group.met);
  }
}

void GameConstraints::factor(bool closing) {
  list_met(closing);
  factor_.begin(sizes_);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    double* to = factor_.diagonal(g);
    for (const Side& side : group.sides)
      if (side.frame >= 0) add_products(group, group, side, side, to);
    for (std::int32_t i = 0; i < group.met; ++i) {
      double& own = to[i * group.met + i];
      own +=
          rows_[group.first + static_cast<std::size_t>(met_[group.first_met + static_cast<std::size_t>(i)])].compliance;
      if (!(own > 0.0)) own = 1.0;  // nothing that it acts on moves
    }
  }
  for (std::size_t c = 0; c < graph_.size(); ++c) {
    const std::int32_t rows = factor_.rows_of(c), columns = graph_[c][0] == rows ? graph_[c][1] : graph_[c][0];
    const Group &of_rows = groups_[static_cast<std::size_t>(rows)],
                &of_columns = groups_[static_cast<std::size_t>(columns)];
    double* to = factor_.block(c);
    for (const Side& a : of_rows.sides)
      for (const Side& b : of_columns.sides)
        if (a.frame >= 0 && a.frame == b.frame) add_products(of_rows, of_columns, a, b, to);
  }
  factor_.factor();
}

void GameConstraints::add_products(const Group& of_rows, const Group& of_columns, const Side& a, const Side& b,
                                   double* to) const {
  const std::int32_t *rows = &met_[of_rows.first_met], *columns = &met_[of_columns.first_met];
  for (std::int32_t i = 0; i < of_rows.met; ++i)
    for (std::int32_t j = 0; j < of_columns.met; ++j)
      to[i * of_columns.met + j] +=
          dot(numbers_.data() + a.at + static_cast<std::size_t>(rows[i] * a.coordinates),
              numbers_.data() + b.at + static_cast<std::size_t>(columns[j] * b.coordinates), a.coordinates);
}

double GameConstraints::read(const Group& group, std::size_t i, const std::vector<Block8>& x) const {
  double sum[4] = {};
  for (const Side& side : group.sides) {
    if (side.frame < 0) continue;
    const double* numbers = numbers_.data() + side.at + i * static_cast<std::size_t>(side.coordinates);
    const Block8* at = x.data() + side.body;
    const double* unscale = unscales_[static_cast<std::size_t>(side.frame)].data();
    for (int l = 0; l < 8; ++l) sum[l % 4] += numbers[l] * unscale[l] * static_cast<double>(at->v[l]);
    for (std::int32_t k = 8; k < side.coordinates; k += 8)
      for (int l = 0; l < 8; ++l) sum[l % 4] += numbers[k + l] * static_cast<double>(at[k / 8].v[l]);
  }
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

double GameConstraints::read(const Group& group, std::size_t i, const std::vector<double>& x) const {
  double sum = 0.0;
  for (const Side& side : group.sides) {
    if (side.frame < 0) continue;
    const double* numbers = numbers_.data() + side.at + i * static_cast<std::size_t>(side.coordinates);
    const double *at = x.data() + 8 * side.body, *unscale = unscales_[static_cast<std::size_t>(side.frame)].data();
    for (std::int32_t l = 0; l < side.coordinates; ++l) sum += numbers[l] * at[l] * (l < 8 ? unscale[l] : 1.0);
  }
  return sum;
}

double GameConstraints::read_pushes(const Group& group, std::size_t i, std::span<const Block8> pushes) const {
  double sum = 0.0;
  for (const Side& side : group.sides) {
    if (side.frame < 0) continue;
    const auto frame = static_cast<std::size_t>(side.frame);
    const double* numbers = numbers_.data() + side.at + i * static_cast<std::size_t>(side.coordinates);
    for (std::size_t l = 0; l < 8; ++l)
      sum += numbers[l] * unscales_[frame][l] * static_cast<double>(pushes[frame].v[l]);
  }
  return sum;
}

/// What forces move eight coordinates by, from `first` on.
std::array<double, 8> GameConstraints::answer(const Group& group, const Side& side, std::int32_t first,
                                              std::span<const double> forces) const {
  std::array<double, 8> sum{};
  const double* numbers = numbers_.data() + side.at + first;
  for (std::size_t i = 0; i < group.count; ++i, numbers += side.coordinates) {
    if (forces[i] == 0.0) continue;
    for (std::size_t l = 0; l < 8; ++l) sum[l] += forces[i] * numbers[l];
  }
  const std::array<double, 8>& scale = scales_[static_cast<std::size_t>(side.frame)];
  for (std::size_t l = 0; first == 0 && l < 8; ++l) sum[l] *= scale[l];
  return sum;
}

void GameConstraints::apply(const Group& group, std::span<const double> forces, std::vector<Block8>& x) const {
  for (const Side& side : group.sides)
    for (std::int32_t k = 0; k < side.coordinates; k += 8) {
      const std::array<double, 8> by = answer(group, side, k, forces);
      float* to = x[static_cast<std::size_t>(side.body + k / 8)].v;
      for (std::size_t l = 0; l < 8; ++l) to[l] += static_cast<float>(by[l]);
    }
}

void GameConstraints::apply(const Group& group, std::span<const double> forces, std::span<double> x) const {
  for (const Side& side : group.sides)
    for (std::int32_t k = 0; k < side.coordinates; k += 8) {
      const std::array<double, 8> by = answer(group, side, k, forces);
      double* to = x.data() + 8 * side.body + k;
      for (std::size_t l = 0; l < 8; ++l) to[l] += by[l];
    }
}

// Velocities ----------------------------------------------------------------------------------------------------------

void GameConstraints::solve(GameBodies& bodies) {
  if (groups_.empty()) return;
  add_what_leads(bodies);
  begun_.clear();
  for (const GameRow& row : rows_) begun_.push_back(row.force);
  for (const Group& group : groups_) apply(group, std::span(begun_).subspan(group.first, group.count), bodies.motion());
  int round = 0;
  do {
    factor(false);
    solve_once(bodies);
  } while (let_go(bodies, ++round < kMostRounds));
  for (const Group& group : groups_) apply(group, changes(group, [](const GameRow&) { return true; }), bodies.motion());
  find_taken(bodies);
}

/// A force within its row's bounds.
double GameConstraints::cut_off(GameRow& row, double force) {
  row.cut = force < row.lower - kRounded * std::abs(row.lower) || force > row.upper + kRounded * std::abs(row.upper);
  return row.cut ? std::clamp(force, row.lower, row.upper) : force;
}

/// By how much forces of a group's rows differ from those that the motion has already.
template <class Counts>
std::span<const double> GameConstraints::changes(const Group& group, const Counts& counts) {
  forces_.assign(group.count, 0.0);
  for (std::size_t i = group.first; i < group.first + group.count; ++i)
    if (counts(rows_[i])) forces_[i - group.first] = rows_[i].force - begun_[i];
  return forces_;
}

/// The forces with which the rows that hold are met, within their bounds. Only what is found last acts on the motion,
/// whose single precision would lose what rounds find whose rows contradict.
void GameConstraints::solve_once(const GameBodies& bodies) {
  answers_.assign(8 * bodies.motion().size(), 0.0);
  for (const Group& group : groups_)
    apply(group, changes(group, [](const GameRow& row) { return row.hold != Hold::kMet; }), answers_);
  right_.assign(factor_.size(), 0.0);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    double* right = right_.data() + factor_.first(g);
    for (std::size_t k = 0; k < static_cast<std::size_t>(group.met); ++k) {
      const auto i = static_cast<std::size_t>(met_[group.first_met + k]);
      const GameRow& row = rows_[group.first + i];
      right[k] = row.target - read(group, i, bodies.motion()) - read(group, i, answers_) -
                 row.compliance * begun_[group.first + i];
    }
  }
  if (factor_.is_complete())
    factor_.solve<1>(right_);
  else
    solve_by_gradients(bodies);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    for (std::size_t k = 0; k < static_cast<std::size_t>(group.met); ++k) {
      const std::size_t i = group.first + static_cast<std::size_t>(met_[group.first_met + k]);
      rows_[i].force = cut_off(rows_[i], begun_[i] + right_[factor_.first(g) + k]);
    }
    apply(group, changes(group, [](const GameRow& row) { return row.hold == Hold::kMet; }), answers_);
  }
}

/// Twice the energy of what the rows took from the motion, by component.
void GameConstraints::find_taken(const GameBodies& bodies) {
  taken_.assign(bodies.bodies().size(), 0.0);
  for (const std::int32_t frame : frames_) {
    const GameBody& body = bodies.body(frame);
    const double* at = answers_.data() + 8 * body.first;
    double& sum = taken_[static_cast<std::size_t>(roots_[static_cast<std::size_t>(frame)])];
    for (std::size_t l = 0; l < static_cast<std::size_t>(8 * body.blocks); ++l) {
      const double by = l < 8 ? at[l] * unscales_[static_cast<std::size_t>(frame)][l] : at[l];
      sum += by * by;
    }
  }
}

/// Conjugate gradients, conditioned by the factor, which has left something out.
void GameConstraints::solve_by_gradients(const GameBodies& bodies) {
  const auto dot_of = [](const std::vector<double>& a, const std::vector<double>& b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
  };
  residuals_ = right_;
  std::ranges::fill(right_, 0.0);
  directions_ = residuals_;
  factor_.solve<1>(directions_);
  double square = dot_of(residuals_, directions_);
  products_.resize(right_.size());
  for (int i = 0; i < kMostGradients && square > 0.0; ++i) {
    multiply(bodies, directions_, products_);
    const double along = dot_of(directions_, products_);
    if (!(along > 0.0)) break;
    for (std::size_t k = 0; k < right_.size(); ++k) {
      right_[k] += square / along * directions_[k];
      residuals_[k] -= square / along * products_[k];
    }
    conditioned_ = residuals_;
    factor_.solve<1>(conditioned_);
    const double next = dot_of(residuals_, conditioned_);
    for (std::size_t k = 0; k < right_.size(); ++k) directions_[k] = conditioned_[k] + next / square * directions_[k];
    square = next;
  }
}

/// (J Jᵀ + C) x of the rows that hold.
void GameConstraints::multiply(const GameBodies& bodies, std::span<const double> x, std::span<double> product) {
  place_.assign(8 * bodies.motion().size(), 0.0);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    forces_.assign(group.count, 0.0);
    for (std::size_t k = 0; k < static_cast<std::size_t>(group.met); ++k)
      forces_[static_cast<std::size_t>(met_[group.first_met + k])] = x[factor_.first(g) + k];
    apply(group, forces_, place_);
  }
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    for (std::size_t k = 0; k < static_cast<std::size_t>(group.met); ++k) {
      const auto i = static_cast<std::size_t>(met_[group.first_met + k]);
      product[factor_.first(g) + k] =
          rows_[group.first + i].compliance * x[factor_.first(g) + k] + read(group, i, place_);
    }
  }
}

/// Rows whose forces were cut off stay at that bound, and those at a bound that would go beyond their gaps may take
/// hold. @return whether any did: the others are to be solved for again, as their forces stand against those
bool GameConstraints::let_go(const GameBodies& bodies, bool takes_hold) {
  bool changed = false;
  for (const Group& group : groups_)
    for (std::size_t i = 0; i < group.count; ++i) {
      GameRow& row = rows_[group.first + i];
      if (!is_bounded(row)) continue;
      const Hold before = row.hold;
      if (row.hold == Hold::kMet) {
        if (!row.cut) continue;
        row.hold = row.force == row.lower ? Hold::kLower : Hold::kUpper;
      } else if (takes_hold) {
        const double open =
            row.target - read(group, i, bodies.motion()) - read(group, i, answers_) - row.compliance * row.force;
        if (row.hold == Hold::kLower ? open > kRounded * length_ : open < -kRounded * length_) row.hold = Hold::kMet;
      }
      changed = changed || row.hold != before;
    }
  return changed;
}

// Places --------------------------------------------------------------------------------------------------------------

void GameConstraints::close(const BodyStates& states, GameBodies& bodies, bool pushed) {
  if (groups_.empty()) return;
  for (const Group& group : groups_) {
    forces_.assign(group.count, 0.0);
    for (std::size_t i = 0; i < group.count; ++i) forces_[i] = -rows_[group.first + i].force;
    apply(group, forces_, bodies.answers());
  }
  if (std::ranges::any_of(rows_, [](const GameRow& row) { return row.gives_way && row.hold == Hold::kMet; }))
    factor(true);
  measure(states, bodies, pushed);
  asked_ = right_;
  factor_.solve<kColumns>(right_);
  find_shares();
  displace(bodies, true);
}

/// Right-hand sides of zeros, and of each row that holds: its group, its number there, and its gap as it is now.
/// @param visit (group, i, gap, right) with right of kColumns numbers
template <class Visit>
void GameConstraints::for_met_gaps(const BodyStates& states, const Visit& visit) {
  right_.assign(kColumns * factor_.size(), 0.0);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    gaps_.assign(group.count, 0.0);
    group.constraint->gaps(states, StepTime::kStart, gaps_);
    double* right = right_.data() + kColumns * factor_.first(g);
    for (std::size_t k = 0; k < static_cast<std::size_t>(group.met); ++k, right += kColumns) {
      const auto i = static_cast<std::size_t>(met_[group.first_met + k]);
      visit(group, i, gaps_[i], right);
    }
  }
}

/// What the rows that hold are short of: in their rates, by the way they turned, and in places.
void GameConstraints::measure(const BodyStates& states, const GameBodies& bodies, bool pushed) {
  const double most = kRecoverySpeed * length_;
  for_met_gaps(states, [&](const Group& group, std::size_t i, double gap, double* right) {
    const GameRow& row = rows_[group.first + i];
    right[kRate] = row.target - read(group, i, bodies.motion()) - row.compliance * row.force;
    if (!row.keeps_place) return;
    const double by_pushes = pushed ? read_pushes(group, i, bodies.pushes()) : 0.0,
                 straight = row.error - right[kRate] + by_pushes;  // the gap as the rows foretell it
    right[kCurve] = straight - (gap - row.rate);
    right[kPlace] = -std::clamp(row.error + by_pushes, -most, most);
  });
}

/// By component, how much of what curves is closed by velocities: as much as takes no more energy than there is.
void GameConstraints::find_shares() {
  given_.assign(taken_.size(), 0.0);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const std::size_t first = factor_.first(g);
    for (std::size_t k = first; k < first + static_cast<std::size_t>(groups_[g].met); ++k)
      given_[static_cast<std::size_t>(groups_[g].component)] +=
          asked_[kColumns * k + kCurve] * right_[kColumns * k + kCurve];
  }
  for (std::size_t c = 0; c < given_.size(); ++c)
    given_[c] = given_[c] > taken_[c] ? std::sqrt(taken_[c] / given_[c]) : 1.0;
}

void GameConstraints::displace(GameBodies& bodies, bool gains_speed) {
  speed_.assign(8 * bodies.motion().size(), 0.0);
  place_.assign(8 * bodies.motion().size(), 0.0);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    const double share = gains_speed ? given_[static_cast<std::size_t>(group.component)] : 0.0;
    const double* found = right_.data() + kColumns * factor_.first(g);
    forces_.assign(group.count, 0.0), yields_.assign(group.count, 0.0);
    for (std::size_t k = 0; k < static_cast<std::size_t>(group.met); ++k, found += kColumns) {
      const auto i = static_cast<std::size_t>(met_[group.first_met + k]);
      GameRow& row = rows_[group.first + i];
      yields_[i] = found[kPlace] + (1.0 - share) * found[kCurve];
      if (!gains_speed) continue;
      const double force = std::clamp(row.force + found[kRate] + share * found[kCurve], row.lower, row.upper);
      forces_[i] = force - row.force;
      row.force = force;
    }
    if (gains_speed) apply(group, forces_, speed_);
    apply(group, yields_, place_);
  }
  for (const std::int32_t frame : frames_) {
    const GameBody& body = bodies.body(frame);
    const auto from = static_cast<std::size_t>(8 * body.first);
    bodies.displace(frame, speed_.data() + from, place_.data() + from);
  }
}

void GameConstraints::end_substep(const BodyStates& states, GameBodies& bodies, bool last) {
  if (last && !groups_.empty()) {
    residual_ = 0.0;
    const double most = kRecoverySpeed * length_;
    for_met_gaps(states, [&](const Group& group, std::size_t i, double gap, double* right) {
      const GameRow& row = rows_[group.first + i];
      if (!row.keeps_place) return;
      const double open = gap - row.rate;
      right[kPlace] = -std::clamp(open, -most, most);
      residual_ = std::max(residual_, std::abs(open));
    });
    factor_.solve<kColumns>(right_);
    displace(bodies, false);
  }
  for (const Group& group : groups_) {
    forces_.clear();
    for (std::size_t i = 0; i < group.count; ++i) forces_.push_back(length_ * rows_[group.first + i].force);
    group.constraint->accept(states, forces_);
  }
}

bool GameConstraints::all_finite() const {
  return std::ranges::all_of(rows_, [](const GameRow& row) { return std::isfinite(row.force); });
}

}  // namespace limber::internal
