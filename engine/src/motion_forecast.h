// Where bodies are when a step begins, how far they may come within it, and where they are expected when it ends: what
// a contact source is asked with.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "body_table.h"
#include "constraint_stage.h"
#include "limber/dynamics/contact_source.h"
#include "limber/dynamics/exact_motion.h"
#include "sleep_stage.h"

namespace limber::internal {

/// Where a body is expected when the step ends; BodyState has the meaning of the first three.
struct ExpectedEnd {
  RigidTransform pose{};
  std::vector<double> amplitudes;
  double doubt = 0.0;
  bool foreseen = false;
};

class MotionForecast {
 public:
  MotionForecast(BodyTable& bodies, const ConstraintStage& constraints, SleepStage& sleep)
      : bodies_(&bodies), constraints_(&constraints), sleep_(&sleep) {}

  /// Nothing is known of the step to come. @param length s
  void begin(double length, const Vec3& gravity);
  /// Forgets what the source has been told.
  void tell_all_anew() { told_.changes = 0; }
  /// @return whether those of bodies that sleep were written, too
  bool write_states();
  /// Writes the state of a body that moves. @param length how long it is to be looked ahead, s
  void write_state(Index body, double length);
  /// All stand where they are now.
  void stand_still();
  /// A body that takes the rest of the step by itself: where it would be in the end if nothing held it, and how far
  /// contacts are looked for. @param left s
  void expect_in_part(Index body, double left, double look_ahead);
  /// Whether a body's step may be cut, and what it comes to found on its way. Others are looked ahead for as far as
  /// they come.
  bool can_wait(Index body) const;
  /// So are these, until all are looked ahead for by themselves again.
  void look_farther(std::span<const Index> bodies);
  void look_as_before() { farther_.clear(); }

  /// Takes for expected where the step, as foreseen, takes bodies that end elsewhere than they were expected.
  /// @return whether contacts have not been looked for there
  bool expect_foreseen_ends();
  /// Where a body ends, as foreseen.
  void find_end(Index body, ExpectedEnd& end) const;
  /// The same, of one in an island.
  void foreseen_end(Index body, ExpectedEnd& end) const;
  /// How far any point of a body is at most from where the way of its origin takes it, m.
  double beside(Index body, const ExpectedEnd& end) const;
  /// How far a body comes in a step that lets go of it, m. Where something held it, gravity acts at the step's start.
  double fall() const { return gravity_.norm() * length_ * length_; }

  /// By body.
  std::span<const BodyState> states() const { return states_; }
  const BodyState& state(Index body) const { return states_[static_cast<std::size_t>(body)]; }
  const ExactMotion& motion(Index body) const { return motions_[static_cast<std::size_t>(body)]; }
  /// How far any point may come within the step, where it ends or before, m.
  double way(Index body) const { return ways_[static_cast<std::size_t>(body)]; }

 private:
  /// How far the source has been told.
  struct Told {
    std::uint64_t changes = 0;  // SleepStage::changes()
    int left = 0;               // times all states are to be told, sleepers and statics too: as they come to stand, and
                                // as they stay
  };
  void write_all_states();
  static void expect_to_stay(BodyState& state);
  void expect(Index body);
  void expect_unconstrained(Index body);
  double free_reach(Index body, const Vec3& displacement) const;
  double difference(Index body, const Quaternion& q, std::span<const double> z, const ExpectedEnd& end) const;
  bool looks_farther(Index body) const {
    return static_cast<std::size_t>(body) < farther_.size() && farther_[static_cast<std::size_t>(body)] != 0;
  }

  BodyTable* bodies_;
  const ConstraintStage* constraints_;
  SleepStage* sleep_;
  double length_ = 0.0;
  Vec3 gravity_ = Vec3::Zero();
  Told told_;
  // By body.
  std::vector<BodyState> states_;
  std::vector<ExactMotion> motions_;
  std::vector<ExpectedEnd> expected_;
  std::vector<double> ways_;
  std::vector<char> farther_;
  ExpectedEnd end_;  // scratch
};

}  // namespace limber::internal
