#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "instruction_sets.h"
#include "limber/core/error.h"
#include "limber/dynamics/reconstruct.h"

namespace limber {
namespace {

/// A surface of random points and shapes on random handles. The last handle is the ground, and every fifth vertex hangs
/// on it alone and has no shapes.
struct SkinnedSurface {
  ModalSurface surface;
  ModalSkin skin;

  SkinnedSurface(Index vertices, Index modes, Index handles) {
    std::mt19937 random(static_cast<unsigned>(vertices * 1000 + modes));
    std::normal_distribution<double> normal;
    const auto vector = [&] { return Vec3f(Vec3(normal(random), normal(random), normal(random)).cast<float>()); };
    surface.basis = ModalBasis(vertices, modes);
    skin.handles = handles, skin.modes = modes;
    const auto n = static_cast<std::size_t>(handles), k = static_cast<std::size_t>(modes);
    for (Index v = 0; v < vertices; ++v) {
      surface.rest.push_back(vector());
      if (v >= 2) surface.triangles.push_back({v - 2, v - 1, v});
      std::vector<double> weights(n, 0.0);
      if (is_held(v)) {
        weights.back() = 1.0;
      } else {
        for (Index m = 0; m < modes; ++m) surface.basis.set(v, m, 0.1f * vector());
        for (double& w : weights) w = std::abs(normal(random));
      }
      skin.render.push_back(skin_influences(weights));
    }
    const auto fill = [&](std::vector<float>& numbers, std::size_t count, double size) {
      for (std::size_t i = 0; i < count; ++i) numbers.push_back(static_cast<float>(size * normal(random)));
    };
    for (std::size_t h = 0; h < n; ++h)
      skin.rest.push_back(h + 1 < n ? Vec3(vector().cast<double>()) : Vec3(Vec3::Zero()));
    fill(skin.rotations, 3 * n * k, 0.3);
    fill(skin.arms, 3 * n * n, 0.3);
    fill(skin.shifts, 3 * n * n * k, 0.05);
    hold(n, k);
  }

  static bool is_held(Index vertex) { return vertex % 5 == 4; }

  Vec3 position(const SkinPose& pose, Index v, std::span<const double> z, const Vec3& more = Vec3::Zero()) const {
    Vec3 linear = more;
    for (Index m = 0; m < surface.basis.modes(); ++m)
      linear += z[static_cast<std::size_t>(m)] * surface.basis.shape(v, m).cast<double>();
    const auto at = static_cast<std::size_t>(v);
    return pose.position(skin.render[at], surface.rest[at].cast<double>(), linear);
  }

 private:
  void hold(std::size_t n, std::size_t k) {
    std::fill(skin.rotations.end() - static_cast<std::ptrdiff_t>(3 * k), skin.rotations.end(), 0.0f);
    for (std::size_t l = 0; l < n; ++l) {
      const auto block = static_cast<std::ptrdiff_t>(l * n + n - 1);
      std::fill_n(skin.arms.begin() + 3 * block, 3, 0.0f);
      std::fill_n(skin.shifts.begin() + 3 * static_cast<std::ptrdiff_t>(k) * block, 3 * k, 0.0f);
    }
  }
};

struct SkinnedInstances {
  std::vector<std::vector<double>> amplitudes;
  std::vector<SkinPose> poses;
  std::vector<std::vector<float>> positions, normals;
  std::vector<ReconstructionTarget> targets;

  SkinnedInstances(const SkinnedSurface& s, int count, bool moved) {
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    for (int i = 0; i < count; ++i) {
      auto& z = amplitudes.emplace_back(static_cast<std::size_t>(s.surface.basis.modes()));
      for (double& x : z) x = normal(random);
      poses.emplace_back(s.skin).set(z);
      positions.emplace_back(3 * s.surface.rest.size());
      normals.emplace_back(3 * s.surface.rest.size());
    }
    for (std::size_t i = 0; i < positions.size(); ++i)
      targets.push_back({.X_OB = moved ? RigidTransform{normalized(Quaternion{0.3, -0.5, 0.2, 0.7}), {1.0, 2.0, -3.0}}
                                       : RigidTransform{},
                         .amplitudes = amplitudes[i].data(),
                         .positions = positions[i].data(),
                         .normals = normals[i].data(),
                         .skin = &poses[i]});
  }
};

Vec3 written(const ReconstructionTarget& target, Index v) {
  return Eigen::Map<const Vec3f>(target.positions + 3 * v).cast<double>();
}

/// The size of every term of a vertex; the error is at most 64u of it (k ≤ 40 of these are of the modes' sum).
double size_of_terms(const SkinnedSurface& s, Index v, const ReconstructionTarget& target) {
  double size = s.surface.rest[static_cast<std::size_t>(v)].cast<double>().norm() + target.X_OB.p.norm();
  for (Index m = 0; m < s.surface.basis.modes(); ++m)
    size += std::abs(target.amplitudes[m]) * s.surface.basis.shape(v, m).cast<double>().norm();
  double largest = 0.0;
  for (const SkinPose::Handle& h : target.skin->handles())
    largest = std::max(largest, h.shift.norm() + h.drift.norm() + 3.0 * h.angle.norm());
  return 3.0 * size + largest;
}

TEST(SkinnedReconstruct, IsWhatThePoseSaysOfEachVertexOnEveryInstructionSet) {
  for_each_instruction_set([](std::int64_t target) {
    for (const Index vertices : {1, 16, 17, 100})
      for (const Index modes : {1, 7, 40})
        for (const int count : {1, 2, 7, 13}) {
          SCOPED_TRACE(::testing::Message() << hwy::TargetName(target) << ": " << vertices << " vertices, " << modes
                                            << " modes, " << count << " instances");
          const SkinnedSurface s(vertices, modes, 9);
          SkinnedInstances instances(s, count, true);
          const std::vector<float> indentations(3 * s.surface.rest.size(), 0.3f);
          if (count > 1) instances.targets[1].displacement = indentations.data();
          reconstruct(s.surface, SkinTiles(s.skin.render), instances.targets);
          for (const ReconstructionTarget& t : instances.targets)
            for (Index v = 0; v < vertices; ++v) {
              const Vec3 more = Vec3::Constant(t.displacement ? 0.3f : 0.0f);
              const Vec3 exact = t.X_OB * s.position(*t.skin, v, {t.amplitudes, static_cast<std::size_t>(modes)}, more);
              ASSERT_LE((written(t, v) - exact).norm(), 64.0 * 0x1p-24 * size_of_terms(s, v, t)) << "vertex " << v;
            }
        }
  });
}

TEST(SkinnedReconstruct, OthersOfABlockKeepTheirBits) {
  const SkinnedSurface s(50, 6, 5);
  SkinnedInstances mixed(s, 8, true), plain(s, 8, true);
  for (std::size_t i = 0; i < 8; ++i) {
    plain.targets[i].skin = nullptr;
    if (i % 2 == 0) mixed.targets[i].skin = nullptr;
  }
  reconstruct(s.surface, SkinTiles(s.skin.render), mixed.targets);
  reconstruct(s.surface, plain.targets);
  for (std::size_t i = 0; i < 8; i += 2) {
    EXPECT_EQ(mixed.positions[i], plain.positions[i]);
    EXPECT_EQ(mixed.normals[i], plain.normals[i]);
  }
  EXPECT_NE(mixed.positions[1], plain.positions[1]);
}

TEST(SkinnedReconstruct, VerticesOnTheGroundStayAtRestToTheBit) {
  const SkinnedSurface s(60, 8, 6);
  SkinnedInstances instances(s, 3, false);
  reconstruct(s.surface, SkinTiles(s.skin.render), instances.targets);
  for (const ReconstructionTarget& t : instances.targets)
    for (Index v = 4; v < 60; v += 5)
      EXPECT_EQ(Vec3f(t.positions[3 * v], t.positions[3 * v + 1], t.positions[3 * v + 2]),
                s.surface.rest[static_cast<std::size_t>(v)]);
}

TEST(SkinnedReconstruct, InstructionSetsWithFusedMultiplyAddGiveTheSameBits) {
  const SkinnedSurface s(100, 20, 12);
  std::vector<std::vector<std::vector<float>>> results;
  for_each_instruction_set([&](std::int64_t target) {
    const SkinnedInstances instances(s, 13, true);
    reconstruct(s.surface, SkinTiles(s.skin.render), instances.targets);
    if (has_fused_multiply_add(target)) results.push_back(instances.positions);
  });
  for (const auto& result : results) EXPECT_EQ(result, results.front());
}

TEST(SkinnedReconstruct, NormalsAreThoseOfTheShapeShown) {
  const SkinnedSurface s(40, 5, 4);
  SkinnedInstances instances(s, 2, true);
  reconstruct(s.surface, SkinTiles(s.skin.render), instances.targets);
  for (std::size_t i = 0; i < 2; ++i) {
    std::vector<float> normals(instances.normals[i].size());
    vertex_normals(s.surface.triangles, instances.positions[i], normals);
    EXPECT_EQ(instances.normals[i], normals);
  }
}

TEST(SkinnedReconstruct, InfluencesThatDoNotFitAreRefused) {
  const SkinnedSurface s(20, 3, 6), other(19, 3, 6), small(20, 3, 2);
  SkinnedInstances instances(s, 1, true), few(small, 1, true);
  EXPECT_THROW(reconstruct(s.surface, instances.targets), InvalidArgument);
  EXPECT_THROW(reconstruct(s.surface, SkinTiles(other.skin.render), instances.targets), InvalidArgument);
  EXPECT_THROW(reconstruct(s.surface, SkinTiles(s.skin.render), few.targets), InvalidArgument);
}

/// fᵀJ at a vertex.
std::vector<double> row_of(const SkinnedSurface& s, SkinPose& pose, Index v, std::span<const double> z, const Vec3& f) {
  const auto at = static_cast<std::size_t>(v);
  Vec3 linear = Vec3::Zero();
  for (std::size_t m = 0; m < z.size(); ++m)
    linear += z[m] * s.surface.basis.shape(v, static_cast<Index>(m)).cast<double>();
  pose.set(z);
  pose.differentiate();
  std::vector<double> g(z.size(), 0.0);
  const Vec3 rest = s.surface.rest[at].cast<double>();
  const Vec3 by_modes = pose.add_rows(s.skin.render[at], rest, linear, f, g);
  for (std::size_t m = 0; m < z.size(); ++m)
    g[m] += by_modes.dot(s.surface.basis.shape(v, static_cast<Index>(m)).cast<double>());
  return g;
}

TEST(SkinPoseKernels, DerivativeIsRightAndTheSameOnEveryInstructionSet) {
  for (const Index modes : {1, 3, 4, 8, 13, 23}) {
    const SkinnedSurface s(6, modes, 7);
    SkinPose pose(s.skin);
    std::vector<double> z;
    for (Index m = 0; m < modes; ++m) z.push_back(0.3 * std::sin(1.0 + 2.0 * m));
    const Vec3 f(0.5, -0.3, 0.8);
    std::vector<std::vector<double>> rows;
    for_each_instruction_set([&](std::int64_t target) {
      SCOPED_TRACE(::testing::Message() << hwy::TargetName(target) << ": " << modes << " modes");
      const std::vector<double> row = row_of(s, pose, 1, z, f);
      if (has_fused_multiply_add(target)) rows.push_back(row);
      for (std::size_t m = 0; m < z.size(); ++m) {
        constexpr double kStep = 1e-5;
        std::vector<double> above = z, below = z;
        above[m] += kStep, below[m] -= kStep;
        pose.set(above);
        const Vec3 high = s.position(pose, 1, above);
        pose.set(below);
        EXPECT_NEAR(row[m], f.dot(high - s.position(pose, 1, below)) / (2.0 * kStep), 1e-8);
      }
    });
    for (const auto& row : rows) EXPECT_EQ(row, rows.front());
  }
}

TEST(SkinTiles, HoldEachVertexWeightOnce) {
  const SkinnedSurface s(37, 2, 8);
  const SkinTiles tiles(s.skin.render);
  EXPECT_EQ(tiles.vertices(), 37);
  EXPECT_EQ(tiles.handles(), 8);
  for (std::size_t v = 0; v < 37; ++v) {
    std::vector<float> weights(8, 0.0f), expected(8, 0.0f);
    for (std::uint32_t e = tiles.starts()[v / 16]; e < tiles.starts()[v / 16 + 1]; ++e)
      weights[tiles.handle_of_entry()[e]] += tiles.weights()[16 * e + v % 16];
    for (std::size_t i = 0; i < 4; ++i) expected[s.skin.render[v].handle[i]] += s.skin.render[v].weight[i];
    EXPECT_EQ(weights, expected);
  }
}

}  // namespace
}  // namespace limber
