#include "body_table.h"

#include <algorithm>
#include <string>

#include "limber/core/error.h"
#include "tuning.h"

namespace limber::internal {
namespace {

// Bodies advanced as one job: about 10 µs of work, so that handing it out costs little.
}  // namespace

Index BodyTable::group_of(std::shared_ptr<const ModalModel> model, double step) {
  const auto same = [&](const ModelGroup& g) { return g.bodies && &g.bodies->model() == model.get(); };
  auto found = std::find_if(groups_.begin(), groups_.end(), same);
  if (found == groups_.end()) {
    auto made = std::make_unique<BodyGroup>(std::move(model), step);
    found = std::find_if(groups_.begin(), groups_.end(), [](const ModelGroup& g) { return g.bodies == nullptr; });
    if (found == groups_.end()) found = groups_.insert(groups_.end(), ModelGroup{});
    const ModalModel& known = made->model();
    const bool skinned = known.data().skin.has_value();
    found->bodies = std::move(made);
    if (known.data().residual_compliance) found->indented = std::make_unique<IndentedSurface>(known);
    if (skinned) found->skin = std::make_unique<GroupSkin>(known);
    if (half_precision_ && !skinned) found->half = std::make_unique<const HalfBasis>(known.render().basis);
  }
  return static_cast<Index>(found - groups_.begin());
}

BodyId BodyTable::add(Entry&& made) {
  if (vacant_.empty()) {
    entries_.emplace_back();
    vacant_.reserve(entries_.size());  // so that remove() cannot fail
    vacant_.push_back(static_cast<std::uint32_t>(entries_.size() - 1));
  }
  const std::uint32_t index = vacant_.back();
  vacant_.pop_back();
  made.generation = entries_[index].generation;
  made.alive = true;
  entries_[index] = std::move(made);
  ++(entries_[index].whole < 0 ? alive_ : parts_);
  awake_.ranges.reserve(entries_.capacity());
  awake_.slots.reserve(entries_.capacity());
  return {index, entries_[index].generation};
}

void BodyTable::remove(BodyId id) {
  Entry& entry = entries_[id.index];
  if (entry.group >= 0) {
    group(entry).remove(entry.slot);
    if (group(entry).count() == 0) groups_[static_cast<std::size_t>(entry.group)] = {};  // lets go of the model
  }
  entry.alive = false;
  --(entry.whole < 0 ? alive_ : parts_);
  // An index whose generations are used up is never given again.
  if (++entry.generation != 0) vacant_.push_back(id.index);
}

const BodyTable::Entry& BodyTable::any_entry(BodyId id, const char* function) const {
  if (!contains(id))
    throw InvalidArgument(std::string("World::") + function + ": body " + std::to_string(id.index) + " (generation " +
                          std::to_string(id.generation) +
                          ") does not exist; it was removed or belongs to another world");
  return entries_[id.index];
}

const BodyTable::Entry& BodyTable::entry(BodyId id, const char* function) const {
  if (any_entry(id, function).group < 0)
    throw InvalidArgument(std::string("World::") + function + ": body " + std::to_string(id.index) +
                          " is a static shape; it has no motion");
  return entries_[id.index];
}

bool BodyTable::shows(const Entry& e) const {
  const bool meets = !e.sensor && (e.filter.self || (e.filter.layers != 0 && e.filter.mask != 0));
  return meets && e.parts.empty() && (e.shape || group(e).model().data().touchable);
}

bool BodyTable::any_indented() const {
  return std::ranges::any_of(groups_, [](const ModelGroup& group) { return group.indented != nullptr; });
}

void BodyTable::set_step_length(double step) {
  for (const ModelGroup& group : groups_)
    if (group.bodies) group.bodies->set_step_length(step);
}

void BodyTable::set_within_step(bool within) {
  for (const ModelGroup& group : groups_)
    if (group.bodies) group.bodies->set_within_step(within);
}

bool BodyTable::impulses_wait() const {
  return std::any_of(entries_.begin(), entries_.end(),
                     [&](const Entry& e) { return e.alive && e.group >= 0 && group(e).has_delayed_impulse(e.slot); });
}

void BodyTable::make_ranges(std::span<const Index> awake, std::uint64_t changes) {
  if (awake_.made_of == changes) return;
  awake_.made_of = changes;
  awake_.slots.clear();
  for (const Index body : awake) {
    const Entry& e = (*this)[body];
    awake_.slots.emplace_back(e.group, e.slot);
  }
  std::sort(awake_.slots.begin(), awake_.slots.end());
  std::vector<Range>& ranges = awake_.ranges;
  ranges.clear();
  for (const auto& [group, slot] : awake_.slots) {
    Range* last = ranges.empty() ? nullptr : &ranges.back();
    if (last != nullptr && last->group == group && last->end == slot &&
        slot - last->begin < kEngineTuning.bodies_per_job)
      ++last->end;
    else
      ranges.push_back({group, slot, slot + 1});
  }
}

void BodyTable::advance_free(std::span<const Index> awake, std::uint64_t changes, const Vec3& gravity, Jobs& jobs) {
  make_ranges(awake, changes);
  const auto advance = [&](const Range& range) {
    model_group(range.group).bodies->advance(range.begin, range.end, gravity);
  };
  // Two captured pointers fit in std::function's own storage, so this allocates nothing.
  jobs.parallel_for(awake_.ranges.size(), 1, [this, &advance](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) advance(awake_.ranges[r]);
  });
}

void BodyTable::save_state(StateWriter& state) const {
  state(static_cast<std::uint64_t>(entries_.size()));
  for (const Entry& e : entries_) {
    state(e.generation, e.placed, e.user_data, e.surface_velocity);
    if (e.alive && e.sensor) state(e.pose);
  }
  state(vacant_);
  for (const Entry& e : entries_)
    if (e.alive && e.group >= 0) group(e).save_state(e.slot, state);
}

void BodyTable::restore_state(StateReader& state) {
  entries_.resize(static_cast<std::size_t>(state.read<std::uint64_t>()));
  for (Entry& e : entries_) {
    state(e.generation, e.placed, e.user_data, e.surface_velocity);
    if (e.alive && e.sensor) state(e.pose);
  }
  state(vacant_);
  for (const Entry& e : entries_)
    if (e.alive && e.group >= 0) group(e).restore_state(e.slot, state);
}

}  // namespace limber::internal
