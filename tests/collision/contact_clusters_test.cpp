#include "limber/collision/contact_clusters.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "constants.h"
#include "counted_new.h"
#include "limber/core/error.h"
#include "scoped_value.h"
#include "tuning.h"

namespace limber {
namespace {

using testing::kInfinity;

constexpr double kSas = 2.0 / std::numbers::pi;  ///< of a convex region's area, in some quadrilateral in it
constexpr double kRoundOff = 1e-12;

ContactPoint contact(std::uint64_t id, const Vec3& position, double gap = 0.0, const Vec3& normal = Vec3::UnitZ()) {
  ContactPoint c;
  c.a.body = 0;
  c.b.body = 1;
  c.normal = normal;
  c.position = position;
  c.gap = gap;
  c.id = id;
  return c;
}

double cross(const Vec3& a, const Vec3& b, const Vec3& c) { return (b - a).cross(c - a).z(); }

/// Convex hull in the xy plane by gift wrapping: another way than the code's.
std::vector<Vec3> hull(const std::vector<ContactPoint>& contacts) {
  std::vector<Vec3> result;
  const auto lowest = std::min_element(contacts.begin(), contacts.end(), [](const auto& a, const auto& b) {
    return std::pair(a.position.x(), a.position.y()) < std::pair(b.position.x(), b.position.y());
  });
  Vec3 corner = lowest->position;
  do {
    result.push_back(corner);
    Vec3 next = corner;
    for (const ContactPoint& c : contacts) {
      const double turn = cross(corner, next, c.position);
      if (next == corner || turn < 0.0 || (turn == 0.0 && (c.position - corner).norm() > (next - corner).norm()))
        next = c.position;
    }
    corner = next;
  } while (corner != lowest->position && result.size() <= contacts.size());
  return result;
}

double area(const std::vector<Vec3>& polygon) {
  double sum = 0.0;
  for (std::size_t i = 2; i < polygon.size(); ++i) sum += 0.5 * cross(polygon[0], polygon[i - 1], polygon[i]);
  return sum;
}
double area(const std::vector<ContactPoint>& contacts) { return area(hull(contacts)); }

bool contains(const std::vector<ContactPoint>& contacts, const Vec3& point) {
  const auto corners = hull(contacts);
  for (std::size_t i = 0; i < corners.size(); ++i)
    if (cross(corners[i], corners[(i + 1) % corners.size()], point) < -kRoundOff) return false;
  return corners.size() >= 3;
}

Vec3 mean(const std::vector<ContactPoint>& contacts) {
  Vec3 sum = Vec3::Zero();
  for (const ContactPoint& c : contacts) sum += c.position;
  return sum / static_cast<double>(contacts.size());
}

std::vector<ContactPoint> reduced(std::vector<ContactPoint> contacts, const ContactClusterOptions& options = {},
                                  double radius = kInfinity, std::span<const std::uint64_t> previous = {}) {
  ContactClusters clusters(options);
  clusters.reduce(contacts, 0, {.length = radius}, previous);
  return contacts;
}

std::vector<std::uint64_t> ids(const std::vector<ContactPoint>& contacts) {
  std::vector<std::uint64_t> result;
  for (const ContactPoint& c : contacts) result.push_back(c.id);
  return result;
}

/// Even samples of a region: uniform pressure.
template <class Inside>
std::vector<ContactPoint> samples(const Inside& inside, double spacing = 0.0625) {
  std::vector<ContactPoint> result;
  for (double x = -2.0; x <= 2.0; x += spacing)
    for (double y = -2.0; y <= 2.0; y += spacing)
      if (inside(x, y)) result.push_back(contact(result.size(), {x, y, 0.0}));
  return result;
}

struct Region {
  const char* name;
  bool (*inside)(double x, double y);
};
constexpr Region kRegions[] = {
    {"square", [](double x, double y) { return std::abs(x) <= 1 && std::abs(y) <= 1; }},
    {"strip", [](double x, double y) { return std::abs(x) <= 2 && std::abs(y) <= 0.125; }},
    {"disc", [](double x, double y) { return x * x + y * y <= 1; }},
    {"half disc", [](double x, double y) { return x * x + y * y <= 2.25 && y >= 0; }},
    {"ellipse", [](double x, double y) { return x * x / 4 + y * y <= 1; }},
    {"ring", [](double x, double y) { return x * x + y * y <= 1 && x * x + y * y >= 0.64; }},
    {"triangle", [](double x, double y) { return x >= -1 && y >= -1 && x + y <= 0.5; }},
    {"trapezium", [](double x, double y) { return std::abs(y) <= 1 && std::abs(x) <= 1 - 0.5 * y; }},
    {"hexagon", [](double x, double y) { return std::abs(y) <= 0.875 && std::abs(x) + std::abs(y) / 1.75 <= 1; }},
    {"cross",
     [](double x, double y) {
       return (std::abs(x) <= 0.25 || std::abs(y) <= 0.25) && std::abs(x) + std::abs(y) <= 1.5;
     }},
    {"ell", [](double x, double y) { return x >= -1 && y >= -1 && x <= 1 && y <= 1 && (x <= -0.5 || y <= -0.5); }},
};

TEST(ContactClusters, UniformPressureOnCommonPatchesIsCarriedByTheFourContactsKept) {
  for (const Region& region : kRegions) {
    const auto all = samples(region.inside);
    const auto kept = reduced(all);
    EXPECT_LE(kept.size(), 4u) << region.name;
    EXPECT_TRUE(contains(kept, mean(all))) << region.name;
    EXPECT_GE(area(kept), kSas * area(all)) << region.name;
  }
}

TEST(ContactClusters, TheLargestPolygonOnThreeOrFourCornersIsThatOfBruteForce) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<ContactPoint> all;
    for (std::uint64_t i = 0; i < 24; ++i) {
      const Vec3 p(normal(random), normal(random), 0.0);
      all.push_back(contact(i, trial % 2 == 0 ? p : Vec3(p.normalized())));  // on a circle all are corners
    }
    double triangle = 0.0, quadrilateral = 0.0;
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        for (std::size_t k = 0; k < j; ++k) {
          triangle = std::max(triangle, 0.5 * std::abs(cross(all[i].position, all[j].position, all[k].position)));
          for (std::size_t l = 0; l < k; ++l)
            quadrilateral = std::max(quadrilateral, area({all[i], all[j], all[k], all[l]}));
        }
    EXPECT_NEAR(area(reduced(all, {.max_points = 3})), triangle, kRoundOff * triangle);
    EXPECT_NEAR(area(reduced(all)), quadrilateral, kRoundOff * quadrilateral);
  }
}

TEST(ContactClusters, MoreCornersSpanMoreAndNeverMoreThanAskedFor) {
  std::vector<ContactPoint> circle;
  for (std::uint64_t i = 0; i < 500; ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i) / 500.0;
    circle.push_back(contact(i, {std::cos(angle), std::sin(angle), 0.0}));
  }
  double last = 0.0;
  for (int n = 3; n <= 12; ++n) {
    const auto kept = reduced(circle, {.max_points = n});
    EXPECT_EQ(kept.size(), static_cast<std::size_t>(n));
    EXPECT_GT(area(kept), last);
    last = area(kept);
  }
  EXPECT_EQ(reduced(circle, {.max_points = 0}).size(), 500u);
  EXPECT_EQ(reduced(circle, {.max_points = 2}).size(), 2u);
}

TEST(ContactClusters, AContactDeeperThanTheRestByMoreThanTheToleranceIsKept) {
  // A ball on a plane, pressed in: the deepest is near the middle.
  std::vector<ContactPoint> ball;
  std::mt19937 random(2);
  std::uniform_real_distribution<double> place(-1.0, 1.0);
  for (std::uint64_t i = 0; i < 200; ++i) {
    const Vec3 p(place(random), place(random), 0.0);
    ball.push_back(contact(i, p, 0.1 * p.squaredNorm()));
  }
  ball[77].gap = -0.01;
  for (const int n : {1, 2, 3, 4, 6}) {
    const auto kept = ids(reduced(ball, {.max_points = n}));
    EXPECT_EQ(kept.size(), static_cast<std::size_t>(n));
    EXPECT_TRUE(std::binary_search(kept.begin(), kept.end(), 77)) << n;
  }
}

TEST(ContactClusters, ALyingCylinderKeepsTheEndsOfItsLine) {
  // Facets beside the line are nearly as near and span far more: they must not displace it.
  std::vector<ContactPoint> cylinder;
  for (int i = 0; i <= 20; ++i)
    for (int side = -1; side <= 1; ++side)
      cylinder.push_back(contact(cylinder.size(), {0.1 * i, 0.2 * side, 0.0}, side == 0 ? 1e-9 * (i % 7) : 0.005));
  const auto kept = reduced(cylinder);
  EXPECT_EQ(kept.size(), 4u);
  for (const double end : {0.0, 2.0})
    EXPECT_TRUE(std::any_of(kept.begin(), kept.end(), [&](const ContactPoint& c) {
      return c.position.y() == 0.0 && std::abs(c.position.x() - end) < kRoundOff;
    })) << end;
}

TEST(ContactClusters, OutcomeDoesNotDependOnTheOrderOfContacts) {
  auto contacts = samples(kRegions[2].inside, 0.125);
  for (ContactPoint& c : contacts) c.gap = 1e-4 * static_cast<double>(c.id * 37 % 11);
  const auto expected = ids(reduced(contacts, {}, 0.7));
  EXPECT_TRUE(std::is_sorted(expected.begin(), expected.end()));
  std::mt19937 random(3);
  for (int trial = 0; trial < 20; ++trial) {
    std::shuffle(contacts.begin(), contacts.end(), random);
    EXPECT_EQ(ids(reduced(contacts, {}, 0.7)), expected);
  }
}

TEST(ContactClusters, SidesOfUnlikeNormalsArePatchesOfTheirOwn) {
  std::vector<ContactPoint> contacts;
  for (const double foot : {0.0, 10.0})
    for (int i = 0; i < 25; ++i)
      contacts.push_back(contact(contacts.size(), {foot + 0.1 * (i % 5), 0.1 * (i / 5), 0.0}));
  for (int i = 0; i < 25; ++i)
    contacts.push_back(contact(contacts.size(), {0.0, 0.1 * (i % 5), 0.1 * (i / 5)}, 0.0, Vec3::UnitX()));
  EXPECT_EQ(reduced(contacts).size(), 8u);
  const testing::ScopedValue wide(internal::collision_tuning_in_use.clusters.normal_angle, 0.5 * std::numbers::pi);
  EXPECT_EQ(reduced(contacts).size(), 8u);
}

TEST(ContactClusters, WhatLiesBetweenCornersIsCoveredToTheSpacing) {
  constexpr double kSpacing = 0.5;
  const auto distance = [](const ContactPoint& c, const std::vector<ContactPoint>& kept) {
    double least = kInfinity;
    for (const ContactPoint& k : kept) least = std::min(least, (c.position - k.position).norm());
    return least;
  };
  std::vector<ContactPoint> contacts;  // 21 × 21 on a square of 2 × 2, which sags in the middle
  for (int i = 0; i < 441; ++i) contacts.push_back(contact(contacts.size(), {0.1 * (i % 21), 0.1 * (i / 21), 0.0}));
  const auto sag = [&](double most) {
    for (ContactPoint& c : contacts) c.gap = most * std::sin(0.5 * std::numbers::pi * c.position.x());
  };
  sag(-1e-5);
  const auto kept = reduced(contacts, {}, kSpacing);
  EXPECT_LE(kept.size(), 25u);  // discs of this radius cover the square from 16 on
  for (const ContactPoint& c : contacts) EXPECT_LE(distance(c, kept), kSpacing + kRoundOff);
  // The same ones carry on as the gaps change; where there are none of them, others are found.
  sag(1e-5);
  EXPECT_EQ(ids(reduced(contacts, {}, kSpacing, ids(kept))), ids(kept));
  contacts.erase(contacts.begin(), contacts.begin() + 210);
  const auto half = reduced(contacts, {}, kSpacing, ids(kept));
  for (const ContactPoint& c : contacts) EXPECT_LE(distance(c, half), 1.1 * kSpacing + kRoundOff);
}

TEST(ContactClusters, ASpacingMayBeAShareOfThePatch) {
  for (const double size : {0.1, 1.0, 10.0}) {
    std::vector<ContactPoint> contacts;
    for (int i = 0; i < 441; ++i) contacts.push_back(contact(contacts.size(), size * Vec3(i % 21, i / 21, 0.0)));
    const auto all = contacts;
    ContactClusters clusters;
    clusters.reduce(contacts, 0, {.share = 0.3}, {});
    EXPECT_GT(contacts.size(), 4u);
    EXPECT_LE(contacts.size(), 9u);
    for (const ContactPoint& c : all) {
      double least = kInfinity;
      for (const ContactPoint& k : contacts) least = std::min(least, (c.position - k.position).norm());
      EXPECT_LE(least, 0.3 * std::sqrt(2.0) * 20.0 * size);
    }
  }
}

TEST(ContactClusters, ContactsInOnePlaceOrOnOneLineAreThinnedToItsEnds) {
  std::vector<ContactPoint> contacts;
  for (std::uint64_t i = 0; i < 30; ++i) contacts.push_back(contact(i, Vec3::Ones()));
  EXPECT_EQ(reduced(contacts).size(), 1u);
  for (ContactPoint& c : contacts) c.position.x() = static_cast<double>(c.id);
  EXPECT_EQ(ids(reduced(contacts)), (std::vector<std::uint64_t>{0, 29}));
}

TEST(ContactClusters, WhatWasKeptIsKeptWhileItIsNearlyAsGood) {
  // A wheel's rim of 64 contacts, all of whose squares are equally large; its gaps wander as it rocks a little.
  std::vector<std::uint64_t> previous;
  std::vector<std::uint64_t> first;
  for (int step = 0; step < 200; ++step) {
    std::vector<ContactPoint> rim;
    const double turn = 0.001 * step, tilt = 2e-4 * std::sin(0.3 * step), bend = 1e-3 * std::sin(0.7 * step);
    for (std::uint64_t i = 0; i < 64; ++i) {
      const double angle = turn + 2.0 * std::numbers::pi * static_cast<double>(i) / 64.0;
      const double radius = 1.0 + bend * std::cos(2.0 * angle);
      rim.push_back(contact(i, {radius * std::cos(angle), radius * std::sin(angle), 0.0}, tilt * std::cos(angle)));
    }
    const auto kept = reduced(rim, {}, kInfinity, previous);
    previous = ids(kept);
    if (step == 0) first = previous;
    EXPECT_EQ(previous, first) << step;
    EXPECT_GE(area(kept), 0.9 * kSas * area(rim));
  }
}

TEST(ContactClusters, WhatWasKeptIsGivenUpOnceItSpansTooLittle) {
  std::vector<ContactPoint> square;
  for (std::uint64_t i = 0; i < 25; ++i) square.push_back(contact(i, {0.25 * (i % 5), 0.25 * (i / 5), 0.0}));
  const std::vector<std::uint64_t> middle{6, 8, 16, 18}, corners{0, 4, 20, 24};
  EXPECT_EQ(ids(reduced(square, {}, kInfinity, middle)), corners);
  const testing::ScopedValue patient(internal::collision_tuning_in_use.clusters.hysteresis, 0.2);
  EXPECT_EQ(ids(reduced(square, {}, kInfinity, middle)), middle);
}

TEST(ContactClusters, ContactsBeforeTheFirstAreLeftAlone) {
  auto contacts = samples(kRegions[0].inside, 0.5);
  const auto count = contacts.size();
  contacts.insert(contacts.end(), contacts.begin(), contacts.begin() + static_cast<std::ptrdiff_t>(count));
  ContactClusters clusters;
  clusters.reduce(contacts, count, {}, {});
  EXPECT_EQ(contacts.size(), count + 4);
}

TEST(ContactClusters, AWarmReductionAllocatesNothing) {
  const auto all = samples(kRegions[2].inside);
  const std::vector<std::uint64_t> previous{1, 5, 100, 200};
  ContactClusters clusters;
  std::vector<ContactPoint> contacts;
  const auto reduce = [&] {
    contacts.assign(all.begin(), all.end());
    clusters.reduce(contacts, 0, {.length = 0.5}, previous);
  };
  reduce();
  const long before = testing::allocations();
  reduce();
  EXPECT_EQ(testing::allocations() - before, 0);
}

/// Σ_r φ_r = 1, Σ_r φ_r x_r = x, φ > 0, over what is kept of several shapes, with and without contacts in the middle.
TEST(ContactClusters, WeightsSumToOneAndReproduceLinearFields) {
  for (const Region& region : kRegions)
    for (const double spacing : {kInfinity, 0.3}) {
      auto contacts = samples(region.inside, 0.125);
      ContactClusters clusters;
      clusters.reduce(contacts, 0, {.share = spacing}, {}, ContactShares::kWeights);
      const std::span<const ContactPoint> all = clusters.all();
      std::vector<double> sum(all.size());
      std::vector<Vec3> mean(all.size(), Vec3::Zero());
      for (const ContactWeight& w : clusters.weights()) {
        EXPECT_GT(w.weight, 0.0);
        EXPECT_TRUE(clusters.kept(w.kept));
        sum[static_cast<std::size_t>(w.contact)] += w.weight;
        mean[static_cast<std::size_t>(w.contact)] += w.weight * all[static_cast<std::size_t>(w.kept)].position;
      }
      for (std::size_t i = 0; i < all.size(); ++i) {
        EXPECT_NEAR(sum[i], 1.0, kRoundOff) << region.name;
        if (contains(contacts, all[i].position)) {
          EXPECT_LT((mean[i] - all[i].position).norm(), kRoundOff) << region.name;
        }
        EXPECT_TRUE(contains(contacts, mean[i])) << region.name;
      }
    }
}

/// The corners of a square have the same parts of it, whatever their order.
TEST(ContactClusters, WeightsOfASquareAreThoseOfItsSymmetry) {
  auto contacts = samples(kRegions[0].inside, 0.25);
  ContactClusters clusters;
  clusters.reduce(contacts, 0, {}, {}, ContactShares::kWeights);
  ASSERT_EQ(contacts.size(), 4u);
  std::vector<double> part(clusters.all().size());
  for (const ContactWeight& w : clusters.weights()) part[static_cast<std::size_t>(w.kept)] += w.weight;
  for (std::size_t i = 0; i < part.size(); ++i)
    EXPECT_NEAR(part[i], clusters.kept(static_cast<Index>(i)) ? 81.0 / 4.0 : 0.0, 1e-9);
}

/// Against even samples of the hull, each given to what is nearest.
TEST(ContactClusters, TheCellOfAContactIsWhatIsNearerToItThanToAnyOther) {
  constexpr double kSample = 1.0 / 128.0;
  for (const Region& region : {kRegions[0], kRegions[6], kRegions[10]}) {
    auto contacts = samples(region.inside, 0.25);
    for (ContactPoint& c : contacts) c.position.x() += 0.05 * std::sin(9.0 * c.position.y());
    const auto corners = hull(contacts);
    const auto inside = [&](const Vec3& p) {
      for (std::size_t i = 0; i < corners.size(); ++i)
        if (cross(corners[i], corners[(i + 1) % corners.size()], p) < 0.0) return false;
      return true;
    };
    ContactClusters clusters;
    clusters.reduce(contacts, 0, {}, {}, ContactShares::kWeightsAndCells);
    const std::span<const ContactPoint> all = clusters.all();
    std::vector<double> nearest(all.size(), 0.0);
    for (double x = -2.0 + 0.5 * kSample; x < 2.0; x += kSample)
      for (double y = -2.0 + 0.5 * kSample; y < 2.0; y += kSample) {
        const Vec3 p(x, y, 0.0);
        if (!inside(p)) continue;
        const auto distance = [&](const ContactPoint& c) { return (c.position - p).squaredNorm(); };
        const auto at = std::min_element(all.begin(), all.end(),
                                         [&](const auto& c, const auto& d) { return distance(c) < distance(d); });
        nearest[static_cast<std::size_t>(at - all.begin())] += kSample * kSample;
      }
    for (std::size_t i = 0; i < all.size(); ++i)
      EXPECT_NEAR(clusters.cell(static_cast<Index>(i)), nearest[i], 0.5 * kSample) << region.name << ' ' << i;
  }
}

TEST(ContactClusters, ContactsUponEachOtherShareTheirCellAndALineHasNone) {
  auto contacts = samples(kRegions[0].inside, 0.5);
  const std::size_t once = contacts.size();
  for (std::size_t i = 0; i < once; ++i) {
    contacts.push_back(contacts[i]);
    contacts.back().id += 1000;
  }
  ContactClusters clusters;
  clusters.reduce(contacts, 0, {}, {}, ContactShares::kWeightsAndCells);
  double sum = 0.0;
  for (Index i = 0; i < static_cast<Index>(2 * once); ++i) sum += clusters.cell(i);
  EXPECT_NEAR(sum, 4.0, kRoundOff);
  auto line = samples([](double x, double y) { return std::abs(x) <= 1.0 && y == 0.0; }, 0.25);
  clusters.reduce(line, 0, {}, {}, ContactShares::kWeightsAndCells);
  for (Index i = 0; i < static_cast<Index>(clusters.all().size()); ++i) EXPECT_TRUE(std::isinf(clusters.cell(i)));
}

TEST(ContactClusters, WhatIsFartherIsNotPressedWithWhatIsKept) {
  auto contacts = samples(kRegions[0].inside, 0.25);
  for (ContactPoint& c : contacts) c.gap = 0.1 * (1.0 + c.position.x());  // 0 to 0.2 of an extent of 2.8: a tilted face
  ContactClusters clusters;
  clusters.reduce(contacts, 0, {}, {}, ContactShares::kWeights);
  for (const ContactWeight& w : clusters.weights()) {
    const double farther =
        clusters.all()[static_cast<std::size_t>(w.contact)].gap - clusters.all()[static_cast<std::size_t>(w.kept)].gap;
    EXPECT_LT(farther, 1e-2 * std::sqrt(8.0));
  }
}

TEST(ContactClusters, OptionsOutOfRangeAreRefused) {
  EXPECT_THROW(ContactClusters({.max_points = -1}), InvalidArgument);
}

}  // namespace
}  // namespace limber
