#include "limber/collision/contact_finder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "finder_scenes.h"
#include "limber/core/error.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "tuning.h"

namespace limber {
namespace {

using testing::contacts_of;
using testing::ContactScene;
using testing::heap;
using testing::Random;

constexpr double kMargin = 0.02;
constexpr double kSceneRoundOff = 1e-13;  ///< of the scenes' few metres: some hundred roundings

BodyGeometry shape(const Shape& s) { return {.model = {}, .shape = std::make_shared<const Shape>(s)}; }

std::shared_ptr<const ModalModel> bent_ball(Index modes = 6, int splits = 2) {
  return testing::wavy_model(shapes::sphere(Vec3::Zero(), 0.5, splits), modes);
}

bool same_bits(const ContactSide& s, const ContactSide& t) {
  return s.body == t.body && s.triangle == t.triangle && s.weight == t.weight && s.point_B == t.point_B;
}
bool same_bits(const std::vector<ContactPoint>& a, const std::vector<ContactPoint>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const ContactPoint& c, const ContactPoint& d) {
    return same_bits(c.a, d.a) && same_bits(c.b, d.b) && c.normal == d.normal && c.position == d.position &&
           c.gap == d.gap && c.id == d.id;
  });
}

std::set<std::uint64_t> id_set(const std::vector<ContactPoint>& contacts) {
  std::set<std::uint64_t> result;
  for (const ContactPoint& c : contacts) result.insert(c.id);
  return result;
}

/// Pairs that have contacts.
std::set<std::pair<Index, Index>> pairs(const std::vector<ContactPoint>& contacts) {
  std::set<std::pair<Index, Index>> result;
  for (const ContactPoint& c : contacts) result.insert({c.a.body, c.b.body});
  return result;
}

TEST(ContactFinder, ContactsAreWhatTheContractSays) {
  const ContactScene scene = heap(60);
  ContactFinder finder;
  scene.add_all_to(finder);
  const Vec3 origin(1.0, 2.0, 3.0);
  const auto contacts = contacts_of(finder, scene, kMargin, origin);
  ASSERT_GT(contacts.size(), 100u);
  const auto key = [](const ContactPoint& c) { return std::tuple(c.a.body, c.b.body, c.id); };
  EXPECT_TRUE(std::is_sorted(contacts.begin(), contacts.end(), [&](auto& c, auto& d) { return key(c) < key(d); }));
  EXPECT_EQ(id_set(contacts).size(), contacts.size());
  for (const ContactPoint& c : contacts) {
    EXPECT_LT(c.a.body, c.b.body);
    EXPECT_LE(c.gap, kMargin);
    EXPECT_NEAR(c.normal.norm(), 1.0, kSceneRoundOff);
    const Vec3 p_a = scene.poses[static_cast<std::size_t>(c.a.body)] * c.a.point_B;
    const Vec3 p_b = scene.poses[static_cast<std::size_t>(c.b.body)] * c.b.point_B;
    EXPECT_NEAR(c.normal.dot(p_a - p_b), c.gap, kSceneRoundOff);
    EXPECT_LT((0.5 * (p_a + p_b) - origin - c.position).norm(), kSceneRoundOff);
    for (const ContactSide* side : {&c.a, &c.b}) {
      const auto& model = scene.geometries[static_cast<std::size_t>(side->body)].model;
      EXPECT_EQ(side->triangle >= 0, model != nullptr);
      if (!model) continue;
      EXPECT_NEAR(side->weight[0] + side->weight[1] + side->weight[2], 1.0, kSceneRoundOff);
      Vec3 p = Vec3::Zero();  // r + U z at the barycentric point, by the asset's own numbers
      const ModalSurface& surface = model->collision();
      const auto& z = scene.amplitudes[static_cast<std::size_t>(side->body)];
      for (std::size_t i = 0; i < 3; ++i) {
        const Index v = surface.triangles[static_cast<std::size_t>(side->triangle)][i];
        Vec3 corner = surface.rest[static_cast<std::size_t>(v)].cast<double>();
        for (std::size_t m = 0; m < z.size(); ++m)
          corner += z[m] * surface.basis.shape(v, static_cast<Index>(m)).cast<double>();
        p += side->weight[i] * corner;
      }
      EXPECT_LT((p - side->point_B).norm(), kSceneRoundOff);
    }
  }
}

TEST(ContactFinder, ManyBodiesTogetherHaveTheContactsOfEachPairAlone) {
  const ContactScene scene = heap(40);
  ContactFinder finder;
  scene.add_all_to(finder);
  std::vector<ContactPoint> alone;
  for (std::size_t a = 0; a < scene.geometries.size(); ++a)
    for (std::size_t b = a + 1; b < scene.geometries.size(); ++b) {
      ContactFinder pair;
      pair.add_body(static_cast<Index>(a), scene.geometries[a], {});
      pair.add_body(static_cast<Index>(b), scene.geometries[b], {});
      const auto contacts = contacts_of(pair, scene, kMargin);
      alone.insert(alone.end(), contacts.begin(), contacts.end());
    }
  EXPECT_TRUE(same_bits(contacts_of(finder, scene, kMargin), alone));
}

TEST(ContactFinder, SameBitsForAnyThreadCountAndOnEveryRun) {
  ContactScene scene = heap(100);
  TbbJobs one(1), two(2), four(4);
  std::vector<std::vector<ContactPoint>> runs;
  for (Jobs* jobs : {&serial_jobs(), static_cast<Jobs*>(&one), static_cast<Jobs*>(&two), static_cast<Jobs*>(&four),
                     &serial_jobs()}) {
    ContactFinder finder;
    scene.add_all_to(finder);
    ContactScene moving = scene;
    std::vector<ContactPoint> all;
    for (int step = 0; step < 4; ++step) {
      const auto contacts = contacts_of(finder, moving, kMargin, Vec3::Zero(), *jobs);
      all.insert(all.end(), contacts.begin(), contacts.end());
      for (std::size_t i = 0; i < moving.poses.size(); ++i)
        moving.poses[i].p.x() += 0.002 * std::sin(static_cast<double>(i));
    }
    runs.push_back(std::move(all));
  }
  ASSERT_GT(runs.front().size(), 500u);
  for (const auto& run : runs) EXPECT_TRUE(same_bits(run, runs.front()));
}

TEST(ContactFinder, GapsUpToTheMarginAndBothReachesAreFound) {
  for (const double gap : {0.099, 0.101})
    for (const bool modal : {false, true}) {
      ContactScene scene;
      scene.add(HalfSpace{});
      if (modal)
        scene.add(BodyGeometry{.model = bent_ball(2), .shape = {}}, {{}, {0, 0, 0.5 + gap}}, {0.0, 0.0});
      else
        scene.add(Sphere{0.5}, {{}, {0, 0, 0.5 + gap}});
      ContactFinder finder;
      scene.add_all_to(finder);
      const bool near = gap < 0.1;
      EXPECT_EQ(!contacts_of(finder, scene, 0.1).empty(), near);
      EXPECT_TRUE(contacts_of(finder, scene, 0.0).empty());
      scene.reaches = {0.03, 0.02};
      EXPECT_EQ(!contacts_of(finder, scene, 0.05).empty(), near);
      scene.reaches = {0.1, 0.0};
      EXPECT_EQ(!contacts_of(finder, scene, 0.0).empty(), near);
    }
}

TEST(ContactFinder, AtMarginZeroWhatTouchesIsFound) {
  ContactScene scene;
  scene.add(Box{Vec3::Ones()});
  scene.add(Box{Vec3::Ones()}, {{}, {0, 0, 2.0}});  // exactly face to face
  scene.add(Sphere{1.0}, {{}, {2.0, 0, 0}});
  ContactFinder finder;
  scene.add_all_to(finder);
  const auto touching = pairs(contacts_of(finder, scene, 0.0));
  EXPECT_TRUE(touching.contains({0, 1}));
  EXPECT_TRUE(touching.contains({0, 2}));
}

TEST(ContactFinder, ABoxAtRestOnTheFloorHasItsFourCorners) {
  ContactScene scene;
  scene.add(HalfSpace{});
  scene.add(Box{{0.5, 0.4, 0.3}}, {{}, {0, 0, 0.3}});
  ContactFinder finder;
  scene.add_all_to(finder);
  const auto contacts = contacts_of(finder, scene, kMargin);
  ASSERT_EQ(contacts.size(), 4u);
  Vec3 sum = Vec3::Zero();
  for (const ContactPoint& c : contacts) {
    EXPECT_NEAR(std::abs(c.position.x()), 0.5, kSceneRoundOff);
    EXPECT_NEAR(std::abs(c.position.y()), 0.4, kSceneRoundOff);
    EXPECT_NEAR(c.gap, 0.0, kSceneRoundOff);
    EXPECT_LT((c.normal + Vec3::UnitZ()).norm(), kSceneRoundOff);  // a is the floor: it is pushed down
    sum += c.position;
  }
  EXPECT_LT(sum.norm(), kSceneRoundOff);
}

TEST(ContactFinder, OnlySleepersBesideAwakeBodiesAreLookedAt) {
  ContactScene scene;
  for (int i = 0; i < 4; ++i)
    scene.add(BodyGeometry{.model = bent_ball(2), .shape = {}}, {{}, {0.95 * i, 0, 0}}, {0.0, 0.0});
  ContactFinder finder;
  scene.add_all_to(finder);
  EXPECT_EQ(pairs(contacts_of(finder, scene, kMargin)).size(), 3u);
  scene.asleep = {true, true, true, false};
  const std::set<std::pair<Index, Index>> last_pair{{2, 3}};
  EXPECT_EQ(pairs(contacts_of(finder, scene, kMargin)), last_pair);
  EXPECT_EQ(pairs(contacts_of(finder, scene, kMargin)), last_pair);
  scene.asleep = {true, true, true, true};
  EXPECT_TRUE(contacts_of(finder, scene, kMargin).empty());
  scene.asleep = {false, true, true, true};
  EXPECT_EQ(pairs(contacts_of(finder, scene, kMargin)), (std::set<std::pair<Index, Index>>{{0, 1}}));
}

TEST(ContactFinder, ContactsOfASleeperAreThoseItHadAwake) {
  ContactScene scene = heap(30);
  ContactFinder finder;
  scene.add_all_to(finder);
  const auto awake = contacts_of(finder, scene, kMargin);
  for (std::size_t i = 0; i < scene.asleep.size(); ++i) scene.asleep[i] = i % 2 == 0;
  std::vector<ContactPoint> expected;
  std::copy_if(awake.begin(), awake.end(), std::back_inserter(expected),
               [](const ContactPoint& c) { return c.a.body % 2 == 1 || c.b.body % 2 == 1; });
  for (int twice = 0; twice < 2; ++twice) EXPECT_TRUE(same_bits(contacts_of(finder, scene, kMargin), expected));
}

TEST(ContactFinder, FiltersAndExcludedPairsAreObeyed) {
  ContactScene scene;
  for (int i = 0; i < 3; ++i) scene.add(Sphere{0.5}, {{}, {0.1 * i, 0, 0}});
  ContactFinder finder;
  scene.add_all_to(finder);
  EXPECT_EQ(pairs(contacts_of(finder, scene, 0.0)).size(), 3u);
  finder.exclude_pair(0, 1, true);
  EXPECT_FALSE(pairs(contacts_of(finder, scene, 0.0)).contains({0, 1}));
  finder.set_filter(2, {.layers = 2, .mask = 2});
  EXPECT_TRUE(contacts_of(finder, scene, 0.0).empty());
  finder.exclude_pair(0, 1, false);
  EXPECT_EQ(pairs(contacts_of(finder, scene, 0.0)), (std::set<std::pair<Index, Index>>{{0, 1}}));
}

/// A block bent so far that its two ends meet: mode 0 of a flat bar rolls it up.
std::shared_ptr<const ModalModel> curling_bar() {
  SurfaceMesh bar;  // a strip of boxes: 41 cross-sections along x
  for (int i = 0; i <= 40; ++i)
    for (int corner = 0; corner < 4; ++corner)
      bar.vertices.emplace_back(0.1 * i - 2.0, corner == 0 || corner == 3 ? -0.1 : 0.1, corner < 2 ? -0.02 : 0.02);
  const auto quad = [&](Index a, Index b, Index c, Index d) {
    bar.triangles.push_back({a, b, c});
    bar.triangles.push_back({a, c, d});
  };
  for (Index i = 0; i < 40; ++i)
    for (Index c = 0; c < 4; ++c) quad(4 * i + c, 4 * i + (c + 1) % 4, 4 * i + 4 + (c + 1) % 4, 4 * i + 4 + c);
  quad(3, 2, 1, 0);
  quad(160, 161, 162, 163);
  ModalModelData data = testing::wavy_data(bar, 1);
  for (Index v = 0; v < static_cast<Index>(bar.vertices.size()); ++v) {  // unit amplitude: once around a circle
    const Vec3 r = bar.vertices[static_cast<std::size_t>(v)];
    const double angle = r.x() / 2.0 * 3.1, radius = 2.0 / 3.1;
    const Vec3 curled((radius - r.z()) * std::sin(angle), r.y(), radius - (radius - r.z()) * std::cos(angle));
    data.render.basis.set(v, 0, (curled - r).cast<float>());
  }
  return std::make_shared<const ModalModel>(std::move(data));
}

TEST(ContactFinder, ABodyTouchesItselfOnlyIfAsked) {
  ContactScene scene;
  scene.add(BodyGeometry{.model = curling_bar(), .shape = {}}, {}, {0.0});
  ContactFinder finder;
  finder.add_body(0, scene.geometries[0], {.self = true});
  EXPECT_TRUE(contacts_of(finder, scene, 0.3).empty());
  scene.amplitudes[0] = {1.0};
  const auto contacts = contacts_of(finder, scene, 0.3);
  ASSERT_FALSE(contacts.empty());
  for (const ContactPoint& c : contacts) {
    EXPECT_EQ(c.a.body, 0);
    EXPECT_EQ(c.b.body, 0);
    EXPECT_GT(std::abs(c.a.point_B.x() - c.b.point_B.x()), 0.01);  // of the two ends
    EXPECT_GT(c.position.z(), 1.0);                                // at the top of the circle
  }
  scene.asleep = {true};
  EXPECT_TRUE(contacts_of(finder, scene, 0.3).empty());
  scene.asleep = {false};
  finder.set_filter(0, {});
  EXPECT_TRUE(contacts_of(finder, scene, 0.3).empty());
}

TEST(ContactFinder, AMillionMetresFromTheOriginContactsAreTheSame) {
  ContactScene scene = heap(40);
  ContactFinder near_finder, far_finder;
  scene.add_all_to(near_finder);
  scene.add_all_to(far_finder);
  ContactScene far = scene;
  const Vec3 offset(1048576.0, -1048576.0, 524288.0);
  for (std::size_t i = 0; i < far.poses.size(); ++i) {
    far.poses[i].p += offset;
    scene.poses[i].p = far.poses[i].p - offset;  // exact: the same places, to the bit
  }
  const auto at_origin = contacts_of(near_finder, scene, kMargin);
  const auto far_away = contacts_of(far_finder, far, kMargin, offset);
  // Relative places of two bodies are exact here; the floor's offset n·p takes one rounding of 1e6 m.
  constexpr double kFarRounding = 1e-9;
  ASSERT_EQ(at_origin.size(), far_away.size());
  for (std::size_t i = 0; i < far_away.size(); ++i) {
    EXPECT_EQ(far_away[i].id, at_origin[i].id);
    EXPECT_NEAR(far_away[i].gap, at_origin[i].gap, kFarRounding);
    EXPECT_LT((far_away[i].position - at_origin[i].position).norm(), kFarRounding);
    EXPECT_LT((far_away[i].normal - at_origin[i].normal).norm(), kFarRounding);
  }
}

TEST(ContactFinder, BodiesInTheSamePlaceGiveFiniteContactsInBoundedNumber) {
  ContactScene scene;
  const auto ball = bent_ball();
  for (int i = 0; i < 3; ++i) scene.add(BodyGeometry{.model = ball, .shape = {}}, {}, std::vector<double>(6, 0.01));
  for (int i = 0; i < 3; ++i) scene.add(Box{Vec3::Ones()});
  for (int i = 0; i < 2; ++i) scene.add(Sphere{});
  ContactFinder finder;
  scene.add_all_to(finder);
  for (const ContactPoint& c : contacts_of(finder, scene, 0.01)) {
    EXPECT_TRUE(std::isfinite(c.gap) && c.position.allFinite());
    EXPECT_NEAR(c.normal.norm(), 1.0, kSceneRoundOff);
  }
}

TEST(ContactFinder, AmplitudesThatTurnABodyInsideOutGiveFiniteContacts) {
  ContactScene scene = heap(12);
  ContactFinder finder;
  scene.add_all_to(finder);
  for (const double size : {1.0, 100.0, 1e6}) {
    Random random(3);
    for (auto& z : scene.amplitudes)
      if (!z.empty()) z = random.amplitudes(static_cast<Index>(z.size()), size);
    for (const ContactPoint& c : contacts_of(finder, scene, kMargin)) {
      EXPECT_TRUE(std::isfinite(c.gap) && c.position.allFinite());
      EXPECT_NEAR(c.normal.norm(), 1.0, 1e-9);
    }
  }
}

TEST(ContactFinder, BodiesComeAndGoAndIndicesAreUsedAgain) {
  ContactScene scene;
  scene.add(Box{Vec3::Ones()});
  scene.add(Sphere{1.0}, {{}, {0, 0, 1.9}});
  ContactFinder finder;
  scene.add_all_to(finder);
  finder.exclude_pair(0, 1, true);
  EXPECT_TRUE(contacts_of(finder, scene, 0.0).empty());
  finder.remove_body(1);
  EXPECT_TRUE(contacts_of(finder, scene, 0.0).empty());
  scene.geometries[1] = {.model = bent_ball(3), .shape = {}};
  scene.amplitudes[1] = {0.0, 0.0, 0.0};
  scene.poses[1].p.z() = 1.45;
  finder.add_body(1, scene.geometries[1], {});  // the exclusion is forgotten
  EXPECT_FALSE(contacts_of(finder, scene, 0.0).empty());
  finder.remove_body(0);
  finder.remove_body(1);
  EXPECT_TRUE(contacts_of(finder, scene, 0.0).empty());
}

TEST(ContactFinder, IdsStayWhileABodySlidesAndBends) {
  // 1 mm and a hundredth of its bend each step; the same corners and vertices touch, so the same ids.
  ContactScene scene;
  scene.add(HalfSpace{});
  scene.add(Box{{0.5, 0.4, 0.3}}, {{}, {0, 0, 0.3}});
  scene.add(BodyGeometry{.model = bent_ball(4), .shape = {}}, {{}, {2, 0, 0.45}}, {0.01, 0.02, 0.0, 0.01});
  ContactFinder finder;
  scene.add_all_to(finder);
  auto last = id_set(contacts_of(finder, scene, kMargin));
  std::size_t stayed = 0, all = 0;
  for (int step = 0; step < 100; ++step) {
    scene.poses[1].p.x() += 0.001;
    scene.poses[2].p.x() += 0.001;
    scene.poses[2].q = quaternion_from_rotation_vector({0.0, 0.0, 0.002 * step});
    for (double& z : scene.amplitudes[2]) z *= 1.01;
    const auto now = id_set(contacts_of(finder, scene, kMargin));
    all += now.size();
    stayed += static_cast<std::size_t>(
        std::count_if(now.begin(), now.end(), [&](std::uint64_t id) { return last.contains(id); }));
    last = now;
  }
  EXPECT_GE(all, 700u);
  EXPECT_GE(static_cast<double>(stayed), 0.97 * static_cast<double>(all));
}

TEST(ContactFinder, WrongStatesAreRefusedByNameAndChangeNothing) {
  ContactScene scene;
  scene.add(HalfSpace{});
  scene.add(BodyGeometry{.model = bent_ball(3), .shape = {}}, {{}, {0, 0, 0.49}}, {0.0, 0.01, 0.0});
  ContactFinder finder;
  scene.add_all_to(finder);
  const auto good = contacts_of(finder, scene, kMargin);
  ASSERT_FALSE(good.empty());

  const double nan = std::nan("");
  const auto expect_refused = [&](const char* member, const std::function<void(ContactScene&)>& spoil) {
    ContactScene wrong = scene;
    spoil(wrong);
    auto contacts = good;
    try {
      finder.find_contacts({.states = wrong.states(), .margin = kMargin}, contacts, serial_jobs());
      ADD_FAILURE() << member << " was not refused";
    } catch (const InvalidArgument& e) {
      EXPECT_THAT(e.what(), ::testing::HasSubstr(member));
      EXPECT_THAT(e.what(), ::testing::HasSubstr("body 1"));
    }
    EXPECT_TRUE(same_bits(contacts, good));
    EXPECT_TRUE(same_bits(contacts_of(finder, scene, kMargin), good));
  };
  expect_refused("pose.p", [&](auto& s) { s.poses[1].p.y() = nan; });
  expect_refused("pose.q", [&](auto& s) { s.poses[1].q.w = nan; });
  expect_refused("pose.q", [&](auto& s) { s.poses[1].q.w = 0.0; });
  expect_refused("amplitudes[2]", [&](auto& s) { s.amplitudes[1][2] = nan; });
  expect_refused("amplitudes", [&](auto& s) { s.amplitudes[1].pop_back(); });
  expect_refused("amplitudes", [&](auto& s) { s.amplitudes[1][0] = 1e300; });
  expect_refused("reach", [&](auto& s) { s.reaches[1] = -1.0; });
  expect_refused("pose.p", [&](auto& s) { s.asleep[1] = true, s.poses[1].p.x() = nan; });

  std::vector<ContactPoint> contacts;
  const auto& states = scene.states();
  EXPECT_THROW(finder.find_contacts({.states = states, .margin = nan}, contacts, serial_jobs()), InvalidArgument);
  EXPECT_THROW(finder.find_contacts({.states = states, .margin = -1.0}, contacts, serial_jobs()), InvalidArgument);
  EXPECT_THROW(finder.find_contacts({.states = std::span(states).first(1)}, contacts, serial_jobs()), InvalidArgument);
}

TEST(ContactFinder, WrongBodiesAreRefused) {
  ContactFinder finder;
  finder.add_body(2, shape(Sphere{}), {});
  EXPECT_THROW(finder.add_body(2, shape(Sphere{}), {}), InvalidArgument);
  EXPECT_THROW(finder.add_body(-1, shape(Sphere{}), {}), InvalidArgument);
  EXPECT_THROW(finder.add_body(3, {}, {}), InvalidArgument);
  EXPECT_THROW(finder.add_body(3, {.model = bent_ball(), .shape = shape(Sphere{}).shape}, {}), InvalidArgument);
  EXPECT_THROW(finder.add_body(3, shape(Sphere{-1.0}), {}), InvalidArgument);
  EXPECT_THROW(finder.remove_body(3), InvalidArgument);
  EXPECT_THROW(finder.set_filter(0, {}), InvalidArgument);
  EXPECT_THROW(finder.exclude_pair(2, 2, true), InvalidArgument);
  EXPECT_THROW(finder.exclude_pair(2, 3, true), InvalidArgument);
}

}  // namespace
}  // namespace limber
