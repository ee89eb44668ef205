/// @file limber/scene/scene_file.h
/// Scenes: which bodies there are, how they start, what they touch and hang on, and what acts on them when. Written as
/// JSON; docs/formats/scene.md describes the file, docs/formats/scene.schema.json is its JSON Schema.
///
///   {"step": 0.001, "duration": 2,
///    "assets": {"bunny": "bunny.glb"},
///    "bodies": [{"name": "bunny", "asset": "bunny", "position": [0, 0, 1], "angular_velocity": [0, 0, 2]}],
///    "strikes": [{"body": "bunny", "time": 0.1, "at": {"ray": {"from": [1, 0, 1], "direction": [-1, 0, 0]}},
///                 "impulse": [-0.5, 0, 0]}]}
///
/// SI units throughout: m, s, kg, N, N·s; angles in degrees in the file only. World axes: z up.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "limber/core/rigid_transform.h"
#include "limber/engine/world.h"
#include "limber/model/mode_selection.h"
#include "limber/model/shape.h"

namespace limber {

/// Axes in which a place on a body is given.
enum class PlaceFrame {
  kWorld,  ///< world, at the start of the step in which the load begins, the body as it is then
  kBody,   ///< body frame (origin at the centre of mass for a free body), rest shape
  kInput,  ///< coordinates of the mesh that the asset was baked from, rest shape
};

/// A place on the render surface of a body. A load stays on the material point that is found when it begins.
struct OnTriangle {
  Index triangle = 0;
  std::array<double, 3> weights{1.0, 0.0, 0.0};  ///< barycentric, ≥ 0, sum 1
};
struct AtVertex {
  Index vertex = 0;  ///< in the order of the asset's POSITION accessor
};
struct NearestTo {
  Vec3 point = Vec3::Zero();  ///< m
  PlaceFrame frame = PlaceFrame::kWorld;
};
/// The first point that a ray from outside meets.
struct AlongRay {
  Vec3 from = Vec3::Zero();        ///< m
  Vec3 direction = Vec3::UnitZ();  ///< any length > 0
  PlaceFrame frame = PlaceFrame::kWorld;
};
using SurfacePlace = std::variant<OnTriangle, AtVertex, NearestTo, AlongRay>;

/// An impulse at an exact time, also inside a step.
struct Strike {
  std::string body{};
  double time = 0.0;  ///< s; in [0, duration)
  SurfacePlace at{};
  Vec3 impulse = Vec3::Zero();  ///< N·s
  Axes axes = Axes::kWorld;
  double contact_time = 1e-3;  ///< s, 1e-6 to 10: how long what strikes touches, for its sound (synthesizer.h)
  std::string where{};         ///< place in the file, for messages
};

/// A force held over whole steps: every step whose start lies in [start, start + duration).
struct HeldForce {
  std::string body{};
  double start = 0.0, duration = 0.0;  ///< s; the duration may be infinite
  SurfacePlace at{};
  Vec3 force = Vec3::Zero();  ///< N
  Axes axes = Axes::kWorld;
  std::string where{};
};

/// Motion of the frame of a body with fixed nodes: x(t) = x₀ + axis · amplitude · sin(2πf (t − start)) within
/// [start, start + duration), at x₀ outside. The velocity that it starts and ends with is reached within one step.
struct Shake {
  Vec3 axis = Vec3::UnitX();           ///< world, unit
  double amplitude = 0.0;              ///< m
  double frequency = 0.0;              ///< Hz; > 0
  double start = 0.0, duration = 0.0;  ///< s; the duration may be infinite
};

/// A pose to be reached at a time. Between keys the frame moves along a straight line and turns about one axis, with
/// position and angle following 10u³ − 15u⁴ + 6u⁵: at rest, and without acceleration, at every key.
struct PoseKey {
  double time = 0.0;  ///< s
  RigidTransform pose{};
};
using FrameMovement = std::variant<std::monostate, Shake, std::vector<PoseKey>>;

/// A shape whose points are in a file of a surface (read_mesh.h): the surface itself, or the convex hull of its
/// vertices.
struct ShapeFile {
  std::filesystem::path path{};
  double scale = 1.0;  ///< metres per unit of the file; > 0
  bool hull = false;
  friend bool operator==(const ShapeFile&, const ShapeFile&) = default;
};
/// A rigid shape: as the scene tells it, checked, or in a file; null: none.
using SceneShape = std::variant<std::shared_ptr<const Shape>, ShapeFile>;

/// A rigid shape that never moves.
struct SceneStatic {
  std::string name{};  ///< unique among the bodies and these
  SceneShape shape{};
  RigidTransform pose{};
  CollisionFilter filter{};
  std::optional<double> friction{};      ///< as in World::add_static
  Vec3 surface_velocity = Vec3::Zero();  ///< as in World::set_surface_velocity
  std::string where{};
};

/// A convex shape that tells who is inside it and pushes nobody, as World::add_sensor().
struct SceneSensor {
  std::string name{};  ///< unique among the bodies, statics and these
  SceneShape shape{};
  RigidTransform pose{};
  CollisionFilter filter{};
  std::string where{};
};

struct SceneBody {
  std::string name{};   ///< unique; copy i of a grid is called "name[i]"
  std::string group{};  ///< the name in the file: shared by all copies, equal to `name` without them
  std::string asset{};  ///< key of Scene::assets
  std::variant<Index, std::string> part = Index{0};  ///< which body of the asset: index or name
  BodyPlacement placement{};                         ///< its shape is null: see below
  SceneShape shape{};                                ///< what others meet in place of the body's surface
  Vec3 surface_velocity = Vec3::Zero();              ///< as in World::set_surface_velocity
  FrameMovement movement{};
  std::string where{};
};

/// A point of a body that is held from the first step whose start is not before `start`, as a handle (handle.h). It is
/// found, and taken where it is, when the hold begins.
struct SceneHandle {
  std::string body{};
  double start = 0.0, duration = 0.0;  ///< s; the duration may be infinite
  SurfacePlace at{};
  HandleOptions options{};
  /// Motion of the target, world, in times counted from the start of the hold; orientations are not used. A shake is
  /// about the place where the point was taken; keys go from there to the positions that they tell.
  FrameMovement movement{};
  std::string where{};
};

/// A joint between two bodies as they stand at first, or a body and the world.
struct SceneJoint {
  std::string a{}, b{};  ///< bodies; b moves relative to a. An empty a is the world
  JointSpec spec{};      ///< its frame in world axes
  double patch_radius = 0.0;
  bool collide = false;                       ///< whether a and b have contacts with each other
  std::vector<JointActuation> coordinates{};  ///< of the first so many coordinates
  std::string where{};
};

/// Who finds the contacts of a scene.
enum class SceneFinder {
  kLimber,  ///< ManifoldFinder for ContactSolver::kGame, ContactFinder for kExact
  kFcl,     ///< FclContactSource, in builds with limber::collision_fcl
};
std::string_view to_string(SceneFinder finder);

/// How the forces of contacts are found: limber's own way, or one of [H03]'s with ContactSolver::kExact in builds with
/// limber::hauser, whose contact_rule.h says what the words mean.
struct SceneContactRule {
  enum class Method { kPenalty, kVelocityProgram, kGapProgram, kComplementary };
  enum class Friction { kCone, kHeuristic, kHeuristicNoSlip };
  enum class Guard { kNone, kClamp, kComplementary };
  Method method = Method::kComplementary;
  Friction friction = Friction::kCone;
  Guard guard = Guard::kClamp;
  double penalty_frequency = 15.0, penalty_damping = 1.0;  ///< Hz, > 0, and ≥ 0

  bool is_own() const { return method == Method::kComplementary && friction == Friction::kCone; }
};
// Words of scene files and reports: the last part of the constant's name, such as "gap_program".
std::string_view to_string(SceneContactRule::Method method);
std::string_view to_string(SceneContactRule::Friction friction);
std::string_view to_string(SceneContactRule::Guard guard);
std::string_view to_string(ContactSolver solver);

/// Which bodies meet, how their contacts are found, and who answers these.
struct SceneContacts {
  ContactSolver solver = kDefaultContactSolver;  ///< of handles and joints, too
  SmallSteps small_steps{};                      ///< of ContactSolver::kGame
  /// Absent: bodies pass through each other. Its solver and small steps are those above.
  std::optional<ContactOptions> options{};
  SceneFinder finder = SceneFinder::kLimber;
  SceneContactRule rule{};
  std::vector<std::array<std::string, 2>> apart{};  ///< bodies without contacts with each other
};

struct Scene {
  std::string name{};                                     ///< the file's name without folder and extension
  double step = 1.0 / 60.0;                               ///< s
  std::int64_t steps = 0;                                 ///< whole steps
  int substeps = 1;                                       ///< as WorldOptions::substeps
  SleepOptions sleep{};                                   ///< as WorldOptions::sleep; on where the file has it
  Vec3 gravity = {0.0, 0.0, -9.80665};                    ///< m/s²
  std::map<std::string, std::filesystem::path> assets{};  ///< name → file, resolved
  std::optional<SceneLimits> limits{};                    ///< leaves out the modes that this scene cannot show
  SceneContacts contacts{};
  std::vector<SceneStatic> statics{};  ///< none without contact
  std::vector<SceneSensor> sensors{};
  std::vector<SceneBody> bodies{};  ///< those of machines last
  std::vector<Strike> strikes{};
  std::vector<HeldForce> forces{};
  std::vector<SceneHandle> handles{};
  std::vector<SceneJoint> joints{};
  /// Where the scene is heard, world, m, one per channel: at most 16. Two ears by default.
  std::vector<Vec3> microphones{{-0.1, -1.0, 1.0}, {0.1, -1.0, 1.0}};

  double duration() const { return step * static_cast<double>(steps); }
};

/// All files that a scene names: assets, and shapes of bodies, statics and sensors; each once.
std::vector<std::filesystem::path> files_of(const Scene& scene);

/// Reads and checks everything that can be checked without the assets and the files of shapes. Assets of machines are
/// read: their bodies, joints and pairs stand among the scene's own, each body as "MACHINE/BODY". Unknown keys are
/// errors that name the nearest known one. @throws InputError in one line: file, place, seen, expected
Scene read_scene(const std::filesystem::path& path);

/// The same from text. @param name shown in messages. @param folder that asset files are relative to
Scene parse_scene(std::string_view text, const std::string& name, const std::filesystem::path& folder);

}  // namespace limber
