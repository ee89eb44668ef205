// What a contact source is asked with before a step: where bodies are, and how far they may come within it. What is
// touched goes on as it does, for the most part; by a fall from rest and a speculative margin beside that everything
// that is not is found as well.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "body_table.h"
#include "limber/dynamics/contact_source.h"
#include "limber/dynamics/exact_motion.h"
#include "sleep_stage.h"

namespace limber::internal {

class MotionForecast {
 public:
  MotionForecast(BodyTable& bodies, SleepStage& sleep) : bodies_(&bodies), sleep_(&sleep) {}

  /// What the source has been told is forgotten.
  void tell_all_anew() { told_ = {}; }
  /// @param length of the step, s, taken in so many substeps. @return whether those of bodies that sleep were written,
  /// too
  bool write_states(double length, int substeps, const Vec3& gravity);

  /// By body.
  std::span<const BodyState> states() const { return states_; }
  std::span<const double> thickness() const { return thickness_; }
  /// Those that are awake, parts of compounds too, ascending. @pre write_states() has not written all
  std::span<const Index> awake() const { return bodies_->has_parts() ? awake_ : sleep_->awake(); }
  /// See ContactQuery::fall.
  const Vec3& fall() const { return fall_; }

 private:
  struct Told {
    std::uint64_t changes = 0;  // SleepStage::changes()
    int left = 0;               // times that all states are to be told, sleepers and statics too
  };
  void write_all();
  void write_awake(Index body);
  void write_parts(Index body);
  void expect_steady(Index body, BodyState& state);
  void expect_exact(Index body, BodyState& state);

  BodyTable* bodies_;
  SleepStage* sleep_;
  double length_ = 0.0;
  Vec3 gravity_ = Vec3::Zero(), fall_ = Vec3::Zero();
  Told told_;
  // By body.
  std::vector<BodyState> states_;
  std::vector<std::vector<double>> end_amplitudes_;
  std::vector<double> thickness_;  // m; infinite for what stands
  std::vector<Index> awake_;       // with parts
  ExactMotion motion_;             // scratch
};

}  // namespace limber::internal
