/// @file limber/model/material.h
/// Isotropic linear elastic materials, by numbers or by name.
#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>

#include "limber/core/types.h"

namespace limber {

struct Material {
  double youngs_modulus = 0.0;  ///< E, Pa; > 0
  double poisson_ratio = 0.0;   ///< ν; in (−1, 0.5)
  double density = 0.0;         ///< ρ, kg/m³; > 0
  /// η of sound, 0 to 1: of its elastic energy a vibration loses 2πη a period, so a mode decays by ξ = ηω/2. 0: not
  /// known.
  double loss_factor = 0.0;

  double lame_lambda() const {
    return youngs_modulus * poisson_ratio / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio));
  }
  double shear_modulus() const { return youngs_modulus / (2.0 * (1.0 + poisson_ratio)); }

  /// @param where the place for the message, such as `region "legs"`.
  /// @throws InvalidArgument naming the field and its value
  void validate(const std::string& where) const;
};

/// A material known by name, with where its numbers come from.
struct MaterialPreset {
  std::string_view name;
  Material material;
  std::string_view source;
  std::string_view loss_source{};  ///< of loss_factor; empty where that is not known
};

/// All presets, by name: steel, aluminium, wood, rubber, jelly, glass, ….
std::span<const MaterialPreset> material_presets();

/// @throws InvalidArgument naming the nearest preset if there is none of that name
const Material& material_preset(std::string_view name);

/// Materials by region name (or integer tag or reference as text); the key "*" is for every region not named.
using MaterialTable = std::map<std::string, Material>;

/// Reads `{"region": {"youngs_modulus": Pa, "poisson_ratio": ν, "density": kg/m³, "loss_factor": η}` (the last may be
/// absent), or `"preset name"`, …}.
/// @throws InputError
MaterialTable read_materials(const std::filesystem::path& path);

}  // namespace limber
