#include "manifold/contact_graph.h"

namespace limber::internal {

void ContactGraph::match(std::span<const BodyPair> pairs) {
  next_.clear();
  matched_.clear();
  auto known = known_.begin();
  const auto pass = [&](const BodyPair* before) {
    for (; known != known_.end() && (before == nullptr || known->pair < *before); ++known) give_back(known->slot);
  };
  for (const BodyPair& pair : pairs) {
    pass(&pair);
    const bool is_known = known != known_.end() && known->pair == pair;
    next_.push_back({pair, is_known ? (known++)->slot : take()});
    matched_.push_back(next_.back().slot);
  }
  pass(nullptr);
  known_.swap(next_);
}

void ContactGraph::forget(Index body) {
  std::erase_if(known_, [&](const Entry& entry) {
    if (entry.pair.a != body && entry.pair.b != body) return false;
    give_back(entry.slot);
    return true;
  });
}

void ContactGraph::forget_all() {
  for (const Entry& entry : known_) give_back(entry.slot);
  known_.clear();
  matched_.clear();
}

LivePair& ContactGraph::append(const BodyPair& pair) {
  known_.push_back({pair, take()});
  return slots_[known_.back().slot];
}

std::uint32_t ContactGraph::take() {
  if (free_.empty()) {
    const std::size_t more = 8 + slots_.size() / 4;  // a few to spare
    for (std::size_t i = 0; i < more; ++i) free_.push_back(static_cast<std::uint32_t>(slots_.size() + more - 1 - i));
    slots_.resize(slots_.size() + more);
    free_.reserve(slots_.size());
  }
  const std::uint32_t slot = free_.back();
  free_.pop_back();
  return slot;
}

void ContactGraph::give_back(std::uint32_t slot) {
  slots_[slot].known = false;
  slots_[slot].apart = 0.0;
  slots_[slot].parting = Vec3::Zero();
  room_->give_back(slots_[slot].points);
  free_.push_back(slot);
}

}  // namespace limber::internal
