// Handles, joints and other Constraints in a step by small steps, all of them solved at once in each substep
// (row_system.h). Rows with bounds (limits, motors, friction, hands) hold or stay at a bound, as the signs of their
// forces and of their gaps have it. First velocities are made to agree with the rows, then contacts are swept, the
// bodies move, and what their gaps are off by there is closed: by velocities, as far as they gain no more energy than
// the first solution took, and else by displacements that leave no speed (docs/derivations/small-steps.md).
#pragma once

#include "row_system.h"

namespace limber::internal {

class GameConstraints {
 public:
  /// Sums over rows of what was open before a closing and is after it, squared.
  struct Closing {
    double before = 0.0, both = 0.0, after = 0.0;
  };
  /// Twice the energy that a motion may have and has, and what share of the motion is left.
  struct Limit {
    double most = 0.0, has = 0.0, share = 1.0;
  };

  /// The rows of a substep, from where it begins. @param number of the substep, 0 …
  void make_rows(const BodyStates& states, const GameBodies& bodies, std::span<Constraint* const> constraints,
                 int number);
  /// Once the bodies have fallen: makes their motion meet the rows.
  void solve(GameBodies& bodies);
  /// y by solve(), by body; none without rows.
  std::span<const double> moved() const {
    return rows_.groups().empty() ? std::span<const double>{} : std::span(moved_.front().v, 8 * moved_.size());
  }
  /// Once the bodies have moved: closes what is open there. @param pushed whether GameBodies::pushes() moved them
  void close(const BodyStates& states, GameBodies& bodies, bool pushed);
  /// Tells the constraints what acted, and at the end of a step closes what close() has left.
  void end_substep(const BodyStates& states, GameBodies& bodies, bool last);

  std::size_t size() const { return rows_.rows().size(); }
  /// The largest gap of the rows that hold, m or rad, at the end of the last substep.
  double residual() const { return residual_; }
  bool all_finite() const;

 private:
  enum Column : std::size_t { kRate, kCurve, kPlace, kColumns };

  void solve_once();
  bool let_go(bool takes_hold);
  void take(std::vector<Block8>& motion);
  void find_gaps(const BodyStates& states);
  void measure(const BodyStates& states, const GameBodies& bodies, bool pushed);
  void find_shares();
  void displace(GameBodies& bodies);
  void move(GameBodies& bodies, bool speeds);
  void limit_change(std::vector<Double8>& y, std::vector<Double8>& change);
  void limit_speeds(const GameBodies& bodies);
  void end_moving(GameBodies& bodies, bool speeds);
  void close_step(const BodyStates& states, GameBodies& bodies);
  void find_errors(const BodyStates& states);
  void close_errors(GameBodies& bodies);
  bool find_closing_shares();
  void shorten_closing(GameBodies& bodies);

  GameRows rows_;
  RowSystem system_;
  std::vector<Double8> motion_, moved_;  // of the bodies: all of it; what the rows did
  std::vector<Double8> slopes_;  // of energies, before all impulses of the substep and after them; none: nobody asks
  std::vector<double> taken_, given_;             // energies by component
  std::vector<double> right_, asked_;             // of the system
  std::vector<Double8> speed_, place_, pushes_;   // of the bodies
  std::vector<double> gaps_, forces_, products_;  // by row: scratch; products_ keeps J motion_ of a solution
  std::vector<Closing> closings_;                 // by component
  std::vector<Limit> limits_;                     // likewise
  double residual_ = 0.0;
};

}  // namespace limber::internal
