#include "solver/pose_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limber/core/error.h"
#include "pose_transfer.h"
#include "solver/pose_starts.h"

namespace limber::internal {
namespace {

// Numbers of the method. A converged pose depends on none of them.
// Factor of the mass matrix, in stiffness · size: small beside all that resists, so that iterations are few, and large
// enough for round-off. A single body has nothing soft of its own; in a block of many, bending is far softer than its
// links.
constexpr double kProximal = 1e-7, kProximalOfLinked = 1e-8;
constexpr double kFeasible = 1e-11;  // to which joints and limits are put back; of the size, rad
constexpr double kSlack = 1e-12;     // a limit that is nearer counts as reached
constexpr int kRestorations = 12;    // Newton steps to put a pose back onto its joints
constexpr double kArmijo = 1e-4;     // of the decrease that the quadratic model promises
// Levenberg–Marquardt damping, in units of the loads' own moments: what second derivatives that are left out amount to.
constexpr double kFirstDamping = 0.125, kDampingFactor = 4.0, kLeastDamping = 1e-5, kLargestDamping = 1e6;
constexpr double kNewtonSteps = 2.0;    // that a pose takes with a matrix just made
constexpr int kShortenings = 2;         // of a step by a matrix that was made for an earlier pose
constexpr double kLeastEnergy = 1e-12;  // of a step's decrease: what later ones are not worth
constexpr int kStartsToChooseFrom = 8;  // for each that is tried
constexpr double kGauge = 1e-12;        // prefers no turn where handles leave it open

std::vector<bool> interface_bodies(const PoseStructure& structure) {
  std::vector<bool> out(structure.bodies.size(), false);
  for (const BodyJoint& joint : structure.joints)
    out[static_cast<std::size_t>(joint.a)] = out[static_cast<std::size_t>(joint.b)] = true;
  return out;
}

std::vector<double> body_radii(const PoseStructure& structure) {
  std::vector<double> out(structure.bodies.size(), 0.0);
  for (const PlacedCell& c : structure.cells) {
    double& r = out[static_cast<std::size_t>(c.body)];
    r = std::max(
        r, (c.cell.centre - structure.bodies[static_cast<std::size_t>(c.body)].centre).norm() + c.cell.half.norm());
  }
  return out;
}

JointRows all_rows(const PoseStructure& structure, const Pose& pose) {
  JointRows out;
  for (std::size_t j = 0; j < structure.joints.size(); ++j) {
    const std::size_t constraints = out.constraints.size(), coordinates = out.coordinates.size();
    append_joint_rows(structure, structure.joints[j], pose.bodies, pose.turns[j], out);
    for (std::size_t i = constraints; i < out.constraints.size(); ++i) out.constraints[i].joint = static_cast<Index>(j);
    for (std::size_t i = coordinates; i < out.coordinates.size(); ++i)
      out.coordinates[i].row.joint = static_cast<Index>(j);
  }
  return out;
}

double beyond(const CoordinateRow& c) { return std::max(c.limit.low - c.row.value, c.row.value - c.limit.high); }

/// The row that says "no further": value ≤ 0 holds.
Row stop(const CoordinateRow& c, bool high) {
  Row out = c.row;
  if (high) {
    out.value = c.row.value - c.limit.high;
  } else {
    out.value = c.limit.low - c.row.value;
    out.J_a = -c.row.J_a, out.J_b = -c.row.J_b;
    out.dQ = -c.row.dQ, out.dt = -c.row.dt, out.bend = -c.row.bend;
  }
  return out;
}

bool all_finite(const Pose& pose) {
  return std::all_of(pose.bodies.begin(), pose.bodies.end(), [](const RigidTransform& X) {
    return X.p.allFinite() && std::isfinite(X.q.w + X.q.x + X.q.y + X.q.z);
  });
}

}  // namespace

double largest_turn(const VectorX& twists) {
  double out = 0.0;
  for (Eigen::Index d = 0; d < twists.size(); d += 6) out = std::max(out, twists.segment<3>(d).norm());
  return out;
}

Feasibility feasibility(const PoseStructure& structure, const Pose& pose) {
  const JointRows rows = all_rows(structure, pose);
  Feasibility out;
  for (const Row& r : rows.constraints) out.joints = std::max(out.joints, std::abs(r.value));
  for (const CoordinateRow& c : rows.coordinates) out.limits = std::max(out.limits, beyond(c));
  return out;
}

double PoseSolver::Linearised::worth(const VectorX& multipliers) const {
  double out = 0.0;
  for (std::size_t i = 0; i < rows.size(); ++i)
    out += std::abs(multipliers[static_cast<Eigen::Index>(i)]) *
           (pushes[i] ? std::max(0.0, rows[i].value) : std::abs(rows[i].value));
  return out;
}

VectorX PoseSolver::Linearised::values() const {
  VectorX out(static_cast<Eigen::Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) out[static_cast<Eigen::Index>(i)] = rows[i].value;
  return out;
}

PoseSolver::PoseSolver(const PoseStructure& structure, const PosingOptions& options, std::vector<HandleTerm> handles)
    : structure_(&structure),
      options_(options),
      handles_(std::move(handles)),
      radius_(body_radii(structure)),
      system_(structure, interface_bodies(structure), kProximal * structure.size, kProximalOfLinked * structure.size) {}

void PoseSolver::set_targets(const std::vector<Vec3>& targets) {
  for (std::size_t i = 0; i < handles_.size(); ++i) handles_[i].target = targets[i];
}

double PoseSolver::energy(const Pose& pose) const {
  const std::vector<Mat3> R = rotations_of(pose.bodies);
  return strain_energy(*structure_, pose.bodies, R) + handle_energy(handles_, pose.bodies, R);
}

PoseSolver::Linearised PoseSolver::linearise(const Pose& pose) const {
  const JointRows joints = all_rows(*structure_, pose);
  Linearised out;
  out.rows = joints.constraints;
  out.pushes.assign(out.rows.size(), false);
  for (const CoordinateRow& c : joints.coordinates)
    for (const bool high : {false, true})
      if (std::isfinite(high ? c.limit.high : c.limit.low)) {
        out.rows.push_back(stop(c, high));
        out.pushes.push_back(true);
      }
  return out;
}

/// A rigid motion of everything that brings the handles nearest to their targets, if nothing is pinned and it helps:
/// what no joint and no strain resists should not take iterations.
void PoseSolver::start_with_rigid_motion(Pose& pose) const {
  if (handles_.empty()) return;
  for (const PoseBody& body : structure_->bodies)
    if (body.pinned) return;
  Vec3 from = Vec3::Zero(), to = Vec3::Zero();
  std::vector<Vec3> points;
  for (const HandleTerm& h : handles_) {
    points.push_back(pose.bodies[static_cast<std::size_t>(h.body)] * h.arm);
    from += points.back(), to += h.target;
  }
  const double n = static_cast<double>(points.size());
  from /= n, to /= n;
  Mat3 correlation = Mat3::Zero();
  for (std::size_t i = 0; i < points.size(); ++i)
    correlation += (handles_[i].target - to) * (points[i] - from).transpose();
  correlation += kGauge * structure_->size * structure_->size * Mat3::Identity();
  const Quaternion turn = normalized(quaternion_from_matrix(nearest_rotation(correlation)));
  const RigidTransform motion{turn, to - turn * from};
  Pose trial = pose;
  for (RigidTransform& X : trial.bodies) X = {normalized(motion.q * X.q), motion * X.p};
  if (energy(trial) < energy(pose)) pose = trial;
}

Pose PoseSolver::advanced(const Pose& pose, const VectorX& step, double part) const {
  Pose out = pose;
  for (std::size_t b = 0; b < out.bodies.size(); ++b)
    if (const Index at = system_.dof(static_cast<Index>(b)); at >= 0)
      out.bodies[b] = moved(pose.bodies[b], part * step.segment<6>(at));
  tell_turns(out);
  return out;
}

/// Angles of joints, told on from where they were.
void PoseSolver::tell_turns(Pose& pose) const {
  for (std::size_t j = 0; j < pose.turns.size(); ++j)
    pose.turns[j] = joint_turn(*structure_, structure_->joints[j], pose.bodies, pose.turns[j]);
}

/// How far a step moves a point at most, of the size.
double PoseSolver::reach(const VectorX& step) const {
  double out = 0.0;
  for (std::size_t b = 0; b < radius_.size(); ++b)
    if (const Index at = system_.dof(static_cast<Index>(b)); at >= 0)
      out = std::max(out, step.segment<3>(at).norm() * radius_[b] + step.segment<3>(at + 3).norm());
  return out / structure_->size;
}

/// Newton's method on joints and the limits that are passed, by the least motion in the metric of H. Only the interface
/// counts for that; the other bodies follow at the end. @param correction out: of all bodies. @return whether they hold
bool PoseSolver::make_feasible(Pose& pose, VectorX& correction) {
  VectorX lambda, gone = VectorX::Zero(system_.interface_dofs());
  correction = VectorX::Zero(system_.dofs());
  for (int i = 0; i <= kRestorations; ++i) {
    const Feasibility now = feasibility(*structure_, pose);
    if (!(std::isfinite(now.joints) && std::isfinite(now.limits))) return false;
    if (now.joints <= kFeasible && now.limits <= kSlack) {
      if (i > 0) bring_along(gone, correction, pose);
      return true;
    }
    if (i == kRestorations) break;
    const Linearised at = linearise(pose);
    lambda.setZero(static_cast<Eigen::Index>(at.rows.size()));
    solve_bounded(system_.compliance(at.rows), at.values(), at.pushes, lambda);
    VectorX step = VectorX::Zero(system_.interface_dofs());
    system_.subtract_response(at.rows, lambda, step);
    step *= kLargestTurn / std::max(largest_turn(step), kLargestTurn);
    for (std::size_t body = 0; body < pose.bodies.size(); ++body)
      if (const Index d = system_.interface_dof(static_cast<Index>(body)); d >= 0)
        pose.bodies[body] = moved(pose.bodies[body], step.segment<6>(d));
    tell_turns(pose);
    gone += step;
  }
  return false;
}

/// Response of bodies off the interface when those on it have moved. @param all out: how all have
void PoseSolver::bring_along(const VectorX& interface, VectorX& all, Pose& pose) {
  system_.follow(interface, all);
  for (std::size_t b = 0; b < pose.bodies.size(); ++b)
    if (const Index d = system_.dof(static_cast<Index>(b)); d >= 0 && system_.interface_dof(static_cast<Index>(b)) < 0)
      pose.bodies[b] = moved(pose.bodies[b], all.segment<6>(d));
}

/// All second derivatives of energy and joints make steps Newton's; joints' own rows are added as stiff springs, which
/// changes no step that keeps them and makes the matrix positive where only the joints hold it. Where it still is not,
/// far from where it is going, it is that of single bodies: the positive part of what all forces on each, its joints'
/// too, give its turning.
PoseSolver::Curvature PoseSolver::curvature(const Pose& pose, const BodyLoads& acting, const Linearised& at) const {
  const Moments moments = joint_moments(acting, at);
  Curvature out{.whole = handle_stiffness(), .single = {}, .joints = joint_terms(pose, at)};
  out.single = out.whole;
  for (std::size_t b = 0; b < out.whole.size(); ++b) {
    const Mat3 damping = damping_ * moments.most[b] * Mat3::Identity();
    out.whole[b].topLeftCorner<3, 3>() += turning_stiffness(acting.moments[b]) + damping;
    out.single[b].topLeftCorner<3, 3>() += positive_part(turning_stiffness(moments.all[b])) + damping;
  }
  return out;
}

void PoseSolver::make_matrix(const Curvature& curvature, const std::vector<Mat3>& R) {
  factor_.whole = system_.factor(R, curvature.whole, curvature.joints);
  if (!factor_.whole && !system_.factor(R, curvature.single, {}))
    throw ComputationError("posing: the strain matrix is not positive definite, expected finite poses");
}

/// Moments of what acts on bodies, their joints' too; and what they may come to with the joints' couples.
PoseSolver::Moments PoseSolver::joint_moments(const BodyLoads& acting, const Linearised& at) const {
  Moments out{acting.moments, std::vector<double>(acting.moments.size(), 0.0)};
  for (std::size_t i = 0; i < at.rows.size(); ++i) {
    const double l = multipliers_[static_cast<Eigen::Index>(i)];
    const Row& row = at.rows[i];
    const auto a = static_cast<std::size_t>(row.a), b = static_cast<std::size_t>(row.b);
    out.all[a] += l * row.arm_a * row.J_a.tail<3>().transpose();
    out.all[b] += l * row.arm_b * row.J_b.tail<3>().transpose();
    out.most[a] += std::abs(l) * row.J_a.head<3>().norm();
    out.most[b] += std::abs(l) * row.J_b.head<3>().norm();
  }
  for (std::size_t b = 0; b < out.most.size(); ++b) out.most[b] += out.all[b].norm();
  return out;
}

std::vector<TwistMatrix> PoseSolver::handle_stiffness() const {
  std::vector<TwistMatrix> out(structure_->bodies.size(), TwistMatrix::Zero());
  for (const HandleTerm& h : handles_)
    out[static_cast<std::size_t>(h.body)] += own_block(h.weight, h.arm, Mat3::Zero());
  return out;
}

/// Per joint the curvature of its rows with their multipliers, and its constraints as springs.
std::vector<PairTerm> PoseSolver::joint_terms(const Pose& pose, const Linearised& at) const {
  const double size = structure_->size;
  const double spring = size * size * size + (at.rows.empty() ? 0.0 : multipliers_.cwiseAbs().maxCoeff());
  std::vector<PairTerm> out(structure_->joints.size());
  std::vector<Mat3> dQ(out.size(), Mat3::Zero());
  std::vector<Vec3> dt(out.size(), Vec3::Zero());
  for (std::size_t i = 0; i < at.rows.size(); ++i) {
    const Row& row = at.rows[i];
    const auto j = static_cast<std::size_t>(row.joint);
    const double l = multipliers_[static_cast<Eigen::Index>(i)];
    dQ[j] += l * row.dQ, dt[j] += l * row.dt;
    out[j].matrix += l * row.bend * row.across * row.across.transpose();
    if (at.pushes[i]) continue;
    PairVector J;
    J << row.J_a, row.J_b;
    out[j].matrix += spring * J * J.transpose();
  }
  for (std::size_t j = 0; j < out.size(); ++j) {
    const BodyJoint& joint = structure_->joints[j];
    out[j].a = joint.a, out[j].b = joint.b;
    out[j].matrix += joint_curvature(*structure_, joint, pose.bodies, dQ[j], dt[j]);
  }
  return out;
}

/// The end of a step, before it is tried.
struct PoseSolver::Direction {
  VectorX residual{};  // gradient + Jᵀλ
  VectorX plain{};     // the step by the matrix alone
  VectorX step{};      // with what earlier steps tell
  std::vector<bool> held{};
};

/// Newton's step with limits, by the matrix that is there.
PoseSolver::Direction PoseSolver::direction(const Pose& pose, const Linearised& at) {
  const std::vector<Mat3> R = rotations_of(pose.bodies);
  const BodyLoads acting = loads(*structure_, handles_, pose.bodies, R);
  if (multipliers_.size() != static_cast<Eigen::Index>(at.rows.size()))
    multipliers_.setZero(static_cast<Eigen::Index>(at.rows.size()));
  if (factor_.age < 0) {
    make_matrix(curvature(pose, acting, at), R);
    pairs_.clear();
    last_.moved.resize(0);
  }
  ++factor_.age;
  Direction out{.residual = VectorX::Zero(system_.dofs())};
  for (std::size_t b = 0; b < acting.gradient.size(); ++b)
    if (const Index d = system_.dof(static_cast<Index>(b)); d >= 0) out.residual.segment<6>(d) = acting.gradient[b];
  VectorX interface;
  system_.reduce(-out.residual, interface);
  solve_bounded(system_.compliance(at.rows), at.values() + system_.apply(at.rows, interface), at.pushes, multipliers_);
  system_.subtract_response(at.rows, multipliers_, interface);
  system_.expand(interface, out.plain);
  for (std::size_t i = 0; i < at.rows.size(); ++i) {
    const Row& row = at.rows[i];
    const double l = multipliers_[static_cast<Eigen::Index>(i)];
    out.held.push_back(!at.pushes[i] || l > 0.0);
    for (const auto& [body, J] : {std::pair(row.a, &row.J_a), std::pair(row.b, &row.J_b)})
      if (const Index d = system_.dof(body); d >= 0) out.residual.segment<6>(d) += l * *J;
  }
  learn(out);
  out.step = out.plain;
  pairs_.correct(out.residual, out.step);
  return out;
}

/// The last step's information on the second derivative along the rows that are held: motions along them are all that
/// pairs say something of.
void PoseSolver::learn(const Direction& now) {
  if (now.held != last_.held) {
    pairs_.clear();
  } else if (last_.moved.size() > 0) {
    pairs_.add(last_.moved, now.residual - last_.residual, last_.plain - now.plain);
  }
  last_ = {.moved = {}, .residual = now.residual, .plain = now.plain, .held = now.held};
}

/// A pose some part of a step away, joints and limits met, and what the quadratic model promises of it.
struct PoseSolver::Trial {
  Pose pose{};
  VectorX moved{};
  double part = 1.0, promised = 0.0, energy = std::numeric_limits<double>::infinity();
};

PoseSolver::Trial PoseSolver::try_step(const Pose& pose, const Direction& way, double part) {
  Trial out{.pose = advanced(pose, way.step, part), .moved = part * way.step, .part = part};
  out.promised = part * (1.0 - 0.5 * part) * std::max(0.0, -way.residual.dot(way.step));
  VectorX correction;
  if (!make_feasible(out.pose, correction) || !all_finite(out.pose)) return out;
  out.moved += correction;
  out.energy = energy(out.pose);
  return out;
}

/// True if the steps that are left, at the rate of the last, take longer than a new matrix and Newton's few.
bool PoseSolver::matrix_pays(double promised, double value) const {
  if (promised >= factor_.promised) return true;
  const double left = std::log(promised / std::max(options_.energy_tolerance * value, kLeastEnergy * promised)) /
                      std::log(factor_.promised / promised);
  return left > kNewtonSteps + system_.factor_cost();
}

/// One iteration: a step is taken if the energy falls. One that a matrix of an earlier pose makes too long is shortened
/// to where the parabola through what is known has its least; else the next is damped more.
PoseSolver::Step PoseSolver::step(Pose& pose, double& value) {
  const Linearised at = linearise(pose);
  const Direction way = direction(pose, at);
  Trial trial = try_step(pose, way, kLargestTurn / std::max(largest_turn(way.step), kLargestTurn));
  Step out{.moved = trial.part * reach(way.step), .outcome = Step::Outcome::kRejected};
  const bool last =
      out.moved <= options_.tolerance || trial.promised <= options_.energy_tolerance * value + at.worth(multipliers_);
  const auto falls = [&] { return trial.energy <= value - kArmijo * trial.promised; };
  for (int i = 0; i < kShortenings && !last && factor_.age > 0 && !falls() && std::isfinite(trial.energy); ++i) {
    const double slope = -way.residual.dot(way.step) * trial.part, gain = value - trial.energy;
    trial = try_step(pose, way, trial.part * 0.5 * slope / (slope - gain));
  }
  if (falls() || (last && trial.energy <= value)) {
    if (damping_ > 0.0 && trial.energy <= value - 0.5 * trial.promised) {
      damping_ = damping_ > kLeastDamping ? damping_ / kDampingFactor : 0.0;
      factor_.age = kAnew;
    }
    if (!last && matrix_pays(trial.promised, value)) factor_.age = kAnew;
    factor_.promised = trial.promised;
    last_.moved = std::move(trial.moved);
    pose = std::move(trial.pose);
    value = trial.energy;
    out.outcome = Step::Outcome::kTaken;
  } else if (!last) {
    if (factor_.age == 0) damping_ = std::max(kDampingFactor * damping_, kFirstDamping);
    factor_.age = kAnew;
  }
  if (last) out.outcome = Step::Outcome::kLast;
  return out;
}

double PoseSolver::handle_error(const Pose& pose) const {
  double out = 0.0;
  for (const HandleTerm& h : handles_)
    out = std::max(out, (pose.bodies[static_cast<std::size_t>(h.body)] * h.arm - h.target).norm());
  return out;
}

/// Whether a handle is not where it is led although nothing is strained: joints and limits alone keep it away.
bool PoseSolver::misses(const Pose& pose, double value) const {
  return handle_error(pose) > options_.tolerance * structure_->size &&
         strain_energy(*structure_, pose.bodies, rotations_of(pose.bodies)) <= options_.energy_tolerance * value;
}

/// Whether a pose at which steps end needs no look at its second derivative: it meets its handles, or it is strained
/// and the last matrix was whole.
bool PoseSolver::is_sure(const Pose& pose, double value) const {
  return !misses(pose, value) && (factor_.whole || handle_error(pose) <= options_.tolerance * structure_->size);
}

/// Whether starts that were tried in vain tell that these targets are beyond reach, too: the root of twice the least
/// energy is a distance from what can be reached, and changes by no more than the targets move.
bool PoseSolver::is_beyond_reach() const {
  double moved = 0.0;
  for (std::size_t i = 0; i < missed_.targets.size(); ++i)
    moved += handles_[i].weight * (handles_[i].target - missed_.targets[i]).squaredNorm();
  return 0.5 * moved < missed_.energy;
}

/// Steps from the pose at hand; where these leave a handle away although nothing is strained, steps from other poses
/// that joints allow, those of the lowest energy first, until a handle is met.
PoseResult PoseSolver::solve(Pose& pose) {
  using Status = PoseResult::Status;
  PoseResult result = descend(pose, options_.max_iterations);
  if (result.status == Status::kInfeasible || options_.starts == 0 || !misses(pose, result.energy) || is_beyond_reach())
    return result;
  const PoseStarts starts(*structure_);
  std::vector<std::pair<double, int>> order;
  for (int i = 1; i <= kStartsToChooseFrom * options_.starts; ++i) order.emplace_back(energy(starts.start(pose, i)), i);
  std::sort(order.begin(), order.end());
  double least = result.energy;
  int left = options_.max_iterations;
  for (int i = 0; i < options_.starts && left > 0; ++i) {
    Pose trial = starts.start(pose, order[static_cast<std::size_t>(i)].second);
    PoseResult tried = descend(trial, left);
    result.iterations += tried.iterations, left -= tried.iterations;
    least = std::min(least, tried.energy);
    if (tried.status != Status::kConverged || misses(trial, tried.energy)) continue;
    tried.iterations = result.iterations, tried.initial_energy = result.initial_energy;
    pose = std::move(trial);
    return tried;
  }
  missed_ = {.targets = {}, .energy = least};
  for (const HandleTerm& h : handles_) missed_.targets.push_back(h.target);
  factor_.age = kAnew;  // the matrix is of another pose
  return result;
}

/// Steps from a pose to where they end. @param pose unchanged if it is kInfeasible
PoseResult PoseSolver::descend(Pose& pose, int most_iterations) {
  using Status = PoseResult::Status;
  PoseResult result;
  Pose trial = pose;
  result.initial_energy = energy(pose);
  const auto tell = [&](Status status, const Pose& at) {
    result.status = status;
    result.energy = energy(at);
    const Feasibility f = feasibility(*structure_, at);
    result.joint_error = f.joints, result.limit_violation = std::max(0.0, f.limits);
    result.handle_error = handle_error(at);
    return result;
  };
  if (damping_ > 0.0) factor_.age = kAnew;
  damping_ = 0.0;
  factor_.promised = std::numeric_limits<double>::infinity();
  last_.moved.resize(0);
  if (const Feasibility f = feasibility(*structure_, trial); f.joints > kFeasible || f.limits > kSlack) {
    // Resistance of handles must not count: joints come first, however far the handles are dragged off by it.
    system_.factor(rotations_of(trial.bodies), std::vector<TwistMatrix>(trial.bodies.size(), TwistMatrix::Zero()), {});
    factor_.age = kAnew;
  }
  VectorX correction;
  if (!make_feasible(trial, correction)) return tell(Status::kInfeasible, pose);
  start_with_rigid_motion(trial);
  double value = energy(trial);
  Status status = Status::kIterationLimit;
  while (status == Status::kIterationLimit && result.iterations < most_iterations) {
    const Step done = step(trial, value);
    ++result.iterations;
    result.last_step = done.moved;
    if (done.outcome == Step::Outcome::kLast && (is_sure(trial, value) || !leave_saddle(trial, value)))
      status = misses(trial, value) ? Status::kLocalMinimum : Status::kConverged;
    if (done.outcome == Step::Outcome::kRejected && damping_ > kLargestDamping) status = Status::kStalled;
  }
  pose = std::move(trial);
  return tell(status, pose);
}

}  // namespace limber::internal
