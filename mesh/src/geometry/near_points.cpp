#include "geometry/near_points.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <utility>

namespace limber::internal {
namespace {

using Cell = std::array<double, 3>;  // whole numbers; doubles, so that no cell is out of range

struct CellHash {
  std::size_t operator()(const Cell& cell) const {
    std::uint64_t h = 0;
    for (const double c : cell)
      h = (h ^ std::bit_cast<std::uint64_t>(c) ^ (h >> 29)) * 0x9e3779b97f4a7c15u;  // 2⁶⁴ over the golden ratio
    return static_cast<std::size_t>(h ^ (h >> 32));
  }
};

/// Points by cells that are as wide as the tolerance, so that those near a point are in the 27 cells around it.
class PointGrid {
 public:
  PointGrid(std::span<const Vec3> points, double tolerance) : points_(points), width_(tolerance) {
    first_in_.reserve(points.size());
    next_.assign(points.size(), -1);
  }

  /// −1 where none is near.
  Index nearest(const Vec3& p) const {
    Index best = -1;
    double distance = width_ * width_;
    const Cell here = cell_of(p);
    const int reach = width_ > 0.0 ? 1 : 0;
    for (int x = -reach; x <= reach; ++x)
      for (int y = -reach; y <= reach; ++y)
        for (int z = -reach; z <= reach; ++z)
          for (Index i = first({here[0] + x, here[1] + y, here[2] + z}); i >= 0; i = next_[i]) {
            const double squared = (points_[i] - p).squaredNorm();
            if (squared > distance || (squared == distance && best >= 0 && i > best)) continue;
            best = i;
            distance = squared;
          }
    return best;
  }

  void add(Index i) {
    const auto [entry, is_new] = first_in_.try_emplace(cell_of(points_[i]), i);
    if (!is_new) next_[i] = std::exchange(entry->second, i);
  }

 private:
  /// −0 is 0.
  Cell cell_of(const Vec3& p) const {
    if (width_ == 0.0) return {p.x() + 0.0, p.y() + 0.0, p.z() + 0.0};
    return {std::floor(p.x() / width_) + 0.0, std::floor(p.y() / width_) + 0.0, std::floor(p.z() / width_) + 0.0};
  }
  Index first(Cell cell) const {
    for (double& c : cell) c += 0.0;  // −1 + 1
    const auto found = first_in_.find(cell);
    return found == first_in_.end() ? -1 : found->second;
  }

  std::span<const Vec3> points_;
  double width_;
  std::unordered_map<Cell, Index, CellHash> first_in_;
  std::vector<Index> next_;  // per point, the next one in its cell
};

}  // namespace

std::vector<Index> representatives(std::span<const Vec3> points, double tolerance) {
  PointGrid grid(points, tolerance);
  std::vector<Index> of;
  of.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Index near = grid.nearest(points[i]);
    of.push_back(near >= 0 ? near : static_cast<Index>(i));
    if (near < 0) grid.add(static_cast<Index>(i));
  }
  return of;
}

}  // namespace limber::internal
