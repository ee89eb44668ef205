#include "limber/collision_fcl/fcl_contact_source.h"

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "fcl_body.h"
#include "fcl_touches.h"
#include "finder/contact_id.h"
#include "finder/geometry_cache.h"
#include "finder/world_bounds.h"
#include "limber/core/error.h"

namespace limber {

using internal::FclBody;
using internal::FclPlace;

namespace {

using Manager = fcl::DynamicAABBTreeCollisionManager<double>;
using Object = fcl::CollisionObject<double>;

[[noreturn]] void refuse(Index body, const std::string& seen, const std::string& expected) {
  throw InvalidArgument("FclContactSource: state of body " + std::to_string(body) + ": " + seen + ", expected " +
                        expected);
}

void check_length(const char* name, double length) {
  if (!(length >= 0.0 && std::isfinite(length)))
    throw InvalidArgument("FclContactSource: " + std::string(name) + " is " + std::to_string(length) +
                          ", expected a finite number of at least 0");
}

bool finite(std::span<const double> numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](double z) { return std::isfinite(z); });
}

}  // namespace

struct FclContactSource::Impl {
  struct Known {
    std::unique_ptr<FclBody> fcl{};
    CollisionFilter filter{};
    std::set<Index> apart{};     ///< bodies it never meets
    bool placed = false;         ///< the broad phase holds it
    bool placed_asleep = false;  ///< as it lies there
  };

  bool contains(Index body) const {
    return body >= 0 && static_cast<std::size_t>(body) < bodies.size() && at(body).fcl != nullptr;
  }
  Known& at(Index body) { return bodies[static_cast<std::size_t>(body)]; }
  const Known& at(Index body) const { return bodies[static_cast<std::size_t>(body)]; }
  Known& present(Index body, const char* function) {
    if (!contains(body))
      throw InvalidArgument("FclContactSource::" + std::string(function) + ": index " + std::to_string(body) +
                            " holds no body, expected one that was added");
    return at(body);
  }
  const BodyState& state(Index body) const { return query.states[static_cast<std::size_t>(body)]; }
  template <class Visit>
  void for_each(const Visit& visit) {
    for (Index i = 0; i < static_cast<Index>(bodies.size()); ++i)
      if (contains(i)) visit(i);
  }

  void check(Index body) const;
  void place_all();
  void set_box(Index body, const Aabb& box);
  bool may_meet(Index a, Index b) const;
  bool planes_meet(Index plane, Index body) const;
  void find_pairs();
  void add_pair(Index a, Index b);
  double reach(const BodyPair& pair) const;
  void find_in_pair(const BodyPair& pair, std::vector<ContactPoint>& contacts);

  internal::GeometryCache geometries;
  std::vector<Known> bodies;
  Manager manager;
  std::vector<Object*> moved;  ///< whose boxes changed
  std::set<Index> planes;
  internal::FclTouches touches;

  struct Query {
    std::span<const BodyState> states;
    double margin = 0.0;
    Vec3 origin = Vec3::Zero();
    std::vector<BodyPair> pairs;
  } query;  ///< under way
};

void FclContactSource::Impl::check(Index body) const {
  if (static_cast<std::size_t>(body) >= query.states.size())
    throw InvalidArgument("FclContactSource: " + std::to_string(query.states.size()) +
                          " states, expected one for body " + std::to_string(body) + " too");
  const BodyState& s = state(body);
  if (!s.pose.p.allFinite() || !(std::abs(s.pose.q.norm() - 1.0) <= 1e-6))
    refuse(body, "pose is not finite or its quaternion not of length 1", "a pose");
  if (s.amplitudes.size() != static_cast<std::size_t>(at(body).fcl->modes()))
    refuse(body, std::to_string(s.amplitudes.size()) + " amplitudes", std::to_string(at(body).fcl->modes()));
  if (!finite(s.amplitudes)) refuse(body, "amplitudes are not finite", "finite numbers");
  if (!s.displacement.allFinite()) refuse(body, "displacement is not finite", "finite numbers");
  if (!(s.reach >= 0.0 && std::isfinite(s.reach)))
    refuse(body, "reach is " + std::to_string(s.reach), "a finite number of at least 0");
}

void FclContactSource::Impl::set_box(Index body, const Aabb& box) {
  Known& known = at(body);
  known.fcl->broad().set_box(box);
  if (known.fcl->half_space() != nullptr) return;
  if (known.placed)
    moved.push_back(&known.fcl->broad());
  else
    manager.registerObject(&known.fcl->broad());
  known.placed = true;
}

void FclContactSource::Impl::place_all() {
  moved.clear();
  for_each([this](Index i) { check(i); });
  for_each([this](Index i) {
    Known& known = at(i);
    const BodyState& s = state(i);
    if (s.asleep && known.placed_asleep) return;
    known.fcl->place(s.pose, s.amplitudes);
    // Half the margin on either side of a gap.
    set_box(i, known.fcl->box().grown(s.way() + 0.5 * query.margin));
    known.placed_asleep = s.asleep;
  });
  manager.update(moved);
}

bool FclContactSource::Impl::may_meet(Index a, Index b) const {
  const Known &s = at(a), &t = at(b);
  const bool stay = s.placed_asleep && t.placed_asleep;
  return (s.filter.layers & t.filter.mask) != 0 && (t.filter.layers & s.filter.mask) != 0 && !stay &&
         !s.apart.contains(b);
}

/// By the box of the body.
bool FclContactSource::Impl::planes_meet(Index plane, Index body) const {
  const HalfSpace h = internal::world_half_space(*at(plane).fcl->half_space(), state(plane).pose);
  const auto& box = at(body).fcl->broad().getAABB();
  const Vec3 half = 0.5 * (box.max_ - box.min_);
  return h.normal.dot(box.center()) - h.offset - h.normal.cwiseAbs().dot(half) <= query.margin + state(plane).way();
}

void FclContactSource::Impl::add_pair(Index a, Index b) {
  if (may_meet(a, b)) query.pairs.push_back({std::min(a, b), std::max(a, b)});
}

void FclContactSource::Impl::find_pairs() {
  query.pairs.clear();
  const auto visit = [](Object* s, Object* t, void* self) {
    const Index a = static_cast<const FclPlace*>(s)->body(), b = static_cast<const FclPlace*>(t)->body();
    if (a != b) static_cast<Impl*>(self)->add_pair(a, b);
    return false;
  };
  manager.collide(this, visit);
  for (const Index plane : planes)
    for (Index i = 0; i < static_cast<Index>(bodies.size()); ++i)
      if (contains(i) && at(i).placed && may_meet(plane, i) && planes_meet(plane, i)) add_pair(plane, i);
  std::ranges::sort(query.pairs);
  query.pairs.erase(std::unique(query.pairs.begin(), query.pairs.end()), query.pairs.end());
}

double FclContactSource::Impl::reach(const BodyPair& pair) const {
  const BodyState &s = state(pair.a), &t = state(pair.b);
  return query.margin + (s.displacement - t.displacement).norm() + s.reach + t.reach;
}

void FclContactSource::Impl::find_in_pair(const BodyPair& pair, std::vector<ContactPoint>& contacts) {
  const std::size_t first = contacts.size();
  touches.find(*at(pair.a).fcl, *at(pair.b).fcl, reach(pair), query.origin, contacts);
  internal::name_contacts(pair, contacts, first);
}

FclContactSource::FclContactSource() : impl_(std::make_unique<Impl>()) {}
FclContactSource::~FclContactSource() = default;
FclContactSource::FclContactSource(FclContactSource&&) noexcept = default;
FclContactSource& FclContactSource::operator=(FclContactSource&&) noexcept = default;

void FclContactSource::add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) {
  Impl& m = *impl_;
  if ((geometry.model == nullptr) == (geometry.shape == nullptr))
    throw InvalidArgument("FclContactSource::add_body: body " + std::to_string(body) + " has " +
                          (geometry.model ? "both a model and a shape" : "neither a model nor a shape") +
                          ", expected one of them");
  if (body < 0 || m.contains(body))
    throw InvalidArgument("FclContactSource::add_body: index " + std::to_string(body) +
                          (body < 0 ? "" : " holds a body") + ", expected a free index of at least 0");
  Impl::Known fresh{.filter = filter};
  if (geometry.model)
    fresh.fcl = std::make_unique<FclBody>(body, m.geometries.get(geometry.model, geometry.skin));
  else
    fresh.fcl = std::make_unique<FclBody>(body, m.geometries.get(geometry.shape));
  if (static_cast<std::size_t>(body) >= m.bodies.size()) m.bodies.resize(static_cast<std::size_t>(body) + 1);
  if (fresh.fcl->half_space() != nullptr) m.planes.insert(body);
  m.at(body) = std::move(fresh);
}

void FclContactSource::remove_body(Index body) {
  Impl::Known& known = impl_->present(body, "remove_body");
  if (known.placed) impl_->manager.unregisterObject(&known.fcl->broad());
  for (const Index other : known.apart) impl_->at(other).apart.erase(body);
  impl_->planes.erase(body);
  known = {};
}

void FclContactSource::set_filter(Index body, const CollisionFilter& filter) {
  impl_->present(body, "set_filter").filter = filter;
}

void FclContactSource::exclude_pair(Index a, Index b, bool excluded) {
  Impl::Known &s = impl_->present(a, "exclude_pair"), &t = impl_->present(b, "exclude_pair");
  if (a == b)
    throw InvalidArgument("FclContactSource::exclude_pair: body " + std::to_string(a) +
                          " and itself, expected two bodies");
  if (excluded)
    s.apart.insert(b), t.apart.insert(a);
  else
    s.apart.erase(b), t.apart.erase(a);
}

void FclContactSource::find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs&) {
  Impl& m = *impl_;
  check_length("margin", query.margin);
  if (!query.origin.allFinite())
    throw InvalidArgument("FclContactSource: origin is not finite, expected finite coordinates");
  m.query.states = query.states;
  m.query.margin = query.margin, m.query.origin = query.origin;
  StageClock clock(query.times);
  m.place_all();
  m.find_pairs();
  clock.lap(Stage::kBroadPhase, static_cast<std::int64_t>(m.query.pairs.size()));
  contacts.clear();
  for (const BodyPair& pair : m.query.pairs) m.find_in_pair(pair, contacts);
  clock.lap(Stage::kNarrowPhase, static_cast<std::int64_t>(contacts.size()));
}

void FclContactSource::restore_state(StateReader&) {
  for (Impl::Known& known : impl_->bodies) known.placed_asleep = false;
}

}  // namespace limber
