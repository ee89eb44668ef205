/// @file page_joints.h
/// Joints of the page's scene: where they are drawn, and how a person drives them.
#pragma once

#include <array>
#include <limits>
#include <span>
#include <tuple>
#include <vector>

#include "description.h"
#include "joint_loads.h"
#include "limber/engine/world.h"
#include "limber/scene/scene_file.h"

namespace limber::internal {

/// What a person wants of a coordinate. NaN: nothing.
struct CoordinateWish {
  double place = std::numeric_limits<double>::quiet_NaN();  ///< to go to, m or rad
  double speed = std::numeric_limits<double>::quiet_NaN();  ///< to go on at, m/s or rad/s

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.place, s.speed);
  }
};
using JointWishes = std::vector<std::array<CoordinateWish, 3>>;  ///< by joint and coordinate; none: no wish at all

class PageJoints {
 public:
  /// @param joints of the scene, in the world, which stands as at first
  PageJoints(const Scene& scene, const World& world, std::span<const PageBody> bodies, std::span<const JointId> joints);

  /// Per joint: origin and x axis in the world, coordinates (3).
  void frames(const World& world, std::vector<double>& out) const;
  /// Drives a joint as is wished, or leaves it to what the scene has acting on it.
  /// @throws InvalidArgument for a joint or a coordinate that there is not, or numbers that are not finite
  void wish(World& world, JointWishes& wishes, int joint, int coordinate, const CoordinateWish& wish) const;

 private:
  struct Joint {
    JointId id{};
    BodyId on{};  // whose frame origin and axis are in; none: the world
    Vec3 origin = Vec3::Zero(), axis = Vec3::UnitX();
    JointType type = JointType::kFixed;
    std::vector<JointActuation> own{};  // of the scene
    JointLoad load{};
  };
  JointActuation actuation(const Joint& joint, int coordinate, const CoordinateWish& wish) const;

  std::vector<Joint> joints_;
  double gravity_ = 0.0;
};

}  // namespace limber::internal
