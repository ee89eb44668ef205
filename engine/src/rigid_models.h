// Models of rigid bodies, made once of each shape and mass, so that bodies of one kind are one group.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "limber/collision/rigid_model.h"

namespace limber::internal {

class RigidModels {
 public:
  /// That of a body that has it still, or a new one.
  RigidModel get(const std::shared_ptr<const Shape>& shape, const MassProperties& mass);
  /// The same of a compound.
  RigidModel get(std::span<const ShapePart> parts, const MassProperties& mass);
  // The same of one that is led.
  RigidModel get_kinematic(const std::shared_ptr<const Shape>& shape);
  RigidModel get_kinematic(std::span<const ShapePart> parts);

 private:
  struct Part {
    std::weak_ptr<const Shape> of{};
    RigidTransform pose{};
  };
  struct Made {
    std::vector<Part> parts{};  // as they were given
    MassProperties mass{};      // 0 kg: led
    std::weak_ptr<const ModalModel> model{};
    std::weak_ptr<const Shape> shape{};
  };
  template <class Make>
  RigidModel find_or_make(std::span<const ShapePart> parts, const MassProperties& mass, const Make& make);

  std::vector<Made> made_;
};

}  // namespace limber::internal
