// make_scene FOLDER: small scenes, one of a bar that one hears with samples of a blow on it, and a model with joints to
// pose, for the page's tests in a browser. Names would be markup, if a page took them for that.
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "block_model.h"
#include "limber/core/file.h"
#include "limber/sound/radiation.h"
#include "limber/sound/synthesizer.h"

namespace {

/// Two bars end to end along x, 1 × 0.2 × 0.2, faces of each with 4 × 1 quads along it.
std::string bars() {
  std::string text;
  int first = 1;
  for (const double start : {0.0, 1.02}) {
    for (int i = 0; i <= 4; ++i)
      for (const auto& [y, z] : std::vector<std::array<double, 2>>{{0.0, 0.0}, {0.2, 0.0}, {0.2, 0.2}, {0.0, 0.2}})
        text += "v " + std::to_string(start + 0.25 * i) + " " + std::to_string(y) + " " + std::to_string(z) + "\n";
    const auto quad = [&](int a, int b, int c, int d) {
      text += "f";
      for (const int v : {a, b, c, d}) text += " " + std::to_string(first + v);
      text += "\n";
    };
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 4; ++k) quad(4 * i + k, 4 * i + (k + 1) % 4, 4 * i + 4 + (k + 1) % 4, 4 * i + 4 + k);
    quad(3, 2, 1, 0);
    quad(16, 17, 18, 19);
    first += 20;
  }
  return text;
}

/// Bending of a free bar of steel, 8 by 1 by ¼ inch [Euler and Bernoulli]: ω = β² h √(E/12ρ), cos βL cosh βL = 1.
std::shared_ptr<const limber::SoundModes> modes_of_a_bar(const limber::ModalSurface& surface) {
  auto modes = std::make_shared<limber::SoundModes>();
  modes->vertices = surface.vertices();
  limber::Index number = 0;
  for (const double beta_length : {4.730041, 7.853205, 10.995608}) {
    const double beta = beta_length / 0.2032, omega = beta * beta * 0.00635 * std::sqrt(200e9 / (12.0 * 7850.0));
    modes->eigenvalues.push_back(omega * omega);
    modes->decays.push_back(0.5 * 2e-4 * omega);
    for (const limber::Vec3f& r : surface.rest)
      for (const double w : limber::testing::block_shape(r.cast<double>(), number))
        modes->shapes.push_back(static_cast<float>(w));
    ++number;
  }
  return modes;
}

/// A blow as the page's synthesizer takes it, and samples of it by this compiler.
std::string struck(const limber::SoundModes& modes, const limber::ModalSurface& surface) {
  constexpr double kRate = 48000.0;
  const std::vector<double> blow = {0, 0, 1, 4, 0.5, 0.25, 0.25, 0.01, -0.3, 0.02, 1e-3, 0.0131, 0.5, 0.25};
  limber::Synthesizer synthesizer({.sample_rate = kRate, .channels = 2});
  synthesizer.add_body(std::make_shared<limber::ModalSound>(
      modes, limber::monopole_gains(modes, surface.rest, surface.triangles), kRate));
  synthesizer.set_gains(0, std::vector<double>{blow[12], blow[13]});
  synthesizer.strike({.at = {.vertices = {0, 1, 4}, .weights = {blow[4], blow[5], blow[6]}},
                      .impulse = {blow[7], blow[8], blow[9]},
                      .contact_time = blow[10],
                      .delay = blow[11]});
  std::vector<float> samples(2 * 8192);
  synthesizer.render(samples);
  return nlohmann::json{{"rate", kRate}, {"blow", blow}, {"samples", samples}}.dump();
}

void write_sounding_scene(const std::filesystem::path& folder) {
  limber::Asset asset = limber::testing::block_asset(2);
  const limber::ModalSurface& surface = asset.bodies[0]->collision();
  asset.sounds = {modes_of_a_bar(surface)};
  limber::write_asset(folder / "bar.glb", asset);
  limber::write_file(folder / "struck.json", struck(*asset.sounds[0], surface));
  limber::write_file(folder / "sound.json", R"({"step": 0.016666666666666666, "duration": 60, "gravity": [0, 0, 0],
    "assets": {"bar": "bar.glb"}, "bodies": [{"name": "bar", "asset": "bar", "position": [0, 0, 1.2]}]})");
}

/// A post that stands and a block hinged to it at its side, at the height of its middle.
limber::Asset machine() {
  limber::ModalModelData post = limber::testing::block_data(2, "<b>post</b>"),
                         arm = limber::testing::block_data(3, "arm");
  post.origin_in_input = limber::Vec3::Zero(), arm.origin_in_input = {2.1, 0, 0};
  limber::Asset asset;
  for (limber::ModalModelData* data : {&post, &arm})
    asset.bodies.push_back(std::make_shared<const limber::ModalModel>(std::move(*data)));
  limber::JointSpec hinge{.type = limber::JointType::kRevolute, .frame = {.origin = {1.05, 0, 0.5}}};
  hinge.frame.axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;  // about y
  hinge.limits.rotation = {-1.5, 1.0};
  asset.joints = {{.a = 0, .b = 1, .spec = hinge},
                  {.b = 0, .spec = {.type = limber::JointType::kFixed}, .patch_radius = 2.0}};
  return asset;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  limber::ModalModelData data = limber::testing::block_data(4, "<img src=x onerror=alert(1)>");
  limber::write_asset(folder / "block.glb",
                      {.bodies = {std::make_shared<const limber::ModalModel>(std::move(data))}, .provenance = {}});
  limber::write_asset(folder / "machine.glb", machine());
  limber::write_file(folder / "markup.json", R"({"step": 0.016666666666666666, "duration": 60, "contact": {},
    "assets": {"</script>": "block.glb"},
    "statics": [{"name": "<b>ground</b>", "shape": {"half_space": {}}},
                {"name": "ball", "shape": {"sphere": {"radius": 0.6}}, "position": [0, 1.5, 0.6]}],
    "sensors": [{"name": "<b>gate</b>", "shape": {"box": {"half_extents": [1.5, 1.5, 0.3]}}, "position": [0, 0, 0.31]},
                {"name": "high", "shape": {"sphere": {"radius": 0.5}}, "position": [-3, 0, 3]}],
    "bodies": [{"name": "</script><script>alert(2)</script>", "asset": "</script>", "position": [0, 0, 1.2]},
               {"name": "b", "asset": "</script>", "position": [0, 0.4, 2.6], "angular_velocity": [0.5, 0, 0.3]},
               {"name": "swings", "asset": "</script>", "position": [3.2, 0, 2.2]}],
    "joints": [{"b": "swings", "type": "revolute", "origin": [2.2, 0, 2.7], "axis": [0, 1, 0],
                "limits": {"rotation": [-1, 1]}}]})");
  write_sounding_scene(folder);
  limber::write_file(folder / "bars.obj", bars());
  limber::write_file(folder / "bars.joints.json", R"({"components": [{"name": "<b>base</b>", "faces": [[0, 18]]},
      {"name": "arm", "faces": [[18, 18]]}],
    "joints": [{"a": 0, "b": 1, "type": "revolute", "origin": [1.01, 0.1, 0.1], "axis": [0, 1, 0],
                "limits": {"rotation": [-1, 1]}}]})");
}
