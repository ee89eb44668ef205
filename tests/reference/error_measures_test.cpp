// Errors of motions that are known to be off by so much.
#include "error_measures.h"

#include <gtest/gtest.h>

#include <cmath>

#include "constants.h"
#include "error_scenes.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using namespace limber::testing;

/// A cube's corners, sample by sample.
NodeMotion cube(int samples, const std::function<NodeVectors(const NodeVectors&, double t)>& moved) {
  NodeVectors corners(8, 3);
  for (int i = 0; i < 8; ++i) corners.row(i) << (i & 1), (i >> 1 & 1), (i >> 2 & 1);
  NodeMotion out;
  for (int n = 0; n < samples; ++n) out.push_back(moved(corners, static_cast<double>(n) / (samples - 1)));
  return out;
}
NodeVectors turned(const NodeVectors& x, double angle) {
  return x * Eigen::AngleAxisd(angle, Vec3(1.0, -2.0, 0.5).normalized()).toRotationMatrix().transpose();
}

TEST(ErrorMeasures, AMotionIsNotOffItself) {
  const auto flight = cube(5, [](const NodeVectors& x, double t) -> NodeVectors { return x.array() + t; });
  const MotionError e = motion_error(flight, flight, Eigen::VectorXd::Ones(8));
  EXPECT_EQ(e.mean, 0.0);
  EXPECT_EQ(e.worst_vertex, 0.0);
  EXPECT_NEAR(e.peak, std::sqrt(3.0), 1e-15);
}

TEST(ErrorMeasures, WhatIsOffByAShareOfTheWayIsOffByThatShare) {
  const auto at_speed = [](double speed) {
    return cube(3, [speed](const NodeVectors& x, double t) -> NodeVectors { return x.array() + speed * t; });
  };
  const MotionError e = motion_error(at_speed(1.02), at_speed(1.0), Eigen::VectorXd::Ones(8));
  EXPECT_NEAR(e.worst, 0.02, 1e-12);
  EXPECT_NEAR(e.worst_vertex, 0.02, 1e-12);
  EXPECT_NEAR(e.mean, 0.02 * std::sqrt((0.25 + 1.0) / 3.0), 1e-12);
  EXPECT_NEAR(node_error(at_speed(1.02), at_speed(1.0), 5), 0.02, 1e-12);
}

TEST(ErrorMeasures, AlignmentTakesAwayRigidMotionsAndNothingElse) {
  const auto stretched = [](double by, double angle) {
    return cube(4, [=](const NodeVectors& x, double t) -> NodeVectors {
      NodeVectors y = x;
      y.col(0) *= 1.0 + by * t;
      return turned(y, angle * t).array() + angle * t;
    });
  };
  const Eigen::VectorXd masses = Eigen::VectorXd::LinSpaced(8, 1.0, 2.0);
  const MotionError rigid = motion_error(stretched(0.1, 0.3), stretched(0.1, 0.0), masses);
  EXPECT_GT(rigid.mean, 1.0);
  EXPECT_NEAR(rigid.shape_mean, 0.0, 1e-12);
  // Equal masses: a cube's moments are then the same about all axes, so that stretching turns no best rotation.
  const MotionError shape = motion_error(stretched(0.11, 0.3), stretched(0.1, 0.7), Eigen::VectorXd::Ones(8));
  EXPECT_NEAR(shape.shape_mean, 0.1 * std::sqrt((1.0 + 4.0 + 9.0) / 9.0 / 4.0), 1e-12);
}

TEST(ErrorMeasures, MotionsOfOtherSizesAreRefused) {
  const auto motion = cube(3, [](const NodeVectors& x, double) { return x; });
  EXPECT_THROW(motion_error({}, {}, Eigen::VectorXd::Ones(8)), InvalidArgument);
  EXPECT_THROW(motion_error(motion, {motion[0]}, Eigen::VectorXd::Ones(8)), InvalidArgument);
  EXPECT_THROW(motion_error(motion, motion, Eigen::VectorXd::Ones(7)), InvalidArgument);
}

TEST(ErrorMeasures, AReferenceMayBeSeenMoreOften) {
  const auto at_speed = [](double speed, int samples) {
    return cube(samples,
                [speed](const NodeVectors& x, double t) -> NodeVectors { return x.array() + speed * t * (2.0 - t); });
  };
  const Eigen::VectorXd masses = Eigen::VectorXd::Ones(8);
  const MotionError often = motion_error(at_speed(1.02, 3), at_speed(1.0, 9), masses);
  const MotionError as_often = motion_error(at_speed(1.02, 3), at_speed(1.0, 3), masses);
  EXPECT_NEAR(often.mean, as_often.mean, 1e-15);
  EXPECT_NEAR(node_error(at_speed(1.02, 3), at_speed(1.0, 9), 2), 0.02, 1e-12);
  EXPECT_THROW(motion_error(at_speed(1.0, 4), at_speed(1.0, 9), masses), InvalidArgument);
}

TEST(ErrorMeasures, TheFirstImpactEndsWhereNothingPressesForAWhile) {
  const std::vector<Touch> touches{{0.10, 1.0}, {0.11, 2.0}, {0.12, 3.0}, {0.20, 5.0}};
  const FirstImpact first = first_impact(touches);
  EXPECT_EQ(first.begin, 0.10);
  EXPECT_EQ(first.end, 0.12);
  EXPECT_EQ(first.impulse, 6.0);
  EXPECT_EQ(first_impact({}).impulse, 0.0);
}

TEST(ErrorMeasures, FrequencyAndPhaseOfAModeAreFound) {
  std::vector<double> times, z;
  for (int i = 0; i < 100; ++i) {
    times.push_back(0.013 * i);
    z.push_back(0.4 * std::cos(31.0 * times.back() - 0.6));
  }
  const ModeFit fit = fit_mode(times, z, 31.2);
  EXPECT_NEAR(fit.omega, 31.0, 1e-10);
  EXPECT_NEAR(fit.phase, 0.6, 1e-10);
  EXPECT_NEAR(fit.amplitude, 0.4, 1e-12);
}

TEST(ErrorMeasures, OrdersAreSlopes) {
  const std::vector<double> h{1.0, 0.5, 0.25}, error{3.0, 0.75, 0.1875};
  EXPECT_NEAR(log_slope(h, error), 2.0, 1e-12);
  EXPECT_EQ(quantiles({3.0, 1.0, 2.0}).median, 2.0);
}

}  // namespace
}  // namespace limber
