// What hardly moves is not searched again, and has the same contacts to the bit.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "finder_scenes.h"
#include "narrow/pair_memory.h"
#include "narrow_phase_bodies.h"

namespace limber::testing {
namespace {

using internal::PairMemory;
using internal::TestRoom;

void expect_same_bits(const std::vector<ContactPoint>& a, const std::vector<ContactPoint>& b) {
  ASSERT_EQ(a.size(), b.size());
  const auto side = [](const ContactSide& x, const ContactSide& y) {
    EXPECT_EQ(x.body, y.body);
    EXPECT_EQ(x.triangle, y.triangle);
    EXPECT_EQ(x.weight, y.weight);
    EXPECT_EQ(x.point_B, y.point_B);
  };
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].id, b[i].id);
    EXPECT_EQ(a[i].gap, b[i].gap);
    EXPECT_EQ(a[i].normal, b[i].normal);
    EXPECT_EQ(a[i].position, b[i].position);
    side(a[i].a, b[i].a), side(a[i].b, b[i].b);
  }
}

/// Lumpy balls that bend, a box, a sheet and a mesh, heaped on each other.
ContactScene lumpy_heap(Random& random) {
  ContactScene scene;
  const auto ball = lumpy_sphere(2, 5), leaf = sheet(8, 4);
  const SurfaceMesh floor = shapes::box({-3.0, -3.0, -1.0}, {3.0, 3.0, 0.0});
  scene.add(TriangleMesh{floor.vertices, floor.triangles});
  scene.add(Box{{0.5, 0.4, 0.3}}, {{}, {0.1, 0.0, 0.31}});
  for (int i = 0; i < 5; ++i)
    scene.add(
        BodyGeometry{.model = ball, .shape = {}},
        {random.pose(0.0).q, Vec3(0.5 * (i % 2), 0.6 * (i / 2) - 0.5, 0.95 + 0.3 * (i % 3)) + random.vector(0.03)},
        random.amplitudes(5, 0.02));
  scene.add(BodyGeometry{.model = leaf, .shape = {}}, {random.pose(0.0).q, {0.0, 0.0, 1.3}},
            random.amplitudes(4, 0.02));
  return scene;
}

struct Stirred {
  std::vector<RigidTransform> poses;
  std::vector<std::vector<double>> amplitudes;
};

void stir(ContactScene& scene, Random& random, double size) {
  for (std::size_t i = 1; i < scene.poses.size(); ++i) {
    scene.poses[i].p += random.vector(size);
    scene.poses[i].q = normalized(quaternion_from_rotation_vector(random.vector(size)) * scene.poses[i].q);
    for (double& z : scene.amplitudes[i]) z += random.uniform(-size, size);
  }
}

TEST(Coherence, ContactsOfWhatHardlyMovesAreThoseOfASearchToTheBit) {
  for (const bool moving : {false, true}) {
    Random random(moving ? 3 : 4);
    ContactScene scene = lumpy_heap(random);
    ContactFinder remembers({.clusters = {.max_points = 0}}),
        searches({.coherence = false, .clusters = {.max_points = 0}});
    scene.add_all_to(remembers), scene.add_all_to(searches);
    std::vector<ContactPoint> found, expected;
    Stirred kept;
    std::size_t contacts = 0;
    const int steps = trials(120);
    for (int step = 0; step < steps; ++step) {
      // Now and then all jumps, or is again where it was, as a rollback has it.
      if (step % 40 == 20) kept = {scene.poses, scene.amplitudes};
      if (step % 40 == 35) scene.poses = kept.poses, scene.amplitudes = kept.amplitudes;
      stir(scene, random, step % 30 == 29 ? 0.1 : std::pow(10.0, random.uniform(-9.0, -3.0)));
      std::vector<BodyState> states = scene.states();
      for (std::size_t i = 0; moving && i < states.size(); ++i) {
        states[i].reach = 0.011;
        states[i].displacement = i == 0 ? Vec3::Zero() : Vec3(1e-4, 0.0, 0.0);
      }
      const double margin = step % 7 == 0 ? 0.012 : 0.01;
      remembers.find_contacts({.states = states, .margin = margin}, found, serial_jobs());
      searches.find_contacts({.states = states, .margin = margin}, expected, serial_jobs());
      expect_same_bits(found, expected);
      if (::testing::Test::HasFailure()) FAIL() << "at step " << step;
      contacts += found.size();
    }
    EXPECT_GT(contacts, 100u * static_cast<unsigned>(steps));
  }
}

/// As long as a list is held good, no point has moved against the other body by more than its slack; it is held good
/// for some motion; and it is made again.
TEST(Coherence, AListHoldsUntilPointsMayHaveMovedByItsSlack) {
  Random random(11);
  const auto model = lumpy_sphere(1, 4);
  const CollisionSurface a(model), b(model);
  TestRoom room;
  int looked = 0, listed = 0, searched = 0;
  for (int trial = 0; trial < 50; ++trial) {
    PairMemory memory(room);
    const double margin = 0.02, size = std::pow(10.0, random.uniform(-5.0, -2.5));
    RigidTransform X_AB = random.pose(1.0), listed_at;
    std::vector<double> z_a = random.amplitudes(4, 0.05), z_b = random.amplitudes(4, 0.05), listed_a, listed_b;
    for (int query = 0; query < 40; ++query) {
      const PairMemory::Advice advice = memory.advise({a, b, X_AB, z_a, z_b, margin, 0.0});
      if (advice == PairMemory::Advice::kSearch) ++searched;
      if (advice == PairMemory::Advice::kList) ++listed, listed_at = X_AB, listed_a = z_a, listed_b = z_b;
      if (advice == PairMemory::Advice::kLook) {
        ++looked;
        DeformedSurface now_a, now_b, then_a, then_b;
        const auto share = [](const CollisionSurface& s) {
          return std::shared_ptr<const CollisionSurface>(std::shared_ptr<void>(), &s);
        };
        now_a.bind(share(a), z_a), now_b.bind(share(b), z_b), then_a.bind(share(a), listed_a),
            then_b.bind(share(b), listed_b);
        double moved_a = 0.0, moved_b = 0.0;
        for (Index v = 0; v < a.vertices(); ++v) {
          moved_a = std::max(moved_a, (now_a.vertex(v) - then_a.vertex(v)).norm());
          moved_b = std::max(moved_b, (X_AB * now_b.vertex(v) - listed_at * then_b.vertex(v)).norm());
        }
        EXPECT_LE(moved_a + moved_b, memory.slack());
      }
      X_AB.p += random.vector(size);
      X_AB.q = normalized(quaternion_from_rotation_vector(random.vector(size)) * X_AB.q);
      for (double& z : z_a) z += random.uniform(-size, size);
      for (double& z : z_b) z += random.uniform(-size, size);
    }
  }
  EXPECT_GT(looked, 500);
  EXPECT_GT(listed, 25);
  EXPECT_GT(searched, 50);
}

}  // namespace
}  // namespace limber::testing
