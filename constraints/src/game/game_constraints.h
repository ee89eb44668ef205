// Handles, joints and other Constraints in a step by small steps, all of them solved at once in each substep:
//
//   (J Jᵀ + C) Δf = target − J y − C f        for the rows that hold, by JointFactor
//
// y: the bodies' coordinates (game_bodies.h), C: compliance of springs and dampers. Rows with bounds (limits, motors,
// friction, hands) hold or stay at a bound, as the signs of their forces and of their gaps have it. First velocities
// are made to agree with the rows, then contacts are swept, the bodies move, and what their gaps are off by there is
// closed: by velocities, as far as they gain no more energy than the first solution took, and else by displacements
// that leave no speed (docs/derivations/small-steps.md).
#pragma once

#include <span>
#include <vector>

#include "game_bodies.h"
#include "joint_factor.h"
#include "limber/constraints/constraint.h"

namespace limber::internal {

/// One row of a constraint.
struct GameRow {
  enum class Hold : std::uint8_t { kMet, kLower, kUpper };

  double lower = -kUnbounded, upper = kUnbounded;  // of its force
  double target = 0.0;                             // what J y is to be, with what the modes had at the substep's start
  double compliance = 0.0;                         // gap per force
  double gap = 0.0;                                // at the substep's start
  double rate = 0.0;                               // what the gap is to change by in the substep
  double error = 0.0;                              // of its gap at the substep's start, which displacements undo
  double force = 0.0;                              // held over the substep
  bool keeps_place = true;                         // the gap itself counts, and not its rate alone
  bool gives_way = false;                          // of a hand of limited force, which closing does not wait for
  bool cut = false;                                // whether the last solution asked for a force beyond a bound
  Hold hold = Hold::kMet;
};

class GameConstraints {
 public:
  /// The rows of a substep, from where it begins. @param number of the substep, 0 …
  void make_rows(const BodyStates& states, const GameBodies& bodies, std::span<Constraint* const> constraints,
                 int number);
  /// Once the bodies have fallen: makes their motion meet the rows.
  void solve(GameBodies& bodies);
  /// Once the bodies have moved: closes what is open there. @param pushed whether GameBodies::pushes() moved them
  void close(const BodyStates& states, GameBodies& bodies, bool pushed);
  /// Closes what close() has left, at the end of a step, and tells the constraints what acted.
  void end_substep(const BodyStates& states, GameBodies& bodies, bool last);

  std::size_t size() const { return rows_.size(); }
  /// The largest gap of the rows that hold, m or rad, at the end of the last substep.
  double residual() const { return residual_; }
  bool all_finite() const;

 private:
  /// A body in the rows of one constraint: as many numbers a row as it has coordinates.
  struct Side {
    std::int32_t frame = -1, coordinates = 0, body = 0;  // −1: none. body: the first block of its coordinates
    std::size_t at = 0;                                  // of the first row in numbers_
  };
  /// The rows of one constraint.
  struct Group {
    Constraint* constraint = nullptr;
    std::size_t first = 0, count = 0;  // of its rows
    std::array<Side, 2> sides;
    std::size_t first_met = 0;  // in met_: those of its rows that hold
    std::int32_t met = 0, component = 0;
  };
  /// A body that something leads, in a row.
  struct Led {
    std::size_t row = 0;
    std::int32_t frame = -1;
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
  };
  enum Column : std::size_t { kRate, kCurve, kPlace, kColumns };

  void add_rows(const BodyStates& states, const GameBodies& bodies, Constraint* constraint, double h);
  void add_sides(const GameBodies& bodies, Group& group);
  void stiffen(const GameBodies& bodies, const Group& group, std::size_t s);
  void scale_turns();
  double last_force(const Group& group, std::size_t i) const;
  void write_side(const GameBodies& bodies, const ConstraintRows::Side& from, double* to) const;
  void add_row(const GameBodies& bodies, const Group& group, std::size_t i);
  void hold_as_before(int number);
  void find_graph(const GameBodies& bodies);
  void find_components(const GameBodies& bodies);
  void add_what_leads(const GameBodies& bodies);
  void factor(bool closing);
  void list_met(bool closing);
  void add_products(const Group& of_rows, const Group& of_columns, const Side& a, const Side& b, double* to) const;
  template <class Counts>
  std::span<const double> changes(const Group& group, const Counts& counts);
  void solve_once(const GameBodies& bodies);
  void find_taken(const GameBodies& bodies);
  static double cut_off(GameRow& row, double force);
  void solve_by_gradients(const GameBodies& bodies);
  void multiply(const GameBodies& bodies, std::span<const double> x, std::span<double> product);
  bool let_go(const GameBodies& bodies, bool takes_hold);
  template <class Visit>
  void for_met_gaps(const BodyStates& states, const Visit& visit);
  void measure(const BodyStates& states, const GameBodies& bodies, bool pushed);
  void find_shares();
  void displace(GameBodies& bodies, bool gains_speed);
  double read(const Group& group, std::size_t i, const std::vector<Block8>& x) const;
  double read(const Group& group, std::size_t i, const std::vector<double>& x) const;
  double read_pushes(const Group& group, std::size_t i, std::span<const Block8> pushes) const;
  std::array<double, 8> answer(const Group& group, const Side& side, std::int32_t first,
                               std::span<const double> forces) const;
  void apply(const Group& group, std::span<const double> forces, std::vector<Block8>& x) const;
  void apply(const Group& group, std::span<const double> forces, std::span<double> x) const;

  std::vector<GameRow> rows_, before_;  // of the last substep
  std::vector<Group> groups_;
  std::vector<std::array<double, 8>> scales_, unscales_;  // by frame: of its coordinates, for what pulls at it
  std::vector<double> numbers_;                           // J
  std::vector<std::int32_t> met_;                         // rows that hold, by group
  std::vector<std::int32_t> sizes_;                       // their number
  std::vector<Led> led_;
  JointFactor factor_;
  std::vector<JointFactor::Pair> graph_;
  std::vector<std::array<std::int32_t, 2>> incident_;  // (frame, group)
  std::vector<std::int32_t> frames_;                   // that rows act on
  std::vector<std::int32_t> roots_;                    // of components, by frame
  std::vector<double> begun_;                          // by row: the force that the motion has when solving begins
  std::vector<double> answers_;                        // by coordinate: what the other forces move
  std::vector<double> taken_, given_;                  // energies by component
  std::vector<double> right_, asked_, speed_, place_;
  std::vector<double> residuals_, directions_, products_, conditioned_;  // of conjugate gradients
  ConstraintRows made_;
  std::vector<double> gaps_, forces_, yields_;  // scratch
  double residual_ = 0.0, length_ = 0.0;
  bool goes_on_ = false;  // rows are those of the substep before
};

}  // namespace limber::internal
