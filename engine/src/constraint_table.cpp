#include "constraint_table.h"

#include <utility>

namespace limber::internal {

std::uint32_t ConstraintTable::add(Entry&& entry) {
  if (vacant_.empty()) {
    entries_.emplace_back();
    vacant_.reserve(entries_.size());  // so that remove() cannot fail
    vacant_.push_back(static_cast<std::uint32_t>(entries_.size() - 1));
  }
  const std::uint32_t place = vacant_.back();
  vacant_.pop_back();
  entry.generation = entries_[place].generation;
  entries_[place] = std::move(entry);
  return place;
}

void ConstraintTable::remove(std::uint32_t place) {
  Entry& entry = entries_[place];
  entry.handle.reset();
  entry.joint.reset();
  entry.user_data = 0;
  entry.strength = std::numeric_limits<double>::infinity();
  // A place whose generations are used up is never given again.
  if (++entry.generation != 0) vacant_.push_back(place);
}

ConstraintTable::Kind ConstraintTable::kind_of(const Entry& entry) {
  return entry.handle ? Kind::kHandle : entry.joint ? Kind::kJoint : Kind::kVacant;
}

void ConstraintTable::save_state(StateWriter& state) const {
  state(vacant_, static_cast<std::uint64_t>(entries_.size()));
  for (const Entry& entry : entries_) {
    state(entry.generation, kind_of(entry), entry.user_data, entry.strength);
    if (entry.handle) state(*entry.handle);
    if (entry.joint) state(*entry.joint);
  }
}

void ConstraintTable::restore_state(StateReader& state) {
  state(vacant_);
  entries_.resize(state.read<std::uint64_t>());
  for (Entry& entry : entries_) {
    const Kind known = kind_of(entry);
    entry.generation = state.read<std::uint32_t>();
    const Kind kind = state.read<Kind>();
    state(entry.user_data, entry.strength);
    if (kind != known) entry.handle.reset(), entry.joint.reset();
    if (kind == Kind::kHandle) {
      if (!entry.handle) entry.handle = std::make_unique<Handle>(MaterialFrame(JointFrame{}), Vec3::Zero());
      state(*entry.handle);
    }
    if (kind == Kind::kJoint) {
      const MaterialFrame any(JointFrame{});
      if (!entry.joint) entry.joint = std::make_unique<JointConstraint>(any, any, JointSpec{});
      entry.joint->restore_state(state);
    }
  }
}

}  // namespace limber::internal
