/// @file limber/model/asset.h
/// The asset file: a GLB that any glTF 2.0 viewer opens, with modes as morph targets, and an extension block with what
/// the runtime needs. Reader and writer live together; docs/formats/asset.md describes the file byte by byte.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "limber/model/modal_model.h"

namespace limber {

/// One or more bodies baked from one input.
struct Asset {
  std::vector<std::shared_ptr<const ModalModel>> bodies{};
  Provenance provenance{};
};

/// The file's bytes. Equal assets give equal bytes, and asset_bytes(asset_from_bytes(b, …)) = b for bytes b of this
/// version.
/// @throws InvalidArgument if there is no body, a name repeats or is not UTF-8, a body has more modes than viewers take
/// (kMaxMorphTargets), or the file would have more than 4 GiB
std::string asset_bytes(const Asset& asset);

/// Writes whole or not at all. @throws InputError (disk), InvalidArgument
void write_asset(const std::filesystem::path& path, const Asset& asset);

/// An asset from bytes in memory. @param name shown in messages, such as `"bell.glb"` with its quotes
/// Trusts nothing: every count, offset, index and number is checked before use, and the content hash must match (a file
/// that another tool rewrote is a picture of the asset, no longer the asset). @throws InputError
Asset asset_from_bytes(std::string_view bytes, const std::string& name);

/// The same from a file. @throws InputError
Asset read_asset(const std::filesystem::path& path);

}  // namespace limber
