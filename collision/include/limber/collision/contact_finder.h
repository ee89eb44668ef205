/// @file limber/collision/contact_finder.h
/// Finds where bodies touch: the ContactSource that limber comes with. Usable without a world:
///
///   ContactFinder finder;
///   finder.add_body(0, {.model = bunny}, {});
///   finder.add_body(1, {.shape = std::make_shared<Shape>(HalfSpace{})}, {});
///   const std::array states{BodyState{.pose = X_WB, .amplitudes = z}, BodyState{}};
///   std::vector<ContactPoint> contacts;
///   finder.find_contacts({.states = states, .margin = 1e-3}, contacts, serial_jobs());
#pragma once

#include <memory>

#include "limber/dynamics/contact_source.h"

namespace limber {

class ContactFinder final : public ContactSource {
 public:
  ContactFinder();
  ~ContactFinder() override;
  ContactFinder(ContactFinder&&) noexcept;
  ContactFinder& operator=(ContactFinder&&) noexcept;

  void add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) override;
  void remove_body(Index body) override;
  void set_filter(Index body, const CollisionFilter& filter) override;
  void exclude_pair(Index a, Index b, bool excluded) override;
  void find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) override;
  void find_impacts(std::span<const BodyState> states, std::span<const ExactMotion* const> motions, double step,
                    double margin, std::vector<Impact>& impacts, Jobs& jobs) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
