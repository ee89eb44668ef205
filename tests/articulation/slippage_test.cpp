#include "limber/articulation/slippage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "constants.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::kPi;

/// A contact whose two sides are the same exact surface x(u, v) over the unit square, with normals.
struct Patch {
  std::function<Vec3(double, double)> point, normal;
};

ContactRegion exact_contact(const std::vector<Patch>& patches, int steps = 40) {
  ContactRegion out;
  out.b = 1;
  for (const Patch& patch : patches)
    for (int i = 0; i < steps; ++i)
      for (int j = 0; j < steps; ++j) {
        const double u = (i + 0.5) / steps, v = (j + 0.5) / steps, e = 1e-6;
        const Vec3 p = patch.point(u, v), n = patch.normal(u, v);
        const double area =
            (patch.point(u + e, v) - p).cross(patch.point(u, v + e) - p).norm() / (e * e * steps * steps);
        out.on_a.push_back({p, n, p, -n, area, 0.0});
      }
  return out;
}

Patch cylinder(double rx, double ry, double half_height) {
  return {[=](double u, double v) {
            return Vec3(rx * std::cos(2 * kPi * u), ry * std::sin(2 * kPi * u), half_height * (2 * v - 1));
          },
          [=](double u, double) {
            return Vec3(Vec3(std::cos(2 * kPi * u) / rx, std::sin(2 * kPi * u) / ry, 0.0).normalized());
          }};
}

Patch plane(const Vec3& centre, const Vec3& x, const Vec3& y) {
  return {[=](double u, double v) { return Vec3(centre + (2 * u - 1) * x + (2 * v - 1) * y); },
          [=](double, double) { return Vec3(x.cross(y).normalized()); }};
}

JointSpec best(const ContactRegion& contact) { return analyse_slippage({contact}).hypotheses.front().joint; }

// A tilt about a diameter moves a point of the cylinder with (0, −z, y): mean squared normal part h²/6, in all
// R²/2 + h²/3; a shift across has 1/2.
TEST(Slippage, SpectrumOfACylinderIsItsClosedForm) {
  const double R = 0.7, h = 0.9, tilt = (h * h / 6) / (R * R / 2 + h * h / 3);
  const Slippage slippage = analyse_slippage({exact_contact({cylinder(R, R, h)}, 200)});
  const double expected[] = {0.0, 0.0, tilt, tilt, 0.5, 0.5};
  const double kWeights = 1e-3;  // samples are weighed by a density that 600 of them estimate
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(slippage.mu[i], expected[i], kWeights) << i;
  EXPECT_EQ(slippage.hypotheses.front().joint.type, JointType::kCylindrical);
}

TEST(Slippage, RotationOfATenPercentEllipseIsBlocked) {
  // Known neighbour of the threshold: mean squared slope of an ellipse of 1.10 against its circle.
  EXPECT_EQ(best(exact_contact({cylinder(1.1, 1.0, 1.0)})).type, JointType::kPrismatic);
  EXPECT_EQ(best(exact_contact({cylinder(1.0, 1.0, 1.0)})).type, JointType::kCylindrical);
}

// By area alone the turn about z has a slippage of 7.6e-3.
TEST(Slippage, ASquarePegUnderAWidePlateStillHoldsIt) {
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), z = Vec3::UnitZ();
  std::vector<Patch> patches = {plane(Vec3::Zero(), x, y)};
  for (const double side : {-1.0, 1.0}) {
    patches.push_back(plane(side * 0.25 * x - 0.25 * z, side * 0.25 * y, 0.25 * z));
    patches.push_back(plane(side * 0.25 * y - 0.25 * z, side * 0.25 * z, 0.25 * x));
  }
  EXPECT_EQ(best(exact_contact(patches)).type, JointType::kFixed);
  EXPECT_EQ(best(exact_contact({patches[0]})).type, JointType::kPlanar);
}

TEST(Slippage, AShortBearingIsACylinderAndNoBall) {
  EXPECT_EQ(best(exact_contact({cylinder(1.0, 1.0, 0.05)})).type, JointType::kCylindrical);
}

TEST(Slippage, BallIsFoundWithItsCentreFromABandAwayFromIt) {
  const Vec3 centre(3.0, -2.0, 5.0);
  const Patch band = {
      [=](double u, double v) {
        const double lat = 0.9 * (v - 0.5), lon = 2 * kPi * u;
        return Vec3(centre + 0.2 * Vec3(std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat)));
      },
      [=](double u, double v) {
        const double lat = 0.9 * (v - 0.5), lon = 2 * kPi * u;
        return Vec3(std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat));
      }};
  const JointSpec joint = best(exact_contact({band}));
  EXPECT_EQ(joint.type, JointType::kBall);
  EXPECT_LT((joint.frame.origin - centre).norm(), 1e-9);
}

TEST(Slippage, HelicoidIsAScrewOfItsPitch) {
  const double pitch = 0.05;  // of a strip from radius 0.5 to 1 over one turn
  const Patch strip = {[=](double u, double v) {
                         const double r = 0.5 + 0.5 * v, a = 2 * kPi * u;
                         return Vec3(r * std::cos(a), r * std::sin(a), pitch * a);
                       },
                       [=](double u, double v) {
                         const double r = 0.5 + 0.5 * v, a = 2 * kPi * u;
                         return Vec3(Vec3(pitch * std::sin(a), -pitch * std::cos(a), r).normalized());
                       }};
  // The strip's edge, at a constant radius, keeps it from sliding across.
  const Patch rim = {[=](double u, double v) {
                       const double a = 2 * kPi * u;
                       return Vec3(std::cos(a), std::sin(a), pitch * a + 0.1 * (v - 0.5));
                     },
                     [=](double u, double) { return Vec3(std::cos(2 * kPi * u), std::sin(2 * kPi * u), 0.0); }};
  const JointSpec joint = best(exact_contact({strip, rim}));
  EXPECT_EQ(joint.type, JointType::kCylindrical);
  EXPECT_NEAR(joint.pitch, pitch, 1e-6);
}

TEST(Slippage, FixedRatioReadsAnExactCylinderAndPlaneAsThePaperDoes) {
  const SlippageOptions paper{.method = SlippageMethod::kFixedRatio};
  const auto type = [&](const Patch& patch) {
    return analyse_slippage({exact_contact({patch})}, paper).hypotheses.front().joint.type;
  };
  EXPECT_EQ(type(cylinder(1.0, 1.0, 1.0)), JointType::kCylindrical);
  EXPECT_EQ(type(plane(Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY())), JointType::kPlanar);
  // Its weakness: a short bearing has two more small eigenvalues.
  EXPECT_NE(type(cylinder(1.0, 1.0, 0.05)), JointType::kCylindrical);
}

TEST(Slippage, WrongArgumentsAreRefused) {
  EXPECT_THROW(analyse_slippage({}), InvalidArgument);
  EXPECT_THROW(analyse_slippage({exact_contact({cylinder(1, 1, 1)})}, {.threshold = 0.0}), InvalidArgument);
  EXPECT_THROW(analyse_slippage({exact_contact({cylinder(1, 1, 1)})}, {.ratio = 1.0}), InvalidArgument);
}

// What touches on four sides and at its end may be a peg in a blind hole or a drawer at its stop.
TEST(Slippage, ADrawerAtItsStopIsTheSecondReadingOfABlindPeg) {
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), z = Vec3::UnitZ();
  std::vector<Patch> walls, all;
  for (const double side : {-1.0, 1.0}) {
    walls.push_back(plane(side * 0.5 * x, side * 0.3 * y, z));
    walls.push_back(plane(side * 0.3 * y, side * z, 0.5 * x));
  }
  all = walls;
  all.push_back(plane(-z, 0.5 * x, -0.3 * y));  // the bottom, outward −z
  const Slippage stopped = analyse_slippage({exact_contact(all)});
  ASSERT_EQ(stopped.hypotheses[0].joint.type, JointType::kFixed);
  ASSERT_EQ(stopped.hypotheses[1].joint.type, JointType::kPrismatic);
  EXPECT_NEAR(std::abs(stopped.hypotheses[1].joint.frame.axes(2, 0)), 1.0, 1e-9);
  EXPECT_GT(stopped.hypotheses[1].confidence, 0.2);
  EXPECT_GT(stopped.hypotheses[0].confidence, 2 * stopped.hypotheses[1].confidence);
  EXPECT_THAT(stopped.hypotheses[1].reason, ::testing::HasSubstr("may be a stop"));

  all.push_back(plane(z, 0.5 * x, 0.3 * y));  // held from both ends it is no stop
  const Slippage held = analyse_slippage({exact_contact(all)});
  ASSERT_EQ(held.hypotheses[0].joint.type, JointType::kFixed);
  EXPECT_LT(held.hypotheses[1].confidence, 0.05);
  EXPECT_EQ(analyse_slippage({exact_contact(walls)}).hypotheses[0].joint.type, JointType::kPrismatic);
}

// A piston that touches the head turns; it may slide as well if the head is but a stop.
TEST(Slippage, APistonAtItsDeadCentreMaySlide) {
  const Patch head = {[](double u, double v) {
                        const double r = 0.7 * std::sqrt(v), a = 2 * kPi * u;
                        return Vec3(r * std::cos(a), r * std::sin(a), 0.9);
                      },
                      [](double, double) { return Vec3(Vec3::UnitZ()); }};
  const Slippage piston = analyse_slippage({exact_contact({cylinder(0.7, 0.7, 0.9), head})});
  ASSERT_EQ(piston.hypotheses[0].joint.type, JointType::kRevolute);
  ASSERT_EQ(piston.hypotheses[1].joint.type, JointType::kCylindrical);
  EXPECT_GT(piston.hypotheses[1].confidence, 0.2);
}

/// A flat face whose outline has the radius r(angle), with a hole in its middle.
Patch flange(const Vec3& centre, const std::function<double(double)>& radius) {
  return {[=](double u, double v) {
            const double a = 2 * kPi * u, r = radius(a) * std::sqrt(0.1 + 0.9 * v);
            return Vec3(centre + Vec3(r * std::cos(a), 0.0, -r * std::sin(a)));
          },
          [](double, double) { return Vec3(Vec3::UnitY()); }};
}

/// Of a polygon about its middle.
std::function<double(double)> polygon(int corners) {
  const double side = 2 * kPi / corners;
  return [=](double a) { return std::cos(side / 2) / std::cos(a - side * std::floor(a / side) - side / 2); };
}

// Two round flanges that meet slide as far as they show; that a bearing holds them in their middle is the second
// hypothesis.
TEST(Slippage, ARoundFlangeMayTurnAboutItsMiddle) {
  const Vec3 centre(0.3, -1.2, 4.0);
  for (const auto& radius : {std::function<double(double)>([](double) { return 1.0; }), polygon(8)}) {
    const Slippage round = analyse_slippage({exact_contact({flange(centre, radius)}, 60)});
    ASSERT_EQ(round.hypotheses[0].joint.type, JointType::kPlanar);
    const JointHypothesis& turns = round.hypotheses[1];
    ASSERT_EQ(turns.joint.type, JointType::kRevolute);
    EXPECT_LT((turns.joint.frame.origin - centre).norm(), 1e-3);
    EXPECT_NEAR(std::abs(turns.joint.frame.axes(1, 0)), 1.0, 1e-9);
    EXPECT_NEAR(turns.joint.frame.axes.determinant(), 1.0, 1e-9);
    EXPECT_NEAR(turns.confidence, 0.2, 0.02);
    EXPECT_THAT(turns.reason, ::testing::HasSubstr("flange"));
  }
  const auto oval = [](double a) { return 1.0 / std::hypot(std::cos(a), 1.1 * std::sin(a)); };
  for (const auto& radius : {polygon(4), polygon(6), std::function<double(double)>(oval)}) {
    const Slippage other = analyse_slippage({exact_contact({flange(centre, radius)}, 60)});
    ASSERT_EQ(other.hypotheses[0].joint.type, JointType::kPlanar);
    EXPECT_LT(other.hypotheses[1].confidence, 0.05);
  }
}

}  // namespace
}  // namespace limber
