// What is not a number, or infinite, is refused by every function of World that takes numbers, and changes nothing.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "limber/collision/contact_finder.h"
#include "limber/core/error.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber {
namespace {

using testing::kMarked;
using testing::kSecond;
using testing::sample_model;

constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// A world with one of everything that can be told a number.
struct Offered {
  ContactFinder finder;
  World world{{.step = 0.01}};
  BodyId body, other, held;
  HandleId handle;
  JointId joint;
  std::vector<float> drawn, few, numbers;

  Offered() {
    const auto model = sample_model();
    body = world.add_body(model, {.pose = {{}, {0.0, 0.0, 1.0}}, .velocity = {0.1, 0.2, 0.3}});
    other = world.add_body(model, {.pose = {{}, {2.0, 0.0, 1.0}}});
    held = world.add_body(sample_model({.motion = FrameMotion::kKinematic}), {.pose = {{}, {-3.0, 0.0, 1.0}}});
    // By game contact friction may be infinite.
    world.set_contact_source(&finder, {.solver = ContactSolver::kExact});
    handle = world.add_handle(body, kMarked);
    joint = world.add_joint(body, other, {.type = JointType::kRevolute, .frame = {.origin = {1.0, 0.0, 1.0}}});
    drawn.resize(3 * static_cast<std::size_t>(model->render().vertices()));
    few.resize(static_cast<std::size_t>(model->modes()));
    for (int i = 0; i < 3; ++i) world.step();
  }
};

using Offer = std::function<void(Offered&, double bad)>;
using Offers = std::vector<std::pair<std::string, Offer>>;

Vec3 with(double bad) { return {0.0, bad, 0.0}; }
SurfacePoint point_with(double bad) { return {.triangle = 1, .weight = {bad, 0.5, 0.5}}; }
Quaternion turn_with(double bad) { return {1.0, 0.0, bad, 0.0}; }
Mat3 axes_with(double bad) {
  Mat3 axes = Mat3::Identity();
  axes(1, 2) = bad;
  return axes;
}

/// Whatever has fields: one offer each.
template <class Struct>
void offer_fields(Offers& all, const std::string& what, const std::function<void(Offered&, const Struct&)>& call,
                  const std::vector<std::pair<std::string, std::function<void(Struct&, double)>>>& fields) {
  for (const auto& [field, set] : fields)
    all.emplace_back(what + ": " + field, [call, set = set](Offered& o, double bad) {
      Struct value{};
      set(value, bad);
      call(o, value);
    });
}

void offer_bodies(Offers& all) {
  offer_fields<BodyPlacement>(
      all, "add_body", [](Offered& o, const BodyPlacement& at) { o.world.add_body(sample_model(), at); },
      {{"position", [](auto& p, double bad) { p.pose.p = with(bad); }},
       {"orientation", [](auto& p, double bad) { p.pose.q = turn_with(bad); }},
       {"velocity", [](auto& p, double bad) { p.velocity = with(bad); }},
       {"angular velocity", [](auto& p, double bad) { p.angular_velocity = with(bad); }},
       {"friction", [](auto& p, double bad) { p.friction = bad; }},
       {"shape", [](auto& p, double bad) { p.shape = std::make_shared<Shape>(Sphere{.radius = bad}); }}});
  const auto ground = std::make_shared<Shape>(HalfSpace{});
  all.emplace_back("add_static: position", [=](Offered& o, double bad) {
    o.world.add_static(ground, {{}, with(bad)});
  });
  all.emplace_back("add_static: orientation", [=](Offered& o, double bad) {
    o.world.add_static(ground, {turn_with(bad), Vec3::Zero()});
  });
  all.emplace_back("add_static: friction", [=](Offered& o, double bad) { o.world.add_static(ground, {}, {}, bad); });
  all.emplace_back("add_static: offset", [](Offered& o, double bad) {
    o.world.add_static(std::make_shared<Shape>(HalfSpace{.offset = bad}));
  });
  all.emplace_back("add_static: vertex", [](Offered& o, double bad) {
    o.world.add_static(std::make_shared<Shape>(
        TriangleMesh{.vertices = {Vec3::Zero(), Vec3::UnitX(), with(bad)}, .triangles = {{0, 1, 2}}}));
  });
}

void offer_time_and_loads(Offers& all) {
  all.emplace_back("advance", [](Offered& o, double bad) { o.world.advance(bad); });
  all.emplace_back("set_step", [](Offered& o, double bad) { o.world.set_step(bad); });
  all.emplace_back("set_gravity", [](Offered& o, double bad) { o.world.set_gravity(with(bad)); });
  all.emplace_back("apply_force", [](Offered& o, double bad) { o.world.apply_force(o.body, kMarked, with(bad)); });
  all.emplace_back("apply_force: point",
                   [](Offered& o, double bad) { o.world.apply_force(o.body, point_with(bad), Vec3::UnitX()); });
  all.emplace_back("apply_force: in body axes",
                   [](Offered& o, double bad) { o.world.apply_force(o.body, kMarked, with(bad), Axes::kBody); });
  all.emplace_back("apply_impulse", [](Offered& o, double bad) { o.world.apply_impulse(o.body, kMarked, with(bad)); });
  all.emplace_back("apply_impulse: point",
                   [](Offered& o, double bad) { o.world.apply_impulse(o.body, point_with(bad), Vec3::UnitX()); });
  all.emplace_back("apply_impulse: delay", [](Offered& o, double bad) {
    o.world.apply_impulse(o.body, kMarked, Vec3::UnitX(), Axes::kWorld, bad);
  });
  offer_fields<KinematicFrame>(
      all, "set_kinematic_frame",
      [](Offered& o, const KinematicFrame& frame) { o.world.set_kinematic_frame(o.held, frame); },
      {{"position", [](auto& f, double bad) { f.pose.p = with(bad); }},
       {"orientation", [](auto& f, double bad) { f.pose.q = turn_with(bad); }},
       {"velocity", [](auto& f, double bad) { f.velocity = with(bad); }},
       {"acceleration", [](auto& f, double bad) { f.acceleration = with(bad); }},
       {"angular velocity", [](auto& f, double bad) { f.angular_velocity = with(bad); }},
       {"angular acceleration", [](auto& f, double bad) { f.angular_acceleration = with(bad); }}});
}

void offer_handles(Offers& all) {
  all.emplace_back("add_handle: point", [](Offered& o, double bad) { o.world.add_handle(o.other, point_with(bad)); });
  offer_fields<HandleOptions>(all, "add_handle",
                              [](Offered& o, const HandleOptions& h) { o.world.add_handle(o.other, kSecond, h); },
                              {{"direction", [](auto& h, double bad) { h.directions = {with(bad)}; }},
                               {"stiffness", [](auto& h, double bad) { h.stiffness = bad; }},
                               {"damping", [](auto& h, double bad) { h.stiffness = 1.0, h.damping = bad; }},
                               // An unbounded force is the default.
                               {"max_force", [](auto& h, double bad) { h.max_force = bad > 0.0 ? -bad : bad; }}});
  offer_fields<HandleTarget>(all, "set_handle_target",
                             [](Offered& o, const HandleTarget& t) { o.world.set_handle_target(o.handle, t); },
                             {{"position", [](auto& t, double bad) { t.position = with(bad); }},
                              {"velocity", [](auto& t, double bad) { t.velocity = with(bad); }}});
  offer_fields<BodyWish>(all, "manipulate",
                         [](Offered& o, BodyWish wish) {
                           wish.body = o.body;
                           std::vector<double> impulses(1);
                           o.world.manipulate(std::span(&wish, 1), {}, impulses);
                         },
                         {{"point", [](auto& w, double bad) { w.at = point_with(bad); }},
                          {"direction", [](auto& w, double bad) { w.direction = with(bad); }},
                          {"wanted", [](auto& w, double bad) { w.wanted = bad; }}});
  offer_fields<BodyForce>(all, "manipulate, by a force",
                          [](Offered& o, BodyForce force) {
                            force.body = o.body;
                            const BodyWish wish{.body = o.body, .wanted = 0.1};
                            std::vector<double> impulses(1);
                            o.world.manipulate(std::span(&wish, 1), std::span(&force, 1), impulses);
                          },
                          {{"point", [](auto& f, double bad) { f.at = point_with(bad); }},
                           {"direction", [](auto& f, double bad) { f.direction = with(bad); }}});
}

void offer_joints(Offers& all) {
  offer_fields<JointSpec>(
      all, "add_joint", [](Offered& o, const JointSpec& joint) { o.world.add_joint(o.body, o.held, joint); },
      {{"origin", [](auto& j, double bad) { j.frame.origin = with(bad); }},
       {"axes", [](auto& j, double bad) { j.frame.axes = axes_with(bad); }},
       {"pitch", [](auto& j, double bad) { j.type = JointType::kCylindrical, j.pitch = bad; }},
       // Ends that are infinite are open, where they are on their side.
       {"low",
        [](auto& j, double bad) { j.type = JointType::kRevolute, j.limits.rotation.low = bad < 0.0 ? -bad : bad; }},
       {"high",
        [](auto& j, double bad) { j.type = JointType::kRevolute, j.limits.rotation.high = bad > 0.0 ? -bad : bad; }},
       {"cone", [](auto& j, double bad) { j.type = JointType::kBall, j.limits.cone = bad > 0.0 ? -bad : bad; }}});
  offer_fields<JointAttachment>(
      all, "add_joint, attached",
      [](Offered& o, const JointAttachment& on) { o.world.add_joint(o.body, o.held, {}, on, {}); },
      {{"radius", [](auto& a, double bad) { a.radius = bad; }}, {"patch", [](auto& a, double bad) {
                                                                   a.patch = {kMarked, kSecond, point_with(bad)};
                                                                 }}});
  offer_fields<JointActuation>(
      all, "set_joint_actuation",
      [](Offered& o, const JointActuation& a) { o.world.set_joint_actuation(o.joint, 0, a); },
      {{"motor_velocity", [](auto& a, double bad) { a.motor_max_force = 1.0, a.motor_velocity = bad; }},
       {"motor_max_force", [](auto& a, double bad) { a.motor_max_force = bad > 0.0 ? -bad : bad; }},
       {"drive_target", [](auto& a, double bad) { a.drive_stiffness = 1.0, a.drive_target = bad; }},
       {"drive_stiffness", [](auto& a, double bad) { a.drive_stiffness = bad; }},
       {"drive_damping", [](auto& a, double bad) { a.drive_damping = bad; }},
       {"friction", [](auto& a, double bad) { a.friction = bad; }}});
}

void offer_contact(Offers& all) {
  offer_fields<ContactOptions>(all, "set_contact_source",
                               [](Offered& o, ContactOptions c) {
                                 c.solver = ContactSolver::kExact;
                                 o.world.set_contact_source(&o.finder, c);
                               },
                               {{"friction", [](auto& c, double bad) { c.friction = bad; }},
                                {"rolling_friction", [](auto& c, double bad) { c.rolling_friction = bad; }},
                                {"recovery_speed", [](auto& c, double bad) { c.recovery_speed = bad; }},
                                {"compliance", [](auto& c, double bad) { c.compliance = bad; }}});
}

void offer_state(Offers& all) {
  all.emplace_back("set_pose: position", [](Offered& o, double bad) { o.world.set_pose(o.body, {{}, with(bad)}); });
  all.emplace_back("set_pose: orientation", [](Offered& o, double bad) {
    o.world.set_pose(o.body, {turn_with(bad), Vec3::Zero()});
  });
  all.emplace_back("set_velocity",
                   [](Offered& o, double bad) { o.world.set_velocity(o.body, with(bad), Vec3::Zero()); });
  all.emplace_back("set_velocity: angular",
                   [](Offered& o, double bad) { o.world.set_velocity(o.body, Vec3::Zero(), with(bad)); });
  const std::vector<double> zero(4, 0.0), nodes(81, 0.0);
  all.emplace_back("set_amplitudes", [=](Offered& o, double bad) {
    o.world.set_amplitudes(o.body, std::vector{0.0, 0.0, bad, 0.0}, zero);
  });
  all.emplace_back("set_amplitudes: rates", [=](Offered& o, double bad) {
    o.world.set_amplitudes(o.body, zero, std::vector{0.0, 0.0, 0.0, bad});
  });
  const auto spoilt = [=](double bad) {
    std::vector<double> out = nodes;
    out[40] = bad;
    return out;
  };
  all.emplace_back("set_node_displacements",
                   [=](Offered& o, double bad) { o.world.set_node_displacements(o.body, spoilt(bad), nodes); });
  all.emplace_back("set_node_displacements: velocities",
                   [=](Offered& o, double bad) { o.world.set_node_displacements(o.body, nodes, spoilt(bad)); });
  all.emplace_back("position", [](Offered& o, double bad) { o.world.position(o.body, point_with(bad)); });
  all.emplace_back("velocity", [](Offered& o, double bad) { o.world.velocity(o.body, point_with(bad)); });
  all.emplace_back("indentation", [](Offered& o, double bad) { o.world.indentation(o.body, point_with(bad)); });
}

void offer_drawing(Offers& all) {
  all.emplace_back("reconstruct: interpolation",
                   [](Offered& o, double bad) { o.world.reconstruct(o.body, o.drawn, {}, bad); });
  all.emplace_back("reconstruct: origin",
                   [](Offered& o, double bad) { o.world.reconstruct(o.body, o.drawn, {}, 1.0, with(bad)); });
  all.emplace_back("reconstruct: tolerance", [](Offered& o, double bad) {
    const DrawTarget target{.id = o.body, .positions = o.drawn, .tolerance = bad};
    o.world.reconstruct(std::span(&target, 1));
  });
  all.emplace_back("interpolated_pose", [](Offered& o, double bad) { o.world.interpolated_pose(o.body, bad); });
  all.emplace_back("interpolated_amplitudes",
                   [](Offered& o, double bad) { o.world.interpolated_amplitudes(o.body, bad, o.few); });
  all.emplace_back("interpolated_weights",
                   [](Offered& o, double bad) { o.world.interpolated_weights(o.body, bad, o.few); });
}

void offer_options(Offers& all) {
  offer_fields<WorldOptions>(all, "World", [](Offered&, const WorldOptions& options) { World world(options); },
                             {{"step", [](auto& w, double bad) { w.step = bad; }},
                              {"gravity", [](auto& w, double bad) { w.gravity = with(bad); }},
                              {"sleep.time", [](auto& w, double bad) { w.sleep.time = bad; }},
                              {"sleep.speed", [](auto& w, double bad) { w.sleep.speed = bad; }}});
}

TEST(WorldNotFinite, EveryNumberIsRefusedAndChangesNothing) {
  Offers offers;
  offer_bodies(offers);
  offer_time_and_loads(offers);
  offer_handles(offers);
  offer_joints(offers);
  offer_contact(offers);
  offer_state(offers);
  offer_drawing(offers);
  offer_options(offers);
  Offered offered, untouched;
  for (const auto& [name, offer] : offers)
    for (const double bad : {std::nan(""), kInfinite, -kInfinite}) {
      const std::uint64_t before = offered.world.state_hash();
      EXPECT_THROW(offer(offered, bad), InvalidArgument) << name << " of " << bad;
      EXPECT_EQ(offered.world.state_hash(), before) << name << " of " << bad;
      EXPECT_EQ(offered.world.body_count(), 3u) << name << " of " << bad;
    }
  // Nor is anything kept for the next step.
  offered.world.step();
  untouched.world.step();
  EXPECT_EQ(offered.world.state_hash(), untouched.world.state_hash());
}

}  // namespace
}  // namespace limber
