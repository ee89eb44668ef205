/// @file sheet_model.h
/// A square sheet that bends: thin, two-sided, of as many triangles and modes as wanted.
#pragma once

#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "limber/model/modal_model.h"

namespace limber::testing {

inline constexpr double kSheetSide = 1.0, kSheetThickness = 1e-3;

struct SheetSize {
  double side = kSheetSide, thickness = kSheetThickness;  ///< m
  double mass = 1.0;                                      ///< kg
};

/// Standing waves over the square, two by two waves more for each four modes; nearly orthonormal over a mass of 1 kg.
/// @param x, y by the side
inline double sheet_shape(double x, double y, int mode) {
  const auto wave = [](double at, int n) { return std::cos(std::numbers::pi * n * (at + 0.5)); };
  const int block = mode / 4;
  return 2.0 * wave(x, 2 * block + 1 + mode % 2) * wave(y, 2 * block + 1 + mode / 2 % 2);
}

/// 4 · cells² + 8 · cells triangles; modes of 20, 55, 90, … Hz that move z only, ξ = 1 1/s.
inline std::shared_ptr<const ModalModel> sheet_model(int cells, int modes, const SheetSize& size = {}) {
  ModalModelData d;
  d.name = "sheet";
  d.mass = size.mass;
  d.volume = size.side * size.side * size.thickness;
  d.inertia = Vec3(1.0, 1.0, 2.0).asDiagonal() * (size.mass * size.side * size.side / 12.0);
  ModalSurface s;
  for (int side = 0; side < 2; ++side)
    for (int j = 0; j <= cells; ++j)
      for (int i = 0; i <= cells; ++i) {
        const Vec3 r(size.side * (static_cast<double>(i) / cells - 0.5),
                     size.side * (static_cast<double>(j) / cells - 0.5), size.thickness * (side - 0.5));
        s.rest.push_back(r.cast<float>());
      }
  const auto vertex = [cells](int side, int i, int j) { return Index{(side * (cells + 1) + j) * (cells + 1) + i}; };
  const auto quad = [&](Index a, Index b, Index c, Index e) {
    s.triangles.push_back({a, b, c});
    s.triangles.push_back({a, c, e});
  };
  for (int j = 0; j < cells; ++j)
    for (int i = 0; i < cells; ++i) {
      quad(vertex(1, i, j), vertex(1, i + 1, j), vertex(1, i + 1, j + 1), vertex(1, i, j + 1));
      quad(vertex(0, i, j), vertex(0, i, j + 1), vertex(0, i + 1, j + 1), vertex(0, i + 1, j));
    }
  for (int i = 0; i < cells; ++i) {
    quad(vertex(0, i, 0), vertex(0, i + 1, 0), vertex(1, i + 1, 0), vertex(1, i, 0));
    quad(vertex(0, i + 1, cells), vertex(0, i, cells), vertex(1, i, cells), vertex(1, i + 1, cells));
    quad(vertex(0, 0, i + 1), vertex(0, 0, i), vertex(1, 0, i), vertex(1, 0, i + 1));
    quad(vertex(0, cells, i), vertex(0, cells, i + 1), vertex(1, cells, i + 1), vertex(1, cells, i));
  }
  s.basis = ModalBasis(s.vertices(), modes);
  for (int mode = 0; mode < modes; ++mode) {
    const double omega = 2.0 * std::numbers::pi * (20.0 + 35.0 * mode);
    d.eigenvalues.push_back(omega * omega);
    d.decays.push_back(1.0);
    d.participation.push_back(Vec3::Zero());
    d.moments.push_back(Mat3::Zero());
    for (Index v = 0; v < s.vertices(); ++v) {
      const Vec3 r = s.rest[static_cast<std::size_t>(v)].cast<double>();
      const double shape = sheet_shape(r.x() / size.side, r.y() / size.side, mode) / std::sqrt(size.mass);
      s.basis.set(v, mode, {0.0f, 0.0f, static_cast<float>(shape)});
    }
  }
  d.render = std::move(s);
  return std::make_shared<const ModalModel>(std::move(d));
}

}  // namespace limber::testing
