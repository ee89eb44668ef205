// Local/global iterations on the energy of posing, to be measured beside Newton's method.
//
// Cells are affine maps x ↦ A (x − c) + p. Strain and handles are squares of them that do not mix their three rows: one
// constant matrix of four numbers a body, factored once; what joins parts (balls, hinges: one point or two of an axis
// that both sides share) is linear in them, too, a small Schur complement. That A is a rotation is what is left, and
// splits by bodies. Douglas and Rachford's splitting of the two (the method of multipliers of local/global kind):
//   z ← z + α (G(2 L(z) − z) − L(z)),   L: nearest rotations; G: least of strain, handles and ½ ρ Σ ω |A − target|²
// accelerated by Anderson's method, from frame to frame from where it ended. Limits are not in it.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <Eigen/SparseCholesky>
#include <vector>

#include "limber/core/error.h"
#include "pose_transfer.h"
#include "solver/pose_energy.h"

namespace limber::benchmarks {

class LocalGlobal {
 public:
  /// @param stiffness ρ, of a body's own
  LocalGlobal(const internal::PoseStructure& structure, const std::vector<internal::HandleTerm>& handles,
              double stiffness)
      : s_(structure), handles_(handles), dof_(structure.bodies.size(), -1), poses_(rest_poses(structure)) {
    for (std::size_t b = 0; b < s_.bodies.size(); ++b)
      if (!s_.bodies[b].pinned) dof_[b] = dofs_, dofs_ += 4;
    add_terms();
    weigh(stiffness);
    Eigen::SparseMatrix<double> K(dofs_, dofs_);
    K.setFromTriplets(triplets_.begin(), triplets_.end());
    factor_.compute(K);
    if (factor_.info() != Eigen::Success) throw ComputationError("local/global: the matrix is not positive definite");
    numbers_ = static_cast<double>(factor_.matrixL().nestedExpression().nonZeros());
    add_joints();
    z_ = rotations();
  }

  double numbers() const { return numbers_; }
  void set_target(std::size_t handle, const Vec3& target) { handles_[handle].target = target; }

  void iterate() {
    const Eigen::MatrixXd R = nearest(z_);
    const Eigen::MatrixXd residual = kRelaxation * (global(2.0 * R - z_) - R);
    accelerate(residual);
  }

  /// Rotations, and the places that go with them.
  internal::BodyPoses poses() {
    const Eigen::MatrixXd R = nearest(z_);
    global(R);
    internal::BodyPoses out = poses_;
    for (std::size_t b = 0; b < out.size(); ++b)
      if (dof_[b] >= 0)
        out[b] = {normalized(quaternion_from_matrix(R.middleRows<3>(3 * dof_[b] / 4).transpose())),
                  x_.row(dof_[b] + 3).transpose()};
    return out;
  }

 private:
  static constexpr double kRelaxation = 1.0;
  static constexpr Eigen::Index kMemory = 8;
  using Four = Eigen::Vector4d;

  static Four four(const Vec3& arm) { return {arm.x(), arm.y(), arm.z(), 1.0}; }

  /// ½ w (Σ a_i · X_i)² for each row, of bodies that may be pinned.
  void add_square(double w, const std::vector<std::pair<Index, Four>>& terms) {
    for (const auto& [i, a] : terms) {
      if (dof(i) < 0) continue;
      for (const auto& [j, b] : terms)
        if (dof(j) >= 0) {
          for (int r = 0; r < 4; ++r)
            for (int c = 0; c < 4; ++c) triplets_.emplace_back(dof(i) + r, dof(j) + c, w * a[r] * b[c]);
        } else {
          fixed_.middleRows<4>(dof(i)) -= w * a * (b.transpose() * at_rest(j));
        }
    }
  }
  Index dof(Index body) const { return dof_[static_cast<std::size_t>(body)]; }
  Eigen::Matrix<double, 4, 3> at_rest(Index body) const {
    Eigen::Matrix<double, 4, 3> out = Eigen::Matrix<double, 4, 3>::Zero();
    out.topRows<3>().setIdentity();
    out.row(3) = s_.bodies[static_cast<std::size_t>(body)].centre;
    return out;
  }

  void add_terms() {
    fixed_ = Eigen::MatrixXd::Zero(dofs_, 3);
    for (const internal::StrainLink& l : s_.links) {
      add_square(l.weight, {{l.a, four(l.arm_a)}, {l.b, -four(l.arm_b)}});
      for (int k = 0; k < 3; ++k) {
        Four column = Four::Zero();
        column.head<3>() = l.spread.col(k);
        add_square(1.0, {{l.a, column}, {l.b, -column}});
      }
    }
    for (const internal::HandleTerm& h : handles_) add_square(h.weight, {{h.body, four(h.arm)}});
  }

  /// ρ ω of a body: its own stiffness against turning; of one without, that of a block of its size.
  void weigh(double stiffness) {
    omega_ = Eigen::VectorXd::Zero(dofs_ / 4);
    for (const auto& t : triplets_)
      if (t.row() == t.col() && t.row() % 4 != 3) omega_[t.row() / 4] += t.value() / 3.0;
    for (std::size_t b = 0; b < s_.bodies.size(); ++b)
      if (dof_[b] >= 0) {
        double& w = omega_[dof_[b] / 4];
        w = stiffness * std::max(w, std::cbrt(s_.bodies[b].volume) * s_.bodies[b].radius_squared);
        for (int r = 0; r < 3; ++r) triplets_.emplace_back(dof_[b] + r, dof_[b] + r, w);
        // Parts that nothing holds stay.
        triplets_.emplace_back(dof_[b] + 3, dof_[b] + 3, 1e-9 * s_.size);
      }
  }

  void add_joints() {
    std::vector<std::pair<internal::BodyJoint, Vec3>> points;
    for (const internal::BodyJoint& j : s_.joints) {
      if (j.joint.type != JointType::kBall && j.joint.type != JointType::kRevolute)
        throw InvalidArgument("local/global: balls and hinges only");
      points.emplace_back(j, j.joint.frame.origin);
      if (j.joint.type == JointType::kRevolute)
        points.emplace_back(j, j.joint.frame.origin + 0.05 * s_.size * j.joint.frame.axes.col(0));
    }
    const auto m = static_cast<Eigen::Index>(points.size());
    rows_ = Eigen::MatrixXd::Zero(dofs_, m);
    values_ = Eigen::MatrixXd::Zero(m, 3);
    for (Eigen::Index i = 0; i < m; ++i) {
      const auto& [joint, at] = points[static_cast<std::size_t>(i)];
      for (const auto& [body, sign] : {std::pair(joint.a, 1.0), std::pair(joint.b, -1.0)}) {
        const Four a = sign * four(at - s_.bodies[static_cast<std::size_t>(body)].centre);
        if (dof(body) >= 0)
          rows_.col(i).segment<4>(dof(body)) = a;
        else
          values_.row(i) -= a.transpose() * at_rest(body);
      }
    }
    if (m == 0) return;
    response_ = factor_.solve(rows_);
    schur_.compute(rows_.transpose() * response_);
  }

  /// Least of all but the rotations, with A near `targets` (3 n × 3: Aᵀ of each body). @return Aᵀ
  Eigen::MatrixXd global(const Eigen::MatrixXd& targets) {
    Eigen::MatrixXd rhs = fixed_;
    for (Eigen::Index b = 0; b < omega_.size(); ++b)
      rhs.middleRows<3>(4 * b) += omega_[b] * targets.middleRows<3>(3 * b);
    for (const internal::HandleTerm& h : handles_)
      if (dof(h.body) >= 0) rhs.middleRows<4>(dof(h.body)) += h.weight * four(h.arm) * h.target.transpose();
    x_ = factor_.solve(rhs);
    if (rows_.cols() > 0) x_ -= response_ * schur_.solve(rows_.transpose() * x_ - values_);
    Eigen::MatrixXd out(3 * omega_.size(), 3);
    for (Eigen::Index b = 0; b < omega_.size(); ++b) out.middleRows<3>(3 * b) = x_.middleRows<3>(4 * b);
    return out;
  }

  static Eigen::MatrixXd nearest(const Eigen::MatrixXd& z) {
    Eigen::MatrixXd out(z.rows(), 3);
    for (Eigen::Index b = 0; b < z.rows(); b += 3)
      out.middleRows<3>(b) = internal::nearest_rotation(z.middleRows<3>(b));
    return out;
  }
  Eigen::MatrixXd rotations() const {
    Eigen::MatrixXd out(3 * omega_.size(), 3);
    for (Eigen::Index b = 0; b < omega_.size(); ++b) out.middleRows<3>(3 * b).setIdentity();
    return out;
  }

  /// Anderson's method (type II) on z ← z + residual; begun anew where the residual grows twofold.
  void accelerate(const Eigen::MatrixXd& residual) {
    const double norm = residual.norm();
    const Eigen::Map<const Eigen::VectorXd> f(residual.data(), residual.size());
    Eigen::Map<Eigen::VectorXd> z(z_.data(), z_.size());
    if (last_norm_ > 0.0 && norm > 2.0 * last_norm_) count_ = 0, has_last_ = false;
    last_norm_ = norm;
    if (dF_.size() == 0) dF_.resize(f.size(), kMemory), dZ_.resize(f.size(), kMemory);
    if (has_last_) {
      dF_.col(count_ % kMemory) = f - last_f_;
      dZ_.col(count_ % kMemory) = z - last_z_;
      ++count_;
    }
    last_f_ = f, last_z_ = z, has_last_ = true;
    z += f;
    const Eigen::Index n = std::min<Eigen::Index>(count_, kMemory);
    if (n == 0) return;
    const auto F = dF_.leftCols(n);
    Eigen::MatrixXd N = F.transpose() * F;
    N.diagonal().array() += 1e-12 * N.trace();
    const Eigen::VectorXd gamma = N.ldlt().solve(F.transpose() * f);
    z -= (dZ_.leftCols(n) + F) * gamma;
  }

  const internal::PoseStructure& s_;
  std::vector<internal::HandleTerm> handles_;
  std::vector<Index> dof_;
  Index dofs_ = 0;
  internal::BodyPoses poses_;
  std::vector<Eigen::Triplet<double>> triplets_;
  Eigen::MatrixXd fixed_;
  Eigen::VectorXd omega_;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor_;
  double numbers_ = 0.0;
  Eigen::MatrixXd rows_, values_, response_;
  Eigen::LDLT<Eigen::MatrixXd> schur_;
  Eigen::MatrixXd z_, x_;
  Eigen::MatrixXd dF_, dZ_;
  Eigen::VectorXd last_f_, last_z_;
  Eigen::Index count_ = 0;
  bool has_last_ = false;
  double last_norm_ = 0.0;
};

}  // namespace limber::benchmarks
