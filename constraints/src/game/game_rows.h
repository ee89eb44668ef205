// The rows of handles, joints and other Constraints in a substep.
//
// J counts in the bodies' coordinates y (game_bodies.h). Forces move them by W Jᵀf, W = 1 but for turns of links that
// are pulled outward: there it is 1/(1 + ¼h²k), k the stiffness against the turn in units of the inertia, so that they
// come as by the trapezoidal rule. Without that a link that turns to and fro faster than 2 radians a substep would be
// thrown about.
#pragma once

#include <span>
#include <vector>

#include "game_bodies.h"
#include "limber/constraints/constraint.h"
#include "row_kernels.h"

namespace limber::internal {

/// One row of a constraint.
struct GameRow {
  enum class Hold : std::uint8_t { kMet, kLower, kUpper };

  double lower = -kUnbounded, upper = kUnbounded;  // of its force
  double target = 0.0;                             // what J y is to be, with what the modes had at the substep's start
  double compliance = 0.0;                         // gap per force
  double rate = 0.0;                               // what the gap is to change by in the substep
  double error = 0.0;                              // of its gap at the substep's start, which displacements undo
  double error_before = 0.0;                       // the same, before the last closing
  double left = 0.0;                               // of the step's first error, what the step does not undo
  double force = 0.0;                              // held over the substep
  double closing = 0.0;                            // displaces the bodies at the step's end: the last such force
  bool keeps_place = true;                         // the gap itself counts, and not its rate alone
  bool gives_way = false;                          // of a hand of limited force, which closing does not wait for
  bool cut = false;                                // whether the last solution asked for a force beyond a bound
  Hold hold = Hold::kMet;

  bool is_bounded() const { return lower != -kUnbounded || upper != kUnbounded; }
};

/// A body that rows act on, and the number of those that rows join it to.
struct RowBody {
  std::int32_t frame = 0, first = 0, blocks = 0, component = 0;
};

class GameRows {
 public:
  /// From where the substep begins. @param number of the substep, 0 …
  void make(const BodyStates& states, const GameBodies& bodies, std::span<Constraint* const> constraints, int number);
  /// J where the bodies are at the step's end, for displacements: turns resist what GameRow::closing would do to them
  /// beyond first order. @pre the constraints have accepted the substep
  void linearise_again(const BodyStates& states, const GameBodies& bodies);
  /// Once the bodies have begun the substep: what moves a led body in it whatever acts.
  void add_what_leads(const GameBodies& bodies);

  std::span<GameRow> rows() { return rows_; }
  std::span<const GameRow> rows() const { return rows_; }
  std::span<const GameGroup> groups() const { return groups_; }
  std::span<GameRow> of(const GameGroup& group) { return std::span(rows_).subspan(group.first, group.count); }
  std::size_t blocks() const { return blocks_; }     ///< of all bodies' coordinates, and one that stands
  bool any_bounded() const { return any_bounded_; }  ///< whether any row is
  /// s, the substep
  double length() const { return length_; }
  RowArrays arrays() const { return {groups_.data(), groups_.size(), numbers_.data(), weights_.data()}; }

  // Vectors have the blocks of the bodies' coordinates.
  /// y in double. @param at where, others are left as they are
  void widen(std::span<const RowBody> at, const std::vector<Block8>& y, std::vector<Double8>& to) const;
  /// The same of GameBodies::pushes().
  void widen_pushes(std::span<const RowBody> at, const std::vector<Block8>& pushes, std::vector<Double8>& to) const;
  /// slopes += W times those of the bodies' energies, J for a unit of y. @param y, more whose sum the frames have
  void add_energy_slopes(const GameBodies& bodies, std::span<const RowBody> at, const std::vector<Block8>& y,
                         std::span<const Double8> more, std::vector<Double8>& slopes);
  /// Twice the energy that a body's stiffness against turns takes of its motion.
  double stored(const RowBody& body, const Double8& y) const {
    const Turns& k = stiffness_[static_cast<std::size_t>(body.frame)];
    return k[0] * y.v[3] * y.v[3] + k[1] * y.v[4] * y.v[4] + k[2] * y.v[5] * y.v[5];
  }
  /// J y. @param product one number for each row
  void multiply(std::span<const Double8> y, std::vector<double>& product) const;
  /// y += W Jᵀ f. @param forces likewise
  void add_answer(std::span<const double> forces, std::span<Double8> y) const;

 private:
  /// A body that something leads, in a row.
  struct Led {
    std::size_t row = 0;
    std::int32_t frame = -1;
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
  };
  using Turns = std::array<double, 3>;  // by axis of the inertia

  void linearise(const BodyStates& states, Constraint* constraint);
  void add_group(const GameBodies& bodies, Constraint* constraint);
  void write_sides(const GameBodies& bodies, const GameGroup& group, bool closing);
  /// Of one side of the rows at hand: what their forces pull with, and where they act from the body's origin, world.
  struct Pull {
    Vec3 force = Vec3::Zero(), arm = Vec3::Zero();
    double directions = 0.0;  // of less than two the arm is not known
  };
  static void stiffen(const GameBody& body, const Pull& at, Turns& stiffness);
  static void resist(const GameBody& body, const Pull& at, Turns& stiffness);
  void write_row(const GameBodies& bodies, const GameGroup& group, std::size_t i);
  void hold(const GameGroup& group, double step);
  void weigh_turns();

  std::vector<GameRow> rows_;
  std::vector<GameGroup> groups_;
  std::vector<Double8> numbers_;  // J
  std::vector<Turns> stiffness_;  // by frame, against its turn: k, and then ¼h²k
  std::vector<Double8> weights_;
  std::vector<Led> led_;
  ConstraintRows made_;
  std::vector<double> slope_;  // scratch
  std::size_t blocks_ = 0;
  double length_ = 0.0, per_length_ = 0.0;
  bool any_bounded_ = false;
};

}  // namespace limber::internal
