#include "tuning_collision_pairs.h"

#include <cmath>
#include <utility>

#include "block_model.h"
#include "random_states.h"
#include "shapes.h"
#include "solid_bodies.h"
#include "wavy_model.h"

namespace limber {
namespace {

using testing::Body;
using testing::PairReference;
using testing::Random;

std::unique_ptr<Body> modal(std::shared_ptr<const ModalModel> model) {
  return std::make_unique<Body>(std::move(model));
}
std::unique_ptr<Body> box_of_triangles(const Vec3& half) {
  return modal(testing::wavy_model(shapes::box(-half, half), 0));
}

/// Bent bodies at random, judged by brute force.
void add_random_pairs(std::vector<TuningPair>& pairs) {
  Random random(71);
  const auto coarse = testing::lumpy_sphere(1, 5), fine = testing::lumpy_sphere(2, 3);
  const Vec3 half(0.5, 0.3, 0.4);
  for (int i = 0; i < 160; ++i) {
    TuningPair pair{modal(coarse), i % 2 == 0 ? modal(fine) : std::make_unique<Body>(Shape{Box{half}}), 0.08,
                    OverlapMethod::kNearestPoint};
    pair.a->place(random.pose(1.0), random.amplitudes(5, 0.05));
    const RigidTransform X{random.pose(1.0).q,
                           pair.a->pose.p + random.uniform(0.6, 1.1) * random.vector(1.0).normalized()};
    if (i % 2 == 0)
      pair.b->place(X, random.amplitudes(3, 0.05));
    else
      pair.b->place_box(X, half);
    pair.reference = std::make_unique<PairReference>(pair.a->plain(), pair.b->plain(), pair.margin);
    pairs.push_back(std::move(pair));
  }
}

/// Boxes on a box: flush, a little off, apart, sunk in and tilted.
void add_resting_boxes(std::vector<TuningPair>& pairs) {
  const Vec3 half(0.25, 0.1875, 0.125);
  for (const double off : {0.0, 1e-12, 1e-6, 1e-3, 0.03})
    for (const double gap : {0.0, 1e-9, 1e-5, 1e-3, -1e-9, -1e-5, -1e-3, -0.02, -0.05})
      for (const double tilt : {0.0, 1e-6, 1e-3, 0.005, 0.015, 0.03}) {
        TuningPair pair{box_of_triangles(half), std::make_unique<Body>(Shape{Box{half}}), 2e-3};
        const Quaternion q = quaternion_from_rotation_vector({tilt, 0.7 * tilt, 0.0});
        pair.a->place({q, {off, -off, 2.0 * half.z() + gap}});
        pair.b->place({});
        if (off == 0.0 || -gap < off) pair.upright = tilt;  // else the sides are the nearer way out
        pairs.push_back(std::move(pair));
      }
}

/// Bars laid across each other, tilted, so that their rims have crossed.
void add_crossed_bars(std::vector<TuningPair>& pairs) {
  Random random(72);
  for (int i = 0; i < 60; ++i) {
    TuningPair pair{box_of_triangles({0.1, 1.0, 0.1}), box_of_triangles({1.0, 0.1, 0.1}), 0.0};
    const Vec3 tilt(random.uniform(-0.1, 0.1), random.uniform(-0.3, 0.3), random.uniform(-0.5, 0.5));
    pair.a->place({quaternion_from_rotation_vector(tilt), {0.0, 0.0, 0.2 + random.uniform(-0.02, 0.03)}});
    pair.b->place({});
    pair.upright = 0.45;  // within the cone of the tilts
    pairs.push_back(std::move(pair));
  }
}

/// A box that is about to slide onto the next one of the same height, level to round-off and to a part of an edge.
void add_seams(std::vector<TuningPair>& pairs) {
  const Vec3 half(0.25, 0.1875, 0.125);
  for (const double above : {1e-6, 1e-9, 0.0, -1e-9, -1e-6, -1e-5, -2e-5, -4e-5, -1e-4})
    for (const double move : {0.15, 0.3}) {
      TuningPair pair{box_of_triangles(half), std::make_unique<Body>(Shape{Box{half}}), 0.2};
      pair.a->place({.p = {-2.0 * half.x() - 0.1, 0.013, 2.0 * half.z() + above}});
      pair.b->place({});
      pair.ahead = {move, 0.0, 0.0};
      pair.free_after = 2.0 * std::abs(above) + 1e-8;
      pairs.push_back(std::move(pair));
    }
}

/// Blocks that flex on blocks that flex, about flat on each other, and boxes at random: nothing is known but what the
/// numbers give as they are.
void add_unjudged(std::vector<TuningPair>& pairs) {
  Random random(77);
  const auto block = testing::block_model(4);
  for (int i = 0; i < 60; ++i) {
    TuningPair pair{modal(block), modal(block), 0.01};
    const double bent = std::pow(10.0, random.uniform(-5.0, -1.5));
    const Vec3 tilt = std::pow(10.0, random.uniform(-5.0, -1.0)) * random.vector(1.0);
    pair.a->place(
        {quaternion_from_rotation_vector(tilt), {random.uniform(-0.3, 0.3), 1.0 + random.uniform(-0.01, 0.01), 0.1}},
        random.amplitudes(4, bent));
    pair.b->place({}, random.amplitudes(4, bent));
    pairs.push_back(std::move(pair));
  }
  const Vec3 half(0.25, 0.2, 0.15);
  for (int i = 0; i < 120; ++i) {
    TuningPair pair{box_of_triangles(half), std::make_unique<Body>(Shape{Box{half}}), 0.02};
    pair.a->place({random.pose(1.0).q, random.uniform(0.3, 0.5) * random.vector(1.0).normalized()});
    pair.b->place({});
    pair.ahead = 0.1 * random.vector(1.0);
    pairs.push_back(std::move(pair));
  }
}

/// Solids bent by a tenth and by half, one within the other, by the rest shape and by their tetrahedra.
void add_solids(std::vector<TuningPair>& pairs) {
  Random random(73);
  const auto bar = testing::solid(testing::solid_box({0.75, 0.25, 0.25}, {6, 2, 2}), 4);
  const auto ball = testing::solid(testing::tet_ball(0.4, 4), 3);
  for (int i = 0; i < 40; ++i) {
    TuningPair pair{modal(bar), modal(ball), 0.02, OverlapMethod::kRestDepth, i % 2 == 1};
    pair.a->use_volume(), pair.b->use_volume();
    pair.a->place(random.pose(1.0), random.amplitudes(4, i % 4 < 2 ? 0.05 : 0.25));
    pair.b->place({random.pose(1.0).q, pair.a->pose.p + 0.5 * random.vector(1.0).normalized()},
                  random.amplitudes(3, 0.05));
    pairs.push_back(std::move(pair));
  }
}

ConvexHull hull(Random& random) {
  ConvexHull shape;
  for (int i = 0; i < 24; ++i) shape.points.push_back(0.4 * random.vector(1.0));
  return shape;
}

}  // namespace

std::vector<TuningPair> surface_pairs() {
  std::vector<TuningPair> pairs;
  add_random_pairs(pairs), add_resting_boxes(pairs), add_crossed_bars(pairs), add_seams(pairs);
  add_solids(pairs), add_unjudged(pairs);
  return pairs;
}

std::vector<TuningPair> convex_pairs() {
  std::vector<TuningPair> pairs;
  Random random(74);
  const Vec3 half(0.3, 0.24, 0.18);
  const auto shape = [&](int kind) {
    return kind == 0   ? Shape{Box{half}}
           : kind == 1 ? Shape{Capsule{0.2, 0.3}}
           : kind == 2 ? Shape{hull(random)}
                       : Shape{Sphere{0.3}};
  };
  for (int i = 0; i < 240; ++i) {
    TuningPair pair{std::make_unique<Body>(shape(i % 4)), std::make_unique<Body>(shape(i / 4 % 3)), 0.05};
    pair.a->place(random.pose(1.0));
    pair.b->place({random.pose(1.0).q, pair.a->pose.p + random.uniform(0.3, 0.7) * random.vector(1.0).normalized()});
    pairs.push_back(std::move(pair));
  }
  for (int i = 0; i < 120; ++i) {
    TuningPair pair{std::make_unique<Body>(Shape{Box{half}}), std::make_unique<Body>(Shape{Box{half}}), 0.01};
    const double small = std::pow(10.0, random.uniform(-16.0, -2.0));
    pair.b->place({});
    pair.a->place(
        {quaternion_from_rotation_vector(Vec3(0.0, 0.0, random.uniform(-3.0, 3.0)) + small * random.vector(1.0)),
         {random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), 2.0 * half.z() + small * random.uniform(-1.0, 1.0)}});
    pair.upright = 3.0 * small;
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

}  // namespace limber
