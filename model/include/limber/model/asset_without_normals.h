/// @file limber/model/asset_without_normals.h
/// Assets for who makes normals of its own: half as large with 32 modes or fewer. A glTF viewer shades them flat.
#pragma once

#include <string>

#include "limber/model/asset.h"

namespace limber {

/// As asset_bytes(), but without NORMAL attributes, of meshes and of their targets. read_asset() reads them alike.
/// @throws InvalidArgument as asset_bytes()
std::string asset_bytes_without_normals(const Asset& asset);

}  // namespace limber
