// Bodies made by hand: a few lumped masses with made-up but exactly M-orthonormal modes, so that every integral the
// runtime needs is a finite sum that tests can take a second way.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "limber/dynamics/surface_point.h"
#include "limber/model/modal_model.h"

namespace limber::testing {

inline constexpr double kSampleSize = 0.6;  ///< m, the longest edge of a sample body as it is by default
/// Two points of its surface, neither on an edge.
inline const SurfacePoint kMarked{.triangle = 3, .weight = {0.2, 0.5, 0.3}},
    kSecond{.triangle = 8, .weight = {0.1, 0.1, 0.8}};
inline constexpr FrameMotion kAllMotions[] = {FrameMotion::kFree, FrameMotion::kPoint, FrameMotion::kLine,
                                              FrameMotion::kKinematic};

/// The lumped masses of a sample body and its modes at them, in double precision.
struct Particles {
  std::vector<double> mass;              // kg
  std::vector<Vec3> rest;                // body frame, m
  std::vector<std::vector<Vec3>> shape;  // [mode][particle], kg^−½
};

struct SampleOptions {
  FrameMotion motion = FrameMotion::kFree;
  int modes = 4;
  int dropped = 0;         ///< further modes, which answer as the residual compliance of the corners
  double lowest_hz = 3.0;  ///< frequencies are 1, 1.7, 2.4, … times this
  double decay = 0.0;      ///< ξ of every mode, 1/s
  Vec3 half_extent{0.3, 0.2, 0.1};
};

/// A box of unequal masses, its 8 corners first, then the centres of edges and faces and its own: 81 degrees of
/// freedom, so up to 75 modes. Free and kinematic bodies have their origin at the centre of mass; kPoint and kLine ones
/// hang from above it (the line is the body's x axis).
inline Particles sample_particles(const SampleOptions& o) {
  Particles body;
  double total = 0.0;
  Vec3 center = Vec3::Zero();
  std::vector<Vec3> places;
  for (int corner = 0; corner < 8; ++corner)
    places.push_back({(corner & 1) ? 1.0 : -1.0, (corner & 2) ? 1.0 : -1.0, (corner & 4) ? 1.0 : -1.0});
  for (int i = 0; i < 27; ++i) {
    const Vec3 place(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    if (place.cwiseAbs().sum() < 3.0) places.push_back(place);
  }
  for (const Vec3& place : places) {
    body.rest.push_back(place.cwiseProduct(o.half_extent));
    body.mass.push_back(0.1 + 0.01 * static_cast<double>(body.mass.size()));
    total += body.mass.back();
    center += body.mass.back() * body.rest.back();
  }
  const bool hangs = o.motion == FrameMotion::kPoint || o.motion == FrameMotion::kLine;
  const Vec3 drop = hangs ? Vec3(0.0, 0.0, -0.5) : Vec3::Zero();
  for (Vec3& r : body.rest) r += drop - center / total;

  // Gram–Schmidt in the mass inner product: the rigid motions that the fixing leaves free, then waves over the corners.
  std::vector<std::vector<Vec3>> basis;
  const auto inner = [&](const auto& a, const auto& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < body.mass.size(); ++i) sum += body.mass[i] * a[i].dot(b[i]);
    return sum;
  };
  const auto add = [&](std::vector<Vec3> u) {
    for (int pass = 0; pass < 3; ++pass)
      for (const auto& b : basis) {
        const double s = inner(u, b);
        for (std::size_t i = 0; i < u.size(); ++i) u[i] -= s * b[i];
      }
    const double norm = std::sqrt(inner(u, u));
    for (Vec3& x : u) x /= norm;
    basis.push_back(std::move(u));
  };
  const auto rigid = [&](const Vec3& v, const Vec3& w) {
    std::vector<Vec3> u;
    for (const Vec3& r : body.rest) u.push_back(v + w.cross(r));
    return u;
  };
  if (o.motion == FrameMotion::kFree)
    for (int axis = 0; axis < 3; ++axis) add(rigid(Vec3::Unit(axis), Vec3::Zero()));
  if (o.motion == FrameMotion::kFree || o.motion == FrameMotion::kPoint)
    for (int axis = 0; axis < 3; ++axis) add(rigid(Vec3::Zero(), Vec3::Unit(axis)));
  if (o.motion == FrameMotion::kLine) add(rigid(Vec3::Zero(), Vec3::UnitX()));
  const std::size_t rigid_count = basis.size();
  for (int mode = 0; mode < o.modes + o.dropped; ++mode) {
    std::vector<Vec3> u;
    for (std::size_t i = 0; i < body.mass.size(); ++i) {
      const double x = static_cast<double>(i) + 0.5;
      u.push_back(
          {std::sin(1.3 * x * (mode + 1)), std::cos(0.7 * x + mode * x), std::sin(2.1 * x + 1.0 + 0.9 * mode * x)});
    }
    add(std::move(u));
  }
  basis.erase(basis.begin(), basis.begin() + static_cast<std::ptrdiff_t>(rigid_count));
  body.shape = std::move(basis);
  return body;
}

inline double sample_eigenvalue(const SampleOptions& o, int mode) {
  const double omega = 2.0 * std::numbers::pi * o.lowest_hz * (1.0 + 0.7 * mode);
  return omega * omega;
}

/// Σ w wᵀ/λ over the dropped modes.
inline ResidualCompliance sample_residual(const Particles& body, const SampleOptions& o) {
  constexpr Index kCorners = 8;
  ResidualCompliance residual(ResidualCompliance::Form::kFull, kCorners);
  for (Index a = 0; a < kCorners; ++a)
    for (Index b = 0; b <= a; ++b) {
      Mat3 G = Mat3::Zero();
      for (int mode = o.modes; mode < o.modes + o.dropped; ++mode) {
        const auto& shape = body.shape[static_cast<std::size_t>(mode)];
        G += shape[static_cast<std::size_t>(a)] * shape[static_cast<std::size_t>(b)].transpose() /
             sample_eigenvalue(o, mode);
      }
      residual.set(a, b, G);
    }
  return residual;
}

inline ModalModelData sample_model_data(const SampleOptions& o) {
  const Particles body = sample_particles(o);
  ModalModelData data;
  data.name = "corners";
  data.motion = o.motion;
  data.volume = 8.0 * o.half_extent.prod();
  for (std::size_t i = 0; i < body.mass.size(); ++i) {
    const Vec3& r = body.rest[i];
    data.mass += body.mass[i];
    data.center_of_mass += body.mass[i] * r;
    data.inertia += body.mass[i] * (r.squaredNorm() * Mat3::Identity() - r * r.transpose());
    if (i < 8) data.render.rest.push_back(r.cast<float>());
  }
  data.center_of_mass /= data.mass;
  const bool at_center = o.motion == FrameMotion::kFree || o.motion == FrameMotion::kKinematic;
  if (at_center) data.center_of_mass = Vec3::Zero();  // round-off only
  data.render.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                           {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  data.render.basis = ModalBasis(8, o.modes);
  ModalVolume volume;
  volume.rest = body.rest;
  volume.tets = {{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}};
  volume.basis = ModalBasis(static_cast<Index>(body.mass.size()), o.modes);
  volume.mass_times_basis = ModalBasis(static_cast<Index>(body.mass.size()), o.modes);
  for (int mode = 0; mode < o.modes; ++mode) {
    data.eigenvalues.push_back(sample_eigenvalue(o, mode));
    data.decays.push_back(o.decay);
    Vec3 participation = Vec3::Zero();
    Mat3 moment = Mat3::Zero();
    for (std::size_t i = 0; i < body.mass.size(); ++i) {
      const Vec3& w = body.shape[static_cast<std::size_t>(mode)][i];
      const auto vertex = static_cast<Index>(i);
      participation += body.mass[i] * w;
      moment += body.mass[i] * body.rest[i] * w.transpose();
      if (vertex < 8) data.render.basis.set(vertex, mode, w.cast<float>());
      volume.basis.set(vertex, mode, w.cast<float>());
      volume.mass_times_basis.set(vertex, mode, (body.mass[i] * w).cast<float>());
    }
    data.participation.push_back(o.motion == FrameMotion::kFree ? Vec3(Vec3::Zero()) : participation);
    data.moments.push_back(moment);
  }
  data.volume_block = std::move(volume);
  if (o.dropped > 0) data.residual_compliance = sample_residual(body, o);
  return data;
}

inline std::shared_ptr<const ModalModel> sample_model(const SampleOptions& o = {}) {
  return std::make_shared<const ModalModel>(sample_model_data(o));
}

}  // namespace limber::testing
