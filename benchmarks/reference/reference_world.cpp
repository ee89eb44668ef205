#include "reference_world.h"

#include <algorithm>
#include <cmath>

namespace limber::testing {
namespace {

constexpr int kPowerIterations = 300;
constexpr int kContactRounds = 30;  // of taking in nodes that others' reactions push into the wall
constexpr int kSweeps = 2000;       // of projected Gauss–Seidel
constexpr double kSettled = 1e-13;  // m, change of a row's end value by a sweep
constexpr int kNewtonSteps = 60;
constexpr double kNewtonTolerance = 1e-10;  // of a step, over the largest coordinate
constexpr double kBalanced = 1e-6;          // of the loads

/// Free unknowns of a body, and how many.
std::pair<std::vector<int>, int> free_unknowns(const NodalElasticity& elasticity) {
  std::vector<int> number;
  int count = 0;
  for (const char fixed : elasticity.is_fixed())
    for (int i = 0; i < 3; ++i) number.push_back(fixed != 0 ? -1 : count++);
  return {number, count};
}

SparseDoubles free_part(const SparseDoubles& A, const std::vector<int>& number, int count) {
  std::vector<Eigen::Triplet<double>> entries;
  for (int j = 0; j < A.outerSize(); ++j)
    for (SparseDoubles::InnerIterator it(A, j); it; ++it) {
      const int row = number[static_cast<std::size_t>(it.row())], column = number[static_cast<std::size_t>(j)];
      if (row >= 0 && column >= 0) entries.emplace_back(row, column, it.value());
    }
  SparseDoubles out(count, count);
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

Eigen::VectorXd free_part(const NodeVectors& all, const std::vector<int>& number, int count) {
  Eigen::VectorXd out(count);
  for (std::size_t i = 0; i < number.size(); ++i)
    if (number[i] >= 0) out[number[i]] = all.data()[i];
  return out;
}

void add_free(NodeVectors& all, double factor, const Eigen::VectorXd& part, const std::vector<int>& number) {
  for (std::size_t i = 0; i < number.size(); ++i)
    if (number[i] >= 0) all.data()[i] += factor * part[number[i]];
}

}  // namespace

/// M⁻¹ on the free nodes; columns are kept once made.
class ReferenceWorld::MassSolver {
 public:
  explicit MassSolver(const NodalElasticity& elasticity) {
    for (const char fixed : elasticity.is_fixed()) number_.push_back(fixed != 0 ? -1 : count_++);
    factor_.compute(free_part(elasticity.mass(), number_, count_));
  }
  NodeVectors solve(const NodeVectors& f) const {
    NodeVectors part(count_, 3);
    for (std::size_t v = 0; v < number_.size(); ++v)
      if (number_[v] >= 0) part.row(number_[v]) = f.row(static_cast<Eigen::Index>(v));
    const Eigen::MatrixXd solved = factor_.solve(Eigen::MatrixXd(part));
    NodeVectors out = NodeVectors::Zero(f.rows(), 3);
    for (std::size_t v = 0; v < number_.size(); ++v)
      if (number_[v] >= 0) out.row(static_cast<Eigen::Index>(v)) = solved.row(number_[v]);
    return out;
  }
  const Eigen::VectorXd& column(Index node) {
    Eigen::VectorXd& known = columns_[node];
    if (known.size() > 0) return known;
    known = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(number_.size()));
    const int at = number_[static_cast<std::size_t>(node)];
    if (at < 0) return known;
    const Eigen::VectorXd solved = factor_.solve(Eigen::VectorXd::Unit(count_, at));
    for (std::size_t v = 0; v < number_.size(); ++v)
      if (number_[v] >= 0) known[static_cast<Eigen::Index>(v)] = solved[number_[v]];
    return known;
  }

 private:
  std::vector<int> number_;
  int count_ = 0;
  Eigen::SimplicialLDLT<SparseDoubles> factor_;
  std::unordered_map<Index, Eigen::VectorXd> columns_;
};

/// n · x_a − n · x_b against a target; b may be the world.
struct ReferenceWorld::Row {
  std::size_t body_a = 0;
  Index node_a = 0;
  Vec3 normal = Vec3::UnitZ();
  double target = 0.0;
  bool one_sided = false;
  std::optional<std::pair<std::size_t, Index>> b{};
  double impulse = 0.0;
};

double stable_step(const NodalElasticity& elasticity) {
  const auto [number, count] = free_unknowns(elasticity);
  const SparseDoubles K = free_part(elasticity.stiffness(elasticity.rest()), number, count);
  SparseDoubles all(3 * elasticity.nodes(), 3 * elasticity.nodes());
  std::vector<Eigen::Triplet<double>> entries;
  for (int j = 0; j < elasticity.mass().outerSize(); ++j)
    for (SparseDoubles::InnerIterator it(elasticity.mass(), j); it; ++it)
      for (int i = 0; i < 3; ++i) entries.emplace_back(3 * static_cast<int>(it.row()) + i, 3 * j + i, it.value());
  all.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<SparseDoubles> M(free_part(all, number, count));
  Eigen::VectorXd w(count);
  for (Eigen::Index i = 0; i < count; ++i) w[i] = std::sin(1.0 + 3.7 * static_cast<double>(i * i % 1009));
  double eigenvalue = 0.0;
  for (int i = 0; i < kPowerIterations; ++i) {
    w.normalize();
    w = M.solve(K * w);
    eigenvalue = w.norm();
  }
  return 2.0 / std::sqrt(eigenvalue);
}

ReferenceWorld::ReferenceWorld(ReferenceScene scene) : scene_(std::move(scene)), led_from_(scene_.led.size()) {
  for (const MovingBody& b : scene_.bodies) masses_.push_back(std::make_unique<MassSolver>(*b.elasticity));
}
ReferenceWorld::~ReferenceWorld() = default;

void ReferenceWorld::advance(double seconds, double longest) {
  const int steps = std::max(1, static_cast<int>(std::ceil(seconds / longest * (1.0 - 1e-12))));
  for (int i = 0; i < steps; ++i) step(seconds / steps);
}

void ReferenceWorld::step(double h) {
  const double since = 0.5 * (last_step_ + h);  // velocities are half a step behind the places
  for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
    MovingBody& b = scene_.bodies[i];
    NodeVectors f = b.elasticity->forces(b.x) + b.elasticity->node_masses() * scene_.gravity.transpose();
    for (const NodeForce& load : scene_.forces)
      if (load.body == i && time_ >= load.start - 0.5 * h && time_ < load.end - 0.5 * h)
        f.row(load.node) += load.force.transpose();
    b.v += since * masses_[i]->solve(f);
  }
  settle(bilateral_rows(h), h);
  for (MovingBody& b : scene_.bodies) b.x += h * b.v;
  time_ += h;
  last_step_ = h;
}

std::vector<ReferenceWorld::Row> ReferenceWorld::bilateral_rows(double h) {
  std::vector<Row> rows;
  for (std::size_t i = 0; i < scene_.led.size(); ++i) {
    const LedNode& led = scene_.led[i];
    if (time_ < led.start - 0.5 * h || time_ >= led.end - 0.5 * h) continue;
    if (!led_from_[i]) led_from_[i] = scene_.bodies[led.body].x.row(led.node).transpose();
    const Vec3 target = *led_from_[i] + led.way(time_ + h - led.start);
    for (int axis = 0; axis < 3; ++axis)
      rows.push_back({.body_a = led.body, .node_a = led.node, .normal = Vec3::Unit(axis), .target = target[axis]});
  }
  for (const Tie& tie : scene_.ties)
    for (int axis = 0; axis < 3; ++axis)
      rows.push_back({.body_a = tie.body_a,
                      .node_a = tie.node_a,
                      .normal = Vec3::Unit(axis),
                      .b = std::pair{tie.body_b, tie.node_b}});
  return rows;
}

double ReferenceWorld::end_value(const Row& row, double h) const {
  const auto at = [&](std::size_t body, Index node) {
    const MovingBody& b = scene_.bodies[body];
    return row.normal.dot((b.x.row(node) + h * b.v.row(node)).transpose());
  };
  return at(row.body_a, row.node_a) - (row.b ? at(row.b->first, row.b->second) : 0.0) - row.target;
}

void ReferenceWorld::add_reaction(const Row& row, double impulse) {
  scene_.bodies[row.body_a].v += masses_[row.body_a]->column(row.node_a) * (impulse * row.normal.transpose());
  if (row.b)
    scene_.bodies[row.b->first].v -= masses_[row.b->first]->column(row.b->second) * (impulse * row.normal.transpose());
}

void ReferenceWorld::solve_rows(std::vector<Row>& rows, double h) {
  const auto count = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(count, count);
  Eigen::VectorXd gap(count);
  const auto inverse_mass = [&](std::size_t a, Index node_a, std::size_t b, Index node_b) {
    return a == b ? masses_[a]->column(node_a)[node_b] : 0.0;
  };
  for (Eigen::Index i = 0; i < count; ++i) {
    const Row& r = rows[static_cast<std::size_t>(i)];
    gap[i] = end_value(r, h);
    for (Eigen::Index j = 0; j < count; ++j) {
      const Row& s = rows[static_cast<std::size_t>(j)];
      const double along = h * r.normal.dot(s.normal);
      if (along == 0.0) continue;
      A(i, j) += along * inverse_mass(r.body_a, r.node_a, s.body_a, s.node_a);
      if (r.b) A(i, j) -= along * inverse_mass(r.b->first, r.b->second, s.body_a, s.node_a);
      if (s.b) A(i, j) -= along * inverse_mass(r.body_a, r.node_a, s.b->first, s.b->second);
      if (r.b && s.b) A(i, j) += along * inverse_mass(r.b->first, r.b->second, s.b->first, s.b->second);
    }
  }
  Eigen::VectorXd impulses = Eigen::VectorXd::Zero(count);
  double moved = 1.0;
  for (int sweep = 0; sweep < kSweeps && moved > kSettled; ++sweep) {
    moved = 0.0;
    for (Eigen::Index i = 0; i < count; ++i) {
      const bool one_sided = rows[static_cast<std::size_t>(i)].one_sided;
      double next = impulses[i] - (gap[i] + A.row(i).dot(impulses)) / A(i, i);
      // Rows keep what earlier rounds gave them; in all they push.
      if (one_sided) next = std::max(next, -rows[static_cast<std::size_t>(i)].impulse);
      moved = std::max(moved, std::abs(next - impulses[i]) * A(i, i));
      impulses[i] = next;
    }
  }
  for (Eigen::Index i = 0; i < count; ++i) {
    rows[static_cast<std::size_t>(i)].impulse += impulses[i];
    add_reaction(rows[static_cast<std::size_t>(i)], impulses[i]);
  }
}

void ReferenceWorld::settle(std::vector<Row> rows, double h) {
  std::vector<std::vector<char>> taken;
  for (const MovingBody& b : scene_.bodies) taken.emplace_back(static_cast<std::size_t>(b.x.rows()), 0);
  for (int round = 0; round < kContactRounds; ++round) {
    bool found = round == 0 && !rows.empty();
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
      const MovingBody& b = scene_.bodies[i];
      if (!b.wall) continue;
      for (Index node = 0; node < static_cast<Index>(b.x.rows()); ++node) {
        const Row row{.body_a = i,
                      .node_a = node,
                      .normal = b.wall->sign * Vec3::Unit(b.wall->axis),
                      .target = b.wall->offset,
                      .one_sided = true};
        if (taken[i][static_cast<std::size_t>(node)] != 0 || end_value(row, h) >= -kSettled) continue;
        taken[i][static_cast<std::size_t>(node)] = 1;
        rows.push_back(row);
        found = true;
      }
    }
    if (!found) break;
    solve_rows(rows, h);
  }
  double by_walls = 0.0;
  for (const Row& row : rows)
    if (row.one_sided) by_walls += row.impulse;
  if (by_walls > 0.0) wall_impulses_.push_back({time_ + h, by_walls});
}

double ReferenceWorld::energy() const {
  double sum = 0.0;
  for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
    const MovingBody& b = scene_.bodies[i];
    const Eigen::VectorXd& m = b.elasticity->node_masses();
    NodeVectors f = b.elasticity->forces(b.x) + m * scene_.gravity.transpose();
    const NodeVectors after = b.v + last_step_ * masses_[i]->solve(f);
    // ½ v₋½ᵀ M v₊½ is what central differences conserve of linear bodies.
    sum += 0.5 * b.v.cwiseProduct(b.elasticity->mass() * after).sum() + b.elasticity->energy(b.x) -
           scene_.gravity.dot(b.x.transpose() * m);
  }
  return sum;
}

Vec3 ReferenceWorld::momentum() const {
  Vec3 sum = Vec3::Zero();
  for (const MovingBody& b : scene_.bodies) sum += b.v.transpose() * b.elasticity->node_masses();
  return sum;
}

MidpointBody::MidpointBody(std::shared_ptr<const NodalElasticity> elasticity, NodeVectors x, NodeVectors v)
    : elasticity_(std::move(elasticity)), x_(std::move(x)), v_(std::move(v)) {
  std::tie(free_, unknowns_) = free_unknowns(*elasticity_);
  std::vector<Eigen::Triplet<double>> entries;
  const SparseDoubles& M = elasticity_->mass();
  for (int j = 0; j < M.outerSize(); ++j)
    for (SparseDoubles::InnerIterator it(M, j); it; ++it)
      for (int i = 0; i < 3; ++i) entries.emplace_back(3 * static_cast<int>(it.row()) + i, 3 * j + i, it.value());
  mass_.resize(3 * M.rows(), 3 * M.cols());
  mass_.setFromTriplets(entries.begin(), entries.end());
}

int MidpointBody::step(double h, const NodeVectors& loads) {
  NodeVectors way = h * v_;
  for (std::size_t i = 0; i < free_.size(); ++i)
    if (free_[i] < 0) way.data()[i] = 0.0;
  const double size = x_.cwiseAbs().maxCoeff();
  int round = 0;
  for (; round < kNewtonSteps; ++round) {
    const NodeVectors middle = x_ + 0.5 * way;
    const NodeVectors r =
        elasticity_->forces(middle) + loads - 2.0 / h * (elasticity_->mass() * NodeVectors(way / h - v_));
    const SparseDoubles A = 2.0 / (h * h) * mass_ + 0.5 * elasticity_->stiffness(middle);
    const Eigen::SimplicialLDLT<SparseDoubles> factor(free_part(A, free_, unknowns_));
    const Eigen::VectorXd d = factor.solve(free_part(r, free_, unknowns_));
    add_free(way, 1.0, d, free_);
    if (!(d.cwiseAbs().maxCoeff() > kNewtonTolerance * size)) break;
  }
  x_ += way;
  v_ = 2.0 / h * way - v_;
  return round + 1;
}

double MidpointBody::energy() const {
  return 0.5 * v_.cwiseProduct(elasticity_->mass() * v_).sum() + elasticity_->energy(x_);
}

NodeVectors equilibrium(const NodalElasticity& elasticity, NodeVectors x, const NodeVectors& loads) {
  const auto [number, count] = free_unknowns(elasticity);
  const auto potential = [&](const NodeVectors& at) { return elasticity.energy(at) - loads.cwiseProduct(at).sum(); };
  for (int round = 0; round < kNewtonSteps; ++round) {
    const Eigen::VectorXd r = free_part(elasticity.forces(x) + loads, number, count);
    if (r.norm() <= kBalanced * loads.norm()) return x;
    const Eigen::SimplicialLDLT<SparseDoubles> factor(free_part(elasticity.stiffness(x), number, count));
    const Eigen::VectorXd d = factor.solve(r);
    const double before = potential(x);
    double step = 1.0;
    const auto moved = [&](double by) {
      NodeVectors to = x;
      add_free(to, by, d, number);
      return to;
    };
    NodeVectors next = moved(step);
    while (step > 1e-4 && !(potential(next) <= before + 1e-9 * std::abs(before))) step *= 0.5, next = moved(step);
    x = std::move(next);
  }
  return NodeVectors::Constant(x.rows(), 3, std::nan(""));
}

}  // namespace limber::testing
