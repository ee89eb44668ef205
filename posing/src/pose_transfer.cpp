#include "pose_transfer.h"

#include <Eigen/SVD>
#include <limits>

namespace limber::internal {
namespace {

/// The old cell that each new cell lies in.
std::vector<const PlacedCell*> old_cells(const PoseStructure& from, const PoseStructure& to,
                                         std::span<const Index> was) {
  std::vector<const PlacedCell*> out;
  for (const PlacedCell& c : to.cells)
    out.push_back(&cell_nearest(from, was[static_cast<std::size_t>(c.part)], c.cell.centre));
  return out;
}

/// Sums of a least-squares fit of a rigid motion.
struct Fit {
  double weight = 0.0;
  Vec3 rest = Vec3::Zero(), moved = Vec3::Zero();
  Mat3 product = Mat3::Zero();  // Σ w y xᵀ
  Index only = -1;              // the old body that moves all of it, −2: several

  void add(double w, const Vec3& x, const Vec3& y, Index body) {
    weight += w, rest += w * x, moved += w * y, product += w * y * x.transpose();
    only = only == -1 || only == body ? body : -2;
  }
};

}  // namespace

const PlacedCell& cell_nearest(const PoseStructure& structure, Index part, const Vec3& p) {
  const PlacedCell* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const PlacedCell& c : structure.cells) {
    if (c.part != part) continue;
    const Mat3& axes = structure.grids[static_cast<std::size_t>(c.grid)].axes;
    const double d = ((axes.transpose() * (p - c.cell.centre)).cwiseAbs() - c.cell.half).cwiseMax(0.0).squaredNorm();
    if (d < least) least = d, best = &c;
  }
  return *best;
}

Mat3 nearest_rotation(const Mat3& m) {
  const Eigen::JacobiSVD<Mat3> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vec3 sign(1.0, 1.0, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0);
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

Pose transferred(const PoseStructure& from, const Pose& pose, const PoseStructure& to, std::span<const Index> was) {
  std::vector<Fit> fits(to.bodies.size());
  const auto sources = old_cells(from, to, was);
  for (std::size_t i = 0; i < to.cells.size(); ++i) {
    const PlacedCell& c = to.cells[i];
    const auto old = static_cast<std::size_t>(sources[i]->body);
    const Mat3& axes = to.grids[static_cast<std::size_t>(c.grid)].axes;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3 sign(corner & 1 ? 1.0 : -1.0, corner & 2 ? 1.0 : -1.0, corner & 4 ? 1.0 : -1.0);
      const Vec3 x = c.cell.centre + axes * sign.cwiseProduct(c.cell.half);
      fits[static_cast<std::size_t>(c.body)].add(
          c.cell.half.prod(), x, pose.bodies[old] * Vec3(x - from.bodies[old].centre), static_cast<Index>(old));
    }
  }
  Pose out{rest_poses(to), std::vector<double>(to.joints.size(), 0.0)};
  for (std::size_t b = 0; b < to.bodies.size(); ++b) {
    const Fit& fit = fits[b];
    if (fit.only >= 0) {
      const auto old = static_cast<std::size_t>(fit.only);
      out.bodies[b] = {pose.bodies[old].q, pose.bodies[old] * Vec3(to.bodies[b].centre - from.bodies[old].centre)};
      continue;
    }
    const Mat3 R = nearest_rotation(fit.product - fit.moved * fit.rest.transpose() / fit.weight);
    out.bodies[b] = {normalized(quaternion_from_matrix(R)),
                     fit.moved / fit.weight + R * (to.bodies[b].centre - fit.rest / fit.weight)};
  }
  for (std::size_t j = 0; j < to.joints.size(); ++j)
    for (std::size_t k = 0; k < from.joints.size(); ++k)
      if (from.joints[k].model_joint == to.joints[j].model_joint)
        out.turns[j] = joint_turn(to, to.joints[j], out.bodies, pose.turns[k]);
  return out;
}

}  // namespace limber::internal
