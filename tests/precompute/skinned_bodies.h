// Bodies with modal skins, and the solution that the skins approximate: rotation-strain warping of every tet.
#pragma once

#include <Eigen/SparseCholesky>
#include <cmath>
#include <memory>

#include "constants.h"
#include "limber/precompute/modal_analysis.h"
#include "mesh_files.h"
#include "skin/bake_skin.h"
#include "tet_box.h"

namespace limber::testing {

inline const Material kSoft{.youngs_modulus = 1e5, .poisson_ratio = 0.3, .density = 1000.0};

/// A mesh, its lowest modes and its skin.
struct SkinnedBody {
  TetMesh mesh;
  std::vector<Material> materials{kSoft};
  std::vector<Index> fixed;
  std::unique_ptr<internal::SkinBody> body;
  internal::NodalSkin skin;
  SkinReport report;

  Index modes() const { return static_cast<Index>(body->eigenvalues.size()); }
  double size() const {
    Eigen::AlignedBox3d box;
    for (const Vec3& x : mesh.nodes) box.extend(x);
    return box.diagonal().norm();
  }
  Vec3 rest(std::size_t v) const { return mesh.nodes[v] - body->origin; }
  Vec3 shape(std::size_t v, Index mode) const {
    const auto column = static_cast<Eigen::Index>(v);
    return {body->W(mode, column), body->W(modes() + mode, column), body->W(2 * modes() + mode, column)};
  }
  Vec3 linear(std::size_t v, std::span<const double> z) const {
    Vec3 u = Vec3::Zero();
    for (Index i = 0; i < modes(); ++i) u += z[static_cast<std::size_t>(i)] * shape(v, i);
    return u;
  }
  std::vector<Vec3> places(std::span<const double> z) const { return internal::skinned_nodes(*body, skin, z); }
  double modal_energy(std::span<const double> z) const {
    double energy = 0.0;
    for (std::size_t i = 0; i < z.size(); ++i) energy += 0.5 * body->eigenvalues[i] * z[i] * z[i];
    return energy;
  }
};

inline Vec3 centre_of_mass(const TetMesh& mesh) { return volume_properties(mesh).centroid; }

inline std::unique_ptr<SkinnedBody> skinned(TetMesh mesh, std::vector<Index> fixed, int modes = 20, Index handles = 0,
                                            MassKind mass = MassKind::kLumped) {
  auto b = std::make_unique<SkinnedBody>();
  b->mesh = std::move(mesh);
  b->fixed = std::move(fixed);
  Warnings warnings;
  const ModalAnalysisOptions options{.modes = modes, .mass = mass, .certify = false};
  const ModalAnalysis a = analyse_modes(b->mesh, b->materials, b->fixed, options, warnings);
  std::vector<Index> kept;
  for (Index i = 0; i < modes; ++i) kept.push_back(i);
  b->body = std::make_unique<internal::SkinBody>(
      internal::skin_body(a, kept, b->mesh, b->materials, b->fixed, options, centre_of_mass(b->mesh)));
  b->skin = internal::bake_skin(*b->body, {.make = true, .handles = handles}, b->report);
  return b;
}

inline std::vector<Index> nodes_at_zero_x(const TetMesh& mesh) {
  return nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; });
}

/// A box whose cells are mirror images of their neighbours, so that the mesh leans to no side: Kuhn's tets of
/// tet_box() all run along the same diagonal. Even numbers of cells.
inline TetMesh mirrored_box(int nx, int ny, int nz, const Vec3& size) {
  TetMesh mesh = tet_box(nx, ny, nz, size);
  const Vec3 cell = size.cwiseQuotient(Vec3(nx, ny, nz));
  const auto place = [&](const Vec3& x) { return Eigen::Vector3i((x.cwiseQuotient(cell).array() + 0.5).cast<int>()); };
  const auto node = [&](const Eigen::Vector3i& at) { return at[0] + (nx + 1) * (at[1] + (ny + 1) * at[2]); };
  for (Tet& t : mesh.tets) {
    Eigen::Vector3i low = place(mesh.nodes[t[0]]);
    for (const Index n : t) low = low.cwiseMin(place(mesh.nodes[n]));
    for (Index& n : t) {
      Eigen::Vector3i at = place(mesh.nodes[n]);
      for (int axis = 0; axis < 3; ++axis)
        if (low[axis] % 2 == 1) at[axis] = 2 * low[axis] + 1 - at[axis];
      n = node(at);
    }
  }
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    if (signed_volume(mesh, static_cast<Index>(e)) < 0.0) std::swap(mesh.tets[e][2], mesh.tets[e][3]);
  return mesh;
}

/// A bar along x of section 1.5 : 1, ten times as long as thick.
inline TetMesh flat_bar() { return mirrored_box(30, 4, 4, {10.0, 1.5, 1.0}); }

/// The tets of a box whose centres pass a test, with the nodes that they use.
inline TetMesh cut(TetMesh mesh, const std::function<bool(const Vec3&)>& test) {
  std::vector<Tet> kept;
  for (const Tet& t : mesh.tets)
    if (test(0.25 * (mesh.nodes[t[0]] + mesh.nodes[t[1]] + mesh.nodes[t[2]] + mesh.nodes[t[3]]))) kept.push_back(t);
  mesh.tets = std::move(kept);
  mesh.tet_region.assign(mesh.tets.size(), 0);
  drop_unused_nodes(mesh);
  return mesh;
}

/// Two arms at right angles in the plane z = 0.
inline TetMesh angle_piece() {
  return cut(tet_box(18, 18, 3, {6.0, 6.0, 1.0}), [](const Vec3& c) { return c.x() < 1.0 || c.y() > 5.0; });
}

/// A handle and two prongs.
inline TetMesh fork_piece() {
  return cut(tet_box(28, 9, 3, {7.0, 2.25, 0.75}),
             [](const Vec3& c) { return c.x() < 2.5 || c.y() < 0.75 || c.y() > 1.5; });
}

/// A thin plate rolled up over 100° about the y axis, from the plane x = 0 on.
inline TetMesh curled_plate(int nx, int ny, int nz) {
  TetMesh mesh = tet_box(nx, ny, nz, {5.0, 2.0, 0.2});
  const double radius = 5.0 / (100.0 * kDegree);
  for (Vec3& x : mesh.nodes) {
    const double angle = x.x() / radius, r = radius - x.z();
    x = {r * std::sin(angle), x.y(), radius - r * std::cos(angle)};
  }
  return mesh;
}

/// The largest turn of a tet by a mode per unit amplitude, rad, from the skew part of the displacement gradient.
struct TetMotion {
  Mat3 gradient;  ///< of the displacement
  Vec3 turn() const {
    return 0.5 *
           Vec3(gradient(2, 1) - gradient(1, 2), gradient(0, 2) - gradient(2, 0), gradient(1, 0) - gradient(0, 1));
  }
};

inline std::array<Vec3, 4> shape_gradients(const TetMesh& mesh, const Tet& t) {
  Eigen::Matrix4d corners;
  for (int a = 0; a < 4; ++a) corners.col(a) << 1.0, mesh.nodes[t[a]];
  const Eigen::Matrix4d inverse = corners.inverse();
  std::array<Vec3, 4> g;
  for (int a = 0; a < 4; ++a) g[a] = inverse.block<1, 3>(a, 1).transpose();
  return g;
}

inline TetMotion motion_of(const SkinnedBody& b, const Tet& t, std::span<const double> z) {
  const auto g = shape_gradients(b.mesh, t);
  Mat3 sum = Mat3::Zero();
  for (int a = 0; a < 4; ++a) sum += b.linear(static_cast<std::size_t>(t[a]), z) * g[a].transpose();
  return {sum};
}

/// Amplitudes of one mode that turn some tet by an angle.
inline std::vector<double> turned_by(const SkinnedBody& b, Index mode, double angle) {
  std::vector<double> z(static_cast<std::size_t>(b.modes()), 0.0);
  z[static_cast<std::size_t>(mode)] = 1.0;
  double most = 0.0;
  for (const Tet& t : b.mesh.tets) most = std::max(most, motion_of(b, t, z).turn().norm());
  z[static_cast<std::size_t>(mode)] = angle / most;
  return z;
}

/// Rotation-strain warping [Huang et al. 2011]: the nodes whose gradients fit exp[Θ_t z](1 + S_t z) best, by a sparse
/// solve for all of them. Fixed nodes stay, or the mass centre does.
inline std::vector<Vec3> rotation_strain(const SkinnedBody& b, std::span<const double> z) {
  const auto n = static_cast<int>(b.mesh.nodes.size());
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(n, 3);
  for (std::size_t e = 0; e < b.mesh.tets.size(); ++e) {
    const Tet& t = b.mesh.tets[e];
    const double volume = signed_volume(b.mesh, static_cast<Index>(e));
    const auto g = shape_gradients(b.mesh, t);
    const TetMotion motion = motion_of(b, t, z);
    const Vec3 turn = motion.turn();
    const Mat3 strain = 0.5 * (motion.gradient + motion.gradient.transpose());
    const Mat3 R = turn.norm() > 0.0 ? Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix()
                                     : Mat3(Mat3::Identity());
    const Mat3 F = R * (Mat3::Identity() + strain);
    for (int a = 0; a < 4; ++a) {
      rhs.row(t[a]) += volume * (F * g[a]).transpose();
      for (int c = 0; c < 4; ++c) entries.emplace_back(t[a], t[c], volume * g[a].dot(g[c]));
    }
  }
  std::vector<Index> held = b.fixed;
  if (held.empty()) held = {0};
  for (const Index v : held) {
    constexpr double kStiff = 1e12;  // a penalty: the error of a held node is 1e-12 of the others' motion
    entries.emplace_back(v, v, kStiff);
    rhs.row(v) += kStiff * b.rest(static_cast<std::size_t>(v)).transpose();
  }
  Eigen::SparseMatrix<double> L(n, n);
  L.setFromTriplets(entries.begin(), entries.end());
  const Eigen::MatrixXd x = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(L).solve(rhs);
  std::vector<Vec3> out;
  for (int v = 0; v < n; ++v) out.emplace_back(x.row(v));
  return out;
}

inline double volume_of(const TetMesh& mesh, std::span<const Vec3> x) {
  double sum = 0.0;
  for (const Tet& t : mesh.tets) sum += (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]]) / 6.0;
  return sum;
}

inline double largest_distance(std::span<const Vec3> a, std::span<const Vec3> b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, (a[i] - b[i]).norm());
  return most;
}

}  // namespace limber::testing
