// [H03]'s own methods for contact, in an island: against closed forms, all vertices of their linear programs, and the
// exact motion. Their solver by itself: contact_program_test.cpp.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "constants.h"
#include "contact_scene.h"
#include "limber/hauser/hauser_method.h"
#include "linear_program_vertices.h"

namespace limber::testing {
namespace {

/// Bodies whose contacts are named by hand: points of the first ones against the ground below z = 0, or each other.
class TouchingIsland : public Island {
 public:
  TouchingIsland(const SampleOptions& sample, double step, const HauserMethod& method, double friction = 0.0,
                 const Vec3& gravity = {0.0, 0.0, -kGravity}, const Vec3& normal = Vec3::UnitZ())
      : Island(sample, step, gravity), contacts(method.contacts({.friction = friction})), normal_(normal) {
    solver = method.islands()();
  }
  /// A point that a body carries rigidly along, against the ground.
  void touch_ground(Index body, const Vec3& point_B) { on_ground_.push_back({body, point_B}); }

  IslandReport step() {
    table.resize(members.size());
    table.push_back({});
    const auto ground = static_cast<Index>(members.size());
    std::vector<ContactPoint> found;
    for (const auto& [body, point_B] : on_ground_) {
      const Vec3 p = group.frame(body).pose() * point_B;
      const double gap = normal_.dot(p);
      found.push_back({.a = {.body = body, .point_B = point_B},
                       .b = {.body = ground, .point_B = p - gap * normal_},
                       .normal = normal_,
                       .position = p,
                       .gap = gap,
                       .id = found.size() + 1});
    }
    found.insert(found.end(), others.begin(), others.end());
    contacts.update(states(), found);
    constraints.assign(contacts.constraints().begin(), contacts.constraints().end());
    const IslandReport report = Island::step();
    contacts.finish();
    return report;
  }
  Vec3 impulse() const {
    Vec3 sum = Vec3::Zero();
    for (const ContactEvent& event : contacts.events()) sum += event.impulse;
    return sum;
  }
  double mass() const { return model->data().mass; }

  ContactSet contacts;
  std::vector<ContactPoint> others;

 private:
  struct Touch {
    Index body;
    Vec3 point_B;
  };
  std::vector<Touch> on_ground_;
  Vec3 normal_;
};

const HauserMethod kProgram({.method = ContactMethod::kVelocityProgram, .guard = ProgramGuard::kNone});

// The velocity program ------------------------------------------------------------------------------------------------

/// J M⁻¹ of a normal row at an arm about the mass centre.
Eigen::Matrix<double, 6, 1> response(const Vec3& arm, const Vec3& n, double mass, const Mat3& inertia) {
  Eigen::Matrix<double, 6, 1> column;
  column << n / mass, inertia.inverse() * arm.cross(n);
  return column;
}

/// A rigid body that strikes with two points, as of the example for which the program of least Σp pushes a point that
/// is not approaching: velocities and energy are those of the best vertex.
TEST(HauserMethod, TheVelocityProgramActsOnAnIslandAsItsBestVertexTells) {
  constexpr double kShort = 1e-9;
  TouchingIsland island({.modes = 0}, kShort, kProgram, 0.0, Vec3::Zero());
  const std::array arms{Vec3(0.15, 0.0, 0.0), Vec3(0.3, 0.0, 0.0)};
  const Vec3 v(0.0, 0.0, -2.0), omega(0.0, -9.0, 0.0);
  island.add_body({}, v, omega);
  for (const Vec3& arm : arms) island.touch_ground(0, arm);
  const FrameConstants& c = island.group.frame_constants();
  Eigen::MatrixXd A(2, 2);
  Eigen::VectorXd b(2);
  for (int i = 0; i < 2; ++i) {
    const Vec3& arm = arms[static_cast<std::size_t>(i)];
    b[i] = (v + omega.cross(arm)).z();
    for (int j = 0; j < 2; ++j) {
      const auto column = response(arms[static_cast<std::size_t>(j)], Vec3::UnitZ(), c.mass, c.inertia);
      A(i, j) = (column.head<3>() + Vec3(column.tail<3>()).cross(arm)).z();
    }
  }
  ASSERT_LT(b[0], 0.0);
  ASSERT_GT(b[1], 0.0);
  const double before = island.energy();
  island.step();
  const double least = least_sum_of_all_vertices(A, b);
  EXPECT_NEAR(island.impulse().z(), least, 1e-6 * least);
  EXPECT_NEAR(island.group.frame(0).velocity().z(), v.z() + least / c.mass, 1e-6);
  EXPECT_GT(island.energy(), before) << "it pushes where that is cheap, and adds energy";
}

// Backing up to the first touch
// -----------------------------------------------------------------------------------------

/// What falls onto a point below its mass centre stops there at the exact time, and lies for the rest of the step.
TEST(HauserMethod, BackingUpStopsWhatFallsAtTheTimeOfItsTouch) {
  constexpr double kHeight = 0.05, kBelow = 0.1, kSpeed = 1.0;
  for (const double step : {0.1, 0.06}) {
    TouchingIsland island({.modes = 0}, step, HauserMethod({.method = ContactMethod::kVelocityProgram}));
    island.add_body({{}, {0.0, 0.0, kBelow + kHeight}}, {0.0, 0.0, -kSpeed});
    island.touch_ground(0, {0.0, 0.0, -kBelow});
    const double at_touch = std::sqrt(kSpeed * kSpeed + 2.0 * kGravity * kHeight);
    const double time = (at_touch - kSpeed) / kGravity;
    ASSERT_LT(time, step);
    const IslandReport report = island.step();
    EXPECT_EQ(report.attempts.cuts(), 1);
    EXPECT_NEAR(island.group.frame(0).pose().p.z(), kBelow, 1e-9);
    EXPECT_NEAR(island.group.frame(0).velocity().z(), 0.0, 1e-9);
    EXPECT_NEAR(island.impulse().z(), island.mass() * (at_touch + kGravity * (step - time)), 1e-8);
  }
}

// The acceleration program
// ----------------------------------------------------------------------------------------------

/// A body that turns over a point that rests on the ground presses with what gravity, the centripetal acceleration of
/// the point and the turning of the body's own axes leave: [H03] equation 20.
TEST(HauserMethod, WhatTurnsOverAPointPressesByEquation20) {
  constexpr double kShort = 1e-7;
  const Vec3 arm(0.2, 0.1, -0.1);
  for (const Vec3& omega : {Vec3(0.0, 2.0, 0.0), Vec3(1.0, 3.0, -2.0), Vec3(5.0, 20.0, 0.0)}) {
    TouchingIsland island({.modes = 0}, kShort, kProgram);
    island.add_body({{}, -arm}, -omega.cross(arm), omega);
    island.touch_ground(0, arm);
    const FrameConstants& c = island.group.frame_constants();
    const Vec3 alpha = c.inertia.inverse() * -omega.cross(c.inertia * omega);
    const double open = (Vec3(0.0, 0.0, -kGravity) + omega.cross(omega.cross(arm)) + alpha.cross(arm)).z();
    const Vec3 turn = arm.cross(Vec3::UnitZ());
    const double expected = std::max(0.0, -open / (1.0 / c.mass + turn.dot(c.inertia.inverse() * turn)));
    island.step();
    EXPECT_NEAR(island.impulse().z() / kShort, expected, 1e-5 * island.mass() * kGravity) << omega.transpose();
  }
}

/// How fast a vertex of one body leaves the face of another after a step in which the program held it there; both
/// bodies turn and vibrate, and the vertex slides over the face.
double leaving_speed(double step) {
  TouchingIsland island({.modes = 6, .lowest_hz = 20.0}, step, kProgram, 0.0, Vec3::Zero());
  const SurfacePoint vertex = corner_point(*island.model, 0);  // lowest of all
  SurfacePoint face{};                                         // of the top
  const ModalSurface& surface = island.model->collision();
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    bool top = true;
    for (const Index v : surface.triangles[t]) top = top && surface.rest[static_cast<std::size_t>(v)].z() > 0.0f;
    if (top) face = {.triangle = static_cast<Index>(t), .weight = {0.3, 0.3, 0.4}};
  }
  const RigidTransform upper{quaternion_from_rotation_vector({0.3, -0.4, 0.2}), {0.0, 0.0, 1.0}};
  const Vec3 meet = upper * deformed_point(*island.model, vertex, {});
  const Vec3 omega_a(2.0, 3.0, -1.0), omega_b(-3.0, 2.0, 4.0);
  const Vec3 on_face = deformed_point(*island.model, face, {});
  const Vec3 slides(0.7, -0.4, 0.0);  // over the face, whose normal is z at first
  island.add_body(upper, slides - omega_a.cross(meet - upper.p), omega_a);
  island.add_body({{}, meet - on_face}, -omega_b.cross(on_face), omega_b);
  const std::vector<double> z(6, 0.0), rates{0.1, -0.2, 0.15, 0.1, -0.1, 0.05};
  island.group.set_amplitudes(0, z, rates);
  const Vec3 n = Vec3::UnitZ();
  // The modes' rates come on top: their part along the normal is taken out.
  const Vec3 extra = island.group.velocity(0, vertex) - island.group.velocity(1, face) - slides;
  island.group.set_velocity(0, island.group.frame(0).velocity() - extra, omega_a);
  island.group.apply_force(0, vertex, {0.0, 0.0, -400.0});
  island.others = {{.a = contact_side(island, 0, vertex), .b = contact_side(island, 1, face), .normal = n, .id = 7}};
  island.step();
  EXPECT_GT(island.impulse().z(), 0.0);
  const Vec3 normal = island.group.frame(1).pose().q * n,
             turn = island.group.frame(1).angular_velocity(island.group.frame_constants()).cross(normal);
  return normal.dot(island.group.velocity(0, vertex) - island.group.velocity(1, face)) +
         turn.dot(island.group.position(0, vertex) - island.group.position(1, face));
}

/// Held by accelerations, a vertex stays on a turning face to second order in the step. Without J̇v and the turning of
/// the normal its speed would be off to first order: by h times some ω² r and 2 ω v, 20 m/s² here.
TEST(HauserMethod, WhatTheAccelerationProgramHoldsLeavesToSecondOrderInTheStep) {
  constexpr double kStep = 2e-5, kBias = 20.0;  // s, m/s²
  const double coarse = std::abs(leaving_speed(kStep)), fine = std::abs(leaving_speed(0.5 * kStep));
  EXPECT_LT(coarse, 1e-3 * kBias * kStep);
  EXPECT_NEAR(fine / coarse, 0.25, 0.03);
}

// Friction after the normals
// -----------------------------------------------------------------------------------------------

/// The acceleration down a slope of a body that touches at its mass centre, so that nothing turns; in steps so short
/// that the point does not leave its place on the ground within one. Over a tenth of a second, after another.
double acceleration(const ContactRule& rule, double angle, double friction) {
  const Vec3 normal(-std::sin(angle), 0.0, std::cos(angle));
  constexpr double kStep = 1e-3;
  constexpr int kSteps = 100;
  TouchingIsland island({.modes = 0}, kStep, HauserMethod(rule), friction, {0.0, 0.0, -kGravity}, normal);
  island.add_body({});
  island.touch_ground(0, Vec3::Zero());
  for (int i = 0; i < kSteps; ++i) island.step();
  const Vec3 before = island.group.frame(0).velocity();
  for (int i = 0; i < kSteps; ++i) island.step();
  return (island.group.frame(0).velocity() - before).norm() / (kSteps * kStep);
}

/// With one contact that turns nothing there is nothing that friction after the normals could get wrong: Coulomb's law.
TEST(HauserMethod, OnASinglePointHeuristicFrictionIsCoulombs) {
  constexpr double kMu = 0.5, kSlipped = 1e-4;  // m/s²: forces act half a slip beside the mass centre and turn it
  const double steep = 1.4 * std::atan(kMu), gentle = 0.9 * std::atan(kMu);
  for (const FrictionModel friction : {FrictionModel::kHeuristic, FrictionModel::kHeuristicNoSlip})
    for (const ContactMethod method :
         {ContactMethod::kVelocityProgram, ContactMethod::kGapProgram, ContactMethod::kComplementary}) {
      const ContactRule rule{.method = method, .friction = friction};
      EXPECT_NEAR(acceleration(rule, steep, kMu), kGravity * (std::sin(steep) - kMu * std::cos(steep)), kSlipped)
          << static_cast<int>(method);
      EXPECT_LT(acceleration(rule, gentle, kMu), 1e-6) << static_cast<int>(method);
    }
}

// Penalty
// -----------------------------------------------------------------------------------------------------------------

/// Taken at the step's end, springs give back no more than they took, at any step and stiffness.
TEST(HauserMethod, PenaltySpringsAddNoEnergyAtAnyStep) {
  constexpr double kSpeed = 2.0;
  for (const double hz : {2.0, 15.0, 500.0})
    for (const double step : {1e-3, kFrame, 0.1}) {
      TouchingIsland island({.modes = 0}, step,
                            HauserMethod({.method = ContactMethod::kPenalty,
                                          .guard = ProgramGuard::kNone,
                                          .penalty_frequency = hz,
                                          .penalty_damping = 0.0}),
                            0.0, Vec3::Zero());
      island.guard_energy = false;
      island.add_body({{}, {0.0, 0.0, 0.01}}, {0.0, 0.0, -kSpeed});
      island.touch_ground(0, Vec3::Zero());
      const double omega = 2.0 * std::numbers::pi * hz, k = island.mass() * omega * omega, scale = island.energy();
      const auto energy = [&] {
        const double depth = std::min(0.0, island.group.frame(0).pose().p.z());
        return island.energy() + 0.5 * k * depth * depth;
      };
      double before = energy();
      bool pressed = false;
      for (int i = 0; i < 200; ++i) {
        island.step();
        EXPECT_LE(energy(), before + 1e-9 * scale) << hz << " Hz, step " << step;
        before = energy();
        pressed = pressed || island.impulse().z() > 0.0;
      }
      EXPECT_TRUE(pressed);
      EXPECT_GT(island.group.frame(0).velocity().z(), 0.0) << "it comes back";
    }
}

}  // namespace
}  // namespace limber::testing
