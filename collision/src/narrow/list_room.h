// Room for lists that come and go.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <mutex>
#include <utility>
#include <vector>

namespace limber::internal {

// By powers of two from kLeast on: what one pair gives back another takes, so that a warm query allocates nothing.
template <class T, std::size_t kLeast>
class ListRoom {
 public:
  // Exchanges a list for one that holds so many, empty. A larger one will do; where there is none, some are made at
  // once, as a query more or less crowded is no other scene.
  void exchange(std::vector<T>& list, std::size_t size) {
    give_back(list);
    const std::lock_guard lock(mutex_);
    std::size_t from = shelf(size);
    while (from < free_.size() && free_[from].empty()) ++from;
    if (from == free_.size()) from = make_some(shelf(size));
    list.swap(free_[from].back());
    free_[from].pop_back();
    list.clear();
  }
  // Leaves a list that holds none.
  void give_back(std::vector<T>& list) {
    const std::lock_guard lock(mutex_);
    if (list.capacity() > 0) put_back(shelf(list.capacity()), std::move(list));
    list = {};
  }

 private:
  static std::size_t shelf(std::size_t holds) {
    return static_cast<std::size_t>(std::bit_width(std::max(holds, kLeast) - 1));
  }
  std::size_t make_some(std::size_t at) {
    const std::size_t more = 1 + made_[at] / 4;
    made_[at] += more;
    for (std::size_t i = 0; i < more; ++i) {
      std::vector<T> fresh;
      fresh.reserve(std::size_t{1} << at);
      put_back(at, std::move(fresh));
    }
    free_[at].reserve(made_[at]);
    return at;
  }
  void put_back(std::size_t at, std::vector<T>&& list) { free_[at].push_back(std::move(list)); }

  std::mutex mutex_;
  std::array<std::vector<std::vector<T>>, 33> free_;  // by the logarithm of what they hold, rounded up
  std::array<std::size_t, 33> made_{};
};

}  // namespace limber::internal
