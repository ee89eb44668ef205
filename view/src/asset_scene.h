/// @file asset_scene.h
/// The scene that a page makes of an asset by itself.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "limber/model/asset.h"
#include "limber/view/page_file.h"

namespace limber::internal {

/// Single bodies side by side, free ones fall on the ground from half their height. A machine stands as it was drawn
/// where it is tied to the world, on a ground at its lowest point, and friction in its joints holds it; else it falls.
/// Its file is "asset.glb". @param name of the machine
nlohmann::ordered_json scene_of_asset(const Asset& asset, const std::string& name, UpAxis up);

}  // namespace limber::internal
