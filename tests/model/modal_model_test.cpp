#include "limber/model/modal_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "constants.h"
#include "example_model.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
using testing::kInfinity;

/// What the model says of the example with one thing changed; "accepted" if nothing.
std::string said_of(const std::function<void(ModalModelData&)>& change,
                    ModalModelData data = example::full_box("b", 3)) {
  change(data);
  try {
    ModalModel model(std::move(data));
  } catch (const InvalidArgument& e) {
    return e.what();
  }
  return "accepted";
}

using D = ModalModelData;

TEST(ModalModel, ExamplesAreAccepted) {
  EXPECT_EQ(said_of([](D&) {}), "accepted");
  EXPECT_EQ(said_of([](D&) {}, example::box("b", 3)), "accepted");
  EXPECT_EQ(said_of([](D&) {}, example::full_box("b", 0)), "accepted");
}

TEST(ModalModel, FrequencyIsRootOfEigenvalueOverTwoPi) {
  const ModalModel model(example::box("b", 3));
  EXPECT_NEAR(model.frequency_hz(2), 300.0, 1e-10);
  EXPECT_THROW(model.frequency_hz(3), InvalidArgument);
  EXPECT_THROW(model.frequency_hz(-1), InvalidArgument);
}

TEST(ModalModel, TouchesWithItsRenderSurfaceUnlessItHasAnother) {
  const ModalModel plain(example::box("b", 3)), full(example::full_box("b", 3));
  EXPECT_EQ(&plain.collision(), &plain.render());
  EXPECT_NE(&full.collision(), &full.render());
}

TEST(ModalModel, SkinFitsItsBody) {
  const auto said = [](const std::function<void(ModalSkin&)>& change) {
    return said_of([&](D& d) { change(*d.skin); }, example::with_skin(example::box("b", 3), 4));
  };
  EXPECT_EQ(said([](ModalSkin&) {}), "accepted");
  EXPECT_EQ(said_of([](D&) {}, example::with_skin(example::full_box("b", 3), 4)), "accepted");
  EXPECT_THAT(said([](ModalSkin& s) { s.handles = 0; }), HasSubstr("skin.handles is 0, expected 1 to 255"));
  EXPECT_THAT(said([](ModalSkin& s) { s.modes = 2; }), HasSubstr("skin.modes"));
  EXPECT_THAT(said([](ModalSkin& s) { s.rotations.pop_back(); }), HasSubstr("skin.rotations has 35 entries"));
  EXPECT_THAT(said([](ModalSkin& s) { s.shifts[5] = static_cast<float>(kNan); }), HasSubstr("not finite"));
  EXPECT_THAT(said([](ModalSkin& s) { s.render.pop_back(); }), HasSubstr("skin.render"));
  EXPECT_THAT(said([](ModalSkin& s) { s.collision = s.render; }), HasSubstr("skin.collision"));
  EXPECT_THAT(said([](ModalSkin& s) { s.render[2].handle[1] = 4; }), HasSubstr("skin.render[2] names handle 4"));
  EXPECT_THAT(said([](ModalSkin& s) {
                s.render[2].weight = {0.5f, 0.25f, 0.0f, 0.0f};
              }),
              HasSubstr("has weights of sum 0.75, expected 1"));
  EXPECT_THAT(said([](ModalSkin& s) { s.render[2].weight = {1.5f, -0.5f, 0.0f, 0.0f}; }), HasSubstr("weight"));
  EXPECT_THAT(said([](ModalSkin& s) {
                s.render[2].weight = {0.7f, 0.3f, 0.0f, 0.0f};
              }),
              HasSubstr("multiple of 2^-20"));
  EXPECT_THAT(said([](ModalSkin& s) { s.gauge = {}; }), HasSubstr("skin.gauge"));  // of a free body
}

TEST(SkinInfluences, AreTheFourLargestLessTheFifth) {
  const SkinInfluences at = skin_influences(std::vector<double>{0.1, 0.4, 0.2, 0.05, 0.3, 0.1});
  EXPECT_EQ(at.handle, (std::array<std::uint8_t, 4>{1, 4, 2, 0}));
  EXPECT_NEAR(at.weight[0], 0.5f, 1e-6f);  // (0.4 − 0.1)/0.6
  EXPECT_EQ(at.weight[3], 0.0f);
  EXPECT_EQ(at.weight[0] + at.weight[1] + at.weight[2], 1.0f);
  EXPECT_EQ(skin_influences(std::vector<double>{0.0, 0.0, 3.0}).weight[0], 1.0f);
  EXPECT_EQ(skin_influences(std::vector<double>(6, 1.0)).weight[3], 0.25f);  // alike: the first four
  EXPECT_THROW(skin_influences(std::vector<double>{0.0, -1.0}), InvalidArgument);
  EXPECT_THROW(skin_influences({}), InvalidArgument);
}

TEST(ModalModel, NameIsPrintableText) {
  EXPECT_THAT(said_of([](D& d) { d.name = ""; }), HasSubstr("name is empty"));
  EXPECT_THAT(said_of([](D& d) { d.name = "a\nb"; }), HasSubstr("control character"));
  EXPECT_THAT(said_of([](D& d) { d.name = std::string(201, 'x'); }), HasSubstr("201 bytes, expected at most 200"));
}

TEST(ModalModel, RigidBodyMustBePossible) {
  for (const double wrong : {0.0, -1.0, kNan, kInfinity}) {
    EXPECT_THAT(said_of([&](D& d) { d.mass = wrong; }), HasSubstr("\"b\": mass is"));
    EXPECT_THAT(said_of([&](D& d) { d.volume = wrong; }), HasSubstr("\"b\": volume is"));
  }
  EXPECT_THAT(said_of([](D& d) { d.center_of_mass.y() = kNan; }), HasSubstr("center_of_mass is not finite"));
  EXPECT_THAT(said_of([](D& d) { d.origin_in_input.z() = kInfinity; }), HasSubstr("origin_in_input is not finite"));
  EXPECT_THAT(said_of([](D& d) { d.inertia(0, 1) = kNan; }), HasSubstr("inertia is not finite"));
  EXPECT_THAT(said_of([](D& d) { d.inertia(0, 1) += 1e-6; }), HasSubstr("not symmetric"));
  EXPECT_THAT(said_of([](D& d) { d.inertia = -d.inertia; }), HasSubstr("principal moment"));
  EXPECT_THAT(said_of([](D& d) { d.inertia = Vec3(1.0, 1.0, 2.1).asDiagonal(); }), HasSubstr("sum of the others"));
}

TEST(ModalModel, AFlatPlateIsAtTheLimitOfWhatInertiaAllows) {
  // Zero thickness: I_zz = I_xx + I_yy exactly.
  EXPECT_EQ(said_of([](D& d) { d.inertia = Vec3(1.0, 2.0, 3.0).asDiagonal(); }), "accepted");
}

TEST(ModalModel, OriginIsWhereTheMotionSays) {
  for (const FrameMotion m : {FrameMotion::kFree, FrameMotion::kKinematic})
    EXPECT_THAT(said_of([&](D& d) { d.motion = m; }), HasSubstr("center_of_mass lies"));
  EXPECT_EQ(said_of([](D& d) { d.motion = FrameMotion::kPoint; }), "accepted");
  EXPECT_THAT(said_of([](D& d) { d.line_axis *= 1.001; }), HasSubstr("line_axis has length"));
}

TEST(ModalModel, ModesAreAscendingAndStable) {
  EXPECT_THAT(said_of([](D& d) { std::swap(d.eigenvalues[0], d.eigenvalues[1]); }),
              AllOf(HasSubstr("eigenvalues[1]"), HasSubstr("ascending")));
  EXPECT_THAT(said_of([](D& d) { d.eigenvalues[0] = -1.0; }), HasSubstr("eigenvalues[0] is -1"));
  EXPECT_THAT(said_of([](D& d) { d.eigenvalues[2] = kInfinity; }), HasSubstr("eigenvalues[2] is inf"));
  EXPECT_EQ(said_of([](D& d) { d.eigenvalues[0] = 0.0; }), "accepted");  // a mechanism
  EXPECT_THAT(said_of([](D& d) { d.decays[1] = -0.1; }), HasSubstr("decays[1] is -0.1"));
  EXPECT_THAT(said_of([](D& d) { d.decays.pop_back(); }), HasSubstr("decays has 2 entries, expected 3"));
}

TEST(ModalModel, ScalesOfTheMorphTargetsArePowersOfTwo) {
  EXPECT_EQ(said_of([](D& d) { d.mode_scales = {0.5, 4.0, 1.0}; }), "accepted");
  EXPECT_THAT(said_of([](D& d) {
                d.mode_scales = {0.5, 3.0, 1.0};
              }),
              AllOf(HasSubstr("mode_scales[1] is 3"), HasSubstr("power of two")));
  EXPECT_THAT(said_of([](D& d) { d.mode_scales = {0.5, 1.0, -2.0}; }), HasSubstr("mode_scales[2] is -2"));
  EXPECT_THAT(said_of([](D& d) { d.mode_scales = {0x1p-1074, 1.0, 1.0}; }), HasSubstr("finite reciprocal"));
  EXPECT_THAT(said_of([](D& d) { d.mode_scales = {1.0}; }), HasSubstr("mode_scales has 1 entries, expected 3"));
}

TEST(ModalModel, IntegralsObeyTheBoundsOfNormalisedModes) {
  EXPECT_THAT(said_of([](D& d) { d.participation[1].x() = 1.5; }), HasSubstr("root of the mass, 1.414"));
  EXPECT_THAT(said_of([](D& d) { d.participation[1].x() = kNan; }), HasSubstr("participation[1]"));
  EXPECT_THAT(said_of([](D& d) { d.participation[1].x() = 0.1; }, example::box("b", 3)),
              HasSubstr("0 for a free body"));
  EXPECT_THAT(said_of([](D& d) { d.moments[2](0, 1) = 10.0; }), HasSubstr("moments[2]"));
  EXPECT_THAT(said_of([](D& d) { d.moments[2](0, 1) = kNan; }), HasSubstr("moments[2]"));
  EXPECT_THAT(said_of([](D& d) { d.moments.clear(); }), HasSubstr("moments has 0 entries, expected 3"));
}

TEST(ModalModel, SurfacesAreWhole) {
  EXPECT_THAT(said_of([](D& d) { d.render.triangles.clear(); }), HasSubstr("render.triangles is empty"));
  EXPECT_THAT(said_of([](D& d) { d.render.rest[4].y() = std::numeric_limits<float>::infinity(); }),
              HasSubstr("render.rest[4] is not finite"));
  EXPECT_THAT(said_of([](D& d) { d.render.triangles[5][1] = 54; }),
              HasSubstr("render.triangles[5] names vertex 54, expected 0 to 53"));
  EXPECT_THAT(said_of([](D& d) { d.render.triangles[5][1] = -1; }), HasSubstr("names vertex -1"));
  EXPECT_THAT(said_of([](D& d) { d.render.triangles[5] = {1, 2, 1}; }), HasSubstr("names vertex 1 twice"));
  EXPECT_THAT(said_of([](D& d) { d.render.basis = ModalBasis(53, 3); }),
              HasSubstr("render.basis is for 53 vertices and 3 modes, expected 54 and 3"));
  EXPECT_THAT(said_of([](D& d) {
                d.render.basis.set(53, 2, {0, 0, std::numeric_limits<float>::quiet_NaN()});
              }),
              HasSubstr("render.basis holds a number that is not finite"));
  EXPECT_THAT(said_of([](D& d) { d.collision->triangles[0][0] = 24; }),
              HasSubstr("collision.triangles[0] names vertex 24"));
}

TEST(ModalModel, VolumeIsWhole) {
  EXPECT_THAT(said_of([](D& d) { d.volume_block->tets.clear(); }), HasSubstr("volume_block.tets is empty"));
  EXPECT_THAT(said_of([](D& d) { d.volume_block->rest[2].x() = kNan; }), HasSubstr("volume_block.rest[2]"));
  EXPECT_THAT(said_of([](D& d) { d.volume_block->tets[0][3] = 4; }), HasSubstr("names vertex 4, expected 0 to 3"));
  EXPECT_THAT(said_of([](D& d) { std::swap(d.volume_block->tets[0][0], d.volume_block->tets[0][1]); }),
              HasSubstr("has volume -"));
  EXPECT_THAT(said_of([](D& d) { d.volume_block->mass_times_basis = ModalBasis(4, 2); }),
              HasSubstr("volume_block.mass_times_basis"));
}

TEST(ModalModel, MotionsHaveTheirWords) {
  EXPECT_EQ(to_string(FrameMotion::kFree), "free");
  EXPECT_EQ(to_string(FrameMotion::kPoint), "point");
  EXPECT_EQ(to_string(FrameMotion::kLine), "line");
  EXPECT_EQ(to_string(FrameMotion::kKinematic), "kinematic");
}

}  // namespace
}  // namespace limber
