// All contacts of a step by small steps: their rows, made once from where the bodies are, and the sweeps over them.
#pragma once

#include <span>
#include <vector>

#include "../prepared_contact.h"
#include "game_bodies.h"
#include "limber/constraints/small_steps.h"
#include "limber/core/disjoint_sets.h"
#include "pair_bundles.h"

namespace limber::internal {

class GameContacts {
 public:
  /// What resists rolling, from step to step.
  struct Rolling {
    std::uint64_t id = 0;        // of the contact
    Vec3 moment = Vec3::Zero();  // on a, world, N·m

    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.id, s.moment);
    }
  };
  /// Contacts that have begun to rebound, from step to step: as BundleContact has them.
  struct Rebound {
    std::uint64_t id = 0;  // of the contact
    float stage = 0.0f, energy = 0.0f;

    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.id, s.stage, s.energy);
    }
  };
  struct Options {
    SmallSteps steps;
    double rolling_friction = 0.0;
    bool residual_compliance = true;
    std::span<const double> thickness{};  // by body number
  };

  /// Rows of contacts between bodies that move, or with what stands. They begin with the forces that contacts had in
  /// the last step. @param contacts kept by reference
  void begin_step(const BodyStates& states, GameBodies& bodies, std::span<PreparedContact> contacts,
                  const Options& options, Jobs& jobs);
  /// What the bodies of a substep get of the forces of the last step. @pre the first substep has not begun
  void apply_last_forces(GameBodies& bodies, Jobs& jobs);
  /// Measures gaps. @return whether something is to be pushed apart
  bool begin_substep(const GameBodies& bodies, Jobs& jobs);
  /// After the forward sweep: leaves as much of the forces as adds no energy, of bodies that contacts tie together the
  /// largest share. @param moved y by joints and handles; none: nothing
  void limit_forces(GameBodies& bodies, std::span<const double> moved, Jobs& jobs);
  void sweep(GameBodies& bodies, bool backward, Jobs& jobs);
  /// @param speed m/s: how fast, at most
  void push_apart(GameBodies& bodies, double speed, bool backward, Jobs& jobs);
  /// Notes what rebounds.
  void end_substep(const GameBodies& bodies, Jobs& jobs);
  /// Tells the contacts what acted on them.
  void end_step(const SubstepPlan& plan);

  /// m: how far from their law the last sweep left the rows.
  double residual(GameBodies& bodies, Jobs& jobs);
  /// Whether no force pulls, is outside its cone, or is not finite.
  bool meet_law() const;
  std::size_t size() const { return contacts_.size(); }

  std::vector<Rolling>& rolling_memory() { return rolling_memory_; }
  const std::vector<Rolling>& rolling_memory() const { return rolling_memory_; }
  std::vector<Rebound>& rebound_memory() { return rebound_memory_; }
  const std::vector<Rebound>& rebound_memory() const { return rebound_memory_; }

 private:
  ContactRow make(const BodyStates& states, const GameBodies& bodies, const PreparedContact& contact,
                  const Options& options) const;
  void put(const BodyStates& states, const GameBodies& bodies, std::size_t contact, const Options& options);
  bool find_modes(const GameBodies& bodies, std::size_t contact, std::size_t side, ModePoint& point) const;
  void add_corners(std::size_t contact, std::size_t side, float sign, ModePoint& point) const;
  void make_skin_rows(const BodyStates& states, const GameBodies& bodies);
  void begin_rebound(const GameBodies& bodies, const PreparedContact& contact, ContactRow& row) const;
  void tell(std::size_t contact, const SubstepPlan& plan);
  /// Of bodies that contacts tie together: what their forces change the energy by, what they may, and what of them is
  /// left.
  struct Works {
    double linear = 0.0, square = 0.0, given = 0.0;
    float share = 1.0f;
  };
  Works& works_of(std::int32_t frame) {
    return frame < 0 ? works_.back() : works_[static_cast<std::size_t>(ties_.root(frame))];
  }
  void add_works(const GameBodies& bodies);
  void scale_forces(GameBodies& bodies, std::span<const double> moved);
  Vec3 last_moment(const PreparedContact& contact) const;

  std::span<PreparedContact> contacts_;
  PairBundles bundles_;
  std::vector<Rolling> rolling_memory_;
  std::vector<Rebound> rebound_memory_;
  std::vector<bool> touched_;  // by frame
  DisjointSets ties_;          // of frames
  std::vector<Works> works_;   // by the root of an island, and of what does not move
  std::vector<double> modal_;  // scratch of bodies with skins
  std::vector<float> skin_rows_;
  std::vector<std::size_t> skin_at_;  // by side of a contact, in these
};

}  // namespace limber::internal
