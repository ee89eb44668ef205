#include "limber/collision/contact_finder.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <string>
#include <tuple>

#include "finder/geometry_cache.h"
#include "finder/surface_pool.h"
#include "finder/world_bounds.h"
#include "limber/collision/broad_phase.h"
#include "limber/collision/time_of_impact.h"
#include "limber/core/error.h"
#include "limber/dynamics/exact_motion.h"
#include "tuning.h"

namespace limber {

using internal::GeometryCache;
using internal::ModalGeometry;
using internal::SurfacePool;
using internal::world_box;
using internal::world_half_space;

namespace {

struct FoundBody {
  bool present = false;
  std::shared_ptr<const ModalGeometry> modal{};  ///< one of the two
  std::shared_ptr<const RigidGeometry> rigid{};
  bool finds_itself = false;
  double diagonal = 0.0;       ///< of its box at rest, m; infinite for a half-space
  bool placed_asleep = false;  ///< as its place in the broad phase was made
  double placed_reach = 0.0;

  Index modes() const { return modal ? modal->surface->modes() : 0; }
  bool is_half_space() const { return rigid && std::holds_alternative<HalfSpace>(rigid->shape()); }
};

/// What one thread works with. Which of them does a task changes nothing but the time.
struct Worker {
  explicit Worker(const ContactFinderOptions& options) : narrow(options.narrow_phase), clusters(options.clusters) {}
  NarrowPhase narrow;
  ContactClusters clusters;
  SurfacePool pool;
  DeformedSurface root;  ///< for boxes of whole bodies
  TimeOfImpact time_of_impact;
  std::vector<double> amplitudes;
};

/// Lends workers to threads.
class Workers {
 public:
  void start_query(const ContactFinderOptions& options, int concurrency) {
    while (all_.size() < static_cast<std::size_t>(concurrency)) all_.push_back(std::make_unique<Worker>(options));
    free_.clear();
    for (const auto& worker : all_) worker->pool.start_query(), free_.push_back(worker.get());
  }
  class Lease {
   public:
    explicit Lease(Workers& from) : from_(from), worker_(from.take()) {}
    ~Lease() {
      const std::lock_guard lock(from_.mutex_);
      from_.free_.push_back(worker_);
    }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    Worker& operator*() const { return *worker_; }

   private:
    Workers& from_;
    Worker* worker_;
  };

 private:
  Worker* take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) throw ComputationError("ContactFinder: Jobs runs more loop bodies at once than concurrency()");
    Worker* worker = free_.back();
    free_.pop_back();
    return worker;
  }
  std::mutex mutex_;
  std::vector<std::unique_ptr<Worker>> all_;
  std::vector<Worker*> free_;
};

/// What was kept of one pair: a range of ids.
struct PairIds {
  BodyPair pair;
  std::size_t first = 0, count = 0;
};

/// A bijection that spreads every bit over all (the finaliser of Steele, Lea and Flood's SplitMix, 2014).
std::uint64_t mixed(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

/// Different for each pair; for one pair as different as the features' own.
std::uint64_t contact_id(const BodyPair& pair, std::uint64_t features) {
  const auto key = static_cast<std::uint64_t>(pair.a) << 32 | static_cast<std::uint32_t>(pair.b);
  return mixed(features ^ mixed(key + 0x9e3779b97f4a7c15u));
}

[[noreturn]] void refuse(Index body, const std::string& seen, const std::string& expected) {
  throw InvalidArgument("ContactFinder: state of body " + std::to_string(body) + ": " + seen + ", expected " +
                        expected);
}

/// All but the amplitudes' size, which binding them shows: see bind_state().
void check_state(Index index, const FoundBody& body, const BodyState& state) {
  const double unit = internal::collision_tuning().finder.unit_quaternion;
  const Quaternion& q = state.pose.q;
  if (!state.pose.p.allFinite()) refuse(index, "pose.p is not finite", "finite coordinates");
  if (!(std::abs(q.norm() - 1.0) <= unit)) refuse(index, "pose.q has length " + std::to_string(q.norm()), "1");
  if (!state.displacement.allFinite() || !state.rotation.allFinite())
    refuse(index, "displacement or rotation is not finite", "finite numbers");
  if (!(state.reach >= 0.0 && std::isfinite(state.reach)))
    refuse(index, "reach is " + std::to_string(state.reach), "a finite number of at least 0");
  if (!(state.look_ahead >= 0.0))
    refuse(index, "look_ahead is " + std::to_string(state.look_ahead), "a number of at least 0");
  if (state.amplitudes.size() != static_cast<std::size_t>(body.modes()))
    refuse(index, std::to_string(state.amplitudes.size()) + " amplitudes", std::to_string(body.modes()));
}

/// Binds amplitudes that nobody has looked at yet; what is wrong with them is told with the body's name.
void bind_state(DeformedSurface& surface, Index index, const FoundBody& body, std::span<const double> z) {
  try {
    surface.bind(body.modal->surface, z, BoundsChoice::kAmplitudes);
  } catch (const InvalidArgument& e) {
    for (std::size_t i = 0; i < z.size(); ++i)
      if (!std::isfinite(z[i])) refuse(index, "amplitudes[" + std::to_string(i) + "] is not finite", "finite numbers");
    refuse(index, e.what(), "smaller amplitudes");
  }
}

/// How far contacts are looked for, where features decide.
double reach_of_features(const BodyState& state) { return std::min(state.reach, state.look_ahead); }

void check_length(const char* name, double length) {
  if (!(length >= 0.0 && std::isfinite(length)))
    throw InvalidArgument("ContactFinder: " + std::string(name) + " is " + std::to_string(length) +
                          ", expected a finite number of at least 0");
}

}  // namespace

void ContactFinderOptions::validate() const {
  clusters.validate();
  if (!(spacing > 0.0))
    throw InvalidArgument("ContactFinderOptions: spacing is " + std::to_string(spacing) + ", expected above 0");
}

struct ContactFinder::Impl {
  explicit Impl(const ContactFinderOptions& o) : options(o) { options.validate(); }

  ContactFinderOptions options;
  GeometryCache geometries;
  std::vector<FoundBody> bodies;
  std::vector<Index> self_touching;  ///< bodies that find themselves, ascending
  BroadPhase broad_phase;
  Workers workers;

  // Of the query under way.
  std::span<const BodyState> states;
  std::span<const ExactMotion* const> motions;  ///< none where contacts are asked for
  std::span<const Index> some;                  ///< the bodies that are asked for; none: all
  double farthest_beyond = 0.0;                 ///< by how much a reach exceeds that of features
  double step = 0.0, margin = 0.0;
  Vec3 origin = Vec3::Zero();
  std::vector<Index> to_place;
  std::vector<Aabb> boxes;  ///< by entry of to_place
  std::vector<BodyPair> pairs, merged_pairs;
  std::vector<Index> near;                       ///< one body
  std::vector<std::vector<ContactPoint>> found;  ///< by chunk of pairs
  std::vector<ImpactTime> times;                 ///< by pair

  // Of the last query, ascending.
  std::vector<PairIds> kept_pairs, last_pairs;
  std::vector<std::uint64_t> kept_ids, last_ids;

  FoundBody& present(Index body, const char* function) {
    if (!contains(body))
      throw InvalidArgument("ContactFinder::" + std::string(function) + ": index " + std::to_string(body) +
                            " holds no body, expected one that was added");
    return at(body);
  }
  bool contains(Index body) const {
    return body >= 0 && static_cast<std::size_t>(body) < bodies.size() && at(body).present;
  }
  FoundBody& at(Index body) { return bodies[static_cast<std::size_t>(body)]; }
  const FoundBody& at(Index body) const { return bodies[static_cast<std::size_t>(body)]; }
  const BodyState& state(Index body) const { return states[static_cast<std::size_t>(body)]; }
  const ExactMotion* motion(Index body) const {
    return static_cast<std::size_t>(body) < motions.size() ? motions[static_cast<std::size_t>(body)] : nullptr;
  }

  void set_finds_itself(Index body, bool finds);
  bool stays_in_place(Index body, const BodyState& state) const;
  void check_and_list();
  void check_motion(Index index) const;
  void check_place(Index index);
  void find_near_pairs(Jobs& jobs);
  void find_pairs_of_some();
  void make_boxes(Jobs& jobs);
  void make_box(std::size_t entry, Worker& worker);
  Aabb swept_box(Index index, Worker& worker) const;
  void place();
  void merge_self_pairs();
  void drop_pairs(std::span<const std::pair<Index, Index>> except);
  void check_sleepers_in_pairs();
  void find_in_pairs(Jobs& jobs);
  void find_in_pair(const BodyPair& pair, Worker& worker, std::vector<ContactPoint>& contacts) const;
  CollisionBody collision_body(Index body, Worker& worker) const;
  double spacing(const BodyPair& pair) const;
  std::span<const std::uint64_t> kept_last_time(const BodyPair& pair) const;
  void gather(std::vector<ContactPoint>& contacts);
  void keep_ids(const BodyPair& pair, std::span<const std::uint64_t> ids);
  bool asked_for(Index body) const { return some.empty() || std::binary_search(some.begin(), some.end(), body); }
  void find_impacts_in_pairs(Jobs& jobs);
  ImpactTime find_impact(const BodyPair& pair, Worker& worker) const;
  MovingBody moving_body(Index index) const;
  void gather(std::vector<Impact>& impacts) const;
};

void ContactFinder::Impl::set_finds_itself(Index body, bool finds) {
  const auto where = std::lower_bound(self_touching.begin(), self_touching.end(), body);
  const bool listed = where != self_touching.end() && *where == body;
  if (finds && !listed) self_touching.insert(where, body);
  if (!finds && listed) self_touching.erase(where);
  at(body).finds_itself = finds;
}

bool ContactFinder::Impl::stays_in_place(Index body, const BodyState& s) const {
  return s.asleep && at(body).placed_asleep && at(body).placed_reach == s.reach;
}

/// Refuses states before anything is changed, and lists the bodies whose place in the broad phase is to be made anew.
void ContactFinder::Impl::check_and_list() {
  to_place.clear();
  for (std::size_t i = 0; some.empty() && i < bodies.size(); ++i)
    if (bodies[i].present) check_place(static_cast<Index>(i));
  for (const Index index : some)
    if (contains(index)) check_place(index);
}

void ContactFinder::Impl::check_place(Index index) {
  const auto i = static_cast<std::size_t>(index);
  if (motion(index) != nullptr) {
    check_motion(index);
  } else {
    if (i >= states.size())
      throw InvalidArgument("ContactFinder: " + std::to_string(states.size()) + " states, expected one for body " +
                            std::to_string(i) + " too");
    if (stays_in_place(index, states[i])) return;
    check_state(index, bodies[i], states[i]);
  }
  to_place.push_back(index);
}

void ContactFinder::Impl::check_motion(Index index) const {
  const ExactMotion& m = *motion(index);
  if (m.modes() != at(index).modes())
    refuse(index, "a motion of " + std::to_string(m.modes()) + " modes", std::to_string(at(index).modes()));
  if (m.step() < step)
    refuse(index, "a motion over " + std::to_string(m.step()) + " s", "the step, " + std::to_string(step) + " s");
}

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
  const FoundBody& body = at(index);
  if (motion(index) != nullptr) {
    boxes[entry] = swept_box(index, worker);
  } else if (body.modal) {
    bind_state(worker.root, index, body, state(index).amplitudes);
    boxes[entry] = world_box(worker.root.bounds(0), state(index).pose).grown(reach_of_features(state(index)));
  } else if (!body.is_half_space()) {
    boxes[entry] = world_box(*body.rigid, state(index).pose).grown(reach_of_features(state(index)));
  }
}

/// Half-spaces that move may come anywhere.
Aabb ContactFinder::Impl::swept_box(Index index, Worker& worker) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const FoundBody& body = at(index);
  if (body.is_half_space()) return {Vec3::Constant(-kInfinity), Vec3::Constant(kInfinity)};
  if (!body.modal) return swept(body.rigid->bounds(), {}, *motion(index));
  RigidTransform pose;
  worker.amplitudes.resize(static_cast<std::size_t>(body.modes()));
  motion(index)->at(0.0, pose, worker.amplitudes);
  bind_state(worker.root, index, body, worker.amplitudes);
  return swept(worker.root.bounds(0), body.modal->surface->model()->collision_extent().shape, *motion(index));
}

void ContactFinder::Impl::place() {
  farthest_beyond = 0.0;
  for (const Index index : to_place)
    if (motion(index) == nullptr)
      farthest_beyond = std::max(farthest_beyond, state(index).reach - reach_of_features(state(index)));
  for (std::size_t i = 0; i < to_place.size(); ++i) {
    const Index index = to_place[i];
    FoundBody& body = at(index);
    const bool moves = motion(index) != nullptr;
    if (body.is_half_space() && !moves) {
      HalfSpace half_space = world_half_space(std::get<HalfSpace>(body.rigid->shape()), state(index).pose);
      half_space.offset += state(index).reach;
      broad_phase.set_half_space(index, half_space);
    } else {
      broad_phase.set_box(index, boxes[i]);
    }
    body.placed_asleep = !moves && state(index).asleep;
    body.placed_reach = moves ? 0.0 : state(index).reach;
    broad_phase.set_asleep(index, body.placed_asleep);
  }
}

void ContactFinder::Impl::find_near_pairs(Jobs& jobs) {
  check_and_list();
  workers.start_query(options, jobs.concurrency());
  make_boxes(jobs);
  place();
  if (some.empty())
    broad_phase.find_pairs(margin, margin + farthest_beyond, pairs, jobs);
  else
    find_pairs_of_some();
  check_sleepers_in_pairs();
}

void ContactFinder::Impl::find_pairs_of_some() {
  pairs.clear();
  for (std::size_t i = 0; i < to_place.size(); ++i) {
    const Index index = to_place[i];
    near.clear();
    broad_phase.find_near(index, margin, margin + farthest_beyond, near);
    for (const Index other : near)
      if (index < other || !asked_for(other)) pairs.push_back({std::min(index, other), std::max(index, other)});
  }
  std::sort(pairs.begin(), pairs.end());
}

/// Bodies that find themselves and are awake, among the pairs in their order.
void ContactFinder::Impl::merge_self_pairs() {
  if (self_touching.empty()) return;
  merged_pairs.clear();
  auto next = pairs.begin();
  for (const Index body : self_touching) {
    if (state(body).asleep || !asked_for(body)) continue;
    const BodyPair self{body, body};
    for (; next != pairs.end() && *next < self; ++next) merged_pairs.push_back(*next);
    merged_pairs.push_back(self);
  }
  merged_pairs.insert(merged_pairs.end(), next, pairs.end());
  pairs.swap(merged_pairs);
}

/// Their states were last looked at when they fell asleep.
void ContactFinder::Impl::check_sleepers_in_pairs() {
  const Workers::Lease worker(workers);
  for (const auto& [a, b] : pairs)
    for (const Index index : {a, b}) {
      if (motion(index) != nullptr || !state(index).asleep) continue;
      check_state(index, at(index), state(index));
      if (at(index).modal) bind_state((*worker).root, index, at(index), state(index).amplitudes);
    }
}

CollisionBody ContactFinder::Impl::collision_body(Index index, Worker& worker) const {
  const FoundBody& body = at(index);
  const BodyState& s = state(index);
  CollisionBody result{.index = index, .X_WB = s.pose};
  if (!s.asleep) result.displacement = s.displacement, result.rotation = s.rotation;
  if (body.modal) {
    result.surface = &worker.pool.get(index, body.modal->surface, s.amplitudes, options.bounds);
    result.volume = body.modal->volume ? &*body.modal->volume : nullptr;
  } else {
    result.geometry = body.rigid.get();
  }
  return result;
}

double ContactFinder::Impl::spacing(const BodyPair& pair) const {
  const FoundBody &a = at(pair.a), &b = at(pair.b);
  if (a.modes() == 0 && b.modes() == 0) return std::numeric_limits<double>::infinity();
  return options.spacing * std::min(a.diagonal, b.diagonal);
}

std::span<const std::uint64_t> ContactFinder::Impl::kept_last_time(const BodyPair& pair) const {
  const auto known = std::lower_bound(kept_pairs.begin(), kept_pairs.end(), pair,
                                      [](const PairIds& entry, const BodyPair& p) { return entry.pair < p; });
  if (known == kept_pairs.end() || known->pair != pair) return {};
  return std::span(kept_ids).subspan(known->first, known->count);
}

void ContactFinder::Impl::find_in_pair(const BodyPair& pair, Worker& worker,
                                       std::vector<ContactPoint>& contacts) const {
  const std::size_t first = contacts.size();
  const CollisionBody a = collision_body(pair.a, worker);
  if (pair.a == pair.b) {
    worker.narrow.find_self_contacts(a, margin, origin, contacts);
  } else {
    const bool plane = at(pair.a).is_half_space() || at(pair.b).is_half_space();
    const BodyState &s = state(pair.a), &t = state(pair.b);
    const double reaches = plane ? s.reach + t.reach : reach_of_features(s) + reach_of_features(t);
    worker.narrow.find_contacts(a, collision_body(pair.b, worker), margin + reaches, origin, contacts);
  }
  for (std::size_t c = first; c < contacts.size(); ++c) contacts[c].id = contact_id(pair, contacts[c].id);
  worker.clusters.reduce(contacts, first, spacing(pair), kept_last_time(pair));
}

void ContactFinder::Impl::find_in_pairs(Jobs& jobs) {
  const std::size_t per_chunk = internal::collision_tuning().finder.pairs_per_chunk;
  const std::size_t chunks = (pairs.size() + per_chunk - 1) / per_chunk;
  if (found.size() < chunks) found.resize(chunks);
  for (auto& contacts : found) contacts.clear();
  jobs.parallel_for(chunks, 1, [this, per_chunk](std::size_t begin, std::size_t end) {
    const Workers::Lease worker(workers);
    for (std::size_t p = begin * per_chunk; p < std::min(end * per_chunk, pairs.size()); ++p)
      find_in_pair(pairs[p], *worker, found[p / per_chunk]);
  });
}

void ContactFinder::Impl::keep_ids(const BodyPair& pair, std::span<const std::uint64_t> ids) {
  if (kept_pairs.empty() || kept_pairs.back().pair != pair) kept_pairs.push_back({pair, kept_ids.size(), 0});
  kept_pairs.back().count += ids.size();
  kept_ids.insert(kept_ids.end(), ids.begin(), ids.end());
}

/// What was kept of pairs that nobody asks for stays among the rest, in their order.
void ContactFinder::Impl::gather(std::vector<ContactPoint>& contacts) {
  contacts.clear();
  for (const auto& some_contacts : found) contacts.insert(contacts.end(), some_contacts.begin(), some_contacts.end());
  kept_pairs.swap(last_pairs);
  kept_ids.swap(last_ids);
  kept_pairs.clear();
  kept_ids.clear();
  auto last = last_pairs.begin();
  const auto keep_others = [&](const BodyPair* before) {
    for (; !some.empty() && last != last_pairs.end() && (before == nullptr || last->pair < *before); ++last)
      if (!asked_for(last->pair.a) && !asked_for(last->pair.b))
        keep_ids(last->pair, std::span(last_ids).subspan(last->first, last->count));
  };
  for (const ContactPoint& c : contacts) {
    const BodyPair pair{c.a.body, c.b.body};
    keep_others(&pair);
    keep_ids(pair, {&c.id, 1});
  }
  keep_others(nullptr);
}

/// What stands still, and what nobody asks for.
void ContactFinder::Impl::drop_pairs(std::span<const std::pair<Index, Index>> except) {
  std::erase_if(pairs, [&](const BodyPair& pair) {
    return (motion(pair.a) == nullptr && motion(pair.b) == nullptr) ||
           std::ranges::binary_search(except, std::pair(pair.a, pair.b));
  });
}

MovingBody ContactFinder::Impl::moving_body(Index index) const {
  const FoundBody& body = at(index);
  MovingBody result{.geometry = body.rigid.get(), .motion = motion(index)};
  if (body.modal) result.surface = body.modal->surface;
  if (result.motion == nullptr) result.pose = state(index).pose, result.amplitudes = state(index).amplitudes;
  return result;
}

ImpactTime ContactFinder::Impl::find_impact(const BodyPair& pair, Worker& worker) const {
  return worker.time_of_impact.find(moving_body(pair.a), moving_body(pair.b), step, margin);
}

void ContactFinder::Impl::find_impacts_in_pairs(Jobs& jobs) {
  times.resize(pairs.size());
  jobs.parallel_for(pairs.size(), internal::collision_tuning().finder.pairs_per_chunk,
                    [this](std::size_t begin, std::size_t end) {
                      const Workers::Lease worker(workers);
                      for (std::size_t p = begin; p < end; ++p) times[p] = find_impact(pairs[p], *worker);
                    });
}

void ContactFinder::Impl::gather(std::vector<Impact>& impacts) const {
  using Status = ImpactTime::Status;
  impacts.clear();
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const auto& [status, time, advancements] = times[p];
    if (status == Status::kImpact || status == Status::kResting)
      impacts.push_back({.a = pairs[p].a, .b = pairs[p].b, .time = time, .resting = status == Status::kResting});
  }
  std::sort(impacts.begin(), impacts.end(),
            [](const Impact& i, const Impact& j) { return std::tie(i.time, i.a, i.b) < std::tie(j.time, j.a, j.b); });
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
    fresh.modal = m.geometries.get(geometry.model);
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

void ContactFinder::find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) {
  Impl& m = *impl_;
  check_length("margin", query.margin);
  if (!query.origin.allFinite())
    throw InvalidArgument("ContactFinder: origin is not finite, expected finite coordinates");
  m.states = query.states;
  m.motions = {};
  m.some = query.bodies;
  m.margin = query.margin;
  m.origin = query.origin;
  m.find_near_pairs(jobs);
  m.merge_self_pairs();
  m.find_in_pairs(jobs);
  m.gather(contacts);
}

void ContactFinder::find_impacts(const ImpactQuery& query, std::vector<Impact>& impacts, Jobs& jobs) {
  Impl& m = *impl_;
  check_length("step", query.step);
  check_length("margin", query.margin);
  m.states = query.states;
  m.motions = query.motions;
  m.some = query.bodies;
  m.step = query.step;
  m.margin = query.margin;
  m.find_near_pairs(jobs);
  m.drop_pairs(query.except);
  m.find_impacts_in_pairs(jobs);
  m.gather(impacts);
}

}  // namespace limber
