#include "limber/collision/deformed_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "counted_new.h"
#include "instruction_sets.h"
#include "limber/core/error.h"
#include "random_states.h"
#include "shapes.h"
#include "wavy_surface.h"

namespace limber {
namespace {

using testing::Random;
using testing::wavy_surface;

std::shared_ptr<const CollisionSurface> wavy_sphere(int splits, Index modes, int leaf_triangles = 4) {
  return wavy_surface(shapes::sphere(Vec3(0.3, -0.2, 0.1), 1.0, splits), modes, leaf_triangles);
}

/// No vertex below a node lies outside its box, compared without any tolerance.
void expect_all_enclosed(DeformedSurface& body) {
  for (std::size_t n = 0; n < body.surface().nodes().size(); ++n) {
    const Aabb box = body.bounds(static_cast<Index>(n));
    for (const Index t : body.surface().node_triangles(static_cast<Index>(n)))
      for (const Vec3& p : body.triangle(t))
        ASSERT_TRUE(box.contains(p)) << "node " << n << ", triangle " << t << ", outside by "
                                     << ((box.low - p).cwiseMax(p - box.high)).maxCoeff();
  }
}

TEST(DeformedSurface, VerticesAreRestPlusBasisTimesAmplitudesInDouble) {
  Random random(3);
  const auto surface = wavy_sphere(2, 19);
  const std::vector<double> z = random.amplitudes(19, 0.3);
  DeformedSurface body;
  body.bind(surface, z);
  constexpr double kRoundOff = 32 * std::numeric_limits<double>::epsilon();  // of some twenty terms up to 1
  for (Index v = 0; v < surface->vertices(); ++v) {
    Vec3 p = surface->model()->collision().rest[static_cast<std::size_t>(v)].cast<double>();
    for (Index i = 0; i < 19; ++i)
      p += z[static_cast<std::size_t>(i)] * surface->model()->collision().basis.shape(v, i).cast<double>();
    EXPECT_LE((body.vertex(v) - p).norm(), kRoundOff);
  }
}

TEST(DeformedSurface, BoxesOfEveryNodeEncloseItsVertices) {
  Random random(1);
  DeformedSurface body;
  for (const Index modes : {0, 1, 7, 16, 33})
    for (const int leaf_triangles : {1, 4, 8}) {
      const auto surface = wavy_sphere(2, modes, leaf_triangles);
      for (int trial = 0; trial < 200; ++trial) {  // from unseen to a million times the body's size
        body.bind(surface, random.amplitudes(modes, std::pow(10.0, random.uniform(-12.0, 6.0))));
        expect_all_enclosed(body);
        if (HasFatalFailure()) return;
      }
    }
}

TEST(DeformedSurface, BoxesEncloseOnEveryInstructionSet) {
  for_each_instruction_set([](std::int64_t) {
    Random random(5);
    const auto surface = wavy_sphere(1, 21);
    DeformedSurface body;
    for (int trial = 0; trial < 50; ++trial) {
      body.bind(surface, random.amplitudes(21, std::pow(10.0, random.uniform(-6.0, 6.0))));
      expect_all_enclosed(body);
      if (HasFatalFailure()) return;
    }
  });
}

TEST(DeformedSurface, VerticesHaveTheSameBitsOnEveryInstructionSetWithFusedMultiplyAdd) {
  Random random(6);
  const auto surface = wavy_sphere(1, 37);
  const std::vector<double> z = random.amplitudes(37, 0.5);
  std::vector<Vec3> first;
  for_each_instruction_set([&](std::int64_t target) {
    if (!has_fused_multiply_add(target)) return;
    DeformedSurface body;
    body.bind(surface, z);
    std::vector<Vec3> here;
    for (Index v = 0; v < surface->vertices(); ++v) here.push_back(body.vertex(v));
    if (first.empty()) first = here;
    EXPECT_EQ(here, first);
  });
}

TEST(DeformedSurface, BoxesEncloseFarFromTheOriginAndAtTinyScales) {
  Random random(7);
  for (const double scale : {1e-9, 1.0, 1e9}) {
    SurfaceMesh mesh = shapes::sphere(Vec3(50.0, -20.0, 3.0), 1.0, 2);
    for (Vec3& p : mesh.vertices) p *= scale;
    const auto surface = wavy_surface(mesh, 9);
    DeformedSurface body;
    for (int trial = 0; trial < 50; ++trial) {
      body.bind(surface, random.amplitudes(9, scale * std::pow(10.0, random.uniform(-9.0, 3.0))));
      expect_all_enclosed(body);
      if (HasFatalFailure()) return;
    }
  }
}

/// ‖z‖ in the norm of the eigenvalues is the root of twice the elastic energy. Where all modes share it, no vertex can
/// have the largest shape of every mode at once, and the bound by energy is less than Σ d|z|; where one mode has all of
/// it, the sum is the tight one.
TEST(DeformedSurface, BothBoundsTakePart) {
  constexpr Index kModes = 32;
  ModalModelData data = testing::wavy_data(shapes::sphere(Vec3::Zero(), 1.0, 3), kModes);
  data.eigenvalues.assign(kModes, 100.0);
  const auto surface = std::make_shared<const CollisionSurface>(std::make_shared<const ModalModel>(std::move(data)));
  DeformedSurface body;
  const auto growth = [&](const std::vector<double>& z) {
    body.bind(surface, std::vector<double>(kModes, 0.0));
    const double at_rest = body.bounds(0).half_extents().sum();
    body.bind(surface, z);
    return body.bounds(0).half_extents().sum() - at_rest;
  };
  double sum_of_singles = 0.0;
  for (std::size_t i = 0; i < kModes; ++i) {
    std::vector<double> z(kModes, 0.0);
    z[i] = 0.01;
    sum_of_singles += growth(z);
    EXPECT_LE(growth(z), 3.0 * 0.01 * 1.01) << "no wave is higher than 1 along any axis";
  }
  EXPECT_LT(growth(std::vector<double>(kModes, 0.01)), 0.9 * sum_of_singles);
}

TEST(DeformedSurface, AShapeTurnedInsideOutIsEnclosed) {
  // Amplitudes that mirror the body through its centre: mode 0 is the position itself.
  SurfaceMesh mesh = shapes::sphere(Vec3::Zero(), 1.0, 2);
  ModalModelData data = testing::wavy_data(mesh, 1);
  for (Index v = 0; v < static_cast<Index>(mesh.vertices.size()); ++v)
    data.render.basis.set(v, 0, mesh.vertices[static_cast<std::size_t>(v)].cast<float>());
  const auto surface = std::make_shared<const CollisionSurface>(std::make_shared<const ModalModel>(std::move(data)));
  DeformedSurface body;
  for (const double z : {-1.0, -2.0, -3.0}) {  // to a point, to its mirror image, to twice its size
    body.bind(surface, std::vector{z});
    expect_all_enclosed(body);
    const Aabb all = body.bounds(0);
    EXPECT_GE(all.half_extents().minCoeff(), 0.99 * std::abs(1.0 + z));
  }
}

TEST(DeformedSurface, DegenerateSurfacesAreEnclosed) {
  Random random(8);
  SurfaceMesh one{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  SurfaceMesh flat{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 1, 3}}};
  SurfaceMesh doubled{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {1, 0, 0}, {0, 0, 1}},
                      {{0, 1, 2}, {3, 4, 5}, {0, 3, 5}}};
  for (const SurfaceMesh& mesh : {one, flat, doubled}) {
    const auto surface = wavy_surface(mesh, 5, 1);
    DeformedSurface body;
    for (int trial = 0; trial < 100; ++trial) {
      body.bind(surface, random.amplitudes(5, 10.0));
      expect_all_enclosed(body);
    }
  }
}

TEST(DeformedSurface, ARigidSurfaceHasConstantBoxes) {
  const auto surface = std::make_shared<const CollisionSurface>(Box{.half_extents = {1.0, 2.0, 3.0}});
  DeformedSurface body;
  body.bind(surface, {});
  expect_all_enclosed(body);
  const Aabb box = body.bounds(0);
  constexpr double kGuard = 64 * 0x1p-24 * 3.0;  // the guard: some ulps of a float of size 3
  EXPECT_LE((box.high - Vec3(1.0, 2.0, 3.0)).cwiseAbs().maxCoeff(), kGuard);
}

TEST(DeformedSurface, TheWholeBodysBoxCostsOneBoxAndNoVertex) {
  const auto surface = wavy_sphere(3, 8);
  DeformedSurface body;
  body.bind(surface, std::vector<double>(8, 0.1));
  (void)body.bounds(0);
  EXPECT_EQ(body.counters().boxes, 1);
  EXPECT_EQ(body.counters().vertices, 0);
}

TEST(DeformedSurface, AStateIsForgottenWithTheNextOne) {
  const auto surface = wavy_sphere(2, 6);
  DeformedSurface reused, fresh;
  Random random(9);
  for (int trial = 0; trial < 20; ++trial) {
    const std::vector<double> z = random.amplitudes(6, 1.0);
    reused.bind(surface, z);
    fresh = DeformedSurface();
    fresh.bind(surface, z);
    for (Index n = 0; n < static_cast<Index>(surface->nodes().size()); ++n) {
      EXPECT_EQ(reused.bounds(n).low, fresh.bounds(n).low);
      EXPECT_EQ(reused.bounds(n).high, fresh.bounds(n).high);
    }
    for (Index v = 0; v < surface->vertices(); ++v) EXPECT_EQ(reused.vertex(v), fresh.vertex(v));
  }
}

TEST(DeformedSurface, WarmBindingAndReadingAllocateNothing) {
  const auto large = wavy_sphere(3, 24), small = wavy_sphere(1, 5);
  const std::vector<double> z(24, 0.01), y(5, 0.02);
  DeformedSurface body;
  const auto all = [&] {
    body.bind(large, z);
    for (Index n = 0; n < static_cast<Index>(large->nodes().size()); ++n) (void)body.bounds(n);
    for (Index v = 0; v < large->vertices(); ++v) (void)body.vertex(v);
    body.bind(small, y);
    (void)body.bounds(0);
  };
  all();
  const long before = testing::allocations();
  all();
  EXPECT_EQ(testing::allocations(), before);
}

TEST(DeformedSurface, RefusesStatesThatAreNone) {
  const auto surface = wavy_sphere(1, 3);
  DeformedSurface body;
  EXPECT_THROW(body.bind(nullptr, {}), InvalidArgument);
  EXPECT_THROW(body.bind(surface, std::vector<double>(2, 0.0)), InvalidArgument);
  EXPECT_THROW(body.bind(surface, std::vector{0.0, std::nan(""), 0.0}), InvalidArgument);
  EXPECT_THROW(body.bind(surface, std::vector{0.0, 0.0, std::numeric_limits<double>::infinity()}), InvalidArgument);
  EXPECT_THROW(body.bind(surface, std::vector{1e31, 0.0, 0.0}), InvalidArgument);
  EXPECT_NO_THROW(body.bind(surface, std::vector{1e29, 0.0, 0.0}));
  expect_all_enclosed(body);
}

}  // namespace
}  // namespace limber
