#include "limber/dynamics/body_group.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <limits>

#include "constants.h"
#include "limber/core/error.h"
#include "sample_models.h"

namespace limber {
namespace {

using testing::kDown;
using testing::kEpsilon;
using testing::Particles;
using testing::sample_model;
using testing::sample_particles;
using testing::SampleOptions;

const Quaternion kTurned = quaternion_from_rotation_vector({0.7, -0.4, 1.1});

/// −Σ m w_i·Rᵀ(ẍ − g) of the rest shape, moved along o(t) + R(t) r, by differences in time.
double inertial_force(const Particles& body, std::size_t mode, const KinematicFrame& k, const Vec3& gravity) {
  const double dt = 1e-4;
  const auto place = [&](const Vec3& r, double t) -> Vec3 {
    const Vec3 turn = t * k.angular_velocity + 0.5 * t * t * k.angular_acceleration;
    return 0.5 * t * t * k.acceleration + quaternion_from_rotation_vector(turn) * (k.pose.q * r);
  };
  double sum = 0.0;
  for (std::size_t i = 0; i < body.mass.size(); ++i) {
    const Vec3& r = body.rest[i];
    const Vec3 acceleration = (place(r, dt) - 2.0 * place(r, 0.0) + place(r, -dt)) / (dt * dt);
    sum -= body.mass[i] * body.shape[mode][i].dot(k.pose.q.conjugate() * (acceleration - gravity));
  }
  return sum;
}

TEST(SampleModels, ShapesAreMassOrthonormalAndFreeOfTheMotionsLeftFree) {
  for (const FrameMotion motion : testing::kAllMotions) {
    const Particles body = sample_particles({.motion = motion, .modes = 40});
    for (std::size_t i = 0; i < 40; ++i) {
      Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
      for (std::size_t a = 0; a < body.mass.size(); ++a) {
        linear += body.mass[a] * body.shape[i][a];
        angular += body.mass[a] * body.rest[a].cross(body.shape[i][a]);
      }
      if (motion == FrameMotion::kFree) {
        EXPECT_LT(linear.norm(), 1e-14);
      }
      if (motion == FrameMotion::kFree || motion == FrameMotion::kPoint) {
        EXPECT_LT(angular.norm(), 1e-14);
      }
      if (motion == FrameMotion::kLine) {
        EXPECT_LT(std::abs(angular.x()), 1e-14);
      }
      for (std::size_t j = 0; j <= i; ++j) {
        double inner = 0.0;
        for (std::size_t a = 0; a < body.mass.size(); ++a)
          inner += body.mass[a] * body.shape[i][a].dot(body.shape[j][a]);
        EXPECT_NEAR(inner, i == j ? 1.0 : 0.0, 1e-14);
      }
    }
  }
}

TEST(BodyGroup, ModesFeelTheInertialForcesThatTheParticlesFeel) {
  const SampleOptions options{.motion = FrameMotion::kKinematic};
  const Particles body = sample_particles(options);
  const double h = 1e-6;
  BodyGroup group(sample_model(options), h);
  const Index slot = group.add({kTurned, Vec3::Zero()}, Vec3::Zero(), Vec3::Zero());
  const KinematicFrame parent{.pose = {kTurned, Vec3::Zero()},
                              .acceleration = {1.0, -2.0, 0.5},
                              .angular_velocity = {0.8, 1.5, -2.0},
                              .angular_acceleration = {3.0, -1.0, 2.0}};
  group.set_parent(slot, parent);
  group.advance(0, 1, kDown);  // tells the angular velocity
  const std::vector<double> zero(4, 0.0);
  group.set_amplitudes(slot, zero, zero);
  group.set_parent(slot, parent);
  group.advance(0, 1, kDown);
  for (std::size_t i = 0; i < 4; ++i) {
    const double expected = inertial_force(body, i, parent, kDown);
    // ż = g h to (ωh)²; the differences are good to 1e-6 of the largest force.
    EXPECT_NEAR(group.rates(slot)[i] / h, expected, 3e-6 * (std::abs(expected) + 1.0)) << "mode " << i;
  }
}

TEST(BodyGroup, HungBodySagsByGravityOverStiffness) {
  // Strong damping and a long time: z → p·Rᵀg/λ with R hanging straight down.
  const SampleOptions options{.motion = FrameMotion::kKinematic, .decay = 20.0};
  const auto model = sample_model(options);
  BodyGroup group(model, 0.1);
  const Index slot = group.add({kTurned, Vec3::Zero()}, Vec3::Zero(), Vec3::Zero());
  for (int i = 0; i < 200; ++i) group.advance(0, 1, kDown);
  for (std::size_t i = 0; i < 4; ++i) {
    const double expected =
        model->data().participation[i].dot(kTurned.conjugate() * kDown) / model->data().eigenvalues[i];
    EXPECT_NEAR(group.amplitudes(slot)[i], expected, 1e-13) << "mode " << i;
  }
}

TEST(BodyGroup, ShakenBaseGivesTheClosedFormOfABaseExcitedOscillator) {
  const SampleOptions options{.motion = FrameMotion::kKinematic, .modes = 1, .decay = 2.0};
  const auto model = sample_model(options);
  const double lambda = model->data().eigenvalues[0], xi = model->data().decays[0];
  const double p = model->data().participation[0].x();
  ASSERT_GT(std::abs(p), 0.01);
  // x = A sin Ωt: z̈ + 2ξż + λz = p A Ω² sin Ωt from rest, z = Im(Z e^{iΩt}) + e^{−ξt}(a cos ω_d t + b sin ω_d t).
  const double A = 0.05, Omega = 12.0, time = 1.7, omega_d = std::sqrt(lambda - xi * xi);
  const std::complex<double> Z = p * A * Omega * Omega / std::complex<double>(lambda - Omega * Omega, 2.0 * xi * Omega);
  const double a = -Z.imag(), b = (xi * a - Omega * Z.real()) / omega_d;
  const double expected = (Z * std::polar(1.0, Omega * time)).imag() +
                          std::exp(-xi * time) * (a * std::cos(omega_d * time) + b * std::sin(omega_d * time));
  const auto error = [&](int steps) {
    const double h = time / steps;
    BodyGroup group(model, h);
    const Index slot = group.add({}, Vec3::Zero(), Vec3::Zero());
    for (int i = 0; i < steps; ++i) {
      const double end = (i + 1) * h, middle = (i + 0.5) * h;
      group.set_parent(slot, {.pose = {{}, {A * std::sin(Omega * end), 0, 0}},
                              .velocity = {A * Omega * std::cos(Omega * end), 0, 0},
                              .acceleration = {-A * Omega * Omega * std::sin(Omega * middle), 0, 0}});
      group.advance(0, 1, Vec3::Zero());
    }
    return std::abs(group.amplitudes(slot)[0] - expected);
  };
  EXPECT_LT(error(2000), 1e-5 * std::abs(Z));
  EXPECT_NEAR(std::log2(error(200) / error(400)), 2.0, 0.1);
}

TEST(BodyGroup, ConstantAccelerationIsExactForAnyStep) {
  const SampleOptions options{.motion = FrameMotion::kKinematic, .decay = 2.0};
  const auto model = sample_model(options);
  const Vec3 acceleration{0.0, 3.0, 0.0};
  const auto run = [&](int steps) {
    BodyGroup group(model, 1.0 / steps);
    const Index slot = group.add({}, Vec3::Zero(), Vec3::Zero());
    for (int i = 1; i <= steps; ++i) {
      const double t = static_cast<double>(i) / steps;
      group.set_parent(
          slot, {.pose = {{}, 0.5 * t * t * acceleration}, .velocity = t * acceleration, .acceleration = acceleration});
      group.advance(0, 1, Vec3::Zero());
    }
    return std::vector<double>(group.amplitudes(slot).begin(), group.amplitudes(slot).end());
  };
  const auto once = run(1), often = run(1000);
  for (std::size_t i = 0; i < once.size(); ++i) EXPECT_NEAR(once[i], often[i], 1e-13);
}

TEST(BodyGroup, SoftPendulumKeepsItsEnergy) {
  // Swing and flexing exchange energy through gravity acting on the deformed centre of mass.
  const SampleOptions options{.motion = FrameMotion::kPoint, .lowest_hz = 2.0};
  const auto model = sample_model(options);
  const auto worst = [&](double h) {
    BodyGroup group(model, h);
    const Index slot = group.add({quaternion_from_rotation_vector({1.2, 0, 0}), Vec3::Zero()}, Vec3::Zero(), {0, 1, 0});
    const auto energy = [&] {
      const RigidFrame& frame = group.frame(slot);
      double e = frame.kinetic_energy(group.frame_constants()) - kDown.dot(frame.pose().q * group.first_moment(slot));
      for (std::size_t i = 0; i < 4; ++i)
        e += 0.5 * (group.rates(slot)[i] * group.rates(slot)[i] +
                    model->data().eigenvalues[i] * group.amplitudes(slot)[i] * group.amplitudes(slot)[i]);
      return e;
    };
    const double start = energy();
    double error = 0.0;
    for (int i = 0; i < static_cast<int>(20.0 / h); ++i) {
      group.advance(0, 1, kDown);
      error = std::max(error, std::abs(energy() - start));
    }
    return error;
  };
  const double scale = 2.8 * 9.8 * 0.5;  // about m g l, J
  EXPECT_LT(worst(1.0 / 240.0), 0.01 * scale);
  EXPECT_NEAR(std::log2(worst(1.0 / 240.0) / worst(1.0 / 480.0)), 2.0, 0.4);
}

TEST(BodyGroup, DelayedImpulseIsThatOfASplitStep) {
  const auto model = sample_model({.decay = 1.0});
  const SurfacePoint at{.triangle = 4, .weight = {0.1, 0.2, 0.7}};
  const Vec3 impulse{0.3, 0.2, -0.5};
  BodyGroup whole(model, 0.1), first(model, 0.037), rest(model, 0.063);
  for (BodyGroup* group : {&whole, &first, &rest}) group->add({}, Vec3::Zero(), Vec3::Zero());
  const std::vector<double> z{0.01, -0.02, 0.03, 0.005}, rates{0.4, 0.1, -0.2, 0.3};
  whole.set_amplitudes(0, z, rates);
  first.set_amplitudes(0, z, rates);
  whole.apply_impulse(0, at, impulse, 0.037);
  whole.advance(0, 1, Vec3::Zero());
  first.advance(0, 1, Vec3::Zero());
  rest.set_amplitudes(0, first.amplitudes(0), first.rates(0));
  rest.apply_impulse(0, at, impulse, 0.0);
  rest.advance(0, 1, Vec3::Zero());
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(whole.amplitudes(0)[i], rest.amplitudes(0)[i], 32 * kEpsilon);
    EXPECT_NEAR(whole.rates(0)[i], rest.rates(0)[i], 64 * kEpsilon);
  }
}

TEST(BodyGroup, HeldForceDisplacesModesByItsClosedForm) {
  const auto model = sample_model({.decay = 1.0});
  const SurfacePoint at{.triangle = 4, .weight = {0.1, 0.2, 0.7}};
  BodyGroup group(model, 0.2);
  group.add({kTurned, Vec3::Zero()}, Vec3::Zero(), Vec3::Zero());
  const Vec3 force{1.0, -2.0, 3.0};
  group.apply_force(0, at, 0.25 * force);
  group.apply_force(0, at, 0.75 * force);
  group.advance(0, 1, Vec3::Zero());
  for (Index i = 0; i < 4; ++i) {
    const auto m = static_cast<std::size_t>(i);
    const ModePropagator p = propagator({model->data().eigenvalues[m], model->data().decays[m]}, 0.2);
    const double g = shape_at(*model, at, i).dot(kTurned.conjugate() * force);
    EXPECT_NEAR(group.amplitudes(0)[m], p.z_g * g, 16 * kEpsilon * std::abs(g));
  }
  const double mass = model->data().mass;
  EXPECT_LT((group.frame(0).linear_momentum(group.frame_constants()) - 0.2 * force).norm(), 16 * kEpsilon * mass);
  group.advance(0, 1, Vec3::Zero());  // held over one step only
  EXPECT_LT((group.frame(0).linear_momentum(group.frame_constants()) - 0.2 * force).norm(), 16 * kEpsilon * mass);
}

TEST(BodyGroup, RemovedSlotsAreUsedAgainAndStartClean) {
  BodyGroup group(sample_model(), 0.01);
  for (int i = 0; i < 3; ++i) group.add({}, Vec3::Zero(), Vec3::Zero());
  group.apply_impulse(1, {.triangle = 0}, {1, 1, 1}, 0.005);
  group.apply_force(1, {.triangle = 0}, {1, 1, 1});
  group.remove(1);
  EXPECT_EQ(group.count(), 2);
  EXPECT_EQ(group.add({}, Vec3::Zero(), Vec3::Zero()), 1);
  EXPECT_EQ(group.slots(), 3);
  group.advance(0, 3, Vec3::Zero());
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(group.amplitudes(1)[i], 0.0);
  EXPECT_EQ(group.frame(1).velocity(), Vec3(Vec3::Zero()));
}

TEST(BodyGroup, RefusesNoModelAndNoStep) {
  EXPECT_THROW(BodyGroup(nullptr, 0.1), InvalidArgument);
  EXPECT_THROW(BodyGroup(sample_model(), 0.0), InvalidArgument);
  EXPECT_THROW(BodyGroup(sample_model(), std::nan("")), InvalidArgument);
}

}  // namespace
}  // namespace limber
