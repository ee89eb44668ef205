// Which bodies of a world sleep: islands that have been at rest for a while.
#pragma once

#include <cstdint>
#include <span>
#include <tuple>
#include <vector>

#include "constraint_stage.h"
#include "limber/constraints/contact_constraint.h"
#include "limber/engine/world.h"

namespace limber::internal {

class SleepStage {
 public:
  explicit SleepStage(ConstraintStage& constraints) : constraints_(&constraints) {}

  /// A body that is awake, or a static shape.
  void add(Index body);
  /// Wakes what it sleeps with and what rests on it.
  void remove(Index body);

  /// Bodies that move and are awake, ascending. Made anew where one was added or removed, fell asleep or woke;
  /// allocates nothing then.
  std::span<const Index> awake();
  /// Differs from what it was where awake() does; wakings() where somebody woke.
  std::uint64_t changes() const { return changes_; }
  std::uint64_t wakings() const { return wakings_; }

  bool asleep(Index body) const { return asleep_[static_cast<std::size_t>(body)] != 0; }
  /// By body.
  std::span<const char> asleep() const { return asleep_; }
  /// How long a body has been at rest, s.
  double calm(Index body) const { return rest_[static_cast<std::size_t>(body)].calm; }
  /// All that fell asleep with it wake, and all start to count anew.
  void wake(Index body);
  void wake_all();

  /// After a step of h: counts who is at rest, and puts islands to sleep that have been for long enough.
  /// @param events of the step
  void update(const SleepOptions& options, double h, std::span<const ContactEvent> events);

  /// Of as many bodies. Their groups and `constraints` know by themselves who sleeps.
  void save_state(std::size_t bodies, StateWriter& state) const;
  void restore_state(std::size_t bodies, StateReader& state);

 private:
  struct Rest {
    double calm = 0.0;           // s
    Index next = -1;             // of those that fell asleep together, in a ring
    Vec3 push = Vec3::Zero();    // of all contacts over the last step, N·s
    Vec3 pushed = Vec3::Zero();  // and over the one before

    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.calm, s.next, s.push, s.pushed);
    }
  };
  struct Support {
    Index what, sleeper;

    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.what, s.sleeper);
    }
  };
  bool at_rest(Index body, const SleepOptions& options) const;
  void put_to_sleep(std::span<const Index> members);

  ConstraintStage* constraints_;
  std::vector<char> asleep_;
  std::vector<Rest> rest_;
  std::vector<Support> supports_;  // static shapes that sleepers rest on
  std::vector<Index> awake_;
  std::uint64_t changes_ = 1, wakings_ = 1, listed_ = 0;  // the last: changes_ when awake_ was made
};

}  // namespace limber::internal
