// What a World needs of a modal skin beside the bodies that have it.
#pragma once

#include <vector>

#include "limber/dynamics/body_shape.h"
#include "limber/dynamics/exact_motion.h"
#include "limber/dynamics/skin_extent.h"
#include "limber/dynamics/skin_tiles.h"

namespace limber::internal {

/// Of one model. One thread at a time.
class GroupSkin {
 public:
  /// @pre the model has a skin, and outlives this
  explicit GroupSkin(const ModalModel& model)
      : tiles_(model.data().skin->render),
        extent_(model),
        change_(static_cast<std::size_t>(model.modes())),
        shape_(change_.size()),
        scratch_(3 * change_.size()) {}

  const SkinTiles& tiles() const { return tiles_; }

  /// BodyState::reach of a body: how far any of its points may come within its motion beside a displacement, m.
  double reach(const BodyShape& now, const ExactMotion& motion, const Vec3& displacement) {
    motion.changes(change_);
    const double far = extent_.find(now.differentiated(), now.amplitudes(), change_, shape_, scratch_);
    return motion.path().travel_beside(displacement) + motion.sway(far, shape_);
  }

 private:
  SkinTiles tiles_;
  SkinExtent extent_;
  std::vector<double> change_, shape_, scratch_;
};

}  // namespace limber::internal
