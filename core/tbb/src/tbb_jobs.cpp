#include "limber/jobs_tbb/tbb_jobs.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <string>

#include "limber/core/error.h"

namespace limber {

struct TbbJobs::Arena {
  tbb::task_arena arena;
};

TbbJobs::TbbJobs(int threads) {
  if (threads < 0)
    throw InvalidArgument("TbbJobs: threads is " + std::to_string(threads) + ", expected 0 (all) or more");
  arena_ = std::make_unique<Arena>();
  arena_->arena.initialize(threads == 0 ? tbb::task_arena::automatic : threads);
}

TbbJobs::~TbbJobs() = default;

void TbbJobs::parallel_for(std::size_t count, std::size_t grain,
                           const std::function<void(std::size_t, std::size_t)>& body) {
  if (grain == 0) throw InvalidArgument("Jobs::parallel_for: grain is 0, expected at least 1");
  if (count == 0) return;
  if (count <= grain) return body(0, count);
  arena_->arena.execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain),
                      [&](const tbb::blocked_range<std::size_t>& r) { body(r.begin(), r.end()); });
  });
}

int TbbJobs::concurrency() const { return arena_->arena.max_concurrency(); }

}  // namespace limber
