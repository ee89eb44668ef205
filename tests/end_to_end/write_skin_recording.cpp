// write_skin_recording FOLDER: bodies with modal skins for programs that are not ours to look at: NAME.glb, a
// recording, NAME.expected.json, where limber puts its vertices at each key (see check_three_skin.mjs), and
// NAME.clips.glb.
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "limber/core/file.h"
#include "limber/dynamics/body_shape.h"
#include "limber/scene/recording.h"
#include "skinned_bar.h"

namespace limber::testing {
namespace {

Trajectory swung(const std::shared_ptr<const ModalModel>& model) {
  BodyTrack track;
  track.name = "bar";
  track.model = model;
  track.modal_skin = true;
  Trajectory out;
  out.step = out.key_interval = 0.25;
  for (int key = 0; key < 4; ++key) {
    out.times.push_back(0.25 * key);
    track.poses.push_back({quaternion_from_rotation_vector({0.1 * key, 0.2, 0.3 * key}), {1.0 * key, 2.0, 3.0}});
    track.angular_velocities.push_back(Vec3::Zero());
    for (const double z : bent(*model, 0.6 * key)) track.amplitudes.push_back(z);
  }
  out.bodies = {track};
  return out;
}

/// In the world's axes, z up.
nlohmann::json expected(const Trajectory& played) {
  nlohmann::json out = {{"mesh", "bar surface"}, {"size", kLength}, {"keys", nlohmann::json::array()}};
  const BodyTrack& body = played.bodies[0];
  const ModalSurface& surface = body.model->render();
  SkinMemory memory(*body.model->data().skin);
  for (std::size_t key = 0; key < played.times.size(); ++key) {
    const BodyShape shape(*body.model, body.amplitudes_at(key), &memory);
    std::vector<std::vector<double>> positions(static_cast<std::size_t>(surface.vertices()));
    for (std::size_t t = 0; t < surface.triangles.size(); ++t)
      for (std::size_t c = 0; c < 3; ++c) {
        SurfacePoint at{
            .surface = SurfacePoint::Surface::kRender, .triangle = static_cast<Index>(t), .weight = {0.0, 0.0, 0.0}};
        at.weight[c] = 1.0;
        const Vec3 p = body.poses[key] * shape.position(at);
        positions[static_cast<std::size_t>(surface.triangles[t][c])] = {p.x(), p.y(), p.z()};
      }
    out["keys"].push_back({{"time", played.times[key]}, {"positions", positions}});
  }
  return out;
}

void write(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  for (const bool held : {true, false}) {
    const auto model = bar({.held = held});
    const std::string name = held ? "held" : "free";
    const Trajectory played = swung(model);
    write_file(folder / (name + ".glb"), make_recording(played).glb);
    write_file(folder / (name + ".expected.json"), expected(played).dump());
    write_file(folder / (name + ".clips.glb"), make_mode_clips({&model, 1}));
  }
}

}  // namespace
}  // namespace limber::testing

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fputs("usage: write_skin_recording FOLDER\n", stderr);
    return 2;
  }
  limber::testing::write(argv[1]);
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "write_skin_recording: %s\n", e.what());
  return 1;
}
