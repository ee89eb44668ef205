/// @file packed_asset.h
/// Assets as a page holds them: small.
#pragma once

#include <string>
#include <string_view>

#include "limber/model/asset.h"

namespace limber::internal {

/// What a page makes use of: shapes of the drawn surfaces are rounded to 16 bits, of the largest component of each
/// mode; so are the places of their vertices where another surface touches. Modal skins go, and volumes unless
/// they are asked for.
Asset asset_for_a_page(const Asset& asset, bool volumes = false);

/// The bytes of a GLB in another order, in which they compress well; view/web/unpack.js has the way back. Numbers are
/// little-endian: "LMBP", how many segments (uint32), of each its kind, its bytes in the GLB (uint32) and an exponent
/// (int32); then the segments, one after the other.
///   kind 0   as they are
///   kind 1   words of 32 bits, each less the third before it, lowest bytes of all first, then the next
///   kind 2   floats q·2^exponent, q of 16 bits, the same of these
std::string packed(std::string_view glb);

}  // namespace limber::internal
