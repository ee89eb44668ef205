#include "limber/collision/manifold_finder.h"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "limber/core/error.h"
#include "manifold/manifold_finder_impl.h"
#include "tuning.h"

namespace limber {

using internal::FeatureContact;
using internal::FeatureSide;
using internal::KeptPoint;
using internal::ManifoldBody;
using internal::ManifoldWorker;
using internal::ManifoldWorkers;
using internal::PairFinder;
using internal::PairQuery;

void ManifoldFinderOptions::validate() const {
  for (const auto& [name, value] : {std::pair("recycle_distance", recycle_distance),
                                    std::pair("recycle_turn", recycle_turn), std::pair("flush", flush)})
    if (!(value >= 0.0 && value <= 0.1))
      throw InvalidArgument("ManifoldFinderOptions: " + std::string(name) + " is " + std::to_string(value) +
                            ", expected 0 to 0.1");
}

// -- Bodies in the broad phase ----------------------------------------------------------------------------------------

/// About all that a deforming body is expected to pass through until the next query, straight on.
Aabb ManifoldFinder::Impl::swept_box(Index body) const {
  const BodyState& s = state(body);
  const Aabb bounds = fields.bounds(body);
  Aabb box = internal::world_box(bounds, s.pose);
  box.include(internal::world_box(bounds.grown(fields.largest_swing(body)), s.end_pose));
  return box.grown(s.doubt + query.fall.norm());
}

/// About all that a body may pass through until the next query.
void ManifoldFinder::Impl::make_boxes(Jobs& jobs) {
  placing.boxes.resize(placing.bodies.size());
  jobs.parallel_for(placing.bodies.size(), internal::collision_tuning().finder.bodies_per_chunk,
                    [this](std::size_t begin, std::size_t end) {
                      const ManifoldWorkers::Lease worker(workers);
                      for (std::size_t i = begin; i < end; ++i) {
                        ManifoldBody& body = at(placing.bodies[i]);
                        const BodyState& s = state(placing.bodies[i]);
                        if (body.half_space() != nullptr) continue;
                        if (body.modal) {
                          internal::bind_state("ManifoldFinder", placing.bodies[i], (*worker).root, body.modal->surface,
                                               s.amplitudes);
                          body.bent += fields.has(placing.bodies[i]) ? fields.last_bend(placing.bodies[i])
                                                                     : body.largest_bend(s.amplitudes);
                          std::ranges::copy(s.amplitudes, body.amplitudes.begin());
                        }
                        Aabb& box = placing.boxes[i];
                        if (body.modal && fields.has(placing.bodies[i]) && std::isfinite(s.doubt)) {
                          box = swept_box(placing.bodies[i]);
                          continue;
                        }
                        box = body.modal ? internal::world_box((*worker).root.bounds(0), s.pose)
                                         : internal::world_box(body.rigid->geometry, s.pose);
                        box.include(Aabb{box.low + s.displacement, box.high + s.displacement});
                        box = box.grown(s.reach);
                      }
                    });
}

void ManifoldFinder::Impl::place() {
  BroadPhase& broad_phase = bodies.broad_phase();
  for (std::size_t i = 0; i < placing.bodies.size(); ++i) {
    const Index index = placing.bodies[i];
    ManifoldBody& body = at(index);
    const BodyState& s = state(index);
    if (const HalfSpace* shape = body.half_space()) {
      HalfSpace plane = internal::world_half_space(*shape, s.pose);
      plane.offset += s.reach + std::max(0.0, plane.normal.dot(s.displacement));
      broad_phase.set_half_space(index, plane);
    } else {
      broad_phase.set_box(index, placing.boxes[i]);
    }
    body.pose = s.pose, body.turn = to_matrix(s.pose.q);
    body.displacement = s.displacement, body.reach = s.reach;
    body.placed_asleep = s.asleep;
    broad_phase.set_asleep(index, s.asleep);
  }
}

void ManifoldFinder::Impl::find_near_pairs(Jobs& jobs) {
  bodies.list_to_place(query, placing.bodies);
  workers.start_query(
      jobs.concurrency(), [this] { return std::make_unique<ManifoldWorker>(options.narrow_phase); },
      [this](ManifoldWorker& worker) { worker.pairs.start_query(&fields); });
  fields.start_query(bodies.all(), query.states, placing.bodies, jobs);
  make_boxes(jobs);
  place();
  bodies.find_pairs(query, pairs, jobs);
}

// -- Contacts ---------------------------------------------------------------------------------------------------------

namespace {

/// Where a kept point of a body is now, in the body's frame.
Vec3 place_of(const FeatureSide& side, Index index, const ManifoldBody& body, const BodyState& state,
              PairFinder& finder) {
  if (!body.modal || side.triangle < 0) return side.point;
  if (finder.fields().has(index)) return finder.fields().place(index, side);
  DeformedSurface& surface = finder.surface(index, body, state);
  const Triangle& t = body.modal->surface->triangle(side.triangle);
  Vec3 p = Vec3::Zero();
  for (std::size_t c = 0; c < 3; ++c)
    if (side.weight[c] != 0.0) p += side.weight[c] * surface.vertex(t[c]);
  return p;
}

ContactSide side_of(const FeatureSide& kept, Index index, const ManifoldBody& body, double round, const Vec3& point_B) {
  ContactSide side{.body = index, .point_B = point_B, .radius = round};
  if (body.modal && kept.triangle >= 0) side.triangle = kept.triangle, side.weight = kept.weight;
  return side;
}

}  // namespace

/// The point of the body that the normal turns with is the foot of the other's point, as both slide along each other.
ManifoldFinder::Impl::Measured ManifoldFinder::Impl::measure(const KeptPoint& point, const BodyPair& pair,
                                                             ManifoldWorker& worker) const {
  const ManifoldBody &a = at(pair.a), &b = at(pair.b);
  Measured m;
  m.normal = (point.turns_with_b ? b.turn : a.turn) * point.normal;
  m.p_a = a.turn * place_of(point.a, pair.a, a, state(pair.a), worker.pairs) - point.round_a * m.normal;
  m.p_b = b.turn * place_of(point.b, pair.b, b, state(pair.b), worker.pairs) + (b.pose.p - a.pose.p) +
          point.round_b * m.normal;
  m.gap = m.normal.dot(m.p_a - m.p_b);
  if (point.ahead > 0.0) return m;
  if (point.turns_with_b && !b.modal) m.p_b = m.p_a - m.gap * m.normal;
  if (!point.turns_with_b && !a.modal) m.p_a = m.p_b + m.gap * m.normal;
  return m;
}

/// In the frame of a, but for the point of b, which is in its own.
FeatureContact ManifoldFinder::Impl::feature_contact(const Measured& m, const KeptPoint& point,
                                                     const BodyPair& pair) const {
  const ManifoldBody &a = at(pair.a), &b = at(pair.b);
  FeatureContact c{point.a, point.b, a.turn.transpose() * m.normal, m.gap};
  c.a.point = a.turn.transpose() * m.p_a;
  c.b.point = b.turn.transpose() * (m.p_b - (b.pose.p - a.pose.p));
  return c;
}

/// The contacts that the expected motion may close, with gaps as they are now.
std::size_t ManifoldFinder::Impl::write(std::size_t p, ManifoldWorker& worker, ContactPoint* to) const {
  const std::vector<KeptPoint>& points = graph.at(p).points;
  if (points.empty()) return 0;
  const BodyPair& pair = pairs[p];
  const ManifoldBody &a = at(pair.a), &b = at(pair.b);
  const bool by_fields = this->by_fields(pair);
  const PairQuery q =
      by_fields ? query_of(pair) : PairQuery{.a = a, .b = b, .state_a = state(pair.a), .state_b = state(pair.b)};
  const double near_enough = by_fields ? q.expected.near : query.margin + a.reach + b.reach;
  const Vec3 way = a.displacement - b.displacement, between = b.pose.p - a.pose.p, base = a.pose.p - query.origin;
  const std::span<const Touch> listed = listed_touches(p);
  std::size_t count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const KeptPoint& point = points[i];
    const Measured m = listed.empty() ? measure(point, pair, worker) : listed[i].at;
    const auto closing = [&] {
      return by_fields ? fields.closing(q, feature_contact(m, point, pair)) : -m.normal.dot(way);
    };
    if (point.ahead == 0.0 && m.gap > near_enough && m.gap > near_enough + closing()) continue;
    to[count++] = {side_of(point.a, pair.a, a, point.round_a, a.turn.transpose() * m.p_a),
                   side_of(point.b, pair.b, b, point.round_b, b.turn.transpose() * (m.p_b - between)),
                   m.normal,
                   base + 0.5 * (m.p_a + m.p_b),
                   m.gap,
                   point.id};
  }
  return count;
}

void ManifoldFinder::Impl::write_contacts(std::vector<ContactPoint>& contacts, Jobs& jobs) {
  written.first_of.resize(pairs.size() + 1);
  written.counts.resize(pairs.size());
  written.first_of[0] = 0;
  for (std::size_t p = 0; p < pairs.size(); ++p)
    written.first_of[p + 1] = written.first_of[p] + graph.at(p).points.size();
  contacts.resize(written.first_of.back());
  jobs.parallel_for(pairs.size(), internal::collision_tuning().finder.pairs_per_chunk,
                    [this, &contacts](std::size_t begin, std::size_t end) {
                      const ManifoldWorkers::Lease worker(workers);
                      for (std::size_t p = begin; p < end; ++p)
                        written.counts[p] = write(p, *worker, contacts.data() + written.first_of[p]);
                    });
  std::size_t count = 0;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    if (written.first_of[p] != count)
      std::copy_n(contacts.begin() + static_cast<std::ptrdiff_t>(written.first_of[p]), written.counts[p],
                  contacts.begin() + static_cast<std::ptrdiff_t>(count));
    count += written.counts[p];
  }
  contacts.resize(count);
}

// -- The finder -------------------------------------------------------------------------------------------------------

ManifoldFinder::ManifoldFinder(const ManifoldFinderOptions& options) : impl_(std::make_unique<Impl>(options)) {}
ManifoldFinder::~ManifoldFinder() = default;
ManifoldFinder::ManifoldFinder(ManifoldFinder&&) noexcept = default;
ManifoldFinder& ManifoldFinder::operator=(ManifoldFinder&&) noexcept = default;

void ManifoldFinder::add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Impl& m = *impl_;
  m.bodies.check_new(body, geometry);
  ManifoldBody fresh{.present = true};
  if (geometry.model) {
    fresh.modal = m.geometry.surfaces.get(geometry.model, geometry.skin);
  } else {
    fresh.rigid = m.geometry.shapes.get(
        geometry.shape.get(), [&] { return std::make_shared<const internal::ManifoldShape>(geometry.shape); });
  }
  const Aabb box = fresh.modal ? fresh.modal->surface->rest_bounds() : fresh.rigid->geometry.bounds();
  fresh.thickness = fresh.half_space() ? kInfinity : internal::thickness_of(box, fresh.rigid && !fresh.core());
  if (fresh.modal)
    fresh.inner = internal::inner_ball(*geometry.model);
  else if (fresh.core())
    fresh.inner = internal::inner_ball(*fresh.core());
  fresh.radius = fresh.half_space() ? kInfinity : internal::farthest_of(box);
  fresh.amplitudes.assign(static_cast<std::size_t>(fresh.modes()), 0.0);
  m.bodies.add(body, std::move(fresh), filter);
  m.fields.add_body(body, m.at(body));
}

void ManifoldFinder::remove_body(Index body) {
  impl_->bodies.remove(body);
  impl_->graph.forget(body);
  impl_->fields.remove_body(body);
}

void ManifoldFinder::set_filter(Index body, const CollisionFilter& filter) { impl_->bodies.set_filter(body, filter); }

void ManifoldFinder::exclude_pair(Index a, Index b, bool excluded) { impl_->bodies.exclude_pair(a, b, excluded); }

void ManifoldFinder::save_state(StateWriter& state) const {
  state(static_cast<std::uint64_t>(impl_->graph.living()));
  impl_->graph.for_each([&](const BodyPair& pair, const internal::LivePair& live) { state(pair.a, pair.b, live); });
  for (const internal::ManifoldBody& body : impl_->bodies.all())
    if (body.modal) state(body.bent), state.numbers(body.amplitudes);
}

void ManifoldFinder::restore_state(StateReader& state) {
  impl_->graph.forget_all();
  for (auto left = state.read<std::uint64_t>(); left > 0; --left) {
    const auto a = state.read<Index>();
    const auto b = state.read<Index>();
    state(impl_->graph.append({a, b}));
  }
  for (std::size_t i = 0; i < impl_->bodies.size(); ++i) {
    const auto index = static_cast<Index>(i);
    ManifoldBody& body = impl_->at(index);
    if (!body.modal) continue;
    body.bent = state.read<double>();
    state.numbers(body.amplitudes);
    if (impl_->fields.has(index)) impl_->fields.restore(index, body.amplitudes);
  }
  impl_->bodies.forget_places();
}

void ManifoldFinder::find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) {
  Impl& m = *impl_;
  internal::check_query("ManifoldFinder", query);
  m.query = query;
  StageClock clock(query.times);
  m.find_near_pairs(jobs);
  clock.lap(Stage::kBroadPhase, static_cast<std::int64_t>(m.pairs.size()));
  m.find_manifolds(jobs);
  m.level_seams();
  m.write_contacts(contacts, jobs);
  clock.lap(Stage::kNarrowPhase, static_cast<std::int64_t>(contacts.size()));
}

const ManifoldFinder::Counts& ManifoldFinder::counts() const { return impl_->told; }

}  // namespace limber
