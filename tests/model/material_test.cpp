#include "limber/model/material.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>

#include "constants.h"
#include "folders.h"
#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

using testing::kFewRoundings;

template <class E>
std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const E& e) {
    return e.what();
  }
  return "accepted";
}

TEST(Material, LameConstantsAreThoseOfElasticityTheory) {
  // Uniaxial stress σ gives strains ε = σ/E along it and −νε across: both must follow from λ and μ.
  const Material m{.youngs_modulus = 7e10, .poisson_ratio = 0.33, .density = 2700.0};
  const double along = 1e-3, across = -0.33e-3, trace = along + 2.0 * across;
  const double stress = m.lame_lambda() * trace + 2.0 * m.shear_modulus() * along;
  EXPECT_NEAR(stress, 7e10 * along, kFewRoundings * 7e10);
  EXPECT_NEAR(m.lame_lambda() * trace + 2.0 * m.shear_modulus() * across, 0.0, kFewRoundings * 7e10);
}

TEST(Material, ValidatingNamesPlaceFieldAndValue) {
  const auto said = [](const Material& m) {
    return message_of<InvalidArgument>([&] { m.validate("region \"legs\""); });
  };
  EXPECT_EQ(said({1e9, 0.3, 1000.0}), "accepted");
  EXPECT_EQ(said({1e9, -0.99, 1000.0}), "accepted");
  EXPECT_THAT(said({0.0, 0.3, 1000.0}), HasSubstr("region \"legs\": youngs_modulus is 0 Pa, expected above 0"));
  EXPECT_THAT(said({INFINITY, 0.3, 1000.0}), HasSubstr("youngs_modulus is inf Pa"));
  EXPECT_THAT(said({1e9, 0.5, 1000.0}), HasSubstr("poisson_ratio is 0.5, expected above -1 and below 0.5"));
  EXPECT_THAT(said({1e9, -1.0, 1000.0}), HasSubstr("poisson_ratio is -1"));
  EXPECT_THAT(said({1e9, NAN, 1000.0}), HasSubstr("poisson_ratio is nan"));
  EXPECT_THAT(said({1e9, 0.3, -5.0}), HasSubstr("density is -5 kg/m^3"));
}

TEST(Material, EveryPresetIsValidNamedOnceAndHasASource) {
  const auto presets = material_presets();
  for (const MaterialPreset& p : presets) {
    EXPECT_EQ(p.material.loss_factor > 0.0, !p.loss_source.empty()) << p.name;
    EXPECT_EQ(message_of<InvalidArgument>([&] { p.material.validate(std::string(p.name)); }), "accepted");
    EXPECT_GT(p.source.size(), 20u) << p.name;
    EXPECT_EQ(material_preset(p.name).youngs_modulus, p.material.youngs_modulus);
  }
  EXPECT_TRUE(
      std::is_sorted(presets.begin(), presets.end(), [](const auto& a, const auto& b) { return a.name < b.name; }));
  EXPECT_EQ(
      std::adjacent_find(presets.begin(), presets.end(), [](const auto& a, const auto& b) { return a.name == b.name; }),
      presets.end());
}

TEST(Material, PresetsCarrySoundAtTheSpeedsOfAnotherHandbook) {
  // Longitudinal speed in a thin bar, √(E/ρ), m/s: Kinsler and others, Fundamentals of Acoustics, table of solids.
  const double kHandbooksDiffer = 0.03;
  for (const auto& [name, speed] : {std::pair{"aluminium", 5150.0},
                                    {"brass", 3500.0},
                                    {"cast_iron", 3700.0},
                                    {"copper", 3700.0},
                                    {"glass", 5200.0},
                                    {"silver", 2700.0},
                                    {"steel", 5050.0}}) {
    const Material& m = material_preset(name);
    EXPECT_NEAR(std::sqrt(m.youngs_modulus / m.density), speed, kHandbooksDiffer * speed) << name;
  }
}

TEST(Material, TheManualHasThePresetsAsTheyAre) {
  const std::string manual = read_file(LIMBER_SOURCE_DIR "/docs/formats/materials.md");
  std::size_t rows = 0;
  for (const MaterialPreset& p : material_presets()) {
    const std::string row = "| `" + std::string(p.name) + "` |";
    const std::size_t at = manual.find(row);
    ASSERT_NE(at, std::string::npos) << p.name;
    double e = 0.0, nu = 0.0, rho = 0.0;
    ASSERT_EQ(std::sscanf(manual.c_str() + at + row.size(), " %lf | %lf | %lf |", &e, &nu, &rho), 3) << p.name;
    EXPECT_EQ(e, p.material.youngs_modulus) << p.name;
    EXPECT_EQ(nu, p.material.poisson_ratio) << p.name;
    EXPECT_EQ(rho, p.material.density) << p.name;
    if (p.material.loss_factor == 0.0) continue;
    const std::string loss_of = "`" + std::string(p.name) + "` ";
    const std::size_t loss_at = manual.find(loss_of, manual.find("Loss factors of sound:"));
    double loss = 0.0;
    ASSERT_NE(loss_at, std::string::npos) << p.name;
    ASSERT_EQ(std::sscanf(manual.c_str() + loss_at + loss_of.size(), "%lf", &loss), 1) << p.name;
    EXPECT_EQ(loss, p.material.loss_factor) << p.name;
  }
  for (std::size_t at = 0; (at = manual.find("\n| `", at)) != std::string::npos; ++at) ++rows;
  EXPECT_EQ(rows, material_presets().size() + 4) << "four more rows describe the keys of the file";
}

TEST(Material, UnknownPresetSuggestsTheNearest) {
  EXPECT_THAT(message_of<InvalidArgument>([] { material_preset("aluminum"); }),
              HasSubstr("did you mean \"aluminium\"?"));
  EXPECT_THAT(message_of<InvalidArgument>([] { material_preset("stele"); }), HasSubstr("did you mean \"steel\"?"));
  EXPECT_THAT(message_of<InvalidArgument>([] { material_preset("bad\nname"); }), Not(HasSubstr("\n")));
}

class ReadMaterials : public ::testing::Test {
 protected:
  ~ReadMaterials() override { std::filesystem::remove(path); }
  MaterialTable table(const std::string& text) {
    write_file(path, text);
    return read_materials(path);
  }
  std::string error(const std::string& text) {
    return message_of<InputError>([&] { table(text); });
  }
  const std::filesystem::path path =
      std::filesystem::path(::testing::TempDir()) /
      ("limber_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + ".json");
};

TEST_F(ReadMaterials, NumbersAndPresetsByRegion) {
  const MaterialTable t = table(R"({
    "legs": {"youngs_modulus": 1e7, "poisson_ratio": 0.4, "density": 1100},
    "12": "steel",
    "*": "jelly"
  })");
  ASSERT_EQ(t.size(), 3u);
  EXPECT_EQ(t.at("legs").youngs_modulus, 1e7);
  EXPECT_EQ(t.at("legs").poisson_ratio, 0.4);
  EXPECT_EQ(t.at("legs").density, 1100.0);
  EXPECT_EQ(t.at("12").density, material_preset("steel").density);
  EXPECT_EQ(t.at("*").density, material_preset("jelly").density);
}

TEST_F(ReadMaterials, MistakesNameFileRegionAndField) {
  const std::string where = path.string() + "\" region \"legs\"";
  EXPECT_THAT(error(R"({"legs": {"youngs_modulus": 1e7, "poisson_ratio": 0.4}})"),
              AllOf(HasSubstr(where), HasSubstr("\"density\" is missing")));
  EXPECT_THAT(error(R"({"legs": {"youngs_modulus": -1, "poisson_ratio": 0.4, "density": 1}})"),
              AllOf(HasSubstr(where), HasSubstr("youngs_modulus is -1 Pa")));
  EXPECT_THAT(error(R"({"legs": {"youngs_modulus": "1e7", "poisson_ratio": 0.4, "density": 1}})"),
              HasSubstr("youngs_modulus: is \"1e7\", expected a finite number"));
  EXPECT_THAT(error(R"({"legs": {"youngs_modulus": 1e7, "poisons_ratio": 0.4, "density": 1}})"),
              HasSubstr("\"poisson_ratio\" is missing"));
  EXPECT_THAT(error(R"({"legs": {"youngs_modulus": 1e7, "poisson_ratio": 0.4, "density": 1, "colour": 2}})"),
              HasSubstr("\"colour\" is unknown"));
  EXPECT_THAT(error(R"({"legs": "steal"})"), AllOf(HasSubstr(where), HasSubstr("did you mean \"steel\"?")));
  EXPECT_THAT(error(R"({"legs": 7})"), HasSubstr("is 7, expected an object { … } or a preset's name"));
  EXPECT_THAT(error(R"({"legs": "steel", "legs": "wood"})"), HasSubstr("\"legs\" stands twice"));
  EXPECT_THAT(error(R"({"a": {"density": 1, "density": 2}})"), HasSubstr("\"density\" stands twice"));
  EXPECT_THAT(error("{}"), HasSubstr("names no region"));
  EXPECT_THAT(error("[]"), HasSubstr("expected an object"));
  EXPECT_THAT(error("{\"legs\": "), HasSubstr("not valid JSON"));
  EXPECT_THAT(error("{\"legs\": \"steel\"} x"), HasSubstr("not valid JSON"));
  EXPECT_THROW(read_materials(path.string() + ".none"), InputError);
}

}  // namespace
}  // namespace limber
