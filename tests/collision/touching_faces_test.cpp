// Solids whose faces, edges and corners lie exactly on each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "finder_scenes.h"
#include "limber/collision/contact_finder.h"

namespace limber::testing {
namespace {

const Vec3 kHalf(0.25, 0.1875, 0.125);  // of the box that all others touch, m: exact in single precision too

std::shared_ptr<const ModalModel> box_model(const Vec3& half) { return wavy_model(shapes::box(-half, half), 0); }

/// All contacts of a body that may move, at `place`, with what stands at the origin.
std::vector<ContactPoint> contacts_with(const Shape& standing, std::shared_ptr<const ModalModel> moving,
                                        const Vec3& place, double reach, const Vec3& displacement = Vec3::Zero()) {
  ContactFinder finder;
  finder.add_body(0, {.model = {}, .shape = std::make_shared<const Shape>(standing)}, {});
  finder.add_body(1, {.model = std::move(moving), .shape = {}}, {});
  const std::array states{
      BodyState{.pose = {{}, Vec3::Zero()}},
      BodyState{.pose = {{}, place}, .reach = reach, .displacement = displacement, .rotation = Vec3::Zero()}};
  std::vector<ContactPoint> contacts;
  finder.find_contacts({.states = states}, contacts, serial_jobs());
  return contacts;
}

/// Of a box.
std::vector<ContactPoint> contacts_with(const Shape& standing, const Vec3& half, const Vec3& place, double reach,
                                        const Vec3& displacement = Vec3::Zero()) {
  return contacts_with(standing, box_model(half), place, reach, displacement);
}

/// Four contacts or more, all along n. Crossing edges a nanometre apart tell their direction to 1e-7 only.
void expect_normals(const std::vector<ContactPoint>& contacts, const Vec3& n) {
  EXPECT_GE(contacts.size(), 4u);
  for (const ContactPoint& c : contacts) EXPECT_LT((c.normal - n).norm(), 1e-7) << c.normal.transpose();
}

/// Whether a contact is at each of these places.
void expect_places(const std::vector<ContactPoint>& contacts, const std::vector<Vec3>& places) {
  for (const Vec3& place : places)
    EXPECT_TRUE(std::any_of(contacts.begin(), contacts.end(), [&](const ContactPoint& c) {
      return (c.position - place).norm() < 1e-5;
    })) << place.transpose();
}

std::vector<Vec3> corners_at(double z) {
  std::vector<Vec3> corners;
  for (const double x : {-kHalf.x(), kHalf.x()})
    for (const double y : {-kHalf.y(), kHalf.y()}) corners.push_back({x, y, z});
  return corners;
}

TEST(TouchingFaces, ABoxExactlyOnABoxPressesStraightDownAtAllCorners) {
  for (const double off : {0.0, 1e-12, 1e-9, 1e-6})
    for (const double gap : {0.0, 1e-9, 1e-6, -1e-9, -1e-6}) {
      SCOPED_TRACE(::testing::Message() << "off by " << off << ", gap " << gap);
      const auto contacts = contacts_with(Box{kHalf}, kHalf, {off, -off, 2.0 * kHalf.z() + gap}, 1e-3);
      expect_normals(contacts, -Vec3::UnitZ());
      expect_places(contacts, corners_at(kHalf.z()));
      for (const ContactPoint& c : contacts) EXPECT_NEAR(c.gap, gap, 1e-12);
    }
}

TEST(TouchingFaces, ABrickFlushWithOneSideOfABiggerOnePressesStraightDown) {
  const Vec3 big = 2.0 * kHalf;
  expect_normals(contacts_with(Box{big}, kHalf, {kHalf.x(), 0.0, 3.0 * kHalf.z()}, 1e-3), -Vec3::UnitZ());
}

TEST(TouchingFaces, BoxesSideBySidePressOnEachOthersSides) {
  for (const double gap : {0.0, 1e-3})
    expect_normals(contacts_with(Box{kHalf}, kHalf, {2.0 * kHalf.x() + gap, 0.0, 0.0}, 2e-3), -Vec3::UnitX());
}

TEST(TouchingFaces, BoxesThatHaveAnEdgeInCommonAlonePressOnNothing) {
  EXPECT_TRUE(contacts_with(Box{kHalf}, kHalf, {2.0 * kHalf.x(), 0.0, 2.0 * kHalf.z()}, 1e-3).empty());
  EXPECT_TRUE(contacts_with(Box{kHalf}, kHalf, {2.0 * kHalf.x(), 2.0 * kHalf.y(), 0.0}, 1e-3).empty());
}

TEST(TouchingFaces, ABoxInACornerPressesOnAllThreeWalls) {
  TriangleMesh corner;
  corner.vertices = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 0, 2}, {2, 0, 2}, {0, 2, 2}};
  corner.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 5, 1}, {0, 4, 5}, {0, 3, 6}, {0, 6, 4}};
  const auto contacts = contacts_with(corner, kHalf, kHalf, 1e-3);
  for (int axis = 0; axis < 3; ++axis) {
    const auto along = [&](const ContactPoint& c) { return (c.normal + Vec3::Unit(axis)).norm() < 1e-9; };
    EXPECT_GE(std::count_if(contacts.begin(), contacts.end(), along), 4) << axis;
  }
  for (const ContactPoint& c : contacts) EXPECT_NEAR(c.normal.cwiseAbs().maxCoeff(), 1.0, 1e-9);
}

TEST(TouchingFaces, BoxesWithFlushSidesArePushedOutUpwardsHoweverDeep) {
  for (const double depth : {1e-3, 1e-2, 0.05}) {
    const auto contacts = contacts_with(Box{kHalf}, kHalf, {0.0, 0.0, 2.0 * kHalf.z() - depth}, 1e-3);
    expect_normals(contacts, -Vec3::UnitZ());
    for (const ContactPoint& c : contacts) EXPECT_NEAR(c.gap, -depth, 1e-12);
  }
}

// Its tip hangs 1 mm beside the box and below its top; all else stays above. The tip's own edges run over the rim, so
// that the way out through the top would suit them, but there is nothing to get out of.
TEST(TouchingFaces, ATipThatHangsBesideABoxWithoutEnteringItDoesNotOverlap) {
  SurfaceMesh tip;
  tip.vertices = {{0, 0, 0}, {-0.3, 0.25, 0.4}, {-0.3, -0.25, 0.4}, {0.15, 0, 0.5}};
  tip.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const double aside = 1e-3;
  const auto contacts = contacts_with(Box{kHalf}, wavy_model(tip, 0), {kHalf.x() + aside, 0.0, kHalf.z() - 1e-3}, 2e-3);
  for (const ContactPoint& c : contacts) EXPECT_GE(c.gap, 0.0);
  EXPECT_TRUE(std::any_of(contacts.begin(), contacts.end(), [&](const ContactPoint& c) {
    return (c.normal + Vec3::UnitX()).norm() < 1e-9 && std::abs(c.gap - aside) < 1e-9;
  }));
}

TEST(TouchingFaces, IdsOfCornersStayAsABoxMovesUpAndDownByRoundOff) {
  const auto ids = [](double gap) {
    std::vector<std::uint64_t> all;
    for (const ContactPoint& c : contacts_with(Box{1.5 * kHalf}, kHalf, {0.1, 0.05, 2.5 * kHalf.z() + gap}, 1e-3))
      if (*std::max_element(c.b.weight.begin(), c.b.weight.end()) == 1.0) all.push_back(c.id);
    std::sort(all.begin(), all.end());
    return all;
  };
  const auto touching = ids(0.0);
  EXPECT_EQ(touching.size(), 4u);
  for (const double gap : {1e-15, -1e-15, 1e-9, -1e-9}) EXPECT_EQ(ids(gap), touching) << gap;
}

TEST(TouchingFaces, WhatMovesAlongAFloorMeetsTheNextBoxFromAboveAndAWallFromTheFront) {
  const double ahead = 0.1, move = 0.15;  // m
  const Vec3 beside(-2.0 * kHalf.x() - ahead, 0.013, 0.0);
  for (const double above : {1e-9, 0.0, -1e-9})
    for (const ContactPoint& c :
         contacts_with(Box{kHalf}, kHalf, beside + Vec3(0.0, 0.0, 2.0 * kHalf.z() + above), 0.2, {move, 0.0, 0.0}))
      EXPECT_GE(c.gap + c.normal.dot(-Vec3(move, 0.0, 0.0)), -1e-8) << c.normal.transpose();
  const auto wall = contacts_with(Box{kHalf}, kHalf, beside + Vec3(0.0, 0.0, kHalf.z()), 0.2, {move, 0.0, 0.0});
  EXPECT_TRUE(std::any_of(wall.begin(), wall.end(), [&](const ContactPoint& c) {
    return (c.normal - Vec3::UnitX()).norm() < 1e-9 && std::abs(c.gap - ahead) < 1e-9;
  }));
}

}  // namespace
}  // namespace limber::testing
