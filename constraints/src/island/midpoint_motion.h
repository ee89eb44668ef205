// How bodies go through a step under impulses that act in its middle: an energy–momentum step (Simo and Wong 1991).
//
//   displacement d, Cayley vector τ, R₁ = cay(τ) R₀; p, l: impulses and moments of the rows of the middle, f, t: held
//   m (d/Δt − v₀) = ½ (p + Δt m g + Δt f)
//   (1 + ½[τ]) I τ/Δt = L₀ + ½ (1 − ½[τ]) (l + Δt t)          I at the start, world axes
//   v₁ = v₀ + Δt g + (p + Δt f)/m,    L₁ = L₀ + l + Δt t
//
// Where a contact presses all of this comes at the start, s = 1 in place of ½: (d/Δt − v₀) m = s (p + …) and
// (1 + ½[τ]) I τ/Δt = L₀ + s (1 − (1 − s)[τ]) (l + Δt t), so that what rests has no velocity.
//
// The kinetic energy changes by exactly (p·d + l·τ)/Δt and what is held. Modes take the impulses as a force held.
//
// The origin of a body with fixed nodes goes where its parent takes it. In the parent's field g − a the mass moment s
// is one more point at which a given force acts: the moment about the origin is ½(R₀s₀ + R₁s₁) × (g − a), that on the
// modes R' of the field, and their work that of the field exactly. A body on a line turns about the line alone: τ keeps
// to a curve, and of the moments the part along its tangent counts.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "island_step.h"
#include "midpoint_row.h"

namespace limber::internal {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;

inline std::span<double> numbers(Vector& v) { return {v.data(), static_cast<std::size_t>(v.size())}; }
inline std::span<double> numbers(Matrix& m) { return {m.data(), static_cast<std::size_t>(m.size())}; }

/// Of the rows that take part, whose number changes: memory that grows to the largest seen.
class RowMatrix {
 public:
  Eigen::Map<Matrix> resize(Eigen::Index rows, Eigen::Index columns) {
    rows_ = rows, columns_ = columns;
    memory_.resize(static_cast<std::size_t>(rows * columns));
    return view();
  }
  Eigen::Map<Matrix> view() { return {memory_.data(), rows_, columns_}; }
  Eigen::Map<const Matrix> view() const { return {memory_.data(), rows_, columns_}; }
  std::span<double> numbers() { return memory_; }

 private:
  std::vector<double> memory_;
  Eigen::Index rows_ = 0, columns_ = 0;
};
class RowVector {
 public:
  Eigen::Map<Vector> resize(Eigen::Index size) {
    memory_.resize(static_cast<std::size_t>(size));
    return view();
  }
  Eigen::Map<Vector> view() { return {memory_.data(), size()}; }
  Eigen::Map<const Vector> view() const { return {memory_.data(), size()}; }
  std::span<double> numbers() { return memory_; }
  Eigen::Index size() const { return static_cast<Eigen::Index>(memory_.size()); }
  double& operator[](Eigen::Index i) { return memory_[static_cast<std::size_t>(i)]; }
  double operator[](Eigen::Index i) const { return memory_[static_cast<std::size_t>(i)]; }

 private:
  std::vector<double> memory_;
};

class MidpointMotion {
 public:
  /// The step without impulses, modes free. @param bends whether modes move at all in this step
  void begin(IslandStep& step, bool bends);
  Index count() const { return static_cast<Index>(bodies_.size()); }

  /// Goes to where given impulses would take free bodies if rows stayed as they are at the step's start.
  void guess(const IslandStep& step, std::span<const double> impulses);
  /// Predicts the bodies where they are in this step, measures the gaps there, and linearises the rows at the end and
  /// in the middle.
  void place(IslandStep& step);
  /// The rows, as they were linearised last.
  void take_rows(const IslandStep& step, std::vector<MidpointRow>& rows) const;
  /// What impulses leave of the equations above, six numbers a body, N·s and N·m·s; and of the modal loads.
  /// @param impulses by row
  /// @return whether the bodies' are met, to their digits or MidpointTuning::met of the tolerance of places
  bool find_residual(std::span<const MidpointRow> rows, std::span<const double> impulses, Vector& residual,
                     Vector& modal);
  /// Its derivative by (d, τ) of all bodies; and how moments follow bending, modal loads turning, by body: bend and
  /// turned, 3 × modes.
  void find_derivative(const IslandStep& step, std::span<const double> impulses, Matrix& K);
  /// What modes that follow make of the matrices of Newton's step.
  void condense(Matrix& K, std::span<MidpointRow> rows);
  /// And of the residual by what is left of the modal loads: after condense(), until the next one.
  void condense(const Vector& modal_residual, Vector& residual) const;
  /// Adds to the modal loads what turning makes of them.
  void add_turned(const Vector& change, Vector& load) const;
  /// What an impulse moves the row's own gap by through the frames, where they bear no forces, > 0.
  double mobility(const MidpointRow& row) const;
  /// Gaps of row i that impulses on row j make through the modes.
  double through_modes(const MidpointRow& i, const MidpointRow& j) const;
  /// How much larger the parts of K by forces are than those by inertia.
  double force_to_inertia(const Matrix& K) const;
  /// What a unit of modal load makes of the amplitudes.
  const Vector& modal_response() const { return response_; }
  /// Where a body's modes begin among all of the island's.
  Index first_mode(Index body) const { return bodies_[static_cast<std::size_t>(body)].first_mode; }
  /// @param change of (d, τ) by body. @param load of all modes
  void move(const Vector& change, const Vector& load, double part);
  /// (d, τ) in parts of the bodies' sizes and in radians.
  void write_place(Vector& to) const;
  /// A change in parts of the bodies' sizes and in radians.
  void write_relative(const Vector& change, Eigen::Ref<Vector> to) const;
  /// Largest of what the change is to the places, by the tolerances of these.
  double size_of(const Vector& change) const;
  /// The part of a change that turns no body by more than a radian or so.
  double part_of(const Vector& change) const;
  /// Predicts the end, velocities and all. @param impulses by row
  void finish(IslandStep& step, std::span<const double> impulses);
  /// Nothing moves but what is slower for it, and what parents carry.
  void stay(IslandStep& step);

 private:
  struct Body {
    Vec3 shift = Vec3::Zero(), turn = Vec3::Zero();            // d, τ
    Vec3 flight = Vec3::Zero();                                // d without impulses
    Vec3 momentum = Vec3::Zero(), torque = Vec3::Zero();       // L₀, Δt t
    Mat3 inertia = Mat3::Identity(), easy = Mat3::Identity();  // and its inverse
    Mat3 kept = Mat3::Identity();                              // what of the moments' equation counts, a projection
    Mat3 loose = Mat3::Identity();                             // the turns that it is free to, a projection
    double mass = 0.0, size = 0.0, far = 0.0;                  // of gyration; round-off of its place, m
    Index first_mode = 0, modes = 0;
    Index carried = -1;
  };
  struct Carried {  // of a body with fixed nodes
    explicit Carried(const RigidFrame& frame) : end(frame) {}
    RigidFrame end;               // its parent there
    FrameExcitation excitation;   // of one that does not turn by itself
    Vec3 torque = Vec3::Zero();   // Δt t, what is given
    Vec3 field = Vec3::Zero();    // Δt (g − a) where it turns by itself
    Quaternion turn;              // the parent's
    Vec3 line = Vec3::Zero();     // at the end, world
    Vec3 tangent = Vec3::Zero();  // ∂τ/∂x, R₁ = cay(x line) turn R₀
    double angle = 0.0;           // x
  };
  Quaternion attitude(const IslandStep& step, Index local) const;
  void begin_carried(const IslandStep& step, Index local, Body& body);
  void turn_about_line(Body& body);
  RigidFrame end_of(IslandStep& step, Index local, const Vec3& angular_momentum) const;
  FrameExcitation excitation_of(const IslandStep& step, Index local, const RigidFrame& end) const;
  void predict(IslandStep& step, Index local, const RigidFrame& end);
  void find_field_derivative(const IslandStep& step, Index local, Matrix& K);
  void hold_carried(Matrix& K);
  void sum_impulses(const ConstraintRows& rows, const IslandBodies& bodies, std::span<const double> impulses);
  Mat3 late(const Vec3& turn) const;
  Vec3 parent_moment(const Body& body, const Vec3& after) const;

  std::vector<Body> bodies_;
  std::vector<Carried> carried_;
  double length_ = 0.0, share_ = 0.5;  // Δt, s
  bool bends_ = true;
  std::vector<Vec3> impulse_, moment_;  // of the rows, by body
  Vector response_, load_;
  Vector terms_;  // of the equations, by size
  // By mode: ∂r_τ/∂z, and of its load and, by what is no load, its amplitude by τ; condensed: ∂r_τ/∂load, and all of
  // its amplitude by τ.
  Eigen::Matrix<double, 3, Eigen::Dynamic> bend_, turned_, swung_;
};

}  // namespace limber::internal
