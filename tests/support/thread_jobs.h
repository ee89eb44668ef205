// Jobs on a number of threads of the test's choice.
#pragma once

#include <cstddef>
#include <functional>
#include <thread>
#include <vector>

#include "limber/core/jobs.h"

namespace limber::testing {

/// As many threads as asked for, whatever the machine has; ranges of uneven size, started in reverse.
class ThreadJobs final : public Jobs {
 public:
  explicit ThreadJobs(int threads) : threads_(threads) {}
  void parallel_for(std::size_t count, std::size_t,
                    const std::function<void(std::size_t, std::size_t)>& body) override {
    const auto n = static_cast<std::size_t>(threads_);
    std::vector<std::jthread> threads;
    for (std::size_t i = n; i-- > 0;) {
      const std::size_t begin = count * i * i / (n * n), end = count * (i + 1) * (i + 1) / (n * n);
      if (begin < end) threads.emplace_back([&body, begin, end] { body(begin, end); });
    }
  }
  int concurrency() const override { return threads_; }

 private:
  int threads_;
};

}  // namespace limber::testing
