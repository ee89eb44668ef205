/// @file jointed_blocks.h
/// An asset of three blocks with joints, made without a file.
#pragma once

#include "block_model.h"

namespace limber::testing {

inline std::shared_ptr<const ModalModel> block_at(const char* name, const Vec3& place) {
  ModalModelData data = block_data(2, name);
  data.origin_in_input = place;
  return std::make_shared<const ModalModel>(std::move(data));
}

/// Two blocks end to end, hinged where they meet, the first one tied to the world by a ball; a third one overlaps the
/// second.
inline Asset jointed_blocks() {
  constexpr double kL = kBlockLength;
  Asset asset{.bodies = {block_at("upper", {0, 0, 0}), block_at("lower", {kL, 0, 0}), block_at("loose", {kL, 0, 0.5})}};
  Mat3 about_y;
  about_y << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  asset.joints.push_back(
      {.b = 0, .spec = {.type = JointType::kBall, .frame = {.origin = {-0.5 * kL, 0, 0}}}, .patch_radius = 0.8});
  asset.joints.push_back({.a = 0,
                          .b = 1,
                          .spec = {.type = JointType::kRevolute,
                                   .frame = {.origin = {0.5 * kL, 0, 0}, .axes = about_y},
                                   .limits = {.rotation = {-0.4, 0.3}}},
                          .patch_radius = 0.8,
                          .coordinates = {{.friction = 0.2}}});
  asset.apart.push_back({1, 2});
  return asset;
}

}  // namespace limber::testing
