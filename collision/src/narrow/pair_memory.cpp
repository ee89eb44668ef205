#include "narrow/pair_memory.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tuning.h"

namespace limber::internal {

void PairMemory::keep(std::span<const ListedTests> list) {
  room_.exchange(list_, list.size());
  list_.assign(list.begin(), list.end());
}

PairMemory::Advice PairMemory::advise(const State& now) {
  const PairListTuning& tuning = collision_tuning().lists;
  const double moved = known_ ? farthest_move(now) : std::numeric_limits<double>::infinity();
  if (listed_ && moved + std::max(0.0, now.margin - margin_) <= slack_) return Advice::kLook;
  known_ = true;
  X_AB_ = now.X_AB;
  z_a_.assign(now.z_a.begin(), now.z_a.end());
  z_b_.assign(now.z_b.begin(), now.z_b.end());
  margin_ = now.margin;
  slack_ = tuning.slack * now.margin;
  listed_ = moved <= tuning.when * slack_;
  return listed_ ? Advice::kList : Advice::kSearch;
}

// Of any point of one body against any point of the other.
double PairMemory::farthest_move(const State& now) const {
  double moved = (now.X_AB.p - X_AB_.p).norm(), radius = now.b.rest_radius();
  for (std::size_t i = 0; i < z_a_.size(); ++i)
    moved += std::abs(now.z_a[i] - z_a_[i]) * now.a.largest_shape(static_cast<Index>(i));
  for (std::size_t i = 0; i < z_b_.size(); ++i) {
    const double shape = now.b.largest_shape(static_cast<Index>(i));
    moved += std::abs(now.z_b[i] - z_b_[i]) * shape;
    radius += std::abs(now.z_b[i]) * shape;
  }
  return moved + 2.0 * (now.X_AB.q * X_AB_.q.conjugate()).vector().norm() * radius;
}

}  // namespace limber::internal
