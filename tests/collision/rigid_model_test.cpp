// Rigid bodies from shapes: masses and moments against slices of the solid, and frames at the centre of mass.
#include "limber/collision/rigid_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "limber/core/error.h"

namespace limber {
namespace {

constexpr double kDensity = 700.0;

/// A round solid about z of the given outline, cut into discs: m, and the moments about its middle.
template <class Radius>
MassProperties sum_of_discs(double half_height, const Radius& radius) {
  constexpr int kDiscs = 200000;
  MassProperties sum;
  const double thickness = 2.0 * half_height / kDiscs;
  for (int i = 0; i < kDiscs; ++i) {
    const double z = -half_height + (i + 0.5) * thickness, r2 = radius(z) * radius(z);
    const double mass = kDensity * std::numbers::pi * r2 * thickness, across = mass * (r2 / 4.0 + z * z);
    sum.mass += mass;
    sum.inertia.diagonal() += Vec3(across, across, mass * r2 / 2.0);
  }
  return sum;
}

void expect_same_mass(const MassProperties& a, const MassProperties& b, double relative) {
  EXPECT_NEAR(a.mass, b.mass, relative * b.mass);
  EXPECT_LE((a.center_of_mass - b.center_of_mass).norm(), relative);
  EXPECT_LE((a.inertia - b.inertia).norm(), relative * b.inertia.norm());
}

TEST(MassProperties, ThoseOfRoundSolidsAreSumsOfTheirDiscs) {
  constexpr double kCut = 1e-8;  // of discs as thick as these
  const auto ball = [](double z) { return std::sqrt(std::max(0.0, 0.09 - z * z)); };
  expect_same_mass(mass_properties(Sphere{0.3}, kDensity), sum_of_discs(0.3, ball), kCut);
  const auto capsule = [&](double z) { return ball(std::max(0.0, std::abs(z) - 0.5)); };
  expect_same_mass(mass_properties(Capsule{0.3, 0.5}, kDensity), sum_of_discs(0.8, capsule), kCut);
}

TEST(MassProperties, ABoxIsTheHullAndTheMeshOfItsCorners) {
  const Vec3 half(0.1, 0.2, 0.4);
  ConvexHull hull{{Vec3::Zero()}};  // a point inside counts for nothing
  for (int i = 0; i < 8; ++i)
    hull.points.push_back(half.cwiseProduct(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1)));
  const MassProperties box = mass_properties(Box{half}, kDensity);
  EXPECT_NEAR(box.mass, kDensity * 0.2 * 0.4 * 0.8, 1e-12);
  EXPECT_NEAR(box.inertia(0, 0), box.mass / 12.0 * (0.4 * 0.4 + 0.8 * 0.8), 1e-12);
  expect_same_mass(mass_properties(hull, kDensity), box, 1e-14);
}

TEST(MassProperties, APrismOfManySidesIsNearlyTheCylinder) {
  constexpr int kSides = 64;
  const double inside =
      2.0 / 3.0 * std::pow(2.0 * std::numbers::pi / kSides, 2);  // what the sides leave out, of moments
  const MassProperties prism = mass_properties(cylinder_hull(0.3, 0.5, kSides), kDensity);
  expect_same_mass(prism, sum_of_discs(0.5, [](double) { return 0.3; }), inside);
}

TEST(MassProperties, WhatBoundsNoSolidIsRefused) {
  const Triangle one{0, 1, 2};
  const TriangleMesh open{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {one}};
  const std::vector<Vec3> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const TriangleMesh inverted{corners, {{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}}};
  const HeightField field{2, 2, 1.0, 1.0, {0, 0, 0, 0}};
  for (const Shape& shape : {Shape(open), Shape(inverted), Shape(field), Shape(HalfSpace{})})
    EXPECT_THROW(mass_properties(shape, kDensity), InvalidArgument);
  for (const double density : {0.0, -1.0, std::nan("")})
    EXPECT_THROW(mass_properties(Sphere{}, density), InvalidArgument);
  EXPECT_THROW(cylinder_hull(1.0, 1.0, 2), InvalidArgument);
  EXPECT_THROW(make_rigid_model(nullptr, {}), InvalidArgument);
}

TEST(RigidModel, ItsOriginIsTheCentreOfMass) {
  const std::vector<Vec3> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const auto wedge = std::make_shared<const Shape>(ConvexHull{corners});
  const MassProperties mass = mass_properties(*wedge, kDensity);
  EXPECT_LE((mass.center_of_mass - Vec3::Constant(0.25)).norm(), 1e-15);
  const RigidModel made = make_rigid_model(wedge, mass);
  EXPECT_EQ(made.model->data().origin_in_input, mass.center_of_mass);
  EXPECT_LE(mass_properties(*made.shape, kDensity).center_of_mass.norm(), 1e-15);
  EXPECT_EQ(made.model->modes(), 0);
}

TEST(RigidModel, AWeightedBoxIsAHullAndAWeightedBallIsRefused) {
  MassProperties mass = mass_properties(Box{}, kDensity);
  mass.center_of_mass = {0.0, 0.0, -0.4};
  const RigidModel tumbler = make_rigid_model(std::make_shared<const Shape>(Box{}), mass);
  EXPECT_LE((mass_properties(*tumbler.shape, kDensity).center_of_mass - Vec3(0.0, 0.0, 0.4)).norm(), 1e-15);
  EXPECT_THROW(make_rigid_model(std::make_shared<const Shape>(Sphere{}), mass), InvalidArgument);
}

}  // namespace
}  // namespace limber
