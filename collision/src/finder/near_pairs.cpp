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
  for (std::size_t i = 0; query.awake.empty() && i < bodies.size(); ++i)
    if (bodies[i].present) check_place(static_cast<Index>(i));
  for (const Index index : query.awake)
    if (contains(index)) check_place(index);
}

void ContactFinder::Impl::check_place(Index index) {
  const auto i = static_cast<std::size_t>(index);
  if (i >= query.states.size())
    throw InvalidArgument("ContactFinder: " + std::to_string(query.states.size()) + " states, expected one for body " +
                          std::to_string(i) + " too");
  if (stays_in_place(index, state(index))) return;
  check_state(index, bodies[i], state(index));
  to_place.push_back(index);
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
  if (body.modal) {
    bind_state(worker.root, index, body, state(index).amplitudes);
    boxes[entry] = world_box(worker.root.bounds(0), state(index).pose).grown(state(index).way());
  } else if (!body.is_half_space()) {
    boxes[entry] = world_box(*body.rigid, state(index).pose).grown(state(index).way());
  }
}

void ContactFinder::Impl::place() {
  for (std::size_t i = 0; i < to_place.size(); ++i) {
    const Index index = to_place[i];
    FoundBody& body = at(index);
    const double way = state(index).way();
    if (body.is_half_space()) {
      HalfSpace half_space = world_half_space(std::get<HalfSpace>(body.rigid->shape()), state(index).pose);
      half_space.offset += way;
      broad_phase.set_half_space(index, half_space);
    } else {
      broad_phase.set_box(index, boxes[i]);
    }
    body.placed_asleep = state(index).asleep;
    body.placed_reach = way;
    broad_phase.set_asleep(index, body.placed_asleep);
  }
}

void ContactFinder::Impl::find_near_pairs(Jobs& jobs) {
  check_and_list();
  workers.start_query(options, jobs.concurrency());
  make_boxes(jobs);
  place();
  broad_phase.find_pairs(query.margin, pairs, jobs);
  check_sleepers_in_pairs();
}

/// Bodies that find themselves and are awake, among the pairs in their order.
void ContactFinder::Impl::merge_self_pairs() {
  if (self_touching.empty()) return;
  merged_pairs.clear();
  auto next = pairs.begin();
  for (const Index body : self_touching) {
    if (state(body).asleep) continue;
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
      if (!state(index).asleep) continue;
      check_state(index, at(index), state(index));
      if (at(index).modal) bind_state((*worker).root, index, at(index), state(index).amplitudes);
    }
}

}  // namespace limber
