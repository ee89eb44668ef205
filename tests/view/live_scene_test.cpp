// What limber/scene and the page play, without them.
#include "limber/view/live_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "block_model.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/dynamics/reconstruct.h"
#include "limber/scene/recording.h"
#include "limber/scene/run.h"

namespace limber {
namespace {

constexpr Index kModes = 3;
constexpr const char* kScene = R"({"step": 0.01, "duration": 10, "assets": {"block": "block.glb"}, "contact": {},
  "statics": [{"name": "ground", "shape": {"half_space": {}}}],
  "sensors": [{"name": "low", "shape": {"box": {"half_extents": [2, 2, 0.2]}}, "position": [0, 0, 0], "meets": [0]},
              {"name": "aside", "shape": {"sphere": {"radius": 0.5}}, "position": [0, 9, 5]}],
  "bodies": [{"name": "a", "asset": "block", "position": [0, 0, 0.8]},
             {"name": "b", "asset": "block", "position": [5, 0, 0.8]}],
  "joints": [{"b": "b", "type": "ball", "origin": [5, 0, 2]}],
  "strikes": [{"body": "a", "time": 0.2, "at": {"vertex": 0}, "impulse": [0, 0.3, 0]}]})";

/// A scene in a folder of its own.
class LiveSceneTest : public ::testing::Test {
 protected:
  LiveSceneTest() {
    std::filesystem::create_directories(folder_);
    write_asset(folder_ / "block.glb", testing::block_asset(kModes));
    write_file(scene(), kScene);
  }
  ~LiveSceneTest() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path scene() const { return folder_ / "falls.json"; }
  void make_it_sound() const { write_asset(folder_ / "block.glb", testing::sounding_block_asset(kModes)); }

 private:
  const std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) / ::testing::UnitTest::GetInstance()->current_test_info()->name();
};

/// One that has begun.
struct Played {
  explicit Played(const std::filesystem::path& path) : live(path) { begin(live.settings()); }
  void begin(const LiveSettings& settings) {
    world.reset();
    live.prepare(settings);
    live.begin(world.emplace(live.world_options()));
  }
  void step(int count) {
    for (int i = 0; i < count; ++i) live.step();
  }
  std::optional<BodyHit> cast(const Vec3& from, const Vec3& way) const {
    return world->cast_ray({.from = from, .way = 100.0 * way});
  }

  LiveScene live;
  std::optional<World> world;
};

TEST_F(LiveSceneTest, LeftAloneItIsTheSceneThatSimulatePlays) {
  Played page(scene());
  page.step(50);
  EXPECT_EQ(page.live.steps_taken(), 50);
  const Scene told = read_scene(scene());
  EXPECT_EQ(page.world->state_hash(), run_scene(told, load_models(told), {.steps = 50}).state_hash);
}

TEST_F(LiveSceneTest, BeforeItBeginsBodiesStandAsPlaced) {
  LiveScene live(scene());
  EXPECT_EQ(live.frame().size(), 2u * (7 + kModes));
  EXPECT_EQ(live.frame()[2], 0.8f);
  EXPECT_EQ(live.bent(0, 0.0).modes, 0);
  EXPECT_THROW(live.step(), InvalidArgument);
  EXPECT_THROW((void)live.joints(), InvalidArgument);
}

TEST_F(LiveSceneTest, ABentSurfaceAndAFrameGiveWhatTheEngineReconstructs) {
  Played page(scene());
  page.step(40);
  page.world->set_amplitudes(page.live.bodies()[0].id, std::vector{0.0, 0.2, 0.0}, std::vector(kModes, 0.0));
  const std::size_t vertices = page.live.models()[0]->render().rest.size();
  const std::span<const float> frame = page.live.frame();
  const RigidTransform X{.q = normalized(Quaternion{frame[3], frame[4], frame[5], frame[6]}),
                         .p = {frame[0], frame[1], frame[2]}};
  std::vector<float> positions(3 * vertices), normals(3 * vertices);
  page.world->reconstruct(page.live.bodies()[0].id, positions, {});
  vertex_normals(testing::block_data(kModes).render.triangles, positions, normals);
  const BentSurface bent = page.live.bent(0, 0.0);
  ASSERT_EQ(bent.modes, 2);
  ASSERT_EQ(bent.positions.size(), positions.size());
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto at = [v](std::span<const float> of) { return Vec3(of[3 * v], of[3 * v + 1], of[3 * v + 2]); };
    EXPECT_LT((X * at(bent.positions) - at(positions)).norm(), 1e-6) << v;  // m, of a block of 2 m in single precision
    EXPECT_LT((X.q * at(bent.normals) - at(normals)).norm(), 1e-5) << v;
  }
}

TEST_F(LiveSceneTest, ASurfaceIsBentByNoMoreModesThanOneSees) {
  Played page(scene());
  EXPECT_EQ(page.live.bent(0, 0.0).modes, 0) << "at rest";
  const std::optional<BodyHit> hit = page.cast({-10, 0.1, 0.9}, {1, 0, 0});
  ASSERT_TRUE(hit && hit->at);
  page.world->apply_impulse(hit->body, *hit->at, testing::kBlockMass * Vec3(1, 0.3, 0.2).normalized());
  page.step(3);
  const BentSurface all = page.live.bent(0, 0.0);
  ASSERT_EQ(all.modes, kModes);
  const std::vector<float> exact(all.positions.begin(), all.positions.end());
  std::vector<float> rest;
  for (const Vec3f& p : page.live.models()[0]->render().rest) rest.insert(rest.end(), p.begin(), p.end());
  bool fewer = false;
  for (double tolerance = 1.0; tolerance > 1e-7; tolerance *= 0.5) {
    const BentSurface seen = page.live.bent(0, tolerance);
    fewer = fewer || (seen.modes > 0 && seen.modes < kModes);
    const std::span<const float> drawn = seen.modes > 0 ? seen.positions : std::span<const float>(rest);
    for (std::size_t i = 0; i < exact.size(); i += 3)
      EXPECT_LE(std::hypot(drawn[i] - exact[i], drawn[i + 1] - exact[i + 1], drawn[i + 2] - exact[i + 2]),
                tolerance + 1e-6);
  }
  EXPECT_TRUE(fewer);
}

TEST_F(LiveSceneTest, SettingsOfTheNextStartAreTaken) {
  Played page(scene());
  LiveSettings settings = page.live.settings();
  settings.modes = 1;
  settings.damping = 2.0;
  settings.step = 1.0 / 30.0;
  settings.stiffness = {0.25};
  page.begin(settings);
  EXPECT_EQ(page.live.steps_taken(), 0);
  ASSERT_EQ(page.live.models()[0]->modes(), 1);
  EXPECT_NEAR(page.live.models()[0]->data().decays[0], 0.5 * 2.0 * testing::block_decay(0), 1e-12) << "ratios stay";
  EXPECT_EQ(page.world->options().step, 1.0 / 30.0);
  settings.stiffness = {kUnbounded};
  page.begin(settings);
  EXPECT_EQ(page.live.models()[0]->modes(), 0);
  for (const double wrong : {-1.0, 0.0, kUnbounded}) {
    settings.step = wrong;
    EXPECT_THROW(page.live.prepare(settings), InvalidArgument);
  }
  page.step(1);
  settings.step = 0.01, settings.stiffness = {0.0};
  EXPECT_THROW(page.live.prepare(settings), InvalidArgument);
}

TEST_F(LiveSceneTest, BodiesAddedComeAndGoWithTheState) {
  Played page(scene());
  page.step(5);
  std::vector<std::byte> before, after;
  page.live.save_state(before);
  const BodyId added = page.live.add_body(0, {0, 0, 3}, "third");
  page.step(5);
  page.live.save_state(after);
  const std::uint64_t hash = page.world->state_hash();
  page.live.restore_state(before);
  EXPECT_EQ(page.live.bodies().size(), 2u);
  EXPECT_EQ(page.live.steps_taken(), 5);
  EXPECT_EQ(page.live.add_body(0, {0, 0, 0}, "third"), added);
  page.live.restore_state(after);
  EXPECT_EQ(page.world->state_hash(), hash);
  EXPECT_THROW(page.live.add_body(1, {0, 0, 0}, ""), InvalidArgument);
}

TEST_F(LiveSceneTest, ARecordingIsThatOfTheRun) {
  Played page(scene());
  page.live.record();
  for (int i = 0; i < 30; ++i) page.live.step(), page.live.record();
  const std::string glb = page.live.recording();
  const Scene told = read_scene(scene());
  EXPECT_EQ(glb, make_recording(run_scene(told, load_models(told), {.steps = 30, .key_rate = 1e6}).trajectory).glb);
}

TEST_F(LiveSceneTest, BodiesAddedOnTheWayAreInTheRecording) {
  Played page(scene());
  for (int i = 0; i < 6; ++i) {
    if (i == 3) page.live.add_body(0, {0, 0, 4}, "third");
    page.step(1);
    page.live.record();
  }
  EXPECT_NE(page.live.recording().find("third"), std::string::npos);
}

TEST_F(LiveSceneTest, BlowsAreNotedWhileSomebodyListens) {
  EXPECT_EQ(LiveScene(scene()).sounding(0), nullptr);
  make_it_sound();
  Played played(scene());
  LiveScene& page = played.live;
  ASSERT_NE(page.sounding(0), nullptr);
  const auto poke_it = [&] { page.note_blow(0, {0.25, 0.5, 0.9}, {0, -testing::kBlockMass, 0}, 2e-4); };
  poke_it();
  played.step(60);
  EXPECT_TRUE(page.take_blows().empty());
  played.begin(page.settings());
  page.listen(true);
  poke_it();
  const std::span<const double> poke = page.take_blows();
  ASSERT_EQ(poke.size(), LiveScene::kBlowNumbers);
  EXPECT_EQ(poke[0], 0.0);
  const std::vector<Vec3f>& rest = (*page.models()[0]).collision().rest;
  Vec3 struck = Vec3::Zero();
  for (std::size_t i = 1; i <= 3; ++i) struck += poke[3 + i] * rest[static_cast<std::size_t>(poke[i])].cast<double>();
  EXPECT_LT((struck - Vec3(0.25, 0.5, 0.1)).norm(), 1e-6);
  EXPECT_LT((Vec3(poke[7], poke[8], poke[9]) - Vec3(0, -testing::kBlockMass, 0)).norm(), 1e-12);
  EXPECT_EQ(poke[10], 2e-4);
  EXPECT_EQ(poke[11], 0.0);
  EXPECT_LT((Vec3(poke[12], poke[13], poke[14]) - Vec3(0.25, 0.5, 0.9)).norm(), 1e-6);

  // The scene's strike at 0.2 s, and the ground: as a run notes them.
  played.step(60);
  const std::span<const double> noted = page.take_blows();
  ASSERT_FALSE(noted.empty());
  EXPECT_EQ(noted.size() % LiveScene::kBlowNumbers, 0u);
  EXPECT_TRUE(page.take_blows().empty());
  played.begin(page.settings());
  played.step(60);
  const std::size_t untouched = page.take_blows().size();
  const Scene told = read_scene(scene());
  RunResult run = run_scene(told, load_models(told), {.steps = 60, .keep_blows = true});
  std::erase_if(run.trajectory.blows, [&](const BlowRecord& b) {  // of what slides, of which a page is silent
    return b.other == BlowRecord::kNobody &&
           std::ranges::none_of(told.strikes, [&](const Strike& s) { return s.contact_time == b.contact_time; });
  });
  EXPECT_EQ(untouched, LiveScene::kBlowNumbers * run.trajectory.blows.size());
  EXPECT_GT(untouched, LiveScene::kBlowNumbers);
}

TEST_F(LiveSceneTest, ContactsBearWhatLiesOnThem) {
  LiveScene live(scene());
  World world(live.world_options());
  live.begin(world);
  double sum = 0.0;
  constexpr int kLast = 50;  // steps of the mean
  for (int i = 0; i < 400; ++i) {
    live.step();
    const std::span<const double> contacts = live.contacts();
    for (std::size_t c = 0; c < contacts.size() && i >= 400 - kLast; c += 6) {
      sum += contacts[c + 5] / kLast;
      EXPECT_NEAR(contacts[c + 2], 0.0, 0.05) << "on the ground";
    }
  }
  EXPECT_NEAR(sum, 9.80665 * testing::kBlockMass, 0.05 * 9.80665 * testing::kBlockMass) << "the block that lies, alone";
}

TEST_F(LiveSceneTest, TheDescriptionNamesWhatIsThere) {
  const LiveScene page(scene());
  const auto json = nlohmann::json::parse(page.description());
  EXPECT_EQ(json["bodies"].size(), 2u);
  EXPECT_EQ(json["models"].size(), 1u);
  EXPECT_EQ(json["models"][0]["sound"]["modes"], 0);
  EXPECT_EQ(json["joints"][0]["type"], "ball");
  EXPECT_EQ(json["joints"][0]["on"], 1);
  EXPECT_NEAR(json["joints"][0]["origin"][2], 2.0 - 0.8, 1e-12);
  EXPECT_NEAR(json["joints"][0]["load"]["mass"], testing::kBlockMass, 1e-9);
  EXPECT_EQ(json["statics"][0]["ground"], true);
  ASSERT_EQ(json["sensors"].size(), 2u);
  EXPECT_EQ(json["sensors"][1]["name"], "aside");
  const auto& points = json["sensors"][0]["points"];
  ASSERT_GE(points.size(), 24u);  // a box
  for (std::size_t i = 0; i < points.size(); i += 3) EXPECT_NEAR(std::abs(points[i + 2].get<double>()), 0.2, 1e-12);
}

}  // namespace
}  // namespace limber
