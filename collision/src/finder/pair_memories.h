// The memories of pairs that are near each other, from query to query.
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <vector>

#include "limber/collision/broad_phase.h"
#include "narrow/pair_memory.h"

namespace limber::internal {

class PairMemories {
 public:
  /// Bodies of so many modes may come.
  void reserve(Index modes) {
    modes_ = std::max(modes_, static_cast<std::size_t>(modes));
    for (const auto& memory : all_) memory->reserve(modes_);
  }

  /// Those of the pairs of a query, ascending; others are near no more. @param wants (const BodyPair&) → bool: whether
  /// a pair that is new is to have one
  template <class Wants>
  void match(std::span<const BodyPair> pairs, const Wants& wants) {
    next_.clear();
    next_.reserve(all_.size());
    of_pair_.clear();
    auto known = known_.begin();
    const auto pass = [&](const BodyPair* before) {
      for (; known != known_.end() && (before == nullptr || known->pair < *before); ++known) give_back(known->memory);
    };
    for (const BodyPair& pair : pairs) {
      pass(&pair);
      const bool is_known = known != known_.end() && known->pair == pair;
      PairMemory* memory = is_known ? (known++)->memory : wants(pair) ? take() : nullptr;
      if (memory != nullptr) next_.push_back({pair, memory});
      of_pair_.push_back(memory);
    }
    pass(nullptr);
    known_.swap(next_);
  }
  /// Null: none is kept. @param pair its place in the last match()
  PairMemory* of(std::size_t pair) const { return of_pair_[pair]; }

  void forget(Index body) {
    std::erase_if(known_, [&](const Slot& slot) {
      if (slot.pair.a != body && slot.pair.b != body) return false;
      give_back(slot.memory);
      return true;
    });
  }

 private:
  struct Slot {
    BodyPair pair;
    PairMemory* memory;
  };
  PairMemory* take() {
    if (free_.empty()) {
      for (std::size_t more = 1 + all_.size() / 4; more > 0; --more) {  // a few to spare
        all_.push_back(std::make_unique<PairMemory>(*room_));
        all_.back()->reserve(modes_);
        free_.push_back(all_.back().get());
      }
      free_.reserve(all_.capacity());
    }
    PairMemory* memory = free_.back();
    free_.pop_back();
    return memory;
  }
  void give_back(PairMemory* memory) {
    memory->forget();
    free_.push_back(memory);
  }

  std::unique_ptr<TestRoom> room_ = std::make_unique<TestRoom>();
  std::size_t modes_ = 0;
  std::vector<std::unique_ptr<PairMemory>> all_;
  std::vector<PairMemory*> free_, of_pair_;
  std::vector<Slot> known_, next_;  // ascending
};

}  // namespace limber::internal
