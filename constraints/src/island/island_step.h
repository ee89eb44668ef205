// What all solvers of an island's step share: its bodies, its rows at the step's start and at its end, their impulses,
// and the bodies' motion under these.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "../frame_at.h"
#include "limber/constraints/island_solver.h"
#include "limber/solvers/contact_potential.h"

namespace limber::internal {

inline bool is_equality(const RowParameters& law) {
  return !law.slides && law.lower == -kUnbounded && law.upper == kUnbounded;
}
/// Rows of the contact whose normal row this is, or of the vector whose first row it is.
inline Index contact_rows(const RowParameters& first) { return first.friction > 0.0 || first.radius > 0.0 ? 3 : 1; }
/// Where its impulse stays, or theirs.
inline ContactPotential set_of(const RowParameters& first) {
  using Set = ContactPotential::Set;
  if (first.radius > 0.0) return {.set = Set::kBall, .bound = first.radius};
  if (first.friction > 0.0) return {.set = Set::kCone, .bound = first.friction};
  return {.set = Set::kInterval, .lower = first.lower, .upper = first.upper};
}

/// A step, or a part of one where it is cut.
struct StepPart {
  std::span<const ConstrainedBody> table;
  std::span<const Index> members;
  std::span<Constraint* const> constraints;
  IslandOptions options;    ///< with the part's own length
  double whole_step = 0.0;  ///< s
  double left = 0.0;        ///< s, of the step, from where the part begins
  bool begins = true, ends = true;
  bool last_resort = false;  ///< shorter parts were not found either
};

/// What acts on the bodies of an island, in the form in which they are predicted.
struct IslandLoads {
  std::vector<ConstraintLoad> frames;  // by body; their modal parts are parts of:
  std::vector<double> modes;           // by degree of freedom
  std::vector<ModalStep> steps;        // how the modes go through the part, where not as their groups go through a step

  void clear(const IslandBodies& bodies);
  /// @param values by row. @param frame_scale, modal_scale of them, what frames and modes get
  void add(const IslandBodies& bodies, const ConstraintRows& rows, std::span<const double> values, double frame_scale,
           double modal_scale);
  /// Numbers of a body's modes.
  double* modal(Index local) {
    return modes.data() + (frames[static_cast<std::size_t>(local)].modal.data() - modes.data());
  }
};

/// Its members are many since they are all that the solvers of a step hand on to each other.
struct IslandStep {
  StepPart part;
  IslandBodies bodies;
  ConstraintRows rows, end_rows, midpoint_rows;  // linearised at the start, at the predicted end and in the middle
  std::vector<Index> first_row;                  // per constraint, and the end
  bool contacts_alone = false;                   // among the rows
  bool mean = false;            // joints and the like: impulses act by the rows of the middle of the step
  bool touches = false;         // some rows are contacts
  bool loads_at_start = false;  // gravity and held forces come to the frames there, as impulses do
  double theta = 1.0;           // the part of f that frames get at the start; the rest at the end
  std::vector<double> start_gap, gap;
  std::vector<double> f;                       // N·s, beside the reactions
  std::vector<double> reaction, end_reaction;  // N, to held forces, at the start and at the end
  std::vector<double> touch_impulse;           // N·s, before the step
  std::vector<double> end_impulse;             // N·s, after it
  double end_work = 0.0;                       // J, of these where rows are driven
  double end_modal_gain = 0.0;                 // J, what they give the modes
  IslandLoads loads;

  /// Linearises the rows. All impulses are zero. @param contacts_react contacts answer to held forces as other rows
  /// that hold do, which are half at the start: no row comes in rounds or in the middle of the step
  void begin(const StepPart& of, bool contacts_react);
  double length() const { return part.options.step; }
  std::size_t size() const { return f.size(); }
  const RowParameters& law(std::size_t row) const { return rows.row(static_cast<Index>(row)).law; }
  /// Those of its rows.
  std::span<const double> of_constraint(std::span<const double> by_row, std::size_t constraint) const {
    const auto begin = static_cast<std::size_t>(first_row[constraint]),
               end = static_cast<std::size_t>(first_row[constraint + 1]);
    return by_row.subspan(begin, end - begin);
  }
  bool any_law(bool (*holds)(const RowParameters&)) const;
  /// What the world's gravity is to a body.
  Vec3 gravity_of(Index local) const {
    return bodies.body(local).group->own_gravity(bodies.body(local).slot, part.options.gravity);
  }

  /// The bodies under θ f and the first half of the reaction at the start, their modes under all of both, held; and the
  /// gaps there.
  void predict();
  /// Under the loads as they are.
  void predict_under_loads();
  /// Linearises the rows elsewhere than at the start.
  void linearise(StepTime when, ConstraintRows& to) const;
  void measure(StepTime when, std::vector<double>& into) const;

  /// act(side, local, again) for the bodies of a row; again: the one before was the same body.
  template <class Action>
  void for_bodies(std::size_t row, Action&& act) const;
  /// act(first row, number of rows) for each row, or the rows of one contact or vector.
  template <class Action>
  void for_units(Action&& act) const {
    for (std::size_t i = 0, count = 1; i < size(); i += count) {
      count = static_cast<std::size_t>(contact_rows(law(i)));
      act(i, count);
    }
  }

 private:
  void load_start(Index local, ConstraintLoad& load) const;
  Vec3 held_gravity(Index local) const;
  void set_loads();
  void move_under_loads();
  void find_kind(bool contacts_react);
  void set_modal_steps();
};

template <class Action>
void IslandStep::for_bodies(std::size_t row, Action&& act) const {
  Index last = -1;
  for (const ConstraintRows::Side& side : rows.row(static_cast<Index>(row)).sides) {
    const Index local = bodies.local(side.body);
    if (local < 0) continue;
    act(side, local, local == last);
    last = local;
  }
}

}  // namespace limber::internal
