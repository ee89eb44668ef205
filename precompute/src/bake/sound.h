/// @file sound.h
/// The modes of a body that one hears.
#pragma once

#include <memory>
#include <span>

#include "bake/bake_body.h"
#include "bake/body_surfaces.h"
#include "limber/model/sound_modes.h"

namespace limber::internal {

/// Before anything is computed. @throws InvalidArgument where neither materials nor options tell how a body's sound
/// decays
void require_losses(const BodyInput& in, std::span<const Material> materials, const BakeOptions& options);

/// @param touching the surface that shapes are told at
std::shared_ptr<const SoundModes> bake_sound(const BodyInput& in, std::span<const Material> materials,
                                             const PlacedSurface& touching, const BakeOptions& options,
                                             SoundReport& report, Warnings& warnings, Jobs& jobs);

}  // namespace limber::internal
