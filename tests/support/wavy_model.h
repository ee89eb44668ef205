// A deformable body of any surface: its modes are waves of rising wave number through space, with the frequencies of a
// body whose bending waves they were. Not orthonormal over a mass, so for geometry only.
#pragma once

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "limber/mesh/surface_mesh.h"
#include "limber/model/modal_model.h"

namespace limber::testing {

/// Displacement at a point per unit amplitude of a mode; lengths relative to `size`, |w| up to 1.7 / √(1 kg).
inline Vec3 wavy_shape(const Vec3& p, double size, Index mode) {
  const double wave = 1.0 + 0.6 * mode, turn = 2.4 * mode;  // a golden angle apart: directions do not repeat
  const Vec3 along(std::cos(turn), std::sin(turn), std::sin(1.7 * turn));
  const double phase = wave * along.dot(p) / size + 0.3 * mode;
  return {std::sin(phase), std::cos(phase), std::sin(phase + turn)};
}

inline ModalModelData wavy_data(const SurfaceMesh& mesh, Index modes) {
  ModalModelData d;
  d.name = "wavy";
  d.mass = 1.0;
  d.volume = 1.0;
  double size = 0.0;
  for (const Vec3& p : mesh.vertices) size = std::max(size, p.cwiseAbs().maxCoeff());
  d.inertia = Mat3::Identity() * size * size;
  for (Index i = 0; i < modes; ++i) {
    const double omega = 2.0 * std::numbers::pi * 2.0 * std::pow(1.0 + 0.6 * i, 2);
    d.eigenvalues.push_back(omega * omega);
    d.decays.push_back(0.1);
    d.participation.push_back(Vec3::Zero());
    d.moments.push_back(Mat3::Zero());
  }
  d.render.triangles = mesh.triangles;
  d.render.basis = ModalBasis(static_cast<Index>(mesh.vertices.size()), modes);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    d.render.rest.push_back(mesh.vertices[v].cast<float>());
    for (Index i = 0; i < modes; ++i)
      d.render.basis.set(static_cast<Index>(v), i, wavy_shape(mesh.vertices[v], size, i).cast<float>());
  }
  return d;
}

inline std::shared_ptr<const ModalModel> wavy_model(const SurfaceMesh& mesh, Index modes) {
  return std::make_shared<const ModalModel>(wavy_data(mesh, modes));
}

}  // namespace limber::testing
