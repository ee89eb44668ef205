/// @file pair_contacts.h
/// The contacts of one pair of bodies as rows of an island (contact_constraint.h has the equations). Private to the
/// constraints module.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "contact_indentations.h"
#include "limber/constraints/contact_constraint.h"
#include "prepared_contact.h"

namespace limber {

class PairContacts final : public Constraint {
 public:
  void set(std::span<PreparedContact> contacts, const ContactOptions& options, ContactIndentations& indentations);
  std::span<const PreparedContact> contacts() const { return contacts_; }

  std::array<Index, 2> bodies() const override { return {contacts_.front().a.body, contacts_.front().b.body}; }
  void add_rows(const BodyStates& states, StepTime when, double step, ConstraintRows& rows) override;
  void gaps(const BodyStates& states, StepTime when, std::span<double> gaps) const override;
  bool is_contact() const override { return true; }
  void slid(std::span<const double> slip) override;
  void accept(const BodyStates&, std::span<const double> impulses) override;
  void add_force_derivative(const BodyStates& states, std::span<const double> impulses,
                            ForceDerivative& sum) const override;

 private:
  /// A step, or part of one, starts from here.
  void begin(const BodyStates& states);

  /// @param visit gets each contact and the number of its first row
  template <class Visit>
  void visit_rows(Visit&& visit) const {
    std::size_t row = 0;
    for (PreparedContact& contact : contacts_) {
      visit(contact, row);
      row += static_cast<std::size_t>(contact.rows());
    }
  }

  /// What the bodies yield at the step's start along a contact's axes, m.
  const Vec3& indentation_of(const PreparedContact& contact) const {
    return indentation_[static_cast<std::size_t>(&contact - contacts_.data())];
  }

  /// What each contact yields by itself in the coming step, m/N.
  double compliance(const BodyStates& states) const;

  /// Whether a part of one body is caught between two of the other: contacts that overlap and push either way. To come
  /// apart they would press against each other without bound.
  bool is_caught() const;

  /// Each contact by itself: what keeps loads that could be shared in many ways from wandering between contacts.
  void add_compliance(Index first, ConstraintRows& rows) const;

  /// @param first row of the first contact
  void add_flexibility(const BodyStates& states, Index first, ConstraintRows& rows);

  void add_contact(const BodyStates& states, StepTime when, const PreparedContact& contact, ConstraintRows& rows);

  std::span<PreparedContact> contacts_;
  const ContactOptions* options_ = nullptr;
  ContactIndentations* indentations_ = nullptr;
  std::array<bool, 2> yields_{};      // by side, whether its body has a residual compliance that is to be used
  std::array<Quaternion, 2> turn_{};  // of its body at the step's start, where it yields
  bool flexes_ = false, caught_ = false;
  double step_ = 0.0;
  std::vector<Vec3> indentation_;             // by contact
  double compliance_ = 0.0;                   // of each contact of bodies that flex, m/N
  std::array<std::vector<double>, 2> modal_;  // scratch by side, as what follows
};

}  // namespace limber
