// The bodies of a source of contacts, and which of them are near each other: what ContactFinder and ManifoldFinder have
// in common before they look at a pair.
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "limber/collision/broad_phase.h"
#include "limber/collision/deformed_surface.h"
#include "limber/core/error.h"
#include "limber/dynamics/contact_source.h"

namespace limber::internal {

/// Refuses a state but for the size of its amplitudes, which bind_state() shows. @param finder whose name is told
void check_state(const char* finder, Index body, Index modes, const BodyState& state);
/// Margin, origin and fall.
void check_query(const char* finder, const ContactQuery& query);
/// Binds amplitudes that nobody has looked at yet; what is wrong with them is told with the body's name.
void bind_state(const char* finder, Index body, DeformedSurface& root,
                const std::shared_ptr<const CollisionSurface>& surface, std::span<const double> z);

/// Body has `present` and `placed_asleep`, `modal`, null for a rigid one, and modes().
template <class Body>
class BodyRegister {
 public:
  /// @param finder whose name is told with what is refused
  explicit BodyRegister(const char* finder) : finder_(finder) {}

  std::size_t size() const { return bodies_.size(); }
  bool contains(Index body) const {
    return body >= 0 && static_cast<std::size_t>(body) < bodies_.size() && (*this)[body].present;
  }
  Body& operator[](Index body) { return bodies_[static_cast<std::size_t>(body)]; }
  const Body& operator[](Index body) const { return bodies_[static_cast<std::size_t>(body)]; }
  std::span<const Body> all() const { return bodies_; }
  BroadPhase& broad_phase() { return broad_phase_; }

  void check_new(Index body, const BodyGeometry& geometry) const {
    const std::string where = std::string(finder_) + "::add_body: ";
    if ((geometry.model == nullptr) == (geometry.shape == nullptr))
      throw InvalidArgument(where + "body " + std::to_string(body) + " has " +
                            (geometry.model ? "both a model and a shape" : "neither a model nor a shape") +
                            ", expected one of them");
    if (body < 0 || contains(body))
      throw InvalidArgument(where + "index " + std::to_string(body) + (body < 0 ? "" : " holds a body") +
                            ", expected a free index of at least 0");
  }
  void add(Index body, Body fresh, const CollisionFilter& filter) {
    broad_phase_.add(body, filter);
    if (static_cast<std::size_t>(body) >= bodies_.size()) bodies_.resize(static_cast<std::size_t>(body) + 1);
    (*this)[body] = std::move(fresh);
    set_finds_itself(body, filter.self && (*this)[body].modal);
  }
  void remove(Index body) {
    check_present(body, "remove_body");
    set_finds_itself(body, false);
    broad_phase_.remove(body);
    (*this)[body] = {};
  }
  void set_filter(Index body, const CollisionFilter& filter) {
    check_present(body, "set_filter");
    broad_phase_.set_filter(body, filter);
    set_finds_itself(body, filter.self && (*this)[body].modal);
  }
  void exclude_pair(Index a, Index b, bool excluded) {
    check_present(a, "exclude_pair");
    check_present(b, "exclude_pair");
    broad_phase_.exclude_pair(a, b, excluded);
  }
  /// Their places count as unknown.
  void forget_places() {
    for (Body& body : bodies_) body.placed_asleep = false;
  }

  /// Refuses states before anything is changed, and lists the bodies whose place in the broad phase is to be made anew:
  /// all that are awake or were when they were placed.
  void list_to_place(const ContactQuery& query, std::vector<Index>& to_place) const {
    to_place.clear();
    const auto list = [&](Index body) {
      if (static_cast<std::size_t>(body) >= query.states.size())
        throw InvalidArgument(std::string(finder_) + ": " + std::to_string(query.states.size()) +
                              " states, expected one for body " + std::to_string(body) + " too");
      const BodyState& state = query.states[static_cast<std::size_t>(body)];
      if (state.asleep && (*this)[body].placed_asleep) return;
      check_state(finder_, body, (*this)[body].modes(), state);
      to_place.push_back(body);
    };
    for (std::size_t i = 0; query.awake.empty() && i < bodies_.size(); ++i)
      if (bodies_[i].present) list(static_cast<Index>(i));
    for (const Index body : query.awake)
      if (contains(body)) list(body);
  }
  /// Pairs that are near, ascending: of two bodies, and of those that find themselves and are awake.
  void find_pairs(const ContactQuery& query, std::vector<BodyPair>& pairs, Jobs& jobs) {
    broad_phase_.find_pairs(query.margin, pairs, jobs);
    for (const auto& [a, b] : pairs)  // states of sleepers were last looked at when they fell asleep
      for (const Index body : {a, b})
        if (const BodyState& state = query.states[static_cast<std::size_t>(body)]; state.asleep)
          check_state(finder_, body, (*this)[body].modes(), state);
    if (self_touching_.empty()) return;
    merged_.clear();
    auto next = pairs.begin();
    for (const Index body : self_touching_) {
      if (query.states[static_cast<std::size_t>(body)].asleep) continue;
      const BodyPair self{body, body};
      for (; next != pairs.end() && *next < self; ++next) merged_.push_back(*next);
      merged_.push_back(self);
    }
    merged_.insert(merged_.end(), next, pairs.end());
    pairs.swap(merged_);
  }

 private:
  void check_present(Index body, const char* function) const {
    if (!contains(body))
      throw InvalidArgument(std::string(finder_) + "::" + function + ": index " + std::to_string(body) +
                            " holds no body, expected one that was added");
  }
  void set_finds_itself(Index body, bool finds) {
    const auto where = std::lower_bound(self_touching_.begin(), self_touching_.end(), body);
    const bool listed = where != self_touching_.end() && *where == body;
    if (finds && !listed) self_touching_.insert(where, body);
    if (!finds && listed) self_touching_.erase(where);
  }

  const char* finder_;
  std::vector<Body> bodies_;
  std::vector<Index> self_touching_;  // bodies that find themselves, ascending
  BroadPhase broad_phase_;
  std::vector<BodyPair> merged_;  // scratch
};

}  // namespace limber::internal
