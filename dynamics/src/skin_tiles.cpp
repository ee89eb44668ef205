#include "limber/dynamics/skin_tiles.h"

#include <algorithm>
#include <map>

#include "reconstruct_kernels.h"

namespace limber {
namespace {

using TileWeights = std::map<std::uint8_t, std::array<float, internal::kTileVertices>>;

TileWeights weights_of(std::span<const SkinInfluences> tile) {
  TileWeights by_handle;
  for (std::size_t v = 0; v < tile.size(); ++v)
    for (std::size_t i = 0; i < SkinInfluences::kMost; ++i)
      if (tile[v].weight[i] > 0.0f) by_handle[tile[v].handle[i]][v] += tile[v].weight[i];
  return by_handle;
}

}  // namespace

SkinTiles::SkinTiles(std::span<const SkinInfluences> vertices) : vertices_(static_cast<Index>(vertices.size())) {
  std::vector<float> weights;
  for (std::size_t first = 0; first < vertices.size(); first += internal::kTileVertices) {
    starts_.push_back(static_cast<std::uint32_t>(handle_.size()));
    const std::size_t count = std::min(internal::kTileVertices, vertices.size() - first);
    for (const auto& [handle, shares] : weights_of(vertices.subspan(first, count))) {
      handle_.push_back(handle);
      handles_ = std::max(handles_, Index{handle} + 1);
      weights.insert(weights.end(), shares.begin(), shares.end());
    }
  }
  starts_.push_back(static_cast<std::uint32_t>(handle_.size()));
  weights_ = AlignedArray<float>(weights.size());
  std::copy(weights.begin(), weights.end(), weights_.data());
}

}  // namespace limber
