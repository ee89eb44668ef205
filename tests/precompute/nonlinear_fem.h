// Bodies bent by loads: statics of nonlinear finite elements (benchmarks/reference).
#pragma once

#include <cmath>

#include "reference_world.h"
#include "skinned_bodies.h"

namespace limber::testing {

/// All nodes, from the body's origin, and the load that holds them there, N.
struct BentByLoad {
  std::vector<Vec3> places;
  double force = 0.0;
};

/// The turn of a set of nodes from where they were, rad.
inline double turn_of(std::span<const Index> nodes, std::span<const Vec3> from, std::span<const Vec3> to) {
  Eigen::Matrix3Xd a(3, nodes.size()), b(3, nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = from[static_cast<std::size_t>(nodes[i])];
    b.col(static_cast<Eigen::Index>(i)) = to[static_cast<std::size_t>(nodes[i])];
  }
  return Eigen::AngleAxisd(Mat3(Eigen::umeyama(a, b, false).block<3, 3>(0, 0))).angle();
}

inline NodeVectors spread_load(const SkinnedBody& b, std::span<const Index> nodes, const Vec3& force) {
  NodeVectors f = NodeVectors::Zero(static_cast<Eigen::Index>(b.mesh.nodes.size()), 3);
  for (const Index v : nodes) f.row(v) = force.transpose() / static_cast<double>(nodes.size());
  return f;
}

inline NodeVectors rows_of(std::span<const Vec3> points) {
  NodeVectors rows(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  return rows;
}

inline std::vector<Vec3> points_of(const NodeVectors& rows) {
  std::vector<Vec3> points;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) points.emplace_back(rows.row(i).transpose());
  return points;
}

/// Nodes under a load that keeps its direction and is raised in steps of 10° of the turn of some, until that is an
/// angle. Empty where that fails. @param nodes loaded @param turning whose turn counts @param direction unit
/// @param small a force that turns them by a few degrees, N
inline std::vector<BentByLoad> bend_by_load(const SkinnedBody& b, std::span<const Index> nodes,
                                            std::span<const Index> turning, const Vec3& direction, double small,
                                            double angle) {
  const NodalElasticity body(b.mesh, kSoft, ElasticLaw::kStVenantKirchhoff, b.fixed);
  std::vector<Vec3> rest;
  for (std::size_t v = 0; v < b.mesh.nodes.size(); ++v) rest.push_back(b.rest(v));
  std::vector<BentByLoad> path{{rest, 0.0}};
  double turned = 0.0, step = small;
  for (int round = 0; round < 80; ++round) {
    const double force = path.back().force + step;
    const NodeVectors loads = spread_load(b, nodes, force * direction);
    BentByLoad next{points_of(equilibrium(body, rows_of(path.back().places), loads)), force};
    const double to = turn_of(turning, rest, next.places);
    if (!std::isfinite(to)) {
      step *= 0.5;
    } else if (std::abs(to - angle) < 1e-3) {
      path.push_back(std::move(next));
      return path;
    } else if (to > angle) {
      step *= (angle - turned) / (to - turned);
    } else {
      const double slope = (to - turned) / step;
      step = std::min(10.0 * kDegree, 1.02 * (angle - to)) / slope;
      path.push_back(std::move(next));
      turned = to;
    }
  }
  return {};
}

}  // namespace limber::testing
