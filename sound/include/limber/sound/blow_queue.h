/// @file limber/sound/blow_queue.h
/// Blows from a game's thread to the thread that plays them, which must never wait.
///
///   BlowQueue queue(256);
///   // game:                              // audio callback:
///   queue.push({.body = bell, …});        for (Blow b; queue.pop(b);) synthesizer.strike(b);
///                                         synthesizer.render(interleaved);
///
/// A ring of fixed size [Lamport, Proving the Correctness of Multiprocess Programs, 1977]: one thread pushes and one
/// pops, at the same time. Neither takes a lock, waits or allocates.
#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

#include "limber/sound/synthesizer.h"

namespace limber {

class BlowQueue {
 public:
  /// @param capacity blows that wait at most; 0 counts as 1
  explicit BlowQueue(std::size_t capacity) : slots_((capacity > 0 ? capacity : 1) + 1) {}
  BlowQueue(const BlowQueue&) = delete;
  BlowQueue& operator=(const BlowQueue&) = delete;

  /// By the one thread that pushes. @return false where the queue is full: the blow is not taken
  bool push(const Blow& blow) {
    const std::size_t end = end_.load(std::memory_order_relaxed), next = after(end);
    if (next == begin_.load(std::memory_order_acquire)) return false;
    slots_[end] = blow;
    end_.store(next, std::memory_order_release);
    return true;
  }

  /// By the one thread that pops, in the order of push(). @return false where none waits
  bool pop(Blow& blow) {
    const std::size_t begin = begin_.load(std::memory_order_relaxed);
    if (begin == end_.load(std::memory_order_acquire)) return false;
    blow = slots_[begin];
    begin_.store(after(begin), std::memory_order_release);
    return true;
  }

 private:
  std::size_t after(std::size_t slot) const { return slot + 1 == slots_.size() ? 0 : slot + 1; }

  std::vector<Blow> slots_;                        // one more than the capacity: a full ring is not an empty one
  alignas(64) std::atomic<std::size_t> begin_{0};  // each on a cache line of its own
  alignas(64) std::atomic<std::size_t> end_{0};
};

}  // namespace limber
