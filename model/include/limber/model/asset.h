/// @file limber/model/asset.h
/// The asset file: a GLB that any glTF 2.0 viewer opens, with modes as morph targets, and an extension block with what the
/// runtime needs. Reader and writer live together; docs/formats/asset.md describes the file byte by byte.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "limber/model/modal_model.h"

namespace limber {

/// One or more bodies baked from one input.
struct Asset {
  std::vector<std::shared_ptr<const ModalModel>> bodies;
  Provenance provenance;
};

/// The file's bytes. Equal assets give equal bytes. @throws InvalidArgument if there is no body or a name repeats
std::string asset_bytes(const Asset& asset);

/// Writes whole or not at all. @throws InputError (disk), InvalidArgument
void write_asset(const std::filesystem::path& path, const Asset& asset);

/// Trusts nothing: every count, offset, index and number is checked before use, and the content hash must match (a file
/// that another tool rewrote is a picture of the asset, no longer the asset). @throws InputError
Asset read_asset(const std::filesystem::path& path);

}  // namespace limber
