#include "contact_registry.h"

#include <algorithm>

namespace limber::internal {

void ContactRegistry::set_source(ContactSource* source) {
  source_ = source;
  for (std::size_t i = 0; i < bodies_->size(); ++i) add_body(static_cast<Index>(i));
  for (std::size_t i = 0; i < bodies_->size(); ++i) keep_parts_apart(static_cast<Index>(i));
  for (const Pair& pair : pairs_) tell(pair, true);
}

void ContactRegistry::keep_parts_apart(Index body) {
  const BodyTable::Entry& e = (*bodies_)[body];
  if (source_ == nullptr || !e.alive) return;
  for (std::size_t i = 0; i < e.parts.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (bodies_->shows((*bodies_)[e.parts[i]])) source_->exclude_pair(e.parts[j], e.parts[i], true);
}

void ContactRegistry::add_body(Index body) {
  BodyTable::Entry& e = (*bodies_)[body];
  if (source_ == nullptr || !e.alive || !bodies_->shows(e)) return;
  BodyGeometry geometry;
  if (e.shape)
    geometry.shape = e.shape;
  else
    geometry.model = bodies_->group(e).shared_model(), geometry.skin = bodies_->group(e).skinned(e.slot);
  source_->add_body(body, geometry, e.filter);
  e.placed = false;
}

void ContactRegistry::remove_body(Index body) {
  std::erase_if(pairs_, [&](const Pair& pair) { return pair.a == body || pair.b == body; });
  if (source_ != nullptr && bodies_->shows((*bodies_)[body])) source_->remove_body(body);
}

void ContactRegistry::exclude_for_joint(Index a, Index b, std::uint32_t joint) { exclude({a, b, joint}); }

void ContactRegistry::include_after_joint(std::uint32_t joint) {
  const auto found = std::find_if(pairs_.begin(), pairs_.end(), [&](const Pair& pair) { return pair.joint == joint; });
  if (found != pairs_.end()) include(found);
}

bool ContactRegistry::set_excluded(Index a, Index b, bool excluded) {
  const Pair pair{a, b, Pair::kNoJoint};
  const auto found = std::ranges::find(pairs_, pair);
  if (excluded == (found != pairs_.end())) return false;
  if (excluded)
    exclude(pair);
  else
    include(found);
  return true;
}

bool ContactRegistry::is_excluded(Index a, Index b) const {
  return std::ranges::any_of(pairs_, [&](const Pair& pair) { return pair.a == a && pair.b == b; });
}

void ContactRegistry::exclude(const Pair& pair) {
  if (!is_excluded(pair.a, pair.b)) tell(pair, true);
  pairs_.push_back(pair);
}

void ContactRegistry::include(std::vector<Pair>::iterator found) {
  const Pair pair = *found;
  pairs_.erase(found);
  if (!is_excluded(pair.a, pair.b)) tell(pair, false);
}

void ContactRegistry::tell(const Pair& pair, bool excluded) {
  const auto shown = [&](Index body) { return bodies_->shows((*bodies_)[body]); };
  if (source_ == nullptr) return;
  bodies_->for_shown(pair.a, [&](Index a) {
    bodies_->for_shown(pair.b, [&](Index b) {
      if (shown(a) && shown(b)) source_->exclude_pair(std::min(a, b), std::max(a, b), excluded);
    });
  });
}

void ContactRegistry::restore_pairs(StateReader& state) {
  state(restored_);
  if (std::ranges::equal(pairs_, restored_)) return;
  for (const Pair& pair : pairs_) tell(pair, false);
  pairs_.assign(restored_.begin(), restored_.end());
  for (const Pair& pair : pairs_) tell(pair, true);
}

}  // namespace limber::internal
