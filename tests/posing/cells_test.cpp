// Cells: what of a shape they fill, what they share, and how stiff the body is that they make.
#include "limber/posing/cells.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "limber/core/error.h"
#include "posed_models.h"
#include "solver/pose_energy.h"

namespace limber {
namespace {

using internal::BodyPoses;
using internal::build_structure;
using internal::PoseStructure;
using testing::bar_surface;
using testing::single_part;

double volume_of(const CellGrid& grid) {
  return std::accumulate(grid.cells.begin(), grid.cells.end(), 0.0,
                         [](double sum, const Cell& c) { return sum + 8.0 * c.half.prod(); });
}

/// Area of the faces between cells with a normal along a grid axis.
double area_of(const CellGrid& grid, int axis) {
  double out = 0.0;
  for (const CellFace& f : grid.faces)
    if (f.axis == axis) out += 4.0 * f.half[0] * f.half[1];
  return out;
}

TEST(Cells, ARigidPartIsOneCell) {
  const CellGrid grid = make_cells(shapes::box({0, 0, 0}, {3, 2, 1}), {});
  ASSERT_EQ(grid.cells.size(), 1u);
  EXPECT_NEAR(volume_of(grid), 6.0, 1e-12);
  EXPECT_TRUE(grid.faces.empty());
}

TEST(Cells, ABoxIsFilledWithoutGapsAndItsCellsShareWholeSections) {
  const CellGrid grid =
      make_cells(shapes::box({0, 0, 0}, {4, 2, 1}), {.cells = Subdivision::kUniform, .cell_size = 0.5});
  EXPECT_EQ(grid.cells.size(), 8u * 4u * 2u);
  EXPECT_NEAR(volume_of(grid), 8.0, 1e-12);
  double areas = 0.0;
  for (int axis = 0; axis < 3; ++axis) areas += area_of(grid, axis);
  EXPECT_NEAR(areas, 7 * 2.0 + 3 * 4.0 + 1 * 8.0, 1e-12);  // sections times inner boundaries
}

TEST(Cells, AnOctreeFillsTheSameSpaceWithFewerCells) {
  const SurfaceMesh box = shapes::box({0, 0, 0}, {2, 2, 2});
  const CellGrid fine = make_cells(box, {.cells = Subdivision::kUniform, .cell_size = 0.125});
  const CellGrid octree = make_cells(box, {.cells = Subdivision::kOctree, .cell_size = 0.125, .octree_levels = 2});
  EXPECT_NEAR(volume_of(octree), volume_of(fine), 1e-12);
  EXPECT_LT(octree.cells.size(), 2 * fine.cells.size() / 3);  // 4096: two layers at the surface stay fine
  // Of what the fine cells share, the octree's share all but what lies inside larger cells.
  for (const CellFace& f : octree.faces) {
    const Cell &a = octree.cells[static_cast<std::size_t>(f.a)], &b = octree.cells[static_cast<std::size_t>(f.b)];
    EXPECT_NEAR(f.distance, (octree.axes.transpose() * (b.centre - a.centre))[f.axis], 1e-12);
  }
}

TEST(Cells, WhatLiesOutsideIsDropped) {
  const SurfaceMesh ball = shapes::sphere(Vec3::Zero(), 1.0, 3);
  const CellGrid grid = make_cells(ball, {.cells = Subdivision::kUniform, .cell_size = 0.1});
  const double shell = 4.0 * M_PI * 0.1 * std::sqrt(3.0);  // cells that the surface passes through
  EXPECT_GT(volume_of(grid), enclosed_volume(ball));
  EXPECT_LT(volume_of(grid), enclosed_volume(ball) + shell);
  for (const Cell& c : grid.cells) EXPECT_LT(c.centre.norm(), 1.0 + 0.1 * std::sqrt(3.0));
}

TEST(Cells, AHollowBodyIsHollow) {
  SurfaceMesh pipe = shapes::box({0, 0, 0}, {4, 4, 4});
  shapes::append(shapes::turned(shapes::box({1, 1, 1}, {3, 3, 3})), pipe);
  const CellGrid grid = make_cells(pipe, {.cells = Subdivision::kUniform, .cell_size = 0.25});
  for (const Cell& c : grid.cells) EXPECT_GT((c.centre - Vec3(2, 2, 2)).cwiseAbs().maxCoeff(), 0.8);
}

TEST(Cells, WrongOptionsAreRefused) {
  const SurfaceMesh box = shapes::box({0, 0, 0}, {1, 1, 1});
  EXPECT_THROW(make_cells(box, {.cell_size = -1.0}), InvalidArgument);
  EXPECT_THROW(make_cells(box, {.octree_levels = 0}), InvalidArgument);
  EXPECT_THROW(make_cells(box, {.stiffness = std::nan("")}), InvalidArgument);
  EXPECT_THROW(make_cells(box, {.cells = Subdivision::kUniform, .cell_size = 1e-4}), InvalidArgument);
  EXPECT_THROW(make_cells({}, {}), InvalidArgument);
}

// A bar 8 long, 1 by 1 in section, in cells of 1, 1/2, 1/4 -----------------------------------------------------------

constexpr double kLength = 8.0;

PoseStructure bar(const PartOptions& options, StrainWeights weights) {
  return build_structure(single_part(bar_surface(kLength, 1.0, 8)), {options}, {false}, weights);
}

/// Length between the first and the last centre: what strain is measured over.
double gauge(const PoseStructure& s) {
  double low = kLength, high = 0.0;
  for (const auto& b : s.bodies) low = std::min(low, b.centre.x()), high = std::max(high, b.centre.x());
  return high - low;
}

double energy_of(const PoseStructure& s, const BodyPoses& poses) {
  return internal::strain_energy(s, poses, internal::rotations_of(poses));
}

/// ½ A ε² L is what a bar of stiffness 1 and section A = 1 takes to stretch by ε.
double stretch_stiffness(const PoseStructure& s) {
  constexpr double kStrain = 1e-3;
  BodyPoses poses = rest_poses(s);
  for (auto& X : poses) X.p.x() *= 1.0 + kStrain;
  return energy_of(s, poses) / (0.5 * kStrain * kStrain * gauge(s));
}

/// ½ I κ² L, I = 1/12, is what it takes to bend it to a circle of curvature κ; sections stay plane.
double bend_stiffness(const PoseStructure& s) {
  constexpr double kCurvature = 1e-3;
  BodyPoses poses = rest_poses(s);
  for (auto& X : poses) {
    const double angle = kCurvature * X.p.x(), radius = 1.0 / kCurvature - X.p.y();
    X = {quaternion_from_rotation_vector({0, 0, angle}),
         Vec3(radius * std::sin(angle), 1.0 / kCurvature - radius * std::cos(angle), X.p.z())};
  }
  return energy_of(s, poses) / (0.5 / 12.0 * kCurvature * kCurvature * gauge(s));
}

/// ½ I_p τ² L, I_p = 1/6, is what it takes to twist it, sections staying plane.
double twist_stiffness(const PoseStructure& s) {
  constexpr double kTwist = 1e-3;
  BodyPoses poses = rest_poses(s);
  for (auto& X : poses) {
    const Quaternion q = quaternion_from_rotation_vector({kTwist * X.p.x(), 0, 0});
    X = {q, q * X.p};
  }
  return energy_of(s, poses) / (0.5 / 6.0 * kTwist * kTwist * gauge(s));
}

TEST(StrainEnergy, StiffnessIsThatOfTheBarForAnyCellSize) {
  constexpr double kAllowed = 0.05;
  for (const double size : {1.0, 0.5, 0.25}) {
    const PoseStructure s = bar({.cells = Subdivision::kUniform, .cell_size = size}, StrainWeights::kVolume);
    EXPECT_NEAR(stretch_stiffness(s), 1.0, kAllowed) << size;
    EXPECT_NEAR(bend_stiffness(s), 1.0, kAllowed) << size;
    EXPECT_NEAR(twist_stiffness(s), 1.0, kAllowed) << size;
  }
}

TEST(StrainEnergy, OctreeLevelsMakeItNoStifferAndNoSofter) {
  constexpr double kAllowed = 0.05;
  const PoseStructure s =
      bar({.cells = Subdivision::kOctree, .cell_size = 0.125, .octree_levels = 1}, StrainWeights::kVolume);
  EXPECT_GT(s.bodies.size(), 100u);
  EXPECT_NEAR(stretch_stiffness(s), 1.0, kAllowed);
  EXPECT_NEAR(bend_stiffness(s), 1.0, kAllowed);
}

TEST(StrainEnergy, UnweightedItDependsOnTheCells) {
  const auto stiffness = [](double size) {
    return stretch_stiffness(bar({.cells = Subdivision::kUniform, .cell_size = size}, StrainWeights::kUnweighted));
  };
  EXPECT_GT(stiffness(0.5) / stiffness(1.0), 1.5);
}

TEST(StrainEnergy, UnweightedNeighboursOffsetByTStrainByEightTSquaredPerDirection) {
  const PoseStructure s =
      build_structure(single_part(shapes::box({0, 0, 0}, {2, 1, 1})),
                      {{.cells = Subdivision::kUniform, .cell_size = 1.0}}, {false}, StrainWeights::kUnweighted);
  ASSERT_EQ(s.bodies.size(), 2u);
  const Vec3 t(0.1, -0.2, 0.3);
  BodyPoses poses = rest_poses(s);
  poses[1].p += t;
  EXPECT_NEAR(energy_of(s, poses), 0.5 * 2.0 * 8.0 * t.squaredNorm(), 1e-14);  // ½ of both directions
}

TEST(StrainEnergy, RigidMotionsHaveNone) {
  const PoseStructure s = bar({.cells = Subdivision::kUniform, .cell_size = 0.5}, StrainWeights::kVolume);
  const RigidTransform X{quaternion_from_rotation_vector({0.4, -1.1, 2.0}), {3, -50, 7}};
  BodyPoses poses = rest_poses(s);
  for (auto& pose : poses) pose = X * pose;
  EXPECT_LT(energy_of(s, poses), 1e-24);
}

TEST(StrainEnergy, ShellsOfOnePartHoldTogether) {
  SurfaceMesh two = shapes::box({0, 0, 0}, {1, 1, 1});
  shapes::append(shapes::box({0, 0, 3}, {1, 1, 4}), two);
  const PoseStructure s = build_structure(single_part(two), {{.cells = Subdivision::kUniform, .cell_size = 0.5}},
                                          {false}, StrainWeights::kVolume);
  BodyPoses poses = rest_poses(s);
  for (std::size_t b = 0; b < poses.size(); ++b)
    if (s.bodies[b].centre.z() > 2.0) poses[b].p.x() += 0.1;
  EXPECT_GT(energy_of(s, poses), 1e-5);
}

}  // namespace
}  // namespace limber
