#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <vector>

#include "limber/dynamics/oscillator.h"
#include "limber/dynamics/reconstruct.h"

namespace {
std::atomic<int> allocations{0};
}

// Counting forms for the whole test program.
void* operator new(std::size_t size) {
  ++allocations;
  if (void* p = std::malloc(size > 0 ? size : 1)) return p;
  throw std::bad_alloc();
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }

namespace limber {
namespace {

TEST(Allocation, AStepOfModesMakesNone) {
  const std::vector<double> lambda{1.0, 100.0, 1e4}, decay(3, 0.1);
  const PropagatorTable table(lambda, decay, 0.01);
  alignas(64) double z[8] = {1.0}, zdot[8] = {}, g[8] = {2.0};
  const int before = allocations;
  table.advance(z, zdot, g);
  table.advance_free(z, zdot);
  EXPECT_EQ(allocations, before);
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
  const int before = allocations;
  reconstruct(surface, targets);
  vertex_normals(surface.triangles, positions[0], normals[0]);
  EXPECT_EQ(allocations, before);
  EXPECT_GT(before, 0);
}

}  // namespace
}  // namespace limber
