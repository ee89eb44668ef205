// Nonlinear statics of linear tetrahedra: total Lagrangian, St. Venant–Kirchhoff, Newton with a line search. Shares
// nothing with the library but the mesh and the material.
#pragma once

#include <Eigen/SparseCholesky>
#include <cmath>

#include "skinned_bodies.h"

namespace limber::testing {

class NonlinearBody {
 public:
  NonlinearBody(const TetMesh& mesh, const Material& material, std::span<const Index> fixed)
      : mesh_(mesh), lambda_(material.lame_lambda()), mu_(material.shear_modulus()), place_(mesh.nodes.size(), 0) {
    for (const Tet& t : mesh.tets) gradients_.push_back(shape_gradients(mesh, t));
    for (std::size_t e = 0; e < mesh.tets.size(); ++e) volumes_.push_back(signed_volume(mesh, static_cast<Index>(e)));
    for (const Index v : fixed) place_[static_cast<std::size_t>(v)] = -1;
    for (int& p : place_)
      if (p == 0) p = free_++;
  }

  /// Places of all nodes where forces f on them are balanced, found from x on. NaN where Newton's method gives up.
  std::vector<Vec3> equilibrium(std::vector<Vec3> x, std::span<const Vec3> f) const {
    for (int round = 0; round < 60; ++round) {
      Eigen::SparseMatrix<double> K;
      Eigen::VectorXd r;
      assemble(x, f, K, r);
      if (r.norm() <= 1e-6 * norm(f)) return x;
      const Eigen::VectorXd d = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(K).solve(r);
      const double before = potential(x, f);
      double step = 1.0;
      std::vector<Vec3> next = moved(x, d, step);
      while (step > 1e-4 && !(potential(next, f) <= before + 1e-9 * std::abs(before)))
        step *= 0.5, next = moved(x, d, step);
      x = std::move(next);
    }
    return std::vector<Vec3>(x.size(), Vec3::Constant(std::nan("")));
  }

 private:
  static double norm(std::span<const Vec3> f) {
    double sum = 0.0;
    for (const Vec3& v : f) sum += v.squaredNorm();
    return std::sqrt(sum);
  }
  Mat3 deformation(const std::vector<Vec3>& x, std::size_t e) const {
    Mat3 F = Mat3::Zero();
    for (std::size_t a = 0; a < 4; ++a)
      F += x[static_cast<std::size_t>(mesh_.tets[e][a])] * gradients_[e][a].transpose();
    return F;
  }
  double potential(const std::vector<Vec3>& x, std::span<const Vec3> f) const {
    double sum = 0.0;
    for (std::size_t e = 0; e < volumes_.size(); ++e) {
      const Mat3 F = deformation(x, e), E = 0.5 * (F.transpose() * F - Mat3::Identity());
      sum += volumes_[e] * (0.5 * lambda_ * E.trace() * E.trace() + mu_ * E.squaredNorm());
    }
    for (std::size_t v = 0; v < x.size(); ++v) sum -= f[v].dot(x[v]);
    return sum;
  }
  std::vector<Vec3> moved(std::vector<Vec3> x, const Eigen::VectorXd& d, double step) const {
    for (std::size_t v = 0; v < x.size(); ++v)
      if (place_[v] >= 0) x[v] += step * d.segment<3>(3 * place_[v]);
    return x;
  }
  void assemble(const std::vector<Vec3>& x, std::span<const Vec3> f, Eigen::SparseMatrix<double>& K,
                Eigen::VectorXd& r) const {
    std::vector<Eigen::Triplet<double>> entries;
    r = Eigen::VectorXd::Zero(3 * free_);
    for (std::size_t v = 0; v < x.size(); ++v)
      if (place_[v] >= 0) r.segment<3>(3 * place_[v]) += f[v];
    for (std::size_t e = 0; e < volumes_.size(); ++e) {
      const Mat3 F = deformation(x, e), E = 0.5 * (F.transpose() * F - Mat3::Identity());
      const Mat3 S = lambda_ * E.trace() * Mat3::Identity() + 2.0 * mu_ * E, B = F * F.transpose();
      for (std::size_t a = 0; a < 4; ++a) {
        const int row = place_[static_cast<std::size_t>(mesh_.tets[e][a])];
        if (row < 0) continue;
        const Vec3 &ga = gradients_[e][a], Fa = F * ga;
        r.segment<3>(3 * row) -= volumes_[e] * (F * S * ga);
        for (std::size_t b = 0; b < 4; ++b) {
          const int column = place_[static_cast<std::size_t>(mesh_.tets[e][b])];
          if (column < 0) continue;
          const Vec3 &gb = gradients_[e][b], Fb = F * gb;
          const Mat3 block = volumes_[e] * (lambda_ * Fa * Fb.transpose() + mu_ * Fb * Fa.transpose() +
                                            mu_ * ga.dot(gb) * B + ga.dot(S * gb) * Mat3::Identity());
          for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) entries.emplace_back(3 * row + i, 3 * column + j, block(i, j));
        }
      }
    }
    K.resize(3 * free_, 3 * free_);
    K.setFromTriplets(entries.begin(), entries.end());
  }

  const TetMesh& mesh_;
  double lambda_, mu_;
  std::vector<int> place_;
  int free_ = 0;
  std::vector<std::array<Vec3, 4>> gradients_;
  std::vector<double> volumes_;
};

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

inline std::vector<Vec3> spread_load(const SkinnedBody& b, std::span<const Index> nodes, const Vec3& force) {
  std::vector<Vec3> f(b.mesh.nodes.size(), Vec3::Zero());
  for (const Index v : nodes) f[static_cast<std::size_t>(v)] = force / static_cast<double>(nodes.size());
  return f;
}

/// Nodes under a load that keeps its direction and is raised in steps of 10° of their turn, until that is an angle.
/// Empty where that fails. @param direction unit @param small a force that turns the nodes by a few degrees, N
inline std::vector<BentByLoad> bend_by_load(const SkinnedBody& b, std::span<const Index> nodes, const Vec3& direction,
                                            double small, double angle) {
  const NonlinearBody body(b.mesh, kSoft, b.fixed);
  std::vector<Vec3> rest;
  for (std::size_t v = 0; v < b.mesh.nodes.size(); ++v) rest.push_back(b.rest(v));
  std::vector<BentByLoad> path{{rest, 0.0}};
  double turned = 0.0, step = small;
  for (int round = 0; round < 80; ++round) {
    const double force = path.back().force + step;
    BentByLoad next{body.equilibrium(path.back().places, spread_load(b, nodes, force * direction)), force};
    const double to = turn_of(nodes, rest, next.places);
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
