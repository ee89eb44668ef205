/// @file limber/model/skin_pose.h
/// The handles of a modal skin for given amplitudes, and with them any point and its exact derivative.
///
///   x_v = r_v + u_v + Σ_h β_vh [(R_h − 1)(r_v + u_v) + t_h],   u_v = U_v z − Σ_h β_vh [e_h + (Θ_h z) × r_v]
///   J_v = ∂x_v/∂z,   g = J_vᵀ f: what a force f at the vertex does to the modes
///
/// t_h = p_h − R_h r_h and e_h = P_h z − (Θ_h z) × r_h (limber/model/modal_skin.h). Free bodies are moved back into
/// their frame first: R_h ← Qᵀ R_h, t_h ← Qᵀ (t_h − c) with the mass centre c and the rotation Q that makes Qᵀ Σ m x rᵀ
/// symmetric.
#pragma once

#include <span>
#include <vector>

#include "limber/model/modal_skin.h"

namespace limber {

/// One body's handles. Made once, then set() as often as one likes: nothing below the constructor allocates.
class SkinPose {
 public:
  /// Motion that a handle gives the points that hang on it.
  struct Handle {
    Mat3 turn = Mat3::Zero();   ///< R_h − 1
    Vec3 shift = Vec3::Zero();  ///< t_h, m
    Vec3 angle = Vec3::Zero();  ///< Θ_h z, rad
    Vec3 drift = Vec3::Zero();  ///< e_h, m
  };

  /// @param skin checked (ModalModel does); must outlive the pose
  explicit SkinPose(const ModalSkin& skin);
  /// As if made anew; allocates only for a skin larger than any before.
  void bind(const ModalSkin& skin);

  const ModalSkin& skin() const { return *skin_; }
  /// @param z k amplitudes, kg^½·m
  void set(std::span<const double> z);
  std::span<const Handle> handles() const { return handles_; }
  /// The same in single precision for reconstruct(): per handle the rows of R_h − 1, t_h, Θ_h z, e_h.
  static constexpr std::size_t kNumbers = 18;
  std::span<const float> numbers() const { return numbers_; }
  /// Largest |Θ_h z|, rad: how far the body is bent.
  double largest_angle() const;

  /// Position of a point of the surface, body frame, m. @param rest r_v @param linear U_v z, m
  Vec3 position(const SkinInfluences& at, const Vec3& rest, const Vec3& linear) const;
  /// r_v + Ũ_v z, m: the part that the handles turn and carry.
  Vec3 undeformed_part(const SkinInfluences& at, const Vec3& rest, const Vec3& linear) const;
  /// R̄ = Σ_h β_vh R_h: what turns small displacements at the point, such as a residual one.
  Mat3 turn(const SkinInfluences& at) const;

  /// Makes ready what the derivative needs at the amplitudes last set. Call before add_rows().
  void differentiate();
  /// dR_h/dz_i Rᵀ = [turn]×, shift = dt_h/dz_i. @pre differentiate()
  struct Rate {
    Vec3 turn, shift;
  };
  Rate rate(Index handle, Index mode) const;
  /// How a free body is kept in its frame, Σ m x rᵀ/m = Q P, and what a mode does to that, in the axes of the frame.
  /// @pre has a gauge; for the second, differentiate()
  const Mat3& frame_moment() const { return stretch_; }  ///< P, m²
  struct FrameRate {
    Vec3 turn = Vec3::Zero();    ///< [turn]× = Qᵀ dQ/dz_i
    Vec3 centre = Vec3::Zero();  ///< Qᵀ dc/dz_i
    Mat3 moment = Mat3::Zero();  ///< Qᵀ d(Σ m x rᵀ/m)/dz_i
  };
  const FrameRate& frame_rate(Index mode) const { return frame_rates_[static_cast<std::size_t>(mode)]; }
  /// g += J_vᵀ f but for the part that goes by U: the caller adds U_vᵀ f̄ with the force f̄ that is returned.
  /// @param f body axes @param g k numbers
  Vec3 add_rows(const SkinInfluences& at, const Vec3& rest, const Vec3& linear, const Vec3& f,
                std::span<double> g) const;
  /// J_v ż, body frame, m/s. @pre differentiate(). @param linear_rate U_v ż. @param rates ż
  Vec3 velocity(const SkinInfluences& at, const Vec3& rest, const Vec3& linear, const Vec3& linear_rate,
                std::span<const double> rates) const;

 private:
  void place_handles(std::span<const double> z);
  void find_frame(std::span<const double> z);
  void stay_in_frame();
  void write_numbers();
  void differentiate_places();
  void differentiate_frame();
  std::size_t row(Index handle, int axis) const;

  const ModalSkin* skin_;
  std::vector<Handle> handles_;
  std::vector<float> numbers_;
  std::vector<Vec3> reach_;           // a_lh + D_lh z, [l][h]
  std::vector<double> moments_;       // S_h + Σ z Z_h, [handle][12]
  Mat3 out_of_frame_, stretch_;       // Q and P of Σ m x rᵀ = Q P
  Vec3 centre_ = Vec3::Zero();        // c
  std::vector<double> turn_rates_;    // Ω_h: [dR_h/dz_i Rᵀ]×, [handle][axis][mode]
  std::vector<double> shift_rates_;   // dt_h/dz
  std::vector<double> drift_shapes_;  // de_h/dz, which no amplitude changes
  std::vector<FrameRate> frame_rates_;
};

}  // namespace limber
