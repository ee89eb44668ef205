/// @file page_history.h
/// States of the page's world that one can go back to.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "limber/core/state_archive.h"
#include "limber/engine/world.h"
#include "limber/scene/scene_player.h"
#include "page_joints.h"

namespace limber::internal {

/// What a person holds.
struct Hands {
  HandleId hand{};
  BodyId body{};
  SurfacePoint at{};
  std::vector<HandleId> pins{};
  JointWishes joints{};
};

/// As bytes for worlds with the same bodies (limber/core/state_archive.h), and back.
void write_hands(const Hands& hands, StateWriter& state);
Hands read_hands(StateReader& state);

class PageHistory {
 public:
  struct Key {
    std::int64_t step = 0;
    std::vector<std::byte> state{};
    Hands hands{};
    std::size_t dropped = 0;  ///< bodies
  };

  void clear() { keys_.clear(); }
  /// Keys of this step and later ones are those of another future: they go. Where all take more than a hundred
  /// megabytes, every second of the older half goes.
  void keep(const ScenePlayer& player, const Hands& hands, std::size_t dropped);
  int size() const { return static_cast<int>(keys_.size()); }
  /// @throws InvalidArgument for a key that there is not
  const Key& at(int key) const;

 private:
  std::vector<Key> keys_;  // by step
};

}  // namespace limber::internal
