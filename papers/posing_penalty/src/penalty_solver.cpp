#include <Eigen/SparseCholesky>
#include <cmath>
#include <string>

#include "limber/core/error.h"
#include "penalty_energy.h"
#include "pose_transfer.h"

namespace limber::internal {
namespace {

// Levenberg's, in stiffnesses of a handle. Not of the matrix's own diagonal (Marquardt's): the large weights in it
// would hold the turns fast that they leave free.
constexpr double kFirstDamping = 1e-6, kDampingFactor = 10.0, kLargestDamping = 1e12;

BodyPoses poses_of(const std::vector<BodyMap>& maps) {
  BodyPoses out;
  for (const BodyMap& map : maps) out.push_back({normalized(quaternion_from_matrix(nearest_rotation(map.A))), map.p});
  return out;
}

std::vector<BodyMap> moved_by(const PenaltyEnergy& energy, const std::vector<BodyMap>& maps,
                              const Eigen::VectorXd& step) {
  std::vector<BodyMap> out = maps;
  for (std::size_t b = 0; b < out.size(); ++b)
    if (const Index at = energy.dof(static_cast<Index>(b)); at >= 0) {
      out[b].A += Eigen::Map<const Mat3>(step.data() + at);
      out[b].p += step.segment<3>(at + 9);
    }
  return out;
}

/// How far a step moves a point of a body as large as the model at most, of the size.
double reach(const PenaltyEnergy& energy, const Eigen::VectorXd& step, double size) {
  double out = 0.0;
  for (Index at = 0; at < energy.dofs(); at += 12)
    out = std::max(out, step.segment<9>(at).norm() + step.segment<3>(at + 9).norm() / size);
  return out;
}

}  // namespace

PoseResult solve_penalty(PenaltyEnergy& energy, const PoseStructure& structure, const PosingOptions& options,
                         std::vector<BodyMap>& maps, std::vector<double>& turns) {
  using Status = PoseResult::Status;
  PoseResult result{.status = Status::kIterationLimit};
  PenaltyEnergy::Jacobian J;
  Eigen::VectorXd r = energy.residuals(maps, turns, &J);
  double value = r.squaredNorm(), damping = kFirstDamping;
  result.initial_energy = value;
  Eigen::SimplicialLDLT<PenaltyEnergy::Jacobian> factor;
  bool analysed = false;
  const double stiffness = options.handle_stiffness * structure.size;
  Eigen::VectorXd unit(energy.dofs());  // A moves a point as far as the body is large
  for (Index at = 0; at < energy.dofs(); at += 12)
    unit.segment<12>(at) << Eigen::Matrix<double, 9, 1>::Constant(stiffness * structure.size * structure.size),
        Vec3::Constant(stiffness);
  while (result.iterations < options.max_iterations) {
    PenaltyEnergy::Jacobian N = J.transpose() * J;
    N.diagonal() += damping * unit;
    if (!analysed) factor.analyzePattern(N);
    analysed = true;
    factor.factorize(N);
    const Eigen::VectorXd step = factor.solve(Eigen::VectorXd(-J.transpose() * r));
    ++result.iterations;
    const std::vector<BodyMap> trial = moved_by(energy, maps, step);
    result.last_step = reach(energy, step, structure.size);
    const double lower = energy.residuals(trial, turns, nullptr).squaredNorm();
    if (lower < value) {
      maps = trial;
      const BodyPoses poses = poses_of(maps);
      for (std::size_t j = 0; j < turns.size(); ++j)
        turns[j] = joint_turn(structure, structure.joints[j], poses, turns[j]);
      r = energy.residuals(maps, turns, &J);
      value = r.squaredNorm();
      damping = std::max(damping / kDampingFactor, kFirstDamping * kFirstDamping);
    } else {
      damping *= kDampingFactor;
    }
    if (result.last_step <= options.tolerance) {
      result.status = Status::kConverged;
      break;
    }
    if (damping > kLargestDamping) {
      result.status = Status::kStalled;
      break;
    }
  }
  result.energy = value;
  return result;
}

}  // namespace limber::internal

namespace limber {
namespace {

class PenaltyPoses final : public PoseMethod {
 public:
  explicit PenaltyPoses(const PenaltyWeights& weights) : weights_(weights) {}
  PoseResult solve(const internal::PoseProblem& problem, internal::AffinePose& pose) const override {
    internal::PenaltyEnergy energy(problem.structure, weights_, problem.handles);
    return internal::solve_penalty(energy, problem.structure, problem.options, pose.maps, pose.turns);
  }

 private:
  PenaltyWeights weights_;
};

}  // namespace

void PenaltyWeights::validate() const {
  const auto positive = [](const char* name, double value) {
    if (!(value > 0.0) || !std::isfinite(value))
      throw InvalidArgument(std::string("PenaltyWeights.") + name + ": is " + std::to_string(value) +
                            ", expected a finite number > 0");
  };
  positive("rigidity", rigidity);
  positive("joints", joints);
}

std::shared_ptr<const PoseMethod> penalty_poses(const PenaltyWeights& weights) {
  weights.validate();
  return std::make_shared<PenaltyPoses>(weights);
}

}  // namespace limber
