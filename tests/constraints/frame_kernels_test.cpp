#include "game/frame_kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <vector>

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

}  // namespace
}  // namespace limber::internal
