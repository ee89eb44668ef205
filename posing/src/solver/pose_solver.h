// Poses by Newton's method on rigid motions with joints and limits as constraints.
#pragma once

#include <vector>

#include "limber/posing/posing_options.h"
#include "solver/bounded_system.h"
#include "solver/pose_energy.h"
#include "solver/secant_pairs.h"

namespace limber::internal {

constexpr double kLargestTurn = 0.8;  // rad of a body in one step: beyond, rotations are far from their linearisation
constexpr int kAnew = -1;             // age of a matrix that is to be made

/// Rad, of the body that turns most. @param twists of bodies, six numbers each
double largest_turn(const VectorX& twists);

/// A pose and what of it is history: how often joints have turned round.
struct Pose {
  BodyPoses bodies{};
  std::vector<double> turns{};  // per joint of the structure, rad
};

/// How far joints and limits are from being met: of the model's size, rad.
struct Feasibility {
  double joints = 0.0, limits = 0.0;
};
Feasibility feasibility(const PoseStructure& structure, const Pose& pose);

/// Minimises strain + handles over poses that the joints allow.
///
/// Each iteration linearises joints and limits and takes the energy's quadratic model (ElasticSystem; with the turning
/// stiffness of all loads, so that it is Newton's but for negative curvature). The step follows from a dense problem in
/// the multipliers of joints and limits alone; the trial pose is put back onto the joints and taken if
/// its energy is lower; else the step is shortened, or the next damped more. Poses between are feasible too. The matrix
/// is kept from call to call, with what steps since have told of it, and made anew where that saves time. Where steps
/// end at a saddle, the pose goes on along its way of negative curvature.
class PoseSolver {
 public:
  /// The structure must outlive the solver.
  PoseSolver(const PoseStructure& structure, const PosingOptions& options, std::vector<HandleTerm> handles);

  /// @param pose in: where to begin; out: no worse. Unchanged if it is kInfeasible. Where handles are not met although
  /// nothing is strained, further starts are tried (PosingOptions::starts).
  PoseResult solve(Pose& pose);

  /// New targets, in the order of the handles.
  void set_targets(const std::vector<Vec3>& targets);

 private:
  /// Rows at a pose: joints, then limits.
  struct Linearised {
    /// Energy that the pose has for not quite meeting joints and limits.
    double worth(const VectorX& multipliers) const;
    VectorX values() const;
    std::vector<Row> rows{};
    std::vector<bool> pushes{};
  };
  struct Step {
    double moved = 0.0;  // a point at most, of the size
    enum class Outcome { kTaken, kRejected, kLast } outcome = Outcome::kTaken;
  };
  PoseResult descend(Pose& pose, int most_iterations);
  void start_with_rigid_motion(Pose& pose) const;
  bool make_feasible(Pose& pose, VectorX& correction);
  void bring_along(const VectorX& interface, VectorX& all, Pose& pose);
  void tell_turns(Pose& pose) const;
  Linearised linearise(const Pose& pose) const;
  /// Second derivatives of what is not strain: their whole, and what is sure to be positive, of single bodies.
  struct Curvature {
    std::vector<TwistMatrix> whole{}, single{};
    std::vector<PairTerm> joints{};
  };
  Curvature curvature(const Pose& pose, const BodyLoads& acting, const Linearised& at) const;
  void make_matrix(const Curvature& curvature, const std::vector<Mat3>& R);
  VectorX surplus(const Curvature& curvature, const VectorX& twists) const;
  struct Descent {
    VectorX way{};
    double curvature = 0.0;  // wayᵀ H way, < 0; 0: there is no such way
  };
  Descent way_of_descent(const Pose& pose);
  bool leave_saddle(Pose& pose, double& value);
  double handle_error(const Pose& pose) const;
  bool misses(const Pose& pose, double value) const;
  bool is_sure(const Pose& pose, double value) const;
  bool is_beyond_reach() const;
  struct Moments {
    std::vector<Mat3> all{};
    std::vector<double> most{};
  };
  Moments joint_moments(const BodyLoads& acting, const Linearised& at) const;
  std::vector<TwistMatrix> handle_stiffness() const;
  std::vector<PairTerm> joint_terms(const Pose& pose, const Linearised& at) const;
  double energy(const Pose& pose) const;
  struct Direction;
  Direction direction(const Pose& pose, const Linearised& at);
  void learn(const Direction& now);
  struct Trial;
  Trial try_step(const Pose& pose, const Direction& way, double part);
  bool matrix_pays(double promised, double value) const;
  Step step(Pose& pose, double& value);
  Pose advanced(const Pose& pose, const VectorX& step, double part) const;
  double reach(const VectorX& step) const;

  const PoseStructure* structure_;
  PosingOptions options_;
  std::vector<HandleTerm> handles_;
  std::vector<double> radius_;  // per body: of the ball around its centre that holds its cells
  ElasticSystem system_;
  VectorX multipliers_;  // of the last step's rows
  double damping_ = 0.0;
  struct {
    int age = kAnew;        // steps that the matrix has been used for
    double promised = 0.0;  // decrease by the step before
    bool whole = false;     // made of all second derivatives, and positive definite: the pose was near a minimum
  } factor_;
  SecantPairs pairs_;  // since the matrix was made, of steps along the rows that are held now
  struct {
    VectorX moved{}, residual{}, plain{};  // moved: empty if the next step is no continuation of it
    std::vector<bool> held{};              // rows
  } last_;
  struct {
    std::vector<Vec3> targets{};  // of handles; empty: none
    double energy = 0.0;          // the least of all starts
  } missed_;                      // where starts were tried last in vain
};

}  // namespace limber::internal
