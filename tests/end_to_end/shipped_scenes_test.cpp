// Every scene of assets/scenes, played for a second with bars in place of its assets: what is asked for happens,
// nothing is lost, and energy and momentum are those of physics. scripts/demo plays them with the assets that they
// name.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "constants.h"
#include "folders.h"
#include "limber/precompute/bake.h"
#include "limber/scene/run.h"
#include "tet_box.h"

namespace limber::testing {
namespace {

constexpr double kSeconds = 1.0;

/// A bar about the origin; as large as the bunnies of the scenes, or their links.
Asset bar_for(const std::string& name) {
  const bool link = name.find("bar") != std::string::npos;
  const Vec3 size = link ? Vec3(0.2, 0.04, 0.04) : Vec3(0.12, 0.10, 0.08);
  TetMesh mesh = link ? tet_box(10, 2, 2, size) : tet_box(3, 2, 2, size);
  for (Vec3& node : mesh.nodes) node -= 0.5 * size;
  BakeOptions options;
  options.materials = {{"*", {.youngs_modulus = 1e5, .poisson_ratio = 0.4, .density = 1000.0}}};
  options.analysis.modes = options.limits.max_modes = 8;
  options.damping = RayleighDamping::from_ratio(0.05, 5.0, 50.0);
  Warnings warnings;
  return bake({.name = name, .mesh = std::move(mesh)}, options, warnings).asset;
}

RunResult played(const limber::Scene& scene) {
  std::map<std::string, Asset> assets;
  for (const auto& [name, file] : scene.assets) assets.emplace(name, bar_for(name));
  return run_scene(scene, make_models(scene, assets),
                   {.steps = static_cast<std::int64_t>(std::round(kSeconds / scene.step)), .key_rate = 1e9});
}

bool all_finite(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
}

void expect_finite(const BodyTrack& body) {
  for (std::size_t key = 0; key < body.poses.size(); ++key)
    ASSERT_TRUE(body.poses[key].p.allFinite() && std::abs(body.poses[key].q.norm() - 1.0) < 1e-12 &&
                body.angular_velocities[key].allFinite() && std::isfinite(body.energies[key].total()))
        << body.name << ", key " << key;
  EXPECT_TRUE(all_finite(body.amplitudes) && all_finite(body.rates)) << body.name;
}

/// The lowest vertex of what is drawn at any key, m.
double lowest(const BodyTrack& body) {
  double low = kInfinity;
  const ModalSurface& surface = body.model->render();
  for (std::size_t key = 0; key < body.poses.size(); ++key)
    for (Index v = 0; v < surface.vertices(); ++v) {
      Vec3 p = surface.rest[static_cast<std::size_t>(v)].cast<double>();
      const auto z = body.amplitudes_at(key);
      for (std::size_t m = 0; m < z.size(); ++m)
        p += z[m] * surface.basis.shape(v, static_cast<Index>(m)).cast<double>();
      low = std::min(low, (body.poses[key] * p).z());
    }
  return low;
}

double energy_at(const RunResult& r, std::size_t key) {
  double sum = 0.0;
  for (const BodyTrack& body : r.trajectory.bodies) sum += body.energies[key].total();
  return sum;
}

/// Where nothing but strikes acts, centres of mass go straight on, and a strike adds its impulse.
void expect_momenta_of_free_flight(const limber::Scene& scene, const RunResult& r) {
  for (const BodyTrack& body : r.trajectory.bodies) {
    const SceneBody& start = *std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                           [&](const SceneBody& b) { return b.name == body.name; });
    Vec3 end = body.poses.front().p + kSeconds * start.placement.velocity;
    for (const Strike& strike : scene.strikes)
      if (strike.body == body.name && strike.time < kSeconds)
        end += (kSeconds - strike.time) / body.model->data().mass * strike.impulse;
    EXPECT_LT((body.poses.back().p - end).norm(), 1e-12) << body.name;
  }
}

/// Where bodies fall and touch: they touch, stay above the ground and within reach, hang together, and lose energy.
/// @param apart of joints, in sizes. @param rise of a step's energy, of that at first
void expect_a_fall(const RunResult& r, double apart, double rise) {
  constexpr double kSize = 0.1;           // m, of a body
  constexpr double kDeep = 0.02 * kSize;  // in the ground, while they strike it
  constexpr double kReach = 0.5 * kGravity * kSeconds * kSeconds;
  EXPECT_GT(r.constraints.begun, 0);
  for (const BodyTrack& body : r.trajectory.bodies) {
    EXPECT_GT(lowest(body), -kDeep) << body.name;
    EXPECT_LT((body.poses.back().p - body.poses.front().p).norm(), kReach) << body.name;
  }
  for (const JointReport& joint : r.joints) EXPECT_LT(joint.largest_distance_error, apart * kSize) << joint.b;
  double before = energy_at(r, 0);
  for (std::size_t key = 1; key < r.trajectory.times.size(); ++key) {
    EXPECT_LE(energy_at(r, key), before + rise * energy_at(r, 0)) << "key " << key;
    before = energy_at(r, key);
  }
}

TEST(ShippedScenes, PlayAsPhysicsSays) {
  int scenes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(LIMBER_SOURCE_DIR "/assets/scenes")) {
    if (entry.path().extension() != ".json") continue;
    SCOPED_TRACE(entry.path());
    ++scenes;
    for (const ContactSolver solver : {ContactSolver::kGame, ContactSolver::kExact}) {
      SCOPED_TRACE(solver == ContactSolver::kExact ? "exact" : "game");
      limber::Scene scene = read_scene(entry.path());
      scene.contacts.solver = solver;
      const RunResult r = played(scene);
      EXPECT_EQ(static_cast<double>(r.steps) * scene.step, kSeconds);
      ASSERT_EQ(r.trajectory.bodies.size(), scene.bodies.size());
      for (const BodyTrack& body : r.trajectory.bodies) ASSERT_NO_FATAL_FAILURE(expect_finite(body));
      const bool flies =
          scene.gravity == Vec3::Zero() && !scene.contacts.options && scene.joints.empty() && scene.handles.empty();
      EXPECT_EQ(r.constraints.failed_steps, 0);  // exact: bodies that fall on each other may end at a limit of work
      if (flies) expect_momenta_of_free_flight(scene, r);
      // Small steps leave joints apart and may add energy, each to a share of its own.
      if (scene.contacts.options)
        solver == ContactSolver::kExact ? expect_a_fall(r, 1e-6, 1e-6) : expect_a_fall(r, 1e-3, 1e-2);
      EXPECT_TRUE(flies || scene.contacts.options) << "expected a scene that this test can judge";
    }
  }
  EXPECT_GE(scenes, 2);
}

}  // namespace
}  // namespace limber::testing
