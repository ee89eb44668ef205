/// @file limber/constraints/constraint_rows.h
/// Rows of J: what each constraint measures, on one body or two.
///
///   u = Σ_sides linear·v + angular·ω + modal·ż          the rate of the row's gap
///   (impulse, moment, modal load) += f (linear, angular, modal)    what its impulse f does
///
/// v and ω are of the body origin, world axes. A point p of a body along n has linear n, angular (p − origin) × n and
/// modal n·R U. Impulses that act on two bodies conserve momentum if their linear parts are opposite and their arms end
/// at one world point.
///
/// A row asks for   gap(end of step) − offset + compliance f = w,   w = 0 while lower < f < upper, w ≥ 0 at the lower
/// bound, w ≤ 0 at the upper one. Gaps are true, nonlinear functions of the bodies' states, given by the row's owner
/// (constraint.h); J is their derivative at the step's start.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "limber/constraints/body_response.h"

namespace limber {

/// Which state of the bodies is meant: before the step, as last predicted, or the mean of both (BodyStates).
enum class StepTime { kStart, kEnd, kMiddle };

/// One body's part of a row.
struct RowSide {
  Index body = -1;                  ///< −1: the world, which does not move; the rest is not read then
  Vec3 linear = Vec3::Zero();       ///< world
  Vec3 angular = Vec3::Zero();      ///< world, about the body origin
  std::span<const double> modal{};  ///< k numbers, or none where the modes do not show
};

/// How a row is to be met.
struct RowParameters {
  double gap = 0.0;            ///< when the row was made, for solvers that do not ask again
  double offset = 0.0;         ///< wanted gap at the step's end, in the gap's unit
  double lower = -kUnbounded;  ///< smallest impulse, ≤ upper; equality rows (−∞, ∞), contacts and limits (0, ∞)
  double upper = kUnbounded;  ///< largest impulse
  double compliance = 0.0;    ///< ≥ 0, gap per impulse: a spring k with a damper c has 1/(Δt k + c)
  double tolerance = 1e-12;   ///< of the gap, in its unit; > 0
  double digits = 0.0;        ///< what of the gap is lost to the digits of what it is computed from, in its unit
  /// A static constraint: a joint, a stop, the ground. Its force under gravity and other held forces is found by
  /// itself, so that what rests has no velocity. For rows without compliance.
  bool holds = false;
  /// The row's force persists from step to step: springs, motors, friction.
  bool goes_on = false;
  double last_force = 0.0;  ///< that of the last step, from which solvers may begin
  /// Prescribed motion of the row's actuator (a handle, a motor) within the step, in the gap's unit: the work f/Δt
  /// times this may enter the system.
  double prescribed_displacement = 0.0;
  /// What the gap is to change by per second at the step's end, where the row has been met: 0, but for prescribed
  /// motion.
  double end_rate = 0.0;
  /// Of the spring in the row, force per unit gap from 0: its energy ½ stiffness gap² counts with that of the bodies.
  double stiffness = 0.0;
  /// μ of a contact's normal row, bounds (0, ∞): the next two rows are its tangents, and their impulses stay in the
  /// cone
  /// |(f₁, f₂)| ≤ μ f. 0: no tangents.
  double friction = 0.0;
  /// > 0: of three rows in a row, whose impulses are a vector no longer than this; `lower` and `upper` are ∓ radius.
  double radius = 0.0;
  /// Of contacts that slide, their normal row: De Saxcé's shift μ |slip| of the last step.
  double shift = 0.0;
  bool contact = false;  ///< of a contact, its normal row or a tangent
  /// One of those tangents; its gap is the slip within the step, its bounds come from the cone.
  bool slides = false;

  /// Makes it a spring k with a damper c, F = −k x' − c (x' − x)/Δt, x the gap now and x' at the step's end: stable for
  /// every k and c.
  void make_spring(double k, double c, double step, double x) {
    compliance = 1.0 / (step * k + c);
    offset = c / (step * k + c) * x;
    stiffness = k;
    goes_on = true;
  }
};

/// RowParameters::digits of what is computed from numbers of a size, in some roundings.
inline double digits_of(double size) {
  constexpr double kRoundings = 16.0 * std::numeric_limits<double>::epsilon();
  return kRoundings * size + std::numeric_limits<double>::min();
}

/// RowParameters::tolerance of a distance: a part of the lengths that it depends on, and what is lost of it to the
/// digits of its place in the world.
inline double distance_tolerance(double part, double length, const Vec3& place) {
  return part * length + digits_of(place.norm());
}

/// The rows of one island, made anew every step in memory that is kept.
class ConstraintRows {
 public:
  struct Side {
    Index body = -1;
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
    std::size_t modal_begin = 0, modal_count = 0;
  };
  struct Row {
    std::array<Side, 2> sides;
    RowParameters law;
  };

  /// Coupled compliance of two rows, beyond what the modes show: gap_i += G f_j/Δt, gap_j += G f_i/Δt.
  struct Flexibility {
    Index i = 0, j = 0;
    double value = 0.0;  ///< G, m/N
    Index body = -1;     ///< that yields, in the table; −1: the row does by itself, i = j
  };

  void clear();
  /// How often they have been cleared: rows made since belong together.
  std::uint64_t makings() const { return makings_; }
  /// @return the row's index. Copies the modal parts. Two sides of one body become one, their sum.
  Index add(const RowSide& a, const RowSide& b, const RowParameters& law);
  /// A row with the law that it has by itself, for whoever writes it in its place: both sides, and then join().
  Row& add() {
    static const RowParameters kLaw;  // copied in a few instructions, as a new one is not
    if (size_ == static_cast<Index>(rows_.size())) rows_.emplace_back();
    Row& row = this->row(size_++);
    row.law = kLaw;
    return row;
  }
  void set_modal(Side& side, std::span<const double> modal) {
    side.modal_begin = modal_.size(), side.modal_count = modal.size();
    if (!modal.empty()) modal_.insert(modal_.end(), modal.begin(), modal.end());
  }
  /// Two sides of one body become one, their sum.
  void join(Row& row) {
    if (row.sides[0].body >= 0 && row.sides[0].body == row.sides[1].body) join_sides(row);
  }
  /// Pairs (i, j) as (i, j) or (j, i), i = j too; what is given for one pair adds up. For rows with bounds. All values
  /// of a body together are a positive semidefinite matrix, of rows that act on it.
  void add_flexibility(Index body, Index i, Index j, double value) { flexibility_.push_back({i, j, value, body}); }
  /// Contact compliance: what a row yields to its own force alone, whatever it acts on, m/N; value ≥ 0.
  void add_compliance(Index row, double value) { flexibility_.push_back({row, row, value, -1}); }
  /// What is stored in flexibilities at the step's start, J: ½ FᵀG F of the last step's forces.
  void add_stored_energy(double energy) { stored_energy_ += energy; }

  Index size() const { return size_; }
  const Row& row(Index i) const { return rows_[static_cast<std::size_t>(i)]; }
  Row& row(Index i) { return rows_[static_cast<std::size_t>(i)]; }
  std::span<const double> modal(const Side& side) const { return {modal_.data() + side.modal_begin, side.modal_count}; }
  const std::vector<Flexibility>& flexibility() const { return flexibility_; }
  double stored_energy() const { return stored_energy_; }

 private:
  void write(const RowSide& from, Side& to) {
    if (from.body < 0) return void(to = {});
    to.body = from.body;
    for (int k = 0; k < 3; ++k)  // cross_matrix.h says why
      to.linear[k] = from.linear[k], to.angular[k] = from.angular[k];
    set_modal(to, from.modal);
  }
  void join_sides(Row& row);

  std::vector<Row> rows_;  // the first size_, and others for later
  Index size_ = 0;
  std::vector<Flexibility> flexibility_;
  double stored_energy_ = 0.0;
  std::vector<double> modal_;
  std::uint64_t makings_ = 0;
};

/// The bodies of one island with the places of their degrees of freedom among all of the island's.
class IslandBodies {
 public:
  /// @param table all bodies. @param members indices into it, ascending
  void set(std::span<const ConstrainedBody> table, std::span<const Index> members);
  /// How the modes of each body go through the coming step, in place of a whole step of their group. Until the next
  /// set(). @param steps one per body; kept by reference
  void set_modal_steps(std::span<const ModalStep> steps);
  /// Turns the rotation axes with the bodies: as they are, or as predicted.
  void place(StepTime when);

  Index count() const { return static_cast<Index>(members_.size()); }
  int degrees_of_freedom() const { return degrees_of_freedom_; }
  const ConstrainedBody& body(Index local) const { return bodies_[static_cast<std::size_t>(local)]; }
  const ModalStep& modal_step(Index local) const {
    return steps_.empty() ? body(local).group->modal_step() : steps_[static_cast<std::size_t>(local)];
  }
  const BodyResponse& response(Index local) const { return responses_[static_cast<std::size_t>(local)]; }
  int first(Index local) const { return first_[static_cast<std::size_t>(local)]; }
  /// −1 if the body is not of this island.
  Index local(Index body) const;

  /// J, rows × degrees of freedom, row-major. @param J that many numbers
  void write_jacobian(const ConstraintRows& rows, std::span<double> J) const;
  /// @param metric one number per degree of freedom
  void write_position_metric(double step, double theta, std::span<double> metric) const;
  void write_velocity_metric(std::span<double> metric) const;
  void write_frame_metric(std::span<double> metric) const;

 private:
  std::vector<Index> members_;
  std::vector<ConstrainedBody> bodies_;
  std::vector<BodyResponse> responses_;
  std::span<const ModalStep> steps_;
  std::vector<int> first_;
  int degrees_of_freedom_ = 0;
};

}  // namespace limber
