// Steps taken, and the real time that waits for the next one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>

namespace limber::internal {

class WorldTime {
 public:
  /// @param step length of a step, s, here and below
  double seconds(double step) const { return time_before_ + static_cast<double>(steps_ - steps_before_) * step; }
  std::uint64_t steps() const { return steps_; }
  double dropped() const { return dropped_; }      ///< s
  double waiting() const { return accumulator_; }  ///< s, of real time

  void count_step() { ++steps_; }
  /// @return how many steps fit into the real time that waits, at most so many; what is beyond is dropped
  int take(double real_seconds, double step, int at_most) {
    accumulator_ += real_seconds;
    const double wanted = std::floor(accumulator_ / step);
    const double taken = std::min(wanted, static_cast<double>(at_most));
    accumulator_ = std::clamp(std::fmod(accumulator_, step), 0.0, std::nextafter(step, 0.0));
    dropped_ += (wanted - taken) * step;
    return static_cast<int>(taken);
  }
  /// Steps to come have another length; what waits stays the same fraction of one.
  void change_step(double from, double to) {
    accumulator_ = std::min(accumulator_ / from * to, std::nextafter(to, 0.0));
    time_before_ = seconds(from);
    steps_before_ = steps_;
  }

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.steps_, s.steps_before_, s.time_before_, s.accumulator_, s.dropped_);
  }

 private:
  std::uint64_t steps_ = 0, steps_before_ = 0;  // taken; those before the step's length was last set
  double time_before_ = 0.0;                    // s, of these
  double accumulator_ = 0.0, dropped_ = 0.0;    // s
};

}  // namespace limber::internal
