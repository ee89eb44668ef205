// What the C interface does by itself: errors, lists, lent threads, callbacks, snapshots. What lies behind it is tested
// where it is made; that the same calls give the same bits: scenes.c.
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "jointed_blocks.h"
#include "limber/limber.h"
#include "limber/machine/machine.h"
#include "limber/model/asset.h"
#include "limber/model/soft_bodies.h"

namespace {

using ::testing::HasSubstr;

template <auto destroy>
struct Destroy {
  void operator()(auto* object) const { destroy(object); }
};
using World = std::unique_ptr<limber_world, Destroy<limber_world_destroy>>;
using Shape = std::unique_ptr<limber_shape, Destroy<limber_shape_destroy>>;
using Asset = std::unique_ptr<limber_asset, Destroy<limber_asset_destroy>>;
using Snapshot = std::unique_ptr<limber_snapshot, Destroy<limber_snapshot_destroy>>;

World make_world(const limber_world_options* options = nullptr) {
  limber_world* world = nullptr;
  EXPECT_EQ(limber_world_create(options, &world), LIMBER_OK) << limber_last_error();
  return World(world);
}

Shape make_sphere(double radius) {
  limber_shape* shape = nullptr;
  EXPECT_EQ(limber_shape_create_sphere(radius, &shape), LIMBER_OK) << limber_last_error();
  return Shape(shape);
}

limber_body_id add_sphere(limber_world* world, double radius, const limber_vec3& at) {
  limber_placement start = limber_default_placement();
  start.pose.p = at;
  limber_body_id id{};
  EXPECT_EQ(limber_world_add_rigid(world, make_sphere(radius).get(), 1000.0, &start, &id), LIMBER_OK)
      << limber_last_error();
  return id;
}

limber_body_id add_ground(limber_world* world) {
  limber_shape* shape = nullptr;
  EXPECT_EQ(limber_shape_create_half_space({0, 0, 1}, 0.0, &shape), LIMBER_OK);
  limber_body_id id{};
  EXPECT_EQ(limber_world_add_static(world, Shape(shape).get(), nullptr, &id), LIMBER_OK);
  return id;
}

Asset soft_ball() {
  const limber_material jelly{1e5, 0.4, 1000.0};
  limber_asset* asset = nullptr;
  EXPECT_EQ(limber_asset_create_soft_ball(0.3, 4, &jelly, 6, 0.02, &asset), LIMBER_OK) << limber_last_error();
  return Asset(asset);
}

double height(const limber_world* world, limber_body_id id) {
  limber_body_state state{};
  EXPECT_EQ(limber_world_body_state(world, id, &state), LIMBER_OK) << limber_last_error();
  return state.pose.p.z;
}

TEST(CErrors, EndAtTheInterfaceWithAResultAndALine) {
  EXPECT_EQ(limber_world_step(nullptr, 1), LIMBER_INVALID_ARGUMENT);
  EXPECT_THAT(limber_last_error(), HasSubstr("world is NULL"));

  limber_asset* asset = nullptr;
  EXPECT_EQ(limber_asset_read_file("/there/is/no.glb", &asset), LIMBER_INPUT_ERROR);
  EXPECT_THAT(limber_last_error(), HasSubstr("/there/is/no.glb"));
  EXPECT_EQ(limber_asset_read_memory("glTF", 4, "four bytes", &asset), LIMBER_INPUT_ERROR);
  EXPECT_THAT(limber_last_error(), HasSubstr("four bytes"));
  EXPECT_EQ(asset, nullptr);

  const World world = make_world();
  const limber_body_id gone = add_sphere(world.get(), 0.1, {0, 0, 1});
  EXPECT_EQ(limber_world_remove_body(world.get(), gone), LIMBER_OK);
  EXPECT_EQ(limber_world_remove_body(world.get(), gone), LIMBER_INVALID_ARGUMENT);
  EXPECT_EQ(limber_world_step(world.get(), -1), LIMBER_INVALID_ARGUMENT);

  limber_body_id id{7, 7};
  limber_placement start = limber_default_placement();
  start.velocity.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(limber_world_add_rigid(world.get(), make_sphere(0.1).get(), 1.0, &start, &id), LIMBER_INVALID_ARGUMENT);
  EXPECT_EQ(id.index, 7u) << "answers are not written where a call fails";
  EXPECT_EQ(limber_world_body_count(world.get()), 0u);

  limber_contact_options options = limber_default_contact_options();
  options.solver = static_cast<limber_contact_solver>(2);
  EXPECT_EQ(limber_world_set_contacts(world.get(), &options), LIMBER_INVALID_ARGUMENT);
  EXPECT_THAT(limber_last_error(), HasSubstr("contact solver is 2"));
}

TEST(CErrors, AreOfTheThread) {
  limber_world_step(nullptr, 1);
  std::string elsewhere = "not asked";
  std::jthread([&elsewhere] { elsewhere = limber_last_error(); }).join();
  EXPECT_EQ(elsewhere, "");
  EXPECT_THAT(limber_last_error(), HasSubstr("world is NULL"));
}

TEST(CErrors, AreCutToTheirLength) {
  limber_asset* asset = nullptr;
  EXPECT_EQ(limber_asset_read_file(std::string(3000, 'x').c_str(), &asset), LIMBER_INPUT_ERROR);
  EXPECT_EQ(std::string(limber_last_error()).size(), 1023u);
}

TEST(CWorld, FallsAlongItsParabolaToTheGround) {
  const World world = make_world();
  EXPECT_EQ(limber_world_set_contacts(world.get(), nullptr), LIMBER_OK) << limber_last_error();
  const limber_body_id ground = add_ground(world.get());
  const limber_body_id ball = add_sphere(world.get(), 0.5, {0, 0, 2.0});
  EXPECT_EQ(limber_world_step(world.get(), 30), LIMBER_OK);
  EXPECT_NEAR(height(world.get(), ball), 2.0 - 0.5 * 9.80665 * 0.25, 1e-9);
  EXPECT_EQ(limber_world_step(world.get(), 120), LIMBER_OK);
  EXPECT_NEAR(height(world.get(), ball), 0.5, 2e-3);

  // The ground presses with the ball's weight.
  std::size_t count = 0;
  EXPECT_EQ(limber_world_contact_events(world.get(), nullptr, 0, &count), LIMBER_OK);
  ASSERT_EQ(count, 1u);
  limber_contact_event event{};
  EXPECT_EQ(limber_world_contact_events(world.get(), &event, 1, &count), LIMBER_OK);
  EXPECT_EQ(event.a.index, std::min(ground.index, ball.index));
  EXPECT_EQ(event.phase, LIMBER_CONTACT_LASTING);
  const double weight = 1000.0 * 4.0 / 3.0 * 3.14159265358979 * 0.125 * 9.80665;
  EXPECT_NEAR(std::abs(event.impulse.z) * 60.0, weight, 1e-2 * weight);
}

TEST(CWorld, VetoLetsTheBallThrough) {
  const World world = make_world();
  limber_world_set_contacts(world.get(), nullptr);
  add_ground(world.get());
  const limber_body_id ball = add_sphere(world.get(), 0.5, {0, 0, 0.6});
  int asked = 0;
  const auto refuse = [](void* context, const limber_contact* contact) {
    ++*static_cast<int*>(context);
    EXPECT_NEAR(std::abs(contact->normal.z), 1.0, 1e-12);
    return false;
  };
  EXPECT_EQ(limber_world_set_contact_veto(world.get(), refuse, &asked), LIMBER_OK);
  EXPECT_EQ(limber_world_step(world.get(), 60), LIMBER_OK);
  EXPECT_GT(asked, 0);
  EXPECT_NEAR(height(world.get(), ball), 0.6 - 0.5 * 9.80665, 1e-6);
}

TEST(CWorld, MotorTurnsAtItsSpeedAndALimitHoldsIt) {
  limber_world_options options = limber_default_world_options();
  options.gravity = {0, 0, 0};
  const World world = make_world(&options);
  const limber_body_id wheel = add_sphere(world.get(), 0.2, {0, 0, 0});
  limber_joint_options hinge = limber_default_joint_options();
  hinge.type = LIMBER_JOINT_REVOLUTE;
  hinge.rotation = {-1.0, 1.0};
  limber_joint_id joint{};
  ASSERT_EQ(limber_world_add_joint(world.get(), {0, 0}, wheel, &hinge, &joint), LIMBER_OK) << limber_last_error();
  limber_actuation motor{};
  motor.motor_velocity = 3.0;
  motor.motor_max_force = 1000.0;
  ASSERT_EQ(limber_world_set_joint_actuation(world.get(), joint, 0, &motor), LIMBER_OK) << limber_last_error();
  limber_world_step(world.get(), 15);
  limber_joint_state state{};
  ASSERT_EQ(limber_world_joint_state(world.get(), joint, &state), LIMBER_OK);
  EXPECT_EQ(state.coordinates, 1);
  EXPECT_NEAR(state.position[0], 0.75, 0.05);
  limber_world_step(world.get(), 45);
  limber_world_joint_state(world.get(), joint, &state);
  EXPECT_NEAR(state.position[0], 1.0, 1e-3);
  EXPECT_EQ(limber_world_set_joint_actuation(world.get(), joint, 1, &motor), LIMBER_INVALID_ARGUMENT);
}

TEST(CWorld, FramesTakeTheirShareOfGravityDampingAndLocks) {
  const World world = make_world();
  limber_placement start = limber_default_placement();
  start.frame.gravity_scale = 0.5;
  start.velocity = {1, 0, 0};
  limber_body_id light{}, lift{};
  ASSERT_EQ(limber_world_add_rigid(world.get(), make_sphere(0.1).get(), 1000.0, &start, &light), LIMBER_OK);
  start = limber_default_placement();
  start.velocity = {0, 0, 2};
  ASSERT_EQ(limber_world_add_kinematic(world.get(), make_sphere(0.1).get(), &start, &lift), LIMBER_OK)
      << limber_last_error();
  limber_body_type type{};
  ASSERT_EQ(limber_world_body_type(world.get(), lift, &type), LIMBER_OK);
  EXPECT_EQ(type, LIMBER_BODY_KINEMATIC);
  ASSERT_EQ(limber_world_set_damping(world.get(), light, 3.0, 0.0), LIMBER_OK) << limber_last_error();
  const bool along_z[3] = {false, false, true}, none[3] = {};
  ASSERT_EQ(limber_world_set_locks(world.get(), light, along_z, none), LIMBER_OK) << limber_last_error();
  limber_world_step(world.get(), 60);
  limber_body_state state{};
  limber_world_body_state(world.get(), light, &state);
  EXPECT_NEAR(state.velocity.x, std::exp(-3.0), 1e-9);
  EXPECT_EQ(state.pose.p.z, 0.0);
  EXPECT_NEAR(height(world.get(), lift), 2.0, 1e-9);
  limber_frame_settings settings{};
  ASSERT_EQ(limber_world_frame_settings(world.get(), light, &settings), LIMBER_OK);
  EXPECT_EQ(settings.gravity_scale, 0.5);
  EXPECT_TRUE(settings.lock_translation[2] && !settings.lock_translation[0]);
}

// A turning ball stretches where its modes feel the turning, and only there.
TEST(CWorld, CouplesTurningAndModesWhereItIsTold) {
  limber_world_options options = limber_default_world_options();
  options.gravity = {0, 0, 0};
  double elastic[2]{};
  for (int coupled = 0; coupled < 2; ++coupled) {
    const World world = make_world(&options);
    limber_placement start = limber_default_placement();
    start.angular_velocity = {0, 0, 5};
    start.inertial_coupling = coupled == 1;
    limber_body_id ball{};
    ASSERT_EQ(limber_world_add_body(world.get(), soft_ball().get(), 0, &start, &ball), LIMBER_OK)
        << limber_last_error();
    limber_world_step(world.get(), 30);
    limber_energy energy{};
    ASSERT_EQ(limber_world_energy(world.get(), ball, &energy), LIMBER_OK);
    elastic[coupled] = energy.elastic;
  }
  EXPECT_EQ(elastic[0], 0.0);
  EXPECT_GT(elastic[1], 0.0);
}

TEST(CWorld, HandleHoldsItsPoint) {
  const World world = make_world();
  limber_body_id ball{};
  ASSERT_EQ(limber_world_add_body(world.get(), soft_ball().get(), 0, nullptr, &ball), LIMBER_OK);
  const limber_surface_point at{LIMBER_SURFACE_COLLISION, 3, {0.5, 0.25, 0.25}};
  limber_vec3 start{}, now{};
  ASSERT_EQ(limber_world_point_position(world.get(), ball, at, &start), LIMBER_OK);
  limber_handle_id handle{};
  ASSERT_EQ(limber_world_add_handle(world.get(), ball, at, nullptr, &handle), LIMBER_OK) << limber_last_error();
  limber_world_step(world.get(), 60);
  limber_world_point_position(world.get(), ball, at, &now);
  EXPECT_NEAR(now.z, start.z, 1e-6);
  limber_handle_state state{};
  ASSERT_EQ(limber_world_handle_state(world.get(), handle, &state), LIMBER_OK);
  EXPECT_LT(state.error, 1e-6);
  limber_world_remove_body(world.get(), ball);
  EXPECT_FALSE(limber_world_contains_handle(world.get(), handle));
}

TEST(CWorld, GoesBackToASnapshotBitForBit) {
  const World world = make_world();
  limber_world_set_contacts(world.get(), nullptr);
  add_ground(world.get());
  limber_placement start = limber_default_placement();
  start.pose.p.z = 0.5;
  limber_body_id ball{};
  ASSERT_EQ(limber_world_add_body(world.get(), soft_ball().get(), 0, &start, &ball), LIMBER_OK);
  limber_world_step(world.get(), 20);

  limber_snapshot* made = nullptr;
  ASSERT_EQ(limber_snapshot_create(&made), LIMBER_OK);
  const Snapshot snapshot(made);
  EXPECT_EQ(limber_snapshot_bytes(snapshot.get(), nullptr), nullptr);
  ASSERT_EQ(limber_world_save_state(world.get(), snapshot.get()), LIMBER_OK);
  limber_world_step(world.get(), 30);
  const std::uint64_t first = limber_world_state_hash(world.get());

  std::size_t size = 0;
  const void* bytes = limber_snapshot_bytes(snapshot.get(), &size);
  EXPECT_EQ(limber_world_restore_state(world.get(), bytes, size / 2), LIMBER_INVALID_ARGUMENT);
  EXPECT_EQ(limber_world_state_hash(world.get()), first);
  ASSERT_EQ(limber_world_restore_state(world.get(), bytes, size), LIMBER_OK) << limber_last_error();
  EXPECT_EQ(limber_world_step_count(world.get()), 20u);
  limber_world_step(world.get(), 30);
  EXPECT_EQ(limber_world_state_hash(world.get()), first);
}

TEST(CWorld, RunsOnThreadsOfTheCaller) {
  int lent = 0;
  limber_world_options options = limber_default_world_options();
  options.jobs = {
      &lent, 3,
      [](void* context, std::size_t count, std::size_t, void (*loop)(void*, std::size_t, std::size_t), void* of) {
        ++*static_cast<int*>(context);
        std::vector<std::jthread> threads;
        for (std::size_t i = 0; i < 3; ++i) threads.emplace_back([=] { loop(of, count * i / 3, count * (i + 1) / 3); });
      }};
  std::uint64_t hashes[2]{};
  for (int threaded = 0; threaded < 2; ++threaded) {
    const World world = make_world(threaded == 1 ? &options : nullptr);
    limber_world_set_contacts(world.get(), nullptr);
    add_ground(world.get());
    for (int i = 0; i < 12; ++i) add_sphere(world.get(), 0.2, {0.1 * i, 0.05 * (i % 3), 0.5 + 0.3 * i});
    EXPECT_EQ(limber_world_step(world.get(), 60), LIMBER_OK) << limber_last_error();
    hashes[threaded] = limber_world_state_hash(world.get());
  }
  EXPECT_GT(lent, 0);
  EXPECT_EQ(hashes[0], hashes[1]);
  options.jobs.parallel_for = nullptr;
  limber_world* none = nullptr;
  EXPECT_EQ(limber_world_create(&options, &none), LIMBER_INVALID_ARGUMENT);
}

TEST(CWorld, ListsWhatThereIs) {
  const World world = make_world();
  std::vector<limber_body_id> added;
  for (int i = 0; i < 3; ++i) added.push_back(add_sphere(world.get(), 0.1, {1.0 * i, 0, 0}));
  std::size_t count = 0;
  limber_body_id first[2]{};
  EXPECT_EQ(limber_world_list_bodies(world.get(), first, 2, &count), LIMBER_OK);
  EXPECT_EQ(count, 3u);
  EXPECT_EQ(first[1].index, added[1].index);
  EXPECT_EQ(limber_world_list_bodies(world.get(), nullptr, 2, &count), LIMBER_INVALID_ARGUMENT);
  EXPECT_EQ(limber_world_body_at(world.get(), added[2].index).generation, added[2].generation);
  EXPECT_EQ(limber_world_body_at(world.get(), 0xffffffffu).generation, 0u);

  EXPECT_EQ(limber_world_set_body_user_data(world.get(), added[0], 42), LIMBER_OK);
  std::uint64_t data = 0;
  EXPECT_EQ(limber_world_body_user_data(world.get(), added[0], &data), LIMBER_OK);
  EXPECT_EQ(data, 42u);
}

TEST(CWorld, AnswersRaysByFilter) {
  const World world = make_world();
  const limber_body_id near = add_sphere(world.get(), 0.5, {2, 0, 0}), far = add_sphere(world.get(), 0.5, {4, 0, 0});
  bool found = false;
  limber_hit hit{};
  ASSERT_EQ(limber_world_cast_ray(world.get(), {0, 0, 0}, {10, 0, 0}, nullptr, &found, &hit), LIMBER_OK);
  ASSERT_TRUE(found);
  EXPECT_EQ(hit.body.index, near.index);
  EXPECT_NEAR(hit.distance, 1.5, 1e-6);
  EXPECT_NEAR(hit.normal.x, -1.0, 1e-6);

  limber_query_filter filter = limber_default_query_filter();
  const std::uint32_t not_this = near.index;
  filter.context = const_cast<std::uint32_t*>(&not_this);
  filter.accepts = [](void* context, limber_body_id id) { return id.index != *static_cast<std::uint32_t*>(context); };
  limber_world_cast_ray(world.get(), {0, 0, 0}, {10, 0, 0}, &filter, &found, &hit);
  ASSERT_TRUE(found);
  EXPECT_EQ(hit.body.index, far.index);

  std::size_t count = 0;
  limber_hit hits[4]{};
  EXPECT_EQ(limber_world_cast_ray_all(world.get(), {0, 0, 0}, {10, 0, 0}, nullptr, hits, 4, &count), LIMBER_OK);
  ASSERT_EQ(count, 2u);
  EXPECT_NEAR(hits[1].distance, 3.5, 1e-6);
  limber_world_cast_ray(world.get(), {0, 0, 0}, {-10, 0, 0}, nullptr, &found, &hit);
  EXPECT_FALSE(found);

  limber_body_id inside[4]{};
  EXPECT_EQ(limber_world_find_overlaps(world.get(), make_sphere(1.0).get(), {{1, 0, 0, 0}, {3, 0, 0}}, nullptr, inside,
                                       4, &count),
            LIMBER_OK);
  EXPECT_EQ(count, 2u);
}

TEST(CWorld, TellsWhoIsInASensor) {
  const World world = make_world();
  limber_body_id gate{};
  ASSERT_EQ(
      limber_world_add_sensor(world.get(), make_sphere(0.5).get(), limber_identity(), limber_default_filter(), &gate),
      LIMBER_OK);
  const limber_body_id ball = add_sphere(world.get(), 0.1, {0, 0, 1.0});
  bool came = false, left = false;
  for (int i = 0; i < 60; ++i) {
    limber_world_step(world.get(), 1);
    limber_sensor_event event{};
    std::size_t count = 0;
    ASSERT_EQ(limber_world_sensor_events(world.get(), &event, 1, &count), LIMBER_OK);
    if (count == 0) continue;
    EXPECT_EQ(event.body.index, ball.index);
    (event.began ? came : left) = true;
  }
  EXPECT_TRUE(came);
  EXPECT_TRUE(left);
}

// The three ways to draw agree: vertices, amplitudes and morph weights.
TEST(CWorld, DrawsTheSameOnCpuAndGpu) {
  const World world = make_world();
  const Asset asset = soft_ball();
  const limber_model* model = nullptr;
  limber_model_data data{};
  ASSERT_EQ(limber_asset_model(asset.get(), 0, &model), LIMBER_OK);
  ASSERT_EQ(limber_model_get_data(model, &data), LIMBER_OK);
  ASSERT_EQ(data.modes, 6);
  limber_body_id ball{};
  limber_placement start = limber_default_placement();
  start.pose = {limber_quat_from_rotation_vector({0.1, 0.2, 0.3}), {1, 2, 3}};
  ASSERT_EQ(limber_world_add_body(world.get(), asset.get(), 0, &start, &ball), LIMBER_OK);
  limber_world_apply_impulse(world.get(), ball, {LIMBER_SURFACE_RENDER, 0, {1, 0, 0}}, {5, 0, 5}, LIMBER_AXES_WORLD,
                             0.0);
  limber_world_step(world.get(), 3);

  const auto numbers = 3 * static_cast<std::size_t>(data.render.vertices);
  std::vector<float> drawn(numbers), target(numbers), weights(6), local(data.render.rest, data.render.rest + numbers);
  ASSERT_EQ(limber_world_reconstruct(world.get(), ball, drawn.data(), nullptr, 1.0), LIMBER_OK) << limber_last_error();
  ASSERT_EQ(limber_world_interpolated_weights(world.get(), ball, 1.0, weights.data()), LIMBER_OK);
  for (std::int32_t mode = 0; mode < 6; ++mode) {
    ASSERT_EQ(limber_model_morph_target(model, mode, target.data()), LIMBER_OK);
    for (std::size_t i = 0; i < numbers; ++i) local[i] += weights[static_cast<std::size_t>(mode)] * target[i];
  }
  limber_transform pose{};
  ASSERT_EQ(limber_world_interpolated_poses(world.get(), &ball, 1, 1.0, &pose), LIMBER_OK);
  const limber::RigidTransform X{.q = {pose.q.w, pose.q.x, pose.q.y, pose.q.z}, .p = {pose.p.x, pose.p.y, pose.p.z}};
  double largest_weight = 0.0;
  for (const float w : weights) largest_weight = std::max(largest_weight, std::abs(double(w)));
  EXPECT_GT(largest_weight, 1e-3);
  for (std::size_t v = 0; v < numbers; v += 3) {
    const limber::Vec3 world_point = X * limber::Vec3(local[v], local[v + 1], local[v + 2]);
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(world_point[axis], drawn[v + static_cast<std::size_t>(axis)], 1e-5);
  }
}

TEST(CAsset, IsReadFromTheBytesOfItsFile) {
  const limber::Asset written{.bodies = {limber::make_soft_ball(0.3, 4, {1e5, 0.4, 1000.0}, 6)}};
  const std::string bytes = limber::asset_bytes(written);
  limber_asset* read = nullptr;
  ASSERT_EQ(limber_asset_read_memory(bytes.data(), bytes.size(), nullptr, &read), LIMBER_OK) << limber_last_error();
  const Asset asset(read);
  EXPECT_EQ(limber_asset_body_count(asset.get()), 1u);
  const limber_model* model = nullptr;
  EXPECT_EQ(limber_asset_model(asset.get(), 1, &model), LIMBER_INVALID_ARGUMENT);
  ASSERT_EQ(limber_asset_model(asset.get(), 0, &model), LIMBER_OK);
  limber_model_data data{};
  ASSERT_EQ(limber_model_get_data(model, &data), LIMBER_OK);
  EXPECT_EQ(data.mass, written.bodies[0]->data().mass);
  EXPECT_EQ(data.eigenvalue[5], written.bodies[0]->data().eigenvalues[5]);
}

TEST(CMachine, MovesAsFromCpp) {
  const limber::Asset written = limber::testing::jointed_blocks();
  const std::string bytes = limber::asset_bytes(written);
  limber_asset* read = nullptr;
  ASSERT_EQ(limber_asset_read_memory(bytes.data(), bytes.size(), nullptr, &read), LIMBER_OK) << limber_last_error();
  const Asset asset(read);
  ASSERT_EQ(limber_asset_joint_count(asset.get()), 2u);
  limber_asset_joint joint{};
  EXPECT_EQ(limber_asset_get_joint(asset.get(), 2, &joint), LIMBER_INVALID_ARGUMENT);
  ASSERT_EQ(limber_asset_get_joint(asset.get(), 1, &joint), LIMBER_OK);
  EXPECT_EQ(joint.a, 0);
  EXPECT_EQ(joint.b, 1);
  EXPECT_EQ(joint.options.type, LIMBER_JOINT_REVOLUTE);
  EXPECT_EQ(joint.options.frame.p.x, 1.0);
  EXPECT_NEAR(joint.options.frame.q.w, 0.5, 1e-15);  // a third of a turn takes x to y
  EXPECT_EQ(joint.options.rotation.high, 0.3);
  EXPECT_EQ(joint.options.on_b.radius, 0.8);
  EXPECT_EQ(joint.coordinates, 1);
  EXPECT_EQ(joint.actuation[0].friction, 0.2);

  const limber::RigidTransform pose{limber::quaternion_from_rotation_vector({0.3, -0.5, 0.9}), {3, 1, 2}};
  for (const bool tied : {true, false}) {
    limber_machine_placement start = limber_default_machine_placement();
    start.pose = {limber_quat_from_rotation_vector({0.3, -0.5, 0.9}), {3, 1, 2}};
    start.angular_velocity = {0, 0, 1};
    start.tied = tied;
    const World world = make_world();
    limber_body_id bodies[3]{};
    limber_joint_id joints[2]{};
    EXPECT_EQ(limber_world_add_machine(world.get(), asset.get(), &start, bodies, nullptr), LIMBER_INVALID_ARGUMENT);
    ASSERT_EQ(limber_world_add_machine(world.get(), asset.get(), &start, bodies, joints), LIMBER_OK);
    EXPECT_EQ(limber_world_contains_joint(world.get(), joints[0]), tied);
    limber_world_step(world.get(), 20);

    limber::World cpp;
    add_machine(cpp, written, {.pose = pose, .angular_velocity = {0, 0, 1}, .tied = tied});
    for (int i = 0; i < 20; ++i) cpp.step();
    EXPECT_EQ(limber_world_state_hash(world.get()), cpp.state_hash());
  }
}

TEST(CShape, TellsTheMassOfASolid) {
  limber_mass_properties mass{};
  ASSERT_EQ(limber_shape_mass_properties(make_sphere(0.5).get(), 1000.0, &mass), LIMBER_OK);
  EXPECT_NEAR(mass.mass, 523.5987755982989, 1e-9);
  EXPECT_NEAR(mass.inertia[4], 0.4 * mass.mass * 0.25, 1e-9);
  limber_shape* shape = nullptr;
  EXPECT_EQ(limber_shape_create_sphere(-1.0, &shape), LIMBER_INVALID_ARGUMENT);
  const double flat[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
  EXPECT_EQ(limber_shape_create_hull(flat, 3, &shape), LIMBER_INVALID_ARGUMENT);
  EXPECT_EQ(shape, nullptr);
  ASSERT_EQ(limber_shape_create_hull(flat, 4, &shape), LIMBER_OK);
  EXPECT_EQ(limber_shape_mass_properties(Shape(shape).get(), 1.0, &mass), LIMBER_INVALID_ARGUMENT);
}

/// A ball that falls from 1 m hits the ground at v = √(2 g h), less a step's worth, and stops: its momentum is the
/// impulse.
TEST(CContacts, TellHitsAboveASpeed) {
  constexpr double kStep = 1.0 / 240.0, kGravity = 9.80665, kRadius = 0.1, kHeight = 1.0;
  for (const double asked : {4.0, 5.0}) {
    limber_world_options options = limber_default_world_options();
    EXPECT_EQ(options.hit_speed, 1.0);
    options.step = kStep, options.hit_speed = asked;
    const World world = make_world(&options);
    EXPECT_EQ(limber_world_set_contacts(world.get(), nullptr), LIMBER_OK);
    const limber_body_id ground = add_ground(world.get());
    const limber_body_id ball = add_sphere(world.get(), kRadius, {0, 0, kHeight + kRadius});
    EXPECT_EQ(limber_world_set_body_user_data(world.get(), ball, 7), LIMBER_OK);
    const double speed = std::sqrt(2.0 * kGravity * kHeight);  // 4.43 m/s
    std::vector<limber_hit_event> hits;
    for (int i = 0; i < 240; ++i) {
      EXPECT_EQ(limber_world_step(world.get(), 1), LIMBER_OK);
      limber_hit_event event{};
      std::size_t count = 0;
      EXPECT_EQ(limber_world_hit_events(world.get(), &event, 1, &count), LIMBER_OK);
      if (count > 0) hits.push_back(event);
    }
    ASSERT_EQ(hits.size(), asked < speed ? 1u : 0u) << asked;
    if (hits.empty()) continue;
    const limber_hit_event& hit = hits[0];
    const bool ball_first = hit.a.index == ball.index;
    EXPECT_EQ(ball_first ? hit.b.index : hit.a.index, ground.index);
    EXPECT_EQ(ball_first ? hit.user_data_a : hit.user_data_b, 7u);
    EXPECT_NEAR(hit.speed, speed, 2.0 * kGravity * kStep);
    EXPECT_NEAR(hit.normal.z, ball_first ? 1.0 : -1.0, 1e-9);
    const double mass = 1000.0 * 4.0 / 3.0 * 3.14159265358979 * kRadius * kRadius * kRadius;
    EXPECT_NEAR(std::abs(hit.impulse.z), mass * speed, 0.02 * mass * speed);
    EXPECT_NEAR(height(world.get(), ball), kRadius, 1e-3);
  }
}

/// A belt under a box carries it along at its own speed.
TEST(CContacts, BeltsCarry) {
  const World world = make_world();
  EXPECT_EQ(limber_world_set_contacts(world.get(), nullptr), LIMBER_OK);
  const limber_body_id ground = add_ground(world.get());
  EXPECT_EQ(limber_world_set_surface_velocity(world.get(), ground, {0.5, 0, 0}), LIMBER_OK);
  limber_vec3 told{};
  EXPECT_EQ(limber_world_surface_velocity(world.get(), ground, &told), LIMBER_OK);
  EXPECT_EQ(told.x, 0.5);
  limber_shape* shape = nullptr;
  EXPECT_EQ(limber_shape_create_box({0.2, 0.2, 0.1}, &shape), LIMBER_OK);
  const Shape box(shape);
  limber_placement start = limber_default_placement();
  start.pose.p.z = 0.1;
  limber_body_id id{};
  EXPECT_EQ(limber_world_add_rigid(world.get(), box.get(), 500.0, &start, &id), LIMBER_OK);
  EXPECT_EQ(limber_world_step(world.get(), 120), LIMBER_OK);
  limber_body_state state{};
  EXPECT_EQ(limber_world_body_state(world.get(), id, &state), LIMBER_OK);
  EXPECT_NEAR(state.velocity.x, 0.5, 1e-3);
}

/// A ball that hangs by a joint of less strength than its weight is let go in the first step.
TEST(CWorld, JointsBreakAboveTheirStrength) {
  const World world = make_world();
  const limber_body_id ball = add_sphere(world.get(), 0.1, {0, 0, -1});
  limber_joint_options options = limber_default_joint_options();
  options.type = LIMBER_JOINT_BALL;
  limber_joint_id joint{};
  EXPECT_EQ(limber_world_add_joint(world.get(), {0, 0}, ball, &options, &joint), LIMBER_OK) << limber_last_error();
  double strength = 0.0;
  EXPECT_EQ(limber_world_joint_strength(world.get(), joint, &strength), LIMBER_OK);
  EXPECT_TRUE(std::isinf(strength));
  EXPECT_EQ(limber_world_step(world.get(), 10), LIMBER_OK);
  limber_joint_state state{};
  EXPECT_EQ(limber_world_joint_state(world.get(), joint, &state), LIMBER_OK);
  EXPECT_EQ(limber_world_set_joint_strength(world.get(), joint, 0.9 * state.lock_force.z), LIMBER_OK);
  EXPECT_EQ(limber_world_set_joint_strength(world.get(), joint, -1.0), LIMBER_INVALID_ARGUMENT);
  EXPECT_EQ(limber_world_step(world.get(), 1), LIMBER_OK);
  limber_joint_break broken{};
  std::size_t count = 0;
  EXPECT_EQ(limber_world_joint_breaks(world.get(), &broken, 1, &count), LIMBER_OK);
  ASSERT_EQ(count, 1u);
  EXPECT_EQ(broken.joint.index, joint.index);
  EXPECT_EQ(broken.a.generation, 0u);
  EXPECT_EQ(broken.b.index, ball.index);
  EXPECT_FALSE(limber_world_contains_joint(world.get(), joint));
}

/// A dumb-bell of two balls: its mass, its rest on both, and queries that know the whole and tell a place for loads.
TEST(CWorld, CompoundsStandOnTheirParts) {
  constexpr double kRadius = 0.1;
  const Shape ball = make_sphere(kRadius);
  limber_transform left = limber_default_placement().pose, right = left;
  left.p.x = -0.3, right.p.x = 0.3;
  const limber_shape_part parts[] = {{ball.get(), left}, {ball.get(), right}};
  limber_mass_properties one{}, both{};
  EXPECT_EQ(limber_shape_mass_properties(ball.get(), 500.0, &one), LIMBER_OK);
  EXPECT_EQ(limber_parts_mass_properties(parts, 2, 500.0, &both), LIMBER_OK);
  EXPECT_NEAR(both.mass, 2.0 * one.mass, 1e-12);
  EXPECT_NEAR(both.inertia[8], 2.0 * (one.inertia[8] + one.mass * 0.09), 1e-12);

  const World world = make_world();
  EXPECT_EQ(limber_world_set_contacts(world.get(), nullptr), LIMBER_OK);
  add_ground(world.get());
  limber_placement start = limber_default_placement();
  start.pose.p.z = 0.2;
  limber_body_id bell{}, heavy{}, led{};
  EXPECT_EQ(limber_world_add_compound(world.get(), parts, 2, 500.0, &start, &bell), LIMBER_OK) << limber_last_error();
  both.mass *= 3.0;
  start.pose.p.y = 1.0;
  EXPECT_EQ(limber_world_add_compound_with_mass(world.get(), parts, 2, &both, &start, &heavy), LIMBER_OK);
  start.pose.p.y = 2.0;
  EXPECT_EQ(limber_world_add_kinematic_compound(world.get(), parts, 2, &start, &led), LIMBER_OK) << limber_last_error();
  EXPECT_EQ(limber_world_step(world.get(), 120), LIMBER_OK);
  EXPECT_NEAR(height(world.get(), bell), kRadius, 1e-3);
  EXPECT_NEAR(height(world.get(), heavy), kRadius, 1e-3);
  EXPECT_EQ(height(world.get(), led), 0.2);
  EXPECT_EQ(limber_world_body_count(world.get()), 4u);

  bool found = false;
  limber_hit hit{};
  EXPECT_EQ(limber_world_cast_ray(world.get(), {0.3, 0, 2}, {0, 0, -3}, nullptr, &found, &hit), LIMBER_OK);
  ASSERT_TRUE(found);
  EXPECT_EQ(hit.body.index, bell.index);
  EXPECT_TRUE(hit.has_point);
  EXPECT_EQ(limber_world_apply_impulse(world.get(), bell, hit.at, {0, 0, 1}, LIMBER_AXES_WORLD, 0.0), LIMBER_OK);

  limber_body_id none{9, 9};
  EXPECT_EQ(limber_world_add_compound(world.get(), nullptr, 0, 500.0, nullptr, &none), LIMBER_INVALID_ARGUMENT);
  EXPECT_EQ(limber_world_add_compound(world.get(), nullptr, 2, 500.0, nullptr, &none), LIMBER_INVALID_ARGUMENT);
  const limber_shape_part empty[] = {{nullptr, left}};
  EXPECT_EQ(limber_world_add_compound(world.get(), empty, 1, 500.0, nullptr, &none), LIMBER_INVALID_ARGUMENT);
  EXPECT_EQ(none.index, 9u);
}

}  // namespace
