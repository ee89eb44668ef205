// What contact forces press into bodies beyond their kept modes (residual_compliance.h), from step to step.
//
// A body remembers what contacts pressed its vertices v with in its last step, f_v, in its own frame, and where it
// bends by a modal skin turned back to the rest shape by how it is turned there:
//
//   u_v = Σ_w G_vw f_w,     energy ½ Σ_v f_v · u_v
//
// A contact gives shares w(v) of its force to the corners of its triangle and is moved by the mean Σ_v w(v) u_v of
// their displacements. This is a state of the body, not of its contacts: it turns with the body, and where contacts
// come and go or slide on to other triangles, each of them finds the indentation that is there.
//
// Forces are found in the next step: all contacts of a body yield to each other, whichever body they are with.
#pragma once

#include <span>
#include <tuple>
#include <vector>

#include "limber/constraints/contact_constraint.h"
#include "prepared_contact.h"

namespace limber {

/// Numbers vertices in the order in which they are asked for.
class VertexNumbers {
 public:
  void clear() { ++round_, count_ = 0; }
  /// A new one is count() as it was before.
  std::size_t operator()(Index vertex);
  std::size_t count() const { return count_; }

 private:
  struct Known {
    std::uint64_t round = 0;
    std::size_t number = 0;
  };
  std::vector<Known> known_;  // by vertex
  std::uint64_t round_ = 1;
  std::size_t count_ = 0;
};

class ContactIndentations {
 public:
  using Corners = std::span<const VertexShare>;

  /// A contact's side as rows of the island at hand: `rows` of them from `first` on, along the columns of `axes`.
  struct Rows {
    Corners corners{};
    Mat3 axes = Mat3::Identity();  // body frame, turned round for the body that is pressed the other way
    Index first = 0, count = 0;
  };

  /// Room for the bodies of a table. Nothing below allocates for them once warm.
  void reserve(std::size_t bodies);
  std::size_t bodies() const { return bodies_.size(); }
  /// Mean displacement of a point's corners by the forces remembered, axes of the rest shape.
  Vec3 displacement(const BodyStates& states, Index body, Corners corners);
  /// Adds a side's rows: they yield to each other and to all those that the body has already in this part of a step;
  /// with the body's first, what it has stored.
  void add_rows(const BodyStates& states, Index body, const Rows& side, ConstraintRows& rows);
  /// What is pressed from here on takes the place of the last step's.
  void renew(Index body) { at(body).gathers = true; }
  /// Takes the force of a side in the place of those of the last step, or part of one. @param force body frame, N
  void press(Index body, Corners corners, const Vec3& force);

  /// After a step: bodies that nothing has pressed let go of what they had. @param asleep by body: keep theirs
  /// @param touched bodies that had contacts in the step, in any order; others are left alone but for their loads
  void finish(std::span<const char> asleep, std::span<const Index> touched);
  /// After the state was restored.
  void list_loaded();
  void forget(Index body);
  void clear();

  std::span<const IndentationLoad> loads(Index body) const;
  /// J. @pre the body's model is the one that was pressed
  double energy(const BodyStates& states, Index body) const;

 private:
  friend struct StateFields;
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.bodies_);
  }

  struct Body {
    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.loads);
    }

    std::vector<IndentationLoad> loads;
    VertexNumbers of_loads;
    std::vector<Rows> rows;  // of the part of a step at hand, which may be done again, with others
    const ConstraintRows* made_in = nullptr;
    std::uint64_t making = 0;  // of those rows
    VertexNumbers of_rows;     // of all of these
    std::vector<Index> vertices;
    std::vector<Mat3> answer;  // of each of them to a force on one point
    bool gathers = false;      // rows are being added; the loads are those of the part before
    bool pressed = false;      // in this step
  };
  Body& at(Index body) { return bodies_[static_cast<std::size_t>(body)]; }
  const Body& at(Index body) const { return bodies_[static_cast<std::size_t>(body)]; }
  static void find_answers(const ResidualCompliance& compliance, Corners corners, Body& b);

  std::vector<Body> bodies_;
  std::vector<Index> loaded_;   // those with loads, ascending
  std::vector<Index> stirred_;  // scratch of finish()
};

}  // namespace limber
