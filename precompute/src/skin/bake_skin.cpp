#include "skin/bake_skin.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "limber/mesh/ten_node_tet.h"
#include "limber/model/skin_pose.h"
#include "skin/handle_weights.h"

namespace limber::internal {
namespace {

constexpr double kDesignBend = 2.0 * std::numbers::pi / 3.0;  // up to 120° are meant to look right
constexpr double kLargestSpread = 13.0 * std::numbers::pi / 180.0;
constexpr Index kFewest = 8, kMost = 24, kMore = 4;  // handles tried where none are asked for
constexpr Index kLowestModes = 3;                    // that count: higher ones turn less by the same energy

using Matrix = Eigen::MatrixXd;

Eigen::Index columns(const std::vector<Vec3>& nodes) { return static_cast<Eigen::Index>(nodes.size()); }

/// [displacement][axis of the derivative] of each mode in a tet: 3k × 3, [axis][mode] down.
Matrix displacement_gradient(const SkinBody& body, const TetFields& fields, std::size_t tet) {
  Matrix G = Matrix::Zero(body.W.rows(), 3);
  for (int a = 0; a < 4; ++a) G += body.W.col(body.mesh.tets[tet][a]) * fields.gradient[tet][a].transpose();
  return G;
}

/// Θ of each mode from its gradient: 3k, half the curl.
Eigen::VectorXd turns_of(const Matrix& G) {
  const Eigen::Index k = G.rows() / 3;
  Eigen::VectorXd turns(G.rows());
  turns.segment(0, k) = 0.5 * (G.col(1).segment(2 * k, k) - G.col(2).segment(k, k));
  turns.segment(k, k) = 0.5 * (G.col(2).segment(0, k) - G.col(0).segment(2 * k, k));
  turns.segment(2 * k, k) = 0.5 * (G.col(0).segment(k, k) - G.col(1).segment(0, k));
  return turns;
}

/// Mean turns at nodes (3k × N) of what a tet's turns are.
Matrix nodal_turns(const SkinBody& body, const TetFields& fields, const Matrix& tet_turns) {
  Matrix turns = Matrix::Zero(body.W.rows(), body.W.cols());
  for (std::size_t e = 0; e < body.mesh.tets.size(); ++e)
    for (const Index n : body.mesh.tets[e])
      turns.col(n) += 0.25 * fields.volume[e] * tet_turns.col(static_cast<Eigen::Index>(e));
  for (Eigen::Index n = 0; n < turns.cols(); ++n) turns.col(n) /= fields.node_volume[n];
  for (const Index n : body.fixed) turns.col(n).setZero();
  return turns;
}

/// Weights of all handles in a tet or at a node, from influences.
Eigen::VectorXd spread_out(const SkinInfluences& at, Index handles) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(handles);
  for (std::size_t i = 0; i < SkinInfluences::kMost; ++i) weights[at.handle[i]] += static_cast<double>(at.weight[i]);
  return weights;
}

Eigen::VectorXd tet_weights(const HandleWeights& weights, const Tet& t) {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(weights.handles);
  for (const Index n : t) mean += 0.25 * spread_out(weights.nodes[static_cast<std::size_t>(n)], weights.handles);
  return mean;
}

/// Θ_h: means over what hangs on each handle, 3k × n, rounded as stored; the ground's is 0.
Matrix handle_turns(const SkinBody& body, const TetFields& fields, const Matrix& tet_turns,
                    const HandleWeights& weights) {
  Matrix turns = Matrix::Zero(body.W.rows(), weights.handles);
  Eigen::VectorXd volume = Eigen::VectorXd::Zero(weights.handles);
  for (std::size_t e = 0; e < body.mesh.tets.size(); ++e) {
    const Eigen::VectorXd share = fields.volume[e] * tet_weights(weights, body.mesh.tets[e]);
    volume += share;
    for (Index h = 0; h < weights.handles; ++h)
      if (share[h] > 0.0) turns.col(h) += share[h] * tet_turns.col(static_cast<Eigen::Index>(e));
  }
  for (Index h = 0; h < weights.handles; ++h)
    if (volume[h] > 0.0) turns.col(h) /= volume[h];
  if (weights.ground) turns.col(weights.handles - 1).setZero();
  return turns.cast<float>().cast<double>();
}

// How many ----------------------------------------------------------------------------------------------------------

Vec3 turn_by(const Matrix& turns, Eigen::Index column, Eigen::Index mode) {
  const Eigen::Index k = turns.rows() / 3;
  return {turns(mode, column), turns(k + mode, column), turns(2 * k + mode, column)};
}

double largest_turn(const Matrix& turns, Eigen::Index mode) {
  double most = 0.0;
  for (Eigen::Index v = 0; v < turns.cols(); ++v) most = std::max(most, turn_by(turns, v, mode).norm());
  return most;
}

/// From rest. The two ends of a free body turn to opposite sides.
double design_angle(const SkinBody& body) {
  return body.motion == FrameMotion::kFree ? 0.5 * kDesignBend : kDesignBend;
}

/// Each mode alone, at the least energy that turns any of them by the design angle anywhere.
Eigen::VectorXd design_amplitudes(const SkinBody& body, const Matrix& turns) {
  Eigen::VectorXd amplitudes = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(body.eigenvalues.size()));
  double least = 0.0;
  const auto energy = [&](Eigen::Index i) {
    const double turn = largest_turn(turns, i);
    return turn > 0.0 ? body.eigenvalues[static_cast<std::size_t>(i)] * std::pow(design_angle(body) / turn, 2) : 0.0;
  };
  for (Eigen::Index i = 0; i < amplitudes.size(); ++i)
    if (const double e = energy(i); e > 0.0 && (least == 0.0 || e < least)) least = e;
  for (Eigen::Index i = 0; i < amplitudes.size(); ++i)
    if (const double lambda = body.eigenvalues[static_cast<std::size_t>(i)]; lambda > 0.0)
      amplitudes[i] = std::sqrt(least / lambda);
  return amplitudes;
}

/// The largest over nodes and the lowest modes of Σ_h β_h |(Θ_node − Θ_h) z|, rad.
double largest_spread(const SkinBody& body, const Matrix& node_turns, const Matrix& handles,
                      const HandleWeights& weights) {
  const Eigen::VectorXd amplitudes = design_amplitudes(body, node_turns);
  double most = 0.0;
  for (Eigen::Index v = 0; v < node_turns.cols(); ++v)
    for (Eigen::Index i = 0; i < std::min<Eigen::Index>(kLowestModes, amplitudes.size()); ++i) {
      const SkinInfluences& at = weights.nodes[static_cast<std::size_t>(v)];
      double spread = 0.0;
      for (std::size_t c = 0; c < SkinInfluences::kMost; ++c)
        spread +=
            static_cast<double>(at.weight[c]) * (turn_by(node_turns, v, i) - turn_by(handles, at.handle[c], i)).norm();
      most = std::max(most, amplitudes[i] * spread);
    }
  return most;
}

// Where they go -----------------------------------------------------------------------------------------------------

/// Everything that the parts of a bake share.
struct Bake {
  const SkinBody& body;
  const TetFields& fields;
  const HandleWeights& weights;
  const Matrix& places;  // N × 3
  const Matrix& turns;   // Θ_h, 3k × n
  const Eigen::SparseMatrix<double>& L;

  Index handles() const { return weights.handles; }
  Eigen::Index modes() const { return turns.rows() / 3; }
  bool is_ground(Index h) const { return weights.ground && h + 1 == handles(); }
};

/// Volume that hangs on each handle by node, N × n, each column of sum 1.
Matrix node_shares(const Bake& b) {
  Matrix shares(b.places.rows(), b.handles());
  for (Eigen::Index v = 0; v < shares.rows(); ++v)
    shares.row(v) =
        b.fields.node_volume[v] * spread_out(b.weights.nodes[static_cast<std::size_t>(v)], b.handles()).transpose();
  for (Index h = 0; h < b.handles(); ++h) shares.col(h) /= shares.col(h).sum();
  return shares;
}

/// L y_h = w_h: what the gradients everywhere do to the mean place of a handle. The ground's stays 0.
Matrix mean_place_adjoints(const Bake& b, Matrix shares) {
  std::vector<Index> held(b.body.fixed.begin(), b.body.fixed.end());
  if (b.weights.ground)
    shares.col(b.handles() - 1).setZero();
  else {
    // A free body's mass centre stays: its mean place is out of every handle's.
    Eigen::VectorXd mass = Eigen::VectorXd::Zero(b.places.rows());
    for (std::size_t e = 0; e < b.body.mesh.tets.size(); ++e)
      for (const Index n : b.body.mesh.tets[e])
        mass[n] += b.body.materials[b.body.mesh.tet_region[e]].density * b.fields.volume[e];
    shares.colwise() -= mass / mass.sum();
    held = {0};  // where places count from
  }
  return HeldSolver(b.L, held).solve(shares, Matrix::Zero(shares.rows(), shares.cols()));
}

/// The gradient of a mode less what the handles turn: strain, and the rest of the rotation.
Matrix residual_gradient(const Bake& b, std::size_t tet, const Eigen::VectorXd& weights) {
  Matrix E = displacement_gradient(b.body, b.fields, tet);
  const Eigen::VectorXd turn = b.turns * weights;
  const Eigen::Index k = b.modes();
  const auto x = turn.segment(0, k), y = turn.segment(k, k), z = turn.segment(2 * k, k);
  E.col(1).segment(0, k) += z, E.col(2).segment(0, k) -= y;  // − [Θ]×
  E.col(0).segment(k, k) -= z, E.col(2).segment(k, k) += x;
  E.col(0).segment(2 * k, k) += y, E.col(1).segment(2 * k, k) -= x;
  return E;
}

void add_arms_and_shifts(const Bake& b, const Matrix& y, ModalSkin& skin) {
  const Index n = b.handles();
  const Eigen::Index k = b.modes();
  std::vector<Matrix> arms(static_cast<std::size_t>(n), Matrix::Zero(3, n));
  std::vector<Matrix> shifts(static_cast<std::size_t>(n), Matrix::Zero(3 * k, n));
  for (std::size_t e = 0; e < b.body.mesh.tets.size(); ++e) {
    const Eigen::VectorXd weights = tet_weights(b.weights, b.body.mesh.tets[e]);
    Eigen::Matrix<double, 3, Eigen::Dynamic> slope = Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, n);
    for (int a = 0; a < 4; ++a) slope += b.fields.volume[e] * b.fields.gradient[e][a] * y.row(b.body.mesh.tets[e][a]);
    const Matrix shift = residual_gradient(b, e, weights) * slope;
    for (Index l = 0; l < n; ++l) {
      if (weights[l] == 0.0) continue;
      arms[static_cast<std::size_t>(l)] += weights[l] * slope;
      shifts[static_cast<std::size_t>(l)] += weights[l] * shift;
    }
  }
  for (Index l = 0; l < n; ++l) {
    const auto at = static_cast<std::size_t>(l);
    const auto append = [](std::vector<float>& all, const Matrix& m) {
      for (Eigen::Index i = 0; i < m.size(); ++i) all.push_back(static_cast<float>(m.data()[i]));
    };
    append(skin.arms, arms[at]);
    append(skin.shifts, shifts[at]);
  }
}

ModalSkin make_handles(const Bake& b) {
  ModalSkin skin;
  skin.handles = b.handles();
  skin.modes = static_cast<Index>(b.modes());
  const Matrix shares = node_shares(b);
  for (Index h = 0; h < b.handles(); ++h)
    skin.rest.push_back(b.is_ground(h) ? Vec3(Vec3::Zero()) : Vec3(b.places.transpose() * shares.col(h)));
  for (Eigen::Index i = 0; i < b.turns.size(); ++i) skin.rotations.push_back(static_cast<float>(b.turns.data()[i]));
  add_arms_and_shifts(b, mean_place_adjoints(b, shares), skin);
  return skin;
}

// Free bodies -------------------------------------------------------------------------------------------------------

/// μ: (M 1, M r)/m per node, 4 × N.
Matrix frame_moments(const Bake& b) {
  const SparseMatrix& M = b.body.node_mass;
  Matrix ones_and_places(4, b.places.rows());
  ones_and_places.row(0).setOnes();
  ones_and_places.bottomRows(3) = b.places.transpose();
  Matrix moments = Matrix::Zero(4, b.places.rows());
  for (Index c = 0; c < M.size; ++c)
    for (Index e = M.column_start[c]; e < M.column_start[c + 1]; ++e)
      moments.col(c) += M.value[e] * ones_and_places.col(M.row[e]);
  return moments / moments.row(0).sum();
}

/// Ũ of one mode at all nodes, 3 × N.
Matrix undeformed_shapes(const Bake& b, const ModalSkin& skin, Eigen::Index mode) {
  SkinPose pose(skin);
  std::vector<double> z(static_cast<std::size_t>(b.modes()), 0.0);
  z[static_cast<std::size_t>(mode)] = 1.0;
  pose.set(z);
  Matrix shapes(3, b.places.rows());
  for (Eigen::Index v = 0; v < shapes.cols(); ++v) {
    Vec3 u = turn_by(b.body.W, v, mode);
    const SkinInfluences& at = b.weights.nodes[static_cast<std::size_t>(v)];
    for (std::size_t c = 0; c < SkinInfluences::kMost; ++c) {
      const SkinPose::Handle& handle = pose.handles()[at.handle[c]];
      u -= static_cast<double>(at.weight[c]) * (handle.drift + handle.angle.cross(Vec3(b.places.row(v))));
    }
    shapes.col(v) = u;
  }
  return shapes;
}

/// Adds Σ_v β_vh x_v μ_vᵀ, 3 × 4 per handle, to `out` at handle · stride.
void add_moments(const Bake& b, const Matrix& x, const Matrix& moments, double* out, std::size_t stride) {
  for (Eigen::Index v = 0; v < x.cols(); ++v) {
    const Eigen::Matrix<double, 3, 4> moment = x.col(v) * moments.col(v).transpose();
    const SkinInfluences& at = b.weights.nodes[static_cast<std::size_t>(v)];
    for (std::size_t c = 0; c < SkinInfluences::kMost; ++c)
      Eigen::Map<Eigen::Matrix<double, 3, 4>>(out + at.handle[c] * stride) +=
          static_cast<double>(at.weight[c]) * moment;
  }
}

SkinGauge make_gauge(const Bake& b, const ModalSkin& skin) {
  const auto n = static_cast<std::size_t>(b.handles()), k = static_cast<std::size_t>(b.modes());
  SkinGauge gauge{.weights = std::vector<double>(4 * n, 0.0),
                  .rest = std::vector<double>(12 * n, 0.0),
                  .shapes = std::vector<double>(12 * n * k, 0.0)};
  const Matrix moments = frame_moments(b);
  for (Eigen::Index v = 0; v < moments.cols(); ++v) {
    const SkinInfluences& at = b.weights.nodes[static_cast<std::size_t>(v)];
    for (std::size_t c = 0; c < SkinInfluences::kMost; ++c)
      Eigen::Map<Eigen::Vector4d>(gauge.weights.data() + 4 * at.handle[c]) +=
          static_cast<double>(at.weight[c]) * moments.col(v);
  }
  add_moments(b, b.places.transpose(), moments, gauge.rest.data(), 12);
  for (std::size_t i = 0; i < k; ++i)
    add_moments(b, undeformed_shapes(b, skin, static_cast<Eigen::Index>(i)), moments, gauge.shapes.data() + 12 * i,
                12 * k);
  return gauge;
}

// Report ------------------------------------------------------------------------------------------------------------

std::vector<SkinReport::Mode> mode_reports(const SkinBody& body, const NodalSkin& skin, const Matrix& node_turns) {
  std::vector<SkinReport::Mode> reports;
  for (std::size_t i = 0; i < body.eigenvalues.size() && reports.size() < kLowestModes; ++i) {
    const double turn = largest_turn(node_turns, static_cast<Eigen::Index>(i));
    if (!(body.eigenvalues[i] > 0.0 && turn > 0.0)) continue;
    SkinReport::Mode& report = reports.emplace_back();
    report.mode = static_cast<Index>(i);
    for (std::size_t a = 0; a < SkinReport::kDegrees.size(); ++a) {
      std::vector<double> z(body.eigenvalues.size(), 0.0);
      z[i] = SkinReport::kDegrees[a] * std::numbers::pi / 180.0 / turn;
      report.energy[a] = shape_energy(body, skinned_nodes(body, skin, z)) / (0.5 * body.eigenvalues[i] * z[i] * z[i]);
    }
  }
  return reports;
}

}  // namespace

SkinBody skin_body(const ModalAnalysis& analysis, std::span<const Index> kept, const TetMesh& mesh,
                   std::span<const Material> materials, std::span<const Index> fixed, const ModalAnalysisOptions& made,
                   const Vec3& origin) {
  const auto k = static_cast<Eigen::Index>(kept.size());
  SkinBody body{.mesh = mesh.has_mid_edge_nodes() ? split_into_eight(mesh) : mesh,
                .materials = materials,
                .fixed = fixed,
                .motion = analysis.freedom.motion,
                .origin = origin,
                .node_mass = assemble_mass(mesh, materials, made.mass),
                .W = Matrix(3 * k, columns(mesh.nodes)),
                .eigenvalues = {}};
  for (Eigen::Index m = 0; m < k; ++m) {
    const Index column = kept[static_cast<std::size_t>(m)];
    body.eigenvalues.push_back(analysis.eigenvalues[static_cast<std::size_t>(column)]);
    const double* shape = analysis.shapes.data() + 3 * static_cast<std::size_t>(column) * mesh.nodes.size();
    for (Eigen::Index v = 0; v < body.W.cols(); ++v)
      for (Eigen::Index axis = 0; axis < 3; ++axis) body.W(axis * k + m, v) = shape[3 * v + axis];
  }
  return body;
}

NodalSkin bake_skin(const SkinBody& body, const SkinOptions& options, SkinReport& report) {
  const TetFields fields(body.mesh);
  const Eigen::SparseMatrix<double> L = laplacian(body.mesh, fields);
  Matrix places(columns(body.mesh.nodes), 3);
  for (Eigen::Index v = 0; v < places.rows(); ++v)
    places.row(v) = (body.mesh.nodes[static_cast<std::size_t>(v)] - body.origin).transpose();
  Matrix tet_turns(body.W.rows(), static_cast<Eigen::Index>(body.mesh.tets.size()));
  for (std::size_t e = 0; e < body.mesh.tets.size(); ++e)
    tet_turns.col(static_cast<Eigen::Index>(e)) = turns_of(displacement_gradient(body, fields, e));
  const Matrix node_turns = nodal_turns(body, fields, tet_turns);
  const Matrix features = cluster_features(node_turns.transpose(), body.eigenvalues, places, fields.node_volume);

  const auto nodes = static_cast<Index>(body.mesh.nodes.size());
  HandleWeights weights;
  Matrix turns;
  for (Index count = options.handles > 0 ? options.handles : kFewest;; count += kMore) {
    const std::vector<Index> cluster = cluster_nodes(features, fields.node_volume, std::min(count, nodes));
    weights = diffuse_clusters(fields, L, cluster, std::min(count, nodes), places, body.fixed);
    turns = handle_turns(body, fields, tet_turns, weights);
    report.spread = largest_spread(body, node_turns, turns, weights);
    if (options.handles > 0 || count >= kMost || count >= nodes || report.spread <= kLargestSpread) break;
  }
  const Bake bake{body, fields, weights, places, turns, L};
  NodalSkin out{.skin = make_handles(bake), .nodes = weights.nodes};
  if (body.motion == FrameMotion::kFree) out.skin.gauge = make_gauge(bake, out.skin);
  report.handles = weights.handles;
  report.ground = weights.ground;
  report.modes = mode_reports(body, out, node_turns);
  return out;
}

std::vector<Vec3> skinned_nodes(const SkinBody& body, const NodalSkin& skin, std::span<const double> z) {
  SkinPose pose(skin.skin);
  pose.set(z);
  const Eigen::Map<const Eigen::VectorXd> amplitudes(z.data(), static_cast<Eigen::Index>(z.size()));
  const Eigen::Index k = amplitudes.size();
  std::vector<Vec3> out;
  for (std::size_t v = 0; v < body.mesh.nodes.size(); ++v) {
    const auto shape = body.W.col(static_cast<Eigen::Index>(v));
    const Vec3 linear(shape.segment(0, k).dot(amplitudes), shape.segment(k, k).dot(amplitudes),
                      shape.segment(2 * k, k).dot(amplitudes));
    out.push_back(pose.position(skin.nodes[v], body.mesh.nodes[v] - body.origin, linear));
  }
  return out;
}

double shape_energy(const SkinBody& body, std::span<const Vec3> places) {
  const TetFields fields(body.mesh);
  double energy = 0.0;
  for (std::size_t e = 0; e < body.mesh.tets.size(); ++e) {
    Mat3 F = Mat3::Zero();
    for (int a = 0; a < 4; ++a) F += places[body.mesh.tets[e][a]] * fields.gradient[e][a].transpose();
    const Mat3 strain = 0.5 * (F.transpose() * F - Mat3::Identity());
    const Material& material = body.materials[body.mesh.tet_region[e]];
    energy += fields.volume[e] * (0.5 * material.lame_lambda() * strain.trace() * strain.trace() +
                                  material.shear_modulus() * strain.squaredNorm());
  }
  return energy;
}

std::vector<SkinInfluences> surface_influences(const NodalSkin& skin, const TetMesh& mesh, const Embedding& surface) {
  std::vector<SkinInfluences> out;
  std::vector<double> row(static_cast<std::size_t>(skin.skin.handles));
  for (const EmbeddedVertex& vertex : surface.vertices) {
    std::fill(row.begin(), row.end(), 0.0);
    const TetNodes tet(mesh, static_cast<std::size_t>(vertex.tet));
    PointInEighth at{.corner = {0, 1, 2, 3}, .L = vertex.weight};
    if (mesh.has_mid_edge_nodes()) at = point_in_eighth(vertex.weight);
    for (std::size_t a = 0; a < 4; ++a) {
      const SkinInfluences& node = skin.nodes[tet[at.corner[a]]];
      for (std::size_t i = 0; i < SkinInfluences::kMost; ++i)
        row[node.handle[i]] += std::max(0.0, at.L[a]) * static_cast<double>(node.weight[i]);
    }
    out.push_back(skin_influences(row));
  }
  return out;
}

}  // namespace limber::internal
