// The index that a world's queries ask, brought to where its bodies are when a question comes.
#pragma once

#include <vector>

#include "body_table.h"
#include "limber/collision/spatial_index.h"
#include "limber/engine/world.h"

namespace limber::internal {

class BodyQueries {
 public:
  explicit BodyQueries(const BodyTable& bodies) : bodies_(bodies) {}

  /// To be told of bodies that came, went, moved or bent.
  void tell_changed() { changed_ = true; }

  SpatialIndex& index();
  SpatialIndex::Filter filter(const BodyFilter& filter) const;
  BodyHit told(const SpatialIndex::Hit& hit) const;
  /// Bodies that a shape touches, to `found`, ascending.
  void find_overlaps(const Shape& shape, const RigidTransform& pose, const SpatialIndex::Filter& filter);

  std::vector<SpatialIndex::Hit> hits;  ///< scratch
  std::vector<Index> found;             ///< scratch

 private:
  /// What the index has of a body. It keeps both alive, so that their addresses are nobody else's.
  struct Shown {
    const Shape* shape = nullptr;
    const ModalModel* model = nullptr;
    std::uint32_t layers = 0;
    bool skinned = false;
    friend bool operator==(const Shown&, const Shown&) = default;
    bool any() const { return shape != nullptr || model != nullptr; }
  };
  Shown shown_of(const BodyTable::Entry& e) const;
  void show(Index entry);

  const BodyTable& bodies_;
  SpatialIndex index_;
  std::vector<Shown> shown_;
  bool changed_ = true;
};

}  // namespace limber::internal
