// A soft bar with a modal skin, baked.
#pragma once

#include <memory>
#include <vector>

#include "constants.h"
#include "limber/engine/world.h"
#include "limber/model/skin_pose.h"
#include "limber/precompute/bake.h"
#include "skinned_bodies.h"

namespace limber::testing {

inline constexpr double kLength = 10.0;
// First bending mode of the bar, s.
inline constexpr double kPeriod = 60.0;

inline TetMesh bar_mesh(int cells = 20) { return mirrored_box(cells, 2, 2, {kLength, 1.5, 1.0}); }

struct BarOptions {
  bool held = true, skin = true, damped = false, residual = false;
  int cells = 20;  // along it
};

/// A bar of kSoft along x, held at x = 0 or free, 20 modes, 16 handles.
inline std::shared_ptr<const ModalModel> bar(const BarOptions& options = {}) {
  BakeOptions o;
  o.materials = {{"*", kSoft}};
  o.analysis.modes = o.limits.max_modes = 20;
  o.analysis.certify = false;
  o.skin = {.make = options.skin, .handles = 16};
  o.residual.surface = options.residual;
  if (options.damped) o.damping = RayleighDamping::from_ratio(1.0, 1.0 / kPeriod, 10.0 / kPeriod);
  if (options.held) o.fixed = {parse_node_selector("box:-0.1,-0.1,-0.1,0.001,2,2")};
  Warnings warnings;
  return bake({.name = "bar", .mesh = bar_mesh(options.cells)}, o, warnings).asset.bodies[0];
}

/// A vertex of the surface by its place in the input.
inline SurfacePoint vertex_at(const ModalModel& model, const Vec3& input) {
  const Vec3 r = input - model.data().origin_in_input;
  const ModalSurface& s = model.collision();
  for (std::size_t t = 0; t < s.triangles.size(); ++t)
    for (std::size_t c = 0; c < 3; ++c)
      if ((s.rest[static_cast<std::size_t>(s.triangles[t][c])].cast<double>() - r).norm() < 1e-5) {
        SurfacePoint at{.triangle = static_cast<Index>(t), .weight = {0.0, 0.0, 0.0}};
        at.weight[c] = 1.0;
        return at;
      }
  throw InvalidArgument("no vertex there");
}

/// Amplitudes with which the softest mode would turn some handle by so much, others a share of it.
inline std::vector<double> bent(const ModalModel& model, double angle) {
  SkinPose pose(*model.data().skin);
  std::vector<double> z(static_cast<std::size_t>(model.modes()), 0.0);
  z[0] = 1.0;
  pose.set(z);
  const double scale = angle / pose.largest_angle();
  for (std::size_t i = 0; i < z.size(); ++i)
    z[i] = scale * (i == 0 ? 1.0 : 0.2 / static_cast<double>(i + 1) * (i % 2 == 0 ? 1.0 : -1.0));
  return z;
}

inline std::vector<double> zeros(const ModalModel& model) {
  return std::vector<double>(static_cast<std::size_t>(model.modes()), 0.0);
}

inline const WorldOptions kWeightless{.step = kPeriod / 60.0, .gravity = Vec3::Zero()};

}  // namespace limber::testing
