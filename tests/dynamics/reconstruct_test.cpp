#include "limber/dynamics/reconstruct.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>
#include <limits>
#include <random>

#include "limber/core/error.h"

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
  const double size = surface.rest[v].cast<double>().norm() + displacement;
  return u * ((surface.basis.modes() + 4) * displacement + 8.0 * size + 2.0 * target.X_OB.p.norm());
}

Vec3 exact_position(const ModalSurface& surface, Index v, const ReconstructionTarget& target) {
  Vec3 p = surface.rest[v].cast<double>();
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

TEST(Reconstruct, EqualsTheDoubleSumWithinFloatRounding) {
  for (const Index vertices : {1, 3, 15, 16, 17, 100})
    for (const Index modes : {0, 1, 7, 32, 300})
      for (const int count : {1, 2, 3, 7, 8, 13}) {
        SCOPED_TRACE(testing::Message() << vertices << " vertices, " << modes << " modes, " << count << " instances");
        const ModalSurface surface = random_surface(vertices, modes);
        const Instances instances(surface, count);
        reconstruct(surface, instances.targets);
        for (const auto& target : instances.targets) expect_exact_within_rounding(surface, target);
      }
}

}  // namespace
}  // namespace limber
