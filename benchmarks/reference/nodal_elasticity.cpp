#include "nodal_elasticity.h"

#include <Eigen/SVD>
#include <cmath>

namespace limber::testing {
namespace {

using Mat9 = Eigen::Matrix<double, 9, 9>;

/// The numbers of a law.
struct Law {
  ElasticLaw law;
  double lambda, mu;

  // Moduli of kNeoHookean.
  double mu_h() const { return 4.0 / 3.0 * mu; }
  double lambda_h() const { return lambda + 5.0 / 6.0 * mu; }
  double alpha() const { return 1.0 + 0.75 * mu_h() / lambda_h(); }
};

Mat3 small_strain(const Mat3& F) { return 0.5 * (F + F.transpose()) - Mat3::Identity(); }
Mat3 green_strain(const Mat3& F) { return 0.5 * (F.transpose() * F - Mat3::Identity()); }
Mat3 hooke(const Law& law, const Mat3& strain) {
  return law.lambda * strain.trace() * Mat3::Identity() + 2.0 * law.mu * strain;
}

/// ∂ det F/∂F.
Mat3 cofactors(const Mat3& F) {
  Mat3 G;
  G << F.col(1).cross(F.col(2)), F.col(2).cross(F.col(0)), F.col(0).cross(F.col(1));
  return G;
}

/// How they change with F.
Mat3 cofactors_change(const Mat3& F, const Mat3& D) {
  Mat3 G;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    G.col(i) = D.col(j).cross(F.col(k)) + F.col(j).cross(D.col(k));
  }
  return G;
}

double energy_density(const Law& law, const Mat3& F) {
  if (law.law == ElasticLaw::kNeoHookean) {
    const double I = F.squaredNorm(), stretch = F.determinant() - law.alpha();
    const double at_rest = -0.5 * law.mu_h() * std::log(4.0) + 0.5 * law.lambda_h() * std::pow(1.0 - law.alpha(), 2);
    return 0.5 * law.mu_h() * (I - 3.0 - std::log(I + 1.0)) + 0.5 * law.lambda_h() * stretch * stretch - at_rest;
  }
  const Mat3 strain = law.law == ElasticLaw::kLinear ? small_strain(F) : green_strain(F);
  return 0.5 * law.lambda * strain.trace() * strain.trace() + law.mu * strain.squaredNorm();
}

/// ∂Ψ/∂F.
Mat3 stress(const Law& law, const Mat3& F) {
  switch (law.law) {
    case ElasticLaw::kLinear:
      return hooke(law, small_strain(F));
    case ElasticLaw::kStVenantKirchhoff:
      return F * hooke(law, green_strain(F));
    case ElasticLaw::kNeoHookean:
      break;
  }
  return law.mu_h() * (1.0 - 1.0 / (F.squaredNorm() + 1.0)) * F +
         law.lambda_h() * (F.determinant() - law.alpha()) * cofactors(F);
}

/// How it changes with F.
Mat3 stress_change(const Law& law, const Mat3& F, const Mat3& D) {
  if (law.law == ElasticLaw::kLinear) return hooke(law, 0.5 * (D + D.transpose()));
  if (law.law == ElasticLaw::kStVenantKirchhoff)
    return D * hooke(law, green_strain(F)) + F * hooke(law, 0.5 * (D.transpose() * F + F.transpose() * D));
  const double above = F.squaredNorm() + 1.0;
  const Mat3 G = cofactors(F);
  return law.mu_h() * ((1.0 - 1.0 / above) * D + 2.0 * F.cwiseProduct(D).sum() / (above * above) * F) +
         law.lambda_h() * (G.cwiseProduct(D).sum() * G + (F.determinant() - law.alpha()) * cofactors_change(F, D));
}

Mat9 tangent(const Law& law, const Mat3& F) {
  Mat9 C;
  for (int i = 0; i < 9; ++i) {
    Mat3 D = Mat3::Zero();
    D(i % 3, i / 3) = 1.0;
    const Mat3 change = stress_change(law, F, D);
    C.col(i) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(change.data());
  }
  return C;
}

}  // namespace

NodeVectors node_places(const TetMesh& mesh) {
  NodeVectors x(static_cast<Eigen::Index>(mesh.nodes.size()), 3);
  for (Eigen::Index v = 0; v < x.rows(); ++v) x.row(v) = mesh.nodes[static_cast<std::size_t>(v)].transpose();
  return x;
}

Eigen::Map<const Eigen::VectorXd> numbers_of(const NodeVectors& vectors) { return {vectors.data(), vectors.size()}; }

BestRotation best_rotation(const NodeVectors& a, const NodeVectors& weighted, const NodeVectors& b,
                           const Eigen::VectorXd& masses) {
  const double mass = masses.sum();
  BestRotation best;
  best.from = a.transpose() * masses / mass;
  best.to = b.transpose() * masses / mass;
  // Σ (b − to) (M (a − from))ᵀ: `weighted` less what the shift takes away.
  const Mat3 moment = b.transpose() * weighted - mass * best.to * best.from.transpose();
  const Eigen::JacobiSVD<Mat3> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0.0) U.col(2) *= -1.0;
  best.rotation = U * svd.matrixV().transpose();
  return best;
}

NodalElasticity::NodalElasticity(const TetMesh& mesh, const Material& material, ElasticLaw law,
                                 std::span<const Index> fixed)
    : law_(law),
      lambda_(material.lame_lambda()),
      mu_(material.shear_modulus()),
      tets_(mesh.tets),
      rest_(node_places(mesh)),
      is_fixed_(mesh.nodes.size(), 0),
      turns_(fixed.empty()) {
  for (const Tet& t : tets_) {
    Mat3 edges;
    for (std::size_t i = 0; i < 3; ++i)
      edges.col(static_cast<Eigen::Index>(i)) = (rest_.row(t[i + 1]) - rest_.row(t[0])).transpose();
    const Mat3 inverse = edges.inverse();
    std::array<Vec3, 4> g;
    g[0].setZero();
    for (std::size_t i = 0; i < 3; ++i) {
      g[i + 1] = inverse.row(static_cast<Eigen::Index>(i)).transpose();
      g[0] -= g[i + 1];
    }
    gradients_.push_back(g);
    volumes_.push_back(edges.determinant() / 6.0);
  }
  for (const Index v : fixed) is_fixed_[static_cast<std::size_t>(v)] = 1;
  assemble_mass(material.density);
  center_ = rest_.transpose() * node_masses_ / node_masses_.sum();
  weighted_rest_ = mass_ * (rest_.rowwise() - center_.transpose());
  if (law_ == ElasticLaw::kLinear)
    linear_stiffness_ = assemble_stiffness([&](std::size_t) {
      return tangent({law_, lambda_, mu_}, Mat3::Identity());
    });
}

void NodalElasticity::assemble_mass(double density) {
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t e = 0; e < tets_.size(); ++e)
    for (const Index a : tets_[e])
      for (const Index b : tets_[e]) entries.emplace_back(a, b, density * volumes_[e] / 20.0 * (a == b ? 2.0 : 1.0));
  mass_.resize(nodes(), nodes());
  mass_.setFromTriplets(entries.begin(), entries.end());
  node_masses_ = mass_ * Eigen::VectorXd::Ones(nodes());
}

Mat3 NodalElasticity::deformation(const NodeVectors& x, std::size_t tet) const {
  Mat3 F = Mat3::Zero();
  for (std::size_t a = 0; a < 4; ++a) F += x.row(tets_[tet][a]).transpose() * gradients_[tet][a].transpose();
  return F;
}

NodalElasticity::Turned NodalElasticity::turned(const NodeVectors& x) const {
  if (!turns_) return {.R = Mat3::Identity(), .d = x - rest_};
  const NodeVectors r = rest_.rowwise() - center_.transpose();
  const BestRotation best = best_rotation(r, weighted_rest_, x, node_masses_);
  return {.R = best.rotation, .d = (x.rowwise() - best.to.transpose()) * best.rotation - r};
}

NodeVectors NodalElasticity::linear_forces(const NodeVectors& x) const {
  const Turned frame = turned(x);
  NodeVectors g(nodes(), 3);
  Eigen::Map<Eigen::VectorXd>(g.data(), g.size()) = linear_stiffness_ * numbers_of(frame.d);
  if (!turns_) return -g;
  // The frame turns with x so that Σ w × d stays 0, w = M r: by δϑ = J⁻¹ Σ w × Rᵀδx, J = Σ (w·y) 1 − y wᵀ, y = r + d.
  // The energy changes by g·(Rᵀδx − δϑ × y), which makes no torque on the body as a whole.
  const NodeVectors y = (rest_.rowwise() - center_.transpose()) + frame.d;
  const Mat3 J = weighted_rest_.cwiseProduct(y).sum() * Mat3::Identity() - y.transpose() * weighted_rest_;
  Vec3 torque = Vec3::Zero();
  for (Eigen::Index v = 0; v < nodes(); ++v) torque += Vec3(y.row(v)).cross(Vec3(g.row(v)));
  const Vec3 s = J.transpose().inverse() * torque;
  for (Eigen::Index v = 0; v < nodes(); ++v)
    g.row(v) = -(frame.R * (Vec3(g.row(v)) - s.cross(Vec3(weighted_rest_.row(v))))).transpose();
  return g;
}

double NodalElasticity::energy(const NodeVectors& x) const {
  if (law_ == ElasticLaw::kLinear) {
    const NodeVectors d = turned(x).d;
    return 0.5 * numbers_of(d).dot(linear_stiffness_ * numbers_of(d));
  }
  double sum = 0.0;
  for (std::size_t e = 0; e < tets_.size(); ++e)
    sum += volumes_[e] * energy_density({law_, lambda_, mu_}, deformation(x, e));
  return sum;
}

NodeVectors NodalElasticity::forces(const NodeVectors& x) const {
  if (law_ == ElasticLaw::kLinear) return linear_forces(x);
  NodeVectors f = NodeVectors::Zero(nodes(), 3);
  for (std::size_t e = 0; e < tets_.size(); ++e) {
    const Mat3 P = volumes_[e] * stress({law_, lambda_, mu_}, deformation(x, e));
    for (std::size_t a = 0; a < 4; ++a) f.row(tets_[e][a]) -= (P * gradients_[e][a]).transpose();
  }
  return f;
}

template <class Tangent>
SparseDoubles NodalElasticity::assemble_stiffness(Tangent&& tangent_of) const {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(144 * tets_.size());
  for (std::size_t e = 0; e < tets_.size(); ++e) {
    const Mat9 C = volumes_[e] * tangent_of(e);
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = 0; b < 4; ++b) {
        Mat3 block = Mat3::Zero();
        for (Eigen::Index i = 0; i < 3; ++i)
          for (Eigen::Index j = 0; j < 3; ++j)
            block += gradients_[e][a][i] * gradients_[e][b][j] * C.block<3, 3>(3 * i, 3 * j);
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) entries.emplace_back(3 * tets_[e][a] + i, 3 * tets_[e][b] + j, block(i, j));
      }
  }
  SparseDoubles K(3 * nodes(), 3 * nodes());
  K.setFromTriplets(entries.begin(), entries.end());
  return K;
}

SparseDoubles NodalElasticity::stiffness(const NodeVectors& x) const {
  const Law law{law_, lambda_, mu_};
  if (law_ != ElasticLaw::kLinear)
    return assemble_stiffness([&](std::size_t e) { return tangent(law, deformation(x, e)); });
  if (!turns_) return linear_stiffness_;
  const Mat3 R = turned(x).R;
  std::vector<Eigen::Triplet<double>> turn;
  for (int v = 0; v < static_cast<int>(nodes()); ++v)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) turn.emplace_back(3 * v + i, 3 * v + j, R(i, j));
  SparseDoubles all(3 * nodes(), 3 * nodes());
  all.setFromTriplets(turn.begin(), turn.end());
  return all * linear_stiffness_ * SparseDoubles(all.transpose());
}

}  // namespace limber::testing
