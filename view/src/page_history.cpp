#include "page_history.h"

#include <string>
#include <utility>

#include "limber/core/error.h"

namespace limber::internal {

void write_hands(const Hands& hands, StateWriter& state) {
  state(hands.hand.index, hands.hand.generation, hands.body.index, hands.body.generation, hands.at);
  state(static_cast<std::uint64_t>(hands.pins.size()), hands.joints);
  for (const HandleId pin : hands.pins) state(pin.index, pin.generation);
}

Hands read_hands(StateReader& state) {
  Hands hands;
  state(hands.hand.index, hands.hand.generation, hands.body.index, hands.body.generation, hands.at);
  const auto pins = state.read<std::uint64_t>();
  state(hands.joints);
  for (std::uint64_t i = 0; i < pins; ++i) {
    HandleId pin;
    state(pin.index, pin.generation);
    hands.pins.push_back(pin);
  }
  return hands;
}

void PageHistory::keep(const ScenePlayer& player, const Hands& hands, std::size_t dropped) {
  constexpr std::size_t kMostBytes = 100u << 20;
  while (!keys_.empty() && keys_.back().step >= player.steps_taken()) keys_.pop_back();
  keys_.push_back({.step = player.steps_taken(), .state = {}, .hands = hands, .dropped = dropped});
  player.save_state(keys_.back().state);
  std::size_t bytes = 0;
  for (const Key& key : keys_) bytes += key.state.size();
  if (bytes <= kMostBytes) return;
  std::vector<Key> fewer;  // the first always
  for (std::size_t i = 0; i < keys_.size(); ++i)
    if (i % 2 == 0 || i >= keys_.size() / 2) fewer.push_back(std::move(keys_[i]));
  keys_ = std::move(fewer);
}

const PageHistory::Key& PageHistory::at(int key) const {
  if (key < 0 || key >= size())
    throw InvalidArgument("PageWorld: kept state " + std::to_string(key) + ", expected 0 to " +
                          std::to_string(size() - 1));
  return keys_[static_cast<std::size_t>(key)];
}

}  // namespace limber::internal
