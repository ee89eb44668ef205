#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "constants.h"
#include "limber/dynamics/body_group.h"
#include "sample_models.h"

namespace limber {
namespace {

using testing::kAllMotions;
using testing::kDown;
using testing::kMarked;
using testing::sample_model;

/// Two equal groups of one moving body each.
struct Twins {
  explicit Twins(FrameMotion motion, double step = 1.0 / 60.0)
      : model(sample_model({.motion = motion, .modes = 11, .decay = 0.3})), one(model, step), other(model, step) {
    for (BodyGroup* group : {&one, &other}) {
      group->add({quaternion_from_rotation_vector({0.3, 0.1, -0.7}), {1.0, 2.0, 3.0}}, {0.1, 0.2, 0.3},
                 {2.0, -1.0, 0.5});
      group->apply_impulse(0, kMarked, {0.1, -0.3, 0.2}, 0.0);
    }
  }
  std::shared_ptr<const ModalModel> model;
  BodyGroup one, other;
};

void expect_same_bits(const BodyGroup& a, const BodyGroup& b) {
  const RigidTransform &X = a.frame(0).pose(), &Y = b.frame(0).pose();
  EXPECT_EQ(X.p, Y.p);
  EXPECT_EQ(X.q.w, Y.q.w);
  EXPECT_EQ(X.q.vector(), Y.q.vector());
  EXPECT_EQ(a.frame(0).velocity(), b.frame(0).velocity());
  EXPECT_EQ(a.frame(0).angular_momentum(a.frame_constants()), b.frame(0).angular_momentum(b.frame_constants()));
  for (std::size_t i = 0; i < a.amplitudes(0).size(); ++i) {
    EXPECT_EQ(a.amplitudes(0)[i], b.amplitudes(0)[i]);
    EXPECT_EQ(a.rates(0)[i], b.rates(0)[i]);
  }
}

TEST(ConstraintStep, WithoutAConstraintItIsTheFreeStepBitForBit) {
  for (const FrameMotion motion : kAllMotions) {
    Twins twins(motion);
    for (int step = 0; step < 20; ++step) {
      for (BodyGroup* group : {&twins.one, &twins.other}) {
        if (step == 5) group->apply_force(0, kMarked, {1.0, 2.0, 3.0});
        if (step == 9) group->apply_impulse(0, kMarked, {0.1, 0.0, 0.2}, 0.004);
      }
      twins.one.advance(0, 1, kDown);
      twins.other.predict(0, kDown);
      twins.other.commit(0);
      expect_same_bits(twins.one, twins.other);
    }
  }
}

TEST(ConstraintStep, APredictionLeavesTheBodyAsItIs) {
  for (const FrameMotion motion : kAllMotions) {
    Twins twins(motion);
    const std::vector<double> modal(11, 0.3);
    for (int step = 0; step < 5; ++step) {
      twins.other.predict(
          0, kDown, {.impulse = {1.0, 2.0, 3.0}, .moment = {3.0, 2.0, 1.0}, .force = {5.0, 0.0, 1.0}, .modal = modal});
      expect_same_bits(twins.one, twins.other);
      twins.one.advance(0, 1, kDown);
      twins.other.advance(0, 1, kDown);
    }
  }
}

/// The load of a force, of which the frame gets its impulse at the step's start.
TEST(ConstraintStep, AnImpulseMovesTheFrameLikeAnImpulseAndTheModesLikeAHeldForce) {
  for (const FrameMotion motion : kAllMotions) {
    Twins struck(motion), held(motion);
    const double h = struck.one.step_length();
    BodyGroup& group = struck.other;
    const Vec3 J(0.4, -0.2, 0.7);
    const Quaternion q_WB = group.frame(0).pose().q;
    const Vec3 arm = q_WB * deformed_point(*struck.model, kMarked, group.amplitudes(0));
    std::vector<double> modal(11, 0.0);
    add_modal_force(*struck.model, kMarked, q_WB.conjugate() * J, modal);
    group.predict(0, Vec3::Zero(), {.impulse = J, .moment = arm.cross(J), .modal = modal});

    struck.one.apply_impulse(0, kMarked, J, 0.0);
    struck.one.advance(0, 1, Vec3::Zero());
    held.one.apply_force(0, kMarked, J / h);
    held.one.advance(0, 1, Vec3::Zero());

    constexpr double kRoundOff = 1e-13;
    const RigidFrame &expected = struck.one.frame(0), &seen = group.predicted_frame(0);
    EXPECT_NEAR((expected.pose().p - seen.pose().p).norm(), 0.0, kRoundOff);
    // A body hung on a line or point takes its excitation from the frame's path, which differs between the two.
    if (motion != FrameMotion::kFree && motion != FrameMotion::kKinematic) continue;
    EXPECT_NEAR((expected.pose().q * arm - seen.pose().q * arm).norm(), 0.0, kRoundOff);
    for (std::size_t i = 0; i < 11; ++i)
      if (group.velocity_response()[i] == 1.0) {
        EXPECT_NEAR(group.predicted_amplitudes(0)[i], held.one.amplitudes(0)[i], kRoundOff);
        EXPECT_NEAR(group.predicted_rates(0)[i], held.one.rates(0)[i], kRoundOff * 100);
      }
  }
}

TEST(ConstraintStep, ModesAboveTheNyquistRateAnswerStaticallyAndForget) {
  const double h = 1.0 / 60.0;
  const auto stiff = sample_model({.modes = 6, .lowest_hz = 400.0});
  BodyGroup loaded(stiff, h), free(stiff, h);
  for (BodyGroup* g : {&loaded, &free}) {
    g->add({}, Vec3::Zero(), Vec3::Zero());
    g->apply_impulse(0, kMarked, {0.1, 0.2, 0.3}, 0.0);
  }
  const std::vector<double> load(6, 5.0);
  for (int step = 0; step < 8; ++step) {
    loaded.predict(0, kDown, {.modal = step < 4 ? std::span<const double>(load) : std::span<const double>()});
    loaded.commit(0);
    free.advance(0, 1, kDown);
    for (std::size_t i = 0; i < 6; ++i) {
      const double answer = step < 4 ? 5.0 / h / stiff->data().eigenvalues[i] : 0.0;
      EXPECT_NEAR(loaded.static_amplitudes(0)[i], answer, 1e-15 * answer);
      EXPECT_NEAR(loaded.amplitudes(0)[i] - free.amplitudes(0)[i], answer, 1e-14);
    }
  }
}

TEST(ConstraintStep, TheModesResponseIsPositiveForEveryStiffnessDampingAndStep) {
  for (const double hz : {0.01, 1.0, 29.9, 30.1, 60.0, 1e3, 1e6})
    for (const double decay : {0.0, 1.0, 1e3, 1e6})
      for (const double h : {1e-4, 1.0 / 60.0, 0.1}) {
        BodyGroup group(sample_model({.modes = 5, .lowest_hz = hz, .decay = decay}), h);
        for (std::size_t i = 0; i < 5; ++i) {
          const double lambda = group.model().data().eigenvalues[i];
          const double response = group.position_response()[i];
          EXPECT_GT(response, 0.0);
          EXPECT_LE(response * h * lambda, 2.0 * (1.0 + 1e-12)) << "1 − cos at most";
        }
      }
}

}  // namespace
}  // namespace limber
