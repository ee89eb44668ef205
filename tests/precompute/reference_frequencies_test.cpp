/// Five meshes whose frequencies three other programs agree on: tests/data/reference-modal.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "folders.h"
#include "limber/precompute/modal_analysis.h"
#include "mesh_files.h"

namespace limber {
namespace {

const std::filesystem::path kFolder = std::filesystem::path(LIMBER_SOURCE_DIR) / "tests/data/reference-modal";
constexpr double kAgreement = 1e-6;  // what the programs agree on among themselves, relative

struct Summary {
  int zero_modes = 0;
  double mass = 0.0, volume = 0.0;
  std::vector<double> frequencies;  // of all bodies, ascending, Hz
};

std::vector<Material> materials_of(const nlohmann::json& reference, const TetMesh& mesh) {
  std::vector<Material> materials;
  for (const Region& region : mesh.regions)
    for (const auto& m : reference["materials"])
      if (m["region"] == "*" || m["region"] == region.name || (m.contains("tag") && m["tag"] == region.tag)) {
        materials.push_back({.youngs_modulus = m["E"], .poisson_ratio = m["nu"], .density = m["rho"]});
        break;
      }
  return materials;
}

Summary analyse_bodies(const TetMesh& mesh, std::span<const Material> materials, const std::vector<Index>& fixed,
                       MassKind mass) {
  Summary all;
  const auto component = connected_components(mesh);
  for (Index body = 0; body <= *std::max_element(component.begin(), component.end()); ++body) {
    const SubMesh part = extract_component(mesh, component, body);
    std::vector<Index> held;
    for (std::size_t i = 0; i < part.node_of.size(); ++i)
      if (std::binary_search(fixed.begin(), fixed.end(), part.node_of[i])) held.push_back(static_cast<Index>(i));
    Warnings warnings;
    const auto found = analyse_modes(part.mesh, materials, held, {.modes = 30, .mass = mass}, warnings);
    EXPECT_TRUE(found.accuracy.certified);
    EXPECT_LT(found.accuracy.orthogonality_max, 1e-9);
    EXPECT_LE(found.accuracy.residual_max, found.accuracy.residual_bound);
    EXPECT_LT(found.accuracy.backward_error_max, 1e-12);
    all.zero_modes += found.freedom.rigid_modes + found.freedom.mechanisms;
    all.volume += volume_properties(part.mesh).volume;
    for (const double m : assemble_mass(part.mesh, materials, mass).value) all.mass += m;
    for (const double lambda : found.eigenvalues) all.frequencies.push_back(std::sqrt(lambda) / (2 * std::numbers::pi));
  }
  std::sort(all.frequencies.begin(), all.frequencies.end());
  return all;
}

class ReferenceFrequencies : public ::testing::TestWithParam<const char*> {};

TEST_P(ReferenceFrequencies, AreThoseOfThreeOtherPrograms) {
  std::ifstream file(kFolder / (std::string(GetParam()) + ".json"));
  ASSERT_TRUE(file) << kFolder;
  const auto reference = nlohmann::json::parse(file);
  Warnings warnings;
  const TetMesh mesh = testing::read_tets(kFolder / reference["mesh"].get<std::string>(), warnings);
  const auto materials = materials_of(reference, mesh);
  ASSERT_EQ(materials.size(), mesh.regions.size());
  std::vector<Index> fixed;
  if (!reference["fixed"].is_null()) fixed = reference["fixed"]["nodes_index0"].get<std::vector<Index>>();
  for (const auto& [kind, key] :
       {std::pair(MassKind::kConsistent, "freqs_hz"), {MassKind::kLumped, "freqs_hz_lumped"}}) {
    const Summary found = analyse_bodies(mesh, materials, fixed, kind);
    EXPECT_EQ(found.zero_modes, reference["zero_modes"]);
    EXPECT_NEAR(found.mass, reference["total_mass"], 1e-12 * found.mass);
    EXPECT_NEAR(found.volume, reference["total_volume"], 1e-12 * found.volume);
    const auto frequencies = reference[key].get<std::vector<double>>();
    ASSERT_LE(frequencies.size(), found.frequencies.size());
    double worst = 0.0;
    for (std::size_t i = 0; i < frequencies.size(); ++i)
      worst = std::max(worst, std::abs(found.frequencies[i] / frequencies[i] - 1.0));
    EXPECT_LT(worst, kAgreement) << key;
    RecordProperty(key, std::to_string(worst * 1e12) + "e-12 relative, the worst");
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, ReferenceFrequencies,
                         ::testing::Values("bar_cantilever", "composite_medit", "pinned_node", "small_300",
                                           "two_bodies"),
                         [](const auto& parameter) { return std::string(parameter.param); });

}  // namespace
}  // namespace limber
