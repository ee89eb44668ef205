#include "fem/stress_recovery.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <string>
#include <tuple>

#include "fem/element_rules.h"

namespace limber::internal {
namespace {

constexpr std::size_t kOverfit = 2;  // a fit rests on at least so many points a term
constexpr double kRidge = 1e-10;     // picks the least polynomial where points do not tell one
Vec3 place(const TetMesh& mesh, Index tet, const Barycentric& L) {
  Vec3 x = Vec3::Zero();
  for (std::size_t a = 0; a < 4; ++a) x += L[a] * mesh.nodes[mesh.tets[tet][a]];
  return x;
}

/// σ n of a stress written as six numbers.
Eigen::Matrix<double, 3, 6> traction(const Vec3& n) {
  Eigen::Matrix<double, 3, 6> N;
  N << n[0], 0, 0, 0, n[2], n[1],  //
      0, n[1], 0, n[2], 0, n[0],   //
      0, 0, n[2], n[1], n[0], 0;
  return N;
}

using Mat6 = Eigen::Matrix<double, 6, 6>;

struct Face {
  std::array<Index, 3> corners;  // ascending
  Index tet;
  bool operator<(const Face& f) const { return std::tie(corners, tet) < std::tie(f.corners, f.tet); }
};

/// Of tets that have it alone.
std::vector<Face> outer_faces(const TetMesh& mesh) {
  std::vector<Face> faces, outer;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (std::size_t left_out = 0; left_out < 4; ++left_out) {
      Face f{.corners = {}, .tet = static_cast<Index>(t)};
      for (std::size_t a = 0, i = 0; a < 4; ++a)
        if (a != left_out) f.corners[i++] = mesh.tets[t][a];
      std::sort(f.corners.begin(), f.corners.end());
      faces.push_back(f);
    }
  std::sort(faces.begin(), faces.end());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const bool as_before = i > 0 && faces[i - 1].corners == faces[i].corners;
    const bool as_next = i + 1 < faces.size() && faces[i + 1].corners == faces[i].corners;
    if (!as_before && !as_next) outer.push_back(faces[i]);
  }
  return outer;
}

}  // namespace

/// A polynomial in (x − centre)/size around a corner.
struct StressRecovery::Fit {
  Vec3 centre;
  double size = 0.0;
  std::vector<Index> samples;
  Eigen::MatrixXd P;                           // monomials at the samples
  Eigen::LLT<Eigen::MatrixXd> alike, coupled;  // normal equations: one for all components, or where faces couple them
  bool has_faces = false;
};

StressRecovery::StressRecovery(const TetMesh& mesh, std::span<const Index> fixed_nodes)
    : mesh_(mesh), points_(rule_points(mesh.has_mid_edge_nodes() ? 10 : 4)) {
  number_values();
  find_free_faces(fixed_nodes);
}

void StressRecovery::number_values() {
  struct Known {
    Index part, value;
  };
  std::map<std::string, Index> by_name;
  std::vector<Index> smooth_part;  // per region
  for (const Region& r : mesh_.regions)
    smooth_part.push_back(by_name.try_emplace(r.name, static_cast<Index>(by_name.size())).first->second);
  std::vector<std::vector<Known>> of_node(mesh_.nodes.size());
  values_.resize(mesh_.tets.size());
  for (std::size_t t = 0; t < mesh_.tets.size(); ++t) {
    const TetNodes nodes(mesh_, t);
    const Index part = smooth_part[mesh_.tet_region[t]];
    for (std::size_t a = 0; a < nodes.size(); ++a) {
      auto& known = of_node[nodes[a]];
      auto found = std::find_if(known.begin(), known.end(), [&](const Known& k) { return k.part == part; });
      if (found == known.end()) {
        found = known.insert(known.end(), {part, static_cast<Index>(places_.size())});
        places_.push_back(mesh_.nodes[nodes[a]]);
        tets_of_.emplace_back();
      }
      values_[t][a] = found->value;
      if (a < 4) tets_of_[found->value].push_back(static_cast<Index>(t));
    }
  }
}

void StressRecovery::find_free_faces(std::span<const Index> fixed_nodes) {
  std::vector<char> fixed(mesh_.nodes.size(), 0);
  for (const Index n : fixed_nodes) fixed[n] = 1;
  faces_of_.resize(places_.size());
  for (const Face& f : outer_faces(mesh_)) {
    const auto& c = f.corners;
    if (fixed[c[0]] && fixed[c[1]] && fixed[c[2]]) continue;
    FreeFace face{.corners = {mesh_.nodes[c[0]], mesh_.nodes[c[1]], mesh_.nodes[c[2]]}, .normal = Vec3::Zero()};
    face.normal = (face.corners[1] - face.corners[0]).cross(face.corners[2] - face.corners[0]).normalized();
    for (std::size_t a = 0; a < 4; ++a)
      if (std::find(c.begin(), c.end(), mesh_.tets[f.tet][a]) != c.end()) faces_of_[values_[f.tet][a]].push_back(face);
  }
}

Eigen::RowVectorXd StressRecovery::monomials(const Vec3& x) const {
  Eigen::RowVectorXd p(terms());
  p.head<4>() << 1.0, x[0], x[1], x[2];
  if (p.size() > 4) p.tail<6>() << x[0] * x[0], x[1] * x[1], x[2] * x[2], x[1] * x[2], x[2] * x[0], x[0] * x[1];
  return p;
}

/// The tets of a corner's region around it, as many rings as a fit needs.
std::vector<Index> StressRecovery::patch_around(Index corner) const {
  std::vector<Index> tets = tets_of_[corner];
  while (samples() * tets.size() < kOverfit * static_cast<std::size_t>(terms())) {
    std::vector<Index> wider;
    for (const Index t : tets)
      for (std::size_t a = 0; a < 4; ++a) {
        const auto& around = tets_of_[values_[t][a]];
        wider.insert(wider.end(), around.begin(), around.end());
      }
    std::sort(wider.begin(), wider.end());
    wider.erase(std::unique(wider.begin(), wider.end()), wider.end());
    if (wider.size() == tets.size()) break;
    tets = std::move(wider);
  }
  return tets;
}

StressRecovery::Fit StressRecovery::fit_around(Index corner) const {
  Fit fit;
  fit.centre = places_[corner];
  std::vector<Vec3> places;
  for (const Index t : patch_around(corner))
    for (std::size_t q = 0; q < samples(); ++q) {
      fit.samples.push_back(static_cast<Index>(samples()) * t + static_cast<Index>(q));
      places.push_back(place(mesh_, t, points_[q]));
      fit.size = std::max(fit.size, (places.back() - fit.centre).norm());
    }
  const auto count = static_cast<Eigen::Index>(places.size());
  fit.P.resize(count, terms());
  for (Eigen::Index i = 0; i < count; ++i) fit.P.row(i) = monomials((places[i] - fit.centre) / fit.size);
  Eigen::MatrixXd normal = fit.P.transpose() * fit.P;
  normal.diagonal().array() += kRidge * static_cast<double>(count);
  fit.has_faces = !faces_of_[corner].empty();
  if (!fit.has_faces) {
    fit.alike.compute(normal);
    return fit;
  }
  // Unknown 6 k + c: component c of term k.
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(6 * terms(), 6 * terms());
  for (Eigen::Index k = 0; k < terms(); ++k)
    for (Eigen::Index l = 0; l < terms(); ++l) all.block<6, 6>(6 * k, 6 * l).diagonal().setConstant(normal(k, l));
  for (const FreeFace& face : faces_of_[corner]) {
    const Mat6 NN = traction(face.normal).transpose() * traction(face.normal);
    for (std::size_t a = 0; a < 3; ++a) {  // exact for the products of linear functions on a face
      const Vec3 middle = 0.5 * (face.corners[a] + face.corners[(a + 1) % 3]);
      const Eigen::RowVectorXd p = monomials((middle - fit.centre) / fit.size);
      for (Eigen::Index k = 0; k < terms(); ++k)
        for (Eigen::Index l = 0; l < terms(); ++l) all.block<6, 6>(6 * k, 6 * l) += p[k] * p[l] * NN;
    }
  }
  fit.coupled.compute(all);
  return fit;
}

/// terms × columns of at_samples
Eigen::MatrixXd StressRecovery::coefficients(const Fit& fit, const StressRows& at_samples) const {
  const StressRows right = fit.P.transpose() * at_samples(fit.samples, Eigen::all);
  if (!fit.has_faces) return fit.alike.solve(right);
  const Eigen::Index modes = right.cols() / 6;
  // Rows of `right` hold component after component: the same numbers as a matrix of 6 · terms rows.
  const StressRows solved = fit.coupled.solve(Eigen::Map<const StressRows>(right.data(), 6 * terms(), modes));
  return Eigen::Map<const StressRows>(solved.data(), terms(), 6 * modes);
}

/// Values of the middles of a corner's edges, each once.
std::vector<Index> StressRecovery::middles_around(Index corner) const {
  std::vector<Index> middles;
  if (!mesh_.has_mid_edge_nodes()) return middles;
  for (const Index t : tets_of_[corner])
    for (std::size_t e = 0; e < kTetEdges.size(); ++e)
      for (const int end : kTetEdges[e])
        if (values_[t][end] == corner) middles.push_back(values_[t][4 + e]);
  std::sort(middles.begin(), middles.end());
  middles.erase(std::unique(middles.begin(), middles.end()), middles.end());
  return middles;
}

StressRows StressRecovery::recover(const StressRows& at_samples) const {
  StressRows recovered = StressRows::Zero(static_cast<Eigen::Index>(places_.size()), at_samples.cols());
  for (Index corner = 0; corner < static_cast<Index>(places_.size()); ++corner) {
    if (tets_of_[corner].empty()) continue;  // the middle of an edge
    const Fit fit = fit_around(corner);
    const Eigen::MatrixXd c = coefficients(fit, at_samples);
    recovered.row(corner) += monomials(Vec3::Zero()) * c;
    for (const Index v : middles_around(corner))
      recovered.row(v) += 0.5 * monomials((places_[v] - fit.centre) / fit.size) * c;
  }
  return recovered;
}

}  // namespace limber::internal
