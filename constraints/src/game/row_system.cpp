#include "row_system.h"

#include <algorithm>
#include <numeric>

#include "../tuning.h"

namespace limber::internal {
namespace {

using Hold = GameRow::Hold;

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

}  // namespace

// Graph ---------------------------------------------------------------------------------------------------------------

void RowSystem::find_graph(const GameBodies& bodies, const GameRows& rows) {
  const std::span<const GameGroup> groups = rows.groups();
  incident_.clear(), graph_.clear(), bodies_.clear(), of_group_.clear();
  joined_.reset(bodies.bodies().size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    for (const GameSide& side : groups[g].sides)
      if (side.frame >= 0) incident_.push_back({side.frame, static_cast<std::int32_t>(g)});
    if (groups[g].sides[0].frame >= 0 && groups[g].sides[1].frame >= 0)
      joined_.join(groups[g].sides[0].frame, groups[g].sides[1].frame);
  }
  std::ranges::sort(incident_);
  for (std::size_t i = 0; i < incident_.size(); ++i)
    for (std::size_t j = i + 1; j < incident_.size() && incident_[j][0] == incident_[i][0]; ++j)
      if (incident_[i][1] != incident_[j][1]) graph_.push_back({incident_[i][1], incident_[j][1]});
  std::ranges::sort(graph_);
  graph_.erase(std::unique(graph_.begin(), graph_.end()), graph_.end());
  factor_.set_graph(groups.size(), graph_);
  number_components(bodies, groups);
  all_met_ = false;
}

/// By their first bodies.
void RowSystem::number_components(const GameBodies& bodies, std::span<const GameGroup> groups) {
  of_frame_.resize(bodies.bodies().size());
  components_ = 0;
  for (const auto& [frame, group] : incident_) {
    if (!bodies_.empty() && bodies_.back().frame == frame) continue;
    const std::int32_t root = joined_.root(frame);
    if (root == frame) of_frame_[static_cast<std::size_t>(frame)] = static_cast<std::int32_t>(components_++);
    const GameBody& body = bodies.body(frame);
    bodies_.push_back({frame, body.first, body.blocks, of_frame_[static_cast<std::size_t>(root)]});
  }
  for (const GameGroup& group : groups) {
    const std::int32_t frame = std::max(group.sides[0].frame, group.sides[1].frame);
    of_group_.push_back(frame < 0 ? 0 : of_frame_[static_cast<std::size_t>(joined_.root(frame))]);
  }
  components_ = std::max<std::size_t>(components_, 1);
}

// Matrix --------------------------------------------------------------------------------------------------------------

void RowSystem::list_met(const GameRows& rows, bool closing) {
  if (all_met_ && !rows.any_bounded()) return;
  all_met_ = !rows.any_bounded();
  met_.clear(), sizes_.clear(), first_met_.clear();
  for (const GameGroup& group : rows.groups()) {
    const std::size_t begin = met_.size();
    for (std::size_t i = 0; i < group.count; ++i)
      if (const GameRow& row = rows.rows()[group.first + i]; row.hold == Hold::kMet && !(closing && row.gives_way))
        met_.push_back(static_cast<std::int32_t>(i));
    first_met_.push_back(static_cast<std::int32_t>(begin));
    sizes_.push_back(static_cast<std::int32_t>(met_.size() - begin));
  }
}

void RowSystem::factor(const GameRows& rows, bool closing) {
  list_met(rows, closing);
  factor_.begin(sizes_);
  const std::span<const GameGroup> groups = rows.groups();
  const auto multiply = [&](std::size_t r, std::size_t s, double* to) {
    multiply_pair(rows.arrays(), {&groups[r], met(r).data(), met(r).size()}, {&groups[s], met(s).data(), met(s).size()},
                  to);
  };
  for (std::size_t g = 0; g < groups.size(); ++g) {
    double* to = factor_.diagonal(g);
    multiply(g, g, to);
    const std::span<const std::int32_t> met = this->met(g);
    for (std::size_t i = 0; i < met.size(); ++i) {
      double& own = to[i * met.size() + i];
      own += rows.rows()[groups[g].first + static_cast<std::size_t>(met[i])].compliance;
      if (!(own > 0.0)) own = 1.0;  // nothing that it acts on moves
    }
  }
  for (std::size_t c = 0; c < graph_.size(); ++c) {
    const std::int32_t of_rows = factor_.rows_of(c), of_columns = graph_[c][0] == of_rows ? graph_[c][1] : graph_[c][0];
    multiply(static_cast<std::size_t>(of_rows), static_cast<std::size_t>(of_columns), factor_.block(c));
  }
  factor_.factor();
}

// Conjugate gradients -------------------------------------------------------------------------------------------------

void RowSystem::solve_fully(const GameRows& rows, std::span<const double> guess, std::vector<double>& x) {
  if (factor_.is_complete()) return factor_.solve<1>(x);
  Gradients& g = gradients_;
  g.residual = x;
  x.assign(guess.begin(), guess.end());
  g.product.resize(x.size());
  multiply(rows, x, g.product);
  for (std::size_t k = 0; k < x.size(); ++k) g.residual[k] -= g.product[k];
  g.direction = g.residual;
  factor_.solve<1>(g.direction);
  double square = dot(g.residual, g.direction);
  for (int i = 0; i < kConstraintsTuning.small_steps.most_gradients && square > 0.0; ++i) {
    multiply(rows, g.direction, g.product);
    const double along = dot(g.direction, g.product);
    if (!(along > 0.0)) break;
    for (std::size_t k = 0; k < x.size(); ++k) {
      x[k] += square / along * g.direction[k];
      g.residual[k] -= square / along * g.product[k];
    }
    g.conditioned = g.residual;
    factor_.solve<1>(g.conditioned);
    const double next = dot(g.residual, g.conditioned);
    for (std::size_t k = 0; k < x.size(); ++k) g.direction[k] = g.conditioned[k] + next / square * g.direction[k];
    square = next;
  }
}

/// (J W Jᵀ + C) x
void RowSystem::multiply(const GameRows& rows, std::span<const double> x, std::span<double> product) {
  std::vector<Double8>& moved = gradients_.moved;
  std::vector<double>& forces = gradients_.forces;
  moved.assign(rows.blocks(), {});
  forces.assign(rows.rows().size(), 0.0);
  for_met(rows, [&](std::size_t row, std::size_t k) { forces[row] = x[k]; });
  rows.add_answer(forces, moved);
  rows.multiply(moved, forces);
  for_met(rows, [&](std::size_t row, std::size_t k) { product[k] = rows.rows()[row].compliance * x[k] + forces[row]; });
}

}  // namespace limber::internal
