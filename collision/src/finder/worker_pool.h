// Lends what threads work with. Which of them does a task changes nothing but the time.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "limber/core/error.h"

namespace limber::internal {

template <class Worker>
class WorkerPool {
 public:
  /// @param make a worker. @param start gets each one ready for a query
  template <class Make, class Start>
  void start_query(int concurrency, const Make& make, const Start& start) {
    while (all_.size() < static_cast<std::size_t>(concurrency)) all_.push_back(make());
    free_.clear();
    for (const auto& worker : all_) start(*worker), free_.push_back(worker.get());
  }
  class Lease {
   public:
    explicit Lease(WorkerPool& from) : from_(from), worker_(from.take()) {}
    ~Lease() {
      const std::lock_guard lock(from_.mutex_);
      from_.free_.push_back(worker_);
    }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    Worker& operator*() const { return *worker_; }

   private:
    WorkerPool& from_;
    Worker* worker_;
  };

 private:
  Worker* take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) throw ComputationError("find_contacts: Jobs runs more loop bodies at once than concurrency()");
    Worker* worker = free_.back();
    free_.pop_back();
    return worker;
  }
  std::mutex mutex_;
  std::vector<std::unique_ptr<Worker>> all_;
  std::vector<Worker*> free_;
};

}  // namespace limber::internal
