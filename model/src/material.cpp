#include "limber/model/material.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "limber/core/error.h"
#include "limber/internal/material_json.h"
#include "limber/internal/strict_json.h"
#include "text.h"

namespace limber {
namespace {

using internal::shown;

constexpr std::string_view kCallister =
    "Callister and Rethwisch, Materials Science and Engineering, appendix B (density, modulus, Poisson's ratio tables)";
constexpr std::string_view kCallisterMiddle =
    "Callister and Rethwisch, Materials Science and Engineering, appendix B; middle of the range given there";
constexpr std::string_view kWoodHandbook =
    "Wood Handbook, USDA Forest Products Laboratory FPL-GTR-190, chapter 5, at 12 % moisture; isotropic approximation "
    "with "
    "the modulus along the grain: across the grain wood is 10 to 20 times softer";

constexpr std::string_view kCremer =
    "Cremer, Heckl and Petersson, Structure-Borne Sound, table of material properties; middle of the range given there";

// E in Pa, Poisson's ratio, density in kg/m³, loss factor. Ascending by name.
constexpr std::array kPresets = {
    MaterialPreset{"acrylic", {2.74e9, 0.40, 1190.0, 0.03}, kCallisterMiddle, kCremer},
    MaterialPreset{"aluminium", {69e9, 0.33, 2700.0, 0.0001}, kCallister, kCremer},
    MaterialPreset{"balsa", {3.4e9, 0.23, 179.0}, kWoodHandbook},
    MaterialPreset{"bone",
                   {17e9, 0.30, 1900.0},
                   "cortical bone; modulus along the bone from Reilly and Burstein, Journal of Biomechanics 8 (1975), "
                   "Poisson's ratio and density rounded; isotropic approximation: across it 11.5 GPa"},
    MaterialPreset{"brass", {110e9, 0.35, 8530.0, 0.0006}, kCallister, kCremer},
    MaterialPreset{"bronze", {100e9, 0.34, 8930.0}, kCallister},
    MaterialPreset{"cast_iron", {101e9, 0.26, 7300.0}, kCallisterMiddle},
    MaterialPreset{"ceramic",
                   {380e9, 0.22, 3980.0, 0.0001},
                   kCallister,
                   "order of magnitude only, not from a handbook: dense alumina"},
    MaterialPreset{"concrete", {31e9, 0.20, 2400.0, 0.006}, kCallisterMiddle, kCremer},
    MaterialPreset{"copper", {115e9, 0.33, 8890.0, 0.002}, kCallister, kCremer},
    MaterialPreset{"cork",
                   {13e6, 0.05, 170.0, 0.15},
                   "Gibson, Easterling and Ashby, Proceedings of the Royal Society A 377 (1981), across the radial "
                   "direction; isotropic approximation",
                   kCremer},
    MaterialPreset{"foam",
                   {1.5e6, 0.30, 50.0},
                   "Ashby, Materials Selection in Mechanical Design, appendix A, flexible polymer foam of low density; "
                   "rounded middle of the ranges"},
    MaterialPreset{"gelatine",
                   {1e5, 0.49, 1060.0},
                   "ballistic gelatine of 10 %, order of magnitude only, not from a handbook; Poisson's ratio lowered "
                   "from nearly 0.5, where linear tetrahedra lock"},
    MaterialPreset{"glass", {69e9, 0.23, 2500.0, 0.0013}, kCallister, kCremer},
    MaterialPreset{"gold", {77e9, 0.42, 19320.0, 0.0003}, kCallister, kCremer},
    MaterialPreset{"ice",
                   {9.33e9, 0.325, 917.0, 0.0016},
                   "Gammon, Kiefte, Clouter and Denner, Journal of Glaciology 29 (1983), polycrystalline at -16 C",
                   "1/Q of cold polar ice at 90 m depth, Agnew and others, Journal of Glaciology (2023); near melting "
                   "a hundred times more"},
    MaterialPreset{
        "jelly",
        {5e3, 0.49, 1030.0},
        "dessert gel, order of magnitude only, not from a handbook; Poisson's ratio lowered from nearly 0.5, "
        "where linear tetrahedra lock"},
    MaterialPreset{"nylon", {2.69e9, 0.39, 1140.0}, kCallisterMiddle},
    MaterialPreset{"oak", {12.5e9, 0.35, 706.0, 0.009}, kWoodHandbook, kCremer},
    MaterialPreset{"polycarbonate", {2.38e9, 0.36, 1200.0}, kCallister},
    MaterialPreset{"rubber",
                   {2e6, 0.49, 925.0, 0.06},
                   "Ashby, Materials Selection in Mechanical Design, appendix A, natural rubber, middle of the ranges; "
                   "Poisson's ratio lowered from 0.4999, where linear tetrahedra lock",
                   "Gent, Engineering with Rubber: unfilled natural rubber at 1 to 10 Hz, middle of the range"},
    MaterialPreset{
        "silicone",
        {2e6, 0.49, 1030.0},
        "Sylgard 184: modulus within the 1.32 to 2.97 MPa that Johnston and others measured after cures at 25 to "
        "200 C, Journal of Micromechanics and Microengineering 24 (2014); density from the maker's data sheet; "
        "Poisson's ratio lowered from nearly 0.5, where linear tetrahedra lock"},
    MaterialPreset{"silver", {74e9, 0.37, 10490.0, 0.0004}, kCallister, kCremer},
    MaterialPreset{"spruce", {10.8e9, 0.37, 448.0, 0.008}, kWoodHandbook, kCremer},
    MaterialPreset{"steel", {207e9, 0.30, 7850.0, 0.00016}, kCallister, kCremer},
    MaterialPreset{"titanium", {114e9, 0.34, 4430.0}, kCallister},
    MaterialPreset{"wood", {13.4e9, 0.29, 538.0, 0.008}, kWoodHandbook, kCremer},
};

std::vector<std::string> preset_names() {
  std::vector<std::string> names;
  names.reserve(std::size(kPresets));
  for (const MaterialPreset& p : kPresets) names.emplace_back(p.name);
  return names;
}

}  // namespace

void Material::validate(const std::string& where) const {
  const auto refuse = [&](const std::string& field, double value, const std::string& unit,
                          const std::string& expected) {
    throw InvalidArgument(where + ": " + field + " is " + shown(value) + unit + ", expected " + expected);
  };
  if (!(std::isfinite(youngs_modulus) && youngs_modulus > 0.0))
    refuse("youngs_modulus", youngs_modulus, " Pa", "above 0 and finite");
  if (!(poisson_ratio > -1.0 && poisson_ratio < 0.5))
    refuse("poisson_ratio", poisson_ratio, "", "above -1 and below 0.5 (0.49 for rubber-like materials)");
  if (!(std::isfinite(density) && density > 0.0)) refuse("density", density, " kg/m^3", "above 0 and finite");
}

std::span<const MaterialPreset> material_presets() { return kPresets; }

const Material& material_preset(std::string_view name) {
  const auto found = std::find_if(kPresets.begin(), kPresets.end(), [&](const auto& p) { return p.name == name; });
  if (found != kPresets.end()) return found->material;
  throw InvalidArgument("there is no material preset " + internal::in_quotes(name) + "; did you mean \"" +
                        internal::nearest_word(name, preset_names()) + "\"?");
}

Material internal::read_material(const nlohmann::json& value, const std::string& where) {
  try {
    if (value.is_string()) return material_preset(value.get<std::string>());
    if (!value.is_object())
      throw InputError(where + ": is " + internal::JsonObject::shown(value) +
                       ", expected an object { … } or a preset's name");
    const internal::JsonObject object(value, where);
    const Material material{.youngs_modulus = object.number("youngs_modulus"),
                            .poisson_ratio = object.number("poisson_ratio"),
                            .density = object.number("density"),
                            .loss_factor = object.has("loss_factor") ? object.number("loss_factor") : 0.0};
    object.finish();
    material.validate(where);
    return material;
  } catch (const InvalidArgument& e) {
    const std::string what = e.what();
    throw InputError(what.starts_with(where) ? what : where + ": " + what);
  }
}

MaterialTable read_materials(const std::filesystem::path& path) {
  const nlohmann::json document = internal::read_json(path);
  const internal::JsonObject object(document, "\"" + path.string() + "\"");
  MaterialTable table;
  object.for_each_member([&](const std::string& region, const nlohmann::json& value) {
    table.emplace(region, internal::read_material(value, object.where() + " region " + internal::in_quotes(region)));
  });
  if (table.empty()) throw InputError(object.where() + ": names no region, expected at least one, or \"*\" for all");
  return table;
}

}  // namespace limber
