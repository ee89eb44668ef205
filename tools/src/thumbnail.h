/// @file thumbnail.h
/// A small picture of an asset's first mode.
#pragma once

#include <string>

#include "limber/model/asset.h"

namespace limber::tools {

/// Bytes of a PNG: the bodies where they stood in the input, seen from above at an angle, each bent by its first mode
/// to a tenth of its size, brighter where it moves more. @param width, height in pixels, ≥ 1
std::string thumbnail(const Asset& asset, int width, int height);

}  // namespace limber::tools
