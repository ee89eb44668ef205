/// @file limber/jobs_tbb/tbb_jobs.h
/// limber::Jobs over oneTBB. A target of its own (limber::jobs_tbb), so that only those who ask for it link TBB.
#pragma once

#include <memory>

#include "limber/core/jobs.h"

namespace limber {

class TbbJobs final : public Jobs {
 public:
  /// @param threads number of threads including the caller's; 0: as many as the machine has
  /// @throws InvalidArgument if threads < 0
  explicit TbbJobs(int threads = 0);
  ~TbbJobs() override;

  void parallel_for(std::size_t count, std::size_t grain,
                    const std::function<void(std::size_t, std::size_t)>& body) override;
  int concurrency() const override;

 private:
  struct Arena;
  std::unique_ptr<Arena> arena_;
};

}  // namespace limber
