#include "objects.h"

namespace limber::c {
namespace {

/// One loop on its way through the caller's threads, which exceptions must not cross.
struct Loop {
  const std::function<void(std::size_t, std::size_t)>& body;
  std::mutex lock{};
  std::exception_ptr first{};

  static void run(void* of, std::size_t begin, std::size_t end) {
    Loop& loop = *static_cast<Loop*>(of);
    try {
      loop.body(begin, end);
    } catch (...) {
      const std::lock_guard guard(loop.lock);
      if (!loop.first) loop.first = std::current_exception();
    }
  }
};

}  // namespace

CallerJobs::CallerJobs(const limber_jobs& jobs) : jobs_(jobs) {
  if (jobs.concurrency > 0 && jobs.parallel_for == nullptr) throw InvalidArgument("jobs.parallel_for is NULL");
}

void CallerJobs::parallel_for(std::size_t count, std::size_t grain,
                              const std::function<void(std::size_t, std::size_t)>& body) {
  if (jobs_.concurrency <= 0) return serial_jobs().parallel_for(count, grain, body);
  Loop loop{.body = body};
  jobs_.parallel_for(jobs_.context, count, grain, &Loop::run, &loop);
  if (loop.first) std::rethrow_exception(loop.first);
}

}  // namespace limber::c
