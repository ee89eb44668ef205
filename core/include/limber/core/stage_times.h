/// @file limber/core/stage_times.h
/// Times of the stages of a step, on request (World::set_stage_times).
///
/// A StageClock is laid over a step: each lap gives all the time since the last one to a stage, so that the stages of a
/// step sum to the step. Without times to add to it reads no clock: a branch on a null pointer per lap is all it costs.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace limber {

/// The parts of a step, in the order in which they are taken, and of drawing. Behind each what its `units` count.
enum class Stage : std::uint8_t {
  kBookkeeping,  ///< what begins and ends a step, sleep, events. Unit: step
  kLookAhead,    ///< how far bodies may come within the step. Unit: body awake
  kBroadPhase,   ///< boxes about bodies, pairs of near ones. Unit: near pair
  kNarrowPhase,  ///< contacts of near pairs. Unit: contact
  kRows,         ///< contacts, joints and handles as rows; islands. Unit: row
  kAdvance,      ///< bodies without constraints, exactly. Unit: body
  kSolve,        ///< forces of the rows, predicted motions, energy guard. Unit: row
  kCommit,       ///< the predicted motions happen; rows are told their impulses. Unit: body
  kReconstruct,  ///< World::reconstruct(); no part of a step. Unit: vertex, each instance's
};
inline constexpr std::size_t kStages = 9;

/// "bookkeeping", "look_ahead", "broad_phase", "narrow_phase", "rows", "advance", "solve", "commit",
/// "reconstruct".
constexpr std::string_view to_string(Stage stage) {
  constexpr std::array<std::string_view, kStages> kNames{
      "bookkeeping", "look_ahead", "broad_phase", "narrow_phase", "rows", "advance", "solve", "commit", "reconstruct"};
  return kNames[static_cast<std::size_t>(stage)];
}

struct StageTime {
  double seconds = 0.0;    ///< wall clock
  std::int64_t units = 0;  ///< see Stage
};

class StageTimes {
 public:
  StageTime& operator[](Stage stage) { return times_[static_cast<std::size_t>(stage)]; }
  const StageTime& operator[](Stage stage) const { return times_[static_cast<std::size_t>(stage)]; }
  void add(const StageTimes& other) {
    for (std::size_t i = 0; i < kStages; ++i) {
      times_[i].seconds += other.times_[i].seconds;
      times_[i].units += other.times_[i].units;
    }
  }
  double seconds() const {  ///< of all stages
    double sum = 0.0;
    for (const StageTime& time : times_) sum += time.seconds;
    return sum;
  }

 private:
  std::array<StageTime, kStages> times_{};
};

class StageClock {
 public:
  /// Starts. @param times what laps are added to, which outlives this; null: laps do nothing
  explicit StageClock(StageTimes* times = nullptr) : times_(times) {
    if (times_ != nullptr) last_ = Clock::now();
  }
  bool runs() const { return times_ != nullptr; }
  /// The time since the last lap was spent on a stage.
  void lap(Stage stage, std::int64_t units = 0) {
    if (times_ == nullptr) return;
    (*times_)[stage].seconds += seconds();
    (*times_)[stage].units += units;
  }
  /// It was spent by others, perhaps many at once, whose own times say on what: it is split in their proportions, and
  /// goes to `otherwise` where they tell of no time.
  void lap(const StageTimes& theirs, Stage otherwise) {
    if (times_ == nullptr) return;
    const double sum = theirs.seconds(), passed = seconds();
    if (!(sum > 0.0)) (*times_)[otherwise].seconds += passed;
    for (std::size_t i = 0; i < kStages; ++i) {
      const auto stage = static_cast<Stage>(i);
      if (sum > 0.0) (*times_)[stage].seconds += passed * (theirs[stage].seconds / sum);
      (*times_)[stage].units += theirs[stage].units;
    }
  }

 private:
  using Clock = std::chrono::steady_clock;
  double seconds() {
    const Clock::time_point now = Clock::now();
    const double passed = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return passed;
  }

  StageTimes* times_;
  Clock::time_point last_{};
};

}  // namespace limber
