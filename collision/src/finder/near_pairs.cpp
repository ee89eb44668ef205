#include <algorithm>
#include <cmath>

#include "finder/contact_finder_impl.h"
#include "finder/world_bounds.h"
#include "tuning.h"

namespace limber {

using internal::FoundBody;
using internal::Worker;
using internal::Workers;
using internal::world_box;
using internal::world_half_space;

namespace {

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
  if (!(state.doubt >= 0.0)) refuse(index, "doubt is " + std::to_string(state.doubt), "a number of at least 0");
  if (std::isfinite(state.doubt) && !(state.end_pose.p.allFinite() && std::abs(state.end_pose.q.norm() - 1.0) <= unit))
    refuse(index, "end_pose is not finite or its quaternion not of length 1", "a pose");
  if (std::isfinite(state.doubt) && state.end_amplitudes.size() != static_cast<std::size_t>(body.modes()))
    refuse(index, std::to_string(state.end_amplitudes.size()) + " end_amplitudes", std::to_string(body.modes()));
  if (std::isfinite(state.doubt) &&
      !std::all_of(state.end_amplitudes.begin(), state.end_amplitudes.end(), [](double z) { return std::isfinite(z); }))
    refuse(index, "end_amplitudes are not finite", "finite numbers");
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

}  // namespace

bool ContactFinder::Impl::stays_in_place(Index body, const BodyState& s) const {
  return s.asleep && at(body).placed_asleep && at(body).placed_reach == s.way();
}

/// Refuses states before anything is changed, and lists the bodies whose place in the broad phase is to be made anew.
void ContactFinder::Impl::check_and_list() {
  to_place.clear();
  const std::span<const Index> known = some.empty() ? awake : some;
  for (std::size_t i = 0; known.empty() && i < bodies.size(); ++i)
    if (bodies[i].present) check_place(static_cast<Index>(i));
  for (const Index index : known)
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
  if (!body.modal->surface->skin())
    return swept(worker.root.bounds(0), body.modal->surface->model()->collision_extent().shape, *motion(index));
  worker.shape.resize(worker.amplitudes.size());
  motion(index)->changes(worker.amplitudes);
  worker.root.skin_extent(worker.amplitudes, worker.shape);
  return swept(worker.root.bounds(0), worker.shape, *motion(index));
}

void ContactFinder::Impl::place() {
  farthest_beyond = 0.0;
  for (const Index index : to_place)
    if (motion(index) == nullptr)
      farthest_beyond = std::max(farthest_beyond, state(index).way() - reach_of_features(state(index)));
  for (std::size_t i = 0; i < to_place.size(); ++i) {
    const Index index = to_place[i];
    FoundBody& body = at(index);
    const bool moves = motion(index) != nullptr;
    if (body.is_half_space() && !moves) {
      HalfSpace half_space = world_half_space(std::get<HalfSpace>(body.rigid->shape()), state(index).pose);
      half_space.offset += state(index).way();
      broad_phase.set_half_space(index, half_space);
    } else {
      broad_phase.set_box(index, boxes[i]);
    }
    body.placed_asleep = !moves && state(index).asleep;
    body.placed_reach = moves ? 0.0 : state(index).way();
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

}  // namespace limber
