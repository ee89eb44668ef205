// Surfaces that bend by a modal skin: boxes and bounds that hold, and contacts that give no energy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <random>

#include "limber/collision/contact_finder.h"
#include "limber/collision/deformed_surface.h"
#include "limber/dynamics/body_shape.h"
#include "limber/dynamics/skin_extent.h"
#include "skinned_bar.h"

namespace limber::testing {
namespace {

/// Amplitudes at random whose handles turn by up to so much.
std::vector<double> random_bend(const ModalModel& model, double angle, std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::vector<double> z;
  for (const double lambda : model.data().eigenvalues) z.push_back(normal(random) / std::sqrt(lambda));
  SkinPose pose(*model.data().skin);
  pose.set(z);
  for (double& x : z) x *= angle / pose.largest_angle();
  return z;
}

std::shared_ptr<const CollisionSurface> surface_of(const std::shared_ptr<const ModalModel>& model) {
  return std::make_shared<const CollisionSurface>(model, CollisionSurfaceOptions{.skin = true});
}

TEST(SkinnedSurfaces, BoxesEncloseAllVerticesAtAnyBend) {
  std::mt19937 random(7);
  for (const bool held : {true, false}) {
    const auto model = bar({.held = held});
    const auto surface = surface_of(model);
    DeformedSurface body;
    for (int trial = 0; trial < 40; ++trial) {
      const double angle = trial < 20 ? 1.0 : 0.5 * (trial - 19);
      const std::vector<double> z = random_bend(*model, angle, random);
      body.bind(surface, z);
      for (Index n = 0; n < static_cast<Index>(surface->nodes().size()); ++n) {
        const Aabb box = body.bounds(n);
        for (const Index t : surface->node_triangles(n))
          for (const Vec3& x : body.triangle(t))
            EXPECT_TRUE(((x - box.low).array() >= 0.0).all() && ((box.high - x).array() >= 0.0).all());
      }
    }
  }
}

TEST(SkinnedSurfaces, VerticesAreWherePointsOfTheBodyAre) {
  const auto model = bar();
  const auto surface = surface_of(model);
  const std::vector<double> z = bent(*model, 2.0);
  DeformedSurface body;
  body.bind(surface, z);
  SkinMemory memory(*model->data().skin);
  const BodyShape shape(*model, z, &memory);
  for (Index t = 0; t < surface->triangles(); ++t) {
    const SurfacePoint at{.triangle = t, .weight = {0.2, 0.3, 0.5}};
    const auto [a, b, c] = body.triangle(t);
    EXPECT_LT((shape.position(at) - (0.2 * a + 0.3 * b + 0.5 * c)).norm(), 1e-12 * kLength);
  }
}

TEST(SkinnedSurfaces, NoVertexMovesFartherThanTheBoundSays) {
  std::mt19937 random(11);
  for (const bool held : {true, false}) {
    const auto model = bar({.held = held});
    const auto surface = surface_of(model);
    DeformedSurface now, later;
    constexpr int kTrials = 120;
    constexpr std::array changes{0.001, 0.002, 0.02, 0.06, 0.1};  // rad
    double over_small = 0.0;                                      // the bound over the truth, of the least
    for (int trial = 0; trial < kTrials; ++trial) {
      const std::vector<double> z = random_bend(*model, 0.1 * (trial % 20), random),
                                to = random_bend(*model, changes[static_cast<std::size_t>(trial) % changes.size()],
                                                 random);
      std::vector<double> change(z.size()), shape(z.size()), there(z.size());
      for (std::size_t i = 0; i < z.size(); ++i) there[i] = z[i] + to[i], change[i] = std::abs(to[i]);
      now.bind(surface, z);
      later.bind(surface, there);
      const double far = now.skin_extent(change, shape);
      double bound = 0.0, moved = 0.0, farthest = 0.0;
      for (std::size_t i = 0; i < z.size(); ++i) bound += shape[i] * change[i];
      for (Index v = 0; v < surface->vertices(); ++v) {
        moved = std::max(moved, (later.vertex(v) - now.vertex(v)).norm());
        farthest = std::max(farthest, now.vertex(v).norm());
      }
      EXPECT_LE(moved, bound);
      EXPECT_LE(farthest, far);
      if (trial % 5 == 0) over_small += bound / moved / (kTrials / 5);
    }
    EXPECT_LT(over_small, held ? 3.5 : 10.0);
  }
}

struct Release {
  double largest_gain = 0.0, deepest = 0.0;  // of the energy at the start; of the length
  bool pressed = false;
};

struct Fall {
  double degrees = 60.0, steps_a_period = 60.0, friction = 0.0;
  bool residual = false;
};

/// A bar bent up and let go, to fall back on a plane under it, without damping: one swing.
Release release_on_a_plane(const Fall& fall) {
  const double degrees = fall.degrees, steps_a_period = fall.steps_a_period;
  const auto model = bar({.residual = fall.residual, .cells = 10});
  ContactFinder finder;
  World world({.step = kPeriod / steps_a_period, .gravity = Vec3::Zero()});
  world.set_contact_source(&finder,
                           {.solver = ContactSolver::kExact, .friction = fall.friction, .recovery_speed = 0.0});
  const Vec3 origin = model->data().origin_in_input;
  world.add_static(std::make_shared<Shape>(HalfSpace{}), {.p = Vec3(0.0, 0.0, -0.05) - Vec3(0.0, 0.0, origin.z())});
  const BodyId id = world.add_body(model);
  std::vector<double> z = bent(*model, degrees * kDegree);
  for (std::size_t i = 1; i < z.size(); ++i) z[i] = 0.0;
  world.set_amplitudes(id, z, zeros(*model));
  const SurfacePoint end = vertex_at(*model, {kLength, 0.75, 1.0});
  if (world.position(id, end).z() < 0.0) {
    for (double& x : z) x = -x;
    world.set_amplitudes(id, z, zeros(*model));
  }
  const double start = world.energy(id).total();
  Release r;
  double last = start;
  const double ground = -0.05 - origin.z();
  std::vector<float> positions(3 * static_cast<std::size_t>(model->render().vertices()));
  for (int i = 0; i < static_cast<int>(steps_a_period); ++i) {
    world.step();
    const double energy = world.energy(id).total();
    r.largest_gain = std::max(r.largest_gain, (energy - last) / start);
    last = energy;
    r.pressed = r.pressed || !world.contact_events().empty();
    world.reconstruct(id, positions, {});
    for (std::size_t v = 0; v < positions.size(); v += 3)
      r.deepest = std::max(r.deepest, (ground - static_cast<double>(positions[v + 2])) / kLength);
  }
  return r;
}

/// In steps of a twentieth of the swing contacts act far from where they were found: it sinks in, and gains no energy.
TEST(SkinnedSurfaces, ABarThatFallsBackOnAPlaneGainsNoEnergyAndDoesNotSinkIn) {
  for (const double friction : {0.0, 0.5})
    for (const bool residual : {false, true})
      for (const double steps : {20.0, 60.0}) {
        SCOPED_TRACE(::testing::Message() << "friction " << friction << ", residual " << residual << ", " << steps);
        const Release r = release_on_a_plane({.steps_a_period = steps, .friction = friction, .residual = residual});
        EXPECT_TRUE(r.pressed);
        EXPECT_LE(r.largest_gain, 1e-9);
        if (steps == 60.0) {
          EXPECT_LE(r.deepest, 5e-4);
        }
      }
}

/// A contact's force is turned back with the skin where it presses: what yields goes along it, however the bar bends.
TEST(SkinnedSurfaces, GameContactPressesABentBarAlongItsForce) {
  const auto model = bar({.residual = true, .cells = 10});
  ContactFinder finder;
  World world(kWeightless);
  world.set_contact_source(&finder, {.friction = 0.0});
  const BodyId id = world.add_body(model);
  const SurfacePoint end = vertex_at(*model, {kLength, 0.75, 1.0});
  const Vec3 straight = world.position(id, end);
  std::vector<double> z = bent(*model, 80.0 * kDegree);
  for (std::size_t i = 1; i < z.size(); ++i) z[i] = 0.0;
  world.set_amplitudes(id, z, zeros(*model));
  const Vec3 back = (straight - world.position(id, end)).normalized();
  const Vec3 axis = -Vec3::UnitZ().cross(back);
  world.add_static(std::make_shared<Shape>(HalfSpace{}),
                   {quaternion_from_rotation_vector(std::acos(-back.z()) * axis.normalized()),
                    world.position(id, end) + 0.1 * back});
  for (int i = 0; i < 20 && world.contact_events().empty(); ++i) world.step();
  ASSERT_FALSE(world.contact_events().empty());
  Vec3 deepest = Vec3::Zero();
  for (Index t = 0; t < static_cast<Index>(model->collision().triangles.size()); ++t)
    for (std::size_t c = 0; c < 3; ++c) {
      SurfacePoint at{.triangle = t, .weight = {0.0, 0.0, 0.0}};
      at.weight[c] = 1.0;
      const Vec3 u = world.indentation(id, at);
      if (u.norm() > deepest.norm()) deepest = u;
    }
  EXPECT_GT(-back.dot(deepest), 0.9 * deepest.norm());
}

/// Two free bars on a joint, bent and turning, without damping: joints act on the way on which the bodies bend.
TEST(WorldWithSkins, BarsOnAJointKeepTheirEnergyAndStayTogether) {
  const auto model = bar({.held = false});
  for (const JointType type : {JointType::kBall, JointType::kRevolute}) {
    World world(kWeightless);
    world.set_contact_source(nullptr, {.solver = ContactSolver::kExact});
    const Vec3 in_body = model->data().origin_in_input;
    const BodyId a = world.add_body(model, {.angular_velocity = {0.0, 0.01, 0.02}}),
                 b = world.add_body(model, {.pose = {{}, {1.1 * kLength, 0.0, 0.0}}, .velocity = {0.0, 0.05, 0.0}});
    JointSpec spec{.type = type};
    spec.frame.origin = Vec3(1.05 * kLength, 0.75, 0.5) - in_body;
    const JointId joint = world.add_joint(a, b, spec);
    std::vector<double> rates = bent(*model, 0.03);
    world.set_amplitudes(a, zeros(*model), rates);
    const auto energy = [&] { return world.energy(a).total() + world.energy(b).total(); };
    double last = energy(), gain = 0.0, off = 0.0;
    const double start = last;
    int unsettled = 0;
    for (int i = 0; i < 240; ++i) {
      world.step();
      gain = std::max(gain, energy() - last);
      last = energy();
      off = std::max(off, world.joint(joint).distance_error);
      unsettled += world.constraint_report().solved ? 0 : 1;
    }
    EXPECT_EQ(unsettled, 0);
    EXPECT_LE(gain, 1e-9 * start);
    EXPECT_LE(off, 1e-10 * kLength);
  }
}

/// A bar that lies on rough ground is pulled up and over by a hand at its end, under a weight that bends it.
TEST(SkinnedSurfaces, AHandBendsABarThatLiesOnTheGround) {
  const auto model = bar({.held = false, .damped = true});
  ContactFinder finder;
  World world({.step = kPeriod / 60.0, .gravity = {0.0, 0.0, -0.1}});
  world.set_contact_source(&finder, {.solver = ContactSolver::kExact, .friction = 0.5});
  world.add_static(std::make_shared<Shape>(HalfSpace{}), {.p = -model->data().origin_in_input});
  const BodyId id = world.add_body(model);
  const SurfacePoint end = vertex_at(*model, {kLength, 0.75, 1.0}), other = vertex_at(*model, {0.0, 0.75, 0.0});
  const HandleId hand = world.add_handle(id, end, {.stiffness = 5000.0, .damping = 5000.0});
  const Vec3 start = world.position(id, end);
  const double ground = -model->data().origin_in_input.z();
  constexpr int kSteps = 240;
  int unsettled = 0;
  for (int i = 1; i <= kSteps; ++i) {
    const double angle = std::min(1.0, i / 180.0) * 60.0 * kDegree;
    world.set_handle_target(hand,
                            {.position = start + 0.5 * kLength * Vec3(std::cos(angle) - 1.0, 0.0, std::sin(angle))});
    world.step();
    unsettled += world.constraint_report().solved ? 0 : 1;
  }
  EXPECT_LE(unsettled, kSteps / 20);  // ten
  EXPECT_LE(ground - world.position(id, other).z(), 1e-3 * kLength);
  EXPECT_GT(world.position(id, end).z(), start.z() + 0.3 * kLength);
}

}  // namespace
}  // namespace limber::testing
