// Bodies of the narrow phase's tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "contact_bodies.h"
#include "contact_reference.h"
#include "shapes.h"
#include "wavy_model.h"

namespace limber::testing {

inline constexpr double kGap = 1e-9;  ///< what is asked of gaps, in parts of a size of 1 m

inline std::shared_ptr<const ModalModel> lumpy_sphere(int splits, Index modes) {
  SurfaceMesh mesh = shapes::sphere(Vec3::Zero(), 0.5, splits);
  for (Vec3& p : mesh.vertices) p *= 1.0 + 0.15 * std::sin(7.0 * p.x()) * std::cos(5.0 * p.y() + 3.0 * p.z());
  return wavy_model(mesh, modes);
}

/// A sheet of cells × cells squares, one layer of triangles, across z.
inline std::shared_ptr<const ModalModel> sheet(Index cells, Index modes) {
  SurfaceMesh mesh;
  for (Index j = 0; j <= cells; ++j)
    for (Index i = 0; i <= cells; ++i)
      mesh.vertices.emplace_back(static_cast<double>(i) / cells - 0.5, static_cast<double>(j) / cells - 0.5, 0.0);
  for (Index j = 0; j < cells; ++j)
    for (Index i = 0; i < cells; ++i) {
      const Index v = j * (cells + 1) + i, w = v + cells + 1;
      mesh.triangles.push_back({v, v + 1, w + 1});
      mesh.triangles.push_back({v, w + 1, w});
    }
  return wavy_model(mesh, modes);
}

inline Body rigid(const Shape& shape, const RigidTransform& pose) {
  Body body(shape);
  body.place(pose);
  return body;
}

inline double nearest_distance(const PlainSurface& s, const Vec3& p) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    const auto x = s.corners(t);
    const double radius = std::max((x[1] - x[0]).norm(), (x[2] - x[0]).norm());
    if ((p - x[0]).norm() - radius > least) continue;
    least = std::min(least, hull_distance({&p, 1}, x).distance);
  }
  return least;
}

}  // namespace limber::testing
