/// @file live_tracks.h
/// Motion of a live scene's bodies, key by key.
#pragma once

#include <memory>
#include <span>

#include "limber/scene/run.h"
#include "limber/view/live_scene.h"

namespace limber::internal {

/// Adds a key, whose time is there, to the track of each body. A new body was at its place in all keys of before; one
/// that is gone stays at its last.
void record_key(const World& world, std::span<const LiveScene::Body> bodies,
                std::span<const std::shared_ptr<const ModalModel>> kinds, Trajectory& recorded);

}  // namespace limber::internal
