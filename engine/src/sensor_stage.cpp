#include "sensor_stage.h"

#include <algorithm>

namespace limber::internal {

void SensorStage::add(Index sensor) { sensors_.insert(std::ranges::lower_bound(sensors_, sensor), sensor); }

void SensorStage::remove(Index sensor) {
  std::erase(sensors_, sensor);
  std::erase_if(inside_, [&](const Overlap& o) { return static_cast<Index>(o.sensor.index) == sensor; });
}

void SensorStage::find(Index sensor, std::vector<Overlap>& found) {
  const BodyTable::Entry& e = bodies_[sensor];
  queries_.find_overlaps(*e.shape, e.pose, {.mask = e.filter.mask});
  for (const Index body : queries_.found)
    if ((bodies_[body].filter.mask & e.filter.layers) != 0) found.push_back({bodies_.id(sensor), bodies_.id(body)});
}

void SensorStage::tell(const Overlap& overlap, bool began) {
  const auto data = [&](BodyId id) {
    return bodies_.contains(id) ? bodies_[static_cast<Index>(id.index)].user_data : std::uint64_t{0};
  };
  events_.push_back({overlap.sensor, overlap.body, began, data(overlap.sensor), data(overlap.body)});
}

void SensorStage::update() {
  events_.clear();
  if (sensors_.empty()) return;
  now_.clear();
  for (const Index sensor : sensors_) find(sensor, now_);
  // Both lists ascend: what is in one of them alone has begun or ended.
  auto before = inside_.begin();
  auto now = now_.begin();
  while (before != inside_.end() || now != now_.end()) {
    if (now == now_.end() || (before != inside_.end() && *before < *now)) {
      tell(*before++, false);
    } else if (before == inside_.end() || *now < *before) {
      tell(*now++, true);
    } else {
      ++before, ++now;
    }
  }
  std::swap(inside_, now_);
}

void SensorStage::list(Index sensor, std::vector<BodyId>& bodies) const {
  bodies.clear();
  for (const Overlap& o : inside_)
    if (static_cast<Index>(o.sensor.index) == sensor) bodies.push_back(o.body);
}

}  // namespace limber::internal
