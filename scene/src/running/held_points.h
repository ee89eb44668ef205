/// @file held_points.h
/// The handles of a scene while it is played: taken, led and let go at their times.
#pragma once

#include <string>
#include <vector>

#include "limber/engine/world.h"
#include "limber/scene/scene_file.h"
#include "limber/scene/scene_player.h"

namespace limber::internal {

class HeldPoints {
 public:
  /// @param handle outlives this
  void plan(const SceneHandle& handle, BodyId body, const std::string& name);
  /// When all are planned. Holds that begin after the last step are forgotten.
  void begin(double step, std::int64_t steps);

  /// Before step n: takes hold, lets go, and says where the points are wanted at its end.
  void hold(World& world, std::int64_t n);
  /// After step n.
  void note(const World& world, std::int64_t n);
  const std::vector<HandleReport>& reports() const { return reports_; }

  /// Which handles are held, and from where they are led.
  void save_state(StateWriter& state) const;
  void restore_state(StateReader& state);

 private:
  struct Planned {
    const SceneHandle* handle = nullptr;
    BodyId body{};
    std::int64_t first = 0, end = 0;  // steps
    HandleId id{};
  };
  HandleTarget target(const Planned& planned, const Vec3& taken, std::int64_t n) const;

  double step_ = 0.0;
  std::vector<Planned> planned_;
  std::vector<HandleReport> reports_;  // of the same
};

}  // namespace limber::internal
