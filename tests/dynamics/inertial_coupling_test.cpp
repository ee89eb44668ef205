#include "limber/dynamics/inertial_coupling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "constants.h"
#include "counted_new.h"
#include "limber/core/error.h"
#include "limber/core/state_archive.h"
#include "limber/dynamics/body_group.h"
#include "sample_models.h"

namespace limber {
namespace {

using testing::kPi;
using testing::Particles;
using testing::sample_model;
using testing::sample_particles;
using testing::SampleOptions;

std::vector<double> some_numbers(std::size_t count, double size, double phase) {
  std::vector<double> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = size * std::sin(2.3 * static_cast<double>(i) + phase);
  return out;
}

/// The masses of a body, one by one.
struct Masses {
  double kinetic = 0.0;
  Vec3 angular_momentum = Vec3::Zero();
};

Masses masses_of(const Particles& body, const BodyGroup& group, Index slot) {
  Masses sum;
  const RigidTransform& pose = group.frame(slot).pose();
  const Vec3 omega_W = group.angular_velocity(slot);
  for (std::size_t p = 0; p < body.mass.size(); ++p) {
    Vec3 x = body.rest[p], v = Vec3::Zero();
    for (std::size_t i = 0; i < body.shape.size(); ++i) {
      x += group.amplitudes(slot)[i] * body.shape[i][p];
      v += group.rates(slot)[i] * body.shape[i][p];
    }
    const Vec3 arm = pose.q * x, velocity = omega_W.cross(arm) + pose.q * v;
    sum.kinetic += 0.5 * body.mass[p] * velocity.squaredNorm();
    sum.angular_momentum += body.mass[p] * arm.cross(velocity);
  }
  return sum;
}

double kinetic_energy(const BodyEnergy& e) { return e.kinetic_rigid + e.kinetic_modal; }

class CoupledSample : public ::testing::Test {
 protected:
  static inline const SampleOptions kOptions{.modes = 12, .lowest_hz = 6.0};
  Particles masses = sample_particles(kOptions);

  BodyGroup body(double step, double bend, const Vec3& omega) {
    BodyGroup group(sample_model(kOptions), step);
    const Index slot =
        group.add({quaternion_from_rotation_vector({0.3, -0.5, 0.2}), Vec3::Zero()}, Vec3::Zero(), omega);
    group.couple(slot);
    group.set_amplitudes(slot, some_numbers(12, bend, 0.4), some_numbers(12, 40.0 * bend, 1.7));
    return group;
  }
};

TEST_F(CoupledSample, HasTheEnergyAndTheMomentumOfItsMasses) {
  const BodyGroup group = body(0.01, 0.02, {5.0, -3.0, 4.0});
  const Masses sum = masses_of(masses, group, 0);
  EXPECT_NEAR(kinetic_energy(group.energy(0, Vec3::Zero())), sum.kinetic, 1e-6 * sum.kinetic);  // shapes are floats
  const Vec3 L = group.frame(0).angular_momentum(group.frame_constants());
  EXPECT_LT((L - sum.angular_momentum).norm(), 1e-6 * L.norm());
  EXPECT_LT((group.angular_velocity(0) - Vec3(5.0, -3.0, 4.0)).norm(), 1e-12);
  EXPECT_NEAR(group.rates(0)[3], some_numbers(12, 0.8, 1.7)[3], 1e-13);
}

TEST_F(CoupledSample, KeepsItsMomentumAndItsEnergyOverTenThousandSteps) {
  BodyGroup group = body(1.0 / 240.0, 0.01, {5.0, -3.0, 4.0});
  const Vec3 before = masses_of(masses, group, 0).angular_momentum;
  const Vec3 told = group.frame(0).angular_momentum(group.frame_constants());
  const double energy = group.energy(0, Vec3::Zero()).total();
  double most = 0.0, early = 0.0;
  for (int n = 0; n < 10000; ++n) {
    group.advance(0, 1, Vec3::Zero());
    most = std::max(most, std::abs(group.energy(0, Vec3::Zero()).total() / energy - 1.0));
    if (n == 999) early = most;
  }
  EXPECT_LT(most, 1e-4);
  EXPECT_LT(most, 1.5 * early);  // no drift
  const Vec3 after = masses_of(masses, group, 0).angular_momentum;
  EXPECT_LT((group.frame(0).angular_momentum(group.frame_constants()) - told).norm(), 1e-12 * told.norm());
  EXPECT_LT((after - before).norm(), 1e-6 * before.norm());  // shapes are floats
}

TEST_F(CoupledSample, GoesTheSameWayInShorterStepsToSecondOrder) {
  const auto place_after = [&](int steps) -> Vec3 {
    BodyGroup group = body(0.2 / steps, 0.01, {5.0, -3.0, 4.0});
    for (int n = 0; n < steps; ++n) group.advance(0, 1, Vec3::Zero());
    return group.frame(0).pose().q * Vec3(0.3, 0.2, 0.1) + Vec3(group.amplitudes(0)[0], group.amplitudes(0)[4], 0.0);
  };
  const Vec3 exact = place_after(6400);
  const double coarse = (place_after(100) - exact).norm(), fine = (place_after(200) - exact).norm();
  EXPECT_GT(coarse, 1e-9);
  EXPECT_NEAR(coarse / fine, 4.0, 0.5);
}

TEST_F(CoupledSample, TurnsAsTheRestShapeWhereNothingBends) {
  const Vec3 omega(5.0, -3.0, 4.0);
  BodyGroup group = body(0.02, 0.0, omega);
  RigidFrame alone(group.frame_constants(), group.frame(0).pose(), Vec3::Zero(), omega);
  BodyGroup stiff(sample_model({.modes = 12, .lowest_hz = 6e5}), 0.02);
  const Index slot = stiff.add(group.frame(0).pose(), Vec3::Zero(), omega);
  stiff.couple(slot);
  for (int n = 0; n < 50; ++n) {
    stiff.advance(0, 1, Vec3::Zero());
    alone.begin_step(group.frame_constants(), {}, Vec3::Zero(), 0.02);
    alone.end_step(group.frame_constants(), {}, Vec3::Zero(), 0.02);
  }
  EXPECT_LT(rotation_vector(stiff.frame(slot).pose().q.conjugate() * alone.pose().q).norm(), 1e-8);
}

TEST_F(CoupledSample, OneModeRingsExactlyWhereNothingTurns) {
  BodyGroup coupled = body(0.02, 0.0, Vec3::Zero()), alone(sample_model(kOptions), 0.02);
  alone.add({}, Vec3::Zero(), Vec3::Zero());
  std::vector<double> z(12, 0.0), rest(12, 0.0);
  z[3] = 0.05;
  coupled.set_amplitudes(0, z, rest), alone.set_amplitudes(0, z, rest);
  for (int n = 0; n < 50; ++n) coupled.advance(0, 1, Vec3::Zero()), alone.advance(0, 1, Vec3::Zero());
  for (std::size_t i = 0; i < 12; ++i) EXPECT_NEAR(coupled.amplitudes(0)[i], alone.amplitudes(0)[i], 1e-9);
}

TEST_F(CoupledSample, AnImpulseGivesItsMomentum) {
  BodyGroup group = body(0.01, 0.02, {5.0, -3.0, 4.0});
  const Masses before = masses_of(masses, group, 0);
  const Vec3 impulse(0.4, -0.2, 0.7), arm = group.position(0, testing::kMarked);
  group.apply_impulse(0, testing::kMarked, impulse, 0.0);
  const Masses after = masses_of(masses, group, 0);
  EXPECT_LT((after.angular_momentum - before.angular_momentum - arm.cross(impulse)).norm(), 1e-6);
}

TEST_F(CoupledSample, AForceOnAPointMovesWithItToSecondOrder) {
  const auto momentum_after = [&](int steps) -> Vec3 {
    BodyGroup group = body(0.2 / steps, 0.01, {5.0, -3.0, 4.0});
    for (int n = 0; n < steps; ++n) {
      group.apply_force(0, testing::kMarked, {3.0, 1.0, -2.0});
      group.advance(0, 1, Vec3::Zero());
    }
    return group.frame(0).angular_momentum(group.frame_constants());
  };
  const Vec3 exact = momentum_after(3200);
  const double coarse = (momentum_after(50) - exact).norm(), fine = (momentum_after(100) - exact).norm();
  EXPECT_GT(coarse, 1e-7);
  EXPECT_NEAR(coarse / fine, 4.0, 0.5);
}

TEST_F(CoupledSample, GoesOnFromASavedStateInTheSameBits) {
  BodyGroup group = body(0.01, 0.02, {5.0, -3.0, 4.0});
  std::vector<std::byte> bytes;
  StateWriter writer(bytes);
  group.save_state(0, writer);
  const auto run = [&] {
    for (int n = 0; n < 20; ++n) group.advance(0, 1, Vec3::Zero());
    return std::pair(group.rates(0)[2], group.angular_velocity(0).x());
  };
  const auto first = run();
  StateReader reader(bytes);
  group.restore_state(0, reader);
  EXPECT_EQ(run(), first);
}

TEST_F(CoupledSample, AStepAllocatesNothing) {
  BodyGroup group = body(0.01, 0.02, {5.0, -3.0, 4.0});
  group.advance(0, 1, Vec3::Zero());
  const long before = testing::allocations();
  group.advance(0, 1, Vec3::Zero());
  EXPECT_EQ(testing::allocations(), before);
}

TEST_F(CoupledSample, RefusesFixedBodiesAndThoseWithoutAVolume) {
  BodyGroup fixed(sample_model({.motion = FrameMotion::kPoint}), 0.01);
  fixed.add({}, Vec3::Zero(), Vec3::Zero());
  EXPECT_THROW(fixed.couple(0), InvalidArgument);
  ModalModelData data = testing::sample_model_data(kOptions);
  data.volume_block.reset();
  BodyGroup empty(std::make_shared<const ModalModel>(std::move(data)), 0.01);
  empty.add({}, Vec3::Zero(), Vec3::Zero());
  EXPECT_THROW(empty.couple(0), InvalidArgument);
}

/// A slender bar along x of length and wave speed 1, in slices. Its modes: `stretches` of the free bar, or the first
/// bending shape of a free beam in y and in z.
struct Slices {
  static constexpr int kCount = 400;
  double mass = 1.0, length = 1.0;

  ModalModelData data(const std::vector<std::function<Vec3(double)>>& shapes, std::vector<double> eigenvalues,
                      double decay) const {
    ModalModelData d = testing::sample_model_data({.modes = 0, .half_extent = {0.5, 0.01, 0.01}});
    d.name = "bar";
    d.mass = mass, d.inertia = Vec3(1e-4, 1.0 / 12.0, 1.0 / 12.0).asDiagonal();
    d.eigenvalues = std::move(eigenvalues);
    d.decays.assign(shapes.size(), decay);
    d.participation.assign(shapes.size(), Vec3::Zero());
    const auto k = static_cast<Index>(shapes.size());
    d.render.basis = ModalBasis(d.render.vertices(), k);
    ModalVolume& volume = *d.volume_block;
    volume.rest.resize(kCount, Vec3::Zero());
    volume.basis = ModalBasis(kCount, k), volume.mass_times_basis = ModalBasis(kCount, k);
    for (Index i = 0; i < k; ++i) {
      Mat3 moment = Mat3::Zero();
      for (Index s = 0; s < kCount; ++s) {
        const double x = (s + 0.5) / kCount - 0.5;
        const Vec3 w = shapes[static_cast<std::size_t>(i)](x);
        moment += Vec3(x, 0.0, 0.0) * w.transpose() / kCount;
        volume.basis.set(s, i, w.cast<float>());
        volume.mass_times_basis.set(s, i, (w / kCount).cast<float>());
      }
      for (Index v = 0; v < 8; ++v)
        d.render.basis.set(v, i, shapes[static_cast<std::size_t>(i)]((v & 1) ? 0.5 : -0.5).cast<float>());
      d.moments.push_back(moment);
    }
    return d;
  }
};

/// u″ + (ω/c)² (x + u) = 0 with free ends: u(½) = tan(κ/2)/κ − ½, κ = ω/c. A bar that spins and rings comes to it as
/// its own damping takes the ringing, in steps of up to a quarter of its period too.
TEST(SpinningBar, StretchesAsItsClosedForm) {
  std::vector<std::function<Vec3(double)>> shapes;
  std::vector<double> eigenvalues;
  for (int i = 1; i <= 15; i += 2) {
    shapes.push_back([i](double x) -> Vec3 { return std::sqrt(2.0) * std::cos(i * kPi * (x + 0.5)) * Vec3::UnitX(); });
    eigenvalues.push_back(i * i * kPi * kPi);
  }
  for (const double step : {0.02, 0.2, 0.5}) {
    BodyGroup group(std::make_shared<const ModalModel>(Slices{}.data(shapes, eigenvalues, 0.05)), step);
    const Index slot = group.add({}, Vec3::Zero(), {0.0, 0.0, 0.5});
    group.couple(slot);
    for (int n = 0; n < 200.0 / step; ++n) group.advance(0, 1, Vec3::Zero());
    const double omega = group.angular_velocity(slot).z();
    double stretch = 0.0;
    for (std::size_t i = 0; i < shapes.size(); ++i) stretch += group.amplitudes(slot)[i] * shapes[i](0.5).x();
    const double expected = std::tan(0.5 * omega) / omega - 0.5;
    EXPECT_NEAR(stretch, expected, 0.01 * expected) << step;
    EXPECT_LT(omega, 0.499);  // the inertia grew
  }
}

/// A square bar that spins about its length and is plucked: the plane in which it bends stays in space while the bar
/// turns 1.9 times in it, as Foucault's rod does, in steps of a third of a period.
TEST(SpinningBar, BendsInAPlaneThatStaysInSpace) {
  const auto beam = [](double x) { return std::sqrt(2.0) * std::cos(2.0 * kPi * x); };
  const std::vector<std::function<Vec3(double)>> shapes{[&](double x) -> Vec3 { return beam(x) * Vec3::UnitY(); },
                                                        [&](double x) -> Vec3 { return beam(x) * Vec3::UnitZ(); }};
  const double frequency = 40.0 * kPi;
  for (const double step : {1.0 / 60.0, 1.0 / 240.0}) {
    BodyGroup group(
        std::make_shared<const ModalModel>(Slices{}.data(shapes, {frequency * frequency, frequency * frequency}, 0.0)),
        step);
    const Index slot = group.add({}, Vec3::Zero(), {12.0, 0.0, 0.0});
    group.couple(slot);
    group.set_amplitudes(slot, std::vector{1e-4, 0.0}, std::vector{0.0, -12.0 * 1e-4});  // at rest in space
    double out_of_plane = 0.0;
    for (int n = 0; n < 1.0 / step; ++n) {
      group.advance(0, 1, Vec3::Zero());
      const std::span<const double> z = group.amplitudes(slot);
      out_of_plane = std::max(out_of_plane, std::abs((group.frame(slot).pose().q * Vec3(0.0, z[0], z[1])).z()));
    }
    EXPECT_LT(out_of_plane, 1e-6) << step;
  }
}

}  // namespace
}  // namespace limber
