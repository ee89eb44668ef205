/// @file limber/constraints/material_frame.h
/// A point or patch of a deforming body, prepared for rows: the rows of U are gathered once.
///
///   p_BP = r + D z,    R_BP = exp([Θ z]ₓ) R_rest
///
/// For one point D are its shapes and Θ = 0. For a patch of points r_v with weights w_v (Σ w_v = 1) it is the mean
/// displacement and the rotation that fits the displacements u_v best in the least-squares sense, linear in z:
///   D = Σ w_v U_v,    Θ = I_P⁻¹ Σ w_v [r_v − r̄]ₓ U_v,    I_P = Σ w_v (|x|²1 − x xᵀ),  x = r_v − r̄
/// Θ is zero about directions in which the patch has no extent. A frame placed off the patch moves rigidly with it.
///
/// On a body that bends by its modal skin the origin is carried by the skin (skin_pose.h): one point of the surface by
/// the corners of its triangle, a patch's frame by the handles that the patch hangs on in the mean, so that it is at r
/// + D z to first order. Its axes turn by exp([Θ z]ₓ) all the same.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "limber/constraints/constraint.h"
#include "limber/dynamics/surface_point.h"
#include "limber/model/joint_spec.h"

namespace limber {

/// What one side of a row measures of how modes move a frame, body axes. Parts add up.
struct FrameMeasure {
  Vec3 shift_B = Vec3::Zero(), turn_B = Vec3::Zero();  ///< of its origin by D ż, of its axes by Θ ż
};

/// By a turn's vector r: |r|, cos ½|r| and the factor of r in the vector part of its quaternion, sin(½|r|)/|r|.
struct HalfTurn {
  double angle = 0.0, cosine = 1.0, factor = 0.5;
};

/// A frame at one time of a step. In the middle of it axes are the mean of both ends, not orthonormal.
struct FrameInstant {
  /// What counts where modes show, in body axes.
  struct Bend {
    Mat3 R_BW, axes_B;  ///< R_BW: in the middle R'ᵀ (BodyStates)
    /// What the axes turn by per unit of Θ dz, once find_turning() has been called at one of the step's ends; in the
    /// middle the Cayley vector of all of it, of Θ Δz.
    Mat3 turning = Mat3::Identity();
    Vec3 turned = Vec3::Zero();  ///< Θ z, at the step's ends
    HalfTurn half{};             ///< of it
  };
  BodyStates states;
  StepTime when = StepTime::kStart;
  Index body = -1;
  Vec3 position = Vec3::Zero();  ///< of the frame's origin, world, m
  Mat3 axes = Mat3::Identity();  ///< world
  Vec3 origin = Vec3::Zero();    ///< of the body, world, m
  std::optional<Bend> bend{};

  /// Of a point of the world, from its origin in its axes.
  Vec3 local(const Vec3& p) const {
    const double x = p[0] - position[0], y = p[1] - position[1], z = p[2] - position[2];
    const auto along = [&](int i) { return axes(0, i) * x + axes(1, i) * y + axes(2, i) * z; };
    return {along(0), along(1), along(2)};
  }

  /// Before bend_axis() and bend_turn(), at one of the step's ends.
  void find_turning();
  // What modes add. @pre bend
  /// To the velocity of the frame's origin along n. @param n world
  void bend_origin(const Vec3& n, FrameMeasure& to) const;
  /// To the velocity along n of the material point that is at p now, the frame's motion carried on rigidly to it.
  /// @param p, n world
  void bend_point(const Vec3& p, const Vec3& n, FrameMeasure& to) const;
  /// To what u · (an axis of the frame) changes by, u held. @param axis 0 to 2. @param u world
  void bend_axis(int axis, const Vec3& u, FrameMeasure& to) const;
  /// To the angular velocity along a. @param a world
  void bend_turn(const Vec3& a, FrameMeasure& to) const;
};

class MaterialFrame {
 public:
  /// Fixed to the world.
  explicit MaterialFrame(const JointFrame& in_world);
  /// Moves with the body frame alone, whatever the modes do. @param in_body origin and axes, body frame, rest shape
  MaterialFrame(Index body, const JointFrame& in_body);
  /// One point of the surface; axes of the body frame. @param skinned the body bends by its model's skin, here and
  /// below
  MaterialFrame(Index body, const ModalModel& model, const SurfacePoint& at, bool skinned = false);
  /// A patch: of vertices weighted by the area between them, where there is any; else of points alike. @param in_body
  /// where the frame sits in the rest shape
  /// @throws InvalidArgument if `patch` is empty or a point of it is not valid
  MaterialFrame(Index body, const ModalModel& model, std::span<const SurfacePoint> patch, const JointFrame& in_body,
                bool skinned = false);

  Index body() const { return body_; }
  /// What the origin moves by with each mode, as bent at the predicted end of the step, body axes; none where modes do
  /// not show. @param room for what is not kept; the result may refer to it
  std::span<const Vec3> displacements(const BodyStates& states, std::vector<Vec3>& room) const;

  Vec3 position(const BodyStates& states, StepTime when) const;  ///< world, m
  Vec3 velocity(const BodyStates& states, StepTime when) const;  ///< of the point, world, m/s
  /// The Cayley vector of the body's turn over the step (BodyStates), and to first order that of the deformation.
  Vec3 turn(const BodyStates& states) const;

  /// The frame at one time of a step, with what all rows about it share.
  FrameInstant at(const BodyStates& states, StepTime when) const {
    return when == StepTime::kMiddle ? between(at_end(states, StepTime::kStart), at_end(states, StepTime::kEnd))
                                     : at_end(states, when);
  }
  /// The same at one of the step's ends. @param axes whether its axes count; else they are the world's
  FrameInstant at_end(const BodyStates& states, StepTime when, bool axes = true) const;
  /// The middle, from both ends.
  FrameInstant between(const FrameInstant& start, const FrameInstant& end) const;
  /// Of a row that measures the velocity of the frame's origin along n, world. @param modal room for k numbers; the
  /// result refers to it
  RowSide side(const FrameInstant& at, const Vec3& n, std::vector<double>& modal) const;
  /// What modes show of a row. @param modal likewise. @pre at.bend
  void write_modal(const FrameInstant& at, const FrameMeasure& measure, std::vector<double>& modal) const;

 private:
  friend struct StateFields;
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.body_, s.rest_.origin, s.rest_.axes, s.displacement_, s.rotation_, s.anchors_);
  }

  /// What hangs on the handles of a skin and is moved by its modes: a share of the origin.
  struct Anchor {
    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.influences.weight, s.influences.handle, s.rest, s.share, s.shapes);
    }

    SkinInfluences influences{};
    Vec3 rest = Vec3::Zero();
    double share = 1.0;
    std::vector<Vec3> shapes{};  // one per mode
  };

  Vec3 turn(std::span<const double> z) const;      // Θ z
  Vec3 displace(std::span<const double> z) const;  // D z
  Vec3 place(const BodyShape& shape) const;
  void add_rows(const BodyShape& shape, const Vec3& f_B, std::span<double> g) const;
  void add_rows(const BodyStates& states, StepTime when, const Vec3& f_B, std::span<double> g) const;

  Index body_ = -1;
  JointFrame rest_;
  std::vector<Vec3> displacement_, rotation_;  // D, Θ, one column per mode; empty: none
  std::vector<Anchor> anchors_;                // where the body has a skin; else none
};

/// All vertices of a surface within a radius of a point, as a patch; the nearest vertex if there is none.
/// @param center body frame, rest shape, m. @param radius m, ≥ 0
std::vector<SurfacePoint> patch_around(const ModalModel& model, SurfacePoint::Surface surface, const Vec3& center,
                                       double radius);

}  // namespace limber
