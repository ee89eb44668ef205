/// @file stability_scenes.h
/// Baked bars that fly, fall, pile up, are held, torn at and joined, over all that could make them gain energy,
/// explode, sink in or drift. `limber-benchmark stability`, its tests and the energy tests run them.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "limber/core/types.h"

namespace limber::testing {

enum class StabilityScene {
  kFlight,  ///< a bar flies, spins and rings after a blow
  kGround,  ///< a bar falls askew onto the ground, turning, with friction
  kPile,    ///< a second one, heavier by the mass ratio, falls onto one that lies there
  kHandle,  ///< a bar is held at one corner and swings; with `pull`, the hand pulls it away first and lets it go
  kChain,   ///< three bars hang on a ball joint and a hinge with limits, the last heavier by the mass ratio
};
inline constexpr int kStabilityScenes = 5;

/// One case. Lengths and speeds of the scene follow `size` as gravity makes them: times by √size.
struct StabilityCase {
  StabilityScene scene = StabilityScene::kGround;
  double youngs_modulus = 1e6;  ///< Pa
  double poisson_ratio = 0.3;
  double density = 1000.0;      ///< kg/m³
  double size = 1.0;            ///< of bars of 0.3 × 0.1 × 0.1 m
  double sliver_angle = 0.0;    ///< smallest dihedral angle of flat tetrahedra in the mesh, degrees; 0: none are
  bool one_tet = false;         ///< a single tetrahedron in place of the bar
  double step = 1.0 / 60.0;     ///< s
  bool varying_step = false;    ///< each step its own, from a tenth of `step` to all of it
  double pause = 0.0;           ///< length of one step amid the others, s; 0: none is
  double damping_ratio = 0.0;   ///< of the first mode; more of the higher ones
  int modes = 20;               ///< at most; kAllModes: as many as the mesh has
  double mass_ratio = 1.0;      ///< kPile, kChain
  double friction = 0.5;        ///< kGround, kPile
  double gravity = 1.0;         ///< times the standard one
  double speed = 0.0;           ///< downwards at first, m/s; kGround
  double spin = 0.0;            ///< at first, rad/s; kFlight
  double pull = 0.0;            ///< by how many sizes the hand pulls within ten steps before it lets go; kHandle
  double far_away = 0.0;        ///< distance of the scene from the origin, m
  double recovery_speed = 0.0;  ///< m/s; 0: nothing does work on bodies that overlap
  int substeps = 0;  ///< of ContactSolver::kGame; 0: kExact. With recovery it parts bodies by its own push_speed
};
inline constexpr int kAllModes = 1000;

/// Observations of a case. Energies over their scale: the largest of the energy put in and Σ m g size.
struct StabilityResult {
  double worst_rise = 0.0;     ///< of World::energy in a step
  double total_rise = 0.0;     ///< largest excess over the energy that was put in
  double energy_digits = 0.0;  ///< round-off of the largest kinetic and potential energies, whose sum this is
  double removed = 0.0;        ///< what the constraints took out on purpose (ConstraintReport)

  // The same by the nodes of the meshes (energy_meter.h).
  double node_worst_rise = 0.0, node_total_rise = 0.0;
  double spin_bound = 0.0;         ///< largest sum over the bodies of what their change of inertia may account for
  double spin_excess = 0.0;        ///< largest amount by which the kinetic energies differ beyond that
  double strain_difference = 0.0;  ///< largest difference of the elastic energies

  bool finite = true;
  double overlap = 0.0;          ///< deepest vertex below the ground, over the bar's length
  double rest_overlap = 0.0;     ///< the same at the last step
  bool passed = false;           ///< some body was wholly below the ground
  double largest_turn = 0.0;     ///< by which a body turned in a step, rad
  double off_target = 0.0;       ///< of the held point or the joints, over the bar's length
  double momentum_error = 0.0;   ///< of the mass centre's parabola and of the angular momentum, relative; kFlight
  int steps = 0, unsettled = 0;  ///< steps; those in which some island failed (IslandStatus::kFailed)
};

/// Runs a case. @throws InputError if the bake does not take the material or the mesh
StabilityResult run(const StabilityCase& at, int steps);

/// The same by Bullet's reduced deformable body (explicit, as its own examples set it up), on modes of the same bake
/// with lumped masses: one bar that flies, or falls onto a box, never far from the origin, without pauses. Energies are
/// those of its nodes and modes. Overlap beyond its margin counts; nothing is told of momentum or of unsettled steps.
bool bullet_can(const StabilityCase& at);
StabilityResult run_by_bullet(const StabilityCase& at, int steps);
bool has_bullet();  ///< whether this build has it; else run_by_bullet() throws InvalidArgument

/// Faults of a case. Energies may rise by round-off alone, and by what changes of inertia the nodes' energy
/// knows of; where something recovers from overlap, by the work of that, which is not judged.
enum class StabilityFault {
  kNotFinite,
  kEnergy,     ///< more than was put in, by World::energy or by the nodes: by 1e-6 of its scale; kGame: by 1e-2
  kPassed,     ///< wholly below the ground
  kOverlap,    ///< deeper in the ground at the end than kMostOverlap of the length
  kOffTarget,  ///< held points and joints: more than 1e-6 of the length, or rad, beside what the place's digits allow
  kMomentum,   ///< more than 1e-9 beside the same
  kUnsettled,  ///< more than a hundredth of the steps
};
inline constexpr int kStabilityFaults = 7;
inline constexpr double kMostOverlap = 0.05;
/// Bit i: fault i.
unsigned faults(const StabilityCase& at, const StabilityResult& seen);
const char* name(StabilityFault fault);

const char* name(StabilityScene scene);
std::string text(const StabilityCase& at);  ///< in one line, what differs from the defaults

/// E 1e2…1e12 Pa × step 1e-4…0.1 s × damping 0…overdamped × modes 0…64 × ν 0.3 and 0.499 × mass ratio 1 and 1e4, where
/// the scene has two weights; all scenes but kFlight: 2,616 cases. @param recovery_speed m/s, where there is contact
std::vector<StabilityCase> energy_grid(double recovery_speed = 0.0);

/// All axes to their ends: each level of each by itself, and `random` cases of each scene drawn from all of them at
/// once, the same for the same number. Default recovery.
std::vector<StabilityCase> extreme_cases(int random);

/// A case with as many quantities as can be at their usual values, one after the other, so that `is_alike` still holds.
StabilityCase simplified(StabilityCase at, const std::function<bool(const StabilityCase&)>& is_alike);

/// The quantities of a case by name, in the order of a table's columns.
std::vector<std::pair<const char*, double>> coordinates(const StabilityCase& at);

}  // namespace limber::testing
