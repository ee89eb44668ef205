/// @file limber/constraints/joint_constraint.h
/// Joints between two deforming bodies, or a body and the world, as rows ([X09] Table 1; joint_spec.h for the types).
///
/// Frame J sits on both parts, o_a, R_a and o_b, R_b, each moving with the patch it is attached to (material_frame.h).
/// With d = R_aᵀ(o_b − o_a) and Q = R_aᵀR_b the locked freedoms are rows
///   d_i = 0,     x_b or z_b along that of a (two rows),     or the vector part of Q's quaternion = 0 (three rows),
/// and the free ones coordinates q: rotation about x (z for planar), translation along x (x and y), and for a ball the
/// intrinsic x-y-z Euler angles. Angles count full turns. On each coordinate may act
///   a limit     lo ≤ q ≤ hi                    rows of one sign
///   a motor     q̇ = v, |F| ≤ max_force         a row with bounds
///   a drive     F = −k (q − target) − c q̇      a spring and damper, evaluated at the end of the step: stable for all
///   friction    |F| ≤ friction, against q̇      a row with bounds
/// Impulses act at o_b on both bodies, so that momentum is kept exactly.
///
/// All locked rows are met at the end of the step, to 1e-12 of the joint's size. Parts that start out of place are
/// brought together at 1 m/s and 1 rad/s.
#pragma once

#include <array>
#include <tuple>
#include <type_traits>
#include <vector>

#include "limber/constraints/material_frame.h"
#include "limber/core/state_archive.h"
#include "limber/model/joint_spec.h"

namespace limber {

class JointConstraint final : public Constraint {
 public:
  /// @param a, b the joint's frame on each part. @param spec its frame is not read
  /// @throws InvalidArgument if the spec is not valid
  JointConstraint(MaterialFrame a, MaterialFrame b, const JointSpec& spec);

  int coordinates() const { return freedoms(spec_.type).count(); }
  void set_actuation(int coordinate, const JointActuation& actuation);
  const JointActuation& actuation(int coordinate) const { return actuation_[static_cast<std::size_t>(coordinate)]; }

  /// q at the end of the last step, angles with their full turns.
  double coordinate(int i, const BodyStates& states) const { return coordinate(instant(states, StepTime::kStart), i); }
  /// Force along the coordinate over the last step: limit, motor, drive and friction together, N or N·m.
  double coordinate_force(int i) const { return force_.coordinate[static_cast<std::size_t>(i)]; }
  /// Force of the locked translations on b over the last step, world, N.
  const Vec3& force() const { return force_.locked; }
  /// How far the locked freedoms are off: largest distance (m) and angle (rad).
  struct Error {
    double distance = 0.0, angle = 0.0;
  };
  Error error(const BodyStates& states) const;

  std::array<Index, 2> bodies() const override { return {a_.body(), b_.body()}; }
  bool may_be_divided() const override { return true; }
  void begin_part(const PartOfStep& part) override { ends_step_ = part.length == part.left; }
  void add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) override;
  void add_force_derivative(const BodyStates& states, std::span<const double> impulses,
                            ForceDerivative& sum) const override;
  void gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const override;
  void accept(const BodyStates& states, std::span<const double> impulses) override;

  /// Reads a joint in the place of this one. @param state written of any joint
  void restore_state(StateReader& state);

 private:
  friend struct StateFields;
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.a_, s.b_, s.spec_.type, s.spec_.frame.origin, s.spec_.frame.axes, s.spec_.limits, s.spec_.pitch,
                    s.actuation_, s.last_, s.force_.plan, s.force_.coordinate, s.force_.actuation, s.force_.locked);
  }

  /// Both frames at one instant.
  struct Instant {
    FrameInstant a, b;
    Vec3 d = a.local(b.position);  // in a's axes
  };
  /// From the origin of each body to o_b, where all forces act, world.
  struct Arms {
    explicit Arms(const Instant& at) : a(at.b.position - at.a.origin), b(at.b.position - at.b.origin) {}
    Vec3 a, b;
  };
  /// What a row measures: d_i; one axis of b across one of a; q_i of the vector part of Q's quaternion, twice; the
  /// screw's d_x − pitch q; an angle q; how far x_b is from x_a.
  enum class Measure { kTranslation, kAcross, kTurn, kScrew, kAngle, kCone };
  /// What it asks for. The last three are those of actuation.
  enum class Law { kLocked, kLimit, kMotor, kDrive, kFriction };
  /// A row's gap is sign (measure − zero).
  struct RowPlan {
    Measure measure = Measure::kTranslation;
    Law law = Law::kLocked;
    int axis = 0;         // of J
    int coordinate = -1;  // that is measured; −1: none
    double sign = 1.0, zero = 0.0;
  };
  /// Of the last step.
  struct Forces {
    std::array<double, 3> coordinate{};
    std::array<double, 9> actuation{};  // by actuator()
    std::vector<double> plan;           // by row of plan_
    Vec3 locked = Vec3::Zero();         // locked and coordinate: of a step's last part
  };
  /// Relative motion that a row measures: linear along n at o_b, and angular about a; world.
  struct Direction {
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
  };

  struct TurnAxes {
    int of_a = 0, of_b = 0;
    double sign = 0.0;
  };

  std::array<TurnAxes, 2> turn_axes(const RowPlan& row) const;
  Instant instant(const BodyStates& states, StepTime when) const;
  Instant instant_of_rows(const BodyStates& states, StepTime when) const;
  Vec3 raw_coordinates(const Instant& at) const;
  double unwrapped(double raw, int i) const;
  double coordinate(const Instant& at, int i) const { return unwrapped(raw_coordinates(at)[i], i); }
  double measured(const Instant& at, const RowPlan& row) const;
  double gap(const Instant& at, const RowPlan& row) const { return row.sign * (measured(at, row) - row.zero); }
  Direction direction(const Instant& at, const RowPlan& row) const;
  Vec3 direction_change(const Instant& at, const RowPlan& row, const Mat3& dR_a, const Mat3& dR_b) const;
  Direction mean_direction(const Instant& start, const Instant& end, const Instant& at, const RowPlan& row,
                           const Vec3& turn) const;
  int axis_of(int coordinate) const;
  int turning_axis() const { return spec_.type == JointType::kPlanar ? 2 : 0; }  // of what turns about one alone
  static bool is_distance(const RowPlan& row) {
    return row.measure == Measure::kTranslation || row.measure == Measure::kScrew;
  }
  static std::size_t actuator(const RowPlan& row) {
    return static_cast<std::size_t>(3 * (static_cast<int>(row.law) - static_cast<int>(Law::kMotor)) + row.coordinate);
  }
  double& last_force(std::size_t row) {
    return rows_[row].law < Law::kMotor ? force_.plan[row] : force_.actuation[actuator(rows_[row])];
  }
  void sum_forces();
  RowPlan row_of(int coordinate, Law law, double sign = 1.0, double zero = 0.0) const;
  void plan();
  void plan_locked_rows();
  void plan_limits();
  void plan_actuation();
  void add_mean_rows(const BodyStates& states, ConstraintRows& rows);
  RowParameters& add_row(const Instant& at, const Arms& arms, const RowPlan& plan, const Direction& along,
                         ConstraintRows& rows);
  void bend(const Instant& at, const RowPlan& plan, const Direction& along, FrameMeasure& of_a,
            FrameMeasure& of_b) const;
  void write_law(const RowPlan& plan, double gap, RowParameters& law) const;
  void write_actuation_law(const RowPlan& plan, double gap, RowParameters& law) const;

  MaterialFrame a_, b_;
  JointSpec spec_;
  std::array<JointActuation, 3> actuation_{};
  std::array<double, 3> last_{};  // coordinates at the last step's end: where angles are counted from
  std::vector<RowPlan> plan_;     // locked rows, then limits
  std::vector<RowPlan> rows_;     // plan_ and the actuation
  Forces force_;
  double step_ = 0.0;
  bool ends_step_ = true;      // the part at hand does
  bool counts_turns_ = false;  // a row measures an angle
  bool sees_turns_ = false;    // a row is not of a distance along a's axes
  Mat3 axes_at_start_ = Mat3::Identity();
  std::vector<double> modal_;         // scratch
  mutable std::vector<Vec3> shapes_;  // scratch of add_force_derivative()
};

}  // namespace limber
