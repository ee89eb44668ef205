// What sleeps is not looked at: neither by the world's own loops nor by the source of contacts.
#include <gtest/gtest.h>

#include <algorithm>

#include "grounded_world.h"
#include "limber/core/stage_times.h"

namespace limber::testing {
namespace {

/// Asks a finder with the world's hint and another one without, and compares all that they find.
class ComparedSource final : public ContactSource {
 public:
  void add_body(Index body, const BodyGeometry& geometry, const CollisionFilter& filter) override {
    hinted_.add_body(body, geometry, filter);
    plain_.add_body(body, geometry, filter);
  }
  void remove_body(Index body) override { hinted_.remove_body(body), plain_.remove_body(body); }
  void set_filter(Index body, const CollisionFilter& filter) override {
    hinted_.set_filter(body, filter), plain_.set_filter(body, filter);
  }
  void exclude_pair(Index a, Index b, bool excluded) override {
    hinted_.exclude_pair(a, b, excluded), plain_.exclude_pair(a, b, excluded);
  }
  void find_contacts(const ContactQuery& query, std::vector<ContactPoint>& contacts, Jobs& jobs) override {
    ContactQuery without = query;
    without.awake = {};
    plain_.find_contacts(without, others_, jobs);
    hinted_.find_contacts(query, contacts, jobs);
    ++queries;
    if (!query.awake.empty()) ++hints;
    largest_hint = std::max(largest_hint, query.awake.size());
    EXPECT_EQ(contacts.size(), others_.size());
    for (std::size_t i = 0; i < std::min(contacts.size(), others_.size()); ++i) {
      EXPECT_EQ(contacts[i].id, others_[i].id);
      EXPECT_EQ(contacts[i].gap, others_[i].gap);
    }
  }
  void save_state(StateWriter& state) const override { hinted_.save_state(state); }
  void restore_state(StateReader& state) override { hinted_.restore_state(state); }

  int queries = 0, hints = 0;
  std::size_t largest_hint = 0;

 private:
  ContactFinder hinted_, plain_;
  std::vector<ContactPoint> others_;
};

/// Twelve boxes asleep on the ground, and one that hops about among them.
struct Sleepers {
  static constexpr int kSleepers = 12;
  ComparedSource source;
  World world{{.sleep = {.enabled = true, .time = 0.1, .speed = 0.01}}};
  std::vector<BodyId> boxes;

  explicit Sleepers(const ContactOptions& options = {}) {
    world.set_contact_source(&source, options);
    world.add_static(std::make_shared<Shape>(HalfSpace{}));
    const auto model = damped_box(4, 60.0);
    for (int i = 0; i <= kSleepers; ++i)
      boxes.push_back(world.add_body(model, {.pose = {{}, {1.0 * i, 0.0, depth_below_origin(*model)}}}));
    for (int n = 0; n < 120; ++n) shake();
  }
  void shake() {
    world.apply_force(boxes.back(), {.triangle = 0}, {0.0, 0.0, 0.1});
    world.step();
  }
  int asleep() const {
    return static_cast<int>(std::count_if(boxes.begin(), boxes.end(), [&](BodyId b) { return world.is_asleep(b); }));
  }
};

TEST(Sleepers, AreNotShownToTheSourceOfContactsAgain) {
  Sleepers scene;
  ASSERT_EQ(scene.asleep(), Sleepers::kSleepers);
  scene.source.queries = scene.source.hints = 0;
  scene.source.largest_hint = 0;
  for (int n = 0; n < 30; ++n) scene.shake();
  EXPECT_EQ(scene.source.hints, scene.source.queries);
  EXPECT_EQ(scene.source.largest_hint, 1u);
}

TEST(Sleepers, CountForNothingInTheStagesOfAStep) {
  Sleepers scene(exactly());
  StageTimes times;
  scene.world.set_stage_times(&times);
  scene.shake();
  EXPECT_EQ(times[Stage::kLookAhead].units, 1);
  EXPECT_EQ(times[Stage::kAdvance].units + times[Stage::kCommit].units, 1);
}

TEST(Sleepers, ThatAreMetWakeAndAreFoundAsWithoutTheHint) {
  Sleepers scene;
  // Thrown along the row: it knocks at one after the other, and all is compared in every query.
  scene.world.set_velocity(scene.boxes.back(), {-6.0, 0.0, 1.0}, {0.0, 1.0, 0.0});
  int fewest = Sleepers::kSleepers;
  for (int n = 0; n < 90; ++n) {
    scene.world.step();
    fewest = std::min(fewest, scene.asleep());
  }
  EXPECT_LT(fewest, Sleepers::kSleepers - 1);
  for (int n = 0; n < 600 && scene.asleep() <= Sleepers::kSleepers; ++n) scene.world.step();
  EXPECT_EQ(scene.asleep(), Sleepers::kSleepers + 1);
}

TEST(Sleepers, KeepTheEnergyOfTheirContactsAndTellOfTheirEndWhenTheyWake) {
  Sleepers scene;
  const BodyId first = scene.boxes.front();
  const double before = scene.world.energy(first).total();
  for (int n = 0; n < 30; ++n) scene.shake();
  EXPECT_EQ(scene.world.energy(first).total(), before);
  scene.world.set_pose(first, {{}, {0.0, 0.0, 3.0}});
  scene.world.step();
  const auto index = static_cast<Index>(first.index);
  const auto ended = std::ranges::count_if(scene.world.contact_events(), [&](const ContactEvent& e) {
    return (e.a == index || e.b == index) && e.phase == ContactPhase::kEnded;
  });
  EXPECT_GE(ended, 3);
  for (const ContactEvent& e : scene.world.contact_events())
    EXPECT_TRUE(e.phase != ContactPhase::kEnded || e.a == index || e.b == index);
}

}  // namespace
}  // namespace limber::testing
