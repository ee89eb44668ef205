// Handles, joints and other Constraints in a step by small steps: their rows are made anew in each substep, as they
// turn with the bodies, and take part in its sweeps.
//
// Rows without compliance ask for velocities, J Δy = h end_rate; what is left of their gaps is undone by displacements
// of the frames that leave no speed, and where frames cannot move, by the modes. Rows with compliance ask for
// gap − offset + C f = 0 at the substep's end. They begin a substep without a force: a row that looks at its gap and
// begins with the last one would grow where the sweeps have not met it (docs/derivations/small-steps.md).
#pragma once

#include <span>
#include <vector>

#include "game_bodies.h"
#include "limber/constraints/constraint.h"

namespace limber::internal {

/// One row of a constraint in the coordinates of the bodies.
struct GameRow {
  struct Side {
    std::int32_t rows = 0, body = 0, blocks = 0, frame = -1;  // as ContactSideRows, one row
  };
  std::array<Side, 2> sides;
  RowLaw law;
  double wanted = 0.0;      // what J y is to be, with what the modes had at the substep's start
  double compliance = 0.0;  // gap per force
  double mass = 0.0, push_mass = 0.0;
  double error = 0.0;              // of its gap, that frames undo
  double force = 0.0, push = 0.0;  // held over the substep; what displaces frames
};

class GameConstraints {
 public:
  /// The rows of a substep, from where it begins. @param number of the substep, 0 …
  void make_rows(const BodyStates& states, const GameBodies& bodies, std::span<Constraint* const> constraints,
                 int number);
  /// Gives the bodies the forces that go on.
  void begin_substep(GameBodies& bodies);
  void sweep(GameBodies& bodies, bool backward);
  /// @return whether any gap is to be undone
  bool wants_push() const { return wants_push_; }
  void push_apart(GameBodies& bodies, bool backward);
  /// Once the bodies have moved: what goes on belongs to the rows to come.
  void end_substep(const BodyStates& states, GameBodies& bodies);

  std::size_t size() const { return rows_.size(); }
  /// The largest change that a hard row's velocity law still asks for, m or rad of the last substep.
  double residual(const GameBodies& bodies) const;
  bool all_finite() const;

 private:
  static constexpr int kMostTogether = 6;
  using Together = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostTogether, kMostTogether>;
  /// The rows of one constraint.
  struct Group {
    Constraint* constraint = nullptr;
    std::size_t first = 0, count = 0;
    std::array<std::size_t, kMostTogether> equal{};  // those that lock, solved for together
    int together = 0;
    Together inverse{};
  };

  void add_rows(const BodyStates& states, const GameBodies& bodies, Constraint* constraint, double h);
  void add_row(const GameBodies& bodies, const ConstraintRows::Row& from, double gap, double yields);
  void add_side(const GameBodies& bodies, const ConstraintRows::Side& from, GameRow::Side& side);
  void find_target(const GameBodies& bodies, GameRow& row, double gap, double yields) const;
  void lock_together(Group& group) const;
  void solve(Group& group, GameBodies& bodies);
  void solve_together(Group& group, GameBodies& bodies);
  std::size_t solve_bounded(std::size_t at, GameBodies& bodies);
  void solve_vector(std::size_t first, std::size_t count, double radius, GameBodies& bodies);
  double read(const GameRow& row, const std::vector<Block8>& x) const;
  void apply(const GameRow& row, double force, std::vector<Block8>& x) const;
  double coupling(const GameRow& row, const GameRow& other) const;
  double open(const GameRow& row, const GameBodies& bodies) const;

  std::vector<GameRow> rows_;
  std::vector<Group> groups_;
  std::vector<Block8> blocks_;
  ConstraintRows made_;
  std::vector<double> gaps_, impulses_, yields_;  // scratch
  bool wants_push_ = false;
};

}  // namespace limber::internal
