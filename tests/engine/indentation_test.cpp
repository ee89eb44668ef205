// What contacts press in beyond the kept modes, on what is drawn.
#include <gtest/gtest.h>

#include <cmath>

#include "counted_new.h"
#include "grounded_world.h"

namespace limber::testing {
namespace {

/// Half of its modes are kept and the others answer as residual compliance; or all are kept.
SampleOptions few_modes(double hz) {
  return {.modes = 6, .dropped = 14, .lowest_hz = hz, .decay = std::numbers::pi * hz};
}
SampleOptions all_modes(double hz) { return {.modes = 20, .lowest_hz = hz, .decay = std::numbers::pi * hz}; }
constexpr double kSoft = 3.0;  // Hz: a box that gives by a thousandth of itself under its weight

/// Told that nothing of it yields beside its modes, so that contacts give as little by themselves as where something
/// does.
std::shared_ptr<const ModalModel> stiff(const SampleOptions& sample) {
  ModalModelData data = sample_model_data(sample);
  data.residual_compliance = ResidualCompliance(ResidualCompliance::Form::kFull, data.render.vertices());
  return std::make_shared<const ModalModel>(std::move(data));
}

/// A body on the ground, without friction, so that nothing is wedged.
struct Lying {
  explicit Lying(const std::shared_ptr<const ModalModel>& model)
      : scene(exactly({.friction = 0.0})),
        body(scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model)}}})) {}
  std::vector<float> drawn(double interpolation = 1.0) const {
    std::vector<float> positions(3 * static_cast<std::size_t>(scene.world.model(body).render().vertices()));
    scene.world.reconstruct(body, positions, {}, interpolation);
    return positions;
  }
  GroundedWorld scene;
  BodyId body;
};

double farthest_apart(const std::vector<float>& a, const std::vector<float>& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, static_cast<double>(std::abs(a[i] - b[i])));
  return most;
}

double largest_height_between(const std::vector<float>& a, const std::vector<float>& b) {
  double most = 0.0;
  for (std::size_t i = 2; i < a.size(); i += 3) most = std::max(most, static_cast<double>(std::abs(a[i] - b[i])));
  return most;
}

/// A box of 6 modes whose other 14 answer as residual compliance looks like one with all 20. (In height: nothing holds
/// it sideways. Forces act where the modes take their points, so softer boxes differ by what that is off.)
TEST(Indentations, ShowWhatTheDroppedModesWould) {
  // m: positions of half a metre in single precision, and what a contact yields by itself (1e-4 g Δt²).
  constexpr double kFloat = 2e-7, kGive = 3e-7;
  constexpr double kHz = 10.0;
  SampleOptions dropped = few_modes(kHz);
  dropped.dropped = 0;
  Lying few(sample_model(few_modes(kHz))), without(stiff(dropped)), all(stiff(all_modes(kHz)));
  for (Lying* lying : {&few, &without, &all}) lying->scene.step(300);
  EXPECT_GT(largest_height_between(without.drawn(), all.drawn()), 50.0 * (kFloat + kGive));
  EXPECT_LT(largest_height_between(few.drawn(), all.drawn()), kFloat + kGive);
  EXPECT_GT(lowest(few.scene.world, few.body), -kFloat - kGive);
}

/// What is drawn, less what the modes show, is indentation(), between two states too.
TEST(Indentations, AreWhatIsDrawnBesideTheModes) {
  constexpr double kFloat = 2e-7;
  Lying lying(sample_model(few_modes(kSoft)));
  World& world = lying.scene.world;
  lying.scene.step(3);  // still coming down on its indentations
  const auto indentation_of = [&](Index vertex) {
    const ModalSurface& surface = world.model(lying.body).render();
    SurfacePoint at{.surface = SurfacePoint::Surface::kRender, .weight = {0.0, 0.0, 0.0}};
    while (surface.triangles[static_cast<std::size_t>(at.triangle)][0] != vertex &&
           surface.triangles[static_cast<std::size_t>(at.triangle)][1] != vertex &&
           surface.triangles[static_cast<std::size_t>(at.triangle)][2] != vertex)
      ++at.triangle;
    for (std::size_t i = 0; i < 3; ++i)
      at.weight[i] = surface.triangles[static_cast<std::size_t>(at.triangle)][i] == vertex ? 1.0 : 0.0;
    return std::pair<Vec3, Vec3>(world.position(lying.body, at), world.indentation(lying.body, at));
  };
  std::vector<std::pair<Vec3, Vec3>> before, now;
  for (Index v = 0; v < 8; ++v) before.push_back(indentation_of(v));
  world.step();
  for (Index v = 0; v < 8; ++v) now.push_back(indentation_of(v));
  const std::vector<float> newest = lying.drawn(), between = lying.drawn(0.25);
  double deepest = 0.0, change = 0.0;
  for (std::size_t v = 0; v < 8; ++v) {
    const Vec3 shown(newest[3 * v], newest[3 * v + 1], newest[3 * v + 2]);
    EXPECT_LT((shown - now[v].first - now[v].second).norm(), kFloat);
    const Vec3 mixed = 0.25 * (now[v].first + now[v].second) + 0.75 * (before[v].first + before[v].second);
    // The box does not turn here, so that all of it goes in straight lines between two states.
    EXPECT_LT((Vec3(between[3 * v], between[3 * v + 1], between[3 * v + 2]) - mixed).norm(), kFloat);
    deepest = std::max(deepest, now[v].second.norm());
    change = std::max(change, (now[v].second - before[v].second).norm());
  }
  EXPECT_GT(deepest, 10.0 * kFloat);
  EXPECT_GT(change, 10.0 * kFloat);
}

/// A render surface of its own goes with the surface that touches.
TEST(Indentations, MoveARenderSurfaceWithTheCollisionSurface) {
  ModalModelData data = sample_model_data(few_modes(kSoft));
  data.collision = sample_model_data(few_modes(kSoft)).render;
  Lying separate(std::make_shared<const ModalModel>(std::move(data))), one(sample_model(few_modes(kSoft)));
  separate.scene.step(100), one.scene.step(100);
  EXPECT_LT(farthest_apart(separate.drawn(), one.drawn()), 1e-7);
}

TEST(Indentations, GoWithTheirBodyAndWithTheContacts) {
  Lying lying(sample_model(few_modes(kSoft)));
  World& world = lying.scene.world;
  const SurfacePoint at{.weight = {1.0, 0.0, 0.0}};
  lying.scene.step(60);
  EXPECT_GT(world.indentation(lying.body, at).norm(), 1e-6);
  world.remove_body(lying.body);
  lying.body = world.add_body(sample_model(few_modes(kSoft)), {.pose = {{}, {0.0, 0.0, 5.0}}});  // in the other's place
  EXPECT_EQ(world.indentation(lying.body, at), Vec3(Vec3::Zero()));
  const std::vector<float> newest = lying.drawn(), between = lying.drawn(0.5);
  EXPECT_EQ(newest, between);
  const BodyId plain = world.add_body(sample_model({}));
  EXPECT_EQ(world.indentation(plain, at), Vec3(Vec3::Zero()));
}

TEST(Indentations, AreDrawnWithoutAllocationOnceWarm) {
  Lying lying(sample_model(few_modes(kSoft)));
  lying.scene.step(60);
  std::vector<float> positions = lying.drawn(0.5), normals(positions.size());
  const long before = allocations();
  for (int i = 0; i < 10; ++i) lying.scene.world.reconstruct(lying.body, positions, normals, 0.5);
  EXPECT_EQ(allocations() - before, 0);
}

}  // namespace
}  // namespace limber::testing
