/// @file limber/model/pose_keys.h
/// Poses as the keys of a GLB animation (glb.h), and colours that tell parts apart.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "limber/core/rigid_transform.h"

namespace limber {

/// Colours of parts, in turn: linear RGBA.
inline constexpr std::array<std::array<float, 4>, 6> kPartColors{{{0.60f, 0.60f, 0.58f, 1.0f},
                                                                  {0.25f, 0.42f, 0.60f, 1.0f},
                                                                  {0.62f, 0.50f, 0.30f, 1.0f},
                                                                  {0.36f, 0.52f, 0.34f, 1.0f},
                                                                  {0.46f, 0.36f, 0.56f, 1.0f},
                                                                  {0.58f, 0.34f, 0.32f, 1.0f}}};

/// Three numbers a key, m. @param metres_per_unit of the poses' lengths
std::vector<float> translation_keys(std::span<const RigidTransform> poses, double metres_per_unit = 1.0);

/// x, y, z, w of each key. q and −q are one attitude; neighbours take the signs between which linear interpolation goes
/// the short way.
std::vector<float> rotation_keys(std::span<const RigidTransform> poses);

}  // namespace limber
