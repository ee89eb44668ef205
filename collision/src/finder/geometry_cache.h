// What is made ready once of each model and shape, and shared by the bodies that have it.
#pragma once

#include <memory>
#include <optional>
#include <unordered_map>

#include "limber/collision/collision_surface.h"
#include "limber/collision/narrow_phase.h"

namespace limber::internal {

struct ModalGeometry {
  ModalGeometry(const std::shared_ptr<const ModalModel>& model, bool skin)
      : surface(std::make_shared<const CollisionSurface>(model, CollisionSurfaceOptions{.skin = skin})) {
    if (model->data().volume_block) volume.emplace(model);
  }
  std::shared_ptr<const CollisionSurface> surface;
  std::optional<RestVolume> volume;
};

/// What is made once of each key, and lives as long as someone has it. A value keeps its key alive, so that its address
/// is not another's.
template <class Key, class Value>
class SharedByKey {
 public:
  template <class Make>
  std::shared_ptr<const Value> get(const Key* key, const Make& make) {
    if (const auto known = map_.find(key); known != map_.end())
      if (auto value = known->second.lock()) return value;
    std::shared_ptr<const Value> value = make();
    std::erase_if(map_, [](const auto& entry) { return entry.second.expired(); });
    map_[key] = value;
    return value;
  }

 private:
  std::unordered_map<const Key*, std::weak_ptr<const Value>> map_;
};

class GeometryCache {
 public:
  std::shared_ptr<const ModalGeometry> get(const std::shared_ptr<const ModalModel>& model, bool skin) {
    return (skin ? skinned_ : modal_).get(model.get(), [&] {
      return std::make_shared<const ModalGeometry>(model, skin);
    });
  }
  std::shared_ptr<const RigidGeometry> get(const std::shared_ptr<const Shape>& shape) {
    struct Entry {
      explicit Entry(std::shared_ptr<const Shape> s) : shape(std::move(s)), geometry(*shape) {}
      std::shared_ptr<const Shape> shape;
      RigidGeometry geometry;
    };
    return rigid_.get(shape.get(), [&] {
      auto entry = std::make_shared<const Entry>(shape);
      return std::shared_ptr<const RigidGeometry>(entry, &entry->geometry);
    });
  }

 private:
  SharedByKey<ModalModel, ModalGeometry> modal_, skinned_;
  SharedByKey<Shape, RigidGeometry> rigid_;
};

}  // namespace limber::internal
