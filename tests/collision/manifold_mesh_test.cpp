// Convex bodies on meshes and height fields, as ManifoldFinder sees them: no seam shows.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "asked.h"
#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#include "sliding_body.h"

namespace limber {
namespace {

using testing::contacts_of;
using testing::ContactScene;
using testing::Random;
using testing::SlidingBody;

constexpr double kLength = 12.0, kHalfWidth = 1.0;

/// A strip from x = from to x = to of the ground plane, at a height, of triangles of random shape.
TriangleMesh random_strip(double from, double to, int cells, unsigned seed, double bump = 0.0) {
  Random random(seed);
  TriangleMesh mesh;
  constexpr int kAcross = 5;
  const double dx = (to - from) / cells, dy = 2.0 * kHalfWidth / kAcross;
  for (int i = 0; i <= cells; ++i)
    for (int j = 0; j <= kAcross; ++j) {
      const bool rim_x = i == 0 || i == cells, rim_y = j == 0 || j == kAcross;
      mesh.vertices.emplace_back(from + dx * (i + (rim_x ? 0.0 : random.uniform(-0.4, 0.4))),
                                 -kHalfWidth + dy * (j + (rim_y ? 0.0 : random.uniform(-0.4, 0.4))),
                                 random.uniform(-bump, bump));
    }
  const auto at = [](int i, int j) { return static_cast<Index>(i * (kAcross + 1) + j); };
  for (int i = 0; i < cells; ++i)
    for (int j = 0; j < kAcross; ++j)
      if (random.uniform(0.0, 1.0) < 0.5) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      } else {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        mesh.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
  return mesh;
}

/// Rows of cells of other lengths each, in one mesh: vertices lie on edges of the next row.
TriangleMesh unmatched_rows() {
  TriangleMesh mesh;
  for (int row = 0; row < 5; ++row) {
    Random random(static_cast<unsigned>(row));
    const int cells = 40 + 7 * row;
    const double y = -1.0 + 0.4 * row, length = (kLength + 1.0) / cells;
    double from = -1.0;
    for (int i = 1; i <= cells; ++i) {
      const double to = -1.0 + length * (i + (i < cells ? random.uniform(-0.4, 0.4) : 0.0));
      const auto first = static_cast<Index>(mesh.vertices.size());
      for (const Vec3& p : {Vec3(from, y, 0.0), Vec3(to, y, 0.0), Vec3(to, y + 0.4, 0.0), Vec3(from, y + 0.4, 0.0)})
        mesh.vertices.push_back(p);
      mesh.triangles.push_back({first, first + 1, first + 2});
      mesh.triangles.push_back({first, first + 2, first + 3});
      from = to;
    }
  }
  return mesh;
}

struct Floor {
  const char* name;
  std::function<void(ContactScene&)> add;
};

std::vector<Floor> flat_floors() {
  return {
      {"half-space", [](ContactScene& s) { s.add(HalfSpace{}); }},
      {"flush boxes",
       [](ContactScene& s) {
         for (int i = 0; i < 24; ++i) s.add(Box{{0.25, 1.0, 0.5}}, {{}, {0.5 * i, 0.0, -0.5}});
       }},
      {"boxes level to a tenth of a millimetre",
       [](ContactScene& s) {
         for (int i = 0; i < 24; ++i)
           s.add(Box{{0.25, 1.0, 0.5}}, {{}, {0.5 * i, 0.0, -0.5 + 1e-4 * std::sin(3.0 * i)}});
       }},
      {"tiles smaller than what slides",
       [](ContactScene& s) {
         for (int i = 0; i < 130; ++i)
           for (int j = -3; j < 3; ++j) s.add(Box{{0.05, 0.05, 0.1}}, {{}, {-0.5 + 0.1 * i, 0.05 + 0.1 * j, -0.1}});
       }},
      {"triangles that only lie side by side", [](ContactScene& s) { s.add(unmatched_rows()); }},
      {"coarse mesh", [](ContactScene& s) { s.add(random_strip(-1.0, kLength, 11, 1)); }},
      {"fine mesh", [](ContactScene& s) { s.add(random_strip(-1.0, kLength, 97, 2)); }},
      {"two meshes side by side",
       [](ContactScene& s) { s.add(random_strip(-1.0, 3.0, 7, 3)), s.add(random_strip(3.0, kLength, 19, 4)); }},
      {"mesh beside a box",
       [](ContactScene& s) {
         s.add(random_strip(-1.0, 3.0, 7, 3));
         s.add(Box{{5.0, 1.0, 0.5}}, {{}, {8.0, 0.0, -0.5}});
       }},
      {"mesh beside a height field",
       [](ContactScene& s) {
         s.add(random_strip(-1.0, 3.0, 13, 6));
         HeightField field{.columns = 31, .rows = 7, .spacing_x = 0.3, .spacing_y = 0.35, .heights = {}};
         field.heights.assign(static_cast<std::size_t>(field.columns * field.rows), 0.0f);
         s.add(field, {{}, {3.0, -1.05, 0.0}});
       }},
      {"height field",
       [](ContactScene& s) {
         HeightField field{.columns = 53, .rows = 9, .spacing_x = 0.25, .spacing_y = 0.25, .heights = {}};
         field.heights.assign(static_cast<std::size_t>(field.columns * field.rows), 0.0f);
         s.add(field, {{}, {-1.0, -1.0, 0.0}});
       }},
  };
}

TEST(ManifoldSeams, AFrictionlessCubeKeepsItsSpeedOverTenMetresOfAnyFlatFloor) {
  for (const Floor& floor : flat_floors())
    for (const double speed : testing::all_or_first<double>({7.0, 2.0, 0.5}))
      for (const double turn : {0.0, 0.3, std::numbers::pi / 6.0}) {
        ContactScene scene;
        floor.add(scene);
        SlidingBody cube(scene, Box{Vec3::Constant(0.1)},
                         {quaternion_from_rotation_vector({0.0, 0.0, turn}), {0.0, 0.03, 0.1}}, 0.0);
        cube.v = {speed, 0.0, 0.0};
        ManifoldFinder finder;
        scene.add_all_to(finder);
        double lowest = 1.0;
        for (int step = 0; step * speed / 60.0 < 10.0; ++step) {
          cube.step(finder);
          lowest = std::min(lowest, cube.pose().p.z());
        }
        EXPECT_NEAR(cube.v.x(), speed, 1e-3 * speed) << floor.name << " at " << speed << " m/s, turned by " << turn;
        EXPECT_GT(lowest, 0.1 - 2e-3) << floor.name;
      }
}

TEST(ManifoldSeams, ACubeLandsOnAnyFlatFloorAndGoesOn) {
  for (const Floor& floor : flat_floors()) {
    ContactScene scene;
    floor.add(scene);
    SlidingBody cube(scene, Box{Vec3::Constant(0.1)}, {{}, {0.0, 0.03, 0.4}}, 0.0);
    cube.v = {3.0, 0.0, 0.0};
    ManifoldFinder finder;
    scene.add_all_to(finder);
    for (int step = 0; step < 180; ++step) cube.step(finder);
    EXPECT_NEAR(cube.v.x(), 3.0, 3e-3) << floor.name;
    EXPECT_NEAR(cube.pose().p.z(), 0.1, 2e-3) << floor.name;
  }
}

TEST(ManifoldSeams, ABallRollsFourMetresOnAnyFlatFloor) {
  for (const Floor& floor : flat_floors())
    for (const double speed : testing::all_or_first<double>({5.0, 2.0, 0.5})) {
      ContactScene scene;
      floor.add(scene);
      SlidingBody ball(scene, Sphere{0.1}, {{}, {0.0, 0.03, 0.1}}, 0.5);
      ball.v = {speed, 0.0, 0.0}, ball.w = {0.0, speed / 0.1, 0.0};
      ManifoldFinder finder;
      scene.add_all_to(finder);
      const double before = ball.kinetic();
      while (ball.pose().p.x() < 4.0 && ball.v.x() > 0.1) ball.step(finder);
      EXPECT_NEAR(ball.kinetic(), before, 0.01 * before) << floor.name << " at " << speed << " m/s";
      EXPECT_NEAR(ball.pose().p.z(), 0.1, 1e-3) << floor.name;
    }
}

TEST(ManifoldSeams, ACubeThatRestedBesideASeamIsNotHeldByIt) {
  for (const Floor& floor : flat_floors())
    for (const double speed : {0.02, 0.2}) {
      ContactScene scene;
      floor.add(scene);
      SlidingBody cube(scene, Box{Vec3::Constant(0.1)}, {{}, {2.899, 0.03, 0.1}}, 0.0);  // seams at 2.75 and 3
      ManifoldFinder finder;
      scene.add_all_to(finder);
      for (int step = 0; step < 5; ++step) cube.step(finder);
      cube.v = {speed, 0.0, 0.0};
      for (int step = 0; step < 120; ++step) cube.step(finder);
      // 1e-4 m/s is what a floor off level by 5e-6 gives it meanwhile.
      EXPECT_NEAR(cube.v.x(), speed, 1e-3 * std::max(speed, 0.1)) << floor.name << " at " << speed << " m/s";
    }
}

/// All is turned such that its weight presses it to both.
TEST(ManifoldSeams, ACubeGoesOnAlongAWallAndTheFloorAtOnce) {
  const RigidTransform upright{quaternion_from_rotation_vector({0.5 * std::numbers::pi, 0.0, 0.0}), {0.0, 0.3, 0.5}};
  const RigidTransform turned{quaternion_from_rotation_vector({-0.25 * std::numbers::pi, 0.0, 0.0}), Vec3::Zero()};
  for (const Floor& floor : flat_floors())
    for (const bool wall_of_boxes : {true, false}) {
      ContactScene scene;
      floor.add(scene);
      for (int i = 0; wall_of_boxes && i < 30; ++i) scene.add(Box{{0.2, 0.25, 0.5}}, {{}, {0.4 * i, 0.55, 0.4}});
      if (!wall_of_boxes) scene.add(random_strip(-1.0, kLength, 31, 7), upright);
      for (RigidTransform& pose : scene.poses) pose = turned * pose;
      SlidingBody cube(scene, Box{Vec3::Constant(0.1)}, turned * RigidTransform{{}, {0.0, 0.2, 0.1}}, 0.0);
      cube.v = {3.0, 0.0, 0.0};
      ManifoldFinder finder;
      scene.add_all_to(finder);
      while (cube.pose().p.x() < 9.0 && cube.v.x() > 0.1) cube.step(finder);
      EXPECT_NEAR(cube.v.x(), 3.0, 3e-3) << floor.name << (wall_of_boxes ? ", boxes" : ", mesh");
      EXPECT_LE((turned.inverse() * cube.pose().p - Vec3(cube.pose().p.x(), 0.2, 0.1)).norm(), 2e-3) << floor.name;
    }
}

TEST(ManifoldSeams, StepsAndWallsStop) {
  for (const bool as_mesh : {false, true}) {
    ContactScene scene;
    scene.add(HalfSpace{});
    TriangleMesh wall{
        {{2.0, -1.0, -0.2}, {2.0, 1.0, -0.2}, {2.0, 1.0, 0.5}, {2.0, -1.0, 0.5}, {3.0, 1.0, 0.5}, {3.0, -1.0, 0.5}},
        {{0, 2, 1}, {0, 3, 2}, {3, 4, 2}, {3, 5, 4}}};
    if (as_mesh)
      scene.add(wall);
    else
      scene.add(Box{{0.5, 1.0, 0.35}}, {{}, {2.5, 0.0, 0.15}});
    SlidingBody cube(scene, Box{Vec3::Constant(0.1)}, {{}, {0.0, 0.0, 0.1}}, 0.0);
    cube.v = {3.0, 0.0, 0.0};
    ManifoldFinder finder;
    scene.add_all_to(finder);
    for (int step = 0; step < 60; ++step) cube.step(finder);
    EXPECT_LT(cube.pose().p.x(), 1.95) << (as_mesh ? "mesh" : "box");
  }
}

TEST(ManifoldMesh, ABoxOnATriangulatedPlaneHasItsFourCornersByTheSameIdsWhereverItSlides) {
  ContactScene scene;
  scene.add(random_strip(-1.0, 2.0, 25, 5));
  scene.add(Box{{0.2, 0.15, 0.1}}, {quaternion_from_rotation_vector({0.0, 0.0, 0.4}), {0.0, 0.0, 0.1 - 1e-5}});
  ManifoldFinder finder;
  scene.add_all_to(finder);
  const auto first = contacts_of(finder, scene, 1e-3);
  ASSERT_EQ(first.size(), 4u);
  for (int step = 1; step < 100; ++step) {
    scene.poses[1].p.x() = 0.01 * step;
    const auto contacts = contacts_of(finder, scene, 1e-3);
    ASSERT_EQ(contacts.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(contacts[i].id, first[i].id);
      EXPECT_NEAR(contacts[i].gap, -1e-5, 1e-12);
      EXPECT_LE((contacts[i].normal + Vec3::UnitZ()).norm(), 1e-12);
    }
  }
}

/// Never less deep. Deeper where a triangle's own way out is barred by the next one: one in 200.
TEST(ManifoldMesh, OnBumpyGroundTheDeepestContactIsThatOfTheExactFinder) {
  Random random(17);
  int touching = 0, deeper = 0;
  for (int trial = 0; trial < testing::trials(300); ++trial) {
    ContactScene scene;
    scene.add(random_strip(-1.0, 1.0, 9, static_cast<unsigned>(trial), 0.04));
    const Shape shapes[]{Box{{0.3, 0.25, 0.2}}, Sphere{0.2}, Capsule{0.15, 0.2}};
    scene.add(shapes[trial % 3], {random.pose(1.0).q, {random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4), 0.5}});
    ContactFinder exact;
    scene.add_all_to(exact);
    const auto gap_at = [&](ContactSource& finder) {
      double least = 0.5;
      for (const ContactPoint& c : contacts_of(finder, scene, 0.5)) least = std::min(least, c.gap);
      return least;
    };
    const double depth = random.uniform(0.0, 3e-3);
    for (int i = 0; i < 20; ++i) scene.poses[1].p.z() -= gap_at(exact) + depth;
    ManifoldFinder finder;
    scene.add_all_to(finder);
    const double expected = gap_at(exact), seen = gap_at(finder);
    if (std::abs(expected + depth) > 1e-6) continue;
    ++touching;
    EXPECT_LE(seen, expected + 1e-4) << trial;
    deeper += seen < expected - 1e-4 ? 1 : 0;
  }
  EXPECT_GT(touching, testing::trials(300) / 2);
  EXPECT_LE(deeper, touching / 50);
  RecordProperty("touching", touching);
  RecordProperty("deeper", deeper);
}

TEST(ManifoldMesh, BodiesThatStartInTheGroundComeOutAndNeverSink) {
  Random random(3);
  const auto closed = [] {
    TriangleMesh box;
    for (int i = 0; i < 8; ++i) box.vertices.emplace_back(i & 1 ? 2.0 : -2.0, i & 2 ? 2.0 : -2.0, i & 4 ? 0.0 : -3.0);
    box.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                     {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    return box;
  }();
  HeightField field{.columns = 9, .rows = 9, .spacing_x = 0.5, .spacing_y = 0.5, .heights = {}};
  field.heights.assign(81, 0.0f);
  for (int trial = 0; trial < 60; ++trial) {
    const double share = random.uniform(0.04, 0.9);
    ContactScene scene;
    const RigidTransform corner{{}, {-2.0, -2.0, 0.0}};
    trial % 2 == 0 ? scene.add(closed) : scene.add(field, corner);
    const Shape shapes[]{Box{{0.3, 0.25, 0.2}}, Sphere{0.2}, Capsule{0.15, 0.2}};
    scene.add(shapes[trial % 3],
              {random.pose(1.0).q, {random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), 0.2 - 0.4 * share}});
    for (int push = 0; push < 100; ++push) {
      ManifoldFinder finder;
      scene.add_all_to(finder);
      const auto contacts = contacts_of(finder, scene, 1e-3);
      if (contacts.empty()) break;
      const ContactPoint& c = *std::ranges::min_element(contacts, {}, &ContactPoint::gap);
      EXPECT_LT(c.normal.z(), 0.99 * -1.0 + 0.01) << trial;  // out of the body: up out of the ground
      if (c.gap > -1e-6) break;
      scene.poses[1].p += 0.5 * c.gap * c.normal;
    }
    double lowest = 1.0;
    ManifoldFinder finder;
    scene.add_all_to(finder);
    for (const ContactPoint& c : contacts_of(finder, scene, 1e-3)) lowest = std::min(lowest, c.gap);
    EXPECT_GT(lowest, -1e-5) << trial;
    EXPECT_GT(scene.poses[1].p.z(), 0.1) << trial;
  }
}

}  // namespace
}  // namespace limber
