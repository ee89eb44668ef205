#include "game/frame_kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <vector>

#include "instruction_sets.h"
#include "limber/core/types.h"

namespace limber::internal {
namespace {

/// Frames that turn by themselves, one by each angle about one axis, in a substep of a second.
std::vector<Eigen::Quaterniond> turned_by(const std::array<double, kFramesAtOnce>& angles, const Vec3& axis) {
  EightFrames frames;
  std::vector<Block8> free(kFramesAtOnce), motion(kFramesAtOnce), answers(kFramesAtOnce), pushes(kFramesAtOnce);
  std::vector<FrameShift> shifts(kFramesAtOnce);
  for (std::size_t l = 0; l < kFramesAtOnce; ++l) {
    frames.first[l] = static_cast<std::int32_t>(l);
    frames.turns_axes.v[l] = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      frames.turn_scale[i][i].v[l] = 1.0;
      frames.now.free_turn[i].v[l] = angles[l] * axis[static_cast<Eigen::Index>(i)];
    }
  }
  end_frames({&frames, 1, shifts.data(), pushes.data(), free.data(), motion.data(), answers.data(), 1.0}, false);
  std::vector<Eigen::Quaterniond> out;
  const auto& q = frames.now.attitude;
  for (std::size_t l = 0; l < kFramesAtOnce; ++l) out.emplace_back(q[0].v[l], q[1].v[l], q[2].v[l], q[3].v[l]);
  return out;
}

/// Round-off of the angle itself is all that grows with it: a step of an hour turns a wheel by millions of radians.
TEST(FrameKernels, FramesTurnByAnyAngleAsRotationVectorsSay) {
  const std::array<double, kFramesAtOnce> angles{0.0, 1e-9, 0.3, 3.1, 6.4, 125.0, 4.5e4, 3e7};
  const Vec3 axis = Vec3(2.0, -3.0, 6.0) / 7.0;
  const std::vector<Eigen::Quaterniond> turned = turned_by(angles, axis);
  for (std::size_t l = 0; l < kFramesAtOnce; ++l) {
    const Eigen::Quaterniond expected(Eigen::AngleAxisd(angles[l], axis));
    EXPECT_NEAR(turned[l].norm(), 1.0, 1e-15);
    const double error =
        std::min((turned[l].coeffs() - expected.coeffs()).norm(), (turned[l].coeffs() + expected.coeffs()).norm());
    EXPECT_LT(error, 1e-15 + 4e-16 * angles[l]) << angles[l];
  }
}

TEST(FrameKernels, NoAngleIsTooLargeForAnAttitude) {
  const std::vector<Eigen::Quaterniond> turned =
      turned_by({1e12, 1e20, 1e40, 1e80, 1e120, 1e150, -1e9, -1e30}, Vec3::UnitY());
  for (const Eigen::Quaterniond& q : turned) EXPECT_NEAR(q.norm(), 1.0, 1e-15);
}

/// Of tumbling frames that are pushed about, after a substep: all that the loops have written.
std::vector<double> after_a_substep() {
  constexpr double kLength = 0.1;
  EightFrames frames;
  std::vector<Block8> free(kFramesAtOnce), motion(kFramesAtOnce), answers(kFramesAtOnce), pushes(kFramesAtOnce);
  std::vector<FrameShift> shifts(kFramesAtOnce);
  for (std::size_t l = 0; l < kFramesAtOnce; ++l) {
    const double of = 1.0 + static_cast<double>(l);
    frames.first[l] = static_cast<std::int32_t>(l);
    frames.root_mass.v[l] = of, frames.per_root.v[l] = 1.0 / of;
    for (std::size_t i = 0; i < 3; ++i) {
      const double root = of + 0.3 * static_cast<double>(i);
      frames.principal[i][i].v[l] = frames.momentum[i][i].v[l] = 1.0;
      frames.roots[i].v[l] = root, frames.per_turn[i].v[l] = 1.0 / root;
      frames.now.turn[i].v[l] = of * (0.5 + static_cast<double>(i));
      frames.now.way[i].v[l] = 0.01 * of;
    }
  }
  const FrameArrays all{&frames, 1, shifts.data(), pushes.data(), free.data(), motion.data(), answers.data(), kLength};
  turn_frames(all, kLength);
  begin_frames(all);
  for (Block8& y : motion)
    for (float& x : y.v) x += 0.25f;
  end_frames(all, false);
  place_frames(all, true);
  std::vector<double> out;
  const auto add = [&](const auto& fields) {
    for (const Double8& field : fields) out.insert(out.end(), field.v, field.v + kFramesAtOnce);
  };
  add(frames.now.shift), add(frames.now.attitude), add(frames.now.v), add(frames.now.turn);
  for (const auto& row : frames.turn_scale) add(row);
  return out;
}

TEST(FrameKernels, BitsAreTheSameWithFusedMultiplyAdd) {
  std::vector<double> expected;
  for_each_instruction_set([&](std::int64_t target) {
    if (!has_fused_multiply_add(target)) return;
    const std::vector<double> out = after_a_substep();
    if (expected.empty()) expected = out;
    EXPECT_TRUE(out == expected);
  });
}

}  // namespace
}  // namespace limber::internal
