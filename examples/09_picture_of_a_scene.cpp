// 09_picture_of_a_scene: how is a scene file played, and what did its bodies look like at some instants?
//   run:   09_picture_of_a_scene falling_bunnies.json fall.pov 0.2 0.5 4 && povray fall.pov +W1800 +H600 +A
//   see:   the scene at each time in seconds, side by side: what stands in grey, each model in a colour of its own
//   next:  10_joints_from_a_mesh; the header to read, scene/include/limber/scene/run.h
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>

#include "limber/collision/shape_surface.h"
#include "limber/core/file.h"
#include "limber/dynamics/reconstruct.h"
#include "limber/model/morph_targets.h"
#include "limber/scene/run.h"
#include "povray.h"

namespace {

using limber::Vec3;

constexpr double kApart = 1.0;  // from one instant's middle to the next one's, in sizes of the scene
constexpr const char* kColours[] = {"<0.80, 0.42, 0.15>", "<0.15, 0.38, 0.62>", "<0.28, 0.52, 0.22>",
                                    "<0.62, 0.18, 0.18>", "<0.42, 0.28, 0.55>"};

/// What bodies take up at the start, and a camera is set up for: everything that moves, and down to the ground.
struct View {
  Vec3 middle = Vec3::Zero();
  double size = 1.0;
};

View view_of(const limber::Trajectory& played) {
  Vec3 low = played.bodies.front().poses.front().p, high = low;
  double reach = 0.0;
  for (const limber::BodyTrack& body : played.bodies) {
    low = low.cwiseMin(body.poses.front().p), high = high.cwiseMax(body.poses.front().p);
    for (const auto& p : body.model->render().rest) reach = std::max(reach, static_cast<double>(p.norm()));
  }
  low.z() = 0.0;
  return {0.5 * (low + high), (high - low).norm() + 2.0 * reach};
}

std::size_t key_at(const limber::Trajectory& played, double seconds) {
  const auto after = std::lower_bound(played.times.begin(), played.times.end(), seconds - 1e-9);
  return std::min<std::size_t>(static_cast<std::size_t>(after - played.times.begin()), played.times.size() - 1);
}

/// Vertices as they are at a key, by the body's modes or its modal skin, the whole shifted.
std::vector<float> vertices_at(const limber::BodyTrack& body, std::size_t key, const Vec3& shift) {
  const limber::ModalModel& model = *body.model;
  const auto z = body.amplitudes_at(key);
  std::vector<float> xyz(3 * static_cast<std::size_t>(model.render().vertices()));
  limber::RigidTransform X = body.poses[key];
  X.p += shift;
  limber::ReconstructionTarget target{.X_OB = X, .amplitudes = z.data(), .positions = xyz.data()};
  if (!body.modal_skin) {
    limber::reconstruct(model.render(), {&target, 1});
    return xyz;
  }
  limber::SkinPose skin(*model.data().skin);
  skin.set(z);
  target.skin = &skin;
  limber::reconstruct(model.render(), limber::SkinTiles(model.data().skin->render), {&target, 1});
  return xyz;
}

void add_mesh(std::string& text, const std::vector<float>& positions, const std::vector<limber::Triangle>& triangles,
              bool smooth, const char* colour) {
  text += "mesh2 {\n";
  add_vectors(text, "vertex_vectors", positions);
  if (smooth) add_vectors(text, "normal_vectors", limber::unit_normals(positions, triangles));
  add(text, "  face_indices { %zu", triangles.size());
  for (const auto& [a, b, c] : triangles) add(text, ",\n<%d,%d,%d>", a, b, c);
  add(text, " }\n  pigment { rgb %s } finish { diffuse 0.75 ambient 0.14 specular 0.2 roughness 0.04 }\n}\n", colour);
}

void add_instant(std::string& text, const limber::Trajectory& played, std::size_t key, const Vec3& shift) {
  std::map<const limber::ModalModel*, std::size_t> colours;
  for (const limber::BodyTrack& body : played.bodies) {
    const std::size_t colour = colours.try_emplace(body.model.get(), colours.size()).first->second;
    add_mesh(text, vertices_at(body, key, shift), body.model->render().triangles, true,
             kColours[colour % std::size(kColours)]);
  }
  for (const limber::StaticShape& s : played.statics) {
    if (std::holds_alternative<limber::HalfSpace>(*s.shape)) continue;  // one plane for all instants
    const limber::TriangleMesh surface = limber::surface_of(*s.shape, Vec3::Zero(), 1.0);
    std::vector<float> xyz;
    for (const Vec3& r : surface.vertices)
      for (int a = 0; a < 3; ++a) xyz.push_back(static_cast<float>((s.pose * r + shift)[a]));
    add_mesh(text, xyz, surface.triangles, false, "<0.62, 0.64, 0.67>");
  }
}

void add_planes(std::string& text, const limber::Trajectory& played) {
  for (const limber::StaticShape& s : played.statics)
    if (const auto* half = std::get_if<limber::HalfSpace>(s.shape.get())) {
      const Vec3 n = s.pose.q * half->normal;
      add(text,
          "plane { <%.6g,%.6g,%.6g>, %.6g pigment { rgb <0.87, 0.89, 0.92> } finish { diffuse 0.6 ambient 0.3 } }\n",
          n.x(), n.y(), n.z(), half->offset + n.dot(s.pose.p));
    }
}

/// A camera for a row of instants, `across` wide.
std::string camera(const View& view, std::size_t instants) {
  std::string text;
  const double across = kApart * view.size * static_cast<double>(instants);
  add(text, "camera {\n  perspective sky z right <%.6g, 0, 0> up <0, 1, 0> angle 40\n", -static_cast<double>(instants));
  add(text, "  location <0, %.6g, %.6g> look_at <0, 0, %.6g>\n}\n", -1.35 * across, 0.42 * across, view.middle.z());
  return text;
}

}  // namespace

int main(int argc, char** argv) try {
  std::vector<double> seconds;
  for (int i = 3; i < argc; ++i) seconds.push_back(std::strtod(argv[i], nullptr));
  if (seconds.empty()) {
    std::fputs("usage: 09_picture_of_a_scene SCENE.json OUT.pov SECONDS…\n", stderr);
    return 2;
  }
  const limber::Scene scene = limber::read_scene(argv[1]);
  const limber::Trajectory played = limber::run_scene(scene, limber::load_models(scene)).trajectory;

  const View view = view_of(played);
  std::string text = povray_stage(view.size) + camera(view, seconds.size());
  add_planes(text, played);
  for (std::size_t i = 0; i < seconds.size(); ++i) {
    const double place = kApart * view.size * (static_cast<double>(i) - 0.5 * static_cast<double>(seconds.size() - 1));
    add_instant(text, played, key_at(played, seconds[i]), {place - view.middle.x(), -view.middle.y(), 0.0});
  }
  limber::write_file(argv[2], text);
  std::printf("%s: %zu instants of %zu bodies\n", argv[2], seconds.size(), played.bodies.size());
} catch (const std::exception& e) {
  std::fprintf(stderr, "09_picture_of_a_scene: %s\n", e.what());
  return 1;
}
