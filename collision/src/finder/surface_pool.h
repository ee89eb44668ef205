// The deformed surfaces that one thread has at hand.
#pragma once

#include <array>
#include <cstdint>

#include "limber/collision/deformed_surface.h"

namespace limber::internal {

/// Bodies are bound when a pair needs them and kept while others do, as one body is in several pairs. Bounded, as a
/// surface's scratch is as large as the surface: the one not used for longest makes room.
class SurfacePool {
 public:
  /// Forgets all states.
  void start_query() { ++query_; }

  /// The surface of a body in the query's state; the last four that were asked for stay. A body finds the room that it
  /// had in earlier queries, so that nothing grows once all bodies were asked for.
  DeformedSurface& get(Index body, const std::shared_ptr<const CollisionSurface>& surface, std::span<const double> z) {
    Slot* place = slots_.data();
    for (Slot& slot : slots_) {
      if (slot.body == body) {
        place = &slot;
        break;
      }
      if (slot.used < place->used) place = &slot;
    }
    if (place->body == body && place->query == query_) return place->use(++clock_);
    place->surface.bind(surface, z);
    place->body = body;
    place->query = query_;
    return place->use(++clock_);
  }

 private:
  struct Slot {
    DeformedSurface surface;
    Index body = -1;
    std::uint64_t query = 0, used = 0;
    DeformedSurface& use(std::uint64_t now) {
      used = now;
      return surface;
    }
  };
  static constexpr std::size_t kSlots = 32;
  std::array<Slot, kSlots> slots_;
  std::uint64_t query_ = 0, clock_ = 0;
};

}  // namespace limber::internal
