/// @file example_model.h
/// Bodies made by formula, for tests of what is done with a model rather than of how it is baked.
#pragma once

#include <cmath>
#include <memory>
#include <numbers>

#include "limber/model/asset.h"

namespace limber::example {

/// A closed box surface [−a, a] × [−b, b] × [−c, c] with n × n quads on each face, vertices not shared between faces.
inline ModalSurface box_surface(const Vec3& half, Index n, Index modes) {
  ModalSurface s;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      const Index first = s.vertices();
      for (Index j = 0; j <= n; ++j)
        for (Index i = 0; i <= n; ++i) {
          Vec3 p;
          p[axis] = side;
          p[(axis + 1) % 3] = 2.0 * i / n - 1.0;
          p[(axis + 2) % 3] = 2.0 * j / n - 1.0;
          s.rest.push_back(p.cwiseProduct(half).cast<float>());
        }
      for (Index j = 0; j < n; ++j)
        for (Index i = 0; i < n; ++i) {
          const Index v = first + j * (n + 1) + i;
          const bool outward = side > 0.0;
          s.triangles.push_back(outward ? Triangle{v, v + 1, v + n + 2} : Triangle{v, v + n + 2, v + 1});
          s.triangles.push_back(outward ? Triangle{v, v + n + 2, v + n + 1} : Triangle{v, v + n + 1, v + n + 2});
        }
    }
  s.basis = ModalBasis(s.vertices(), modes);
  return s;
}

/// A smooth shape that differs from mode to mode: bending of growing wave number along x, in turns along y and z.
inline Vec3 bending_shape(const Vec3& p, Index mode) {
  const double wave = std::sin(std::numbers::pi * (mode + 1) * (p.x() + 0.5)) * (0.1 + 0.01 * mode);
  return {0.02 * p.y() * wave, mode % 2 == 0 ? wave : 0.0, mode % 2 == 1 ? wave : 0.0};
}

inline void bend(ModalSurface& surface) {
  for (Index v = 0; v < surface.vertices(); ++v)
    for (Index i = 0; i < surface.basis.modes(); ++i) {
      const Vec3 p = surface.rest[static_cast<std::size_t>(v)].cast<double>();
      surface.basis.set(v, i, bending_shape(p, i).cast<float>());
    }
}

/// A free box of 2 kg with that many bending modes.
inline ModalModelData box(const std::string& name, Index modes, Index subdivisions = 2) {
  const Vec3 half{0.5, 0.1, 0.15};
  ModalModelData d;
  d.name = name;
  d.mass = 2.0;
  d.volume = 8.0 * half.prod();
  d.origin_in_input = {1.0, 2.0, 3.0};
  const Vec3 square = half.cwiseAbs2();
  d.inertia =
      (d.mass / 3.0 * Vec3(square.y() + square.z(), square.x() + square.z(), square.x() + square.y())).asDiagonal();
  for (Index i = 0; i < modes; ++i) {
    const double omega = 2.0 * std::numbers::pi * 100.0 * (i + 1);
    d.eigenvalues.push_back(omega * omega);
    d.decays.push_back(0.5 + 1e-7 * omega * omega);
    d.participation.push_back(Vec3::Zero());
    d.moments.push_back(Mat3::Identity() * (0.01 / (i + 1.0)));
  }
  d.render = box_surface(half, subdivisions, modes);
  bend(d.render);
  return d;
}

/// Handles in a row along x that turn about z as the modes bend, for all vertices of the model's surfaces.
inline ModalSkin skin_of(const ModalModelData& d, Index handles) {
  const auto n = static_cast<std::size_t>(handles), k = d.eigenvalues.size();
  ModalSkin skin{.handles = handles, .modes = static_cast<Index>(k)};
  for (Index h = 0; h < handles; ++h) skin.rest.emplace_back((h + 0.5) / handles - 0.5, 0.01 * h, 0.0);
  const auto wave = [](std::size_t i) { return static_cast<float>(std::sin(0.7 * static_cast<double>(i) + 1.0)); };
  for (std::size_t i = 0; i < 3 * n * k; ++i) skin.rotations.push_back(0.3f * wave(i));
  for (std::size_t i = 0; i < 3 * n * n; ++i) skin.arms.push_back(0.1f * wave(2 * i));
  for (std::size_t i = 0; i < 3 * n * n * k; ++i) skin.shifts.push_back(0.01f * wave(3 * i));
  const auto hang = [&](Index vertices) {
    std::vector<SkinInfluences> all;
    for (Index v = 0; v < vertices; ++v) {
      std::vector<double> weights;
      for (Index h = 0; h < handles; ++h) weights.push_back(1.0 + std::sin(0.3 * v + 1.1 * h));
      all.push_back(skin_influences(weights));
    }
    return all;
  };
  skin.render = hang(d.render.vertices());
  if (d.collision) skin.collision = hang(d.collision->vertices());
  if (d.volume_block) skin.volume = hang(static_cast<Index>(d.volume_block->rest.size()));
  if (d.motion != FrameMotion::kFree) return skin;
  skin.gauge.weights.assign(4 * n, 0.25);
  skin.gauge.rest.assign(12 * n, 0.5);
  skin.gauge.shapes.assign(12 * n * k, 0.125);
  return skin;
}

/// The same with a collision surface and a volume block (one tet) besides, fixed along a line.
inline ModalModelData full_box(const std::string& name, Index modes) {
  ModalModelData d = box(name, modes);
  d.motion = FrameMotion::kLine;
  d.line_axis = Vec3(1.0, 2.0, 2.0) / 3.0;
  d.center_of_mass = {0.1, 0.0, -0.05};
  d.inertia += 0.1 * Mat3::Identity();
  for (Vec3& p : d.participation) p = {0.3, -0.2, 0.1};
  d.collision = box_surface({0.5, 0.1, 0.15}, 1, modes);
  bend(*d.collision);
  ModalVolume volume;
  volume.rest = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 1.0 / 3.0}};
  volume.tets = {{0, 1, 2, 3}};
  volume.basis = ModalBasis(4, modes), volume.mass_times_basis = ModalBasis(4, modes);
  for (Index v = 0; v < 4; ++v)
    for (Index i = 0; i < modes; ++i) {
      const Vec3 w = bending_shape(volume.rest[static_cast<std::size_t>(v)], i);
      volume.basis.set(v, i, w.cast<float>());
      volume.mass_times_basis.set(v, i, (0.5 * w).cast<float>());
    }
  d.volume_block = std::move(volume);
  ResidualCompliance residual(ResidualCompliance::Form::kFull, d.collision->vertices());
  for (Index a = 0; a < residual.vertices(); ++a)
    for (Index b = 0; b <= a; ++b) residual.set(a, b, Mat3(Vec3(3.0, 2.0, 1.0).asDiagonal()) * (1e-7 / (1.0 + a - b)));
  d.residual_compliance = std::move(residual);
  return d;
}

inline std::shared_ptr<const ModalModel> model(ModalModelData data) {
  return std::make_shared<const ModalModel>(std::move(data));
}

inline ModalModelData with_skin(ModalModelData d, Index handles) {
  d.skin = skin_of(d, handles);
  return d;
}

/// Three bodies, one with every optional part and two with a skin.
inline Asset asset() {
  return {.bodies = {model(box("bar", 7)), model(with_skin(full_box("hinged bar", 5), 3)),
                     model(with_skin(box("reed", 4), 6))},
          .provenance = {.tool = "limber-precompute 0.1.0",
                         .input = "bar.msh",
                         .input_hash = std::string(64, 'a'),
                         .options = "--modes 7 --youngs-modulus 2.07e11"}};
}

}  // namespace limber::example
