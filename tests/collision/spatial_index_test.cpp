// Queries against brute force: every triangle, every body, one after the other, by other formulas.
#include "limber/collision/spatial_index.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "asked.h"
#include "counted_new.h"
#include "limber/collision/closest_features.h"
#include "limber/core/error.h"
#include "random_states.h"
#include "shapes.h"
#include "wavy_model.h"

namespace limber {
namespace {

using testing::Random;
using testing::trials;
using testing::wavy_model;

constexpr Index kWaves = 7;

/// A body that bends, and its triangles where they are.
struct BentBody {
  std::shared_ptr<const ModalModel> model;
  RigidTransform pose{};
  std::vector<double> z{};
  std::vector<TrianglePoints> triangles{};

  void place(SpatialIndex& index, Index body, const RigidTransform& at, const std::vector<double>& amplitudes) {
    pose = at, z = amplitudes;
    triangles.clear();
    for (Index t = 0; t < static_cast<Index>(model->render().triangles.size()); ++t) {
      TrianglePoints x;
      for (std::size_t i = 0; i < 3; ++i) {
        SurfacePoint corner{.triangle = t, .weight = {0, 0, 0}};
        corner.weight[i] = 1.0;
        x[i] = pose * deformed_point(*model, corner, z);
      }
      triangles.push_back(x);
    }
    index.set_state(body, pose, z);
  }
};

/// Balls, boxes and an open sheet, bent and strewn about anew for each question.
class Strewn {
 public:
  Strewn() {
    const SurfaceMesh ball = shapes::sphere(Vec3::Zero(), 0.5, 2);
    SurfaceMesh cap = ball;
    std::erase_if(cap.triangles,
                  [&](const Triangle& t) { return cap.vertices[static_cast<std::size_t>(t[0])].z() < 0; });
    for (const SurfaceMesh& mesh : {ball, ball, shapes::box({-0.4, -0.3, -0.2}, {0.4, 0.3, 0.2}), cap, ball})
      bodies_.push_back({wavy_model(mesh, kWaves)});
    for (std::size_t i = 0; i < bodies_.size(); ++i)
      index_.add_body(static_cast<Index>(i), {.model = bodies_[i].model});
  }
  void strew(Random& random) {
    for (std::size_t i = 0; i < bodies_.size(); ++i)
      bodies_[i].place(index_, static_cast<Index>(i), random.pose(1.0), random.amplitudes(kWaves, 0.04));
  }
  SpatialIndex& index() { return index_; }
  const std::vector<BentBody>& bodies() const { return bodies_; }

  /// The surface point of a hit is where the hit is.
  void expect_place(const SpatialIndex::Hit& hit, double tolerance) const {
    const BentBody& body = bodies_[static_cast<std::size_t>(hit.body)];
    ASSERT_TRUE(hit.at);
    EXPECT_LE((body.pose * deformed_point(*body.model, *hit.at, body.z) - hit.position).norm(), tolerance);
  }

 private:
  SpatialIndex index_;
  std::vector<BentBody> bodies_;
};

/// By the three equations  from + f way = x0 + u e1 + v e2.
double fraction_on(const Ray& ray, const TrianglePoints& x) {
  Mat3 A;
  A << ray.way, x[0] - x[1], x[0] - x[2];
  const Vec3 r = A.fullPivLu().solve(x[0] - ray.from);
  const bool meets = r.x() >= 0.0 && r.x() <= 1.0 && r.y() >= 0.0 && r.z() >= 0.0 && r.y() + r.z() <= 1.0;
  return meets ? r.x() : 2.0;
}

TEST(SpatialIndex, RaysMeetTheFirstOfAllTriangles) {
  Random random(1);
  Strewn scene;
  int met = 0;
  std::vector<SpatialIndex::Hit> all;
  for (int i = 0; i < trials(2000); ++i) {
    if (i % 10 == 0) scene.strew(random);
    const Ray ray{random.vector(2.0), random.vector(3.0)};
    std::vector<std::pair<double, Index>> first;  // on each body
    for (std::size_t b = 0; b < scene.bodies().size(); ++b) {
      double least = 2.0;
      for (const TrianglePoints& x : scene.bodies()[b].triangles) least = std::min(least, fraction_on(ray, x));
      if (least <= 1.0) first.emplace_back(least, static_cast<Index>(b));
    }
    std::sort(first.begin(), first.end());
    scene.index().cast_ray(ray, all);
    ASSERT_EQ(all.size(), first.size()) << "ray " << i;
    for (std::size_t h = 0; h < all.size(); ++h) {
      EXPECT_EQ(all[h].body, first[h].second);
      EXPECT_NEAR(all[h].fraction, first[h].first, 1e-9);
      EXPECT_LE(all[h].normal.dot(ray.way), 0.0);
      EXPECT_NEAR(all[h].normal.norm(), 1.0, 1e-12);
      scene.expect_place(all[h], 1e-9);
    }
    const auto hit = scene.index().cast_ray(ray);
    ASSERT_EQ(hit.has_value(), !first.empty());
    if (!hit) continue;
    ++met;
    EXPECT_EQ(hit->body, all.front().body);
    EXPECT_EQ(hit->position, all.front().position);
  }
  EXPECT_GE(met, trials(2000) / (testing::kSanitized ? 20 : 10));
}

TEST(SpatialIndex, NearestPointsAreTheLeastOfAllTriangles) {
  Random random(2);
  Strewn scene;
  for (int i = 0; i < trials(2000); ++i) {
    if (i % 10 == 0) scene.strew(random);
    const Vec3 p = random.vector(2.0);
    double least = 10.0;
    for (const BentBody& body : scene.bodies())
      for (const TrianglePoints& x : body.triangles)
        least = std::min(least, (closest_on_triangle(p, x).point - p).norm());
    const auto near = scene.index().nearest_point(p, 10.0);
    ASSERT_TRUE(near);
    EXPECT_NEAR(near->distance, least, 1e-12);
    EXPECT_LE((near->position + near->distance * near->normal - p).norm(), 1e-12);
    scene.expect_place(*near, 1e-9);
    EXPECT_FALSE(scene.index().nearest_point(p, 0.999 * least));
  }
}

/// A solid that asks: its corners and radius, at the start.
struct Asking {
  Shape shape;
  RigidTransform pose;
  std::vector<Vec3> points;
  double radius;
};

Asking random_asking(Random& random) {
  const RigidTransform pose = random.pose(1.2);
  const Vec3 size = Vec3::Constant(0.25) + random.vector(0.2);
  switch (random.index(4)) {
    case 0:
      return {Sphere{size.x()}, pose, {pose.p}, size.x()};
    case 1:
      return {Capsule{size.x(), size.y()}, pose, {pose * Vec3(0, 0, -size.y()), pose * Vec3(0, 0, size.y())}, size.x()};
    case 2: {
      Asking box{Box{size}, pose, {}, 0.0};
      for (int i = 0; i < 8; ++i)
        box.points.push_back(pose * size.cwiseProduct(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1)));
      return box;
    }
    default: {
      ConvexHull hull;
      for (int i = 0; i < 6; ++i) hull.points.push_back(random.vector(0.4));
      Asking asking{hull, pose, {}, 0.0};
      for (const Vec3& p : hull.points) asking.points.push_back(pose * p);
      return asking;
    }
  }
}

/// Of a solid moved by f way; 0 where it meets the triangle.
double moved_gap(const Asking& asking, const Vec3& way, double f, const TrianglePoints& x) {
  std::vector<Vec3> moved = asking.points;
  for (Vec3& p : moved) p += f * way;
  return std::max(0.0, distance({moved, asking.radius}, {x, 0.0}).distance);
}

/// The first touch, by halving: first to the least distance, which is convex in f, then to where it is zero.
double touch_of(const Asking& asking, const Vec3& way, const TrianglePoints& x) {
  double low = 0.0, high = 1.0;
  if (moved_gap(asking, way, 0.0, x) == 0.0) return 0.0;
  for (int i = 0; i < 50 && moved_gap(asking, way, high, x) > 0.0; ++i) {
    const double third = (high - low) / 3.0;
    const double a = moved_gap(asking, way, low + third, x), b = moved_gap(asking, way, high - third, x);
    if (a == 0.0) {
      high = low + third;
      break;
    }
    (a < b ? high : low) += a < b ? -third : third;
  }
  if (moved_gap(asking, way, high, x) > 0.0) return 2.0;
  for (low = 0.0; high - low > 1e-9;)
    (moved_gap(asking, way, 0.5 * (low + high), x) > 0.0 ? low : high) = 0.5 * (low + high);
  return high;
}

TEST(SpatialIndex, CastsEndWhereTheyFirstTouch) {
  Random random(3);
  SpatialIndex index;
  BentBody ball{wavy_model(shapes::sphere(Vec3::Zero(), 0.5, 1), kWaves)};
  index.add_body(0, {.model = ball.model});
  int met = 0, began_inside = 0;
  for (int i = 0; i < trials(300); ++i) {
    ball.place(index, 0, random.pose(0.3), random.amplitudes(kWaves, 0.04));
    const Asking asking = random_asking(random);
    const Vec3 way = random.vector(2.0);
    double first = 2.0;
    for (const TrianglePoints& x : ball.triangles) first = std::min(first, touch_of(asking, way, x));
    const auto hit = index.cast_shape(asking.shape, asking.pose, way);
    if (hit && hit->normal.isZero()) {  // it begins in the body; its triangles alone may be met later
      EXPECT_EQ(hit->fraction, 0.0);
      ++began_inside;
      continue;
    }
    ASSERT_EQ(hit.has_value(), first <= 1.0) << "case " << i;
    if (!hit) continue;
    ++met;
    // The gap that counts as touching, over the speed at which it closes.
    const double closing = -hit->normal.dot(way);
    EXPECT_NEAR(hit->fraction, first, 1e-6 / std::max(closing, 1e-3)) << "case " << i;
    EXPECT_LE(hit->fraction, first + 1e-8);
    EXPECT_GE(closing, 0.0);
  }
  EXPECT_GE(met, trials(300) / 10);
  EXPECT_GE(began_inside, trials(300) / 50);
}

TEST(SpatialIndex, OverlapsAreOfSurfacesAndOfWhatLiesWithin) {
  Random random(4);
  Strewn scene;
  std::vector<Index> found;
  for (int i = 0; i < trials(1000); ++i) {
    if (i % 5 == 0) scene.strew(random);
    const Asking asking = random_asking(random);
    std::vector<Index> expected;
    for (std::size_t b = 0; b < scene.bodies().size(); ++b) {
      const BentBody& body = scene.bodies()[b];
      bool touches = std::any_of(body.triangles.begin(), body.triangles.end(), [&](const TrianglePoints& x) {
        return moved_gap(asking, Vec3::Zero(), 0.0, x) == 0.0;
      });
      if (b != 3) {  // the sheet has no inside; in the others a ray out crosses the surface an odd number of times
        const Ray out{asking.points.front(), Vec3(3.1, 4.7, 5.3)};
        touches = touches || std::count_if(body.triangles.begin(), body.triangles.end(),
                                           [&](const TrianglePoints& x) { return fraction_on(out, x) <= 1.0; }) %
                                     2 ==
                                 1;
      }
      if (touches) expected.push_back(static_cast<Index>(b));
    }
    scene.index().find_overlaps(asking.shape, asking.pose, found);
    EXPECT_EQ(found, expected) << "case " << i;
  }
}

/// Of round shapes: the hit lies on the surface, and nothing before it does.
TEST(SpatialIndex, RaysMeetRoundShapesFromOutsideAndInside) {
  Random random(5);
  SpatialIndex index;
  constexpr double kRadius = 0.3, kHalf = 0.4;
  index.add_body(0, {.shape = std::make_shared<const Shape>(Capsule{kRadius, kHalf})});
  int met = 0;
  for (int i = 0; i < 1000; ++i) {
    const RigidTransform pose = random.pose(0.3);
    index.set_state(0, pose, {});
    const Ray ray{random.vector(1.0), random.vector(2.0)};
    const SegmentPoints core{pose * Vec3(0, 0, -kHalf), pose * Vec3(0, 0, kHalf)};
    const auto height = [&](double f) {
      const Vec3 p = ray.from + f * ray.way;
      return (closest_on_segment(p, core).point - p).norm() - kRadius;
    };
    const auto hit = index.cast_ray(ray);
    const double until = hit ? hit->fraction : 1.0;
    constexpr int kSamples = 200;
    for (int s = 1; s < kSamples; ++s) EXPECT_GT(height(0.0) * height(until * s / kSamples), 0.0) << "ray " << i;
    if (!hit) continue;
    ++met;
    EXPECT_NEAR(height(until), 0.0, 1e-12);
  }
  EXPECT_GE(met, 100);
}

TEST(SpatialIndex, ClosedFormsOfRigidBodies) {
  SpatialIndex index;
  index.add_body(0, {.shape = std::make_shared<const Shape>(HalfSpace{})});
  index.add_body(1, {.shape = std::make_shared<const Shape>(Box{{1, 1, 1}})});
  index.add_body(2, {.shape = std::make_shared<const Shape>(Sphere{0.5})});
  index.set_state(0, {}, {});
  index.set_state(1, {.p = {0, 0, 4}}, {});
  index.set_state(2, {.p = {5, 0, 4}}, {});
  const auto down = index.cast_ray({{0, 0, 10}, {0, 0, -20}});
  ASSERT_TRUE(down);
  EXPECT_EQ(down->body, 1);
  EXPECT_NEAR(down->distance, 5.0, 1e-12);
  EXPECT_LE((down->normal - Vec3::UnitZ()).norm(), 1e-15);
  EXPECT_FALSE(index.cast_ray({{0, 0, 10}, {0, 0, -4.9}}));
  const auto ball = index.cast_shape(Sphere{0.25}, {.p = {-4, 0, 4}}, {20, 0, 0});
  ASSERT_TRUE(ball);
  EXPECT_NEAR(ball->distance, 2.75, 1e-6);
  EXPECT_LE((ball->position - Vec3(-1, 0, 4)).norm(), 1e-6);
  const auto two = index.cast_shape(Sphere{0.25}, {.p = {9, 0.25, 4}}, {-20, 0, 0});
  ASSERT_TRUE(two);
  EXPECT_EQ(two->body, 2);
  EXPECT_NEAR(two->distance, 4.0 - std::sqrt(0.75 * 0.75 - 0.25 * 0.25), 1e-6);
  const auto ground = index.cast_shape(Box{{0.5, 0.5, 0.5}}, {.p = {-5, 0, 3}}, {0, 0, -5});
  ASSERT_TRUE(ground);
  EXPECT_EQ(ground->body, 0);
  EXPECT_NEAR(ground->fraction, 0.5, 1e-12);
  // A shape wholly within a solid, and one that begins in it.
  std::vector<Index> found;
  index.find_overlaps(Sphere{0.1}, {.p = {0, 0, 4}}, found);
  EXPECT_EQ(found, std::vector<Index>{1});
  const auto inside = index.cast_shape(Sphere{0.1}, {.p = {0, 0, 4}}, {20, 0, 0});
  ASSERT_TRUE(inside);
  EXPECT_EQ(inside->fraction, 0.0);
  const auto near = index.nearest_point({5, 0, 4.1}, 1.0);
  ASSERT_TRUE(near);
  EXPECT_NEAR(near->distance, 0.4, 1e-12);
  EXPECT_NEAR(near->normal.z(), -1.0, 1e-12);  // the surface is above the point
}

TEST(SpatialIndex, FiltersLeaveBodiesOutAndTiesGoToTheLowest) {
  SpatialIndex index;
  const auto box = std::make_shared<const Shape>(Box{{1, 1, 1}});
  for (const Index body : {7, 3, 5}) {  // all in one place
    index.add_body(body, {.shape = box}, body == 3 ? 2u : 1u);
    index.set_state(body, {}, {});
  }
  const Ray ray{{5, 0.1, 0.2}, {-10, 0, 0}};
  EXPECT_EQ(index.cast_ray(ray)->body, 3);
  EXPECT_EQ(index.cast_ray(ray, {.mask = 1})->body, 5);
  EXPECT_EQ(index.cast_ray(ray, {.accepts = [](Index b) { return b == 7; }})->body, 7);
  index.remove_body(3);
  EXPECT_EQ(index.cast_ray(ray)->body, 5);
  index.set_state(5, {.p = {0, 50, 0}}, {});
  EXPECT_EQ(index.cast_ray(ray)->body, 7);
  EXPECT_EQ(index.nearest_point({0, 48, 0}, 2.0)->body, 5);
}

TEST(SpatialIndex, ArgumentsAreChecked) {
  SpatialIndex index;
  const auto box = std::make_shared<const Shape>(Box{});
  index.add_body(0, {.shape = box});
  EXPECT_FALSE(index.cast_ray({{5, 0, 0}, {-10, 0, 0}}));  // is nowhere yet
  EXPECT_THROW(index.add_body(0, {.shape = box}), InvalidArgument);
  EXPECT_THROW(index.add_body(-1, {.shape = box}), InvalidArgument);
  EXPECT_THROW(index.add_body(1, {}), InvalidArgument);
  EXPECT_THROW(index.remove_body(1), InvalidArgument);
  EXPECT_THROW(index.set_state(0, {.p = Vec3::Constant(std::nan(""))}, {}), InvalidArgument);
  EXPECT_THROW(index.cast_ray({{0, 0, 0}, {0, 0, 0}}), InvalidArgument);
  EXPECT_THROW(index.cast_ray({Vec3::Constant(std::nan("")), {1, 0, 0}}), InvalidArgument);
  EXPECT_THROW(index.cast_shape(HalfSpace{}, {}, {1, 0, 0}), InvalidArgument);
  EXPECT_THROW(index.cast_shape(Sphere{-1.0}, {}, {1, 0, 0}), InvalidArgument);
  EXPECT_THROW(index.nearest_point({0, 0, 0}, 0.0), InvalidArgument);
}

/// What is made of a model is made once: further bodies of it cost next to nothing.
TEST(SpatialIndex, BodiesOfOneModelShareItsSurface) {
  const auto model = wavy_model(shapes::sphere(Vec3::Zero(), 0.5, 2), kWaves);
  SpatialIndex index;
  const auto add = [&](Index body) {
    const auto before = testing::allocations();
    index.add_body(body, {.model = model});
    index.set_state(body, {}, std::vector<double>(kWaves, 0.0));
    return testing::allocations() - before;
  };
  const long first = add(0);
  long others = 0;
  for (Index body = 1; body <= 4; ++body) others += add(body);
  EXPECT_LT(others, first);
}

TEST(SpatialIndex, WarmQueriesAllocateNothing) {
  Random random(6);
  Strewn scene;
  std::vector<SpatialIndex::Hit> hits;
  std::vector<Index> found;
  const Box box{{0.2, 0.2, 0.2}};
  const Shape shape(box);
  const auto ask = [&] {
    Random again(7);
    for (int i = 0; i < 50; ++i) {
      const Ray ray{again.vector(2.0), again.vector(3.0)};
      scene.index().cast_ray(ray);
      scene.index().cast_ray(ray, hits);
      scene.index().cast_shape(shape, {.p = ray.from}, ray.way);
      scene.index().find_overlaps(shape, {.p = ray.from}, found);
      scene.index().nearest_point(ray.from, 1.0);
    }
  };
  scene.strew(random);
  ask();
  const auto before = testing::allocations();
  ask();
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace limber
