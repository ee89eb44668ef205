// 15_picture_of_poses: what do joints change when a model is pulled?
//   bake:  make_assembly lamp --out lamp.obj
//   run:   15_picture_of_poses lamp.obj lamp.joints.json && povray bee.pov +W1200 +H500 +A
//          povray lamp.pov +W1500 +H500 +A
//   see:   a bee pulled by the tip of its abdomen, with joints and as one soft body: without them wings and legs go along; a
//          lamp whose post hardly turns, pulled sideways, as one soft body, of rigid parts, and with two soft arms (the
//          red ball is where the hand is)
//   next:  docs/posing.md
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <numeric>

#include "limber/posing/posing_session.h"
#include "povray.h"

namespace {

using limber::Index;
using limber::Vec3;

/// Adds a part: a sphere of triangles, stretched to half axes along the columns of `axes`, which are orthogonal.
void add_part(limber::JointedModel& model, const std::string& name, const Vec3& centre, const limber::Mat3& axes) {
  constexpr int kRings = 20, kSides = 28;
  limber::SurfaceMesh& mesh = model.surface;
  const auto first = static_cast<Index>(mesh.vertices.size());
  const auto vertex = [&](int ring, int side) {
    return first + (ring == 0 ? 0 : ring == kRings ? 1 : 2 + (ring - 1) * kSides + side % kSides);
  };
  mesh.vertices.push_back(centre + axes.col(2));
  mesh.vertices.push_back(centre - axes.col(2));
  for (int r = 1; r < kRings; ++r)
    for (int s = 0; s < kSides; ++s) {
      const double polar = M_PI * r / kRings, turn = 2.0 * M_PI * s / kSides;
      mesh.vertices.push_back(
          centre + axes * Vec3(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn), std::cos(polar)));
    }
  limber::ModelPart part{name, {}};
  for (int r = 0; r < kRings; ++r)
    for (int s = 0; s < kSides; ++s)
      for (const limber::Triangle& t : {limber::Triangle{vertex(r, s), vertex(r + 1, s), vertex(r + 1, s + 1)},
                                        limber::Triangle{vertex(r, s), vertex(r + 1, s + 1), vertex(r, s + 1)}}) {
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
        part.triangles.push_back(static_cast<Index>(mesh.triangles.size()));
        mesh.triangles.push_back(t);
      }
  model.parts.push_back(std::move(part));
}

/// Half axes: along `way`, across it in the plane of `flat`, and along `flat`.
limber::Mat3 half_axes(const Vec3& way, const Vec3& flat, const Vec3& half) {
  limber::Mat3 out;
  const Vec3 x = way.normalized(), z = x.cross(flat).cross(x).normalized();
  out << half[0] * x, half[1] * z.cross(x), half[2] * z;
  return out;
}

/// A limb from one point to another.
void add_limb(limber::JointedModel& model, const std::string& name, const Vec3& from, const Vec3& to, double radius) {
  add_part(model, name, 0.5 * (from + to),
           half_axes(to - from, Vec3(0.3, 0.2, 1.0), Vec3(0.5 * (to - from).norm() + 0.5 * radius, radius, radius)));
}

void add_ball_joint(limber::JointedModel& model, Index a, Index b, const Vec3& at) {
  limber::ModelJoint joint{.a = a, .b = b};
  joint.joint.type = limber::JointType::kBall;
  joint.joint.frame.origin = at;
  model.joints.push_back(joint);
}

/// x is forward, z up.
limber::JointedModel bee() {
  limber::JointedModel out;
  const Vec3 z = Vec3::UnitZ();
  add_part(out, "thorax", {0.2, 0, 0.05}, half_axes(Vec3(1, 0, 0), z, {0.24, 0.2, 0.19}));
  add_part(out, "head", {0.55, 0, 0.02}, half_axes(Vec3(1, 0, 0), z, {0.15, 0.17, 0.15}));
  add_part(out, "abdomen", {-0.42, 0, -0.02}, half_axes(Vec3(1, 0, 0.06), z, {0.42, 0.22, 0.2}));
  add_ball_joint(out, 0, 1, {0.42, 0, 0.03});
  add_ball_joint(out, 0, 2, {-0.02, 0, 0.02});
  for (const double side : {-1.0, 1.0}) {
    for (const double back : {0.25, 0.95}) {
      const Vec3 root(0.22 - 0.1 * back, 0.12 * side, 0.21), way(-back, side, 0.25);
      const double half = back < 0.5 ? 0.34 : 0.28;
      add_part(out, "wing", root + half * way.normalized(), half_axes(way, z, {half, 0.11, 0.012}));
      add_ball_joint(out, 0, static_cast<Index>(out.parts.size()) - 1, root);
    }
    for (const double along : {0.5, 0.0, -0.5}) {
      const Vec3 hip(0.2 + 0.2 * along, 0.13 * side, -0.06), knee = hip + Vec3(0.28 * along, 0.26 * side, 0.02),
                                                             foot = knee + Vec3(0.2 * along, 0.1 * side, -0.36);
      add_limb(out, "thigh", hip, knee, 0.035);
      add_ball_joint(out, 0, static_cast<Index>(out.parts.size()) - 1, hip);
      add_limb(out, "shin", knee, foot, 0.028);
      add_ball_joint(out, static_cast<Index>(out.parts.size()) - 2, static_cast<Index>(out.parts.size()) - 1, knee);
    }
  }
  for (std::size_t p = 0; p < out.parts.size(); ++p) out.parts[p].name += " " + std::to_string(p);
  return out;
}

/// All triangles in one part, without joints.
limber::JointedModel as_one(const limber::JointedModel& model) {
  limber::JointedModel out;
  out.surface = model.surface;
  out.parts = {{"all", std::vector<Index>(model.surface.triangles.size())}};
  std::iota(out.parts[0].triangles.begin(), out.parts[0].triangles.end(), 0);
  return out;
}

const char* const kColours[] = {"<0.90,0.62,0.13>", "<0.25,0.45,0.68>", "<0.80,0.34,0.24>", "<0.36,0.60,0.42>",
                                "<0.55,0.42,0.65>", "<0.45,0.68,0.78>", "<0.75,0.70,0.55>"};

/// The posed surface, part by part in the colours of `parts`, moved by `by`; and a ball where the hand is.
std::string drawn(const limber::PosingSession& session, const limber::JointedModel& parts, const Vec3& hand,
                  double ball, const Vec3& by) {
  std::vector<Vec3> p(session.model().surface.vertices.size()), n(p.size());
  session.reconstruct(p, n);
  std::string text;
  for (std::size_t i = 0; i < parts.parts.size(); ++i) {
    std::vector<Index> own(p.size(), -1);
    std::vector<float> places, normals;
    std::string faces;
    for (const Index t : parts.parts[i].triangles) {
      std::array<Index, 3> corner{};
      for (std::size_t k = 0; k < 3; ++k) {
        const auto v = static_cast<std::size_t>(parts.surface.triangles[static_cast<std::size_t>(t)][k]);
        if (own[v] < 0) {
          own[v] = static_cast<Index>(places.size() / 3);
          for (int c = 0; c < 3; ++c) {
            places.push_back(static_cast<float>(p[v][c] + by[c]));
            normals.push_back(static_cast<float>(n[v][c]));
          }
        }
        corner[k] = own[v];
      }
      add(faces, ",\n<%d,%d,%d>", corner[0], corner[1], corner[2]);
    }
    text += "mesh2 {\n";
    add_vectors(text, "vertex_vectors", places);
    add_vectors(text, "normal_vectors", normals);
    add(text, "  face_indices { %zu", parts.parts[i].triangles.size());
    text += faces + " }\n";
    add(text, "  pigment { rgb %s } finish { ambient 0.12 diffuse 0.75 specular 0.15 roughness 0.04 } }\n",
        kColours[std::min(i, std::size(kColours) - 1)]);
  }
  add(text, "sphere { <%.6g,%.6g,%.6g>, %.6g pigment { rgb <0.9,0.05,0.05> } finish { ambient 0.2 } }\n",
      hand.x() + by.x(), hand.y() + by.y(), hand.z() + by.z(), ball);
  return text;
}

void write_scene(const char* path, const std::string& models, const Vec3& from, const Vec3& to, double width,
                 double aspect, double floor, double size) {
  std::string text = povray_stage(size) + models;
  add(text, "plane { z, %.6g pigment { rgb <0.86,0.87,0.86> } }\n", floor);
  add(text, "camera { orthographic location <%.6g,%.6g,%.6g> sky z up %.6g * z right ", from.x(), from.y(), from.z(),
      width / aspect);
  add(text, "%.6g * x look_at <%.6g,%.6g,%.6g> }\n", width, to.x(), to.y(), to.z());
  std::ofstream(path) << text;
}

double moved(const limber::PosingSession& session, const limber::JointedModel& parts, std::size_t from_part) {
  std::vector<Vec3> p(parts.surface.vertices.size());
  session.reconstruct(p);
  double out = 0.0;
  for (std::size_t i = from_part; i < parts.parts.size(); ++i)
    for (const Index t : parts.parts[i].triangles)
      for (const Index v : parts.surface.triangles[static_cast<std::size_t>(t)])
        out = std::max(out,
                       (p[static_cast<std::size_t>(v)] - parts.surface.vertices[static_cast<std::size_t>(v)]).norm());
  return out;
}

void bees() {
  const limber::JointedModel model = bee();
  const Vec3 tip(-0.84, 0.0, -0.045), hand(-0.42, 0.0, 0.7);
  limber::PosingSession jointed(model), grid(as_one(model));
  jointed.set_pinned(0, true);
  jointed.set_part(2, {.cells = limber::Subdivision::kUniform, .cell_size = 0.1});
  jointed.move_handle(jointed.add_handle(2, tip), hand);
  const limber::PoseResult with = jointed.solve();

  grid.set_part(0, {.cells = limber::Subdivision::kUniform, .cell_size = 0.1});
  for (const Vec3& way : {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, -1, 0), Vec3(0, 0, 1), Vec3(0, 0, -1)})
    grid.add_handle(0, Vec3(0.3, 0, 0.05) + 0.18 * way);  // the thorax, held
  grid.move_handle(grid.add_handle(0, tip), hand);
  const limber::PoseResult without = grid.solve();

  const Vec3 right(0.87, 0.23, 0.0), left = -right;  // across the view
  write_scene("bee.pov", drawn(jointed, model, hand, 0.035, left) + drawn(grid, model, hand, 0.035, right),
              {1.6, -6, 3.2}, {0.02, 0, 0.08}, 3.8, 2.4, -0.5, 1.0);
  std::printf(
      "bee.pov: wings and legs move by %.4f with joints (%zu cells, %d iterations), by %.4f without (%zu, %d)\n",
      moved(jointed, model, 3), jointed.cells().size(), with.iterations, moved(grid, model, 3), grid.cells().size(),
      without.iterations);
}

void lamps(const char* file, const char* joints) {
  limber::Warnings warnings;
  limber::JointedModel model =
      limber::jointed_model(limber::read_grouped_surface(file, warnings), limber::read_joints(joints), joints);
  // The post hardly turns on the base: sideways the shade can go only as far as the arms bend.
  model.joints.front().joint.limits.rotation = {-0.15, 0.15};
  const Index base = model.part_named("base"), shade = model.part_named("shade");
  Eigen::AlignedBox3d box, foot;
  for (const Vec3& p : model.surface.vertices) box.extend(p);
  const double size = box.diagonal().norm();
  Vec3 grip = box.max();
  for (const Index t : model.parts[static_cast<std::size_t>(shade)].triangles)
    for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
      if (const Vec3& p = model.surface.vertices[static_cast<std::size_t>(v)];
          p.z() - 0.1 * p.x() < grip.z() - 0.1 * grip.x())
        grip = p;
  for (const Index t : model.parts[static_cast<std::size_t>(base)].triangles)
    for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
      foot.extend(model.surface.vertices[static_cast<std::size_t>(v)]);
  const Vec3 hand = grip + size * Vec3(0.0, -0.5, 0.1);

  std::string text;
  for (int setting = 0; setting < 3; ++setting) {
    limber::PosingSession lamp(setting == 0 ? as_one(model) : model);
    if (setting == 0) {
      lamp.set_part(0, {.cells = limber::Subdivision::kUniform, .cell_size = 0.06 * size});
      for (const Index t : model.parts[static_cast<std::size_t>(base)].triangles) {
        const Vec3& p =
            model.surface.vertices[static_cast<std::size_t>(model.surface.triangles[static_cast<std::size_t>(t)][0])];
        if (p.z() < foot.min().z() + 1e-6 && t % 7 == 0) lamp.add_handle(0, p);
      }
    } else {
      lamp.set_pinned(base, true);
    }
    if (setting == 2)
      for (const char* arm : {"arm 1", "arm 2"})
        lamp.set_part(lamp.model().part_named(arm), {.cells = limber::Subdivision::kUniform, .cell_size = 0.03 * size});
    const limber::PoseHandle handle = lamp.add_handle(setting == 0 ? 0 : shade, grip);
    lamp.move_handle(handle, hand);
    const limber::PoseResult result = lamp.solve();
    std::printf("lamp.pov: %-15s %4zu cells, %3d iterations, hand off by %.4f\n",
                setting == 0   ? "one soft body"
                : setting == 1 ? "rigid parts"
                               : "two soft arms",
                lamp.cells().size(), result.iterations, (lamp.handle_point(handle) - hand).norm() / size);
    text += drawn(lamp, model, hand, 0.02 * size, 1.05 * size * (setting - 1) * Vec3(0.707, 0.707, 0));
  }
  const Vec3 middle = box.center() + size * Vec3(0, -0.1, 0.02);
  write_scene("lamp.pov", text, middle + size * Vec3(4, -4, 1.2), middle, 3.3 * size, 3.0, box.min().z(), size);
}

}  // namespace

int main(int argc, char** argv) try {
  bees();
  lamps(argc > 1 ? argv[1] : "lamp.obj", argc > 2 ? argv[2] : "lamp.joints.json");
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "15_picture_of_poses: %s\n", e.what());
  return 1;
}
