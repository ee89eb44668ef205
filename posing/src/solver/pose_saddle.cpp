// Whether a pose at which steps end is a minimum, and the way on where it is a saddle.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "solver/pose_solver.h"

namespace limber::internal {
namespace {

constexpr double kNegative = 1e-6;    // of the matrix: negative curvature that is more than round-off
constexpr double kExhausted = 1e-10;  // what a direction adds to those before it, of itself
constexpr int kMostDirections = 40;   // of Lanczos' method; a mechanism has as many as freedoms
constexpr int kHalvings = 30;
constexpr double kLower = 1e-3;  // of the decrease that the curvature promises

/// Numbers between −1 and 1 without symmetry, the same on every run.
VectorX uneven(Eigen::Index n) {
  VectorX out(n);
  for (Eigen::Index i = 0; i < n; ++i)
    out[i] = 2.0 * std::fmod(0.6180339887498949 * static_cast<double>(i + 1), 1.0) - 1.0;
  return out;
}

}  // namespace

/// (P − H) u: the matrix P is that of single bodies, H has all second derivatives.
VectorX PoseSolver::surplus(const Curvature& curvature, const VectorX& twists) const {
  VectorX out = VectorX::Zero(twists.size());
  for (std::size_t b = 0; b < curvature.whole.size(); ++b)
    if (const Index d = system_.dof(static_cast<Index>(b)); d >= 0)
      out.segment<6>(d) += (curvature.single[b] - curvature.whole[b]) * twists.segment<6>(d);
  for (const PairTerm& pair : curvature.joints) {
    PairVector u = PairVector::Zero();
    const Index a = pair.a < 0 ? -1 : system_.dof(pair.a), b = pair.b < 0 ? -1 : system_.dof(pair.b);
    if (a >= 0) u.head<6>() = twists.segment<6>(a);
    if (b >= 0) u.tail<6>() = twists.segment<6>(b);
    const PairVector f = pair.matrix * u;
    if (a >= 0) out.segment<6>(a) -= f.head<6>();
    if (b >= 0) out.segment<6>(b) -= f.tail<6>();
  }
  return out;
}

/// The eigenvector of least curvature, relative to P, among motions that joints and pressed limits allow: Lanczos'
/// method on P⁻¹ (P − H) with the products of P.
PoseSolver::Descent PoseSolver::way_of_descent(const Pose& pose) {
  const std::vector<Mat3> R = rotations_of(pose.bodies);
  const BodyLoads acting = loads(*structure_, handles_, pose.bodies, R);
  const Linearised at = linearise(pose);
  damping_ = 0.0;
  const Curvature curved = curvature(pose, acting, at);
  make_matrix(curved, R);
  factor_.age = factor_.whole ? 0 : kAnew;
  pairs_.clear();
  last_.moved.resize(0);
  if (factor_.whole) return {};
  std::vector<Row> held;
  for (std::size_t i = 0; i < at.rows.size(); ++i)
    if (!at.pushes[i] || multipliers_[static_cast<Eigen::Index>(i)] > 0.0) held.push_back(at.rows[i]);
  const std::vector<bool> pushes(held.size(), false);
  const MatrixX compliance = system_.compliance(held);
  const auto response = [&](const VectorX& force) {
    VectorX interface, lambda, out;
    system_.reduce(force, interface);
    solve_bounded(compliance, system_.apply(held, interface), pushes, lambda);
    system_.subtract_response(held, lambda, interface);
    system_.expand(interface, out);
    return out;
  };
  const Eigen::Index most = std::min<Eigen::Index>(kMostDirections, system_.dofs());
  MatrixX ways(system_.dofs(), most), forces(system_.dofs(), most), T = MatrixX::Zero(most, most);
  VectorX force = uneven(system_.dofs());
  Eigen::Index n = 0;
  for (; n < most; ++n) {
    VectorX way = response(force);
    const double before = way.dot(force);
    for (int twice = 0; twice < 2; ++twice) {
      const VectorX share = ways.leftCols(n).transpose() * force;
      way -= ways.leftCols(n) * share;
      force -= forces.leftCols(n) * share;
    }
    const double square = way.dot(force);
    if (!(square > kExhausted * kExhausted * std::max(before, 0.0)) || square <= 0.0) break;
    ways.col(n) = way / std::sqrt(square);
    forces.col(n) = force / std::sqrt(square);
    force = surplus(curved, ways.col(n));
    T.col(n).head(n + 1) = ways.leftCols(n + 1).transpose() * force;
    T.row(n).head(n + 1) = T.col(n).head(n + 1).transpose();
  }
  if (n == 0) return {};
  const Eigen::SelfAdjointEigenSolver<MatrixX> split(T.topLeftCorner(n, n));
  const double surplus_most = split.eigenvalues()[n - 1];
  if (surplus_most <= 1.0 + kNegative) return {};
  Descent out{.way = ways.leftCols(n) * split.eigenvectors().col(n - 1), .curvature = 1.0 - surplus_most};
  const double turn = largest_turn(out.way);
  if (!(turn > 0.0)) return {};
  out.curvature *= kLargestTurn * kLargestTurn / (turn * turn);
  out.way *= kLargestTurn / turn;
  return out;
}

/// Goes along the way of descent, to the side that is lower, and shorter until the energy falls.
/// @return whether it has
bool PoseSolver::leave_saddle(Pose& pose, double& value) {
  const Descent descent = way_of_descent(pose);
  if (descent.curvature >= 0.0) return false;
  double part = 1.0;
  for (int i = 0; i < kHalvings; ++i, part *= 0.5) {
    Pose best;
    double lowest = value + 0.5 * kLower * part * part * descent.curvature;
    bool found = false;
    for (const double side : {1.0, -1.0}) {
      Pose trial = advanced(pose, descent.way, side * part);
      VectorX correction;
      if (!make_feasible(trial, correction)) continue;
      if (const double e = energy(trial); e < lowest) lowest = e, best = std::move(trial), found = true;
    }
    if (!found) continue;
    pose = std::move(best), value = lowest;
    factor_.age = kAnew;
    return true;
  }
  return false;
}

}  // namespace limber::internal
