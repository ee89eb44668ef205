// Ten-node tets against closed forms: element matrices, rigid motions, patches of constant and of linear strain,
// frequencies of bars and plates, and how they converge.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>

#include "limber/mesh/ten_node_tet.h"
#include "limber/model/embedding.h"
#include "limber/precompute/bake.h"
#include "limber/precompute/fem.h"
#include "limber/precompute/modal_analysis.h"
#include "tet_box.h"

namespace limber::ten_node {
namespace {

const Material kSteel{.youngs_modulus = 2.07e11, .poisson_ratio = 0.3, .density = 7850.0};
const std::array<Vec3, 4> kTet{Vec3(0.1, -0.2, 0.3), Vec3(1.3, 0.1, 0.2), Vec3(0.4, 0.9, 0.1), Vec3(0.2, 0.3, 1.4)};

TetMesh ten_node_box(const Vec3& size, int nx, int ny, int nz) {
  TetMesh mesh = testing::tet_box(nx, ny, nz, size);
  add_mid_edge_nodes(mesh);
  return mesh;
}

TetMesh one_tet() {
  TetMesh mesh{.nodes = {kTet.begin(), kTet.end()}, .tets = {{0, 1, 2, 3}}, .tet_region = {0}, .regions = {{"0", 0}}};
  add_mid_edge_nodes(mesh);
  return mesh;
}

Eigen::MatrixXd dense(const SparseMatrix& A) {
  Eigen::MatrixXd D = Eigen::MatrixXd::Zero(A.size, A.size);
  for (Index c = 0; c < A.size; ++c)
    for (Index e = A.column_start[c]; e < A.column_start[c + 1]; ++e) D(A.row[e], c) = A.value[e];
  return D;
}

/// A field at all nodes.
template <class Field>
Eigen::VectorXd at_nodes(const TetMesh& mesh, Field&& field) {
  Eigen::VectorXd u(3 * static_cast<Eigen::Index>(mesh.nodes.size()));
  for (std::size_t n = 0; n < mesh.nodes.size(); ++n) u.segment<3>(3 * static_cast<int>(n)) = field(mesh.nodes[n]);
  return u;
}

double lowest_hz(const TetMesh& mesh, const Material& material, MassKind mass, std::span<const Index> fixed = {}) {
  Warnings warnings;
  const ModalAnalysis a =
      analyse_modes(mesh, std::array{material}, fixed, {.modes = 2, .mass = mass, .certify = false}, warnings);
  return std::sqrt(a.eigenvalues[0]) / (2.0 * std::numbers::pi);
}

/// Free bar in bending, 22.373/(2πL²) √(EI/ρA).
double thin_bar_hz(double length, double thickness, const Material& m) {
  return 22.3733 / (2.0 * std::numbers::pi * length * length) * std::sqrt(m.youngs_modulus / (12.0 * m.density)) *
         thickness;
}

TEST(TenNodeStiffness, has_the_six_rigid_motions_and_no_more) {
  const auto K = ten_node_stiffness(kTet, kSteel);
  const Eigen::Map<const Eigen::Matrix<double, 30, 30>> matrix(K.data());
  EXPECT_EQ((matrix - matrix.transpose()).norm(), 0.0);
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix).eigenvalues();
  EXPECT_LT(values.head(6).cwiseAbs().maxCoeff(), 1e-13 * values[29]);
  EXPECT_GT(values[6], 1e-4 * values[29]);
}

// u quadratic, so strain is linear: the energy ½ ∫ ε:D:ε has a closed form in second moments of the tet.
TEST(TenNodeStiffness, holds_the_energy_of_a_linear_strain_exactly) {
  const TetMesh mesh = one_tet();
  const Eigen::MatrixXd K = dense(assemble_stiffness(mesh, std::array{kSteel}));
  // u = (x y, 0, 0): ε_xx = y, 2 ε_xy = x; ½ ∫ (λ + 2μ) y² + μ x² dV.
  const Eigen::VectorXd u = at_nodes(mesh, [](const Vec3& x) { return Vec3(x[0] * x[1], 0.0, 0.0); });
  const VolumeProperties p = volume_properties(mesh);
  const Mat3 about_origin = p.second_moment + p.volume * p.centroid * p.centroid.transpose();
  const double lambda = kSteel.lame_lambda(), mu = kSteel.shear_modulus();
  const double energy = 0.5 * ((lambda + 2.0 * mu) * about_origin(1, 1) + mu * about_origin(0, 0));
  EXPECT_NEAR(0.5 * u.dot(K * u), energy, 1e-13 * energy);
}

TEST(TenNodeMass, integrates_quadratic_fields_exactly_and_lumps_to_the_whole) {
  const TetMesh mesh = one_tet();
  const double mass = kSteel.density * volume_properties(mesh).volume;
  const Eigen::MatrixXd M = dense(assemble_mass(mesh, std::array{kSteel}, MassKind::kConsistent));
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(10);
  EXPECT_NEAR(ones.dot(M * ones), mass, 1e-14 * mass);
  // ∫ L₀² L₁² dV = 6V 2! 2!/7! = V/210; N of edge 01 is 4 L₀ L₁.
  EXPECT_NEAR(M(4, 4), 16.0 * mass / 210.0, 1e-14 * mass);
  // ∫ x (x y) with x and x y at the nodes: degree 3, exact for a consistent mass.
  Eigen::VectorXd x(10), moments = Eigen::VectorXd::Zero(3);
  for (int axis = 0; axis < 3; ++axis) {
    for (int n = 0; n < 10; ++n) x[n] = mesh.nodes[static_cast<std::size_t>(n)][axis];
    moments[axis] = ones.dot(M * x);
  }
  EXPECT_LT((moments - mass * volume_properties(mesh).centroid).norm(), 1e-13 * mass);
  const Eigen::MatrixXd lumped = dense(assemble_mass(mesh, std::array{kSteel}, MassKind::kLumped));
  EXPECT_NEAR(lumped.trace(), mass, 1e-14 * mass);
  EXPECT_NEAR(lumped(0, 0), mass / 36.0, 1e-14 * mass);
  EXPECT_NEAR(lumped(9, 9), 4.0 * mass / 27.0, 1e-14 * mass);
}

TEST(TenNodeForces, are_the_assembled_product) {
  const TetMesh mesh = ten_node_box({0.3, 0.2, 0.1}, 2, 1, 1);
  const Eigen::VectorXd u = at_nodes(mesh, [](const Vec3& x) { return Vec3(std::sin(9.0 * x[1]), x[0] * x[2], x[1]); });
  Eigen::VectorXd f(u.size());
  elastic_forces(mesh, std::array{kSteel}, {u.data(), u.data() + u.size()}, {f.data(), f.data() + f.size()});
  const Eigen::VectorXd assembled = dense(assemble_stiffness(mesh, std::array{kSteel})) * u;
  EXPECT_LT((f - assembled).norm(), 1e-13 * f.norm());
}

TEST(TenNodeModes, leave_six_rigid_motions_and_are_certified) {
  Warnings warnings;
  const TetMesh mesh = ten_node_box({0.3, 0.04, 0.01}, 6, 1, 1);
  for (const MassKind mass : {MassKind::kLumped, MassKind::kConsistent}) {
    const ModalAnalysis a = analyse_modes(mesh, std::array{kSteel}, {}, {.modes = 12, .mass = mass}, warnings);
    EXPECT_TRUE(a.accuracy.certified);
    EXPECT_EQ(a.freedom.rigid_modes, 6);
    EXPECT_EQ(a.freedom.mechanisms, 0);
    EXPECT_LT(a.accuracy.orthogonality_max, 1e-12);
    EXPECT_LE(a.accuracy.residual_max, a.accuracy.residual_bound);
  }
  EXPECT_TRUE(warnings.empty());
}

// Euler and Bernoulli leave out shear and rotary inertia, 0.5 % here.
TEST(TenNodeModes, of_a_thin_bar_ring_as_beam_theory_says_with_one_cell_across) {
  const Vec3 size(0.3, 0.04, 0.01);
  const double theory = thin_bar_hz(0.3, 0.01, kSteel);
  const double quadratic = lowest_hz(ten_node_box(size, 15, 2, 1), kSteel, MassKind::kConsistent);
  const double linear = lowest_hz(testing::tet_box(15, 2, 1, size), kSteel, MassKind::kConsistent);
  EXPECT_NEAR(quadratic, theory, 0.01 * theory);
  EXPECT_GT(linear, 1.5 * theory);
}

// Axial waves of a bar at ν = 0, cos πx/L: error of λ of order 4, of linear elements of order 2.
TEST(TenNodeModes, of_a_bar_converge_with_order_four) {
  const double length = 0.1;
  const Material m{.youngs_modulus = 2e11, .poisson_ratio = 0.0, .density = 8000.0};
  const double exact = std::pow(std::numbers::pi / length, 2) * m.youngs_modulus / m.density;
  const auto error = [&](int cells) {
    const TetMesh mesh = ten_node_box({length, 0.02, 0.02}, cells, 1, 1);
    Warnings warnings;
    const ModalAnalysis a = analyse_modes(mesh, std::array{m}, {},
                                          {.modes = 12, .mass = MassKind::kConsistent, .certify = false}, warnings);
    const Eigen::VectorXd wave =
        at_nodes(mesh, [&](const Vec3& x) { return Vec3(std::cos(std::numbers::pi * x[0] / length), 0.0, 0.0); });
    double best = 0.0, eigenvalue = 0.0;
    for (std::size_t i = 0; i < a.eigenvalues.size(); ++i) {
      const Eigen::Map<const Eigen::VectorXd> shape(a.shapes.data() + i * static_cast<std::size_t>(wave.size()),
                                                    wave.size());
      const double alike = std::abs(shape.dot(wave)) / shape.norm();
      if (alike > best) best = alike, eigenvalue = a.eigenvalues[i];
    }
    return eigenvalue / exact - 1.0;
  };
  const double coarse = error(2), fine = error(4);
  EXPECT_GT(fine, 0.0) << "from above";
  EXPECT_LT(fine, 1e-3);
  EXPECT_NEAR(std::log2(coarse / fine), 4.0, 0.5);
}

TEST(TenNodeShares, are_exact_for_quadratic_fields_inside_and_linear_ones_everywhere) {
  const TetMesh mesh = ten_node_box({0.3, 0.2, 0.1}, 2, 1, 1);
  const std::vector<Vec3> points{{0.11, 0.07, 0.03}, {0.29, 0.01, 0.09}, {0.31, 0.1, 0.05}, {0.1, 0.21, -0.01}};
  const Embedding embedding = embed(points, mesh);
  EXPECT_EQ(embedding.outside, 2);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const NodeShares at = node_shares(mesh, embedding.vertices[i]);
    ASSERT_EQ(at.count, 10u);
    Vec3 place = Vec3::Zero();
    double product = 0.0;
    for (std::size_t c = 0; c < 10; ++c) {
      const Vec3& x = mesh.nodes[static_cast<std::size_t>(at.node[c])];
      place += at.share[c] * x;
      product += at.share[c] * x[0] * x[1];
    }
    EXPECT_LT((place - points[i]).norm(), 1e-15);
    if (i < 2) {
      EXPECT_NEAR(product, points[i][0] * points[i][1], 1e-15);
    }
  }
}

BakeInput clamped_bar() { return {.name = "bar", .mesh = testing::tet_box(15, 2, 1, {0.3, 0.04, 0.01})}; }

BakeOptions clamped(const Material& material, Elements elements) {
  BakeOptions options{.materials = {{"*", material}}, .fixed = {NodesInBox{{-1.0, -1.0, -1.0}, {0.0, 1.0, 1.0}}}};
  options.elements = elements;
  options.analysis = {.modes = 4, .mass = MassKind::kConsistent};
  return options;
}

// Euler and Bernoulli: 1.8751²/(2πL²) √(EI/ρA); the clamp stops the width from bending the other way, 1 % here.
double cantilever_hz(const Material& m) {
  return 1.8751 * 1.8751 / (2.0 * std::numbers::pi * 0.09) * 0.01 * std::sqrt(m.youngs_modulus / (12.0 * m.density));
}

TEST(TenNodeBake, holds_the_middles_of_held_edges) {
  Warnings warnings;
  const BakeResult result = bake(clamped_bar(), clamped(kSteel, Elements::kQuadratic), warnings);
  const BodyReport& report = result.bodies[0];
  EXPECT_EQ(report.mesh.nodes_per_tet, 10);
  EXPECT_EQ(report.freedom.motion, FrameMotion::kKinematic);
  EXPECT_EQ(report.freedom.zero_modes(), 0);
  EXPECT_NEAR(report.modes.frequencies_hz[0], cantilever_hz(kSteel), 0.02 * cantilever_hz(kSteel));
  const ModalSurface& drawn = result.asset.bodies[0]->data().render;
  int held = 0;
  for (Index v = 0; v < drawn.vertices(); ++v) {
    if (drawn.rest[static_cast<std::size_t>(v)][0] + result.asset.bodies[0]->data().origin_in_input[0] > 1e-9) continue;
    ++held;
    for (Index m = 0; m < 4; ++m) EXPECT_EQ(drawn.basis.shape(v, m).norm(), 0.0f);
  }
  EXPECT_EQ(held, 15) << "six corners and nine middles of the clamped face";
}

TEST(TenNodeBake, answers_loads_and_stores_all_nodes_and_a_skin) {
  BakeInput input{.name = "bar", .mesh = testing::tet_box(6, 1, 1, {0.3, 0.04, 0.04})};
  BakeOptions options = clamped(kSteel, Elements::kQuadratic);
  options.volume_block = true;
  options.skin.make = true;
  options.residual.surface = true;
  options.residual.patches = {{Vec3(0.3, 0.02, 0.02), 0.03}};
  Warnings warnings;
  const BakeResult result = bake(input, options, warnings);
  const ModalModelData& data = result.asset.bodies[0]->data();
  EXPECT_EQ(data.volume_block->tets.size(), 8 * input.mesh.tets.size());
  EXPECT_EQ(static_cast<Index>(data.volume_block->rest.size()), result.bodies[0].mesh.nodes);
  EXPECT_EQ(result.bodies[0].residual.modes, 6);
  ASSERT_TRUE(data.residual_compliance && data.skin);
  EXPECT_EQ(data.skin->volume.size(), data.volume_block->rest.size());
  EXPECT_EQ(data.skin->render.size(), data.render.rest.size());
  EXPECT_TRUE(warnings.empty()) << warnings[0];
}

TEST(TenNodeBake, drops_middles_where_linear_elements_are_asked_for) {
  BakeInput input = clamped_bar();
  Warnings warnings;
  const double linear = bake(input, clamped(kSteel, Elements::kLinear), warnings).bodies[0].modes.frequencies_hz[0];
  add_mid_edge_nodes(input.mesh);
  EXPECT_EQ(bake(input, clamped(kSteel, Elements::kLinear), warnings).bodies[0].modes.frequencies_hz[0], linear);
  EXPECT_EQ(bake(input, clamped(kSteel, Elements::kAsGiven), warnings).bodies[0].mesh.nodes_per_tet, 10);
}

// Bending asks for no change of volume, and E alone counts.
TEST(TenNodeBake, hardly_locks_near_one_half_where_linear_elements_do_and_say_so) {
  const BakeInput free{.name = "bar", .mesh = testing::tet_box(15, 2, 1, {0.3, 0.04, 0.02})};
  const auto hz = [&](double nu, Elements elements, Warnings& warnings) {
    BakeOptions options = clamped({.youngs_modulus = 5e6, .poisson_ratio = nu, .density = 1100.0}, elements);
    options.fixed.clear();
    return bake(free, options, warnings).bodies[0].modes.frequencies_hz[0];
  };
  Warnings quiet, told;
  const double at_049 = hz(0.49, Elements::kQuadratic, quiet), at_0499 = hz(0.499, Elements::kQuadratic, quiet);
  EXPECT_NEAR(at_0499, at_049, 0.01 * at_049);
  EXPECT_TRUE(quiet.empty());
  EXPECT_GT(hz(0.499, Elements::kLinear, told), 2.0 * at_0499);
  ASSERT_EQ(told.size(), 1u);
  EXPECT_NE(told[0].find("lock near nu = 1/2"), std::string::npos) << told[0];
}

}  // namespace
}  // namespace limber::ten_node
