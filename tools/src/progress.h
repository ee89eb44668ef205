/// @file progress.h
/// One line of progress on a terminal, for work that takes longer than a second; nothing at all when piped.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

namespace limber::tools {

/// Shows "NAME: STAGE … 3.2 s" on stderr, redrawn by a thread of its own, so that a stage may block as long as it
/// likes.
class Progress {
 public:
  /// @param name of the program. Looks once whether stderr is a terminal.
  explicit Progress(std::string name);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// The work enters a stage, such as "factorising".
  void stage(std::string_view what);
  /// How far the stage is, in [0, 1].
  void fraction(double done);
  /// Removes the line. No more is drawn until the next stage().
  void clear();

 private:
  void watch(const std::stop_token& stop);

  const std::string name_;
  const bool terminal_;
  std::chrono::steady_clock::time_point began_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::string stage_;       // empty: nothing to show
  double fraction_ = -1.0;  // negative: unknown
  bool drawn_ = false;
  std::jthread watcher_;  // last: it uses all of the above
};

}  // namespace limber::tools
