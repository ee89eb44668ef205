// A bent strip that meets itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "constants.h"
#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "limber/precompute/bake.h"
#include "tet_box.h"

namespace limber {
namespace {

using testing::kGravity;

constexpr double kArm = 0.2, kUpper = 0.15, kInner = 0.01, kThickness = 0.02, kWidth = 0.04;  // m
const Material kSoftRubber{.youngs_modulus = 5e5, .poisson_ratio = 0.4, .density = 1100.0};

// A strip bent to a hairpin: a lower arm from x = kArm to 0, half a turn, and an upper arm back. Its inner faces are
// 2 kInner apart.
TetMesh hairpin() {
  const double radius = kInner + 0.5 * kThickness, turn = std::numbers::pi * radius, length = kArm + turn + kUpper;
  TetMesh mesh = testing::tet_box(36, 2, 2, {length, kWidth, kThickness});
  for (Vec3& p : mesh.nodes) {
    const double along = p.x(), out = 0.5 * kThickness - p.z();  // from the middle line, away from the inside
    if (along <= kArm) {
      p = {kArm - along, p.y(), -radius - out};
    } else if (along >= kArm + turn) {
      p = {along - kArm - turn, p.y(), radius + out};
    } else {
      const double angle = (along - kArm) / radius;
      p = {-(radius + out) * std::sin(angle), p.y(), -(radius + out) * std::cos(angle)};
    }
  }
  for (Tet& tet : mesh.tets) std::swap(tet[2], tet[3]);  // the bend mirrors
  return mesh;
}

std::shared_ptr<const ModalModel> baked(bool held, bool residual = false) {
  BakeOptions o;
  o.materials = {{"*", kSoftRubber}};
  o.analysis.modes = o.limits.max_modes = 12;
  o.volume_block = true;
  o.residual.surface = residual;
  o.damping = RayleighDamping::from_ratio(held ? 0.5 : 0.02, 1.0, 10.0);
  if (held) o.fixed = {NodesInBox{{-1e-6, -1.0, -1.0}, {1.0, 1.0, -kInner + 1e-6}}};  // the lower arm
  Warnings warnings;
  return bake({.name = "hairpin", .mesh = hairpin()}, o, warnings).asset.bodies[0];
}

struct Strip {
  Strip(const std::shared_ptr<const ModalModel>& model, bool touches_itself, const WorldOptions& options = {})
      : world(options) {
    world.set_contact_source(&finder, {.solver = ContactSolver::kExact, .residual_compliance = true});
    body = world.add_body(model, {.filter = {.self = touches_itself}});
  }
  void step(int count) {
    for (int i = 0; i < count; ++i) world.step();
  }
  // The least height of the upper arm's inner face over the lower arm, where that is held.
  double gap() const {
    const ModalModel& model = world.model(body);
    const ModalSurface& s = model.collision();
    const Vec3 origin = model.data().origin_in_input;
    double least = 1.0;
    for (std::size_t t = 0; t < s.triangles.size(); ++t)
      for (std::size_t c = 0; c < 3; ++c) {
        const Vec3 input = s.rest[static_cast<std::size_t>(s.triangles[t][c])].cast<double>() + origin;
        if (std::abs(input.z() - kInner) > 1e-6) continue;
        SurfacePoint at{.triangle = static_cast<Index>(t), .weight = {0.0, 0.0, 0.0}};
        at.weight[c] = 1.0;
        const Vec3 now = world.position(body, at) + world.indentation(body, at) + origin;
        if (now.x() > 0.0 && now.x() < kArm) least = std::min(least, now.z() + kInner);
      }
    return least;
  }
  ContactFinder finder;
  World world;
  BodyId body;
};

TEST(SelfContact, AStripThatIsBentOntoItselfRestsOnItself) {
  for (const bool residual : {false, true}) {
    const auto model = baked(true, residual);
    Strip through(model, false), resting(model, true);
    for (Strip* strip : {&through, &resting}) strip->step(300);
    ASSERT_LT(through.gap(), -0.5 * kThickness) << "the arm is to be too soft to carry itself";
    // With residual compliance the surface of the held arm yields as well.
    EXPECT_GT(resting.gap(), residual ? -0.02 * kThickness : -1e-6 * kThickness);
    EXPECT_LT(resting.gap(), 1e-6 * kThickness);
    EXPECT_LT(resting.world.energy(resting.body).kinetic_modal, 1e-15);
    EXPECT_TRUE(resting.world.constraint_report().solved);
    double pressing = 0.0;
    for (const ContactEvent& event : resting.world.contact_events()) {
      EXPECT_EQ(event.a, event.b);
      pressing += std::abs(event.impulse.z()) / resting.world.options().step;
    }
    const double weight = kGravity * model->data().mass;
    EXPECT_GT(pressing, 0.01 * weight);
    EXPECT_LT(pressing, 0.5 * weight);  // that of the arm, a part of which its root carries
  }
}

// Forces of a body on itself move neither its centre of mass nor turn it.
TEST(SelfContact, MovesNothingAndGivesNoEnergy) {
  const auto model = baked(false);
  Strip strip(model, true, {.step = 1.0 / 240.0, .gravity = Vec3::Zero()});
  std::vector<double> z(static_cast<std::size_t>(model->modes()), 0.0), rates = z;
  // The two arms towards each other.
  const ModalSurface& s = model->collision();
  for (Index v = 0; v < s.vertices(); ++v) {
    const Vec3 p = s.rest[static_cast<std::size_t>(v)].cast<double>() + model->data().origin_in_input;
    if (p.x() < 0.5 * kUpper) continue;
    for (std::size_t i = 0; i < rates.size(); ++i)
      rates[i] -= (p.z() > 0.0 ? 1.0 : -1.0) * s.basis.shape(v, static_cast<Index>(i)).cast<double>().z();
  }
  const double size = std::sqrt(std::inner_product(rates.begin(), rates.end(), rates.begin(), 0.0));
  for (double& rate : rates) rate *= 0.15 / size;
  strip.world.set_amplitudes(strip.body, z, rates);
  double before = strip.world.energy(strip.body).total(), most = 0.0;
  const double first = before;
  int touched = 0;
  for (int i = 0; i < 240; ++i) {
    strip.step(1);
    const double now = strip.world.energy(strip.body).total();
    most = std::max(most, now - before);
    before = now;
    touched += strip.world.contact_events().empty() ? 0 : 1;
    EXPECT_LT(strip.world.body(strip.body).velocity.norm(), 1e-10);
    EXPECT_LT(strip.world.body(strip.body).angular_velocity.norm(), 1e-8);
  }
  EXPECT_GT(touched, 0);
  EXPECT_LT(most, 1e-6 * first);
}

}  // namespace
}  // namespace limber
