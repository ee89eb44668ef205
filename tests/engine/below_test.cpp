// Bodies that are wholly below a terrain come up through it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "asked.h"
#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber::testing {
namespace {

constexpr Index kPosts = 31;
constexpr double kSpacing = 0.1, kMiddle = 0.5 * kSpacing * (kPosts - 1);

/// A dale with hills in it, from which nothing rolls away.
double height(double x, double y) {
  const double u = x - kMiddle, v = y - kMiddle;
  return 0.05 * std::sin(5.0 * x) * std::cos(4.0 * y) + 0.3 * (u * u + v * v);
}

HeightField field() {
  HeightField f{kPosts, kPosts, kSpacing, kSpacing, {}};
  for (Index j = 0; j < kPosts; ++j)
    for (Index i = 0; i < kPosts; ++i) f.heights.push_back(static_cast<float>(height(i * kSpacing, j * kSpacing)));
  return f;
}

/// The same surface as an open mesh, front up.
TriangleMesh open_mesh() {
  TriangleMesh mesh;
  const HeightField f = field();
  for (Index j = 0; j < kPosts; ++j)
    for (Index i = 0; i < kPosts; ++i)
      mesh.vertices.emplace_back(i * kSpacing, j * kSpacing, f.heights[static_cast<std::size_t>(j * kPosts + i)]);
  for (Index j = 0; j + 1 < kPosts; ++j)
    for (Index i = 0; i + 1 < kPosts; ++i) {
      const Index v = j * kPosts + i;
      mesh.triangles.push_back({v, v + 1, v + kPosts + 1});
      mesh.triangles.push_back({v, v + kPosts + 1, v + kPosts});
    }
  return mesh;
}

struct Came {
  double height = 0.0;  // of the body's origin over the terrain, m
  double fastest = 0.0;
  int steps = 0;
};

/// Lets a body go at a depth, in the middle of the terrain. @param shape null: its own surface, which bends
Came from_below(const Shape& terrain, const std::shared_ptr<const Shape>& shape, double depth) {
  ContactFinder finder;
  World world;
  const ContactOptions options;
  world.set_contact_source(&finder, options);
  world.add_static(std::make_shared<Shape>(terrain));
  const auto model =
      sample_model({.modes = shape ? 0 : 4, .lowest_hz = 10.0, .decay = 20.0, .half_extent = {0.1, 0.08, 0.05}});
  const Vec3 start(kMiddle, kMiddle, height(kMiddle, kMiddle) - depth);
  const BodyId body = world.add_body(model, {.pose = {{}, start}, .shape = shape});
  Came came;
  const int limit = static_cast<int>((depth + 1.0) / options.recovery_speed / world.options().step);
  for (; came.steps < limit; ++came.steps) {
    world.step();
    came.fastest = std::max(came.fastest, world.body(body).velocity.norm());
  }
  const Vec3 p = world.body(body).pose.p;
  came.height = p.z() - height(p.x(), p.y());
  return came;
}

TEST(Below, BodiesComeUpThroughATerrainAtAnyDepth) {
  const std::shared_ptr<const Shape> shapes[] = {std::make_shared<Shape>(Sphere{0.06}),
                                                 std::make_shared<Shape>(Capsule{0.05, 0.06}),
                                                 std::make_shared<Shape>(Box{{0.1, 0.08, 0.05}}), nullptr};
  for (const Shape& terrain : {Shape(field()), Shape(open_mesh())})
    for (const double depth : all_or_first<double>({0.15, 3.0}))
      for (const auto& shape : shapes) {
        const Came came = from_below(terrain, shape, depth);
        EXPECT_GT(came.height, 0.045);
        EXPECT_LT(came.height, 0.12);
        EXPECT_LT(came.fastest, 1.0) << "what comes up falls by no more than the hills' 10 cm, 1.4 m/s";
      }
}

// What lies beside a terrain is not below it, nor what it has its front to.
TEST(Below, NothingElseIsBelow) {
  for (const Shape& terrain : {Shape(field()), Shape(open_mesh())}) {
    ContactFinder finder;
    finder.add_body(0, {.shape = std::make_shared<Shape>(terrain)}, {});
    finder.add_body(1, {.shape = std::make_shared<Shape>(Box{{0.1, 0.1, 0.1}})}, {});
    finder.add_body(2, {.shape = std::make_shared<Shape>(Sphere{0.1})}, {});
    const Vec3 beside(-0.5, kMiddle, -2.0), above(kMiddle, kMiddle, 0.5);
    std::vector<ContactPoint> contacts;
    for (const auto& [box, ball] : {std::pair(beside, above), std::pair(above, beside)}) {
      const std::vector<BodyState> states{{}, {.pose = {{}, box}}, {.pose = {{}, ball}}};
      finder.find_contacts({.states = states, .margin = 0.01}, contacts, serial_jobs());
      EXPECT_TRUE(contacts.empty());
    }
  }
}

}  // namespace
}  // namespace limber::testing
