/// @file limber/constraints/contact_constraint.h
/// Contacts as rows of an island: one-sided along the normal, Coulomb's cone across it.
///
///   0 ≤ f_n ⊥ gap(end of step) + (G F)_n − offset ≥ 0         |f_t| ≤ μ f_n, against the slip of the whole step
///
/// Gaps in m, impulses f in N·s, F = f/Δt. Gap and slip are those at the end of the step: stiff bodies do not sink,
/// what sticks does not creep. Both points of a contact are carried along by their bodies, deformation included; of
/// round surfaces (ContactSide::radius) the centre is, and slip counts rolling. The normal stays as it was found.
///
/// *Residual compliance* G (residual_compliance.h): what the modes that were left out yield. A contact r gives shares
/// w_r(v) of its force, its barycentric weights, to the corners v of its triangle and yields by their mean:
///
///   G_rs = Σ_vw w_r(v) G_vw w_s(w),
///
/// symmetric and positive semidefinite, for all contacts of a body among each other. The residual displacement is a
/// state of the body: what its last step pressed its vertices with, in its own frame (IndentationLoad), with the energy
/// ½ FᵀG F. Slip counts from there, and what it makes up for is no overlap.
///
/// *Contact compliance* c: contacts of bodies that flex may yield by themselves, which makes the shares of a
/// load among redundant contacts unique for island solvers that need it (ContactOptions::compliance).
///
/// *Overlap* at the start, what indentations leave of it, shrinks by a fifth a step, at most at `recovery_speed`; that
/// is work done on the island, bounded by what lifts it at that speed.
///
/// Only options throw, InvalidArgument. What to expect: docs/contact.md.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <tuple>
#include <type_traits>
#include <vector>

#include "limber/constraints/constraint.h"
#include "limber/constraints/small_steps.h"
#include "limber/core/jobs.h"
#include "limber/dynamics/contact_source.h"
#include "limber/dynamics/surface_point.h"

namespace limber {

/// Who answers contacts, and with them all handles and joints.
enum class ContactSolver {
  kGame,   ///< by small steps (small_steps.h): bounded work
  kExact,  ///< as one convex problem an island (island_solver.h): to the law, in the time that it takes
};
constexpr ContactSolver kDefaultContactSolver = ContactSolver::kGame;

struct ContactOptions {
  ContactSolver solver = kDefaultContactSolver;
  SmallSteps small_steps{};  ///< of kGame
  double friction = 0.5;     ///< μ of bodies without their own; ≥ 0; infinite, with kGame: what touches sticks
  /// C ≥ 0, the coefficient of rolling resistance: spheres and capsules are braked where they roll by a moment of up to
  /// C R F_n, R from the contact to the nearer of their origins. A ball on a plane feels C F_n at its rim: it slows by
  /// C g/(1 + ⅖), and stays on slopes of less than atan C. A tyre on asphalt has 0.01, a ball on grass 0.1. Spinning is
  /// braked likewise; bodies with corners are not. 0: round bodies roll on for ever.
  double rolling_friction = 0.0;
  double recovery_speed = 0.05;  ///< m/s, ≥ 0: bodies that overlap are pushed apart at most this fast
  /// Used where the models have it.
  bool residual_compliance = true;
  /// ≥ 0: so much of what a force moves the reduced mass of two bodies within a step each contact of bodies that flex
  /// yields by itself, a thirtieth of that beside a residual compliance. Island solvers of other methods ask for it;
  /// limber's own (make_island_solver()) needs none and leaves it out of its rows.
  double compliance = 0.0;
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, ContactOptions>
auto state_fields(Self& s) {
  return std::tie(s.solver, s.small_steps, s.friction, s.rolling_friction, s.recovery_speed, s.residual_compliance,
                  s.compliance);
}

/// What became of a contact in the last step.
enum class ContactPhase {
  kBegun,    ///< pressed now, and not before
  kLasting,  ///< pressed now and before
  kEnded,    ///< pressed before, and not now
};

/// One contact after a step, for sound, damage and games.
struct ContactEvent {
  std::uint64_t id = 0;  ///< of the ContactPoint
  Index a = -1, b = -1;  ///< bodies
  ContactPhase phase = ContactPhase::kBegun;
  Vec3 position = Vec3::Zero();  ///< world, at the start of the step in which it was last pressed
  Vec3 normal = Vec3::Zero();    ///< world, out of b into a
  Vec3 impulse = Vec3::Zero();   ///< on a over the step, world, N·s; zero for kEnded
  /// kBegun: how fast the points came together as they met, m/s, ≥ 0. By √(u² + 2 a gap) of their speed u and
  /// acceleration a at the step's start, under gravity and held forces: of bodies that fall without turning, exactly.
  double approach = 0.0;

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.id, s.a, s.b, s.phase, s.position, s.normal, s.impulse, s.approach);
  }
};

/// What contacts are told of a body's surface.
struct BodySurface {
  double friction = 0.5;         ///< μ ≥ 0; that of a pair is √(μ_a μ_b)
  double restitution = 0.0;      ///< e, 0 to 1; that of a pair is the larger
  Vec3 velocity = Vec3::Zero();  ///< how it runs over the body, as that of a conveyor: m/s, body axes
};

/// A step, as contacts are told of it beside where bodies are.
struct ContactSurroundings {
  Vec3 origin = Vec3::Zero();               ///< that of the query
  std::span<const BodySurface> surfaces{};  ///< by body; those beyond its end have the options' friction
  Vec3 gravity = Vec3::Zero();              ///< m/s², world
};

/// What a scene's contacts remember of a step: with the bodies' states it is all that the next step depends on.
struct ContactMemory {
  std::uint64_t id = 0;                                 ///< of the ContactPoint
  Index a = -1, b = -1;                                 ///< bodies
  Vec3 force = Vec3::Zero();                            ///< on a, mean over the step, world, N
  double compliance = 0.0;                              ///< contact compliance c, m/N; ½ c F² is stored there
  double slip = 0.0;                                    ///< how far the point slid in the step, m
  Index yielding = -1;                                  ///< the body that this energy is counted with
  Vec3 position = Vec3::Zero(), normal = Vec3::Zero();  ///< as in ContactEvent

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.id, s.a, s.b, s.force, s.compliance, s.slip, s.yielding, s.position, s.normal);
  }
};

/// And of a pair that resists rolling.
struct RollingMemory {
  Index a = -1, b = -1;        ///< bodies
  Vec3 moment = Vec3::Zero();  ///< on a, mean over the step, world, N·m

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.a, s.b, s.moment);
  }
};

/// What the contacts of the last step pressed on a vertex with: the source of a body's residual displacement.
struct IndentationLoad {
  Index vertex = -1;          ///< of the collision surface
  Vec3 force = Vec3::Zero();  ///< body frame, N

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.vertex, s.force);
  }
};

struct PreparedContact;

/// All contacts of one scene, remembered from step to step. In every step: update(), then the island solver with
/// constraints() among the others, then finish(). Once warm nothing allocates.
class ContactSet {
 public:
  /// @throws InvalidArgument see ContactOptions::validate()
  explicit ContactSet(const ContactOptions& options = {});
  ~ContactSet();
  ContactSet(ContactSet&&) noexcept;
  ContactSet& operator=(ContactSet&&) noexcept;

  /// Takes the contacts found at the step's start, in the order of ContactSource.
  void update(const BodyStates& states, std::span<const ContactPoint> contacts,
              const ContactSurroundings& surroundings = {}, Jobs& jobs = serial_jobs());
  /// One for each pair of bodies that have contacts, ordered as they are. Valid until the next update().
  std::span<Constraint* const> constraints() const;

  /// What small steps answer, and what they press: for SmallStepSolver.
  std::span<PreparedContact> prepared();
  void press_indentations(const BodyStates& states);

  /// Books what the step did: after the islands' steps, before the next update().
  /// @param asleep by body: whether it sleeps. Its contacts were not given to update(): they are remembered as they
  /// were, and told neither as lasting nor as ended
  /// @param some_woke whether a body that slept at the last call does not any more; where none did, those that sleep
  /// cost nothing
  void finish(std::span<const char> asleep = {}, bool some_woke = true);
  /// Contacts that press, or have ceased to, in the last step, ordered by (a, b, id).
  std::span<const ContactEvent> events() const;
  /// Contacts that pressed in the last step, ordered by (a, b, id).
  std::span<const ContactMemory> memory() const;
  /// Those under which bodies fell asleep, ordered by (a, b, id).
  std::span<const ContactMemory> resting() const;
  /// Pairs that resisted rolling in the last step, ordered by (a, b).
  std::span<const RollingMemory> rolling() const;
  /// The forces behind a body's residual displacement, as the last step left them.
  std::span<const IndentationLoad> indentation_loads(Index body) const;
  /// The energy in a body's residual and contact compliance, ½ FᵀG F and ½ c F², J: beside that of its modes.
  double indentation_energy(const BodyStates& states, Index body) const;
  const ContactOptions& options() const;
  /// A body that is removed: its residual displacement goes with it.
  void forget(Index body);
  /// Forgets what it knows of earlier steps.
  void clear();
  /// The options, and all that the coming steps depend on. Between finish() and update().
  void save_state(StateWriter& state) const;
  void restore_state(StateReader& state);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
