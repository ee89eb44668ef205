#include "limber/dynamics/reconstruct.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <span>
#include <vector>

#include "asked.h"
#include "instruction_sets.h"
#include "limber/core/error.h"
#include "limber/dynamics/half_basis.h"

namespace limber {
namespace {

/// A surface of random points, shapes and triangles; every vertex is in a triangle where there are three or more.
ModalSurface random_surface(Index vertices, Index modes) {
  std::mt19937 random(static_cast<unsigned>(vertices * 1000 + modes));
  std::normal_distribution<float> normal;
  const auto vector = [&] { return Vec3f(normal(random), normal(random), normal(random)); };
  ModalSurface surface{.rest = {}, .triangles = {}, .basis = ModalBasis(vertices, modes)};
  for (Index v = 0; v < vertices; ++v) {
    surface.rest.push_back(vector());
    for (Index m = 0; m < modes; ++m) surface.basis.set(v, m, 0.1f * vector());
    if (v >= 2) surface.triangles.push_back({v - 2, v - 1, v});
  }
  return surface;
}

/// Instances of one surface with random poses and amplitudes, and room for their vertices.
struct Instances {
  std::vector<std::vector<double>> amplitudes;
  std::vector<std::vector<float>> positions, normals;
  std::vector<ReconstructionTarget> targets;

  Instances(const ModalSurface& surface, int count, bool with_normals = false) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    const std::size_t modes = static_cast<std::size_t>(surface.basis.modes());
    for (int i = 0; i < count; ++i) {
      amplitudes.emplace_back(modes);
      for (double& z : amplitudes.back()) z = normal(random);
      positions.emplace_back(3 * surface.rest.size() + kGuard, kUntouched);
      normals.emplace_back(3 * surface.rest.size() + kGuard, kUntouched);
      const RigidTransform X{normalized(Quaternion{normal(random), normal(random), normal(random), normal(random)}),
                             3.0 * Vec3(normal(random), normal(random), normal(random))};
      targets.push_back(
          {X, amplitudes.back().data(), positions.back().data(), with_normals ? normals.back().data() : nullptr});
    }
  }

  static constexpr std::size_t kGuard = 48;  // one tile: what a careless store of a partial tile would touch
  static constexpr float kUntouched = -12345.0f;
};

/// |float − exact| ≤ (k + 4)·u·Σ|z_m||shape_m| for the sum (k products and sums, the rounded amplitudes and what the
/// rest adds), and 8u of the size of every term of the rotated and moved point; u = 2⁻²⁴.
double rounding_bound(const ModalSurface& surface, Index v, const ReconstructionTarget& target) {
  constexpr double u = 0x1p-24;
  double displacement = 0.0;
  for (Index m = 0; m < surface.basis.modes(); ++m)
    displacement += std::abs(target.amplitudes[m]) * surface.basis.shape(v, m).cast<double>().norm();
  if (target.displacement) displacement += Eigen::Map<const Vec3f>(target.displacement + 3 * v).cast<double>().norm();
  const double size = surface.rest[v].cast<double>().norm() + displacement;
  return u * ((surface.basis.modes() + 4) * displacement + 8.0 * size + 2.0 * target.X_OB.p.norm());
}

Vec3 exact_position(const ModalSurface& surface, Index v, const ReconstructionTarget& target) {
  Vec3 p = surface.rest[v].cast<double>();
  if (target.displacement) p += Eigen::Map<const Vec3f>(target.displacement + 3 * v).cast<double>();
  for (Index m = 0; m < surface.basis.modes(); ++m)
    p += target.amplitudes[m] * surface.basis.shape(v, m).cast<double>();
  return target.X_OB * p;
}

void expect_exact_within_rounding(const ModalSurface& surface, const ReconstructionTarget& target) {
  for (Index v = 0; v < surface.vertices(); ++v) {
    const Eigen::Map<const Vec3f> p(target.positions + 3 * v);
    const double error = (p.cast<double>() - exact_position(surface, v, target)).norm();
    ASSERT_LE(error, std::sqrt(3.0) * rounding_bound(surface, v, target)) << "vertex " << v;
  }
}

TEST(Reconstruct, EqualsTheDoubleSumWithinFloatRoundingOnEveryInstructionSet) {
  for_each_instruction_set([](std::int64_t target) {
    for (const Index vertices : {1, 3, 15, 16, 17, 100})
      for (const Index modes : {0, 1, 7, 32, 300})
        for (const int count : {1, 2, 3, 7, 8, 13}) {
          SCOPED_TRACE(::testing::Message() << hwy::TargetName(target) << ": " << vertices << " vertices, " << modes
                                            << " modes, " << count << " instances");
          const ModalSurface surface = random_surface(vertices, modes);
          Instances instances(surface, count);
          // Every third one is displaced beside its modes, as others of its block are not.
          const std::vector<float> moved(3 * surface.rest.size(), 0.3f);
          for (std::size_t i = 1; i < instances.targets.size(); i += 3)
            instances.targets[i].displacement = moved.data();
          reconstruct(surface, instances.targets);
          for (const auto& t : instances.targets) expect_exact_within_rounding(surface, t);
        }
  });
}

TEST(Reconstruct, WritesNothingPastTheLastVertex) {
  for_each_instruction_set([](std::int64_t) {
    for (Index vertices = 1; vertices <= 33; ++vertices)
      for (const int count : {1, 8}) {
        const ModalSurface surface = random_surface(vertices, 3);
        const Instances instances(surface, count, true);
        reconstruct(surface, instances.targets);
        for (const auto* arrays : {&instances.positions, &instances.normals})
          for (const auto& array : *arrays) {
            const std::span<const float> guard = std::span(array).last(Instances::kGuard);
            EXPECT_THAT(guard, ::testing::Each(Instances::kUntouched)) << vertices << " vertices";
            EXPECT_THAT(std::span(array).first(array.size() - guard.size()),
                        ::testing::Each(::testing::Ne(Instances::kUntouched)));
          }
      }
  });
}

TEST(Reconstruct, InstructionSetsWithFusedMultiplyAddGiveTheSameBits) {
  const ModalSurface surface = random_surface(100, 20);
  std::vector<std::vector<std::vector<float>>> results;
  for_each_instruction_set([&](std::int64_t target) {
    const Instances instances(surface, 13);
    reconstruct(surface, instances.targets);
    if (has_fused_multiply_add(target)) results.push_back(instances.positions);
  });
  for (const auto& result : results) EXPECT_EQ(result, results.front());
}

TEST(Reconstruct, MoreModesThanOneBlockHoldsAreExactToo) {
  // 1,024 modes of 8 instances fill the stack buffer of amplitudes: beyond, blocks are of fewer.
  const ModalSurface surface = random_surface(17, 3000);
  const Instances instances(surface, 5);
  reconstruct(surface, instances.targets);
  for (const auto& target : instances.targets) expect_exact_within_rounding(surface, target);
}

TEST(Reconstruct, RestShapeOfNoModesIsMovedRigidly) {
  ModalSurface surface = random_surface(20, 0);
  std::vector<float> positions(60);
  const double quarter = std::sqrt(0.5);
  const ReconstructionTarget target{.X_OB = {{quarter, 0.0, 0.0, quarter}, {10.0, 0.0, 0.0}},
                                    .positions = positions.data()};
  reconstruct(surface, {&target, 1});
  for (Index v = 0; v < 20; ++v) {  // a quarter turn about z: x → y, y → −x
    EXPECT_FLOAT_EQ(positions[3 * v], 10.0f - surface.rest[v].y());
    EXPECT_NEAR(positions[3 * v + 1], surface.rest[v].x(), 1e-6f);
    EXPECT_EQ(positions[3 * v + 2], surface.rest[v].z());
  }
}

TEST(Reconstruct, TinyDeformationOfALargeBodyKeepsItsDigits) {
  // 64 modes that all but cancel at a point 1 m out: summed from the rest position each would round to 6e-8 m.
  ModalSurface surface{.rest = {Vec3f(1.0f, 0.0f, 0.0f)}, .triangles = {}, .basis = ModalBasis(1, 64)};
  for (Index m = 0; m < 64; ++m) surface.basis.set(0, m, Vec3f(1.0f, 0.0f, 0.0f));
  std::vector<double> amplitudes(64, 0x1p-25);  // half an ulp of 1 each: lost one by one, 2⁻¹⁹ together
  Vec3f position;
  const ReconstructionTarget target{.X_OB = {}, .amplitudes = amplitudes.data(), .positions = position.data()};
  reconstruct(surface, {&target, 1});
  EXPECT_EQ(position.x(), 1.0f + 0x1p-19f);
}

/// Splits every loop to single indices and runs them last to first.
class BackwardsJobs final : public Jobs {
 public:
  void parallel_for(std::size_t count, std::size_t,
                    const std::function<void(std::size_t, std::size_t)>& body) override {
    for (std::size_t i = count; i-- > 0;) body(i, i + 1);
  }
  int concurrency() const override { return 1; }
};

TEST(Batch, ManyEqualsOneByOne) {
  for_each_instruction_set([](std::int64_t target) {
    for (const Index modes : {0, 5, 40, testing::all_or_tenth(2000)}) {
      SCOPED_TRACE(::testing::Message() << hwy::TargetName(target) << ", " << modes << " modes");
      const ModalSurface surface = random_surface(777, modes);
      const Instances together(surface, 23, true), alone(surface, 23, true), backwards(surface, 23, true);
      reconstruct(surface, together.targets);
      for (const auto& one : alone.targets) reconstruct(surface, {&one, 1});
      BackwardsJobs jobs;
      reconstruct(surface, backwards.targets, jobs);
      EXPECT_EQ(together.positions, alone.positions);
      EXPECT_EQ(together.normals, alone.normals);
      EXPECT_EQ(together.positions, backwards.positions);
      EXPECT_EQ(together.normals, backwards.normals);
    }
  });
}

TEST(Reconstruct, RejectsMissingArraysAndWrongSurfaces) {
  const ModalSurface surface = random_surface(5, 2);
  Instances instances(surface, 2, true);
  auto targets = instances.targets;
  targets[1].positions = nullptr;
  EXPECT_THROW(reconstruct(surface, targets), InvalidArgument);
  targets = instances.targets, targets[1].amplitudes = nullptr;
  EXPECT_THROW(reconstruct(surface, targets), InvalidArgument);
  ModalSurface wrong = random_surface(5, 2);
  wrong.rest.pop_back();
  EXPECT_THROW(reconstruct(wrong, instances.targets), InvalidArgument);
  wrong = random_surface(5, 2), wrong.triangles[1][2] = 5;
  EXPECT_THROW(reconstruct(wrong, instances.targets), InvalidArgument);
  EXPECT_THROW(reconstruct(random_surface(1, 8193), instances.targets), InvalidArgument);
  EXPECT_THAT(instances.positions, ::testing::Each(::testing::Each(Instances::kUntouched)));
  EXPECT_NO_THROW(reconstruct(surface, {}));
}

/// A sphere of radius 1 about `center`: `rings` circles of latitude between two poles.
struct Sphere {
  std::vector<float> positions;
  std::vector<Triangle> triangles;

  Sphere(Index rings, float radius) {
    const Index sectors = 2 * rings;
    const auto add = [&](double polar, double azimuth) {
      positions.push_back(radius * static_cast<float>(std::sin(polar) * std::cos(azimuth)));
      positions.push_back(radius * static_cast<float>(std::sin(polar) * std::sin(azimuth)));
      positions.push_back(radius * static_cast<float>(std::cos(polar)));
    };
    add(0.0, 0.0);
    for (Index ring = 1; ring <= rings; ++ring)
      for (Index s = 0; s < sectors; ++s)
        add(std::numbers::pi * ring / (rings + 1), 2.0 * std::numbers::pi * (s + 0.5 * ring) / sectors);
    add(std::numbers::pi, 0.0);
    const auto at = [&](Index ring, Index s) { return 1 + (ring - 1) * sectors + s % sectors; };
    const Index south = 1 + rings * sectors;
    for (Index s = 0; s < sectors; ++s) {
      triangles.push_back({0, at(1, s), at(1, s + 1)});
      triangles.push_back({south, at(rings, s + 1), at(rings, s)});
      for (Index ring = 1; ring < rings; ++ring) {
        triangles.push_back({at(ring, s), at(ring + 1, s), at(ring, s + 1)});
        triangles.push_back({at(ring, s + 1), at(ring + 1, s), at(ring + 1, s + 1)});
      }
    }
  }
};

TEST(VertexNormals, OfASphereArePositionsForAnySize) {
  for (const float radius : {1e-6f, 1.0f, 1e6f}) {
    const Sphere sphere(40, radius);
    std::vector<float> normals(sphere.positions.size());
    vertex_normals(sphere.triangles, sphere.positions, normals);
    ASSERT_NE(normals.size() / 3 % 16, 0u);  // the last vertices are less than a vector
    for (std::size_t i = 0; i < normals.size(); i += 3) {
      const Eigen::Map<const Vec3f> n(&normals[i]), p(&sphere.positions[i]);
      EXPECT_NEAR(n.norm(), 1.0f, 2e-7f);
      // Facets are π/41 wide; the mean of those round a vertex leans by less than a facet's sagitta.
      EXPECT_GT(n.dot(p) / radius, std::cos(std::numbers::pi / 41.0 / 2.0));
    }
  }
}

TEST(VertexNormals, WeighByAreaAndPointUpWhereThereIsNone) {
  // A vertex at the corner of a 1 × 1 triangle facing z and one of twice the area facing x; the last vertex is free.
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 2, 5, 5, 5};
  const std::vector<Triangle> triangles{{0, 1, 2}, {0, 2, 3}};
  std::vector<float> normals(15);
  vertex_normals(triangles, positions, normals);
  EXPECT_FLOAT_EQ(normals[0], 2.0f / std::sqrt(5.0f));
  EXPECT_FLOAT_EQ(normals[1], 0.0f);
  EXPECT_FLOAT_EQ(normals[2], 1.0f / std::sqrt(5.0f));
  EXPECT_THAT(std::span(normals).last(3), ::testing::ElementsAre(0.0f, 0.0f, 1.0f));
}

TEST(VertexNormals, RejectArraysAndIndicesThatDoNotFit) {
  std::vector<float> positions(9), normals(9), short_normals(6);
  EXPECT_THROW(vertex_normals({}, positions, short_normals), InvalidArgument);
  EXPECT_THROW(vertex_normals({}, std::span(positions).first(8), std::span(normals).first(8)), InvalidArgument);
  EXPECT_THROW(vertex_normals(std::vector<Triangle>{{0, 1, 3}}, positions, normals), InvalidArgument);
  EXPECT_THROW(vertex_normals(std::vector<Triangle>{{0, -1, 2}}, positions, normals), InvalidArgument);
}

TEST(HalfBasis, MovesVerticesByNoMoreThanItTells) {
  for (const Index vertices : {5, 16, 100}) {
    const ModalSurface surface = random_surface(vertices, 9);
    const HalfBasis half(surface.basis);
    Instances instances(surface, 11);
    reconstruct(surface, half, instances.targets);
    double largest_share = 0.0;
    for (const ReconstructionTarget& target : instances.targets) {
      double told = 0.0;
      for (std::size_t i = 0; i < 9; ++i) told += std::abs(target.amplitudes[i]) * half.errors()[i];
      for (Index v = 0; v < vertices; ++v) {
        const Vec3 seen = Eigen::Map<const Vec3f>(target.positions + 3 * v).cast<double>();
        const double off = (seen - exact_position(surface, v, target)).norm();
        EXPECT_LE(off, told + rounding_bound(surface, v, target));
        largest_share = std::max(largest_share, off / told);
      }
      for (std::size_t guard = 0; guard < Instances::kGuard; ++guard)
        EXPECT_EQ(target.positions[3 * static_cast<std::size_t>(vertices) + guard], Instances::kUntouched);
    }
    EXPECT_GT(largest_share, 0.1);
  }
}

TEST(HalfBasis, KeepsElevenDigitsOfModesOfAnySize) {
  ModalSurface surface = random_surface(40, 3);
  for (Index v = 0; v < 40; ++v) {
    surface.basis.set(v, 1, 1e-9f * surface.basis.shape(v, 1));
    surface.basis.set(v, 2, 1e7f * surface.basis.shape(v, 2));
  }
  const HalfBasis half(surface.basis);
  for (Index m = 0; m < 3; ++m) {
    double largest = 0.0;
    for (Index v = 0; v < 40; ++v) largest = std::max(largest, static_cast<double>(surface.basis.shape(v, m).norm()));
    EXPECT_LE(half.errors()[static_cast<std::size_t>(m)], 0x1p-11 * largest);
    EXPECT_GT(half.errors()[static_cast<std::size_t>(m)], 0.0);
  }
}

TEST(HalfBasis, GivesTheSameBitsHoweverTargetsAreGrouped) {
  const ModalSurface surface = random_surface(37, 6);
  const HalfBasis half(surface.basis);
  Instances together(surface, 13), alone(surface, 13);
  reconstruct(surface, half, together.targets);
  for (const ReconstructionTarget& target : alone.targets) reconstruct(surface, half, {&target, 1});
  EXPECT_EQ(together.positions, alone.positions);
}

TEST(HalfBasis, RefusesTheBasisOfAnotherSurface) {
  const ModalSurface surface = random_surface(20, 4), other = random_surface(20, 5);
  Instances instances(surface, 1);
  EXPECT_THROW(reconstruct(surface, HalfBasis(other.basis), instances.targets), InvalidArgument);
}

}  // namespace
}  // namespace limber
