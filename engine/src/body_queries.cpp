#include "body_queries.h"

#include <algorithm>

namespace limber::internal {

BodyQueries::Shown BodyQueries::shown_of(const BodyTable::Entry& e) const {
  if (!e.alive || e.sensor || !e.parts.empty() || e.filter.layers == 0) return {};
  Shown shown{.shape = e.shape.get(), .layers = e.filter.layers};
  const BodyTable::Entry& loaded = e.whole < 0 ? e : bodies_[e.whole];
  if (loaded.group >= 0 && bodies_.group(loaded).model().data().touchable) {
    shown.model = &bodies_.group(loaded).model();
    shown.skinned = bodies_.group(loaded).skinned(loaded.slot);
  }
  return shown;
}

void BodyQueries::show(Index entry) {
  const BodyTable::Entry& e = bodies_[entry];
  Shown& before = shown_[static_cast<std::size_t>(entry)];
  const Shown now = shown_of(e);
  if (now != before) {
    if (before.any()) index_.remove_body(entry);
    if (now.any()) {
      const auto model =
          now.model != nullptr ? bodies_.group(bodies_[bodies_.whole_of(entry)]).shared_model() : nullptr;
      index_.add_body(entry, {.model = e.shape ? nullptr : model, .shape = e.shape, .skin = now.skinned}, now.layers,
                      e.shape ? model : nullptr, e.whole < 0 ? RigidTransform{} : e.pose);
    }
    before = now;
  }
  if (!now.any()) return;
  if (e.group < 0)
    index_.set_state(entry, bodies_.standing_pose(e), {});
  else
    index_.set_state(entry, bodies_.group(e).frame(e.slot).pose(), bodies_.group(e).amplitudes(e.slot));
}

SpatialIndex& BodyQueries::index() {
  if (changed_) {
    shown_.resize(bodies_.size());
    for (std::size_t i = 0; i < bodies_.size(); ++i) show(static_cast<Index>(i));
    changed_ = false;
  }
  return index_;
}

void BodyQueries::find_overlaps(const Shape& shape, const RigidTransform& pose, const SpatialIndex::Filter& filter) {
  index().find_overlaps(shape, pose, found, filter);
  if (!bodies_.has_parts()) return;
  for (Index& body : found) body = bodies_.whole_of(body);
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
}

SpatialIndex::Filter BodyQueries::filter(const BodyFilter& filter) const {
  SpatialIndex::Filter asked{.mask = filter.mask};
  if (filter.accepts) asked.accepts = [this, &filter](Index body) { return filter.accepts(bodies_.id(body)); };
  return asked;
}

BodyHit BodyQueries::told(const SpatialIndex::Hit& hit) const {
  const BodyId body = bodies_.id(hit.body);
  return {{body, hit.at, hit.position, hit.normal, hit.fraction, hit.distance},
          bodies_[static_cast<Index>(body.index)].user_data};
}

}  // namespace limber::internal
