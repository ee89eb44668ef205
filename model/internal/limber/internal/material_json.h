/// @file limber/internal/material_json.h
/// A material as JSON. Private to limber's own sources.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "limber/model/material.h"

namespace limber::internal {

/// {"youngs_modulus": Pa, "poisson_ratio": ν, "density": kg/m³} or a preset's name. @param where the place for messages
/// @throws InputError
Material read_material(const nlohmann::json& value, const std::string& where);

}  // namespace limber::internal
