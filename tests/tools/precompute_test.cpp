// limber-precompute as a user runs it: reference frequencies, soups, wrong input.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "broken_meshes.h"
#include "folders.h"
#include "limber/core/file.h"
#include "limber/model/asset.h"
#include "mesh_files.h"
#include "ritz_box.h"
#include "run_program.h"
#include "soup.h"
#include "tet_box.h"

namespace limber {
namespace {

namespace fs = std::filesystem;
using limber::testing::ProgramResult;
using limber::testing::run_program;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using Json = nlohmann::json;

const std::vector<std::string> kSteel = {"--youngs-modulus", "2e11", "--poisson-ratio", "0.3", "--density", "7850"};

class Precompute : public ::testing::Test {
 protected:
  ProgramResult run(std::vector<std::string> arguments, std::optional<rlim_t> largest_file = {}) const {
    return run_program("limber-precompute", arguments, folder / "", largest_file);
  }
  /// Bakes and returns the report.
  Json report(std::vector<std::string> arguments) const {
    for (const char* a : {"-o", "asset.glb", "--report", "report.json"}) arguments.emplace_back(a);
    const ProgramResult r = run(arguments);
    EXPECT_EQ(r.exit_code, 0) << r.err;
    return r.exit_code == 0 ? Json::parse(read_file(folder / "report.json")) : Json();
  }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder / ""), fs::directory_iterator()));
  }
  const samples::Folder folder;
};

bool is_one_line(const std::string& text) {
  return !text.empty() && text.find('\n') == text.size() - 1 &&
         std::all_of(text.begin(), text.end() - 1, [](unsigned char c) { return c >= 32; });
}

// Reference cases ---------------------------------------------------------------------------------------------------

/// The options that make limber-precompute solve a reference case.
std::vector<std::string> options_of(const Json& reference, const fs::path& folder) {
  Json materials;
  for (const Json& m : reference["materials"]) {
    const std::string region = m["region"] == "*" ? "*" : std::to_string(m["tag"].get<int>());
    materials[region] = {{"youngs_modulus", m["E"]}, {"poisson_ratio", m["nu"]}, {"density", m["rho"]}};
  }
  write_file(folder / "materials.json", materials.dump());
  std::vector<std::string> options = {"--materials", "materials.json", "--modes", "30"};
  if (reference["fixed"].is_object()) {
    std::string nodes;
    for (const Json& n : reference["fixed"]["nodes_index0"])
      nodes += (nodes.empty() ? "nodes:" : ",") + std::to_string(n.get<int>());
    options.insert(options.end(), {"--fix", nodes});
  }
  return options;
}

class ReferenceCase : public Precompute, public ::testing::WithParamInterface<const char*> {};

TEST_P(ReferenceCase, AgreesWithThreeIndependentPrograms) {
  const fs::path cases = fs::path(LIMBER_SOURCE_DIR) / "tests/data/reference-modal";
  const Json reference = Json::parse(read_file(cases / (std::string(GetParam()) + ".json")));
  for (const auto& [mass, key] : {std::pair("consistent", "freqs_hz"), std::pair("lumped", "freqs_hz_lumped")}) {
    auto arguments = options_of(reference, folder / "");
    arguments.insert(arguments.begin(), (cases / reference["mesh"].get<std::string>()).string());
    arguments.insert(arguments.end(), {"--mass", mass});
    const Json r = report(arguments);
    ASSERT_TRUE(r.is_object());
    EXPECT_EQ(r["nodes"], reference["nodes_used"]);
    EXPECT_EQ(r["zero_modes"], reference["zero_modes"]);
    EXPECT_EQ(r["components"], reference["components"]);
    EXPECT_NEAR(r["mass"].get<double>(), reference["total_mass"].get<double>(),
                1e-12 * reference["total_mass"].get<double>());
    EXPECT_TRUE(r["certified"]);
    const auto expected = reference[key].get<std::vector<double>>();
    const auto found = r["frequencies_hz"].get<std::vector<double>>();
    ASSERT_GE(found.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i)
      EXPECT_NEAR(found[i], expected[i], 1e-6 * expected[i]) << mass << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, ReferenceCase,
                         ::testing::Values("small_300", "composite_medit", "pinned_node", "two_bodies",
                                           "bar_cantilever"),
                         [](const auto& test) { return std::string(test.param); });

// Ordinary use ------------------------------------------------------------------------------------------------------

/// The mode that is most like cos(nπx/L) e_x at the vertices, x from the bar's end; cos² of the angle between them.
struct Likeness {
  Index mode = 0;
  double cos_squared = 0.0;
};
Likeness most_axial_mode(const ModalModel& bar, int n, double length) {
  const ModalSurface& surface = bar.render();
  Likeness best;
  for (Index mode = 0; mode < bar.modes(); ++mode) {
    double along = 0.0, shape = 0.0, all = 0.0;
    for (Index v = 0; v < surface.vertices(); ++v) {
      const Vec3 w = surface.basis.shape(v, mode).cast<double>();
      const double x = static_cast<double>(surface.rest[static_cast<std::size_t>(v)].x()) + 0.5 * length;
      const double c = std::cos(n * std::numbers::pi * x / length);
      along += c * w.x(), shape += c * c, all += w.squaredNorm();
    }
    const double cos_squared = along * along / (shape * all);
    if (cos_squared > best.cos_squared) best = {mode, cos_squared};
  }
  return best;
}

TEST_F(Precompute, SlicesThatAreMergedGiveTheFrequenciesOfOneBakeAndAMissingOneIsNamed) {
  write_gmsh(folder / "bar.msh", testing::tet_box(8, 2, 2, {0.4, 0.1, 0.08}));
  const std::vector<std::string> bar = {"bar.msh", "--material", "steel"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), bar.begin(), bar.end());
    return more;
  };
  const auto whole = report(with({"--modes", "30"}))["frequencies_hz"].get<std::vector<double>>();
  const std::string cut = std::to_string(0.5 * (whole[9] + whole[10])),
                    end = std::to_string(0.5 * (whole[24] + whole[25]));
  EXPECT_EQ(run(with({"--slice", "0," + cut, "--of", "2", "-o", "low"})).exit_code, 0);
  EXPECT_EQ(run(with({"--slice", cut + "," + end, "--of", "2", "-o", "high"})).exit_code, 0);
  const Json merged = report(with({"--merge", "high", "--merge", "low"}));
  EXPECT_TRUE(merged["certified"]);
  const auto frequencies = merged["frequencies_hz"].get<std::vector<double>>();
  ASSERT_EQ(frequencies.size(), 25u);
  for (std::size_t i = 0; i < frequencies.size(); ++i) EXPECT_NEAR(frequencies[i], whole[i], 1e-10 * whole[i]);

  const ProgramResult alone = run(with({"--merge", "low", "-o", "half.glb"}));
  EXPECT_NE(alone.exit_code, 0);
  EXPECT_THAT(alone.err, HasSubstr("1 of 2 are here"));
  EXPECT_FALSE(fs::exists(folder / "half.glb"));
  EXPECT_THAT(run({"bar.msh", "--material", "copper", "--merge", "low", "-o", "a.glb"}).err, HasSubstr("another mesh"));
}

TEST_F(Precompute, BarAtZeroPoissonRatioRingsAtTheExactAxialFrequencies) {
  // ν = 0: the axial modes of a free bar are those of a string, f_n = n/(2L) √(E/ρ). Consistent mass overestimates the
  // n-th by (nπ/N)²/24 in one dimension, N elements long; across the bar tets differ from that by less than half of it.
  constexpr int kCells = 20;
  constexpr double kLength = 1.0, kModulus = 1e8, kDensity = 1000.0;
  write_gmsh(folder / "bar.msh", testing::tet_box(kCells, 2, 2, {kLength, 0.1, 0.1}));
  const Json r = report({"bar.msh", "--youngs-modulus", "1e8", "--poisson-ratio", "0", "--density", "1000", "--modes",
                         "40", "--mass", "consistent"});
  ASSERT_TRUE(r.is_object());
  const auto bar = read_asset(folder / "asset.glb").bodies.at(0);
  for (int n = 1; n <= 3; ++n) {
    const auto [mode, cos_squared] = most_axial_mode(*bar, n, kLength);
    EXPECT_GT(cos_squared, 0.99) << n << ": Kuhn's tets are not symmetric, so that a little bending goes with it";
    const double exact = n / (2.0 * kLength) * std::sqrt(kModulus / kDensity);
    const double excess = std::pow(n * std::numbers::pi / kCells, 2) / 24.0;
    EXPECT_GT(bar->frequency_hz(mode), exact) << n;
    EXPECT_LT(bar->frequency_hz(mode), exact * (1.0 + 1.5 * excess)) << n;
    EXPECT_NEAR(r["frequencies_hz"][static_cast<std::size_t>(mode)].get<double>(), bar->frequency_hz(mode),
                1e-9 * exact);
  }
}

TEST_F(Precompute, EqualRunsGiveEqualBytes) {
  write_gmsh(folder / "cube.msh", testing::tet_box(3, 1.0));  // a cube has double and triple modes
  std::vector<std::string> arguments = {"cube.msh", "--modes", "12", "-o", "a.glb"};
  arguments.insert(arguments.end(), kSteel.begin(), kSteel.end());
  ASSERT_EQ(run(arguments).exit_code, 0);
  arguments[4] = "b.glb";
  ASSERT_EQ(run(arguments).exit_code, 0);
  EXPECT_EQ(read_file(folder / "a.glb"), read_file(folder / "b.glb"));
}

/// How far the vertices of a surface that lie inside the tets are from moving as the linear field of the tet around
/// them, relative to the largest shape; found by trying every tet. @param inside counts those vertices
double worst_embedding(const ModalSurface& surface, const ModalVolume& volume, Index& inside) {
  std::vector<Mat3> to_weights;
  for (const Tet& t : volume.tets) {
    Mat3 edges;
    for (int a = 0; a < 3; ++a) edges.col(a) = volume.rest[t[a + 1]] - volume.rest[t[0]];
    to_weights.push_back(edges.inverse());
  }
  double worst = 0.0, largest = 0.0;
  for (Index v = 0; v < surface.vertices(); ++v)
    for (std::size_t i = 0; i < volume.tets.size(); ++i) {
      const Tet& t = volume.tets[i];
      const Vec3 w = to_weights[i] * (surface.rest[v].cast<double>() - volume.rest[t[0]]);
      if (w.minCoeff() < 0.0 || w.sum() > 1.0) continue;
      ++inside;
      for (Index mode = 0; mode < surface.basis.modes(); ++mode) {
        Vec3 expected = (1.0 - w.sum()) * volume.basis.shape(t[0], mode).cast<double>();
        for (int a = 0; a < 3; ++a) expected += w[a] * volume.basis.shape(t[a + 1], mode).cast<double>();
        worst = std::max(worst, (surface.basis.shape(v, mode).cast<double>() - expected).norm());
        largest = std::max(largest, expected.norm());
      }
      break;
    }
  return largest > 0.0 ? worst / largest : 1.0;
}

TEST_F(Precompute, SoupIsWrappedBakedAndMoved) {
  testing::write_obj(folder / "soup.obj", shapes::soup());
  // Linear elements, so that the field in a tet of the volume block is linear.
  const Json r = report({"soup.obj", "--material", "rubber", "--elements", "linear", "--modes", "6", "--cell-size",
                         "0.25", "--alpha", "0.1", "--volume"});
  ASSERT_TRUE(r.is_object());
  EXPECT_TRUE(r["surface"]["wrapped"]);
  // Wrap and tets stay within about the wrap's offset and the cell's sagitta of the union of the two balls.
  EXPECT_NEAR(r["volume"].get<double>(), shapes::soup_volume(), 0.1 * shapes::soup_volume());
  EXPECT_EQ(r["zero_modes"], 6);
  const auto soup = read_asset(folder / "asset.glb").bodies[0];
  Index inside = 0;
  constexpr double kSinglePrecision = 1e-5;  // positions and shapes are floats; a cell is some 100 times their spacing
  EXPECT_LT(worst_embedding(soup->render(), *soup->data().volume_block, inside), kSinglePrecision);
  // The tets keep within a tenth of a cell of the wrap: what is deeper than that inside one of the two balls is in
  // them.
  const auto deep = [&](const Vec3f& rest) {
    const Vec3 p = rest.cast<double>() + soup->data().origin_in_input;
    return std::max(1.0 - p.norm(), 0.6 - (p - Vec3(1.2, 0, 0)).norm()) > 2 * 0.1 * 0.25;
  };
  const auto& rest = soup->render().rest;
  const auto expected = std::count_if(rest.begin(), rest.end(), deep);
  EXPECT_GT(expected, 100);
  EXPECT_GE(inside, expected);
  write_file(folder / "scene.json",
             R"({"step": 0.01, "steps": 50, "gravity": [0, 0, 0], "assets": {"soup": "asset.glb"},
                 "bodies": [{"name": "soup", "asset": "soup", "angular_velocity": [1, 2, 3]}],
                 "strikes": [{"body": "soup", "time": 0.1, "at": {"vertex": 0}, "impulse": [10, 0, 0]}]})");
  const ProgramResult moved = run_program("limber-simulate", {"scene.json", "--record", "moved.glb"}, folder / "");
  EXPECT_EQ(moved.exit_code, 0) << moved.err;
  EXPECT_TRUE(fs::exists(folder / "moved.glb"));
}

// Steel of 207 GPa, 7850 kg/m³. Beam theory leaves out shear, and the clamp's hold on the width, 1 to 2 % here.
TEST_F(Precompute, ThinSurfacesRingAsBeamsWithAllDefaults) {
  const double wave = std::sqrt(2.07e11 / (12.0 * 7850.0)) / (2.0 * std::numbers::pi);  // × β² t/L², Hz
  testing::write_obj(folder / "bar.obj", boundary_surface(testing::tet_box(1, 1, 1, {0.3, 0.04, 0.01})).surface);
  const Json bar = report({"bar.obj", "--material", "steel"});
  const double free = 22.3733 * wave * 0.01 / (0.3 * 0.3);
  EXPECT_NEAR(bar["frequencies_hz"][0].get<double>(), free, 0.02 * free);
  EXPECT_EQ(bar["bodies"][0]["nodes_per_tet"], 10);
  EXPECT_LT(bar["nodes"], 1095) << "as the linear mesh had";

  testing::write_obj(folder / "reed.obj", boundary_surface(testing::tet_box(1, 1, 1, {0.06, 0.01, 0.001})).surface);
  const Json reed = report({"reed.obj", "--material", "steel", "--modes", "4", "--fix", "box:-1,-1,-1,1e-6,1,1"});
  const double clamped = 3.51602 * wave * 0.001 / (0.06 * 0.06);
  EXPECT_NEAR(reed["frequencies_hz"][0].get<double>(), clamped, 0.02 * clamped);

  const Json linear = report({"bar.obj", "--material", "steel", "--elements", "linear", "--modes", "4"});
  EXPECT_GT(linear["frequencies_hz"][0].get<double>(), 1.5 * free);
}

// Cells of 60 mm leave the frequencies of this block 0.7 % too high. Ritz's method with polynomials gives the true
// ones.
TEST_F(Precompute, CellsAreAsSmallAsTheWantedFrequencyErrorAsks) {
  const Vec3 size(0.1, 0.08, 0.06);
  testing::write_obj(folder / "block.obj", boundary_surface(testing::tet_box(1, 1, 1, size)).surface);
  const auto baked = [&](std::vector<std::string> more) {
    std::vector<std::string> arguments = {"block.obj", "--material", "steel", "--modes", "10", "--cell-size", "0.06"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return report(arguments);
  };
  const auto largest_error = [](const Json& r) {
    const auto errors = r["frequency_errors"].get<std::vector<double>>();
    return *std::max_element(errors.begin(), errors.end());
  };
  const Json plain = baked({}), loose = baked({"--frequency-error", "5%"}),
             tight = baked({"--frequency-error", "0.5%"});
  EXPECT_GT(largest_error(plain), 0.005);
  EXPECT_EQ(loose["nodes"], plain["nodes"]) << "cells of the size that was asked for do";
  EXPECT_GT(tight["nodes"], plain["nodes"]);
  EXPECT_LT(largest_error(tight), 0.005);
  EXPECT_TRUE(tight["warnings"].empty());
  const testing::RitzBox truth((0.5 * size).asDiagonal(), {2.07e11, 0.3, 7850.0}, {9, 9, 9}, 10);
  for (int m = 0; m < 10; ++m) {
    const double hz = std::sqrt(truth.eigenvalue(m)) / (2.0 * std::numbers::pi);
    EXPECT_NEAR(tight["frequencies_hz"][static_cast<std::size_t>(m)].get<double>(), hz, 0.005 * hz) << m;
  }

  const Json poor = baked({"--frequency-error", "0.1%", "--max-nodes", "1000"});
  ASSERT_EQ(poor["warnings"].size(), 1u);
  EXPECT_THAT(poor["warnings"][0].get<std::string>(), HasSubstr("smaller cells would take more than --max-nodes"));
  EXPECT_GT(largest_error(poor), 0.001);
}

// Quadratic elements, the default, hardly lock. Ritz's method with polynomials gives the true frequencies.
TEST_F(Precompute, ABlockOfRubberRingsAsItShouldNearNuOfOneHalf) {
  const Vec3 size(0.1, 0.08, 0.06);
  testing::write_obj(folder / "block.obj", boundary_surface(testing::tet_box(1, 1, 1, size)).surface);
  for (const char* nu : {"0.49", "0.499"}) {
    const Json r =
        report({"block.obj", "--youngs-modulus", "2e6", "--poisson-ratio", nu, "--density", "925", "--modes", "6"});
    const testing::RitzBox truth((0.5 * size).asDiagonal(), {2e6, std::stod(nu), 925.0}, {11, 11, 11}, 6);
    for (int m = 0; m < 6; ++m) {
      const double hz = std::sqrt(truth.eigenvalue(m)) / (2.0 * std::numbers::pi);
      EXPECT_NEAR(r["frequencies_hz"][static_cast<std::size_t>(m)].get<double>(), hz, 0.01 * hz) << nu << " " << m;
    }
  }
}

TEST_F(Precompute, AFileOfFourNodeTetsKeepsThemUnlessAsked) {
  write_gmsh(folder / "bar.msh", testing::tet_box(15, 2, 1, {0.3, 0.04, 0.01}));
  const Json as_given = report({"bar.msh", "--material", "steel", "--modes", "2"});
  const Json asked = report({"bar.msh", "--material", "steel", "--modes", "2", "--elements", "quadratic"});
  EXPECT_EQ(as_given["bodies"][0]["nodes_per_tet"], 4);
  EXPECT_EQ(asked["bodies"][0]["nodes_per_tet"], 10);
  EXPECT_LT(asked["frequencies_hz"][0], 0.7 * as_given["frequencies_hz"][0].get<double>());
}

TEST_F(Precompute, ScaleMultipliesLengthsFirst) {
  write_gmsh(folder / "cube.msh", testing::tet_box(2, 1000.0));  // millimetres
  std::vector<std::string> arguments = {"cube.msh", "--modes", "3", "--scale", "0.001"};
  arguments.insert(arguments.end(), kSteel.begin(), kSteel.end());
  EXPECT_NEAR(report(arguments)["mass"].get<double>(), 7850.0, 1e-9 * 7850.0);
}

TEST_F(Precompute, TooSmallAndTooFastModesAreDroppedWithTheirReason) {
  write_gmsh(folder / "cube.msh", testing::tet_box(3, 0.1));
  const Json all = report({"cube.msh", "--material", "rubber", "--modes", "20"});
  const double middle = all["frequencies_hz"][10];
  const Json fast = report(
      {"cube.msh", "--material", "rubber", "--modes", "20", "--frame-rate", std::to_string(2 * middle * 1.0001)});
  EXPECT_EQ(fast["kept"].size() + fast["discarded"].size(), fast["frequencies_hz"].size());
  ASSERT_FALSE(fast["discarded"].empty());
  EXPECT_EQ(fast["discarded"][0]["reason"], "above_half_frame_rate");
  const Json small =
      report({"cube.msh", "--material", "rubber", "--modes", "20", "--max-force", "1e-3", "--min-displacement", "1"});
  EXPECT_TRUE(small["kept"].empty());
  EXPECT_EQ(small["discarded"][0]["reason"], "below_min_displacement");
  const Json kept = report({"cube.msh", "--material", "rubber", "--modes", "20", "--max-force", "1e-3",
                            "--min-displacement", "1", "--keep-all"});
  EXPECT_EQ(kept["kept"].size(), kept["frequencies_hz"].size());
}

TEST_F(Precompute, SkinIsBakedOnDemandAndTold) {
  write_gmsh(folder / "bar.msh", testing::tet_box(12, 2, 2, {0.6, 0.1, 0.1}));
  const std::vector<std::string> held = {"bar.msh", "--material",           "nylon", "--modes", "6",
                                         "--fix",   "box:-1,-1,-1,1e-6,1,1"};
  const auto with = [&](const char* option) {
    std::vector<std::string> arguments = held;
    if (*option) arguments.emplace_back(option);
    return report(arguments)["bodies"][0]["skin"];
  };
  EXPECT_TRUE(with("").is_null());
  EXPECT_FALSE(read_asset(folder / "asset.glb").bodies[0]->data().skin);
  const Json three = with("--skin=3");
  EXPECT_EQ(three["handles"], 4);  // the ground beside them
  EXPECT_EQ(three["ground"], true);
  EXPECT_EQ(three["modes"].size(), 3u);
  ASSERT_TRUE(read_asset(folder / "asset.glb").bodies[0]->data().skin);
  EXPECT_EQ(read_asset(folder / "asset.glb").bodies[0]->data().skin->handles, 4);
  EXPECT_THAT(read_asset(folder / "asset.glb").provenance.options, HasSubstr("--skin=3"));
  EXPECT_LT(with("--skin")["spread"].get<double>(), three["spread"].get<double>());
}

// A bar of glass that falls rings at the frequency of a free beam, in the file of its note too.
TEST_F(Precompute, SoundIsBakedOnDemandToldAndHeard) {
  testing::write_obj(folder / "bar.obj", boundary_surface(testing::tet_box(1, 1, 1, {0.2, 0.02, 0.01})).surface);
  const Json silent = report({"bar.obj", "--material", "glass", "--modes", "2"});
  EXPECT_TRUE(silent["bodies"][0]["sound"].is_null());
  const Json heard = report({"bar.obj", "--material", "glass", "--modes", "2", "--sound"});
  EXPECT_EQ(heard["frequencies_hz"], silent["frequencies_hz"]);
  const Json& sound = heard["bodies"][0]["sound"];
  EXPECT_EQ(sound["modes"], sound["audible"]);
  const auto lowest = heard["frequencies_hz"][0].get<double>();  // of another solve, for other modes
  EXPECT_NEAR(sound["frequencies_hz"][0].get<double>(), lowest, 1e-12 * lowest);
  EXPECT_GT(sound["frequencies_hz"][1], 10e3);
  EXPECT_LT(sound["frequencies_hz"][1], 20e3);
  EXPECT_NEAR(sound["loss_factors"][1].get<double>(), 0.0013, 1e-12);
  const Json few = report({"bar.obj", "--material", "glass", "--modes", "2", "--sound=3", "--loss-factor", "0.01"});
  EXPECT_EQ(few["bodies"][0]["sound"]["modes"], 3);
  EXPECT_EQ(few["warnings"].size(), 1u);

  const auto size_of = [&](const char* file) { return fs::file_size(folder / file); };
  const ProgramResult ring = testing::run_program(
      "limber-inspect", {"asset.glb", "--ring", "note.wav", "--ring-vertex", "1", "--ring-seconds", "0.5"},
      folder / "");
  EXPECT_EQ(ring.exit_code, 0) << ring.err;
  EXPECT_LE(size_of("note.wav"), 58u + 24000 * 4);
  write_file(folder / "scene.json", R"({"step": 0.005, "steps": 100, "assets": {"bar": "asset.glb"},
    "statics": [{"name": "ground", "shape": {"half_space": {}}}],
    "bodies": [{"name": "bar", "asset": "bar", "position": [0, 0, 0.1]}]})");
  const ProgramResult scene =
      testing::run_program("limber-simulate", {"scene.json", "--sound", "scene.wav"}, folder / "");
  EXPECT_EQ(scene.exit_code, 0) << scene.err;
  EXPECT_GE(size_of("scene.wav"), 58u + 24000 * 2 * 4);
}

TEST_F(Precompute, BodiesThatTurnAboutAPointGetNoSkin) {
  write_gmsh(folder / "cube.msh", testing::tet_box(2, 1.0));
  const Json r = report({"cube.msh", "--material", "nylon", "--modes", "3", "--fix", "nodes:0", "--skin"});
  EXPECT_TRUE(r["bodies"][0]["skin"].is_null());
  ASSERT_EQ(r["warnings"].size(), 2u);
  EXPECT_THAT(r["warnings"][0].get<std::string>(), HasSubstr("turns about a point or a line"));
  EXPECT_THAT(r["warnings"][1].get<std::string>(), HasSubstr("linear elements are too stiff"));
}

// Materials inside a surface ----------------------------------------------------------------------------------------

/// OBJ text of closed boxes, a group each.
std::string grouped_boxes(const std::vector<std::tuple<std::string, Vec3, Vec3>>& boxes) {
  std::string text;
  Index first = 1;
  for (const auto& [name, low, size] : boxes) {
    const SurfaceMesh box = boundary_surface(testing::tet_box(4, 4, 4, size)).surface;
    text += "g " + name + "\n";
    for (const Vec3& v : box.vertices) {
      const Vec3 p = low + v;
      text += "v " + std::to_string(p.x()) + " " + std::to_string(p.y()) + " " + std::to_string(p.z()) + "\n";
    }
    for (const Triangle& t : box.triangles)
      text += "f " + std::to_string(first + t[0]) + " " + std::to_string(first + t[1]) + " " +
              std::to_string(first + t[2]) + "\n";
    first += static_cast<Index>(box.vertices.size());
  }
  return text;
}

TEST_F(Precompute, GroupsOfASoupsFacesHaveMaterialsOfTheirOwn) {
  write_file(folder / "soup.obj", grouped_boxes({{"left", Vec3(0, 0, 0), Vec3(0.55, 0.4, 0.4)},
                                                 {"right", Vec3(0.45, 0, 0), Vec3(0.55, 0.4, 0.4)}}));
  write_file(folder / "m.json", R"({"left": "rubber", "right": "steel"})");
  const Json r = report({"soup.obj", "--materials", "m.json", "--modes", "4"});
  const Json& regions = r["bodies"][0]["regions"];
  ASSERT_EQ(regions.size(), 2u);
  for (const Json& region : regions) {
    EXPECT_NEAR(region["volume"].get<double>(), 0.08, 0.06 * 0.08) << region["name"];
    const double density = region["name"] == "left" ? 925.0 : 7850.0;
    EXPECT_NEAR(region["mass"].get<double>(), density * region["volume"].get<double>(), 1e-9 * density);
  }
}

TEST_F(Precompute, AGroupOfClosedShellsIsARegionAndNoCavity) {
  write_file(folder / "body.obj", grouped_boxes({{"skin", Vec3(0, 0, 0), Vec3(1, 1, 1)},
                                                 {"core", Vec3(0.25, 0.25, 0.25), Vec3(0.5, 0.5, 0.5)}}));
  write_file(
      folder / "m.json",
      R"([{"name": "*", "material": "rubber"}, {"name": "core", "shells": {"group": "core"}, "material": "steel"}])");
  const Json r = report({"body.obj", "--materials", "m.json", "--modes", "2"});
  EXPECT_NEAR(r["volume"].get<double>(), 1.0, 1e-9);
  const Json& regions = r["bodies"][0]["regions"];
  ASSERT_EQ(regions.size(), 2u);
  const Json& core = regions[regions[0]["name"] == "core" ? 0 : 1];
  EXPECT_NEAR(core["volume"].get<double>(), 0.125, 1e-12) << "faces of tets follow the shell";
  EXPECT_EQ(r["surface"]["followed_regions"], Json::array({"core"}));
  const auto asset = read_asset(folder / "asset.glb");
  EXPECT_EQ(asset.bodies[0]->render().vertices(), 98) << "the skin alone is drawn";
}

TEST_F(Precompute, BadRegionsAreToldInOneLine) {
  write_file(folder / "box.obj", grouped_boxes({{"skin", Vec3(0, 0, 0), Vec3(1, 1, 1)}}));
  write_file(folder / "a.obj", grouped_boxes({{"a", Vec3(0.2, 0.2, 0.2), Vec3(0.4, 0.4, 0.4)}}));
  write_file(folder / "b.obj", grouped_boxes({{"b", Vec3(0.4, 0.4, 0.41), Vec3(0.4, 0.4, 0.4)}}));
  write_file(folder / "half.vtk",
             "# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nSPACING 0.5 1 1\n"
             "POINT_DATA 8\nSCALARS density float\nLOOKUP_TABLE default\n1 1 1 1 1 1 1 1\n");
  const std::vector<std::pair<std::string, const char*>> wrong{
      {R"([{"name": "*", "material": "rubber"}, {"name": "far", "ball": {"center": [9, 9, 9], "radius": 1}, "material": "steel"}])",
       "region \"far\" is empty"},
      {R"([{"name": "a", "shells": "a.obj", "material": "steel"}, {"name": "b", "shells": "b.obj", "material": "wood"}])",
       "the shells of regions \"a\" and \"b\" cross"},
      {R"([{"name": "scan", "voxels": "half.vtk", "material": "steel"}])", "do not cover it"},
      {R"([{"name": "*", "material": "rubber"}, {"name": "x", "shells": {"group": "core"}, "material": "steel"}])",
       "has no group \"core\""}};
  for (const auto& [materials, expected] : wrong) {
    write_file(folder / "m.json", materials);
    const ProgramResult r = run({"box.obj", "--materials", "m.json", "--cell-size", "0.3", "-o", "asset.glb"});
    EXPECT_EQ(r.exit_code, 1) << materials;
    EXPECT_TRUE(is_one_line(r.err)) << r.err;
    EXPECT_THAT(r.err, HasSubstr(expected));
    EXPECT_FALSE(fs::exists(folder / "asset.glb"));
  }
}

// Wrong input -------------------------------------------------------------------------------------------------------

TEST_F(Precompute, EveryBrokenMeshGivesOneLineAndNoOutput) {
  const auto all = samples::broken_meshes();
  ASSERT_GE(all.size(), 60u);
  for (const samples::Broken& b : all) {
    SCOPED_TRACE(b.name);
    folder.write(b.name, b.bytes);
    std::vector<std::string> arguments = {b.name, "-o", "asset.glb", "--report", "report.json"};
    arguments.insert(arguments.end(), kSteel.begin(), kSteel.end());
    const ProgramResult r = run(arguments);
    EXPECT_EQ(r.exit_code, 1) << r.err;
    EXPECT_TRUE(is_one_line(r.err)) << r.err;
    EXPECT_THAT(r.err, StartsWith("limber-precompute: "));
    EXPECT_THAT(r.err, HasSubstr(b.name));
    fs::remove(folder / b.name);
    EXPECT_EQ(files(), 0u) << "something was written";
  }
}

TEST_F(Precompute, SurfacesThatBoundNothingAreRefusedInOneLine) {
  write_file(folder / "triangle.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  write_file(folder / "tilted_quad.obj", "v 0 0 1\nv 3 1 2\nv 4 4 6\nv 1 3 5\nf 1 2 3 4\n");
  write_file(folder / "both_sides.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 3 2\n");
  for (const char* name : {"triangle.obj", "tilted_quad.obj", "both_sides.obj"}) {
    const ProgramResult r = run({name, "-o", "asset.glb", "--material", "steel"});
    EXPECT_EQ(r.exit_code, 1) << name;
    EXPECT_TRUE(is_one_line(r.err)) << r.err;
    EXPECT_THAT(r.err, HasSubstr(name));
    EXPECT_THAT(r.err, HasSubstr("flat"));
    EXPECT_THAT(r.err, HasSubstr("expected a surface around a volume; try"));
  }
  EXPECT_EQ(files(), 3u);
}

TEST_F(Precompute, WhatIsNoMeshGivesOneLine) {
  fs::create_directory(folder / "folder.msh");
  folder.write("empty.obj", "");
  folder.write("text.xyz", "not a mesh");
  for (const char* name : {"folder.msh", "empty.obj", "text.xyz", "missing.msh"}) {
    std::vector<std::string> arguments = {name, "-o", "asset.glb"};
    arguments.insert(arguments.end(), kSteel.begin(), kSteel.end());
    const ProgramResult r = run(arguments);
    EXPECT_EQ(r.exit_code, 1) << name;
    EXPECT_TRUE(is_one_line(r.err)) << r.err;
    EXPECT_FALSE(fs::exists(folder / "asset.glb"));
  }
}

TEST_F(Precompute, WrongUseIsToldWithExitCodeTwo) {
  write_gmsh(folder / "cube.msh", testing::tet_box(1, 1.0));
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"cube.msh"},
      {"cube.msh", "-o", "a.glb"},
      {"cube.msh", "-o", "a.glb", "--material", "stel"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--density", "1000"},
      {"cube.msh", "-o", "a.glb", "--youngs-modulus", "1e9", "--density", "1000"},
      {"cube.msh", "-o", "a.glb", "--youngs-modulus", "1e9", "--density", "1000", "--poisson-ratio", "0.5"},
      {"cube.msh", "-o", "a.glb", "--youngs-modulus", "-1", "--density", "1000", "--poisson-ratio", "0.3"},
      {"cube.msh", "-o", "a.glb", "--youngs-modulus", "nan", "--density", "1000", "--poisson-ratio", "0.3"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--modes", "-1"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--modes", "many"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--modes", "0"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--max-force", "5"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--min-displacement", "1e-3"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--blas-threads", "-1"},
      {"cube.msh", "-o", "cube.msh", "--material", "steel", "--modes", "1"},
      {"cube.msh", "-o", "a.glb", "--report", "cube.msh", "--material", "steel", "--modes", "1"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--fix", "group:clamped"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--fix", "nodes:8"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--fix", "box:5,5,5,6,6,6"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--damping-ratio", "0.1"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--damping-ratio", "0.1@5,0"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--rayleigh", "1,-1"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--mass", "heavy"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--scale", "0"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--skin=0"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--skin=few"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--skin=255"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--frequency-error", "1"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--frequency-error", "0%"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--frequency-error", "nan%"},
      {"cube.msh", "-o", "a.glb", "--material", "steel", "--unknown"},
  };
  for (const auto& arguments : wrong) {
    SCOPED_TRACE(arguments.empty() ? "no arguments" : arguments.back());
    const ProgramResult r = run(arguments);
    EXPECT_EQ(r.exit_code, 2) << r.err;
    EXPECT_TRUE(is_one_line(r.err)) << r.err;
    EXPECT_FALSE(fs::exists(folder / "a.glb"));
  }
}

TEST_F(Precompute, SurfaceFarFromTheMeshAndOptionsWithoutEffectAreToldOf) {
  write_gmsh(folder / "cube.msh", testing::tet_box(1, 1.0));
  SurfaceMesh far = boundary_surface(testing::tet_box(1, 1.0)).surface;
  for (Vec3& x : far.vertices) x.x() += 100.0;
  testing::write_obj(folder / "far.obj", far);
  std::vector<std::string> arguments = {"cube.msh", "--modes", "3", "--render-surface", "far.obj", "--cell-size", "1"};
  arguments.insert(arguments.end(), kSteel.begin(), kSteel.end());
  const Json r = report(arguments);
  ASSERT_EQ(r["warnings"].size(), 3u);
  EXPECT_THAT(r["warnings"][2].get<std::string>(), HasSubstr("linear elements are too stiff"));
  EXPECT_THAT(r["warnings"][0].get<std::string>(),
              HasSubstr("--cell-size, --frequency-error and --alpha have no effect"));
  EXPECT_THAT(r["warnings"][1].get<std::string>(), HasSubstr("8 of 8 vertices lie outside the tetrahedra"));
}

TEST_F(Precompute, ProvenanceHoldsOptionsAsTheyAreTyped) {
  write_gmsh(folder / "cube.msh", testing::tet_box(1, 1.0));
  report({"cube.msh", "--material", "steel", "--modes", "2", "--no-certify", "--volume"});
  EXPECT_EQ(read_asset(folder / "asset.glb").provenance.options, "--material steel --modes 2 --no-certify --volume");
}

TEST_F(Precompute, DiskThatFillsLeavesNothing) {
  write_gmsh(folder / "cube.msh", testing::tet_box(3, 1.0));
  std::vector<std::string> arguments = {"cube.msh", "-o", "asset.glb", "--report", "report.json"};
  arguments.insert(arguments.end(), kSteel.begin(), kSteel.end());
  const ProgramResult r = run(arguments, 2000);
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_TRUE(is_one_line(r.err)) << r.err;
  EXPECT_EQ(files(), 1u) << "more than the input is left";
}

TEST_F(Precompute, HalvesOfABlockAreToldAndMergeNodesMakesThemOne) {
  TetMesh halves = testing::tet_box(2, 1.0);
  const TetMesh other = halves;
  const auto first = static_cast<Index>(halves.nodes.size());
  for (const Vec3& x : other.nodes) halves.nodes.emplace_back(x + Vec3(1, 0, 0));
  for (Tet t : other.tets) {
    for (Index& n : t) n += first;
    halves.tets.push_back(t);
    halves.tet_region.push_back(0);
  }
  halves.node_groups.clear();
  write_gmsh(folder / "halves.msh", halves);
  std::vector<std::string> arguments = {"halves.msh", "--modes", "1", "--no-certify"};
  arguments.insert(arguments.end(), kSteel.begin(), kSteel.end());
  const Json two = report(arguments);
  EXPECT_EQ(two["components"], 2);
  EXPECT_THAT(two["warnings"][0].get<std::string>(), HasSubstr("9 nodes lie on nodes of another body"));
  arguments.insert(arguments.end(), {"--merge-nodes", "1e-6"});
  const Json one = report(arguments);
  EXPECT_EQ(one["components"], 1);
  EXPECT_EQ(one["merged_nodes"], 9);
  EXPECT_NEAR(one["volume"].get<double>(), 2.0, 1e-12);
}

TEST_F(Precompute, FlatTetsAreRefusedAndNegativeOnesTurned) {
  TetMesh mesh = testing::tet_box(2, 1.0);
  std::swap(mesh.tets[3][0], mesh.tets[3][1]);
  write_gmsh(folder / "turned.msh", mesh);
  std::vector<std::string> arguments = {"turned.msh", "--modes", "3"};
  arguments.insert(arguments.end(), kSteel.begin(), kSteel.end());
  const Json r = report(arguments);
  ASSERT_EQ(r["warnings"].size(), 2u);
  EXPECT_THAT(r["warnings"][0].get<std::string>(), HasSubstr("1 of 48 tetrahedra were left-handed"));
  EXPECT_THAT(r["warnings"][1].get<std::string>(), HasSubstr("linear elements are too stiff"));
  EXPECT_NEAR(r["volume"].get<double>(), 1.0, 1e-12);
}

}  // namespace
}  // namespace limber
