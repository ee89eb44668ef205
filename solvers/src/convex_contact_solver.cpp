#include "limber/solvers/convex_contact_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dense_kernels.h"
#include "tuning.h"

namespace limber::internal {

void ConvexContactSolver::begin_structure() {
  nodes_.clear(), units_.clear(), sides_.clear(), node_of_.clear();
  numbers_ = size_ = 0;
}

std::size_t ConvexContactSolver::add_node(std::size_t width) {
  nodes_.push_back({width, size_});
  size_ += padded(width);
  return nodes_.size() - 1;
}

std::size_t ConvexContactSolver::add_unit(std::size_t rows, const ContactPotential& potential, double tolerance) {
  units_.push_back({.rows = rows, .first_side = sides_.size(), .potential = potential, .tolerance = tolerance});
  return units_.size() - 1;
}

std::size_t ConvexContactSolver::add_side(std::size_t node) {
  const std::size_t width = padded(nodes_[node].width), rows = units_.back().rows;
  sides_.push_back({.rows = rows, .column = nodes_[node].first, .width = width, .values = numbers_, .stride = width});
  node_of_.push_back(node);
  numbers_ += rows * width;
  ++units_.back().sides;
  return sides_.size() - 1;
}

void ConvexContactSolver::end_structure() {
  // The order of elimination tells in the last bits: it comes from this problem and from none before it.
  blocks_.factor_widths.clear(), blocks_.factor_pairs.clear();
  std::fill_n(values_.need(std::max(numbers_, kPad)), padded(numbers_), 0.0);
  // With the units, which grow in large steps: how many press, and with whom, changes within a step.
  products_.reserve(3 * units_.capacity());
  for (std::vector<Pair>* pairs : {&blocks_.pairs, &blocks_.factor_pairs}) pairs->reserve(units_.capacity());
  for (AlignedBuffer* vector : {&y_, &d_, &gradient_}) std::fill_n(vector->need(std::max(size_, kPad)), size_, 0.0);
}

MatrixView ConvexContactSolver::values(std::size_t side) {
  return {values_.data() + sides_[side].values, sides_[side].stride};
}

/// To be read only.
MatrixView ConvexContactSolver::jacobian(std::size_t side) const {
  return const_cast<ConvexContactSolver*>(this)->values(side);
}

Vec3 ConvexContactSolver::response(std::size_t unit) const {
  const Unit& of = units_[unit];
  Vec3 sum = Vec3::Zero();
  for (std::size_t s = of.first_side; s < of.first_side + of.sides; ++s) {
    const MatrixView J = jacobian(s);
    for (std::size_t r = 0; r < of.rows; ++r) sum[static_cast<int>(r)] += dot(J.row(r), J.row(r), J.stride);
  }
  return sum;
}

Vec3 ConvexContactSolver::moved(std::size_t unit) {
  const Unit& of = units_[unit];
  multiply_each(by_side_.need(kRowsOfEach * sides_.size()) + kRowsOfEach * of.first_side, sides_.data() + of.first_side,
                of.sides, values_.data(), y_.data());
  return seen_by(of);
}

/// J y of all sides.
void ConvexContactSolver::find_seen(const double* y) {
  multiply_each(by_side_.need(kRowsOfEach * sides_.size()), sides_.data(), sides_.size(), values_.data(), y);
}

/// And of a unit.
Vec3 ConvexContactSolver::seen_by(const Unit& unit) const {
  Vec3 sum = Vec3::Zero();
  const double* side = by_side_.data() + kRowsOfEach * unit.first_side;
  for (std::size_t s = 0; s < unit.sides; ++s, side += kRowsOfEach) sum += Vec3(side[0], side[1], side[2]);
  return sum;
}

/// y += Σ Jᵀ F
void ConvexContactSolver::add_impulses(double* y) {
  double* side = by_side_.need(kRowsOfEach * sides_.size());
  for (const Unit& unit : units_)
    for (std::size_t s = 0; s < unit.sides; ++s, side += kRowsOfEach)
      std::copy_n(unit.impulse.data(), kRowsOfEach, side);
  add_each(y, sides_.data(), sides_.size(), values_.data(), by_side_.data());
}

void ConvexContactSolver::find_ends(const double* y) {
  find_seen(y);
  for (Unit& unit : units_) unit.end = unit.start + seen_by(unit);
}

/// (1)
double ConvexContactSolver::potential_of(const double* y) {
  find_ends(y);
  double sum = 0.5 * dot(y, y, size_);
  for (const Unit& unit : units_) sum += unit.potential.at(unit.end).potential;
  return sum;
}

void ConvexContactSolver::set_motion() {
  std::fill_n(y_.data(), size_, 0.0);
  add_impulses(y_.data());
}

void ConvexContactSolver::begin_with_better_start() {
  double *free = y_.data(), *guess = d_.data();
  std::fill_n(free, size_, 0.0);
  std::fill_n(guess, size_, 0.0);
  add_impulses(guess);
  const double at_free = potential_of(free), at_guess = potential_of(guess);
  if (at_guess < at_free) std::copy_n(guess, size_, free);
}

void ConvexContactSolver::begin() {
  find_reaches();
  pairs_are_new_ = true;
}

ConvexContactReport ConvexContactSolver::solve(const ConvexContactOptions& options) {
  begin();
  begin_with_better_start();
  return solve_on(options);
}

ConvexContactReport ConvexContactSolver::solve_on(const ConvexContactOptions& options) {
  ConvexContactReport report;
  find_ends(y_.data());
  for (;; ++report.iterations) {
    const auto [residual, round_off] = gradient();
    const double* g = gradient_.data();
    report.residual = residual;
    if (residual <= std::max(options.tolerance, round_off)) return report;
    if (report.iterations == options.max_iterations || !std::isfinite(report.residual)) break;
    if (pairs_are_new_) place_pairs();
    assemble();
    if (!blocks_.factor.factor()) break;
    double *d = d_.data(), *y = y_.data();
    find_direction(g, d);
    find_seen(d);
    for (Unit& unit : units_) unit.change = seen_by(unit);
    const double step = best_step(dot(g, d, size_));
    add_scaled(y, step, d, size_);
    for (Unit& unit : units_) unit.end += step * unit.change;
  }
  report.status = SolveStatus::kIterationLimit;
  return report;
}

void ConvexContactSolver::find_reaches() {
  for (std::size_t u = 0; u < units_.size(); ++u) {
    Unit& unit = units_[u];
    unit.reach = std::sqrt(response(u).maxCoeff());
    for (std::size_t s = unit.first_side; s < unit.first_side + unit.sides; ++s) {
      double& reach = nodes_[node_of_[s]].reach;
      reach = std::max(reach, unit.reach / unit.tolerance);
    }
  }
}

/// ∇ = y − Σ Jᵀ F, and each unit's F and ∇²l.
ConvexContactSolver::Gradient ConvexContactSolver::gradient() {
  constexpr double kRounded = 8.0 * std::numeric_limits<double>::epsilon();
  double* g = gradient_.data();
  std::fill_n(g, size_, 0.0);
  double round_off = 0.0, reach = 0.0;
  for (Unit& unit : units_) {
    const ContactPotential::Value v = unit.potential.at(unit.end);
    unit.impulse = v.impulse, unit.stiffness = v.stiffness, unit.acts = v.acts;
    if (!v.acts) continue;
    const double rounded = kRounded * unit.reach / unit.potential.compliance;
    round_off += rounded * rounded * (unit.start.squaredNorm() + unit.end.squaredNorm());
    pairs_are_new_ = pairs_are_new_ || !unit.has_pressed;
    unit.has_pressed = true;
  }
  add_impulses(g);
  const double* y = y_.data();
  for (std::size_t i = 0; i < size_; ++i) g[i] = y[i] - g[i];
  double residual = 0.0;
  for (const Node& node : nodes_) {
    residual = std::max(residual, node.reach * std::sqrt(dot(g + node.first, g + node.first, node.width)));
    reach = std::max(reach, node.reach);
  }
  return {residual, reach * std::sqrt(round_off)};
}

ConvexContactSolver::Pair ConvexContactSolver::pair_of(const Unit& unit) const {
  return std::minmax(node_of_[unit.first_side], node_of_[unit.first_side + 1]);
}

void ConvexContactSolver::Blocks::place() {
  std::ranges::sort(pairs);
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  if (widths == factor_widths && std::ranges::includes(factor_pairs, pairs)) return;
  factor_widths = widths, factor_pairs = pairs;
  factor.begin_pattern(widths);
  for (const auto& [a, b] : factor_pairs) factor.add_edge(a, b);
  factor.end_pattern();
}

/// Finds the blocks of all pairs that have pressed in this problem.
void ConvexContactSolver::place_pairs() {
  blocks_.widths.clear(), blocks_.pairs.clear();
  for (const Node& node : nodes_) blocks_.widths.push_back(node.width);
  for (const Unit& unit : units_)
    if (unit.has_pressed && unit.sides == 2) blocks_.pairs.push_back(pair_of(unit));
  blocks_.place();
  for (Unit& unit : units_) {
    if (!unit.has_pressed || unit.sides < 2) continue;
    const auto [a, b] = pair_of(unit);
    unit.block = blocks_.factor.comes_first(a, b) ? blocks_.factor.block(a, b) : blocks_.factor.block(b, a);
  }
  pairs_are_new_ = false;
}

/// 1 + Σ Jᵀ ∇²l J
void ConvexContactSolver::assemble() {
  blocks_.factor.set_identity();
  products_.clear();
  for (const Unit& unit : units_) {
    if (!unit.acts) continue;
    for (std::size_t s = unit.first_side; s < unit.first_side + unit.sides; ++s)
      list_product(unit, s, s, blocks_.factor.block(node_of_[s], node_of_[s]));
    if (unit.sides < 2) continue;
    std::size_t a = unit.first_side, b = a + 1;
    if (!blocks_.factor.comes_first(node_of_[a], node_of_[b])) std::swap(a, b);
    list_product(unit, a, b, unit.block);
  }
  add_congruences(blocks_.factor.numbers_of_blocks(), values_.data(), products_.data(), products_.size());
}

void ConvexContactSolver::list_product(const Unit& unit, std::size_t a, std::size_t b,
                                       const BlockFactor::Block& block) {
  products_.push_back({.left = sides_[a],
                       .right = sides_[b],
                       .K = unit.stiffness.data(),
                       .to = block.offset,
                       .stride = block.stride,
                       .columns = nodes_[node_of_[a]].width});
}

ContactPotential::Slope ConvexContactSolver::slope_at(double step, double yd, double dd) const {
  ContactPotential::Slope slope{yd + step * dd, dd};
  for (const Unit& unit : units_) {
    const ContactPotential::Slope along = unit.potential.along(unit.end + step * unit.change, unit.change);
    slope.first += along.first;
    slope.second += along.second;
  }
  return slope;
}

/// d = −(1 + Σ Jᵀ ∇²l J)⁻¹ g
void ConvexContactSolver::find_direction(const double* g, double* d) {
  double* x = ordered_.need(blocks_.factor.size());
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    std::copy_n(g + nodes_[i].first, padded(nodes_[i].width), x + blocks_.factor.first(i));
  blocks_.factor.solve(x);
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    for (std::size_t k = 0; k < nodes_[i].width; ++k) d[nodes_[i].first + k] = -x[blocks_.factor.first(i) + k];
}

/// Where (1) is least along d: Newton's method on its slope, within the bracket found so far.
double ConvexContactSolver::best_step(double slope_at_start) const {
  constexpr const ConvexSolverTuning& tuning = kSolversTuning.convex;
  const double yd = dot(y_.data(), d_.data(), size_), dd = dot(d_.data(), d_.data(), size_);
  double step = 1.0, low = 0.0, high = std::numeric_limits<double>::infinity();
  for (int i = 0; i < tuning.most_searches; ++i) {
    const ContactPotential::Slope slope = slope_at(step, yd, dd);
    if (std::abs(slope.first) <= (i == 0 ? tuning.enough_of_full_step : tuning.enough) * std::abs(slope_at_start))
      break;
    (slope.first < 0.0 ? low : high) = step;
    const double next = step - slope.first / slope.second;
    if (next > low && next < std::min(high, tuning.longest_jump * step))
      step = next;
    else
      step = std::isfinite(high) ? 0.5 * (low + high) : 2.0 * step;
  }
  return step;
}

}  // namespace limber::internal
