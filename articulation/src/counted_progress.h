/// How much of a parallel loop is done, told to the thread that called it. Private to the module.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

namespace limber::internal {

/// Counts pieces of work that any thread finishes. Tells of them in the thread that made it, which takes its share of
/// the work: what it tells ascends.
class CountedProgress {
 public:
  /// @param tell gets the part done, 0 … 1; may be empty
  CountedProgress(std::size_t pieces, const std::function<void(double)>& tell)
      : pieces_(pieces), tell_(tell), caller_(std::this_thread::get_id()) {}

  void done(std::size_t pieces = 1) {
    const std::size_t all = done_ += pieces;
    if (tell_ && std::this_thread::get_id() == caller_) tell_(static_cast<double>(all) / static_cast<double>(pieces_));
  }

 private:
  const std::size_t pieces_;
  const std::function<void(double)>& tell_;
  const std::thread::id caller_;
  std::atomic<std::size_t> done_{0};
};

}  // namespace limber::internal
