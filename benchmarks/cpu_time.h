// Time as these benchmarks take it: of this thread's own work, least of many passes.
#pragma once

#include <time.h>

#include <algorithm>
#include <limits>

namespace limber {

/// Seconds that this thread has computed for: other programs on the machine do not count.
inline double thread_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// The least time of a pass: what is left when nothing else disturbed caches and memory. A pass should take 20 µs or
/// more; the clock itself takes half a microsecond.
class LeastTime {
 public:
  template <class Pass>
  void measure(const Pass& pass) {
    const double start = thread_seconds();
    pass();
    seconds_ = std::min(seconds_, thread_seconds() - start);
  }
  double seconds() const { return seconds_; }

 private:
  double seconds_ = std::numeric_limits<double>::infinity();
};

/// What the clock itself adds to each time, s.
inline double clock_seconds() {
  LeastTime none;
  for (int i = 0; i < 1000; ++i) none.measure([] {});
  return none.seconds();
}

}  // namespace limber
