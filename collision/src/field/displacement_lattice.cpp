#include "field/displacement_lattice.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "limber/mesh/surface_locator.h"
#include "tuning.h"

namespace limber::internal {
namespace {

using Node = std::array<Index, 3>;
using Triplets = std::vector<Eigen::Triplet<double>>;

Aabb grown_by_part(const Aabb& box, double part) { return box.grown(part * (box.high - box.low).maxCoeff()); }

template <class Visit>
void for_each_node(const RegularGrid& grid, const Visit& visit) {
  Node n;
  for (n[0] = 0; n[0] < grid.count()[0]; ++n[0])
    for (n[1] = 0; n[1] < grid.count()[1]; ++n[1])
      for (n[2] = 0; n[2] < grid.count()[2]; ++n[2]) visit(n);
}

// The node so many steps on along an axis, if the grid has it.
bool step_on(const RegularGrid& grid, const Node& from, std::size_t axis, Index steps, Node& to) {
  to = from;
  to[axis] += steps;
  return to[axis] >= 0 && to[axis] < grid.count()[axis];
}

}  // namespace

DisplacementLattice::DisplacementLattice(const CollisionSurface& surface)
    : grid_(grown_by_part(surface.rest_bounds(), collision_tuning().field.lattice_beyond),
            collision_tuning().field.lattice_cells, collision_tuning().field.least_lattice_cells) {
  choose_nodes(surface);
  fit(surface);
}

// Nodes of cells that the surface goes through have equations; from these values spread outwards, cell by cell.
void DisplacementLattice::choose_nodes(const CollisionSurface& surface) {
  const SurfaceLocator locator = locator_of(surface);
  const double near = grid_.cell().norm() * (1.0 + 1e-9);
  place_.assign(grid_.nodes(), -1);
  own_.assign(grid_.nodes(), false);
  for_each_node(grid_, [&](const Node& n) {
    if (locator.nearest(grid_.position(n)).distance > near) return;
    own_[grid_.number(n)] = true;
    place_[grid_.number(n)] = nodes_++;
  });
  for (bool open = true; open;) {
    open = false;
    std::vector<std::int32_t> next = place_;
    for_each_node(grid_, [&](const Node& n) {
      if (place_[grid_.number(n)] >= 0) return;
      open = true;
      Node beside;
      for (std::size_t axis = 0; axis < 3; ++axis)
        for (const Index step : {-1, 1})
          if (step_on(grid_, n, axis, step, beside) && place_[grid_.number(beside)] >= 0)
            next[grid_.number(n)] = place_[grid_.number(beside)];
    });
    place_.swap(next);
  }
}

void DisplacementLattice::fit(const CollisionSurface& surface) {
  const GridView g = grid_.view();
  Triplets weights, smoothness;
  std::vector<Index> used;
  for (Index v = 0; v < surface.vertices(); ++v) {
    if (surface.vertex_triangles(v).empty()) continue;
    Node base;
    Vec3 part;
    for (int axis = 0; axis < 3; ++axis) {
      const double along = std::clamp(
          (surface.rest(v)[axis] - static_cast<double>(g.origin[axis])) * static_cast<double>(g.inverse[axis]), 0.0,
          static_cast<double>(g.last[axis]));
      base[static_cast<std::size_t>(axis)] = static_cast<Index>(along);
      part[axis] = along - std::floor(along);
    }
    for (Index corner = 0; corner < 8; ++corner) {
      const std::array<Index, 3> bit{corner >> 2 & 1, corner >> 1 & 1, corner & 1};
      double weight = 1.0;
      for (int axis = 0; axis < 3; ++axis)
        weight *= bit[static_cast<std::size_t>(axis)] == 1 ? part[axis] : 1.0 - part[axis];
      const Node n{base[0] + bit[0], base[1] + bit[1], base[2] + bit[2]};
      weights.emplace_back(static_cast<Index>(used.size()), place_[grid_.number(n)], weight);
    }
    used.push_back(v);
  }
  Index equations = 0;
  const auto own = [&](const Node& n) { return own_[grid_.number(n)]; };
  for_each_node(grid_, [&](const Node& n) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Node one, two;
      if (!own(n) || !step_on(grid_, n, axis, 1, one) || !own(one)) continue;
      constexpr double kFirst = 1e-3, kSecond = 0.0316;  // roots of the weights in the header
      const auto place = [&](const Node& of) { return place_[grid_.number(of)]; };
      smoothness.emplace_back(equations, place(n), kFirst), smoothness.emplace_back(equations++, place(one), -kFirst);
      if (!step_on(grid_, n, axis, 2, two) || !own(two)) continue;
      smoothness.emplace_back(equations, place(n), kSecond),
          smoothness.emplace_back(equations, place(one), -2 * kSecond);
      smoothness.emplace_back(equations++, place(two), kSecond);
    }
  });
  Eigen::SparseMatrix<double> A(static_cast<Index>(used.size()), nodes_), D(equations, nodes_);
  A.setFromTriplets(weights.begin(), weights.end());
  D.setFromTriplets(smoothness.begin(), smoothness.end());
  Eigen::SparseMatrix<double> normal = A.transpose() * A;
  normal += Eigen::SparseMatrix<double>(D.transpose() * D);
  // A node that stands alone and no vertex reads has no equation.
  for (Index n = 0; n < nodes_; ++n) normal.coeffRef(n, n) += 1e-12;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(normal);
  rows_.resize(3 * nodes_, surface.modes());
  Eigen::MatrixXd u(static_cast<Index>(used.size()), 3);
  for (Index m = 0; m < surface.modes(); ++m) {
    for (std::size_t i = 0; i < used.size(); ++i)
      for (int axis = 0; axis < 3; ++axis)
        u(static_cast<Index>(i), axis) = static_cast<double>(surface.row(used[i], axis)[m]);
    const Eigen::MatrixXd x = factor.solve(A.transpose() * u);
    const double largest = u.rowwise().norm().maxCoeff();
    if (largest > 0.0) largest_error_ = std::max(largest_error_, (A * x - u).rowwise().norm().maxCoeff() / largest);
    for (Index n = 0; n < nodes_; ++n) rows_.block(3 * n, m, 3, 1) = x.row(n).transpose().cast<float>();
  }
}

}  // namespace limber::internal
