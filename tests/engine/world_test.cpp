#include "limber/engine/world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "asked.h"
#include "constants.h"
#include "limber/core/error.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "sample_models.h"
#include "thread_jobs.h"

namespace limber {
namespace {

using ::testing::HasSubstr;
using testing::kEpsilon;
using testing::kMarked;
using testing::sample_model;
using testing::ThreadJobs;

const Vec3 kNoGravity = Vec3::Zero();
const Quaternion kTurned = quaternion_from_rotation_vector({0.7, -0.4, 1.1});

std::vector<double> copy(std::span<const double> values) { return {values.begin(), values.end()}; }

std::string message_of(const auto& action) {
  try {
    action();
  } catch (const InvalidArgument& e) {
    return e.what();
  }
  return "no error";
}

// Motion
// ---------------------------------------------------------------------------------------------------------------

TEST(World, FreeBodyFallsOnItsParabola) {
  World world({.step = 0.01});
  const BodyId body = world.add_body(sample_model(), {.pose = {.p = {1, 2, 3}}, .velocity = {1, -2, 4}});
  while (world.step_count() < 1000) world.step();
  const double t = 10.0;
  const Vec3 expected = Vec3(1, 2, 3) + t * Vec3(1, -2, 4) + 0.5 * t * t * world.options().gravity;
  EXPECT_LT((world.body(body).pose.p - expected).norm(), 1000 * kEpsilon * expected.norm());
}

TEST(World, MomentumOfAStruckBodyEqualsTheImpulse) {
  World world({.gravity = kNoGravity});
  const BodyId body = world.add_body(sample_model(), {.pose = {.q = kTurned}});
  const Vec3 impulse{0.3, -1.0, 2.0};
  const Vec3 moment = world.position(body, kMarked).cross(impulse);
  world.apply_impulse(body, kMarked, impulse);
  for (int i = 0; i < 600; ++i) world.step();
  EXPECT_LT((world.linear_momentum(body) - impulse).norm(), 1e-12 * impulse.norm());
  EXPECT_LT((world.angular_momentum(body) - moment).norm(), 1e-12 * moment.norm());
}

// The work of an impulse is J·(v⁻ + v⁺)/2 at the point it acts on, deformation included: rigid and modal parts agree.
TEST(World, ImpulseDoesTheWorkOfItsPoint) {
  World world({.gravity = kNoGravity});
  const BodyId body = world.add_body(sample_model(), {.pose = {.q = kTurned}, .angular_velocity = {1, 2, 3}});
  world.set_amplitudes(body, std::vector<double>{0.02, 0.01, -0.03, 0.02}, std::vector<double>{0.3, 0.1, 0.2, -0.4});
  for (int i = 0; i < 10; ++i) world.step();
  for (const Axes axes : {Axes::kWorld, Axes::kBody}) {
    const Vec3 impulse{0.3, -1.0, 2.0};
    const Vec3 impulse_W = axes == Axes::kWorld ? impulse : world.body(body).pose.q * impulse;
    const double energy = world.energy(body).total();
    const Vec3 before = world.velocity(body, kMarked);
    world.apply_impulse(body, kMarked, impulse, axes);
    const double work = 0.5 * impulse_W.dot(before + world.velocity(body, kMarked));
    EXPECT_NEAR(world.energy(body).total() - energy, work, 64 * kEpsilon * world.energy(body).total());
  }
}

TEST(World, PointVelocityIsTheRateOfItsPosition) {
  const double h = 1e-5;
  World world({.step = h, .gravity = kNoGravity});
  const BodyId body =
      world.add_body(sample_model(), {.pose = {.q = kTurned}, .velocity = {1, 2, 3}, .angular_velocity = {1, 2, 3}});
  world.set_amplitudes(body, std::vector<double>{0.02, 0.01, -0.03, 0.02}, std::vector<double>{0.3, 0.1, 0.2, -0.4});
  const Vec3 before = world.position(body, kMarked);
  world.step();
  const Vec3 velocity = world.velocity(body, kMarked);
  world.step();
  // Central difference: h² of the third derivative, which is about ω³u ≈ 1e4, and round-off ε/h.
  EXPECT_LT(((world.position(body, kMarked) - before) / (2.0 * h) - velocity).norm(), 1e-6 * velocity.norm());
}

TEST(World, StruckBodyRingsAtItsFrequencies) {
  World world({.gravity = kNoGravity});
  const auto model = sample_model({.decay = 0.3});
  const BodyId body = world.add_body(model);
  world.apply_impulse(body, {.triangle = 0}, {0, 0, 1});
  const std::vector<double> start = copy(world.body(body).rates);
  for (int i = 0; i < 240; ++i) world.step();
  for (std::size_t i = 0; i < start.size(); ++i) {
    const double xi = model->data().decays[i], omega = std::sqrt(model->data().eigenvalues[i] - xi * xi);
    const double amplitude = std::abs(start[i]) / omega;
    EXPECT_GT(std::abs(start[i]), 1e-3);
    // The oscillators' bound, 1e-12 + 4ε ωt.
    EXPECT_NEAR(world.body(body).amplitudes[i], start[i] * std::exp(-xi * 4.0) * std::sin(omega * 4.0) / omega,
                amplitude * (1e-12 + 4 * kEpsilon * omega * 4.0));
  }
}

TEST(World, UndampedFreeBodyKeepsItsEnergyFor10000Steps) {
  World world({.gravity = kNoGravity});
  const BodyId body = world.add_body(sample_model({.modes = 40}));
  world.apply_impulse(body, kMarked, {0.3, -1.0, 2.0});
  const double start = world.energy(body).total();
  ASSERT_GT(world.energy(body).kinetic_modal, 0.1 * start);
  double error = 0.0;
  while (world.step_count() < 10000) {
    world.step();
    error = std::max(error, std::abs(world.energy(body).total() / start - 1.0));
  }
  EXPECT_LT(error, 1e-12);
}

TEST(World, HugeStepsAndTinyOnesLeadToTheSameState) {
  // Ten seconds in steps of 1 s, 1/60 s and 1 ms: free flight, rotation and ringing are exact for each.
  const auto run = [](int steps_per_second) {
    World world({.step = 1.0 / steps_per_second});
    const BodyId body = world.add_body(sample_model({.decay = 0.01}), {.angular_velocity = {1, 2, 3}});
    world.apply_impulse(body, kMarked, {0.3, -1.0, 2.0});
    for (int i = 0; i < 10 * steps_per_second; ++i) world.step();
    const BodyView view = world.body(body);
    std::vector<double> state = copy(view.amplitudes);
    for (int axis = 0; axis < 3; ++axis) state.push_back(view.pose.p[axis]);
    const Mat3 R = to_matrix(view.pose.q);
    state.insert(state.end(), R.data(), R.data() + 9);
    return state;
  };
  const auto huge = run(1), usual = run(60), tiny = run(1000);
  for (std::size_t i = 0; i < huge.size(); ++i) {
    EXPECT_NEAR(huge[i], usual[i], 1e-11 * std::max(1.0, std::abs(huge[i]))) << i;
    EXPECT_NEAR(huge[i], tiny[i], 1e-10 * std::max(1.0, std::abs(huge[i]))) << i;
  }
}

// Impulse, held force and gravity give the momenta that they give a point and a solid; vertices keep their distances.
TEST(World, RigidBodyIsABodyWithoutModes) {
  World world;
  const auto model = sample_model({.modes = 0});
  const double m = model->data().mass, h = world.options().step;
  const Vec3 spin{0.0, 0.0, 1.0}, impulse{0.2, -0.1, 1.0}, force{0.5, 0.0, 2.0};
  const BodyId body = world.add_body(model, {.pose = {.q = kTurned}, .angular_velocity = spin});
  const Vec3 arm = world.position(body, kMarked), impulse_W = kTurned * impulse;
  const Mat3 R = to_matrix(kTurned);
  const Vec3 L = R * model->data().inertia * R.transpose() * spin + arm.cross(impulse_W) + h * arm.cross(force);
  world.apply_impulse(body, kMarked, impulse, Axes::kBody, 0.001);  // a frame gets it at the step's start
  world.apply_force(body, kMarked, force);
  world.step();
  const Vec3 acceleration = force / m + world.options().gravity, start = impulse_W / m;
  const Vec3 moved = h * start + 0.5 * h * h * acceleration;
  EXPECT_TRUE(world.body(body).amplitudes.empty());
  EXPECT_LT((world.body(body).velocity - start - h * acceleration).norm(), 64 * kEpsilon * start.norm());
  EXPECT_LT((world.body(body).pose.p - moved).norm(), 64 * kEpsilon * moved.norm());
  EXPECT_LT((world.angular_momentum(body) - L).norm(), 64 * kEpsilon * L.norm());

  std::vector<float> positions(24);
  world.reconstruct(body, positions, {});
  const float* p = positions.data();
  for (const Vec3f& rest : model->render().rest) {
    const Vec3 expected = world.body(body).pose * rest.cast<double>();
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(*p++, expected[axis], 1e-6);
  }
}

TEST(World, NodeDisplacementsAlongAModeExciteThatModeAlone) {
  World world;
  const testing::SampleOptions options{};
  const testing::Particles particles = testing::sample_particles(options);
  const BodyId body = world.add_body(sample_model(options));
  std::vector<double> displacements, velocities;
  for (std::size_t node = 0; node < particles.mass.size(); ++node)
    for (int axis = 0; axis < 3; ++axis) {
      displacements.push_back(0.3 * particles.shape[2][node][axis] + 5.0);  // a rigid motion has no part in any mode
      velocities.push_back(-0.7 * particles.shape[1][node][axis]);
    }
  world.set_node_displacements(body, displacements, velocities);
  constexpr double kFloat = 64 * std::numeric_limits<float>::epsilon();  // MW is single precision
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(world.body(body).amplitudes[i], i == 2 ? 0.3 : 0.0, kFloat);
    EXPECT_NEAR(world.body(body).rates[i], i == 1 ? -0.7 : 0.0, kFloat);
  }
}

TEST(World, HungBodySwingsAndKeepsItsTotalEnergy) {
  for (const FrameMotion motion : {FrameMotion::kPoint, FrameMotion::kLine}) {
    World world({.step = 1.0 / 240.0});
    const BodyId body = world.add_body(sample_model({.motion = motion, .lowest_hz = 20.0}),
                                       {.pose = {.q = quaternion_from_rotation_vector({1.0, 0, 0})}});
    const double start = world.energy(body).total(), scale = std::abs(start);
    double lowest = 0.0, error = 0.0;
    for (int i = 0; i < 2400; ++i) {
      world.step();
      error = std::max(error, std::abs(world.energy(body).total() - start));
      lowest = std::max(lowest, world.energy(body).kinetic_rigid);
    }
    EXPECT_GT(lowest, 0.5 * scale) << to_string(motion);  // it does swing
    EXPECT_LT(error, 0.01 * scale) << to_string(motion);
    EXPECT_EQ(world.body(body).pose.p, Vec3(Vec3::Zero()));
  }
}

TEST(World, BodyWithInertialCouplingTellsItsVelocitiesAndFliesAlone) {
  const BodyPlacement spins{.angular_velocity = {3, -2, 4}, .inertial_coupling = true};
  World world({.gravity = kNoGravity});
  const BodyId body = world.add_body(sample_model(), spins), plain = world.add_body(sample_model());
  const std::vector<double> z{0.02, 0.01, -0.03, 0.02}, rates{0.3, 0.1, 0.2, -0.4};
  world.set_amplitudes(body, z, rates);
  EXPECT_LT((world.body(body).angular_velocity - Vec3(3, -2, 4)).norm(), 1e-13);
  EXPECT_NEAR(world.body(body).rates[3], -0.4, 1e-14);
  const Vec3 L = world.angular_momentum(body);
  const double energy = world.energy(body).total();
  for (int i = 0; i < 240; ++i) world.step();
  EXPECT_LT((world.angular_momentum(body) - L).norm(), 1e-12 * L.norm());
  EXPECT_NEAR(world.energy(body).total(), energy, 1e-3 * energy);
  EXPECT_THROW(world.add_handle(body, kMarked), InvalidArgument);
  EXPECT_THROW(world.add_joint(plain, body, {}), InvalidArgument);
  EXPECT_THROW(world.set_damping(body, 0.0, 1.0), InvalidArgument);
}

TEST(World, RefusesInertialCouplingWhereItIsNotOffered) {
  World world;
  EXPECT_THROW(world.add_body(sample_model({.motion = FrameMotion::kPoint}), {.inertial_coupling = true}),
               InvalidArgument);
  ModalModelData data = testing::sample_model_data({});
  data.volume_block.reset();
  EXPECT_THROW(world.add_body(std::make_shared<const ModalModel>(std::move(data)), {.inertial_coupling = true}),
               InvalidArgument);
  EXPECT_THROW(world.add_body(sample_model(), {.frame = {.angular_damping = 1.0}, .inertial_coupling = true}),
               InvalidArgument);
  EXPECT_EQ(world.body_count(), 0u);
}

// Instances, identity, order
// --------------------------------------------------------------------------------------------

TEST(World, HundredInstancesMoveBitForBitAsEachAlone) {
  const auto model = sample_model();
  World together;
  std::vector<BodyId> bodies;
  const auto load = [](World& world, BodyId id, int i, int step) {
    if ((i + step) % 7 == 0) world.apply_force(id, kMarked, {0.1 * i, -0.2, 0.3});
    if ((i + step) % 11 == 0) world.apply_impulse(id, kMarked, {0.01 * i, 0.2, -0.1}, Axes::kBody, 0.004);
  };
  const auto placement = [](int i) {
    return BodyPlacement{.pose = {.q = kTurned, .p = {1.0 * i, 0, 0}}, .angular_velocity = {0.1 * i, 1, 2}};
  };
  for (int i = 0; i < 100; ++i) bodies.push_back(together.add_body(model, placement(i)));
  for (int step = 0; step < 50; ++step) {
    for (int i = 0; i < 100; ++i) load(together, bodies[static_cast<std::size_t>(i)], i, step);
    together.step();
  }
  for (int i = 0; i < 100; i += 9) {
    World alone;
    const BodyId id = alone.add_body(model, placement(i));
    for (int step = 0; step < 50; ++step) {
      load(alone, id, i, step);
      alone.step();
    }
    const BodyView a = alone.body(id), b = together.body(bodies[static_cast<std::size_t>(i)]);
    EXPECT_EQ(copy(a.amplitudes), copy(b.amplitudes));
    EXPECT_EQ(copy(a.rates), copy(b.rates));
    EXPECT_EQ(a.pose.p, b.pose.p);
    EXPECT_EQ(to_matrix(a.pose.q), to_matrix(b.pose.q));
  }
}

std::uint64_t hash_of_many_bodies(Jobs& jobs) {
  World world({}, jobs);
  std::vector<BodyId> bodies;
  const auto free = sample_model(), hung = sample_model({.motion = FrameMotion::kPoint});
  for (int i = 0; i < 400; ++i)
    bodies.push_back(world.add_body(i % 3 == 0 ? hung : free, {.angular_velocity = {0.1 * i, 1, 2}}));
  for (int step = 0; step < testing::all_or_tenth(600); ++step) {
    const BodyId struck = bodies[static_cast<std::size_t>(step * 37 % 400)];
    world.apply_impulse(struck, kMarked, {0.1, 0.2, 0.3}, Axes::kBody, 0.001);
    world.apply_force(bodies[static_cast<std::size_t>(step * 53 % 400)], kMarked, {1, 0, -1});
    world.step();
  }
  return world.state_hash();
}

TEST(World, StateHashIsTheSameForAnyThreadCount) {
  const std::uint64_t serial = hash_of_many_bodies(serial_jobs());
  for (const int threads : {1, 2, 3, 8}) {
    ThreadJobs jobs(threads);
    EXPECT_EQ(hash_of_many_bodies(jobs), serial) << threads;
  }
  TbbJobs jobs;
  EXPECT_EQ(hash_of_many_bodies(jobs), serial) << "oneTBB";
}

TEST(World, StateHashTellsStatesApart) {
  World world;
  const BodyId body = world.add_body(sample_model());
  const std::uint64_t start = world.state_hash();
  world.apply_impulse(body, kMarked, {0, 0, 1e-300});
  EXPECT_NE(world.state_hash(), start);
}

TEST(World, RemovedBodysIdStaysInvalidForGood) {
  World world;
  const auto model = sample_model();
  const BodyId first = world.add_body(model), second = world.add_body(model);
  world.remove_body(first);
  EXPECT_FALSE(world.contains(first));
  EXPECT_TRUE(world.contains(second));
  const BodyId third = world.add_body(model);
  EXPECT_EQ(third.index, first.index);  // the place is used again, under a new generation
  EXPECT_FALSE(world.contains(first));
  EXPECT_EQ(world.body_count(), 2u);
  EXPECT_THAT(message_of([&] { world.body(first); }), HasSubstr("body 0 (generation 1) does not exist"));
  EXPECT_THAT(message_of([&] { world.remove_body(first); }), HasSubstr("does not exist"));
  EXPECT_THAT(message_of([&] { world.body(BodyId{}); }), HasSubstr("generation 0"));
  EXPECT_THAT(message_of([&] { world.body({99, 1}); }), HasSubstr("body 99"));
}

TEST(World, LastInstanceLetsGoOfItsModel) {
  World world;
  auto model = sample_model();
  const std::weak_ptr<const ModalModel> watch = model;
  const BodyId body = world.add_body(std::move(model));
  const BodyId other = world.add_body(sample_model());
  EXPECT_FALSE(watch.expired());
  world.remove_body(body);
  EXPECT_TRUE(watch.expired());
  world.step();
  EXPECT_EQ(world.model(other).modes(), 4);
}

// Time
// -----------------------------------------------------------------------------------------------------------------

TEST(World, AdvanceTakesWholeStepsAndKeepsTheRest) {
  World world({.step = 0.25});
  EXPECT_EQ(world.advance(0.6), 2);
  EXPECT_NEAR(world.interpolation_factor(), 0.4, 4 * kEpsilon);
  EXPECT_EQ(world.advance(0.125), 0);
  EXPECT_EQ(world.advance(0.0625), 1);
  EXPECT_EQ(world.step_count(), 3u);
  EXPECT_DOUBLE_EQ(world.time(), 0.75);
  EXPECT_EQ(world.dropped_seconds(), 0.0);
}

TEST(World, TimeBeyondTheMostStepsIsDroppedAndCounted) {
  World world({.step = 0.25, .max_steps_per_advance = 3});
  EXPECT_EQ(world.advance(2.125), 3);
  EXPECT_DOUBLE_EQ(world.dropped_seconds(), 5 * 0.25);
  EXPECT_DOUBLE_EQ(world.interpolation_factor(), 0.5);
  EXPECT_EQ(world.advance(1e300), 3);
  EXPECT_GE(world.interpolation_factor(), 0.0);
  EXPECT_LT(world.interpolation_factor(), 1.0);
}

TEST(World, DrawnStateLiesBetweenTheLastTwo) {
  World world({.step = 0.1});
  const BodyId body = world.add_body(sample_model(), {.velocity = {1, 0, 0}, .angular_velocity = {0, 0, 1}});
  world.set_amplitudes(body, std::vector<double>{0.02, 0.01, -0.03, 0.02}, std::vector<double>(4, 0.0));
  const RigidTransform before = world.body(body).pose;
  const std::vector<double> z_before = copy(world.body(body).amplitudes);
  world.step();
  const RigidTransform after = world.body(body).pose;
  const BodyView view = world.body(body);
  EXPECT_EQ(world.interpolated_pose(body, 0.0).p, before.p);
  EXPECT_EQ(world.interpolated_pose(body, 1.0).p, after.p);
  EXPECT_LT((world.interpolated_pose(body, 0.25).p - (0.75 * before.p + 0.25 * after.p)).norm(), 4 * kEpsilon);
  std::vector<float> z(4), positions(24), expected(24);
  world.interpolated_amplitudes(body, 0.25, z);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_FLOAT_EQ(z[i], static_cast<float>(0.75 * z_before[i] + 0.25 * view.amplitudes[i]));

  // Vertices: rest + U z in the drawn pose.
  world.reconstruct(body, positions, {}, 0.25);
  const RigidTransform pose = world.interpolated_pose(body, 0.25);
  for (Index v = 0; v < 8; ++v) {
    Vec3 p = world.model(body).render().rest[static_cast<std::size_t>(v)].cast<double>();
    for (Index i = 0; i < 4; ++i)
      p += static_cast<double>(z[static_cast<std::size_t>(i)]) *
           world.model(body).render().basis.shape(v, i).cast<double>();
    const Vec3 drawn = Eigen::Map<const Vec3f>(positions.data() + 3 * v).cast<double>();
    EXPECT_LT((drawn - pose * p).norm(), 8 * std::numeric_limits<float>::epsilon());
  }
}

TEST(World, DrawingManyAtOnceGivesWhatDrawingEachGives) {
  World world;
  const auto a = sample_model(), b = sample_model({.motion = FrameMotion::kPoint, .modes = 7});
  std::vector<BodyId> bodies;
  for (int i = 0; i < 21; ++i) {
    bodies.push_back(world.add_body(i % 3 == 0 ? b : a, {.pose = {.q = kTurned}, .angular_velocity = {0, 0.1 * i, 0}}));
    world.apply_impulse(bodies.back(), kMarked, {0.1 * i, 0, 0.1});
  }
  world.step();
  std::vector<std::vector<float>> positions(21, std::vector<float>(24)), normals = positions;
  std::vector<DrawTarget> targets;
  for (std::size_t i = 0; i < 21; ++i)
    targets.push_back({bodies[i], positions[i], i % 2 == 0 ? std::span<float>(normals[i]) : std::span<float>()});
  world.reconstruct(targets, 0.3, {1, 2, 3});
  for (std::size_t i = 0; i < 21; ++i) {
    std::vector<float> alone(24), alone_normals(24);
    world.reconstruct(bodies[i], alone, alone_normals, 0.3, {1, 2, 3});
    EXPECT_EQ(positions[i], alone);
    EXPECT_EQ(normals[i], i % 2 == 0 ? alone_normals : std::vector<float>(24));
  }
}

TEST(World, BodyFarAwayIsDrawnAsSharplyAsNearby) {
  World world({.gravity = kNoGravity});
  const Vec3 far{1e6, -1e6, 1e6};
  const auto model = sample_model();
  const BodyId here = world.add_body(model, {.pose = {.q = kTurned}}),
               there = world.add_body(model, {.pose = {kTurned, far}});
  for (const BodyId id : {here, there}) world.apply_impulse(id, kMarked, {0.1, 0.2, 0.3});
  for (int i = 0; i < 60; ++i) world.step();
  std::vector<float> near_positions(24), far_positions(24), near_normals(24), far_normals(24);
  world.reconstruct(here, near_positions, near_normals);
  world.reconstruct(there, far_positions, far_normals, 1.0, far);
  // The pose itself is rounded at 1e6: 60 steps of at most 1e-10 m.
  for (std::size_t i = 0; i < 24; ++i) EXPECT_NEAR(near_positions[i], far_positions[i], 1e-8 + 2e-7);
  for (std::size_t i = 0; i < 24; ++i) EXPECT_NEAR(near_normals[i], far_normals[i], 1e-5);
}

TEST(World, SetStateIsAlsoTheStateDrawnBefore) {
  World world;
  const BodyId body = world.add_body(sample_model(), {.velocity = {100, 0, 0}});
  world.step();
  world.set_pose(body, {kTurned, {5, 5, 5}});
  EXPECT_EQ(world.interpolated_pose(body, 0.0).p, Vec3(5, 5, 5));
}

// Bad arguments
// --------------------------------------------------------------------------------------------------------

TEST(World, RefusesWhatIsNotANumberAndLeavesTheStateAlone) {
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  World world;
  const BodyId body = world.add_body(sample_model());
  const std::uint64_t before = world.state_hash();
  const std::vector<double> good(4, 0.0), bad{0.0, nan, 0.0, 0.0}, nodes(81, 0.0);
  EXPECT_THAT(message_of([&] { world.apply_force(body, kMarked, {nan, 0, 0}); }), HasSubstr("the force is (nan"));
  EXPECT_THAT(message_of([&] { world.apply_impulse(body, kMarked, {0, infinity, 0}); }), HasSubstr("the impulse"));
  EXPECT_THAT(message_of([&] {
                world.apply_impulse(body, kMarked, {0, 0, 1}, Axes::kWorld, 1.0);
              }),
              HasSubstr("delay is 1"));
  EXPECT_THAT(message_of([&] { world.apply_force(body, {.triangle = 12}, {0, 0, 1}); }), HasSubstr("expected 0 to 11"));
  EXPECT_THAT(message_of([&] { world.apply_force(body, {.triangle = -1}, {0, 0, 1}); }), HasSubstr("triangle -1"));
  EXPECT_THAT(message_of([&] { world.apply_force(body, {.weight = {1, 1, 1}}, {0, 0, 1}); }), HasSubstr("sum to 3"));
  EXPECT_THAT(message_of([&] { world.apply_force(body, {.weight = {nan, 1, 1}}, {0, 0, 1}); }), HasSubstr("weights"));
  EXPECT_THAT(message_of([&] { world.set_pose(body, {{}, {nan, 0, 0}}); }), HasSubstr("position"));
  EXPECT_THAT(message_of([&] { world.set_pose(body, {{2, 0, 0, 0}, {0, 0, 0}}); }), HasSubstr("norm 2"));
  EXPECT_THAT(message_of([&] { world.set_velocity(body, {0, 0, 0}, {nan, 0, 0}); }), HasSubstr("angular velocity"));
  EXPECT_THAT(message_of([&] { world.set_amplitudes(body, bad, good); }), HasSubstr("amplitudes[1] is nan"));
  EXPECT_THAT(message_of([&] { world.set_amplitudes(body, good, {}); }), HasSubstr("rates has 0 elements, expected 4"));
  EXPECT_THAT(message_of([&] { world.set_node_displacements(body, good, nodes); }), HasSubstr("expected 81"));
  EXPECT_THAT(message_of([&] { world.set_kinematic_frame(body, {}); }), HasSubstr("moves freely"));
  EXPECT_THAT(message_of([&] { world.advance(nan); }), HasSubstr("real_seconds is nan"));
  EXPECT_THAT(message_of([&] { world.advance(-1.0); }), HasSubstr("at least 0"));
  EXPECT_THAT(message_of([&] { world.add_body(nullptr); }), HasSubstr("model is null"));
  EXPECT_THAT(message_of([&] { world.add_body(sample_model(), {.velocity = {nan, 0, 0}}); }), HasSubstr("velocity"));
  std::vector<float> positions(24), short_array(23);
  EXPECT_THAT(message_of([&] { world.reconstruct(body, short_array, {}); }), HasSubstr("positions has 23 elements"));
  EXPECT_THAT(message_of([&] { world.reconstruct(body, positions, short_array); }), HasSubstr("normals has 23"));
  EXPECT_THAT(message_of([&] { world.reconstruct(body, positions, {}, 1.5); }), HasSubstr("interpolation is 1.5"));
  EXPECT_THAT(message_of([&] { world.reconstruct(body, positions, {}, 1.0, {nan, 0, 0}); }), HasSubstr("origin"));
  EXPECT_EQ(world.state_hash(), before);
  EXPECT_EQ(world.body_count(), 1u);
}

TEST(World, RefusesOptionsOutOfRange) {
  EXPECT_THAT(message_of([] { World({.step = 0.0}); }), HasSubstr("step is 0"));
  EXPECT_THAT(message_of([] { World({.step = std::nan("")}); }), HasSubstr("step is nan"));
  EXPECT_THAT(message_of([] { World({.gravity = {std::nan(""), 0, 0}}); }), HasSubstr("gravity"));
  EXPECT_THAT(message_of([] { World({.max_steps_per_advance = 0}); }), HasSubstr("max_steps_per_advance is 0"));
}

}  // namespace
}  // namespace limber
