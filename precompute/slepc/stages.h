/// @file stages.h
/// Time by stage of a process.
#pragma once

#include <chrono>
#include <ctime>
#include <map>
#include <string>

namespace limber::internal {

class Stages {
 public:
  struct Time {
    double clock = 0.0, cpu = 0.0;  ///< s; the latter of this process, waiting for others too
  };

  /// Adds what passed since the last lap to a stage.
  void lap(const std::string& stage) {
    const Time now = read();
    times_[stage].clock += now.clock - last_.clock;
    times_[stage].cpu += now.cpu - last_.cpu;
    last_ = now;
  }
  const std::map<std::string, Time>& times() const { return times_; }

 private:
  static Time read() {
    const auto clock = std::chrono::steady_clock::now().time_since_epoch();
    return {std::chrono::duration<double>(clock).count(), static_cast<double>(std::clock()) / CLOCKS_PER_SEC};
  }
  std::map<std::string, Time> times_;
  Time last_ = read();
};

}  // namespace limber::internal
