// What contact forces press into bodies beyond their kept modes (residual_compliance.h), from step to step.
//
// A body remembers the forces f_j of its last step at the material points p_j that they pressed on, in its own frame:
//
//   u(p) = Σ_j G(p, p_j) f_j,     energy ½ Σ_j f_j · u(p_j)
//
// This is a state of the body, not of its contacts: it turns with the body, and where contacts come and go, slide on
// to other triangles or are thinned in another way, each of them finds the dent that is there.
//
// Forces are found in the next step: all contacts of a body yield to each other, whichever body they are with.
#pragma once

#include <span>
#include <vector>

#include "limber/constraints/contact_constraint.h"

namespace limber {

class ContactDents {
 public:
  /// A contact's side as rows of the island at hand: `rows` of them from `first` on, along the columns of `axes`.
  struct Rows {
    SurfacePoint at{};
    Mat3 axes = Mat3::Identity();  // body frame, turned round for the body that is pressed the other way
    Index first = 0, count = 0;
  };

  /// Room for the bodies of a table. Nothing below allocates for them once warm.
  void reserve(std::size_t bodies);
  /// Whether a body has a residual compliance at all. @pre it is in the table
  static bool yields(const BodyStates& states, Index body);

  /// Displacement of a material point by the forces remembered, world.
  Vec3 displacement(const BodyStates& states, Index body, const SurfacePoint& at) const;
  /// Adds a side's rows: they yield to each other and to all those that the body has already in this part of a step;
  /// with the body's first, what it has stored.
  void add_rows(const BodyStates& states, Index body, const Rows& side, ConstraintRows& rows);
  /// Takes the force of a side in the place of those of the last step, or part of one.
  void press(Index body, const DentLoad& load);

  /// After a step: bodies that nothing has pressed let go of what they had. @param asleep by body: keep theirs
  void finish(std::span<const char> asleep);
  void forget(Index body);
  void clear();

  std::span<const DentLoad> loads(Index body) const;
  /// J. @pre the body's model is the one that was pressed
  double energy(const BodyStates& states, Index body) const;

 private:
  struct Body {
    std::vector<DentLoad> loads;
    std::vector<Rows> rows;  // of the part of a step at hand
    bool gathers = false;    // rows are being added; the loads are those of the part before
    bool pressed = false;    // in this step
  };
  Body& at(Index body) { return bodies_[static_cast<std::size_t>(body)]; }
  const Body& at(Index body) const { return bodies_[static_cast<std::size_t>(body)]; }

  std::vector<Body> bodies_;
};

}  // namespace limber
