// Who is in the sensors of a world, and who came and went.
#pragma once

#include <span>
#include <tuple>
#include <vector>

#include "body_queries.h"
#include "limber/core/state_archive.h"
#include "limber/engine/world.h"

namespace limber::internal {

class SensorStage {
 public:
  SensorStage(const BodyTable& bodies, BodyQueries& queries) : bodies_(bodies), queries_(queries) {}

  void add(Index sensor);
  void remove(Index sensor);
  /// At a step's end.
  void update();
  std::span<const SensorEvent> events() const { return events_; }
  /// Replaces `bodies`, ascending. @param sensor by BodyId::index
  void list(Index sensor, std::vector<BodyId>& bodies) const;

 private:
  friend struct limber::StateFields;
  /// A body in a sensor. Generations are part of it: a body that takes another's place has come anew.
  struct Overlap {
    BodyId sensor{}, body{};
    template <class Self>
    static auto state_fields(Self& s) {
      return std::tie(s.sensor.index, s.sensor.generation, s.body.index, s.body.generation);
    }
    auto key() const { return std::tie(sensor.index, sensor.generation, body.index, body.generation); }
    friend bool operator<(const Overlap& a, const Overlap& b) { return a.key() < b.key(); }
  };
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.inside_, s.events_);
  }
  void find(Index sensor, std::vector<Overlap>& found);
  void tell(const Overlap& overlap, bool began);

  const BodyTable& bodies_;
  BodyQueries& queries_;
  std::vector<Index> sensors_;   // ascending
  std::vector<Overlap> inside_;  // ascending
  std::vector<Overlap> now_;     // scratch
  std::vector<SensorEvent> events_;
};

}  // namespace limber::internal
