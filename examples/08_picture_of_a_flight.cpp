// 08_picture_of_a_flight: how do deformed vertices get out of limber and into a renderer?
//   run:   08_picture_of_a_flight bunny.glb flight.pov && povray flight.pov +W1600 +H800 +A
//   see:   the body at six instants of one flight, struck at its highest point; colour is the distance from rest
//   next:  09_picture_of_a_scene, a whole scene file in pictures
#include <algorithm>
#include <cstdio>
#include <numbers>
#include <string>

#include "limber/core/file.h"
#include "limber/engine/world.h"
#include "limber/model/asset.h"
#include "povray.h"

namespace {

using limber::Index;
using limber::Vec3;

constexpr int kInstants = 6, kColours = 32;
constexpr double kStep = 1.0 / 1000.0, kFlight = 0.5;  // s
constexpr double kBend = 0.2;                          // largest displacement wanted, as a part of the body's size

/// A world with one body that has just been thrown and struck.
struct Flight {
  limber::World world{{.step = kStep}};
  limber::BodyId body;
};

double size_of(const limber::ModalModel& model) {
  limber::Vec3f low = model.render().rest.front(), high = low;
  for (const auto& p : model.render().rest) low = low.cwiseMin(p), high = high.cwiseMax(p);
  return static_cast<double>((high - low).norm());
}

/// The corner of a triangle that lies highest; the input's y axis points up.
limber::SurfacePoint highest_point(const limber::ModalSurface& surface) {
  limber::SurfacePoint highest{.surface = limber::SurfacePoint::Surface::kRender};
  float y = -1e30f;
  for (std::size_t t = 0; t < surface.triangles.size(); ++t)
    for (std::size_t i = 0; i < 3; ++i) {
      const float at = surface.rest[static_cast<std::size_t>(surface.triangles[t][i])].y();
      if (at <= y) continue;
      y = at;
      highest.triangle = static_cast<Index>(t);
      highest.weight = {0.0, 0.0, 0.0};
      highest.weight[i] = 1.0;
    }
  return highest;
}

/// The throw is chosen so that, strike included, the centre of mass flies from side to side across 1.25 sizes an
/// instant.
Flight launch(const std::shared_ptr<const limber::ModalModel>& model, const Vec3& strike) {
  const double across = size_of(*model) * (kInstants - 1);
  const Vec3 velocity(across / kFlight, 0.0, 0.5 * 9.80665 * kFlight);
  const limber::Quaternion upright = limber::quaternion_from_rotation_vector({0.5 * std::numbers::pi, 0.0, 0.0});
  Flight flight;
  flight.body = flight.world.add_body(model, {.pose = {.q = upright, .p = {-0.5 * across, 0.0, 0.0}},
                                              .velocity = velocity - strike / model->data().mass,
                                              .angular_velocity = Vec3(0.0, 2.0, 1.5)});
  flight.world.apply_impulse(flight.body, highest_point(model->render()), strike);
  return flight;
}

/// One instant: what limber gives for drawing, and how far each vertex is from rest.
struct Instant {
  std::vector<float> positions, normals;
  std::vector<double> displacement;
};

Instant look(const Flight& flight) {
  const auto& rest = flight.world.model(flight.body).render().rest;
  Instant now{std::vector<float>(3 * rest.size()), std::vector<float>(3 * rest.size()), {}};
  flight.world.reconstruct(flight.body, now.positions, now.normals);
  const limber::RigidTransform X_BW = flight.world.body(flight.body).pose.inverse();
  for (std::size_t v = 0; v < rest.size(); ++v) {
    const Vec3 p_WP(now.positions[3 * v], now.positions[3 * v + 1], now.positions[3 * v + 2]);
    now.displacement.push_back((X_BW * p_WP - rest[v].cast<double>()).norm());
  }
  return now;
}

std::vector<Instant> fly(Flight flight) {
  std::vector<Instant> instants;
  const int steps = static_cast<int>(kFlight / kStep);
  for (int n = 1; n <= steps; ++n) {
    flight.world.step();
    if (n * (kInstants - 1) / steps != (n - 1) * (kInstants - 1) / steps || n == 1) instants.push_back(look(flight));
  }
  return instants;
}

double largest_displacement(const std::vector<Instant>& instants) {
  double largest = 0.0;
  for (const Instant& i : instants)
    largest = std::max(largest, *std::max_element(i.displacement.begin(), i.displacement.end()));
  return largest;
}

void add_mesh(std::string& text, const Instant& instant, const std::vector<limber::Triangle>& triangles, double most) {
  text += "mesh2 {\n";
  add_vectors(text, "vertex_vectors", instant.positions);
  add_vectors(text, "normal_vectors", instant.normals);
  add(text, "  texture_list { %d", kColours);
  for (int c = 0; c < kColours; ++c) add(text, ", texture { Shade(%.4f) }", static_cast<double>(c) / (kColours - 1));
  add(text, " }\n  face_indices { %zu", triangles.size());
  const auto colour = [&](Index v) {
    return static_cast<int>(std::min(instant.displacement[static_cast<std::size_t>(v)] / most, 1.0) * (kColours - 1));
  };
  for (const auto& [a, b, c] : triangles) add(text, ",\n<%d,%d,%d>,%d,%d,%d", a, b, c, colour(a), colour(b), colour(c));
  text += " }\n}\n";
}

/// Camera, lights and ground for a row of bodies of this size.
std::string stage(double size) {
  return povray_stage(size) + R"(camera {
  perspective sky z right <-2, 0, 0> up <0, 1, 0> angle 36
  location <0, -9.5, 2.4> * Size look_at <0, 0, 0.45> * Size
}
plane { z, -0.9 * Size pigment { rgb <0.87, 0.89, 0.92> } finish { diffuse 0.6 ambient 0.3 } }
#macro Shade(s)
  pigment { rgb (1 - s) * <0.86, 0.80, 0.70> + s * <0.80, 0.14, 0.08> }
  finish { diffuse 0.75 ambient 0.14 specular 0.25 roughness 0.03 }
#end
)";
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::fputs("usage: 08_picture_of_a_flight ASSET.glb OUT.pov\n", stderr);
    return 2;
  }
  const auto model = limber::read_asset(argv[1]).bodies.at(0);
  // Modes are linear: one flight tells how hard to strike for the bend that is wanted.
  const Vec3 trial = Vec3(-1e-3, 0.0, -1e-3) * model->data().mass;
  const double bend = kBend * size_of(*model);
  const double harder = bend / largest_displacement(fly(launch(model, trial)));
  const auto instants = fly(launch(model, harder * trial));

  std::string text = stage(size_of(*model));
  for (const Instant& instant : instants) add_mesh(text, instant, model->render().triangles, 0.6 * bend);
  limber::write_file(argv[2], text);
  std::printf("%s: %zu instants of %d vertices, struck with %.3g N s\n", argv[2], instants.size(),
              model->render().vertices(), (harder * trial).norm());
} catch (const std::exception& e) {
  std::fprintf(stderr, "08_picture_of_a_flight: %s\n", e.what());
  return 1;
}
