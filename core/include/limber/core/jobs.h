/// @file limber/core/jobs.h
/// Parallel loops behind an interface, so that a game can lend its own thread pool. The serial form is here; a oneTBB
/// form is in limber::jobs_tbb.
#pragma once

#include <cstddef>
#include <functional>

namespace limber {

/// Runs loop bodies. An implementation may run ranges at the same time and in any order, so a caller writes only to
/// what its own indices own; results then cannot depend on the thread count.
class Jobs {
 public:
  virtual ~Jobs() = default;

  /// Calls body(begin, end) for disjoint ranges that cover [0, count), each of at most `grain` indices but the whole at
  /// once where that is cheaper. Returns when all are done. The first exception of a body is thrown again here.
  /// @param grain ≥ 1
  virtual void parallel_for(std::size_t count, std::size_t grain,
                            const std::function<void(std::size_t begin, std::size_t end)>& body) = 0;

  /// How many bodies may run at once, ≥ 1.
  virtual int concurrency() const = 0;
};

/// Everything in the calling thread. Allocates nothing.
class SerialJobs final : public Jobs {
 public:
  void parallel_for(std::size_t count, std::size_t grain,
                    const std::function<void(std::size_t, std::size_t)>& body) override;
  int concurrency() const override { return 1; }
};

/// A shared SerialJobs for default arguments.
Jobs& serial_jobs();

}  // namespace limber
