// The `machine` block of an asset's file: joints between its bodies, and pairs without contacts.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "limber/model/asset.h"

namespace limber::internal {

/// @pre checked. Joints and pairs of `asset` alone are read.
nlohmann::json machine_block(const Asset& asset);

/// Fills joints and pairs of `asset`, whose bodies are not read. @param bodies how many there are. @throws InputError
void read_machine(const nlohmann::json& block, const std::string& where, Index bodies, Asset& asset);

}  // namespace limber::internal
