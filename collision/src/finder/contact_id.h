// What a contact is called, of the features of a pair's narrow phase.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "limber/collision/broad_phase.h"
#include "limber/core/mixed_bits.h"
#include "limber/dynamics/contact_source.h"

namespace limber::internal {

/// Different for each pair; for one pair as different as the features' own.
inline std::uint64_t contact_id(const BodyPair& pair, std::uint64_t features) {
  const auto key = static_cast<std::uint64_t>(pair.a) << 32 | static_cast<std::uint32_t>(pair.b);
  return mixed_bits(features ^ mixed_bits(key + 0x9e3779b97f4a7c15u));
}

/// Names the contacts from `first` on, all of one pair, which have the ids of their features, and sorts them by id.
inline void name_contacts(const BodyPair& pair, std::vector<ContactPoint>& contacts, std::size_t first) {
  const auto begin = contacts.begin() + static_cast<std::ptrdiff_t>(first);
  for (auto c = begin; c != contacts.end(); ++c) c->id = contact_id(pair, c->id);
  std::sort(begin, contacts.end(), [](const ContactPoint& a, const ContactPoint& b) { return a.id < b.id; });
}

}  // namespace limber::internal
