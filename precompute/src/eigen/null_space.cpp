#include "eigen/null_space.h"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <string>

#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"

namespace limber::internal {
namespace {

constexpr double kInLine = 1e-9;     // of the body's size
constexpr double kDependent = 1e-9;  // pivots below this, relative to the largest, are round-off
constexpr int kMaxParts = 300;       // 1,800 unknowns, dense: seconds

/// Coordinates centred on the body and scaled to about one, so that t and r weigh alike.
struct Scaled {
  Vec3 centre = Vec3::Zero();
  double size = 1.0;
  Vec3 operator()(const Vec3& x) const { return (x - centre) / size; }
};

Scaled scaled_coordinates(const TetMesh& mesh) {
  Vec3 low = mesh.nodes[0], high = mesh.nodes[0];
  for (const Vec3& x : mesh.nodes) low = low.cwiseMin(x), high = high.cwiseMax(x);
  return {.centre = (low + high) / 2.0, .size = (high - low).norm() / 2.0};
}

/// 3 × 6: the velocity t + r × y at a point.
Eigen::Matrix<double, 3, 6> motion_at(const Vec3& y) {
  Eigen::Matrix<double, 3, 6> J;
  J.leftCols<3>().setIdentity();
  J.rightCols<3>() << 0, y.z(), -y.y(), -y.z(), 0, y.x(), y.y(), -y.x(), 0;
  return J;
}

/// Up to three of some places that span what all of them do: the first, the farthest from it, the farthest from the
/// line through both.
struct Span {
  std::vector<std::size_t> chosen;  // one place: a point; two: a line; three: a plane or all of space
  Vec3 direction = Vec3::UnitX();   // of the line
};

Span span_of(std::span<const Vec3> places) {
  Span span{.chosen = {0}};
  std::size_t far = 0, off = 0;
  double reach = kInLine, distance = kInLine;
  for (std::size_t i = 0; i < places.size(); ++i)
    if (const double d = (places[i] - places[0]).norm(); d > reach) reach = d, far = i;
  if (far == 0) return span;
  span.chosen.push_back(far);
  span.direction = (places[far] - places[0]).normalized();
  for (std::size_t i = 0; i < places.size(); ++i)
    if (const double d = (places[i] - places[0]).cross(span.direction).norm(); d > distance) distance = d, off = i;
  if (off != 0) span.chosen.push_back(off);
  return span;
}

/// Which parts touch each node, each once, ascending.
std::vector<std::vector<Index>> parts_of_nodes(const TetMesh& mesh, const std::vector<Index>& part) {
  std::vector<std::vector<Index>> parts(mesh.nodes.size());
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (const Index node : TetNodes(mesh, e))
      if (std::find(parts[node].begin(), parts[node].end(), part[e]) == parts[node].end())
        parts[node].push_back(part[e]);
  for (auto& p : parts) std::sort(p.begin(), p.end());
  return parts;
}

/// The rigid parts of a body: numbered 0, 1, … and listed per node.
struct Parts {
  Index count = 0;
  std::vector<std::vector<Index>> of_node;
};

// Parts that share three nodes not in line are one part. This only spares unknowns: the equations would say the same.
bool merge_parts_that_share_three_nodes(const TetMesh& mesh, const Scaled& scaled, std::vector<Index>& part) {
  struct Shared {
    Index a, b;
    Vec3 place;
  };
  std::vector<Shared> shared;
  const auto of_node = parts_of_nodes(mesh, part);
  for (std::size_t node = 0; node < of_node.size(); ++node)
    for (std::size_t i = 0; i < of_node[node].size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        shared.push_back({of_node[node][j], of_node[node][i], scaled(mesh.nodes[node])});
  const auto same_pair = [](const Shared& s, const Shared& t) { return s.a == t.a && s.b == t.b; };
  std::stable_sort(shared.begin(), shared.end(),
                   [](const Shared& s, const Shared& t) { return std::pair(s.a, s.b) < std::pair(t.a, t.b); });
  DisjointSets sets(mesh.tets.size());
  bool merged = false;
  for (std::size_t begin = 0, end = 0; begin < shared.size(); begin = end) {
    std::vector<Vec3> places;
    for (end = begin; end < shared.size() && same_pair(shared[begin], shared[end]); ++end)
      places.push_back(shared[end].place);
    if (span_of(places).chosen.size() == 3) merged |= sets.join(shared[begin].a, shared[begin].b);
  }
  for (Index& p : part) p = sets.root(p);
  return merged;
}

Parts find_parts(const TetMesh& mesh, const Scaled& scaled) {
  std::vector<Index> part = face_connected_parts(mesh);
  while (merge_parts_that_share_three_nodes(mesh, scaled, part)) {
  }
  Parts parts;
  std::vector<Index> number(mesh.tets.size(), -1);
  for (Index& p : part) {
    if (number[p] < 0) number[p] = parts.count++;
    p = number[p];
  }
  parts.of_node = parts_of_nodes(mesh, part);
  return parts;
}

/// For each part, up to three of its fixed nodes that hold it as firmly as all of them.
std::vector<Index> sufficient_nodes(const TetMesh& mesh, const Scaled& scaled, const Parts& parts,
                                    std::span<const Index> fixed_nodes) {
  std::vector<std::vector<Index>> fixed_of_part(parts.count);
  for (const Index node : fixed_nodes) fixed_of_part[parts.of_node[node][0]].push_back(node);
  std::vector<Index> sufficient;
  for (const auto& nodes : fixed_of_part) {
    if (nodes.empty()) continue;
    std::vector<Vec3> places;
    places.reserve(nodes.size());
    for (const Index node : nodes) places.push_back(scaled(mesh.nodes[node]));
    for (const std::size_t i : span_of(places).chosen) sufficient.push_back(nodes[i]);
  }
  return sufficient;
}

/// The equations, transposed: 6 · parts rows, one column each.
Eigen::MatrixXd constraint_columns(const TetMesh& mesh, const Scaled& scaled, const Parts& parts,
                                   std::span<const Index> fixed_nodes) {
  const std::vector<Index> held = sufficient_nodes(mesh, scaled, parts, fixed_nodes);
  Eigen::Index columns = 3 * static_cast<Eigen::Index>(held.size());
  for (const auto& p : parts.of_node) columns += 3 * (static_cast<Eigen::Index>(p.size()) - 1);
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(6 * parts.count, columns);
  Eigen::Index column = 0;
  for (std::size_t node = 0; node < parts.of_node.size(); ++node) {
    const auto J = motion_at(scaled(mesh.nodes[node]));
    const auto& p = parts.of_node[node];
    for (std::size_t i = 1; i < p.size(); ++i, column += 3) {
      C.block<6, 3>(6 * p[0], column) = J.transpose();
      C.block<6, 3>(6 * p[i], column) = -J.transpose();
    }
  }
  for (const Index node : held) {
    C.block<6, 3>(6 * parts.of_node[node][0], column) = motion_at(scaled(mesh.nodes[node])).transpose();
    column += 3;
  }
  return C;
}

/// Rigid motions of the whole body that vanish at the fixed nodes: 6 × dimension, about the scaled centre.
Eigen::MatrixXd rigid_motions(const RigidFreedom& freedom, const Scaled& scaled) {
  const Vec3 p = scaled(freedom.pivot);
  const auto turn = [&](const Vec3& axis) {
    Eigen::Matrix<double, 6, 1> motion;
    motion << -axis.cross(p), axis;
    return motion;
  };
  Eigen::MatrixXd R(6, freedom.dimension());
  if (freedom.motion == FrameMotion::kFree) R.setIdentity();
  if (freedom.motion == FrameMotion::kPoint)
    for (int a = 0; a < 3; ++a) R.col(a) = turn(Vec3::Unit(a));
  if (freedom.motion == FrameMotion::kLine) R.col(0) = turn(freedom.line_axis);
  return R;
}

/// Displacements of all nodes from the motions of the parts (6 · parts × count).
Eigen::MatrixXd at_nodes(const TetMesh& mesh, const Scaled& scaled, const Parts& parts, const Eigen::MatrixXd& motions,
                         std::span<const Index> fixed_nodes) {
  Eigen::MatrixXd N(3 * mesh.nodes.size(), motions.cols());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    N.middleRows<3>(3 * node) = motion_at(scaled(mesh.nodes[node])) * motions.middleRows<6>(6 * parts.of_node[node][0]);
  // The middle of an edge moves as the mean of its ends to the bit, wherever rounding put it.
  for (std::size_t t = 0; t < mesh.mid_edge_nodes.size(); ++t)
    for (std::size_t e = 0; e < kTetEdges.size(); ++e) {
      const Index a = mesh.tets[t][kTetEdges[e][0]], b = mesh.tets[t][kTetEdges[e][1]];
      N.middleRows<3>(3 * mesh.mid_edge_nodes[t][e]) = 0.5 * (N.middleRows<3>(3 * a) + N.middleRows<3>(3 * b));
    }
  for (const Index node : fixed_nodes) N.middleRows<3>(3 * node).setZero();
  return N;
}

void check_part_count(Index count) {
  if (count > kMaxParts)
    throw ComputationError("the body is " + std::to_string(count) +
                           " pieces that hang together only by single nodes or edges, expected at most " +
                           std::to_string(kMaxParts) + ": remesh it so that neighbouring tetrahedra share faces");
}

struct Unreached {
  Eigen::MatrixXd motions;  // orthonormal columns
  double weakest_constraint = 1.0;
};

/// The motions of the parts that satisfy all equations: what is orthogonal to the columns of C.
Unreached orthogonal_complement(const Eigen::MatrixXd& C) {
  if (C.cols() == 0) return {.motions = Eigen::MatrixXd::Identity(C.rows(), C.rows())};
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(C);
  const Eigen::VectorXd pivots = qr.matrixQR().diagonal().cwiseAbs() / qr.maxPivot();
  Eigen::Index rank = 0;
  while (rank < pivots.size() && pivots[rank] > kDependent) ++rank;
  Unreached unreached{.motions = Eigen::MatrixXd::Zero(C.rows(), C.rows() - rank),
                      .weakest_constraint = pivots[rank - 1]};
  unreached.motions.bottomRows(C.rows() - rank).setIdentity();
  unreached.motions.applyOnTheLeft(qr.householderQ());
  return unreached;
}

/// Orthonormal columns that complete `part` to the span of `whole`, which holds it. Empty if nothing is missing.
Eigen::MatrixXd completion(const Eigen::MatrixXd& part, const Eigen::MatrixXd& whole) {
  const Eigen::Index missing = std::max<Eigen::Index>(whole.cols() - part.cols(), 0);
  if (part.cols() == 0 || missing == 0) return whole.leftCols(missing);
  const Eigen::MatrixXd Q =
      Eigen::HouseholderQR<Eigen::MatrixXd>(part).householderQ() * Eigen::MatrixXd::Identity(part.rows(), part.cols());
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> rest(whole - Q * (Q.transpose() * whole));
  return rest.householderQ() * Eigen::MatrixXd::Identity(whole.rows(), missing);
}

}  // namespace

int RigidFreedom::dimension() const {
  switch (motion) {
    case FrameMotion::kFree:
      return 6;
    case FrameMotion::kPoint:
      return 3;
    case FrameMotion::kLine:
      return 1;
    case FrameMotion::kKinematic:
      return 0;
  }
  return 0;
}

RigidFreedom rigid_freedom(const TetMesh& mesh, std::span<const Index> fixed_nodes) {
  RigidFreedom freedom;
  if (fixed_nodes.empty()) return freedom;
  const Scaled scaled = scaled_coordinates(mesh);
  std::vector<Vec3> places;
  for (const Index node : fixed_nodes) places.push_back(scaled(mesh.nodes[node]));
  const Span span = span_of(places);
  constexpr std::array kLeft{FrameMotion::kPoint, FrameMotion::kLine, FrameMotion::kKinematic};
  freedom.motion = kLeft[span.chosen.size() - 1];
  freedom.pivot = mesh.nodes[fixed_nodes.front()];
  freedom.line_axis = span.direction;
  return freedom;
}

NullSpace find_null_space(const TetMesh& mesh, std::span<const Index> fixed_nodes) {
  const Scaled scaled = scaled_coordinates(mesh);
  const Parts parts = find_parts(mesh, scaled);
  check_part_count(parts.count);
  NullSpace space;
  space.rigid = rigid_freedom(mesh, fixed_nodes);
  const Eigen::MatrixXd rigid = rigid_motions(space.rigid, scaled).replicate(parts.count, 1);
  const Unreached free = orthogonal_complement(constraint_columns(mesh, scaled, parts, fixed_nodes));
  const Eigen::MatrixXd mechanisms = completion(rigid, free.motions);
  space.mechanisms = static_cast<int>(mechanisms.cols());
  space.weakest_constraint = free.weakest_constraint;
  Eigen::MatrixXd motions(rigid.rows(), rigid.cols() + mechanisms.cols());
  motions << rigid, mechanisms;
  space.basis = at_nodes(mesh, scaled, parts, motions, fixed_nodes);
  return space;
}

}  // namespace limber::internal
