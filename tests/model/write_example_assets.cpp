// write_example_assets FOLDER: assets for programs that are not ours to look at, and beside some of them where limber
// itself puts their vertices for given amplitudes (NAME.expected.json, see check_three.mjs).

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "example_model.h"
#include "limber/core/file.h"
#include "limber/model/asset.h"
#include "limber/model/audio_gltf.h"
#include "limber/model/morph_targets.h"

namespace limber {
namespace {

/// Amplitudes of both signs, growing smaller with the frequency; kg^½·m.
double amplitude(Index mode) { return (mode % 2 == 0 ? 0.6 : -0.8) / (1.0 + mode); }

nlohmann::json expected_in_viewers(const ModalModel& model) {
  nlohmann::json out = {{"mesh", model.name()}, {"positions", nlohmann::json::array()}};
  const Vec3 origin = model.data().origin_in_input;
  out["origin"] = {origin.x(), origin.y(), origin.z()};
  for (Index i = 0; i < model.modes(); ++i) {
    out["targets"].push_back(mode_target_name(i, model.modes(), model.frequency_hz(i)));
    out["amplitudes"].push_back(amplitude(i));
  }
  for (Index v = 0; v < model.render().vertices(); ++v) {
    Vec3 p = model.render().rest[static_cast<std::size_t>(v)].cast<double>();
    for (Index i = 0; i < model.modes(); ++i) p += amplitude(i) * model.render().basis.shape(v, i).cast<double>();
    out["positions"].push_back({p.x(), p.y(), p.z()});
  }
  return out;
}

/// The first body sounds with two modes; the others are silent.
Asset sounding(Asset asset) {
  const ModalSurface& surface = asset.bodies[0]->collision();
  SoundModes modes{.eigenvalues = {4e6, 9e7}, .decays = {2.5, 40.0}, .shapes = {}, .vertices = surface.vertices()};
  for (int k = 0; k < 2; ++k)
    for (const Vec3f& r : surface.rest) modes.shapes.insert(modes.shapes.end(), {r.x(), k == 0 ? r.y() : -r.y(), 0.5f});
  modes.contact_modulus = 7.6e10;
  asset.sounds.resize(asset.bodies.size());
  asset.sounds[0] = std::make_shared<SoundModes>(modes);
  return asset;
}

void write_examples(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  write_asset(folder / "two_bodies.glb", example::asset());
  write_asset(folder / "rigid.glb", {.bodies = {example::model(example::full_box("stone", 0))}, .provenance = {}});
  const Asset sounds = sounding(example::asset());
  write_asset(folder / "sounds.glb", sounds);
  write_file(folder / "audio.glb", audio_glb_bytes(sounds));
  for (const Index modes : {7, 64, 256}) {
    const auto model = example::model(example::box("bar", modes, 8));
    const std::string name = "bar_" + std::to_string(modes);
    write_asset(folder / (name + ".glb"), {.bodies = {model}, .provenance = {}});
    write_file(folder / (name + ".expected.json"), expected_in_viewers(*model).dump());
  }
}

}  // namespace
}  // namespace limber

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: write_example_assets FOLDER\n";
    return 2;
  }
  try {
    limber::write_examples(argv[1]);
    return 0;
  } catch (const std::exception& e) {
    std::cerr << "write_example_assets: " << e.what() << '\n';
    return 1;
  }
}
