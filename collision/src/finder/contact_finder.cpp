#include "limber/collision/contact_finder.h"

#include <memory>
#include <variant>
#include <vector>

#include "finder/body_register.h"
#include "finder/contact_id.h"
#include "finder/geometry_cache.h"
#include "finder/surface_pool.h"
#include "finder/worker_pool.h"
#include "finder/world_bounds.h"
#include "tuning.h"

namespace limber {

using internal::ModalGeometry;
using internal::world_box;
using internal::world_half_space;

namespace {

struct FoundBody {
  bool present = false;
  std::shared_ptr<const ModalGeometry> modal{};  ///< one of the two
  std::shared_ptr<const RigidGeometry> rigid{};
  bool placed_asleep = false;  ///< as its place in the broad phase was made

  Index modes() const { return modal ? modal->surface->modes() : 0; }
  bool is_half_space() const { return rigid && std::holds_alternative<HalfSpace>(rigid->shape()); }
};

/// What one thread works with.
struct Worker {
  explicit Worker(const NarrowPhaseOptions& options) : narrow(options) {}
  NarrowPhase narrow;
  internal::SurfacePool pool;
  DeformedSurface root;  ///< for boxes of whole bodies
};
using Workers = internal::WorkerPool<Worker>;

}  // namespace

struct ContactFinder::Impl {
  explicit Impl(const NarrowPhaseOptions& o) : options(o) {}

  NarrowPhaseOptions options;
  internal::GeometryCache geometries;
  internal::BodyRegister<FoundBody> bodies{"ContactFinder"};
  Workers workers;

  // Of the query under way.
  ContactQuery query;
  std::vector<Index> to_place;
  std::vector<Aabb> boxes;  ///< by entry of to_place
  std::vector<BodyPair> pairs;
  std::vector<std::vector<ContactPoint>> found;  ///< by chunk of pairs

  const BodyState& state(Index body) const { return query.states[static_cast<std::size_t>(body)]; }

  void find_near_pairs(Jobs& jobs);
  void make_boxes(Jobs& jobs);
  void make_box(std::size_t entry, Worker& worker);
  void place();
  void find_in_pairs(Jobs& jobs);
  void find_in_pair(const BodyPair& pair, Worker& worker, std::vector<ContactPoint>& contacts) const;
  CollisionBody collision_body(Index body, Worker& worker) const;
  void gather(std::vector<ContactPoint>& contacts);
};

// -- Which bodies are near each other ---------------------------------------------------------------------------------

void ContactFinder::Impl::make_boxes(Jobs& jobs) {
  boxes.resize(to_place.size());
  jobs.parallel_for(to_place.size(), internal::collision_tuning().finder.bodies_per_chunk,
                    [this](std::size_t begin, std::size_t end) {
                      const Workers::Lease worker(workers);
                      for (std::size_t i = begin; i < end; ++i) make_box(i, *worker);
                    });
}

/// Of a body to be placed, in the world, from its amplitudes alone.
void ContactFinder::Impl::make_box(std::size_t entry, Worker& worker) {
  const Index index = to_place[entry];
  const FoundBody& body = bodies[index];
  if (body.modal) {
    internal::bind_state("ContactFinder", index, worker.root, body.modal->surface, state(index).amplitudes);
    boxes[entry] = world_box(worker.root.bounds(0), state(index).pose).grown(state(index).way());
  } else if (!body.is_half_space()) {
    boxes[entry] = world_box(*body.rigid, state(index).pose).grown(state(index).way());
  }
}

void ContactFinder::Impl::place() {
  BroadPhase& broad_phase = bodies.broad_phase();
  for (std::size_t i = 0; i < to_place.size(); ++i) {
    const Index index = to_place[i];
    FoundBody& body = bodies[index];
    if (body.is_half_space()) {
      HalfSpace half_space = world_half_space(std::get<HalfSpace>(body.rigid->shape()), state(index).pose);
      half_space.offset += state(index).way();
      broad_phase.set_half_space(index, half_space);
    } else {
      broad_phase.set_box(index, boxes[i]);
    }
    body.placed_asleep = state(index).asleep;
    broad_phase.set_asleep(index, body.placed_asleep);
  }
}

void ContactFinder::Impl::find_near_pairs(Jobs& jobs) {
  bodies.list_to_place(query, to_place);
  workers.start_query(
      jobs.concurrency(), [this] { return std::make_unique<Worker>(options); },
      [](Worker& worker) { worker.pool.start_query(); });
  make_boxes(jobs);
  place();
  bodies.find_pairs(query, pairs, jobs);
}

// -- Pairs ------------------------------------------------------------------------------------------------------------

CollisionBody ContactFinder::Impl::collision_body(Index index, Worker& worker) const {
  const FoundBody& body = bodies[index];
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

void ContactFinder::Impl::find_in_pair(const BodyPair& pair, Worker& worker,
                                       std::vector<ContactPoint>& contacts) const {
  const std::size_t first = contacts.size();
  const CollisionBody a = collision_body(pair.a, worker);
  if (pair.a == pair.b) {
    worker.narrow.find_self_contacts(a, query.margin + 2.0 * state(pair.a).reach, query.origin, contacts);
  } else {
    const BodyState &s = state(pair.a), &t = state(pair.b);
    const double together = (s.displacement - t.displacement).norm() + s.reach + t.reach;
    worker.narrow.find_contacts(a, collision_body(pair.b, worker), query.margin + together, query.origin, contacts);
  }
  internal::name_contacts(pair, contacts, first);
}

void ContactFinder::Impl::find_in_pairs(Jobs& jobs) {
  const std::size_t per_chunk = internal::collision_tuning().finder.pairs_per_chunk;
  const std::size_t chunks = (pairs.size() + per_chunk - 1) / per_chunk;
  if (found.size() < chunks) found.resize(chunks);
  for (std::vector<ContactPoint>& part : found) part.clear();
  jobs.parallel_for(chunks, 1, [this, per_chunk](std::size_t begin, std::size_t end) {
    const Workers::Lease worker(workers);
    for (std::size_t p = begin * per_chunk; p < std::min(end * per_chunk, pairs.size()); ++p)
      find_in_pair(pairs[p], *worker, found[p / per_chunk]);
  });
}

void ContactFinder::Impl::gather(std::vector<ContactPoint>& contacts) {
  contacts.clear();
  for (const std::vector<ContactPoint>& part : found) contacts.insert(contacts.end(), part.begin(), part.end());
}

ContactFinder::ContactFinder(const NarrowPhaseOptions& options) : impl_(std::make_unique<Impl>(options)) {}
ContactFinder::~ContactFinder() = default;
ContactFinder::ContactFinder(ContactFinder&&) noexcept = default;
ContactFinder& ContactFinder::operator=(ContactFinder&&) noexcept = default;

void ContactFinder::add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) {
  Impl& m = *impl_;
  m.bodies.check_new(body, geometry);
  FoundBody fresh{.present = true};
  if (geometry.model)
    fresh.modal = m.geometries.get(geometry.model, geometry.skin);
  else
    fresh.rigid = m.geometries.get(geometry.shape);
  m.bodies.add(body, std::move(fresh), filter);
}

void ContactFinder::remove_body(Index body) { impl_->bodies.remove(body); }

void ContactFinder::set_filter(Index body, const CollisionFilter& filter) { impl_->bodies.set_filter(body, filter); }

void ContactFinder::exclude_pair(Index a, Index b, bool excluded) { impl_->bodies.exclude_pair(a, b, excluded); }

void ContactFinder::restore_state(StateReader&) { impl_->bodies.forget_places(); }

void ContactFinder::find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) {
  Impl& m = *impl_;
  internal::check_query("ContactFinder", query);
  m.query = query;
  StageClock clock(query.times);
  m.find_near_pairs(jobs);
  clock.lap(Stage::kBroadPhase, static_cast<std::int64_t>(m.pairs.size()));
  m.find_in_pairs(jobs);
  m.gather(contacts);
  clock.lap(Stage::kNarrowPhase, static_cast<std::int64_t>(contacts.size()));
}

}  // namespace limber
