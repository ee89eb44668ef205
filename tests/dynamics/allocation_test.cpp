#include <gtest/gtest.h>

#include <vector>

#include "counted_new.h"
#include "limber/dynamics/oscillator.h"
#include "limber/dynamics/reconstruct.h"

namespace limber {
namespace {

TEST(Allocation, AStepOfModesMakesNone) {
  const std::vector<double> lambda{1.0, 100.0, 1e4}, decay(3, 0.1);
  const PropagatorTable table(lambda, decay, 0.01);
  alignas(64) double z[8] = {1.0}, zdot[8] = {}, g[8] = {2.0};
  const long before = testing::allocations();
  table.advance(z, zdot, g);
  table.advance_free(z, zdot);
  EXPECT_EQ(testing::allocations(), before);
}

TEST(Allocation, VerticesAndNormalsOfManyInstancesMakeNone) {
  constexpr Index kVertices = 1000, kModes = 40;
  ModalSurface surface{.rest = {}, .triangles = {}, .basis = ModalBasis(kVertices, kModes)};
  surface.rest.assign(kVertices, Vec3f(1.0f, 2.0f, 3.0f));
  surface.triangles.assign(10, {0, 1, 2});
  const std::vector<double> amplitudes(kModes, 0.1);
  std::vector<std::vector<float>> positions(11, std::vector<float>(3 * kVertices)), normals = positions;
  std::vector<ReconstructionTarget> targets;
  for (std::size_t i = 0; i < positions.size(); ++i)
    targets.push_back({{}, amplitudes.data(), positions[i].data(), normals[i].data()});
  const long before = testing::allocations();
  reconstruct(surface, targets);
  vertex_normals(surface.triangles, positions[0], normals[0]);
  EXPECT_EQ(testing::allocations(), before);
  EXPECT_GT(before, 0);
}

}  // namespace
}  // namespace limber
