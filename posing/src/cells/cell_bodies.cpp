#include "cells/cell_bodies.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

namespace limber::internal {
namespace {

/// How far a point is from a box along axes, per axis and never below 0.
Vec3 outside(const Vec3& p, const Vec3& centre, const Mat3& axes, const Vec3& half) {
  return ((axes.transpose() * (p - centre)).cwiseAbs() - half).cwiseMax(0.0);
}

bool boxes_meet(const Cell& cell, const Mat3& cell_axes, const OrientedBox& box) {
  const Vec3 between = cell.centre - box.frame.origin;
  const auto apart = [&](const Vec3& axis) {
    const double reach = (cell_axes.transpose() * axis).cwiseAbs().dot(cell.half) +
                         (box.frame.axes.transpose() * axis).cwiseAbs().dot(box.half_extents);
    return std::abs(between.dot(axis)) > reach;
  };
  for (int k = 0; k < 3; ++k)
    if (apart(cell_axes.col(k)) || apart(box.frame.axes.col(k))) return false;
  return true;
}

/// How near a cell is to a joint: to its box, then to its middle.
std::pair<double, double> nearness(const Cell& cell, const ModelJoint& joint) {
  const OrientedBox& box = *joint.influence;
  return {outside(cell.centre, box.frame.origin, box.frame.axes, box.half_extents).norm(),
          (cell.centre - box.frame.origin).norm()};
}

Index nearest_cell(const PoseStructure& structure, Index part, const Vec3& p) {
  Index best = -1;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < structure.cells.size(); ++i) {
    const PlacedCell& c = structure.cells[i];
    if (c.part != part) continue;
    const Mat3& axes = structure.grids[static_cast<std::size_t>(c.grid)].axes;
    const double d = outside(p, c.cell.centre, axes, c.cell.half).norm();
    if (d < least) least = d, best = static_cast<Index>(i);
  }
  return best;
}

/// Points of the energy between two bodies, added up.
struct Moments {
  double weight = 0.0;
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();

  /// Adds points with total weight `w` about `mean`, with variances along axes.
  void add(double w, const Vec3& mean, const Mat3& axes, const Vec3& variance) {
    weight += w;
    first += w * mean;
    second += w * (mean * mean.transpose() + axes * variance.asDiagonal() * axes.transpose());
  }
};

using MomentMap = std::map<std::pair<Index, Index>, Moments>;

StrainLink link_of(const PoseStructure& structure, Index a, Index b, const Moments& m) {
  const Vec3 mean = m.first / m.weight;
  const Eigen::SelfAdjointEigenSolver<Mat3> spread(m.second - m.weight * mean * mean.transpose());
  return {.a = a,
          .b = b,
          .weight = m.weight,
          .arm_a = mean - structure.bodies[static_cast<std::size_t>(a)].centre,
          .arm_b = mean - structure.bodies[static_cast<std::size_t>(b)].centre,
          .spread = spread.eigenvectors() * spread.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal()};
}

class Linker {
 public:
  Linker(const JointedModel& model, const std::vector<PartOptions>& options, StrainWeights weights,
         PoseStructure& structure)
      : options_(options), weights_(weights), structure_(structure) {
    for (const ModelJoint& joint : model.joints) cut_.insert(std::minmax(joint.a, joint.b));
  }

  void run() {
    Index base = 0;
    for (const CellGrid& grid : structure_.grids) {
      for (const CellFace& face : grid.faces) add_face(grid, face, base);
      base += static_cast<Index>(grid.cells.size());
    }
    tie_what_is_apart();
    for (const auto& [pair, moments] : moments_)
      structure_.links.push_back(link_of(structure_, pair.first, pair.second, moments));
  }

 private:
  const PlacedCell& cell(Index i) const { return structure_.cells[static_cast<std::size_t>(i)]; }

  /// Harmonic mean: two springs in a row.
  double stiffness(Index part_a, Index part_b) const {
    const double a = options_[static_cast<std::size_t>(part_a)].stiffness,
                 b = options_[static_cast<std::size_t>(part_b)].stiffness;
    return 2.0 * a * b / (a + b);
  }

  void add_face(const CellGrid& grid, const CellFace& face, Index base) {
    const PlacedCell &a = cell(base + face.a), &b = cell(base + face.b);
    if (a.body == b.body || (a.part != b.part && cut_.contains(std::minmax(a.part, b.part)))) return;
    Moments& m = moments_[std::minmax(a.body, b.body)];
    const double k = stiffness(a.part, b.part);
    if (weights_ == StrainWeights::kUnweighted) {  // the 8 corners of either cell
      for (const PlacedCell* c : {&a, &b}) m.add(8.0 * k, c->cell.centre, grid.axes, c->cell.half.cwiseAbs2());
      return;
    }
    Vec3 variance = Vec3::Zero();
    for (int i = 0; i < 2; ++i) {
      const double half = face.half[static_cast<std::size_t>(i)];
      variance[(face.axis + 1 + i) % 3] = half * half / 3.0;
    }
    m.add(k * 4.0 * face.half[0] * face.half[1] / face.distance, face.centre, grid.axes, variance);
  }

  /// Joins sets of cells that no link connects, within each part, over the shortest way.
  void tie_what_is_apart() {
    DisjointSets sets(structure_.bodies.size());
    for (const auto& entry : moments_) sets.join(entry.first.first, entry.first.second);
    std::map<Index, std::vector<Index>> cells_of_part;
    for (std::size_t i = 0; i < structure_.cells.size(); ++i)
      cells_of_part[structure_.cells[i].part].push_back(static_cast<Index>(i));
    for (const auto& [part, cells] : cells_of_part)
      while (tie_nearest(sets, cells)) {
      }
  }

  /// Of the set of the first cell and all others. @return false if there are no others
  bool tie_nearest(DisjointSets& sets, const std::vector<Index>& cells) {
    const Index home = sets.root(cell(cells.front()).body);
    std::vector<Index> near, far;
    for (const Index i : cells) (sets.root(cell(i).body) == home ? near : far).push_back(i);
    if (far.empty()) return false;
    Index best_a = near.front(), best_b = far.front();
    double least = std::numeric_limits<double>::infinity();
    for (const Index a : near)
      for (const Index b : far)
        if (const double d = (cell(a).cell.centre - cell(b).cell.centre).squaredNorm(); d < least)
          least = d, best_a = a, best_b = b;
    const PlacedCell &a = cell(best_a), &b = cell(best_b);
    const double edge = 2.0 * std::min(a.cell.half.minCoeff(), b.cell.half.minCoeff());
    const double w = stiffness(a.part, b.part) * edge * edge / std::sqrt(least);
    moments_[std::minmax(a.body, b.body)].add(w, 0.5 * (a.cell.centre + b.cell.centre), Mat3::Identity(),
                                              Vec3::Constant(edge * edge / 12.0));
    sets.join(a.body, b.body);
    return true;
  }

  const std::vector<PartOptions>& options_;
  StrainWeights weights_;
  PoseStructure& structure_;
  std::set<std::pair<Index, Index>> cut_;  // parts that a joint lies between
  MomentMap moments_;
};

}  // namespace

std::vector<ClaimedCells> claim_cells(const JointedModel& model, const PoseStructure& structure,
                                      const std::vector<PartOptions>& options) {
  std::vector<ClaimedCells> out(model.joints.size());
  const auto deformable = [&](Index part) {
    return options[static_cast<std::size_t>(part)].cells != Subdivision::kRigid;
  };
  for (std::size_t i = 0; i < structure.cells.size(); ++i) {
    const PlacedCell& c = structure.cells[i];
    if (!deformable(c.part)) continue;
    Index nearest = -1;
    for (std::size_t j = 0; j < model.joints.size(); ++j) {
      const ModelJoint& joint = model.joints[j];
      if ((joint.a != c.part && joint.b != c.part) || !joint.influence) continue;
      if (!boxes_meet(c.cell, structure.grids[static_cast<std::size_t>(c.grid)].axes, *joint.influence)) continue;
      if (nearest < 0 || nearness(c.cell, joint) < nearness(c.cell, model.joints[static_cast<std::size_t>(nearest)]))
        nearest = static_cast<Index>(j);
    }
    if (nearest < 0) continue;
    ClaimedCells& claimed = out[static_cast<std::size_t>(nearest)];
    (model.joints[static_cast<std::size_t>(nearest)].a == c.part ? claimed.a : claimed.b)
        .push_back(static_cast<Index>(i));
  }
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const ModelJoint& joint = model.joints[j];
    const Vec3& origin = joint.joint.frame.origin;
    if (out[j].a.empty() && deformable(joint.a)) out[j].a = {nearest_cell(structure, joint.a, origin)};
    if (out[j].b.empty() && deformable(joint.b)) out[j].b = {nearest_cell(structure, joint.b, origin)};
  }
  return out;
}

void link_bodies(const JointedModel& model, const std::vector<PartOptions>& options, StrainWeights weights,
                 PoseStructure& structure) {
  Linker(model, options, weights, structure).run();
}

}  // namespace limber::internal
