#include "limber/dynamics/rigid_frame.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "constants.h"
#include "sample_models.h"
#include "taylor_top.h"

namespace limber {
namespace {

using testing::angle_between;
using testing::kDown;
using testing::kEpsilon;
using testing::kGravity;
using testing::sample_model_data;

void step(RigidFrame& frame, const FrameConstants& c, const FrameLoad& load, double h) {
  const Vec3 first_moment = c.mass * c.center_of_mass;
  frame.begin_step(c, load, first_moment, h);
  frame.end_step(c, load, first_moment, h);
}

/// A body of given moments whose centre of mass hangs `length` below its origin.
FrameConstants hanging_body(FrameMotion motion, const Vec3& moments_about_origin, double length) {
  ModalModelData data = sample_model_data({.motion = motion});
  data.mass = 2.0;
  data.center_of_mass = {0.0, 0.0, -length};
  data.inertia = moments_about_origin.asDiagonal();
  return FrameConstants(data);
}

/// The frame's angular velocity is how fast its attitude turns, so that the momentum it keeps is R I Rᵀω of the motion
/// that is seen. @return the worst relative difference of the momentum seen, by central differences
double momentum_error(const RigidFrame& start, const FrameConstants& c, const Mat3& inertia, int steps, double h) {
  RigidFrame frame = start;
  const Vec3 L = frame.angular_momentum(c);
  double error = 0.0;
  for (int i = 0; i < steps; ++i) {
    const Quaternion before = frame.pose().q;
    step(frame, c, {}, h);
    const Mat3 R = to_matrix(frame.pose().q);
    step(frame, c, {}, h);
    const Quaternion turned = frame.pose().q * before.conjugate();
    const Vec3 omega = turned.vector() / (turned.w > 0.0 ? h : -h);
    error = std::max(error, (R * inertia * R.transpose() * omega - L).norm() / L.norm());
  }
  return error;
}

TEST(RigidFrame, TheMomentumThatFreeFlightKeepsIsThatOfTheMotionSeen) {
  const ModalModelData data = sample_model_data({});
  const FrameConstants c(data);
  const RigidFrame frame(c, {}, {1, 2, 3}, {0.5, 3.0, -0.2});
  const double coarse = momentum_error(frame, c, data.inertia, 5000, 2e-3);
  const double fine = momentum_error(frame, c, data.inertia, 10000, 1e-3);
  // sin(ωh)/h is ω to (ωh)²/6, and the rate changes by as much: 1e-5 here, and a quarter of it at half the step.
  EXPECT_LT(fine, 1e-5);
  EXPECT_NEAR(coarse / fine, 4.0, 0.1);
}

TEST(RigidFrame, FreeFlightKeepsMomentumExactlyAndEnergyToRoundOff) {
  const FrameConstants c(sample_model_data({}));
  RigidFrame frame(c, {}, {1, 2, 3}, {0.5, 3.0, -0.2});
  const Vec3 L = frame.angular_momentum(c), p = frame.linear_momentum(c);
  const double energy = frame.kinetic_energy(c);
  double energy_error = 0.0;
  for (int i = 0; i < 10000; ++i) {
    step(frame, c, {}, 1.0 / 60.0);
    energy_error = std::max(energy_error, std::abs(frame.kinetic_energy(c) / energy - 1.0));
  }
  EXPECT_EQ(frame.angular_momentum(c), L);
  EXPECT_EQ(frame.linear_momentum(c), p);
  EXPECT_LT(energy_error, 32 * kEpsilon);
}

/// Attitude and momentum under a torque constant in the world, by classical Runge–Kutta with tiny steps.
Quaternion driven_reference(const FrameConstants& c, Vec3 L, const Vec3& torque, double time) {
  constexpr int kSteps = 20000;
  const double h = time / kSteps;
  Quaternion q;
  const auto rate = [&](const Quaternion& at, const Vec3& momentum) {
    const Vec3 omega_B = c.inertia.inverse() * (at.conjugate() * momentum);
    const Quaternion d = at * Quaternion{0.0, omega_B.x(), omega_B.y(), omega_B.z()};
    return Quaternion{0.5 * d.w, 0.5 * d.x, 0.5 * d.y, 0.5 * d.z};
  };
  const auto plus = [](const Quaternion& a, double s, const Quaternion& b) {
    return Quaternion{a.w + s * b.w, a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
  };
  for (int i = 0; i < kSteps; ++i) {
    const Vec3 middle = L + 0.5 * h * torque, end = L + h * torque;
    const Quaternion k1 = rate(q, L), k2 = rate(plus(q, 0.5 * h, k1), middle), k3 = rate(plus(q, 0.5 * h, k2), middle),
                     k4 = rate(plus(q, h, k3), end);
    q = plus(plus(plus(plus(q, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4);
    L = end;
  }
  return normalized(q);
}

TEST(RigidFrame, HeldTorqueIsSecondOrderInTheStepAndExactInMomentum) {
  const FrameConstants c(sample_model_data({}));
  const FrameLoad load{.torque = {0.02, -0.05, 0.03}};
  const double time = 2.0;
  const auto run = [&](int steps) {
    RigidFrame frame(c, {}, Vec3::Zero(), {0.5, 3.0, -0.2});
    const Vec3 expected = frame.angular_momentum(c) + time * load.torque;
    for (int i = 0; i < steps; ++i) step(frame, c, load, time / steps);
    EXPECT_LT((frame.angular_momentum(c) - expected).norm(), 4 * steps * kEpsilon * expected.norm());
    return frame.pose().q;
  };
  const RigidFrame start(c, {}, Vec3::Zero(), {0.5, 3.0, -0.2});
  const Quaternion reference = driven_reference(c, start.angular_momentum(c), load.torque, time);
  const double coarse = angle_between(run(64), reference), fine = angle_between(run(128), reference);
  EXPECT_LT(coarse, 1e-3);
  EXPECT_NEAR(std::log2(coarse / fine), 2.0, 0.05);
}

// A pendulum let go at rest at angle θ₀ passes its lowest point after a quarter period, √(I/mgl) K(sin θ₀/2).
class Pendulum : public ::testing::TestWithParam<FrameMotion> {
 protected:
  static constexpr double kLength = 0.4;
  const Vec3 moments{0.7, 0.9, 0.3};
  const FrameConstants c = hanging_body(GetParam(), moments, kLength);
  const FrameLoad load{.gravity = kDown};

  double quarter_period(double start) const {
    return std::sqrt(moments.x() / (c.mass * kGravity * kLength)) * std::comp_ellint_1(std::sin(0.5 * start));
  }
  /// Angle from the lowest point, about x.
  static double angle(const RigidFrame& frame) { return 2.0 * std::atan2(frame.pose().q.x, frame.pose().q.w); }
  RigidFrame let_go(double start) const {
    return RigidFrame(c, {quaternion_from_rotation_vector({start, 0, 0}), Vec3::Zero()}, Vec3::Zero(), Vec3::Zero());
  }
  /// −mgl cos θ
  double energy(const RigidFrame& frame) const {
    return frame.kinetic_energy(c) - c.mass * kDown.dot(frame.pose() * c.center_of_mass);
  }
};

TEST_P(Pendulum, PassesTheBottomAfterAQuarterOfTheEllipticPeriodToSecondOrder) {
  for (const double start : {0.01, 1.0, 3.0}) {
    const auto error = [&](int steps) {
      RigidFrame frame = let_go(start);
      for (int i = 0; i < steps; ++i) step(frame, c, load, quarter_period(start) / steps);
      return std::abs(angle(frame));
    };
    EXPECT_LT(error(2000), 2e-6 * start) << start;
    EXPECT_NEAR(std::log2(error(200) / error(400)), 2.0, 0.02) << start;
  }
}

TEST_P(Pendulum, EnergyStaysBoundedForAThousandPeriods) {
  const double start = 2.0, period = 4.0 * quarter_period(start);
  const auto worst = [&](int steps_per_period, int periods) {
    RigidFrame frame = let_go(start);
    const double reference = energy(frame);
    double error = 0.0;
    for (int i = 0; i < steps_per_period * periods; ++i) {
      step(frame, c, load, period / steps_per_period);
      error = std::max(error, std::abs(energy(frame) - reference));
    }
    return error / (c.mass * kGravity * kLength);
  };
  const double short_run = worst(60, 10);
  EXPECT_LT(short_run, 0.01);
  EXPECT_LT(worst(60, 1000), 1.05 * short_run);  // symplectic: no drift
  EXPECT_NEAR(std::log2(short_run / worst(120, 10)), 2.0, 0.1);
}

TEST_P(Pendulum, EnergyStaysBoundedAtStepsOfManyPeriods) {
  // Strang splitting keeps H + h²(p²V''/12I² − V'²/24I) to higher order (Hairer, Lubich, Wanner, section IX.3), with
  // p²/2I ≤ mgl (1 − cos θ₀) and parts of a step of at most a quarter of a radian of the swing, Ωh ≤ 1/4.
  const double allowed = ((1.0 - std::cos(2.0)) / 6.0 + 1.0 / 24.0) / 16.0 * c.mass * kGravity * kLength;
  for (const double h : {0.1, 1.0, 10.0}) {
    RigidFrame frame = let_go(2.0);
    const double start = energy(frame);
    for (int i = 0; i < 2000; ++i) {
      frame.begin_step(c, load, c.mass * c.center_of_mass, h);
      frame.end_step(c, load, c.mass * c.center_of_mass, h);
      ASSERT_NEAR(energy(frame), start, allowed) << h << " s, step " << i;
    }
  }
}

TEST_P(Pendulum, AnAcceleratedPivotIsGravityTilted) {
  // Let go from the same pose: in a lift that falls at a, gravity is g − a.
  const Vec3 acceleration{0.0, 2.0, -1.0};
  const double h = 0.01;
  RigidFrame carried = let_go(0.3), tilted = let_go(0.3);
  for (int i = 1; i <= 300; ++i) {
    const double t = i * h;
    carried.set_parent({.pose = {quaternion_from_rotation_vector({0.3, 0, 0}), 0.5 * t * t * acceleration},
                        .velocity = t * acceleration,
                        .acceleration = acceleration});
    step(carried, c, load, h);
    step(tilted, c, {.gravity = kDown - acceleration}, h);
  }
  EXPECT_LT(angle_between(carried.pose().q, tilted.pose().q), 1e4 * kEpsilon);
  EXPECT_LT((carried.pose().p - 4.5 * acceleration).norm(), 64 * kEpsilon);
}

INSTANTIATE_TEST_SUITE_P(PointAndLine, Pendulum, ::testing::Values(FrameMotion::kPoint, FrameMotion::kLine),
                         [](const auto& motion) { return std::string(to_string(motion.param)); });

TEST(RigidFrame, SphericalPendulumKeepsItsVerticalMomentum) {
  // Gravity has no moment about the vertical through the pivot.
  const FrameConstants c = hanging_body(FrameMotion::kPoint, {0.7, 0.9, 0.3}, 0.4);
  RigidFrame frame(c, {quaternion_from_rotation_vector({1.0, 0.3, 0}), Vec3::Zero()}, Vec3::Zero(), {0.4, 0.0, 3.0});
  const double vertical = frame.angular_momentum(c).z();
  for (int i = 0; i < 10000; ++i) step(frame, c, {.gravity = kDown}, 0.01);
  EXPECT_NEAR(frame.angular_momentum(c).z(), vertical, 1e4 * kEpsilon * vertical);
}

TEST(RigidFrame, GovernorStandsAtTheAngleWhereGravityAndSpinAgree) {
  // Hung from a line that turns about the vertical: ω² (I_y − I_z) cos θ = m g l.
  const Vec3 moments{0.7, 0.9, 0.3};
  const FrameConstants c = hanging_body(FrameMotion::kLine, moments, 0.4);
  const double spin = 6.0;
  const double angle = std::acos(c.mass * kGravity * 0.4 / (spin * spin * (moments.y() - moments.z())));
  ASSERT_GT(angle, 0.5);
  const Quaternion tilt = quaternion_from_rotation_vector({angle, 0, 0});
  RigidFrame frame(c, {tilt, Vec3::Zero()}, Vec3::Zero(), Vec3::Zero());
  const double h = 1.0 / 240.0;
  for (int i = 1; i <= 2400; ++i) {
    const Quaternion turned = quaternion_from_rotation_vector({0, 0, spin * h * i}) * tilt;
    frame.set_parent({.pose = {turned, Vec3::Zero()}, .angular_velocity = {0, 0, spin}});
    step(frame, c, {.gravity = kDown}, h);
  }
  // The first half kick is before the parent spins: ½h·mgl sin θ/I of speed makes it swing by 0.005 about that angle.
  const Vec3 down_B = frame.pose().q.conjugate() * Vec3(0, 0, -1);
  EXPECT_NEAR(std::acos(-down_B.z()), angle, 0.01);
}

/// Σ m ∂x/∂θ·(ẍ − g) = 0 for particles on a body turned by θ about a carried line, solved for θ̈ by differences.
double line_acceleration_of_particles(const testing::Particles& body, const Quaternion& q_WK, const KinematicFrame& k,
                                      double rate, const Vec3& gravity) {
  const double dt = 1e-4;
  const auto place = [&](const Vec3& r, double t, double theta) -> Vec3 {
    const Quaternion carried =
        quaternion_from_rotation_vector(t * k.angular_velocity + 0.5 * t * t * k.angular_acceleration) * q_WK;
    return 0.5 * t * t * k.acceleration + carried * (quaternion_from_rotation_vector({theta, 0, 0}) * r);
  };
  const auto residual = [&](double theta_dd) {
    double sum = 0.0;
    for (std::size_t i = 0; i < body.mass.size(); ++i) {
      const auto x = [&](double t) { return place(body.rest[i], t, rate * t + 0.5 * theta_dd * t * t); };
      const Vec3 acceleration = (x(dt) - 2.0 * x(0.0) + x(-dt)) / (dt * dt);
      const Vec3 along = (place(body.rest[i], 0.0, dt) - place(body.rest[i], 0.0, -dt)) / (2.0 * dt);
      sum += body.mass[i] * along.dot(acceleration - gravity);
    }
    return sum;
  };
  const double at_zero = residual(0.0), slope = residual(1.0) - at_zero;
  return -at_zero / slope;
}

TEST(RigidFrame, CarriedLineObeysTheParticlesEquationOfMotion) {
  const testing::SampleOptions options{.motion = FrameMotion::kLine};
  const FrameConstants c(sample_model_data(options));
  const Quaternion q_WK = quaternion_from_rotation_vector({0.7, -0.4, 1.1});
  const KinematicFrame parent{.pose = {q_WK, Vec3::Zero()},
                              .acceleration = {1.0, -2.0, 0.5},
                              .angular_velocity = {0.8, 1.5, -2.0},
                              .angular_acceleration = {3.0, -1.0, 2.0}};
  const double rate = 1.7;
  RigidFrame frame(c, {q_WK, Vec3::Zero()}, Vec3::Zero(), rate * (q_WK * Vec3(1, 0, 0)));
  // One tiny step to tell the parent's rates, then one whose change of θ̇ is θ̈ h.
  const double h = 1e-7;
  const auto line_rate = [&] {
    return (frame.angular_velocity(c) - parent.angular_velocity).dot(frame.pose().q * Vec3(1, 0, 0));
  };
  frame.set_parent(parent);
  step(frame, c, {.gravity = kDown}, h);
  const double before = line_rate();
  frame.set_parent(parent);
  step(frame, c, {.gravity = kDown}, h);
  const double expected = line_acceleration_of_particles(testing::sample_particles(options), q_WK, parent, rate, kDown);
  EXPECT_NEAR((line_rate() - before) / h, expected,
              1e-5 * std::abs(expected));  // differences: 1e-6, and 1e-7 of travel
}

TEST(RigidFrame, KinematicFrameGoesWhereItIsToldAndElseCoasts) {
  const FrameConstants c(sample_model_data({.motion = FrameMotion::kKinematic}));
  RigidFrame frame(c, {}, {1, 0, 0}, {0, 0, 2});
  step(frame, c, {.gravity = kDown, .force = {5, 5, 5}, .torque = {5, 5, 5}}, 0.5);
  EXPECT_LT((frame.pose().p - Vec3(0.5, 0, 0)).norm(), kEpsilon);
  EXPECT_LT(angle_between(frame.pose().q, quaternion_from_rotation_vector({0, 0, 1})), 8 * kEpsilon);
  frame.set_parent({.pose = {{}, {7, 8, 9}}, .velocity = {0, 1, 0}});
  step(frame, c, {}, 0.5);
  EXPECT_EQ(frame.pose().p, Vec3(7, 8, 9));
  step(frame, c, {}, 0.5);
  EXPECT_EQ(frame.pose().p, Vec3(7, 8.5, 9));
}

TEST(RigidFrame, KineticEnergyIsThatOfTheParticles) {
  for (const FrameMotion motion : testing::kAllMotions) {
    const testing::SampleOptions options{.motion = motion};
    const FrameConstants c(sample_model_data(options));
    const testing::Particles body = testing::sample_particles(options);
    const RigidFrame frame(c, {quaternion_from_rotation_vector({1, 2, 3}), {1, 1, 1}}, {1, -2, 0.5}, {2, 3, -1});
    double energy = 0.0;
    Vec3 momentum = Vec3::Zero();
    for (std::size_t i = 0; i < body.mass.size(); ++i) {
      const Vec3 v = frame.velocity() + frame.angular_velocity(c).cross(frame.pose().q * body.rest[i]);
      energy += 0.5 * body.mass[i] * v.squaredNorm();
      momentum += body.mass[i] * v;
    }
    EXPECT_NEAR(frame.kinetic_energy(c), energy, 32 * kEpsilon * energy) << to_string(motion);
    EXPECT_LT((frame.linear_momentum(c) - momentum).norm(), 32 * kEpsilon * momentum.norm()) << to_string(motion);
  }
}

TEST(RigidFrame, DecayIsWhatExponentialsSay) {
  EXPECT_EQ(Decay(0.0).left, 1.0);
  EXPECT_EQ(Decay(0.0).first, 1.0);
  EXPECT_EQ(Decay(0.0).second, 0.5);
  for (const double x : {1e-12, 1e-6, 0.01, 0.5, std::nextafter(1.0, 0.0), 1.0, 3.0, 40.0}) {
    const Decay decay(x);
    EXPECT_NEAR(decay.left, std::exp(-x), 4 * kEpsilon) << x;
    EXPECT_NEAR(decay.first, -std::expm1(-x) / x, 4 * kEpsilon) << x;
    const double second = x < 0.01 ? 0.5 - x / 6.0 : (x + std::expm1(-x)) / (x * x);
    EXPECT_NEAR(decay.second, second, 1e-12 + x * x * (x < 0.01)) << x;
  }
}

/// v̇ = a − c v, L̇ = −c L: the same end by one step as by many, and that of the formulas.
TEST(RigidFrame, DampedFlightIsExactForAnyStep) {
  const ModalModelData data = sample_model_data({});
  const FrameConstants c(data);
  constexpr double kLinear = 0.7, kAngular = 1.3, kTime = 2.0;
  const Vec3 v(1, -2, 3), omega(0.5, 3.0, -0.2);
  RigidFrame whole(c, {}, v, omega);
  whole.set_settings(c, {.linear_damping = kLinear, .angular_damping = kAngular});
  RigidFrame parts = whole, undamped(c, {}, v, omega);
  const Vec3 L = whole.angular_momentum(c);
  step(whole, c, {.gravity = kDown}, kTime);
  for (int i = 0; i < 100; ++i) step(parts, c, {.gravity = kDown}, kTime / 100);
  const double left = std::exp(-kLinear * kTime);
  const Vec3 terminal = kDown / kLinear;
  EXPECT_LT((whole.velocity() - (terminal + left * (v - terminal))).norm(), 1e-14 * terminal.norm());
  EXPECT_LT((whole.pose().p - (kTime * terminal + (1.0 - left) / kLinear * (v - terminal))).norm(), 1e-13);
  EXPECT_LT((whole.angular_momentum(c) - std::exp(-kAngular * kTime) * L).norm(), 1e-14 * L.norm());
  step(undamped, c, {}, -std::expm1(-kAngular * kTime) / kAngular);
  EXPECT_LT(angle_between(whole.pose().q, undamped.pose().q), 1e-12);
  EXPECT_LT((whole.pose().p - parts.pose().p).norm(), 1e-13);
  EXPECT_LT((whole.velocity() - parts.velocity()).norm(), 1e-13);
  EXPECT_LT(angle_between(whole.pose().q, parts.pose().q), 1e-11);
}

/// The path that searches follow ends where the step does.
TEST(RigidFrame, ThePathOfADampedOrLockedFrameEndsAtItsEnd) {
  const FrameConstants c(sample_model_data({}));
  const FrameSettings damped{.linear_damping = 2.0, .angular_damping = 3.0},
      locked{.locks = {.translation = {true, false, false}, .rotation = {false, true, true}}};
  for (const FrameSettings& settings : {damped, locked}) {
    RigidFrame frame(c, {}, {1, -2, 3}, {0.5, 3.0, -0.2});
    frame.set_settings(c, settings);
    FramePath path;
    constexpr double h = 0.1;
    frame.begin_step(c, {.gravity = kDown}, Vec3::Zero(), h, &path);
    frame.end_step(c, {.gravity = kDown}, Vec3::Zero(), h, &path);
    const RigidTransform almost = path.pose(h * (1.0 - 1e-13));
    EXPECT_LT((almost.p - frame.pose().p).norm(), 1e-12);
    EXPECT_LT(angle_between(almost.q, frame.pose().q), 1e-12);
    EXPECT_EQ(path.velocity(h), frame.velocity());
  }
}

/// One axis left: e·L and so ω stay, whatever the body's axes are.
TEST(RigidFrame, ABodyThatMayTurnAboutOneAxisTurnsSteadily) {
  const ModalModelData data = sample_model_data({});
  const FrameConstants c(data);
  const Quaternion q = quaternion_from_rotation_vector({1.0, 0.3, -0.5});
  RigidFrame frame(c, {.q = q}, {1, 2, 3}, {0.5, 3.0, -0.2});
  const Vec3 L = frame.angular_momentum(c);
  frame.set_settings(c, {.locks = {.translation = {false, true, false}, .rotation = {true, false, true}}});
  const Mat3 inertia = to_matrix(q) * data.inertia * to_matrix(q).transpose();
  const double rate = L.y() / inertia(1, 1);
  EXPECT_EQ(frame.velocity(), Vec3(1, 0, 3));
  for (int i = 0; i < 50; ++i) step(frame, c, {.gravity = {0, -5, 0}, .torque = {3, 0, 4}}, 0.1);
  EXPECT_LT((frame.angular_velocity(c) - Vec3(0, rate, 0)).norm(), 1e-12 * rate);
  EXPECT_LT(angle_between(frame.pose().q, quaternion_from_rotation_vector({0, 5.0 * rate, 0}) * q), 1e-10);
  EXPECT_LT((frame.pose().p - Vec3(5, 0, 15)).norm(), 1e-12);
}

/// Two axes left, a rolling constraint: what holds ω_z at 0 does no work and has no moment about the others.
TEST(RigidFrame, ABodyThatMayTurnAboutTwoAxesKeepsEnergyAndMomentumAboutThem) {
  const FrameConstants c(sample_model_data({}));
  RigidFrame frame(c, {}, Vec3::Zero(), Vec3::Zero());
  frame.set_settings(c, {.locks = {.rotation = {false, false, true}}});
  frame.set_velocity(c, Vec3::Zero(), {2.0, 3.0, 5.0});
  EXPECT_LT((frame.angular_velocity(c) - Vec3(2.0, 3.0, 0.0)).norm(), 1e-14);
  const Vec3 L = frame.angular_momentum(c);
  const double energy = frame.kinetic_energy(c);
  double drift = 0.0, turned = 0.0;
  for (int i = 0; i < 2400; ++i) {
    const Vec3 before = frame.angular_velocity(c);
    step(frame, c, {}, 1.0 / 240.0);
    EXPECT_EQ(frame.angular_velocity(c).z(), 0.0);
    drift = std::max(drift, std::abs(frame.kinetic_energy(c) / energy - 1.0));
    turned = std::max(turned, (frame.angular_velocity(c) - before).norm());
  }
  EXPECT_LT((frame.angular_momentum(c) - L).head<2>().norm(), 1e-12 * L.norm());
  EXPECT_LT(drift, 1e-4);  // of a rule of second order
  EXPECT_GT(turned, 0.0);
}

}  // namespace
}  // namespace limber
