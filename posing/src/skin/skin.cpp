#include "skin/skin.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>

namespace limber::internal {
namespace {

constexpr double kReach = 1.5;  // of a cell's edge: where its weight has fallen to 0

/// Weight of a cell at a point: (1 − r²)², smooth where it ends.
double kernel(const Cell& cell, const Mat3& axes, const Vec3& x) {
  const double r2 = (axes.transpose() * (x - cell.centre)).cwiseQuotient(2.0 * kReach * cell.half).squaredNorm();
  return r2 < 1.0 ? (1.0 - r2) * (1.0 - r2) : 0.0;
}

/// Cells sorted into the boxes of a coarse grid, so that those around a point are found quickly.
class CellFinder {
 public:
  CellFinder(const PoseStructure& structure, Index grid) : structure_(structure) {
    axes_ = structure.grids[static_cast<std::size_t>(grid)].axes;
    for (std::size_t i = 0; i < structure.cells.size(); ++i)
      if (structure.cells[i].grid == grid) reach_ = reach_.cwiseMax(2.0 * kReach * structure.cells[i].cell.half);
    for (std::size_t i = 0; i < structure.cells.size(); ++i)
      if (structure.cells[i].grid == grid) boxes_[box(structure.cells[i].cell.centre)].push_back(static_cast<Index>(i));
  }

  /// All cells with a weight at x, ascending.
  void around(const Vec3& x, std::vector<Index>& out) const {
    out.clear();
    const auto [bx, by, bz] = box(x);
    for (Index i = bx - 1; i <= bx + 1; ++i)
      for (Index j = by - 1; j <= by + 1; ++j)
        for (Index k = bz - 1; k <= bz + 1; ++k)
          if (const auto found = boxes_.find({i, j, k}); found != boxes_.end())
            for (const Index c : found->second)
              if (kernel(structure_.cells[static_cast<std::size_t>(c)].cell, axes_, x) > 0.0) out.push_back(c);
    std::sort(out.begin(), out.end());
  }

 private:
  std::array<Index, 3> box(const Vec3& x) const {
    const Vec3 at = (axes_.transpose() * x).cwiseQuotient(reach_);
    return {static_cast<Index>(std::floor(at[0])), static_cast<Index>(std::floor(at[1])),
            static_cast<Index>(std::floor(at[2]))};
  }

  const PoseStructure& structure_;
  Mat3 axes_;
  Vec3 reach_ = Vec3::Zero();
  std::map<std::array<Index, 3>, std::vector<Index>> boxes_;
};

}  // namespace

Skin::Skin(const JointedModel& model, const PoseStructure& structure) : rest_(model.surface.vertices) {
  std::vector<Index> group_of_vertex(rest_.size(), -1);
  for (std::size_t p = 0; p < model.parts.size(); ++p)
    for (const Index t : model.parts[p].triangles)
      for (const Index v : model.surface.triangles[static_cast<std::size_t>(t)])
        group_of_vertex[static_cast<std::size_t>(v)] = structure.group_of_part[p];
  std::vector<Index> around;
  for (std::size_t g = 0; g < structure.grids.size(); ++g) {
    const CellFinder finder(structure, static_cast<Index>(g));
    const auto only = std::find_if(structure.cells.begin(), structure.cells.end(),
                                   [&](const PlacedCell& c) { return c.grid == static_cast<Index>(g); });
    const bool single = structure.grids[g].cells.size() == 1;
    for (std::size_t v = 0; v < rest_.size(); ++v) {
      if (group_of_vertex[v] != static_cast<Index>(g)) continue;
      if (single)
        around.assign(1, static_cast<Index>(only - structure.cells.begin()));
      else
        finder.around(rest_[v], around);
      blend(structure, around, static_cast<Index>(v), rest_[v]);
    }
  }
}

void Skin::blend(const PoseStructure& structure, const std::vector<Index>& cells, Index vertex, const Vec3& x) {
  const auto placed = [&](Index c) -> const PlacedCell& { return structure.cells[static_cast<std::size_t>(c)]; };
  const Index first = placed(cells.front()).body;
  if (std::all_of(cells.begin(), cells.end(), [&](Index c) { return placed(c).body == first; })) {
    carried_.push_back({vertex, first, x - structure.bodies[static_cast<std::size_t>(first)].centre});
    return;
  }
  // The eight corners of a cell have the mean s = c − x and the second moment s sᵀ + axes diag(half²) axesᵀ.
  const Mat3& axes = structure.grids[static_cast<std::size_t>(placed(cells.front()).grid)].axes;
  Eigen::Matrix4d M = Eigen::Matrix4d::Zero();
  std::vector<double> weight;
  for (const Index c : cells) {
    const Cell& cell = placed(c).cell;
    const double w = kernel(cell, axes, x);
    const Vec3 s = cell.centre - x;
    weight.push_back(w);
    M(0, 0) += w;
    M.topRightCorner<1, 3>() += w * s.transpose();
    M.bottomRightCorner<3, 3>() +=
        w * (s * s.transpose() + axes * cell.half.cwiseAbs2().asDiagonal() * axes.transpose());
  }
  M.bottomLeftCorner<3, 1>() = M.topRightCorner<1, 3>().transpose();
  const Eigen::Vector4d m = M.ldlt().solve(Eigen::Vector4d::Unit(0));
  const Vec3 slope = m.tail<3>();
  std::map<Index, Eigen::Vector4d> by_body;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const PlacedCell& p = placed(cells[i]);
    const Vec3 s = p.cell.centre - x;
    const double sum = weight[i] * (m[0] + slope.dot(s));
    const Vec3 second = sum * s + weight[i] * (axes * p.cell.half.cwiseAbs2().asDiagonal() * axes.transpose() *
                                               slope);  // Σ φ (x_i − x)
    auto [entry, fresh] = by_body.try_emplace(p.body, Eigen::Vector4d::Zero());
    entry->second.head<3>() += second + sum * (x - structure.bodies[static_cast<std::size_t>(p.body)].centre);
    entry->second[3] += sum;
  }
  blended_.push_back(vertex);
  for (const auto& [body, f] : by_body) {
    bodies_.push_back(body);
    factors_.push_back(
        {static_cast<float>(f[0]), static_cast<float>(f[1]), static_cast<float>(f[2]), static_cast<float>(f[3])});
  }
  first_.push_back(static_cast<Index>(bodies_.size()));
}

void Skin::positions(std::span<const BodyMap> maps, std::span<Vec3> positions) const {
  std::copy(rest_.begin(), rest_.end(), positions.begin());
  for (const Carried& c : carried_) {
    const BodyMap& map = maps[static_cast<std::size_t>(c.body)];
    positions[static_cast<std::size_t>(c.vertex)] = map.A * c.arm + map.p;
  }
  if (blended_.empty()) return;
  // Columns of A and p about the middle of the bodies, in floats of four: what is lost is 1e-7 of the model's size.
  Vec3 middle = Vec3::Zero();
  for (const BodyMap& map : maps) middle += map.p / static_cast<double>(maps.size());
  using Float4 = Eigen::Array4f;
  std::vector<std::array<Float4, 4>, Eigen::aligned_allocator<std::array<Float4, 4>>> columns(maps.size());
  for (std::size_t b = 0; b < maps.size(); ++b)
    for (int k = 0; k < 4; ++k)
      columns[b][static_cast<std::size_t>(k)]
          << (k < 3 ? Vec3(maps[b].A.col(k)) : Vec3(maps[b].p - middle)).cast<float>(),
          0.0f;
  for (std::size_t i = 0; i < blended_.size(); ++i) {
    Float4 sum = Float4::Zero();
    for (Index e = first_[i]; e < first_[i + 1]; ++e) {
      const auto& c = columns[static_cast<std::size_t>(bodies_[static_cast<std::size_t>(e)])];
      const auto& f = factors_[static_cast<std::size_t>(e)];
      sum += f[0] * c[0] + f[1] * c[1] + f[2] * c[2] + f[3] * c[3];
    }
    positions[static_cast<std::size_t>(blended_[i])] = middle + sum.head<3>().matrix().cast<double>();
  }
}

void vertex_normals(std::span<const Vec3> positions, std::span<const Triangle> triangles, std::span<Vec3> normals) {
  std::fill(normals.begin(), normals.end(), Vec3::Zero());
  for (const auto& [i, j, k] : triangles) {
    const Vec3& p = positions[static_cast<std::size_t>(i)];
    const Vec3 area = (positions[static_cast<std::size_t>(j)] - p).cross(positions[static_cast<std::size_t>(k)] - p);
    for (const Index v : {i, j, k}) normals[static_cast<std::size_t>(v)] += area;
  }
  for (Vec3& n : normals) {
    const double length = n.norm();
    n = length > 0.0 ? Vec3(n / length) : Vec3::UnitZ();
  }
}

}  // namespace limber::internal
