/// @file page_tracks.h
/// Motion of the page's bodies, key by key.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "description.h"
#include "limber/scene/run.h"

namespace limber::internal {

/// Adds a key to the track of each body; one that is not there repeats its last one. Keys come from the last to the
/// first, so that the first call has all bodies.
void record_key(const World& world, std::span<const PageBody> bodies,
                std::span<const std::shared_ptr<const ModalModel>> kinds, std::vector<BodyTrack>& tracks);

/// The last key becomes the first.
void turn_round(BodyTrack& track);

}  // namespace limber::internal
