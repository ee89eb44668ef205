// An asset pipeline in miniature: bakes a mesh with the installed precompute component and reads the asset back.
// Exit code 0 if a unit cube of density 1000 weighs 1000 kg and has its modes.

#include <limber/jobs_tbb/tbb_jobs.h>
#include <limber/mesh_assimp/read_surface_mesh.h>
#include <limber/precompute/bake.h>
#include <limber/precompute/tetrahedralise.h>
#include <limber/scene/scene_file.h>

#include <cmath>
#include <cstdio>

int main() {
  limber::SurfaceMesh cube;
  for (int i = 0; i < 8; ++i) cube.vertices.emplace_back(i & 1, i >> 1 & 1, i >> 2);
  cube.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  limber::Warnings warnings;
  limber::TbbJobs jobs;
  limber::BakeOptions options;
  options.materials = {{"*", {.youngs_modulus = 1e7, .poisson_ratio = 0.3, .density = 1000.0}}};
  options.analysis.modes = 8;
  const auto tets = limber::tetrahedralise(cube, {.cell_size = 0.3}, warnings);
  const auto baked = limber::bake({.name = "cube", .mesh = tets.mesh}, options, warnings, jobs);
  const auto asset = limber::asset_from_bytes(limber::asset_bytes(baked.asset), "cube");
  const double mass = asset.bodies[0]->data().mass;
  std::printf("%.9g kg, %d modes\n", mass, static_cast<int>(asset.bodies[0]->modes()));
  return std::abs(mass - 1000.0) < 1.0 && asset.bodies[0]->modes() >= 5 ? 0 : 1;
}
