#include "solver/elastic_system.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "limber/core/cross_matrix.h"
#include "limber/core/disjoint_sets.h"
#include "limber/solvers/block_factor.h"

namespace limber::internal {
namespace {

constexpr double kSweepWork = 40.0;  // multiply-adds of factor() in the time that a step takes per number of the factor

/// The part of a link's matrix between its bodies, rows b and columns a. @param turn R_bᵀ R_a
TwistMatrix cross_block(const StrainLink& link, const Mat3& turn) {
  const Mat3 sa = cross_matrix(link.arm_a), sb = cross_matrix(link.arm_b);
  TwistMatrix out;
  Mat3 rotation = -link.weight * sb * turn * sa;
  for (int k = 0; k < 3; ++k) {
    const Mat3 l = cross_matrix(link.spread.col(k));
    rotation -= l * turn * l;
  }
  out.topLeftCorner<3, 3>() = -rotation;
  out.topRightCorner<3, 3>() = -link.weight * sb * turn;
  out.bottomLeftCorner<3, 3>() = link.weight * turn * sa;
  out.bottomRightCorner<3, 3>() = -link.weight * turn;
  return out;
}

}  // namespace

TwistMatrix own_block(double weight, const Vec3& arm, const Mat3& spread) {
  const Mat3 s = cross_matrix(arm), second = spread * spread.transpose();
  TwistMatrix out;
  out.topLeftCorner<3, 3>() = -weight * s * s + second.trace() * Mat3::Identity() - second;
  out.topRightCorner<3, 3>() = weight * s;
  out.bottomLeftCorner<3, 3>() = -weight * s;
  out.bottomRightCorner<3, 3>() = weight * Mat3::Identity();
  return out;
}

/// Bodies that links connect; its numbers in vectors are those of its factor, eight to a body.
struct ElasticSystem::Block {
  std::vector<Index> bodies{};      // ascending
  std::vector<Index> links{};       // of the structure, between bodies that are not pinned
  std::vector<Index> edge_links{};  // to a pinned body
  std::vector<Index> interface {};  // places in `bodies`
  Index first = 0;                  // dof
  Index interface_first = 0;        // interface dof
  double volume = 0.0;
  BlockFactor factor{};
  std::vector<BlockFactor::Block> own{};                       // per body
  std::vector<std::pair<BlockFactor::Block, bool>> between{};  // per link; whether its rows are a's
  AlignedBuffer vector{};                                      // between the sweeps
  AlignedBuffer followers{};  // per twist of the interface, one after another: what it does to all

  void scatter(const VectorX& f) {
    double* x = vector.need(factor.size());
    for (std::size_t i = 0; i < bodies.size(); ++i)
      Eigen::Map<Twist>(x + factor.first(i)) = f.segment<6>(first + 6 * static_cast<Index>(i));
  }
};

ElasticSystem::~ElasticSystem() = default;
ElasticSystem::ElasticSystem(ElasticSystem&&) noexcept = default;
ElasticSystem& ElasticSystem::operator=(ElasticSystem&&) noexcept = default;

ElasticSystem::ElasticSystem(const PoseStructure& structure, const std::vector<bool>& interface, double proximal,
                             double proximal_of_linked)
    : structure_(&structure), proximal_(proximal), proximal_of_linked_(proximal_of_linked) {
  const auto& bodies = structure.bodies;
  const auto pinned = [&](Index b) { return bodies[static_cast<std::size_t>(b)].pinned; };
  DisjointSets sets(bodies.size());
  for (const StrainLink& link : structure.links)
    if (!pinned(link.a) && !pinned(link.b)) sets.join(link.a, link.b);
  dof_.assign(bodies.size(), -1);
  block_of_.assign(bodies.size(), -1);
  interface_dof_.assign(bodies.size(), -1);
  std::vector<Index> block_of_root(bodies.size(), -1);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b].pinned) continue;
    Index& block = block_of_root[static_cast<std::size_t>(sets.root(static_cast<Index>(b)))];
    if (block < 0) {
      block = static_cast<Index>(blocks_.size());
      blocks_.emplace_back();
    }
    block_of_[b] = block;
    blocks_[static_cast<std::size_t>(block)].bodies.push_back(static_cast<Index>(b));
  }
  for (std::size_t l = 0; l < structure.links.size(); ++l) {
    const StrainLink& link = structure.links[l];
    if (pinned(link.a) && pinned(link.b)) continue;
    const bool edge = pinned(link.a) || pinned(link.b);
    Block& block =
        blocks_[static_cast<std::size_t>(block_of_[static_cast<std::size_t>(pinned(link.a) ? link.b : link.a)])];
    (edge ? block.edge_links : block.links).push_back(static_cast<Index>(l));
  }
  for (Block& block : blocks_) number(block, interface);
  for (Block& block : blocks_) place(block);
}

/// Places of the block's unknowns.
void ElasticSystem::number(Block& block, const std::vector<bool>& interface) {
  block.first = dofs_;
  block.interface_first = interface_dofs_;
  for (std::size_t i = 0; i < block.bodies.size(); ++i) {
    const auto b = static_cast<std::size_t>(block.bodies[i]);
    dof_[b] = dofs_;
    dofs_ += 6;
    block.volume += structure_->bodies[b].volume;
    if (!interface[b]) continue;
    interface_dof_[b] = interface_dofs_;
    interface_dofs_ += 6;
    block.interface.push_back(static_cast<Index>(i));
  }
}

/// The pattern of the block's matrix, once.
void ElasticSystem::place(Block& block) const {
  const auto node = [&](Index body) { return static_cast<std::size_t>((dof(body) - block.first) / 6); };
  block.factor.begin_pattern(std::vector<std::size_t>(block.bodies.size(), 6));
  for (const Index l : block.links) {
    const StrainLink& link = structure_->links[static_cast<std::size_t>(l)];
    block.factor.add_edge(node(link.a), node(link.b));
  }
  for (const Index i : block.interface) {
    block.factor.keep(static_cast<std::size_t>(i));
    for (const Index j : block.interface)
      block.factor.add_edge(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
  }
  block.factor.end_pattern();
  for (std::size_t i = 0; i < block.bodies.size(); ++i) block.own.push_back(block.factor.block(i, i));
  for (const Index l : block.links) {
    const StrainLink& link = structure_->links[static_cast<std::size_t>(l)];
    const bool rows_a = block.factor.comes_first(node(link.a), node(link.b));
    block.between.emplace_back(
        rows_a ? block.factor.block(node(link.a), node(link.b)) : block.factor.block(node(link.b), node(link.a)),
        rows_a);
  }
}

void ElasticSystem::assemble(Block& block, const std::vector<Mat3>& rotations,
                             const std::vector<TwistMatrix>& added) const {
  const auto& s = *structure_;
  std::vector<TwistMatrix> diagonal(block.bodies.size(), TwistMatrix::Zero());
  const auto own = [&](Index body) -> TwistMatrix& {
    return diagonal[static_cast<std::size_t>((dof(body) - block.first) / 6)];
  };
  for (std::size_t i = 0; i < block.bodies.size(); ++i) {
    const auto b = static_cast<std::size_t>(block.bodies[i]);
    // Each block weighs the same, so that a small part is no worse conditioned than a large one.
    const double mass = (block.bodies.size() > 1 ? proximal_of_linked_ : proximal_) * s.bodies[b].volume / block.volume;
    diagonal[i].topLeftCorner<3, 3>() = mass * s.bodies[b].radius_squared * Mat3::Identity();
    diagonal[i].bottomRightCorner<3, 3>() = mass * Mat3::Identity();
    diagonal[i] += added[b];
  }
  block.factor.set_identity();
  const auto write = [&](const BlockFactor::Block& at, const TwistMatrix& m) {
    double* values = block.factor.upper(at);
    for (int r = 0; r < 6; ++r) Eigen::Map<Twist>(values + static_cast<std::size_t>(r) * at.stride) = m.row(r);
  };
  for (std::size_t i = 0; i < block.links.size(); ++i) {
    const StrainLink& link = s.links[static_cast<std::size_t>(block.links[i])];
    own(link.a) += own_block(link.weight, link.arm_a, link.spread);
    own(link.b) += own_block(link.weight, link.arm_b, link.spread);
    const TwistMatrix between = cross_block(
        link, rotations[static_cast<std::size_t>(link.b)].transpose() * rotations[static_cast<std::size_t>(link.a)]);
    const auto& [at, rows_a] = block.between[i];
    write(at, rows_a ? TwistMatrix(between.transpose()) : between);
  }
  for (const Index l : block.edge_links) {
    const StrainLink& link = s.links[static_cast<std::size_t>(l)];
    const bool a = dof(link.a) >= 0;
    own(a ? link.a : link.b) += own_block(link.weight, a ? link.arm_a : link.arm_b, link.spread);
  }
  for (std::size_t i = 0; i < diagonal.size(); ++i) write(block.own[i], diagonal[i]);
}

/// Schur complement at the block's interface, into S.
void ElasticSystem::take_interface(Block& block, MatrixX& S) const {
  for (std::size_t i = 0; i < block.interface.size(); ++i)
    for (std::size_t j = 0; j < block.interface.size(); ++j) {
      const auto a = static_cast<std::size_t>(block.interface[i]), b = static_cast<std::size_t>(block.interface[j]);
      if (a != b && !block.factor.comes_first(a, b)) continue;
      const BlockFactor::Block at = block.factor.block(a, b);
      const auto row = block.interface_first + static_cast<Eigen::Index>(6 * i),
                 column = block.interface_first + static_cast<Eigen::Index>(6 * j);
      for (int r = 0; r < 6; ++r)
        S.block<1, 6>(row + r, column) =
            Eigen::Map<const Twist>(block.factor.upper(at) + static_cast<std::size_t>(r) * at.stride).transpose();
      if (a != b) S.block<6, 6>(column, row) = S.block<6, 6>(row, column).transpose();
    }
}

/// One pass through the factor for all of them, so that following takes none later.
void ElasticSystem::find_followers(Block& block) const {
  const std::size_t size = block.factor.size(), count = 6 * block.interface.size();
  double* x = block.followers.need(count * size);
  std::fill_n(x, count * size, 0.0);
  for (std::size_t i = 0; i < count; ++i)
    x[i * size + block.factor.first(static_cast<std::size_t>(block.interface[i / 6])) + i % 6] = 1.0;
  block.factor.expand(x, count);
}

bool ElasticSystem::factor(const std::vector<Mat3>& rotations, const std::vector<TwistMatrix>& added,
                           const std::vector<PairTerm>& between) {
  MatrixX S = MatrixX::Zero(interface_dofs_, interface_dofs_);
  for (Block& block : blocks_) {
    assemble(block, rotations, added);
    if (!block.factor.factor()) return false;
    take_interface(block, S);
    find_followers(block);
  }
  for (const PairTerm& term : between) {
    const std::array<Index, 2> at{interface_dof(term.a), interface_dof(term.b)};
    for (std::size_t i = 0; i < 2; ++i)
      for (std::size_t j = 0; j < 2; ++j)
        if (at[i] >= 0 && at[j] >= 0)
          S.block<6, 6>(at[i], at[j]) += term.matrix.block<6, 6>(6 * static_cast<int>(i), 6 * static_cast<int>(j));
  }
  const Eigen::LLT<MatrixX> llt(S);
  if (llt.info() != Eigen::Success) return false;
  inverse_ = llt.solve(MatrixX::Identity(S.rows(), S.cols()));
  return true;
}

double ElasticSystem::factor_cost() const {
  double work = 0.0, numbers = 0.0;
  for (const Block& block : blocks_)
    work += block.factor.work(), numbers += static_cast<double>(block.factor.numbers());
  return work / (kSweepWork * std::max(numbers, 1.0));
}

void ElasticSystem::reduce(const VectorX& f, VectorX& interface) {
  VectorX left(interface_dofs_);
  for (Block& block : blocks_) {
    block.scatter(f);
    double* x = block.vector.data();
    block.factor.reduce(x);
    for (std::size_t i = 0; i < block.interface.size(); ++i)
      left.segment<6>(block.interface_first + static_cast<Eigen::Index>(6 * i)) =
          Eigen::Map<const Twist>(x + block.factor.first(static_cast<std::size_t>(block.interface[i])));
  }
  interface = inverse_ * left;
}

void ElasticSystem::expand(const VectorX& interface, VectorX& u) {
  u.resize(dofs_);
  for (Block& block : blocks_) {
    double* x = block.vector.data();
    for (std::size_t i = 0; i < block.interface.size(); ++i)
      Eigen::Map<Twist>(x + block.factor.first(static_cast<std::size_t>(block.interface[i]))) =
          interface.segment<6>(block.interface_first + 6 * static_cast<Index>(i));
    block.factor.expand(x);
    for (std::size_t i = 0; i < block.bodies.size(); ++i)
      u.segment<6>(block.first + 6 * static_cast<Index>(i)) = Eigen::Map<const Twist>(x + block.factor.first(i));
  }
}

void ElasticSystem::follow(const VectorX& interface, VectorX& u) const {
  u.resize(dofs_);
  for (const Block& block : blocks_) {
    const auto size = static_cast<Eigen::Index>(block.factor.size()),
               count = static_cast<Eigen::Index>(6 * block.interface.size());
    const VectorX x = Eigen::Map<const MatrixX>(block.followers.data(), size, count) *
                      interface.segment(block.interface_first, count);
    for (std::size_t i = 0; i < block.bodies.size(); ++i)
      u.segment<6>(block.first + 6 * static_cast<Index>(i)) =
          x.segment<6>(static_cast<Eigen::Index>(block.factor.first(i)));
  }
}

/// Jᵀ f at the interface.
void ElasticSystem::add_force(const Row& row, double f, VectorX& interface) const {
  for (const auto& [body, J] : {std::pair(row.a, &row.J_a), std::pair(row.b, &row.J_b)})
    if (body >= 0 && dof(body) >= 0) interface.segment<6>(interface_dof(body)) += f * *J;
}

MatrixX ElasticSystem::compliance(const std::vector<Row>& rows) const {
  const auto m = static_cast<Eigen::Index>(rows.size());
  MatrixX out(m, m);
  for (Eigen::Index i = 0; i < m; ++i) {
    const Row& row = rows[static_cast<std::size_t>(i)];
    VectorX response = VectorX::Zero(interface_dofs_);
    for (const auto& [body, J] : {std::pair(row.a, &row.J_a), std::pair(row.b, &row.J_b)})
      if (body >= 0 && dof(body) >= 0) response += inverse_.middleCols<6>(interface_dof(body)) * *J;
    out.row(i) = apply(rows, response);
  }
  return out;
}

VectorX ElasticSystem::apply(const std::vector<Row>& rows, const VectorX& interface) const {
  VectorX out = VectorX::Zero(static_cast<Eigen::Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (const auto& [body, J] : {std::pair(rows[i].a, &rows[i].J_a), std::pair(rows[i].b, &rows[i].J_b)})
      if (body >= 0 && dof(body) >= 0)
        out[static_cast<Eigen::Index>(i)] += J->dot(interface.segment<6>(interface_dof(body)));
  return out;
}

void ElasticSystem::subtract_response(const std::vector<Row>& rows, const VectorX& lambda, VectorX& interface) const {
  VectorX force = VectorX::Zero(interface_dofs_);
  for (std::size_t i = 0; i < rows.size(); ++i) add_force(rows[i], lambda[static_cast<Eigen::Index>(i)], force);
  interface -= inverse_ * force;
}

}  // namespace limber::internal
