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

/// Lives as long as a body has it.
class GeometryCache {
 public:
  std::shared_ptr<const ModalGeometry> get(const std::shared_ptr<const ModalModel>& model, bool skin) {
    return find(skin ? skinned_ : modal_, model.get(),
                [&] { return std::make_shared<const ModalGeometry>(model, skin); });
  }
  /// The entry keeps the shape alive, so that its address is not another's.
  std::shared_ptr<const RigidGeometry> get(const std::shared_ptr<const Shape>& shape) {
    struct Entry {
      explicit Entry(std::shared_ptr<const Shape> s) : shape(std::move(s)), geometry(*shape) {}
      std::shared_ptr<const Shape> shape;
      RigidGeometry geometry;
    };
    return find(rigid_, shape.get(), [&] {
      auto entry = std::make_shared<const Entry>(shape);
      return std::shared_ptr<const RigidGeometry>(entry, &entry->geometry);
    });
  }

 private:
  template <class Key, class Value, class Make>
  static std::shared_ptr<const Value> find(std::unordered_map<const Key*, std::weak_ptr<const Value>>& map,
                                           const Key* key, const Make& make) {
    if (const auto known = map.find(key); known != map.end())
      if (auto value = known->second.lock()) return value;
    std::shared_ptr<const Value> value = make();
    std::erase_if(map, [](const auto& entry) { return entry.second.expired(); });
    map[key] = value;
    return value;
  }

  std::unordered_map<const ModalModel*, std::weak_ptr<const ModalGeometry>> modal_, skinned_;
  std::unordered_map<const Shape*, std::weak_ptr<const RigidGeometry>> rigid_;
};

}  // namespace limber::internal
