// Depth of overlap on bent bodies.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "asked.h"
#include "random_states.h"
#include "solid_bodies.h"

namespace limber {
namespace {

using testing::Body;
using testing::Random;

constexpr double kBarLength = 4.0, kHalf = 0.5;

Vec3 on_arc(const Vec3& r, double angle) {
  const double radius = kBarLength / angle, a = r.x() / radius;
  return {(radius - r.z()) * std::sin(a), r.y(), radius - (radius - r.z()) * std::cos(a)};
}

std::shared_ptr<const ModalModel> arc(double angle) {
  const TetMesh mesh = testing::solid_box({0.5 * kBarLength, kHalf, kHalf}, {24, 6, 6});
  ModalModelData data = testing::solid_data(mesh, 1);
  for (Index v = 0; v < data.render.vertices(); ++v) {
    const Vec3 r = data.render.rest[static_cast<std::size_t>(v)].cast<double>();
    data.render.basis.set(v, 0, (on_arc(r, angle) - r).cast<float>());
  }
  for (Index v = 0; v < static_cast<Index>(mesh.nodes.size()); ++v) {
    const Vec3& r = mesh.nodes[static_cast<std::size_t>(v)];
    data.volume_block->basis.set(v, 0, (on_arc(r, angle) - r).cast<float>());
  }
  return std::make_shared<const ModalModel>(std::move(data));
}

/// Of a point in a body, by one of the rules: a corner of a box that is small beside its depth.
ContactPoint at_point(Body& bar, const Vec3& p, OverlapMethod overlap) {
  constexpr double kProbe = 1e-4;
  Body probe(Shape{Box{Vec3::Constant(kProbe)}});
  probe.place_box({{}, p + Vec3::Constant(kProbe)}, Vec3::Constant(kProbe));
  for (const ContactPoint& c : contacts_of(bar, probe, 0.0, {.overlap = overlap}))
    if (testing::key_of(c, 1) == static_cast<std::uint32_t>(Feature::Kind::kVertex) << 30) return c;
  return {};
}

// Bent without being stretched along its middle, a bar's thickness stays what it was.
TEST(RestDepth, IsTheDepthOfTheNearestPointInABentBar) {
  for (const double degrees : testing::all_or_first<double>({90.0, 10.0, 30.0, 60.0})) {
    const double angle = degrees * std::numbers::pi / 180.0;
    Body bar(arc(angle));
    bar.use_volume();
    bar.place({}, {1.0});
    Random random(5);
    std::vector<double> turns;
    for (int i = 0; i < 300; ++i) {
      const Vec3 r = random.vector(1.0).cwiseProduct(Vec3(0.4 * kBarLength, 0.48, 0.48));
      const ContactPoint rest = at_point(bar, on_arc(r, angle), OverlapMethod::kRestDepth),
                         nearest = at_point(bar, on_arc(r, angle), OverlapMethod::kNearestPoint);
      if (!(nearest.gap < 0.0)) continue;  // between the mesh and the arc
      EXPECT_NEAR(rest.gap / nearest.gap, 1.0, 0.005) << degrees << "°";
      turns.push_back(std::acos(std::clamp(rest.normal.dot(nearest.normal), -1.0, 1.0)));
    }
    ASSERT_GT(turns.size(), 250u);
    std::ranges::sort(turns);
    // The rest where two sides are equally near: either is right.
    EXPECT_LT(turns[turns.size() * 98 / 100], 1.0 * std::numbers::pi / 180.0) << degrees << "°";
  }
}

// A block pressed flat: the nearest side is another one then, and what was pushed out to a side goes on to be.
TEST(RestDepth, KeepsTheSideThatWasNearestAtRestHoweverABodyIsSqueezed) {
  const TetMesh mesh = testing::solid_box({0.5, 0.5, 0.5}, {4, 4, 4});
  ModalModelData data = testing::solid_data(mesh, 1);
  for (Index v = 0; v < data.render.vertices(); ++v)
    data.render.basis.set(v, 0, Vec3f(0.0f, 0.0f, -data.render.rest[static_cast<std::size_t>(v)].z()));
  for (Index v = 0; v < static_cast<Index>(mesh.nodes.size()); ++v)
    data.volume_block->basis.set(v, 0,
                                 Vec3f(0.0f, 0.0f, static_cast<float>(-mesh.nodes[static_cast<std::size_t>(v)].z())));
  Body block(std::make_shared<const ModalModel>(std::move(data)));
  block.use_volume();
  for (const double squeezed : {0.0, 0.3, 0.6}) {
    block.place({}, {squeezed});
    const Vec3 p(0.3, 0.05, 0.2 * (1.0 - squeezed));  // 0.2 from the side and 0.3 from the top at rest
    const ContactPoint rest = at_point(block, p, OverlapMethod::kRestDepth),
                       nearest = at_point(block, p, OverlapMethod::kNearestPoint);
    EXPECT_NEAR(rest.gap, -0.2, 1e-6);
    EXPECT_NEAR(std::abs(rest.normal.x()), 1.0, 1e-6);
    EXPECT_NEAR(nearest.gap, -std::min(0.2, 0.3 * (1.0 - squeezed)), 1e-6);
    if (squeezed > 0.5) {
      EXPECT_NEAR(std::abs(nearest.normal.z()), 1.0, 1e-6);
    }
  }
}

}  // namespace
}  // namespace limber
