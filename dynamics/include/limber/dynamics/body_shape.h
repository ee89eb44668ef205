/// @file limber/dynamics/body_shape.h
/// Points of a body's surface at given amplitudes, their motion with these, and the modal forces of loads on them: the
/// one place that knows whether a body bends by its modes alone or by its modal skin.
///
///   p_BP = r + U z                       J = U          by the modes alone
///   p_BP = Σ_c w_c x_c(z)                J = ∂p/∂z      with a skin (skin_pose.h): c corners of the triangle, w weights
///
/// With a skin surfaces stay made of flat triangles, so bodies are touched and held as they are drawn.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "limber/dynamics/surface_point.h"
#include "limber/model/skin_pose.h"

namespace limber {

/// The handles of one body's skin at the amplitudes that were asked for last: a step asks for those at its start, at
/// its end and between, again and again. One thread at a time; the first call allocates.
class SkinMemory {
 public:
  /// @param skin checked; must outlive this
  explicit SkinMemory(const ModalSkin& skin) : skin_(&skin) {}

  /// Stays at z until kPoses others have been asked for. @param z k numbers
  const SkinPose& at(std::span<const double> z) { return entry(z).pose; }
  /// With what SkinPose::add_rows() and velocity() need.
  const SkinPose& differentiated(std::span<const double> z);

 private:
  static constexpr std::size_t kPoses = 6;  // two ends, three places between, and one for a time of contact
  struct Entry {
    SkinPose pose;
    std::vector<double> z;
    std::uint64_t used = 0;  // 0: holds nothing
    bool differentiated = false;
  };
  Entry& entry(std::span<const double> z);

  const ModalSkin* skin_;
  std::vector<Entry> entries_;
  std::uint64_t clock_ = 0;
};

/// Influences of a surface's vertices. @pre the model has a skin
std::span<const SkinInfluences> skin_influences(const ModalModel& model, SurfacePoint::Surface surface);

/// One body's shape at one set of amplitudes: a view, made where it is needed. Points are valid, nothing throws.
class BodyShape {
 public:
  /// @param z k numbers, or none for a body at rest by its modes alone. @param skin null: by the modes alone
  BodyShape(const ModalModel& model, std::span<const double> z, SkinMemory* skin)
      : model_(&model), z_(z), skin_(skin) {}

  std::span<const double> amplitudes() const { return z_; }
  /// The handles here; with what rows and velocities need. @pre there is a skin
  const SkinPose& handles() const { return skin_->at(z_); }
  const SkinPose& differentiated() const { return skin_->differentiated(z_); }

  // A point's place and motion, in the body frame.
  Vec3 position(const SurfacePoint& at) const;
  /// J ż, m/s.
  Vec3 velocity(const SurfacePoint& at, std::span<const double> rates) const;
  /// g += Jᵀ f. @param f_B force (N) or impulse (N·s)
  void add_force(const SurfacePoint& at, const Vec3& f_B, std::span<double> g) const;
  /// Rotation of small displacements beside the modes, such as a residual one, from the rest shape: 1 without a skin.
  Mat3 turn(const SurfacePoint& at) const;

 private:
  const ModalModel* model_;
  std::span<const double> z_;
  SkinMemory* skin_;
};

/// One of the places between two, for the mean ∫₀¹ … ds over the straight way from z₀ to z₁ by Gauss's rule: that of J
/// is J̄ with J̄ Δz = Δx, so that a force that acts by it over a step does the work f·Δx (error: (Θ_h Δz)⁷/2e6 of a
/// handle's arm).
struct ShapeBetween {
  BodyShape shape;
  double weight;  ///< of it in the mean; they sum to 1
};
constexpr std::size_t kShapesBetween = 3;
/// Their places, as parts of the way, and their weights.
constexpr std::array<double, kShapesBetween> kPartsBetween{0.5 - 0.3872983346207417, 0.5, 0.5 + 0.3872983346207417};
constexpr std::array<double, kShapesBetween> kWeightsBetween{5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};

}  // namespace limber
