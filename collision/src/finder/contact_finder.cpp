#include "limber/collision/contact_finder.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "finder/contact_finder_impl.h"
#include "finder/contact_id.h"
#include "tuning.h"

namespace limber {

using internal::contact_id;
using internal::ContactRegions;
using internal::FoundBody;
using internal::ModalGeometry;
using internal::RegionSide;
using internal::Worker;
using internal::Workers;

namespace {

void check_length(const char* name, double length) {
  if (!(length >= 0.0 && std::isfinite(length)))
    throw InvalidArgument("ContactFinder: " + std::string(name) + " is " + std::to_string(length) +
                          ", expected a finite number of at least 0");
}

}  // namespace

void ContactFinderOptions::validate() const {
  clusters.validate();
  for (const auto& [name, value] : {std::pair("spacing", spacing), std::pair("region_spacing", region_spacing)})
    if (!(value > 0.0))
      throw InvalidArgument("ContactFinderOptions: " + std::string(name) + " is " + std::to_string(value) +
                            ", expected above 0");
}

void ContactFinder::Impl::set_finds_itself(Index body, bool finds) {
  const auto where = std::lower_bound(self_touching.begin(), self_touching.end(), body);
  const bool listed = where != self_touching.end() && *where == body;
  if (finds && !listed) self_touching.insert(where, body);
  if (!finds && listed) self_touching.erase(where);
  at(body).finds_itself = finds;
}

CollisionBody ContactFinder::Impl::collision_body(Index index, Worker& worker) const {
  const FoundBody& body = at(index);
  const BodyState& s = state(index);
  CollisionBody result{.index = index, .X_WB = s.pose};
  result.displacement = s.displacement, result.rotation = s.rotation;
  result.reach = s.reach + 0.5 * query.margin;
  if (body.modal) {
    result.surface = &worker.pool.get(index, body.modal->surface, s.amplitudes);
    result.volume = body.modal->volume ? &*body.modal->volume : nullptr;
  } else {
    result.geometry = body.rigid.get();
  }
  return result;
}

ContactSpacing ContactFinder::Impl::spacing(const BodyPair& pair, bool by_regions) const {
  const FoundBody &a = at(pair.a), &b = at(pair.b);
  if (a.modes() == 0 && b.modes() == 0) return {};
  if (by_regions) return {.share = options.region_spacing};
  return {.length = options.spacing * std::min(a.diagonal, b.diagonal)};
}

RegionSide ContactFinder::Impl::region_side(Index index) const {
  const FoundBody& body = at(index);
  if (!body.modal || !body.modal->surface->model()->data().residual_compliance) return {};
  return {body.modal->surface.get(), state(index).pose.q};
}

void ContactFinder::Impl::find_in_pair(const BodyPair& pair, Worker& worker, Found& into) const {
  std::vector<ContactPoint>& contacts = into.contacts;
  const std::size_t first = contacts.size();
  const CollisionBody a = collision_body(pair.a, worker);
  if (pair.a == pair.b) {
    worker.narrow.find_self_contacts(a, query.margin + 2.0 * state(pair.a).reach, query.origin, contacts);
  } else {
    const BodyState &s = state(pair.a), &t = state(pair.b);
    const double together = (s.displacement - t.displacement).norm() + s.reach + t.reach;
    worker.narrow.find_contacts(a, collision_body(pair.b, worker), query.margin + together, query.origin, contacts);
  }
  for (std::size_t c = first; c < contacts.size(); ++c) contacts[c].id = contact_id(pair, contacts[c].id);
  const std::array<RegionSide, 2> sides{region_side(pair.a), region_side(pair.b)};
  const ContactShares shares = internal::shares_for(sides, pair.a == pair.b);
  worker.clusters.reduce(contacts, first, spacing(pair, shares != ContactShares::kNone), kept.of(pair), shares);
  worker.regions.find(worker.clusters, shares, sides, into.regions);
  into.regions.counts.reserve(contacts.capacity());
  into.regions.counts.resize(contacts.size(), {0, 0});
}

void ContactFinder::Impl::find_in_pairs(Jobs& jobs) {
  const std::size_t per_chunk = internal::collision_tuning().finder.pairs_per_chunk;
  const std::size_t chunks = (pairs.size() + per_chunk - 1) / per_chunk;
  if (found.size() < chunks) found.resize(chunks);
  for (Found& part : found) part.contacts.clear(), part.regions.clear();
  jobs.parallel_for(chunks, 1, [this, per_chunk](std::size_t begin, std::size_t end) {
    const Workers::Lease worker(workers);
    for (std::size_t p = begin * per_chunk; p < std::min(end * per_chunk, pairs.size()); ++p)
      find_in_pair(pairs[p], *worker, found[p / per_chunk]);
  });
}

void ContactFinder::Impl::gather(std::vector<ContactPoint>& contacts) {
  contacts.clear();
  regions.clear();
  regions.counts.reserve(contacts.capacity());
  for (const Found& part : found) {
    contacts.insert(contacts.end(), part.contacts.begin(), part.contacts.end());
    regions.append(part.regions);
  }
  regions.give_to(contacts);
  kept.keep(contacts);
}

ContactFinder::ContactFinder(const ContactFinderOptions& options) : impl_(std::make_unique<Impl>(options)) {}
ContactFinder::~ContactFinder() = default;
ContactFinder::ContactFinder(ContactFinder&&) noexcept = default;
ContactFinder& ContactFinder::operator=(ContactFinder&&) noexcept = default;

void ContactFinder::add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) {
  Impl& m = *impl_;
  if ((geometry.model == nullptr) == (geometry.shape == nullptr))
    throw InvalidArgument("ContactFinder::add_body: body " + std::to_string(body) + " has " +
                          (geometry.model ? "both a model and a shape" : "neither a model nor a shape") +
                          ", expected one of them");
  if (body < 0 || m.contains(body))
    throw InvalidArgument("ContactFinder::add_body: index " + std::to_string(body) + (body < 0 ? "" : " holds a body") +
                          ", expected a free index of at least 0");
  FoundBody fresh{.present = true};
  if (geometry.model) {
    fresh.modal = m.geometries.get(geometry.model, geometry.skin);
    fresh.diagonal = 2.0 * fresh.modal->surface->rest_bounds().half_extents().norm();
  } else {
    fresh.rigid = m.geometries.get(geometry.shape);
    fresh.diagonal = 2.0 * fresh.rigid->bounds().half_extents().norm();
  }
  m.broad_phase.add(body, filter);
  if (static_cast<std::size_t>(body) >= m.bodies.size()) m.bodies.resize(static_cast<std::size_t>(body) + 1);
  m.at(body) = std::move(fresh);
  m.set_finds_itself(body, filter.self && m.at(body).modal);
}

void ContactFinder::remove_body(Index body) {
  impl_->present(body, "remove_body");
  impl_->set_finds_itself(body, false);
  impl_->broad_phase.remove(body);
  impl_->at(body) = {};
}

void ContactFinder::set_filter(Index body, const CollisionFilter& filter) {
  const FoundBody& known = impl_->present(body, "set_filter");
  impl_->broad_phase.set_filter(body, filter);
  impl_->set_finds_itself(body, filter.self && known.modal);
}

void ContactFinder::exclude_pair(Index a, Index b, bool excluded) {
  impl_->present(a, "exclude_pair");
  impl_->present(b, "exclude_pair");
  impl_->broad_phase.exclude_pair(a, b, excluded);
}

void ContactFinder::save_state(StateWriter& state) const { state(impl_->kept.pairs, impl_->kept.ids); }

void ContactFinder::restore_state(StateReader& state) {
  state(impl_->kept.pairs, impl_->kept.ids);
  for (FoundBody& body : impl_->bodies) body.placed_asleep = false;
}

void ContactFinder::find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) {
  Impl& m = *impl_;
  check_length("margin", query.margin);
  if (!query.origin.allFinite())
    throw InvalidArgument("ContactFinder: origin is not finite, expected finite coordinates");
  m.query = query;
  StageClock clock(query.times);
  m.find_near_pairs(jobs);
  m.merge_self_pairs();
  clock.lap(Stage::kBroadPhase, static_cast<std::int64_t>(m.pairs.size()));
  m.find_in_pairs(jobs);
  m.gather(contacts);
  clock.lap(Stage::kNarrowPhase, static_cast<std::int64_t>(contacts.size()));
}

}  // namespace limber
