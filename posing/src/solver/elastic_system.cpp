#include "solver/elastic_system.h"

#include <Eigen/SparseCholesky>
#include <algorithm>

#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"

namespace limber::internal {
namespace {

using SparseMatrix = Eigen::SparseMatrix<double>;
using Factor = Eigen::SimplicialLLT<SparseMatrix>;

Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

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

/// Bodies that links connect. The lower triangle of its matrix, columns of six.
struct ElasticSystem::Block {
  std::vector<Index> bodies{};      // ascending
  std::vector<Index> links{};       // of the structure, between bodies that are not pinned
  std::vector<Index> edge_links{};  // to a pinned body
  std::vector<Index> interface {};  // places in `bodies`
  Index first = 0;                  // dof
  double volume = 0.0;
  SparseMatrix matrix{};
  std::vector<std::array<Index, 6>> link_at{};  // per link and column: where its six values begin in the matrix
  std::unique_ptr<Factor> factor = std::make_unique<Factor>();  // Eigen's do not move
  MatrixX columns{};                                            // H⁻¹ E, 6 per interface body
  MatrixX compliance{};                                         // Eᵀ H⁻¹ E
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
  slot_of_.assign(bodies.size(), -1);
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
  for (Block& block : blocks_) {
    block.first = dofs_;
    for (std::size_t i = 0; i < block.bodies.size(); ++i) {
      const auto b = static_cast<std::size_t>(block.bodies[i]);
      dof_[b] = dofs_;
      dofs_ += 6;
      block.volume += bodies[b].volume;
      if (!interface[b]) continue;
      slot_of_[b] = static_cast<Index>(block.interface.size());
      block.interface.push_back(static_cast<Index>(i));
    }
  }
  for (std::size_t l = 0; l < structure.links.size(); ++l) {
    const StrainLink& link = structure.links[l];
    if (pinned(link.a) && pinned(link.b)) continue;
    const bool edge = pinned(link.a) || pinned(link.b);
    Block& block =
        blocks_[static_cast<std::size_t>(block_of_[static_cast<std::size_t>(pinned(link.a) ? link.b : link.a)])];
    (edge ? block.edge_links : block.links).push_back(static_cast<Index>(l));
  }
  for (Block& block : blocks_) {
    // The pattern, once: column by column, the diagonal block and then the links below it, ascending.
    const auto n = static_cast<Index>(6 * block.bodies.size());
    std::vector<Eigen::Triplet<double>> pattern;
    const auto add = [&](Index row, Index column) {
      for (Index c = 0; c < 6; ++c)
        for (Index r = row == column ? c : 0; r < 6; ++r) pattern.emplace_back(row + r, column + c, 1.0);
    };
    for (Index i = 0; i < n; i += 6) add(i, i);
    for (const Index l : block.links) {
      const StrainLink& link = structure.links[static_cast<std::size_t>(l)];
      add(dof(link.b) - block.first, dof(link.a) - block.first);
    }
    block.matrix.resize(n, n);
    block.matrix.setFromTriplets(pattern.begin(), pattern.end());
    block.factor->analyzePattern(block.matrix);
    const auto* inner = block.matrix.innerIndexPtr();
    const auto* outer = block.matrix.outerIndexPtr();
    for (const Index l : block.links) {
      const StrainLink& link = structure.links[static_cast<std::size_t>(l)];
      const Index row = dof(link.b) - block.first, column = dof(link.a) - block.first;
      std::array<Index, 6> at{};
      for (Index c = 0; c < 6; ++c) {
        const auto* begin = inner + outer[column + c];
        at[static_cast<std::size_t>(c)] =
            static_cast<Index>(std::lower_bound(begin, inner + outer[column + c + 1], row) - inner);
      }
      block.link_at.push_back(at);
    }
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
  double* values = block.matrix.valuePtr();
  for (std::size_t i = 0; i < block.links.size(); ++i) {
    const StrainLink& link = s.links[static_cast<std::size_t>(block.links[i])];
    own(link.a) += own_block(link.weight, link.arm_a, link.spread);
    own(link.b) += own_block(link.weight, link.arm_b, link.spread);
    const TwistMatrix between = cross_block(
        link, rotations[static_cast<std::size_t>(link.b)].transpose() * rotations[static_cast<std::size_t>(link.a)]);
    for (int c = 0; c < 6; ++c)
      Eigen::Map<Twist>(values + block.link_at[i][static_cast<std::size_t>(c)]) = between.col(c);
  }
  for (const Index l : block.edge_links) {
    const StrainLink& link = s.links[static_cast<std::size_t>(l)];
    const bool a = dof(link.a) >= 0;
    own(a ? link.a : link.b) += own_block(link.weight, a ? link.arm_a : link.arm_b, link.spread);
  }
  const auto* outer = block.matrix.outerIndexPtr();
  for (std::size_t i = 0; i < diagonal.size(); ++i)
    for (int c = 0; c < 6; ++c)
      for (int r = c; r < 6; ++r) values[outer[6 * static_cast<int>(i) + c] + r - c] = diagonal[i](r, c);
}

void ElasticSystem::factor(const std::vector<Mat3>& rotations, const std::vector<TwistMatrix>& added) {
  for (Block& block : blocks_) {
    assemble(block, rotations, added);
    block.factor->factorize(block.matrix);
    if (block.factor->info() != Eigen::Success)
      throw ComputationError("posing: the strain matrix is not positive definite, expected finite poses");
    MatrixX unit = MatrixX::Zero(block.matrix.rows(), static_cast<Eigen::Index>(6 * block.interface.size()));
    for (std::size_t i = 0; i < block.interface.size(); ++i)
      unit.block<6, 6>(6 * block.interface[i], static_cast<Eigen::Index>(6 * i)).setIdentity();
    block.columns = block.factor->solve(unit);
    block.compliance.resize(unit.cols(), unit.cols());
    for (std::size_t i = 0; i < block.interface.size(); ++i)
      block.compliance.middleRows<6>(static_cast<Eigen::Index>(6 * i)) =
          block.columns.middleRows<6>(6 * block.interface[i]);
  }
}

void ElasticSystem::solve(const VectorX& f, VectorX& u) const {
  u.resize(dofs_);
  for (const Block& block : blocks_)
    u.segment(block.first, block.matrix.rows()) = block.factor->solve(f.segment(block.first, block.matrix.rows()));
}

double ElasticSystem::square(const VectorX& u) const {
  double out = 0.0;
  for (const Block& block : blocks_) {
    const auto own = u.segment(block.first, block.matrix.rows());
    out += own.dot(block.matrix.selfadjointView<Eigen::Lower>() * own);
  }
  return out;
}

ElasticSystem::InterfaceRows ElasticSystem::at_interface(const std::vector<Row>& rows) const {
  InterfaceRows out(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto piece = [&](Index body, const Twist& J) -> InterfaceRow {
      if (body < 0 || dof(body) < 0) return {};
      return {block_of_[static_cast<std::size_t>(body)], slot_of_[static_cast<std::size_t>(body)], J};
    };
    out[i] = {piece(rows[i].a, rows[i].J_a), piece(rows[i].b, rows[i].J_b)};
  }
  return out;
}

MatrixX ElasticSystem::compliance(const InterfaceRows& rows) const {
  const auto m = static_cast<Eigen::Index>(rows.size());
  MatrixX out = MatrixX::Zero(m, m);
  // Rows that act on a block meet there alone.
  std::vector<std::vector<std::pair<Eigen::Index, const InterfaceRow*>>> acting(blocks_.size());
  for (Eigen::Index i = 0; i < m; ++i)
    for (const InterfaceRow& piece : rows[static_cast<std::size_t>(i)])
      if (piece.block >= 0) acting[static_cast<std::size_t>(piece.block)].emplace_back(i, &piece);
  for (std::size_t b = 0; b < blocks_.size(); ++b)
    for (const auto& [i, row] : acting[b]) {
      const VectorX response = blocks_[b].compliance.middleCols<6>(6 * row->offset) * row->J;
      for (const auto& [j, other] : acting[b]) out(i, j) += other->J.dot(response.segment<6>(6 * other->offset));
    }
  return out;
}

VectorX ElasticSystem::apply(const InterfaceRows& rows, const VectorX& u) const {
  VectorX out = VectorX::Zero(static_cast<Eigen::Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (const InterfaceRow& piece : rows[i]) {
      if (piece.block < 0) continue;
      const Block& block = blocks_[static_cast<std::size_t>(piece.block)];
      out[static_cast<Eigen::Index>(i)] +=
          piece.J.dot(u.segment<6>(block.first + 6 * block.interface[static_cast<std::size_t>(piece.offset)]));
    }
  return out;
}

void ElasticSystem::subtract_response(const InterfaceRows& rows, const VectorX& lambda, VectorX& u) const {
  std::vector<VectorX> force(blocks_.size());
  for (std::size_t b = 0; b < blocks_.size(); ++b) force[b] = VectorX::Zero(blocks_[b].columns.cols());
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (const InterfaceRow& piece : rows[i])
      if (piece.block >= 0)
        force[static_cast<std::size_t>(piece.block)].segment<6>(6 * piece.offset) +=
            lambda[static_cast<Eigen::Index>(i)] * piece.J;
  for (std::size_t b = 0; b < blocks_.size(); ++b)
    if (!force[b].isZero(0.0)) u.segment(blocks_[b].first, blocks_[b].columns.rows()) -= blocks_[b].columns * force[b];
}

}  // namespace limber::internal
