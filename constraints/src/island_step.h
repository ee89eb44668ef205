// One step of an island: what its parts share. Each part has a file of its own:
//
//   island_solver.cpp    the step as a whole, its cuts, the rows, and the bodies under the rows' impulses
//   island_reaction.cpp  what rows that hold answer to gravity and other held forces
//   island_touch.cpp     [H03]'s velocity program, before the rows
//   island_working_rows.cpp  which rows take part, and in what order
//   island_newton.cpp    Newton's method for the impulses
//   island_convex.cpp    islands with contacts: all rows as one convex problem, in rounds
//   island_release.cpp   where within a step an impact lets go
//   island_guard.cpp     the energy that may have come in, and what is done about more
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "island_energy.h"
#include "limber/constraints/island_solver.h"
#include "limber/solvers/contact_qp.h"
#include "limber/solvers/convex_contact_solver.h"
#include "limber/solvers/difference_newton.h"
#include "limber/solvers/hauser/contact_program.h"
#include "limber/solvers/least_squares.h"
#include "limber/solvers/secant_iteration.h"
#include "residual_factor.h"

namespace limber {

/// The generalised acceleration of a frame under what is held over the step, without constraints: linear in the loads,
/// so that the rows' answer balances them exactly where nothing moves.
struct FrameAcceleration {
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
};

inline bool is_equality(const RowLaw& law) {
  return !law.slides && law.lower == -kUnbounded && law.upper == kUnbounded;
}
/// Rows of the contact whose normal row this is, or of the vector whose first row it is.
inline Index contact_rows(const RowLaw& first) { return first.friction > 0.0 || first.radius > 0.0 ? 3 : 1; }

/// Whether a step is to be cut at a time within what is left of it: parts are never shorter than a thousandth of it.
inline bool is_part(double time, double left, double whole_step) {
  constexpr double kShortest = 1e-3;
  return time > kShortest * whole_step && left - time > kShortest * whole_step;
}

struct IslandSolver::Impl {
  IslandBodies bodies;
  ConstraintRows rows;
  std::vector<ExactMotion> motions;    // of the members, where a step may be cut
  std::vector<ModalStep> modal_steps;  // of the bodies, where they are not those of their groups
  std::vector<Index> first_row;        // per constraint, and the end
  std::vector<RowLaw> laws;            // of the rows at the step's start
  std::vector<double> J, metric, weighted, gap, start_gap, b, lower, upper, compliance;
  std::vector<double> f, next_f, reaction, end_reaction, change;
  std::vector<FrameAcceleration> accelerations;  // per body, under held forces
  std::vector<double> frame_G, unit_metric;
  std::vector<ConstraintLoad> loads;
  std::vector<double> modal_loads;
  // Rows with bounds, and all rows with those last; the problem in that order, and reduced to those.
  // Among those the contacts with friction come first, three rows each.
  std::vector<Index> bounded, order, place;
  std::size_t cones = 0;
  std::vector<double> ordered_G, A, ordered_b, A_reduced, b_reduced, f_bounded, lower_bounded, upper_bounded, f_equal;
  std::vector<double> held_impulse, friction;
  std::vector<ConstraintRows::Flexibility> flexibility;  // of the rows at the step's start
  double stored_energy = 0.0;
  std::vector<double> wide_J, wide_metric;  // J and the metric with a degree of freedom for each compliance
  ResidualFactor residual;                  // of what bodies yield beyond their modes
  std::vector<std::size_t> nodes;           // of the bodies
  std::vector<double> one_row;
  internal::ConvexContactSolver contacts;
  struct RowUnit {  // a row, or the rows of one contact or vector
    std::size_t first = 0, rows = 1;
    Vec3 impulse = Vec3::Zero();  // whole, that of the round
    Vec3 anchor = Vec3::Zero();   // from where its spring yields
    Vec3 moved = Vec3::Zero();    // what all of them make of its gap, to first order
    Vec3 end = Vec3::Zero();      // its gap, less what it asks for
    double response = 0.0, shift = 0.0, dent = 0.0;
  };
  std::vector<RowUnit> units;
  std::vector<char> early;   // by body: whether it gets gravity and held forces at the step's start
  std::vector<double> slip;  // by row
  LeastSquaresSolver least_squares;
  EqualityElimination elimination;
  ContactQpSolver qp;
  ContactProgramSolver programs;
  ContactRule rule;
  ProgramReport program_report;
  std::vector<double> gap_before;     // of the bounded rows
  std::vector<double> touch_impulse;  // by row, what the velocity program gave at the touch
  std::vector<double> contact_force;  // by row, N, what it holds over the step
  std::vector<Index> touching;        // rows of its contacts, three each with friction
  std::vector<double> mu, A_touch, b_touch, f_touch;
  internal::SecantIteration secant;
  internal::DifferenceNewton newton;
  std::vector<double> slope, tolerance;
  IslandEnergy energy;
  bool recovers = true;         // overlapping bodies are pushed apart
  bool convex = false;          // contacts are among the rows, by a rule for the convex problem
  bool contacts_alone = false;  // among the rows
  bool all_early = false;       // of `early`
  double slowed = 0.0;          // the part of the frames' relative motion that is taken at the step's start
  double start_energy = 0.0;    // J, of that motion
  std::vector<FrameMomentum> start_momenta;

  void gather(std::span<const ConstrainedBody> table, std::span<const Index> members,
              std::span<Constraint* const> constraints, const IslandOptions& options);
  void measure(const BodyStates& states, StepTime when, std::span<Constraint* const> constraints,
               std::vector<double>& into) const;
  void weigh();
  std::size_t weigh_frames();
  void find_accelerations(StepTime when, const Vec3& gravity);
  void answer_rows(bool equalities, std::vector<double>& answer);
  void take_roots();
  double step = 0.0;
  double theta = 1.0;  // the part of f that frames get at the step's start; the rest at its end
  struct HeldMotion {
    double acceleration = 0.0, speed = 0.0, speed_of_a_step = 0.0;
  };
  HeldMotion held_motion(StepTime when, Index row, const IslandOptions& options) const;
  void find_reaction(StepTime when, const IslandOptions& options, std::vector<double>& answer);
  void answer_at_end(const BodyStates& states, std::span<Constraint* const> constraints, const IslandOptions& options);
  void set_modal_steps(double length, double whole_step);
  struct Part {
    std::span<const ConstrainedBody> table;
    std::span<const Index> members;
    std::span<Constraint* const> constraints;
    bool begins, ends;  // the whole step
  };
  void take_divided(Part part, IslandOptions options, IslandReport& report);
  void commit(const Part& part, const IslandOptions& options, IslandReport done, IslandReport& report);
  double longest_impact() const;
  bool may_let_go(double length) const;
  double impact_impulse(double length) const;
  void end_at_release(Part& part, IslandOptions& options, double whole_step, IslandReport& done);
  double find_release(const Part& part, IslandOptions options, double whole_step);
  IslandReport foresee(const Part& part, const IslandOptions& options, double whole_step);
  IslandReport foresee_guarded(const Part& part, const IslandOptions& options, double whole_step);
  double next_cut(std::span<const ConstrainedBody> table, std::span<const Index> members,
                  std::span<Constraint* const> constraints, const Vec3& gravity, double left);
  SolveStatus iterate(const BodyStates& states, std::span<Constraint* const> constraints, const IslandOptions& options,
                      IslandReport& report);
  template <class Action>
  void for_flexibilities(Action&& act) const;
  void sort_rows();
  void factor();
  void factor_equalities();
  void order_rows();
  void assemble_ordered();
  void respond(std::span<const double> values, std::vector<double>& gaps);
  void share_anew(const BodyStates& states, std::span<Constraint* const> constraints, const IslandOptions& options);
  SolveStatus improve();
  SolveStatus improve_equalities();
  SolveStatus improve_all();
  SolveStatus solve_bounded();
  bool by_program() const;
  void take_held_impulses();
  bool holds_contact_forces() const { return rule.method == ContactMethod::kVelocityProgram; }
  void solve_touch(const IslandOptions& options, ProgramReport& report);
  void choose_touching(const IslandOptions& options, bool resting);
  void assemble_touching();
  double row_speed(Index row, const IslandOptions& options) const;
  double row_acceleration(Index row, const IslandOptions& options) const;
  template <class Side>
  double modal_sum(Index row, Side&& number) const;
  SolveStatus solve_touching(std::span<double> into, ProgramReport& report);
  void apply_touch_impulse();
  void hold_contact_forces(double length);
  void keep_within_bounds();
  double largest_change() const;
  bool can_differentiate() const;
  SolveStatus differentiate(const BodyStates& states, std::span<Constraint* const> constraints,
                            const IslandOptions& options, IslandReport& report);
  SolveStatus solve_convex(const BodyStates& states, std::span<Constraint* const> constraints,
                           const IslandOptions& options, IslandReport& report);
  SolveStatus end_unsettled(SolveStatus last, const BodyStates& states, std::span<Constraint* const> constraints,
                            const IslandOptions& options, IslandReport& report);
  void place_units();
  void fill_units();
  template <class Write>
  void fill_values(Write&& write);
  void begin_units();
  struct Distance {
    double from_law = 0.0, moved = 0.0;
  };
  Distance find_starts(bool first_round);
  void find_scale();
  void stiffen();
  void advance_units();
  void take_whole(std::span<const double> impulses);
  /// Of joints, and of contacts by other rules than the convex one: what rows answer to held forces by themselves.
  bool answers_to_loads() const { return !(convex && (contacts_alone || all_early)); }
  /// All loads and impulses come at the step's start; nothing is left for its end.
  bool takes_loads_early() const { return !answers_to_loads() && theta == 1.0; }
  /// The rows' in full: what answers to loads, and what is solved for by rows.
  bool needs_jacobian() const { return !(convex && contacts_alone); }
  void begin_early();
  void find_slip();
  bool press_early();
  double dent_of(std::size_t row);
  void take_impulses();
  template <class Action>
  void for_bodies(std::size_t row, Action&& act) const;
  void take_motion(const IslandOptions& options);
  SolveStatus take_best(const BodyStates& states, std::span<Constraint* const> constraints,
                        const IslandOptions& options, IslandReport& report);
  void predict(const IslandOptions& options);
  void predict_under_loads(const IslandOptions& options);
  void sum_loads(std::span<const double> values, double frame_scale, double modal_scale);
  void add_loads(std::span<const double> values, double frame_scale, double modal_scale);
  double largest_recovery_work(double distance, const IslandOptions& options) const;
  double agent_work(const IslandOptions& options) const;
  bool is_workless() const;
  std::span<const double> whole_impulses();
  double close_energy(const IslandOptions& options, IslandReport& report);
  bool has_recovery() const;
  void stop_recovery();
  bool slow_start(double left);
  bool yield(const BodyStates& states, std::span<Constraint* const> constraints, const IslandOptions& options,
             IslandReport& report);
  void refuse_impulses(const BodyStates& states, std::span<Constraint* const> constraints, const IslandOptions& options,
                       IslandReport& report);
};

/// act(side, local, again) for the bodies of a row; again: the one before was the same body.
template <class Action>
void IslandSolver::Impl::for_bodies(std::size_t row, Action&& act) const {
  Index last = -1;
  for (const ConstraintRows::Side& side : rows.row(static_cast<Index>(row)).sides) {
    const Index local = bodies.local(side.body);
    if (local < 0) continue;
    act(side, local, local == last);
    last = local;
  }
}

/// act(i, j, G_ij) for all pairs of rows that take part and yield to each other, both ways round.
template <class Action>
void IslandSolver::Impl::for_flexibilities(Action&& act) const {
  for (const ConstraintRows::Flexibility& g : flexibility) {
    const auto i = static_cast<std::size_t>(g.i), j = static_cast<std::size_t>(g.j);
    if (place[i] < 0 || place[j] < 0) continue;
    act(i, j, g.value);
    if (i != j) act(j, i, g.value);
  }
}

}  // namespace limber
