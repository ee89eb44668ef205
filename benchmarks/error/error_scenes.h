/// @file error_scenes.h
/// Scenes that are played twice, by limber and by finite elements of all nodes (benchmarks/reference), and compared.
/// The scenes of `limber-benchmark error` and its tests.
///
/// limber plays each as a scene file (limber/scene/scene_file.h), so that a setting that is found to do can be written
/// and run. Bodies are boxes whose meshes are nested: a mesh with half the cells has its nodes among the finer one's.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "error_measures.h"
#include "limber/core/rigid_transform.h"
#include "limber/model/asset.h"
#include "reference_world.h"

namespace limber::testing {

/// A box of the mesh [0, size], free or clamped at x = 0.
struct ErrorBody {
  std::string name;
  Vec3 size = Vec3::Ones();                ///< m
  std::array<int, 3> cells{1, 1, 1};       ///< of the coarsest mesh
  bool clamped = false, mirrored = false;  ///< mirrored: its mesh is, at the middle of x
  bool coupled = false;                    ///< limber plays it with inertial coupling
  Material material{};
  RigidTransform pose{};  ///< of the centre of mass
  Vec3 velocity = Vec3::Zero(), angular_velocity = Vec3::Zero();
  std::optional<Wall> wall{};  ///< what stops it; the reference's, also in the place of a mirror image
};

// Points are nodes of the coarsest mesh, in its coordinates.
struct ErrorForce {
  std::size_t body = 0;
  Vec3 at = Vec3::Zero(), force = Vec3::Zero();  ///< m, N
  double duration = 0.0;                         ///< s, from 0 on
};
struct ErrorLead {
  std::size_t body = 0;
  Vec3 at = Vec3::Zero(), way = Vec3::Zero();  ///< m
  double arrives = 0.0, ends = 0.0;  ///< s; the way follows 10u³ − 15u⁴ + 6u⁵, then it is held, then let go
};
struct ErrorTie {
  std::size_t body_a = 0;
  Vec3 at_a = Vec3::Zero();
  std::size_t body_b = 0;
  Vec3 at_b = Vec3::Zero();
};

struct ErrorScene {
  std::string name, what;  ///< the latter in a few words
  std::vector<ErrorBody> bodies{};
  Vec3 gravity = Vec3::Zero();
  bool ground = false;  ///< z ≥ 0, without friction
  std::vector<ErrorForce> forces{};
  std::vector<ErrorLead> leads{};
  std::vector<ErrorTie> ties{};
  double duration = 1.0;  ///< s
  std::size_t tip_body = 0;
  Vec3 tip = Vec3::Zero();  ///< the node whose error is told by itself

  bool has_constraints() const { return has_contact() || !leads.empty() || !ties.empty(); }
  bool has_contact() const { return ground || bodies.front().wall.has_value(); }
};

/// The references are looked at 240 times a second, limber as often as its steps allow: at 60 a soft body that swings
/// 35 times a second would be seen in nearly the same place again and again.
inline constexpr double kSampleInterval = 1.0 / 240.0;  ///< s
inline constexpr double kSlowestStep = 1.0 / 60.0;      ///< s

/// The scene with everything that drives it so many times as strong: forces, ways, velocities and gravity.
ErrorScene driven(ErrorScene scene, double times);

/// poke, drag, drop, collide, spin, whirl, lamp, squeeze, strip.
const std::vector<ErrorScene>& error_scenes();
/// @throws InvalidArgument naming the known ones
const ErrorScene& error_scene(const std::string& name);

/// A point of every axis.
struct ErrorSetting {
  int modes = 40;
  double step = 1.0 / 240.0;             ///< s; divides kSlowestStep
  std::string method = "complementary";  ///< as in scene files
  int substeps = 0;                      ///< of ContactSolver::kGame; 0: kExact
  bool residual = true;                  ///< static answers of the modes left out, where loads act and bodies touch
  std::string basis = "float";           ///< or "half": shapes rounded to IEEE half precision
  int mesh = 1;                          ///< times as many cells along each axis
  bool quadratic = false;                ///< ten-node tets; all nodes have four
  double drive = 1.0;                    ///< see driven(), which the caller calls
};
std::string text(const ErrorSetting& setting);

/// The models of a scene by a setting, and what they took.
struct BakedScene {
  std::map<std::string, Asset> assets;  ///< by body
  double bake_seconds = 0.0;            ///< of this thread
  std::size_t bytes = 0;                ///< of the models in memory
};
/// Keeps what it has baked.
class SceneBakery {
 public:
  const BakedScene& baked(const ErrorScene& scene, const ErrorSetting& setting);

 private:
  std::map<std::tuple<std::string, int, bool, std::string, int, bool>, BakedScene> known_;
};

/// The scene file's text. @param asset_file of a body's name
std::string scene_text(const ErrorScene& scene, const ErrorSetting& setting,
                       const std::function<std::string(const std::string&)>& asset_file);

/// Impulses of contacts in a step.
struct Touch {
  double time = 0.0, impulse = 0.0;  ///< s, at the step's end; N·s
};
/// From the first touch until nothing presses for kPause.
struct FirstImpact {
  static constexpr double kPause = 0.025;  ///< s
  double begin = -1.0, end = -1.0, impulse = 0.0;
};
FirstImpact first_impact(std::span<const Touch> touches);

/// How a scene went. Motions are those of the coarsest mesh's surface nodes, body by body.
struct PlayedScene {
  std::vector<NodeMotion> motions;
  std::vector<double> step_seconds;  ///< of this thread, of every step
  std::vector<Touch> touches;        ///< steps in which contacts pressed; of walls that mirror each other, of one
  std::vector<Vec3> momenta;         ///< of all free bodies, at the samples, kg·m/s
  double energy_rise = 0.0,
         energy_loss = 0.0;  ///< after the last load has ended, of the largest energy of motion and shape
  int unsettled = 0;
};
PlayedScene play(const ErrorScene& scene, const ErrorSetting& setting, SceneBakery& bakery);

/// @param fraction of the stable step taken
PlayedScene play_reference(const ErrorScene& scene, ElasticLaw law, int mesh, double fraction = 0.4);

/// The step of central differences that is just stable for a body's coarsest mesh, s.
double stable_step_of(const ErrorBody& body);
/// Masses of the compared nodes of a body, kg.
Eigen::VectorXd compared_masses(const ErrorBody& body);
/// The number of the scene's tip among its body's compared nodes.
Index compared_tip(const ErrorScene& scene);

/// All measures of one motion against another; of several bodies the worst.
struct SceneError {
  MotionError motion;
  double tip = 0.0;
  double impulse = 0.0;  ///< of all contacts, relative; 0 without contact
  /// Errors of the first impact: the motion until it ends, root mean square over the whole peak; its impulse and its
  /// length, relative. Later motion magnifies these errors.
  double first = 0.0, first_impulse = 0.0, first_length = 0.0;
  double momentum = 0.0;  ///< largest difference over the largest of the reference
};
SceneError scene_error(const ErrorScene& scene, const PlayedScene& seen, const PlayedScene& reference);

}  // namespace limber::testing
