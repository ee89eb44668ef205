/// @file block_model.h
/// A model whose modes are known in closed form, for tests that need an asset but no eigensolver.
///
/// A block of length L = 2 along x and 1 × 1 across, of mass m, that bends in shapes
///   w_i = √(2/m) cos(2π (i+1) x/L) e_y,   f_i = 5 (i+1)² Hz,   ξ_i = ½ (i+1) 1/s.
/// They are orthonormal over the uniform mass, ∫ρ w_i·w_j = δ_ij, and carry neither momentum (∫ρ w = 0) nor moment
/// (∫ρ x wᵀ = 0, as cos is even).
#pragma once

#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <utility>

#include "limber/model/asset.h"
#include "limber/model/modal_model.h"

namespace limber::testing {

inline constexpr double kBlockLength = 2.0, kBlockWidth = 1.0, kBlockMass = 3.0;

inline double block_frequency_hz(Index mode) { return 5.0 * (mode + 1) * (mode + 1); }
inline double block_decay(Index mode) { return 0.5 * (mode + 1); }

inline Vec3 block_shape(const Vec3& p, Index mode) {
  const double argument = 2.0 * std::numbers::pi * (mode + 1) * p.x() / kBlockLength;
  return Vec3::UnitY() * (std::sqrt(2.0 / kBlockMass) * std::cos(argument));
}

/// The block's surface: `cells` quads along x, one across, two triangles per quad, wound outwards.
inline ModalSurface block_surface(Index cells, Index modes) {
  ModalSurface s;
  for (Index i = 0; i <= cells; ++i)
    for (int corner = 0; corner < 4; ++corner) {
      const double x = kBlockLength * (static_cast<double>(i) / cells - 0.5);
      const double y = 0.5 * kBlockWidth * (corner == 0 || corner == 3 ? -1.0 : 1.0);
      const double z = 0.5 * kBlockWidth * (corner < 2 ? -1.0 : 1.0);
      s.rest.push_back(Vec3(x, y, z).cast<float>());
    }
  const auto quad = [&](Index a, Index b, Index c, Index d) {
    s.triangles.push_back({a, b, c});
    s.triangles.push_back({a, c, d});
  };
  for (Index i = 0; i < cells; ++i)
    for (Index c = 0; c < 4; ++c) {
      const Index d = (c + 1) % 4;
      quad(4 * i + c, 4 * i + d, 4 * (i + 1) + d, 4 * (i + 1) + c);
    }
  quad(3, 2, 1, 0);
  quad(4 * cells, 4 * cells + 1, 4 * cells + 2, 4 * cells + 3);
  s.basis = ModalBasis(static_cast<Index>(s.rest.size()), modes);
  for (Index v = 0; v < s.vertices(); ++v)
    for (Index m = 0; m < modes; ++m)
      s.basis.set(v, m, block_shape(s.rest[static_cast<std::size_t>(v)].cast<double>(), m).cast<float>());
  return s;
}

inline ModalModelData block_data(Index modes, const std::string& name = "block") {
  ModalModelData d;
  d.name = name;
  d.mass = kBlockMass;
  d.volume = kBlockLength * kBlockWidth * kBlockWidth;
  const double along = kBlockMass / 6.0 * kBlockWidth * kBlockWidth;
  const double across = kBlockMass / 12.0 * (kBlockLength * kBlockLength + kBlockWidth * kBlockWidth);
  d.inertia = Vec3(along, across, across).asDiagonal();
  d.origin_in_input = {10.0, 20.0, 30.0};
  for (Index m = 0; m < modes; ++m) {
    const double omega = 2.0 * std::numbers::pi * block_frequency_hz(m);
    d.eigenvalues.push_back(omega * omega);
    d.decays.push_back(block_decay(m));
    d.participation.push_back(Vec3::Zero());
    d.moments.push_back(Mat3::Zero());
  }
  d.render = block_surface(16, modes);
  return d;
}

inline std::shared_ptr<const ModalModel> block_model(Index modes, const std::string& name = "block") {
  return std::make_shared<const ModalModel>(block_data(modes, name));
}

inline Asset block_asset(Index modes, const std::string& name = "block") {
  Asset asset;
  asset.bodies = {block_model(modes, name)};
  asset.provenance.tool = "test";
  asset.provenance.input = "block";
  return asset;
}

/// A block whose three bending modes one hears at 300 (i+1)² Hz; `modes` move it.
inline Asset sounding_block_asset(Index modes) {
  Asset asset = block_asset(modes);
  const ModalSurface& surface = asset.bodies[0]->collision();
  auto sound = std::make_shared<SoundModes>();
  sound->vertices = surface.vertices();
  sound->contact_modulus = 1e7;
  for (Index m = 0; m < 3; ++m) {
    sound->eigenvalues.push_back(std::pow(2.0 * std::numbers::pi * 300.0 * (m + 1) * (m + 1), 2));
    sound->decays.push_back(6.0 * (m + 1));
    for (const Vec3f& r : surface.rest) {
      const Vec3f w = block_shape(r.cast<double>(), m).cast<float>();
      sound->shapes.insert(sound->shapes.end(), {w.x(), w.y(), w.z()});
    }
  }
  asset.sounds = {std::move(sound)};
  return asset;
}

}  // namespace limber::testing
