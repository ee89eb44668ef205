#include "limber/model/morph_targets.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "example_model.h"
#include "limber/core/error.h"

namespace limber {
namespace {

constexpr float kFloatRoundOff = 32 * std::numeric_limits<float>::epsilon();

/// A tetrahedron of four corners that share vertices, so that normals are averages of slanted faces.
const std::vector<float> kPositions{0.1f, 0, 0, 1.2f, 0.1f, 0, 0, 0.9f, 0.2f, 0.3f, 0.1f, 1.1f};
const std::vector<Triangle> kTetFaces{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

Vec3 at(const std::vector<float>& xyz, std::size_t vertex) {
  return Vec3f(xyz[3 * vertex], xyz[3 * vertex + 1], xyz[3 * vertex + 2]).cast<double>();
}

std::vector<float> field(const std::function<Vec3(const Vec3&)>& f) {
  std::vector<float> out;
  for (std::size_t v = 0; v < kPositions.size() / 3; ++v) {
    const Vec3 u = f(at(kPositions, v));
    for (int a = 0; a < 3; ++a) out.push_back(static_cast<float>(u[a]));
  }
  return out;
}

TEST(MorphTargets, NormalsOfABoxAreItsAxes) {
  const ModalSurface box = example::box_surface({0.5, 0.1, 0.15}, 2, 0);
  const std::vector<float> normals = unit_normals(rest_positions(box), box.triangles);
  for (std::size_t v = 0; v < box.rest.size(); ++v) {
    const std::size_t axis = v / 18, side = v / 9 % 2;  // nine vertices a face, faces in the order −x +x −y +y −z +z
    Vec3 expected = Vec3::Zero();
    expected[static_cast<int>(axis)] = side == 0 ? -1.0 : 1.0;
    EXPECT_LT((at(normals, v) - expected).norm(), kFloatRoundOff) << v;
  }
}

TEST(MorphTargets, NormalsTurnWithASurfaceThatTurns) {
  const Vec3 spin(0.3, -0.7, 0.2);
  const auto changes = normal_changes(kPositions, field([&](const Vec3& p) { return Vec3(spin.cross(p)); }), kTetFaces);
  const auto normals = unit_normals(kPositions, kTetFaces);
  for (std::size_t v = 0; v < 4; ++v)
    EXPECT_LT((at(changes, v) - spin.cross(at(normals, v))).norm(), kFloatRoundOff) << v;
}

TEST(MorphTargets, NormalsStayWhenASurfaceMovesOrGrows) {
  for (const auto& f : {std::function<Vec3(const Vec3&)>([](const Vec3&) { return Vec3(1.0, -2.0, 0.5); }),
                        std::function<Vec3(const Vec3&)>([](const Vec3& p) { return Vec3(0.7 * p); })}) {
    const auto changes = normal_changes(kPositions, field(f), kTetFaces);
    for (const float c : changes) EXPECT_LT(std::abs(c), kFloatRoundOff);
  }
}

TEST(MorphTargets, NormalChangesAreTheDerivativeOfTheNormals) {
  const auto moves =
      field([](const Vec3& p) { return Vec3(p.y() * p.z() + 0.2, std::sin(3.0 * p.x()), p.x() * p.x() - p.y()); });
  const float h = 1.0f / 256;
  std::vector<float> ahead = kPositions, behind = kPositions;
  for (std::size_t i = 0; i < moves.size(); ++i) ahead[i] += h * moves[i], behind[i] -= h * moves[i];
  const auto n1 = unit_normals(ahead, kTetFaces), n0 = unit_normals(behind, kTetFaces),
             changes = normal_changes(kPositions, moves, kTetFaces);
  // A central difference of float32 normals: h² of curvature (here of size ten) and round-off over 2h.
  const float kDifference = 10 * h * h + 4 * std::numeric_limits<float>::epsilon() / (2 * h);
  for (std::size_t i = 0; i < moves.size(); ++i) EXPECT_NEAR(changes[i], (n1[i] - n0[i]) / (2 * h), kDifference) << i;
}

TEST(MorphTargets, NormalChangesAreSquareToTheNormal) {
  const auto changes =
      normal_changes(kPositions, field([](const Vec3& p) { return Vec3(p.z(), p.x() * p.y(), 1.0); }), kTetFaces);
  const auto normals = unit_normals(kPositions, kTetFaces);
  for (std::size_t v = 0; v < 4; ++v) EXPECT_LT(std::abs(at(changes, v).dot(at(normals, v))), kFloatRoundOff);
}

TEST(MorphTargets, VertexWithoutAreaHasANormalNevertheless) {
  // Vertex 3 is in no triangle; the two triangles over 0 1 2 cancel.
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 5, 5};
  const std::vector<Triangle> faces{{0, 1, 2}, {0, 2, 1}};
  const auto normals = unit_normals(positions, faces), changes = normal_changes(positions, positions, faces);
  for (std::size_t v = 0; v < 4; ++v) {
    EXPECT_EQ(at(normals, v), Vec3(0, 0, 1));
    EXPECT_EQ(at(changes, v), Vec3(0, 0, 0));
  }
}

TEST(MorphTargets, WrongArraysAreRefused) {
  EXPECT_THROW(unit_normals(kPositions, std::vector<Triangle>{{0, 1, 4}}), InvalidArgument);
  EXPECT_THROW(unit_normals(kPositions, std::vector<Triangle>{{0, 1, -1}}), InvalidArgument);
  EXPECT_THROW(normal_changes(kPositions, std::vector<float>(3), kTetFaces), InvalidArgument);
}

TEST(MorphTargets, NamesSortAsTheModesDo) {
  EXPECT_EQ(mode_target_name(7, 32, 412.3), "mode07_412Hz");
  EXPECT_EQ(mode_target_name(7, 7, 0.0), "mode07_0Hz");
  EXPECT_EQ(mode_target_name(7, 101, 4.1234), "mode007_4.12Hz");
  EXPECT_EQ(mode_target_name(0, 1, 123456.7), "mode00_123457Hz");
  EXPECT_EQ(mode_target_name(0, 1, 999.7), "mode00_1000Hz");
}

TEST(MorphTargets, ScaleIsThePowerOfTwoThatShowsATenthOfTheSize) {
  const double diagonal = 2.0 * Vec3(0.5, 0.1, 0.15).norm();
  for (const float size : {1e-20f, 0.003f, 1.0f, 777.0f, 1e20f}) {
    ModalSurface surface = example::box_surface({0.5, 0.1, 0.15}, 1, 1);
    surface.basis.set(5, 0, {0, size, 0});
    const double scale = visible_mode_scale(surface, 0);
    int exponent = 0;
    EXPECT_EQ(std::frexp(scale, &exponent), 0.5);
    const double ratio = scale * static_cast<double>(size) / (0.1 * diagonal);
    EXPECT_LE(ratio, std::sqrt(2.0) * (1 + 1e-6));
    EXPECT_GE(ratio, std::sqrt(0.5) * (1 - 1e-6));
  }
  EXPECT_EQ(visible_mode_scale(example::box_surface({0.5, 0.1, 0.15}, 1, 1), 0), 1.0);  // moves nothing
}

}  // namespace
}  // namespace limber
