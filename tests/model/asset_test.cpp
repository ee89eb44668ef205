#include "limber/model/asset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "asked.h"
#include "example_model.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/core/quaternion.h"
#include "limber/model/glb.h"

namespace limber {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kOpen = std::numeric_limits<double>::infinity();

/// The message of the InputError that reading gives; "accepted" if it gives none. Any other exception fails the test.
std::string reading(const std::string& bytes) {
  try {
    (void)asset_from_bytes(bytes, "\"test.glb\"");
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

/// A GLB of a document and a binary chunk, with lengths that fit.
std::string glb_of(const std::string& text, std::string_view binary) {
  std::string padded = text;
  padded.resize((text.size() + 3) / 4 * 4, ' ');
  const auto word = [](std::size_t n) {
    const auto v = static_cast<std::uint32_t>(n);
    return std::string(reinterpret_cast<const char*>(&v), 4);
  };
  return "glTF" + word(2) + word(12 + 8 + padded.size() + 8 + binary.size()) + word(padded.size()) + "JSON" + padded +
         word(binary.size()) + std::string("BIN\0", 4) + std::string(binary);
}

/// The example's bytes with its document changed.
std::string with_document(const std::function<void(json&)>& change) {
  const std::string bytes = asset_bytes(example::asset());
  const GlbChunks chunks = glb_chunks(bytes, "test");
  json document = json::parse(chunks.json);
  change(document);
  return glb_of(document.dump(), chunks.binary);
}

json& block_of(json& document, std::size_t mesh) { return document["meshes"][mesh]["extensions"]["LIMBER_modal"]; }

/// Tells where two files differ, rather than print both.
void expect_same_bytes(const std::string& a, const std::string& b) {
  EXPECT_EQ(a.size(), b.size());
  const auto place =
      std::mismatch(a.begin(), a.begin() + static_cast<std::ptrdiff_t>(std::min(a.size(), b.size())), b.begin());
  EXPECT_TRUE(a == b) << "at byte " << place.first - a.begin();
}

void expect_same_surface(const ModalSurface& a, const ModalSurface& b) {
  ASSERT_EQ(a.vertices(), b.vertices());
  EXPECT_EQ(a.rest, b.rest);
  EXPECT_EQ(a.triangles, b.triangles);
  ASSERT_EQ(a.basis.modes(), b.basis.modes());
  for (Index v = 0; v < a.vertices(); ++v)
    for (Index i = 0; i < a.basis.modes(); ++i)
      ASSERT_EQ(a.basis.shape(v, i), b.basis.shape(v, i)) << v << ", mode " << i;
}

void expect_same_skin(const ModalSkin& a, const ModalSkin& b) {
  EXPECT_EQ(a.handles, b.handles);
  EXPECT_EQ(a.modes, b.modes);
  EXPECT_EQ(a.rest, b.rest);
  EXPECT_EQ(a.rotations, b.rotations);
  EXPECT_EQ(a.arms, b.arms);
  EXPECT_EQ(a.shifts, b.shifts);
  EXPECT_EQ(a.render, b.render);
  EXPECT_EQ(a.collision, b.collision);
  EXPECT_EQ(a.volume, b.volume);
  EXPECT_EQ(a.gauge.weights, b.gauge.weights);
  EXPECT_EQ(a.gauge.rest, b.gauge.rest);
  EXPECT_EQ(a.gauge.shapes, b.gauge.shapes);
}

void expect_same_body(const ModalModelData& a, const ModalModelData& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.motion, b.motion);
  EXPECT_EQ(a.line_axis, b.line_axis);
  EXPECT_EQ(a.mass, b.mass);
  EXPECT_EQ(a.volume, b.volume);
  EXPECT_EQ(a.center_of_mass, b.center_of_mass);
  EXPECT_EQ(a.origin_in_input, b.origin_in_input);
  EXPECT_EQ(a.inertia, b.inertia);
  EXPECT_EQ(a.eigenvalues, b.eigenvalues);
  EXPECT_EQ(a.decays, b.decays);
  EXPECT_EQ(a.participation, b.participation);
  EXPECT_EQ(a.moments, b.moments);
  expect_same_surface(a.render, b.render);
  ASSERT_EQ(a.collision.has_value(), b.collision.has_value());
  if (a.collision) expect_same_surface(*a.collision, *b.collision);
  ASSERT_EQ(a.residual_compliance.has_value(), b.residual_compliance.has_value());
  if (a.residual_compliance) {
    EXPECT_EQ(a.residual_compliance->form(), b.residual_compliance->form());
    EXPECT_TRUE(std::ranges::equal(a.residual_compliance->values(), b.residual_compliance->values()));
  }
  ASSERT_EQ(a.captured.size(), b.captured.size());
  for (std::size_t i = 0; i < a.captured.size(); ++i) {
    EXPECT_EQ(a.captured[i].at, b.captured[i].at);
    EXPECT_EQ(a.captured[i].share, b.captured[i].share);
  }
  ASSERT_EQ(a.skin.has_value(), b.skin.has_value());
  if (a.skin) expect_same_skin(*a.skin, *b.skin);
  ASSERT_EQ(a.volume_block.has_value(), b.volume_block.has_value());
  if (!a.volume_block) return;
  EXPECT_EQ(a.volume_block->rest, b.volume_block->rest);
  EXPECT_EQ(a.volume_block->tets, b.volume_block->tets);
  for (Index v = 0; v < a.volume_block->basis.vertices(); ++v)
    for (Index i = 0; i < a.volume_block->basis.modes(); ++i) {
      EXPECT_EQ(a.volume_block->basis.shape(v, i), b.volume_block->basis.shape(v, i));
      EXPECT_EQ(a.volume_block->mass_times_basis.shape(v, i), b.volume_block->mass_times_basis.shape(v, i));
    }
}

TEST(Asset, WhatIsWrittenIsReadBitForBit) {
  const Asset written = example::asset();
  const Asset read = asset_from_bytes(asset_bytes(written), "test");
  ASSERT_EQ(read.bodies.size(), written.bodies.size());
  for (std::size_t i = 0; i < read.bodies.size(); ++i)
    expect_same_body(read.bodies[i]->data(), written.bodies[i]->data());
  EXPECT_EQ(read.provenance.tool, written.provenance.tool);
  EXPECT_EQ(read.provenance.input, written.provenance.input);
  EXPECT_EQ(read.provenance.input_hash, written.provenance.input_hash);
  EXPECT_EQ(read.provenance.options, written.provenance.options);
}

TEST(Asset, EqualAssetsGiveEqualBytesAndReadingKeepsThem) {
  const std::string bytes = asset_bytes(example::asset());
  expect_same_bytes(asset_bytes(example::asset()), bytes);
  expect_same_bytes(asset_bytes(asset_from_bytes(bytes, "test")), bytes);
}

TEST(Asset, ShapesOfAnySizeKeepTheirBytesThroughFile) {
  // A mode scale multiplies each shape: where float32 runs out of digits, the second writing must not differ from the
  // first.
  for (const float size : {1e-44f, 1.1e-38f, 1e-30f, 1e-6f, 1e6f, 1e30f, 3e38f}) {
    ModalModelData d = example::box("bar", 2);
    for (Index v = 0; v < d.render.vertices(); ++v)
      for (Index i = 0; i < 2; ++i) d.render.basis.set(v, i, size * Vec3f(1.0f, 1e-3f * static_cast<float>(v), -0.7f));
    const std::string bytes = asset_bytes({.bodies = {example::model(std::move(d))}, .provenance = {}});
    expect_same_bytes(asset_bytes(asset_from_bytes(bytes, "test")), bytes);
  }
}

TEST(Asset, GoesThroughAFile) {
  const auto path = std::filesystem::path(::testing::TempDir()) / "limber_asset_test.glb";
  write_asset(path, example::asset());
  expect_same_bytes(asset_bytes(read_asset(path)), asset_bytes(example::asset()));
  std::filesystem::remove(path);
  EXPECT_THROW(read_asset(path), InputError);
}

TEST(Asset, SharesOfTheStaticComplianceAreKept) {
  const auto captured = [](double share) {
    ModalModelData data = example::box("bar", 3);
    data.captured = {{{0.1, 0.2, 0.3}, share}, {{-0.1, 1.0 / 3.0, 0.0}, 1.0}};
    return example::model(std::move(data));
  };
  const Asset written{.bodies = {captured(0.25)}, .provenance = {}};
  const std::string bytes = asset_bytes(written);
  const Asset read = asset_from_bytes(bytes, "test");
  expect_same_body(read.bodies[0]->data(), written.bodies[0]->data());
  EXPECT_NE(asset_bytes({.bodies = {captured(0.5)}, .provenance = {}}), bytes);
  EXPECT_THROW(captured(1.5), InvalidArgument);
}

TEST(Asset, ErrorsOfFrequenciesAreKeptAndMayBeUnknown) {
  const auto with_errors = [](std::vector<double> errors) {
    Asset asset{.bodies = {example::model(example::box("bar", 3))}, .provenance = {}};
    asset.frequency_errors = {std::move(errors)};
    return asset;
  };
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  const std::string bytes = asset_bytes(with_errors({1.0 / 3.0, -0.01, unknown}));
  const Asset read = asset_from_bytes(bytes, "test");
  EXPECT_EQ(read.frequency_errors[0][0], 1.0 / 3.0);
  EXPECT_EQ(read.frequency_errors[0][1], -0.01);
  EXPECT_TRUE(std::isnan(read.frequency_errors[0][2]));
  expect_same_bytes(asset_bytes(read), bytes);
  EXPECT_NE(asset_bytes(with_errors({1.0 / 3.0, 0.02, unknown})), bytes);
  const std::string untold = asset_bytes(with_errors({}));
  EXPECT_TRUE(asset_from_bytes(untold, "test").frequency_errors[0].empty());
  EXPECT_THROW(asset_bytes(with_errors({0.1, 0.1, -1.0})), InvalidArgument);
  EXPECT_THROW(asset_bytes(with_errors({0.1})), InvalidArgument);
}

TEST(Asset, RigidBodyHasNoMorphTargets) {
  const std::string bytes = asset_bytes({.bodies = {example::model(example::full_box("stone", 0))}, .provenance = {}});
  const json document = json::parse(glb_chunks(bytes, "test").json);
  EXPECT_FALSE(document["meshes"][0]["primitives"][0].contains("targets"));
  EXPECT_EQ(asset_from_bytes(bytes, "test").bodies[0]->modes(), 0);
}

TEST(Asset, ScalesOfTheMorphTargetsAreKept) {
  ModalModelData data = example::box("bar", 3);
  const std::vector<double> scales{4.0, 0x1p-20, 1.0};
  data.mode_scales = scales;
  const std::string bytes = asset_bytes({.bodies = {example::model(std::move(data))}, .provenance = {}});
  const Asset read = asset_from_bytes(bytes, "test");
  EXPECT_EQ(read.bodies[0]->data().mode_scales, scales);
  expect_same_bytes(asset_bytes(read), bytes);
}

TEST(Asset, WeightOneIsAVisibleShapeOfKnownScale) {
  const Asset asset = example::asset();
  const std::string bytes = asset_bytes(asset);
  const GlbChunks chunks = glb_chunks(bytes, "test");
  json document = json::parse(chunks.json);
  const ModalModelData& body = asset.bodies[0]->data();
  const double diagonal = 2.0 * Vec3(0.5, 0.1, 0.15).norm();
  const json& targets = document["meshes"][0]["primitives"][0]["targets"];
  ASSERT_EQ(targets.size(), 7u);
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const double scale = block_of(document, 0)["mode_scales"][i];
    const json& accessor = document["accessors"][targets[i]["POSITION"].get<std::size_t>()];
    const json& view = document["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    double largest = 0.0;
    for (Index v = 0; v < body.render.vertices(); ++v) {
      float moved[3];
      std::memcpy(moved,
                  chunks.binary.data() + view["byteOffset"].get<std::size_t>() + 12 * static_cast<std::size_t>(v), 12);
      const Vec3f expected = static_cast<float>(scale) * body.render.basis.shape(v, static_cast<Index>(i));
      EXPECT_EQ(Vec3f(moved[0], moved[1], moved[2]), expected);
      largest = std::max(largest, static_cast<double>(expected.norm()));
    }
    // The nearest power of two is off by a factor of √2 at most.
    EXPECT_LE(largest, 0.1 * diagonal * 1.4143);
    EXPECT_GE(largest, 0.1 * diagonal / 1.4143);
  }
}

TEST(Asset, NormalsComeWithUpTo32ModesOnly) {
  for (const Index modes : {32, 33}) {
    const std::string bytes = asset_bytes({.bodies = {example::model(example::box("bar", modes))}, .provenance = {}});
    const json document = json::parse(glb_chunks(bytes, "test").json);
    EXPECT_EQ(document["meshes"][0]["primitives"][0]["targets"][0].contains("NORMAL"), modes <= 32);
    expect_same_bytes(asset_bytes(asset_from_bytes(bytes, "test")), bytes);
  }
}

TEST(Asset, MoreModesThanViewersTakeAreRefused) {
  const auto bytes_with = [](Index modes) {
    return asset_bytes({.bodies = {example::model(example::box("bar", modes, 1))}, .provenance = {}});
  };
  EXPECT_EQ(reading(bytes_with(256)), "accepted");
  EXPECT_THROW(bytes_with(257), InvalidArgument);
}

TEST(Asset, BodiesNeedNamesOfTheirOwn) {
  EXPECT_THROW(asset_bytes({}), InvalidArgument);
  EXPECT_THROW(asset_bytes({.bodies = {example::model(example::box("a", 1)), example::model(example::box("a", 2))},
                            .provenance = {}}),
               InvalidArgument);
}

TEST(Asset, FileNamesOfAnyBytesAreKeptAsText) {
  Asset asset = example::asset();
  asset.provenance.input = "b\xe4r.msh";  // Latin-1
  const std::string bytes = asset_bytes(asset);
  EXPECT_EQ(asset_from_bytes(bytes, "test").provenance.input, "b\xef\xbf\xbdr.msh");
  expect_same_bytes(asset_bytes(asset_from_bytes(bytes, "test")), bytes);
}

// What is not our asset ---------------------------------------------------------------------------------------------

TEST(AssetReader, AFileCutAnywhereIsRefused) {
  const std::string bytes = asset_bytes(example::asset());
  for (std::size_t size = 0; size < bytes.size(); size += size < 64 ? 1 : 97)
    EXPECT_NE(reading(bytes.substr(0, size)), "accepted") << size;
}

TEST(AssetReader, AChangedByteOfTheBinaryChunkIsRefused) {
  std::string bytes = asset_bytes(example::asset());
  const std::size_t binary = bytes.size() - glb_chunks(bytes, "test").binary.size();
  for (std::size_t i = binary; i < bytes.size(); i += 131) {
    bytes[i] = static_cast<char>(bytes[i] ^ 0x10);
    EXPECT_THAT(reading(bytes), HasSubstr("content_hash")) << i;
    bytes[i] = static_cast<char>(bytes[i] ^ 0x10);
  }
}

TEST(AssetReader, AChangedByteAnywhereIsRefusedOrChangesNothingThatIsRead) {
  const std::string bytes = asset_bytes(example::asset());
  const std::size_t binary = bytes.size() - glb_chunks(bytes, "test").binary.size();
  std::mt19937 random(7);
  int accepted = 0;
  for (int n = 0; n < testing::all_or_tenth(1500); ++n) {
    std::string changed = bytes;
    changed[random() % binary] = static_cast<char>(random());
    if (reading(changed) != "accepted") continue;
    ++accepted;
    expect_same_bytes(asset_bytes(asset_from_bytes(changed, "test")), bytes);
  }
  // Names of scenes, materials and the like, and bytes that were the same already.
  EXPECT_LT(accepted, testing::all_or_tenth(900));
}

TEST(AssetReader, AnyValueOfTheDocumentMayBeAnyOtherWithoutHarm) {
  const std::string bytes = asset_bytes(example::asset());
  const GlbChunks chunks = glb_chunks(bytes, "test");
  const json original = json::parse(chunks.json);
  std::vector<std::string> places;
  const json flat = original.flatten();
  for (const auto& [place, unused] : flat.items())
    for (std::string p = place; !p.empty(); p.erase(p.rfind('/')))
      places.push_back(p);  // the values, and what holds them
  const std::vector<json> others{nullptr,
                                 true,
                                 -1,
                                 0,
                                 1,
                                 7,
                                 255,
                                 4294967295u,
                                 18446744073709551615u,
                                 -2.5,
                                 1e308,
                                 4.9e-324,
                                 "",
                                 "free",
                                 json::array(),
                                 json::object(),
                                 json::array({1, 2, 3}),
                                 {{"LIMBER_modal", 1}}};
  std::mt19937 random(3);
  int refused = 0;
  constexpr int kTries = testing::all_or_tenth(1000);
  for (int n = 0; n < kTries; ++n) {
    json document = original;
    document[json::json_pointer(places[random() % places.size()])] = others[random() % others.size()];
    const std::string changed = glb_of(document.dump(), chunks.binary);
    if (reading(changed) == "accepted")
      expect_same_bytes(asset_bytes(asset_from_bytes(changed, "test")), bytes);
    else
      ++refused;
  }
  EXPECT_GT(refused, kTries / 2);
}

TEST(AssetReader, LayoutOfTheJsonDoesNotMatter) {
  const std::string bytes = asset_bytes(example::asset());
  const GlbChunks chunks = glb_chunks(bytes, "test");
  const std::string indented = glb_of(json::parse(chunks.json).dump(3), chunks.binary);
  EXPECT_FALSE(indented == bytes);
  expect_same_bytes(asset_bytes(asset_from_bytes(indented, "test")), bytes);
}

TEST(AssetReader, EveryNumberThatTheRuntimeUsesIsUnderTheHash) {
  for (const char* field : {"mass", "volume"})
    EXPECT_THAT(reading(with_document([&](json& d) { block_of(d, 0)[field] = 2.5; })), HasSubstr("content_hash"))
        << field;
  for (const char* field :
       {"center_of_mass", "origin_in_input", "inertia", "eigenvalues", "decays", "participation", "moments"})
    EXPECT_THAT(reading(with_document([&](json& d) { block_of(d, 0)[field][0] = 0.125; })), HasSubstr("content_hash"))
        << field;
  EXPECT_THAT(reading(with_document([](json& d) { block_of(d, 0)["mode_scales"][0] = 1024.0; })),
              HasSubstr("content_hash"));
  EXPECT_THAT(reading(with_document([](json& d) { block_of(d, 0)["motion"] = "point"; })), HasSubstr("content_hash"));
  EXPECT_THAT(reading(with_document([](json& d) { d["meshes"][0]["name"] = "rod"; })), HasSubstr("content_hash"));
  EXPECT_THAT(reading(with_document([](json& d) { d["extensions"]["LIMBER_modal"]["provenance"]["input"] = "x"; })),
              HasSubstr("content_hash"));
}

TEST(AssetReader, SkinsAreChecked) {
  const std::string place = "\"test.glb\".meshes[2].extensions.LIMBER_modal.skin";
  const auto change = [](const char* field, const json& value) {
    return reading(with_document([&](json& d) { block_of(d, 2)["skin"][field] = value; }));
  };
  EXPECT_THAT(change("version", 2), HasSubstr(place + ".version: is 2, this limber reads version 1"));
  EXPECT_THAT(change("handles", 0), HasSubstr(place + ".handles: is 0"));
  EXPECT_THAT(change("handles", 256), HasSubstr(place + ".handles: is 256"));
  EXPECT_THAT(change("handles", 5), HasSubstr(place + ".rest"));
  EXPECT_THAT(change("knees", 1), HasSubstr("knees"));
  EXPECT_NE(reading(with_document([](json& d) { block_of(d, 2).erase("skin"); })), "accepted");
}

/// The example with joints of every kind of number.
Asset joined() {
  Asset asset = example::asset();
  const Mat3 axes = to_matrix(quaternion_from_rotation_vector({0.3, -0.2, 1.1}));
  asset.joints.push_back({.b = 1, .spec = {.type = JointType::kFixed}, .patch_radius = 0.1, .collide = true});
  asset.joints.push_back({.a = 0,
                          .b = 1,
                          .spec = {.type = JointType::kCylindrical,
                                   .frame = {.origin = {0.1, 1.0 / 3.0, 0}, .axes = axes},
                                   .limits = {.rotation = {-1.0 / 3.0, kOpen}, .translation = {Interval{-0.1, 0.7}}},
                                   .pitch = 0.01},
                          .coordinates = {{.motor_velocity = -2.0, .motor_max_force = 3.0},
                                          {.drive_target = 0.1, .drive_stiffness = 5.0, .friction = 0.3}}});
  asset.joints.push_back({.a = 2,
                          .b = 0,
                          .spec = {.type = JointType::kBall,
                                   .frame = {.axes = axes},
                                   .limits = {.cone = 0.7, .euler = {Interval{-kOpen, 1.0}}}}});
  asset.apart.push_back({2, 1});
  return asset;
}

TEST(Asset, JointsAndPairsAreReadBitForBit) {
  const std::string bytes = asset_bytes(joined());
  const Asset read = asset_from_bytes(bytes, "test");
  EXPECT_EQ(read.joints, joined().joints);
  EXPECT_EQ(read.apart, joined().apart);
  expect_same_bytes(asset_bytes(read), bytes);
}

TEST(Asset, JointsOfBodiesThatAreNotThereAreRefused) {
  const auto refused = [](auto&& change) {
    Asset asset = joined();
    change(asset);
    EXPECT_THROW(asset_bytes(asset), InvalidArgument);
  };
  refused([](Asset& a) { a.joints[0].b = 3; });
  refused([](Asset& a) { a.joints[1].a = 1; });
  refused([](Asset& a) { a.joints[1].patch_radius = -1.0; });
  refused([](Asset& a) { a.joints[0].coordinates.resize(1); });
  refused([](Asset& a) { a.joints[1].coordinates[0].friction = -1.0; });
  refused([](Asset& a) { a.apart[0] = {0, 0}; });
  refused([](Asset& a) { a.apart[0] = {-1, 0}; });
}

TEST(AssetReader, JointsAreCheckedAndUnderTheHash) {
  const auto change = [&](const std::function<void(json&)>& edit) {
    const std::string bytes = asset_bytes(joined());
    json document = json::parse(glb_chunks(bytes, "test").json);
    edit(document["extensions"]["LIMBER_modal"]["machine"]);
    return reading(glb_of(document.dump(), glb_chunks(bytes, "test").binary));
  };
  EXPECT_EQ(change([](json&) {}), "accepted");
  const std::string place = "\"test.glb\".extensions.LIMBER_modal.machine";
  EXPECT_THAT(change([](json& m) { m["version"] = 2; }), HasSubstr(place + ".version: is 2"));
  EXPECT_THAT(change([](json& m) { m["joints"][1]["b"] = 3; }), HasSubstr(place + ".joints[1].b"));
  EXPECT_THAT(change([](json& m) { m["joints"][1]["b"] = 0; }), HasSubstr("another body than"));
  EXPECT_THAT(change([](json& m) { m["joints"][1]["tipe"] = "ball"; }), HasSubstr("\"type\""));
  EXPECT_THAT(change([](json& m) { m["joints"][1]["limits"]["cone"] = 1.0; }), HasSubstr("has no such limit"));
  EXPECT_THAT(change([](json& m) { m["apart"][0] = {1, 1}; }), HasSubstr(place + ".apart[0]"));
  EXPECT_THAT(change([](json& m) { m["joints"] = json::array(), m["apart"] = json::array(); }),
              HasSubstr("no such block"));
  for (const auto& edit : std::vector<std::function<void(json&)>>{
           [](json& m) { m["joints"][0]["a"] = 0; }, [](json& m) { m["joints"][0]["origin"][1] = 0.5; },
           [](json& m) { m["joints"][0]["collide"] = false; }, [](json& m) { m["joints"][1]["pitch"] = 0.02; },
           [](json& m) { m["joints"][1]["limits"]["rotation"][0] = -0.1; },
           [](json& m) { m["joints"][1]["coordinates"][1]["friction"] = 0.4; },
           [](json& m) { m["joints"][2]["limits"]["euler"][0][1] = 0.9; }, [](json& m) { m["apart"] = json::array(); }})
    EXPECT_THAT(change(edit), HasSubstr("content_hash"));
}

TEST(AssetReader, WrongCountsAndTypesNameTheirPlace) {
  const auto change = [](const char* field, const json& value) {
    return reading(with_document([&](json& d) { block_of(d, 1)[field] = value; }));
  };
  const std::string place = "\"test.glb\".meshes[1].extensions.LIMBER_modal.";
  EXPECT_THAT(change("modes", 6), HasSubstr(place + "eigenvalues"));
  EXPECT_THAT(change("modes", -1), HasSubstr(place + "modes: is -1"));
  EXPECT_THAT(change("modes", 1e300), HasSubstr(place + "modes"));
  EXPECT_THAT(change("modes", 18446744073709551615u), HasSubstr(place + "modes"));
  EXPECT_THAT(change("modes", 2000000000), HasSubstr("expected an integer from 0 to 256"));
  EXPECT_THAT(change("vertices", 2000000000), HasSubstr("expected 2000000000"));
  EXPECT_THAT(change("triangles", 1), HasSubstr("expected 3 for"));
  EXPECT_THAT(change("mass", "heavy"), HasSubstr(place + "mass: is \"heavy\", expected a finite number"));
  EXPECT_THAT(change("mass", nullptr), HasSubstr("expected a finite number"));
  EXPECT_THAT(change("motion", "loose"), HasSubstr("expected \"free\", \"point\", \"line\" or \"kinematic\""));
  EXPECT_THAT(change("mode_scales", json(std::vector<double>(5, 0.3))), HasSubstr("power of two"));
  EXPECT_THAT(change("surprise", 1), HasSubstr("\"surprise\" is unknown"));
  EXPECT_THAT(change("collision", json::array()), HasSubstr("expected an object"));
}

TEST(AssetReader, ViewsThatOverlapLeaveGapsOrEndBeyondAreRefused) {
  const auto view = [](const char* field, std::int64_t value) {
    return reading(with_document([&](json& d) { d["bufferViews"][3][field] = value; }));
  };
  EXPECT_THAT(view("byteOffset", 0), HasSubstr("where the bufferView before it ends"));
  EXPECT_THAT(view("byteLength", 8), Not(HasSubstr("accepted")));
  EXPECT_THAT(view("byteLength", 4000000000), HasSubstr("bufferViews[3]: ends at byte"));
  EXPECT_THAT(view("byteLength", -4), HasSubstr("expected an integer"));
  EXPECT_THAT(view("buffer", 1), HasSubstr("expected an integer from 0 to 0"));
  EXPECT_THAT(view("byteStride", 16), HasSubstr("\"byteStride\" is unknown"));
  EXPECT_THAT(reading(with_document([](json& d) { d["buffers"][0]["byteLength"] = 4; })),
              HasSubstr("byteLength: is 4"));
  EXPECT_THAT(reading(with_document([](json& d) { d["bufferViews"].erase(5); })), Not(HasSubstr("accepted")));
}

TEST(AssetReader, PiecesInAnotherOrderAreRefused) {
  const auto swap_targets = [](json& d) {
    json& targets = d["meshes"][0]["primitives"][0]["targets"];
    std::swap(targets[0], targets[1]);
  };
  EXPECT_THAT(reading(with_document(swap_targets)), HasSubstr("another accessor than the next one"));
  EXPECT_THAT(reading(with_document([](json& d) { d["meshes"][0]["primitives"][0]["targets"].erase(6); })),
              HasSubstr("there are 6 morph targets, expected one per mode, 7"));
  EXPECT_THAT(reading(with_document([](json& d) { d["meshes"][0]["primitives"][0]["indices"] = 999999; })),
              HasSubstr("another accessor"));
  EXPECT_THAT(reading(with_document([](json& d) { d["meshes"].erase(2); })), HasSubstr("of which its bodies use"));
}

TEST(AssetReader, NumbersThatAreWrongUnderARightHashAreRefused) {
  // Someone who writes assets of his own can put anything under a hash: the model's own checks stand behind it.
  ModalModelData d = example::box("bar", 1);
  const std::string bytes = asset_bytes({.bodies = {example::model(std::move(d))}, .provenance = {}});
  std::string binary(glb_chunks(bytes, "test").binary);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(binary.data(), &nan, 4);
  const std::string changed = glb_of(std::string(glb_chunks(bytes, "test").json), binary);
  EXPECT_THAT(reading(changed), Not(HasSubstr("accepted")));
}

TEST(AssetReader, OtherGlbFilesAreToldThatTheyAreNoAssets) {
  GlbBuilder glb;
  const int position = glb.add_vertex_vectors(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0});
  const int faces = glb.add_triangles(std::vector<Triangle>{{0, 1, 2}});
  glb.add_node({.mesh = glb.add_mesh({.position = position, .triangles = faces})});
  EXPECT_THAT(reading(glb.bytes()), HasSubstr("has no LIMBER_modal block"));
  EXPECT_THAT(reading("{\"asset\": {\"version\": \"2.0\"}}"), HasSubstr("is not a GLB file"));
  EXPECT_THAT(reading(glb_of("[]", "1234")), HasSubstr("expected an object"));
  EXPECT_THAT(reading(glb_of("{", "1234")), HasSubstr("not valid JSON"));
  EXPECT_THAT(reading(with_document([](json& d) { d["extensionsRequired"] = {"KHR_mesh_quantization"}; })),
              HasSubstr("\"extensionsRequired\" is unknown"));
  EXPECT_THAT(reading(with_document([](json& d) { d["extensions"]["LIMBER_modal"]["version"] = 2; })),
              HasSubstr("this limber reads version 1"));
}

TEST(AssetReader, HostileJsonIsRefusedWithoutHarm) {
  const std::string deep(200000, '[');
  EXPECT_NE(reading(glb_of(deep + std::string(200000, ']'), "1234")), "accepted");
  EXPECT_NE(reading(glb_of("{\"extensions\":" + deep + std::string(200000, ']') + "}", "1234")), "accepted");
  EXPECT_THAT(reading(glb_of("{\"a\":1e999}", "1234")), HasSubstr("not valid JSON"));
  EXPECT_THAT(reading(glb_of("{\"asset\":1,\"asset\":2}", "1234")), HasSubstr("stands twice"));
  EXPECT_THAT(reading(glb_of("{\"a\":\"\xff\"}", "1234")), HasSubstr("not valid JSON"));
  EXPECT_THAT(reading(with_document([&](json& d) { block_of(d, 0)["mass"] = json::array({json::array({1})}); })),
              HasSubstr("mass: is an array of 1 items"));
}

TEST(AssetReader, EveryMessageIsOneLine) {
  const std::string bytes = asset_bytes(example::asset());
  const std::size_t binary = bytes.size() - glb_chunks(bytes, "test").binary.size();
  std::mt19937 random(11);
  for (int n = 0; n < 500; ++n) {
    std::string changed = bytes;
    changed[20 + random() % (binary - 28)] = static_cast<char>(random() % 32);
    EXPECT_THAT(reading(changed), Not(HasSubstr("\n")));
  }
}

}  // namespace
}  // namespace limber
