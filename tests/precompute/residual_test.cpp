#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dense_fem.h"
#include "dense_modes.h"
#include "limber/core/error.h"
#include "rubber_box.h"

namespace limber {
namespace {

using limber::testing::bake_box;
using limber::testing::box;
using limber::testing::dense_model;
using limber::testing::DenseModel;
using limber::testing::kBoxSize;
using limber::testing::kRubber;
using limber::testing::nodes_where;
using limber::testing::rubber;
using limber::testing::tet_box;

constexpr double kSingle = 2e-6;  // shapes and compliances are stored in single precision

std::shared_ptr<const ModalModel> baked_box(const BakeOptions& options, BodyReport* report = nullptr) {
  const BakeResult r = bake_box(options);
  if (report) *report = r.bodies[0];
  return r.asset.bodies[0];
}

/// Σ w wᵀ/λ over all elastic modes, from a dense generalised eigenproblem: another way to K⁺.
Eigen::MatrixXd dense_compliance(std::span<const Index> fixed) {
  const DenseModel model = dense_model(box(), std::vector<Material>{kRubber}, true);
  std::vector<Index> free;
  for (Index dof = 0; dof < model.K.rows(); ++dof)
    if (std::find(fixed.begin(), fixed.end(), dof / 3) == fixed.end()) free.push_back(dof);
  const testing::DenseModes modes = testing::dense_modes(model.K(free, free), model.M(free, free));
  const Eigen::Index rigid = fixed.empty() ? 6 : 0;
  const Eigen::MatrixXd W = modes.W.rightCols(modes.W.cols() - rigid);
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(model.K.rows(), model.K.cols());
  all(free, free) = W * modes.lambda.tail(W.cols()).cwiseInverse().asDiagonal() * W.transpose();
  return all;
}

/// Nodes in the order of the boundary surface's vertices, found by their places.
std::vector<Index> node_of_vertex(const ModalModel& model) {
  const TetMesh mesh = box();
  std::vector<Index> nodes;
  for (const Vec3f& x : model.collision().rest) {
    const Vec3 at = x.cast<double>() + model.data().origin_in_input;
    nodes.push_back(nodes_where(mesh, [&](const Vec3& n) { return (n - at).norm() < 1e-6; }).at(0));
  }
  return nodes;
}

Mat3 static_compliance_of_modes(const ModalModel& model, Index a, Index b) {
  Mat3 sum = Mat3::Zero();
  const ModalBasis& basis = model.collision().basis;
  for (Index i = 0; i < model.modes(); ++i)
    sum += basis.shape(a, i).cast<double>() * basis.shape(b, i).cast<double>().transpose() /
           model.data().eigenvalues[static_cast<std::size_t>(i)];
  return sum;
}

class ResidualOfBox : public ::testing::TestWithParam<bool> {
 protected:
  bool held() const { return GetParam(); }
  BakeOptions options(int modes) const {
    BakeOptions o = rubber(modes);
    if (held()) o.fixed = {NodesInBox{{-1e-9, -1.0, -1.0}, {1e-9, 1.0, 1.0}}};
    return o;
  }
  std::vector<Index> fixed() const {
    return held() ? nodes_where(box(), [](const Vec3& x) { return x.x() < 1e-9; }) : std::vector<Index>{};
  }
};
INSTANTIATE_TEST_SUITE_P(FreeAndHeld, ResidualOfBox, ::testing::Bool());

TEST_P(ResidualOfBox, KeptModesAndResidualTogetherAreTheWholeCompliance) {
  BakeOptions o = options(10);
  o.residual.surface = true;
  BodyReport report;
  const auto model = baked_box(o, &report);
  ASSERT_TRUE(model->data().residual_compliance);
  const ResidualCompliance& residual = *model->data().residual_compliance;
  ASSERT_EQ(residual.form(), ResidualCompliance::Form::kFull);
  EXPECT_EQ(report.residual.bytes, residual.values().size_bytes());
  const Eigen::MatrixXd all = dense_compliance(fixed());
  const std::vector<Index> node = node_of_vertex(*model);
  for (Index a = 0; a < residual.vertices(); ++a)
    for (Index b = 0; b < residual.vertices(); ++b) {
      const Mat3 sum = static_compliance_of_modes(*model, a, b) + residual.block(a, b);
      const Mat3 exact = all.block<3, 3>(3 * node[a], 3 * node[b]);
      ASSERT_LE((sum - exact).norm(), kSingle * all.diagonal().maxCoeff()) << a << " " << b;
    }
}

TEST_P(ResidualOfBox, LocalFormIsTheDiagonalOfTheFullOne) {
  BakeOptions o = options(10);
  o.residual.surface = true;
  const auto full = baked_box(o);
  o.residual.max_full_bytes = 0.0;
  const auto local = baked_box(o);
  const ResidualCompliance& r = *local->data().residual_compliance;
  ASSERT_EQ(r.form(), ResidualCompliance::Form::kLocal);
  EXPECT_EQ(r.values().size(), 9u * static_cast<std::size_t>(r.vertices()));
  for (Index v = 0; v < r.vertices(); ++v) EXPECT_EQ(r.block(v, v), full->data().residual_compliance->block(v, v));
  EXPECT_EQ(r.block(0, 1), Mat3::Zero());
}

TEST_P(ResidualOfBox, ResidualModesMakeChosenNodesExactWhateverIsKept) {
  BakeOptions o = options(5);
  const std::vector<Index> chosen =
      nodes_where(box(), [](const Vec3& x) { return x.x() > kBoxSize.x() - 1e-9 && x.z() < 1e-9; });
  o.residual.nodes = {NodesByIndex{chosen}};
  o.volume_block = true;
  BodyReport report;
  const auto model = baked_box(o, &report);
  EXPECT_EQ(report.residual.modes, static_cast<Index>(3 * chosen.size()));
  ASSERT_EQ(model->modes(), 5 + report.residual.modes);

  const Eigen::MatrixXd all = dense_compliance(fixed());
  const std::vector<Index> node = node_of_vertex(*model);
  const auto is_chosen = [&](Index v) { return std::find(chosen.begin(), chosen.end(), node[v]) != chosen.end(); };
  for (Index a = 0; a < model->collision().vertices(); ++a)
    for (Index b = 0; b < model->collision().vertices(); ++b) {
      if (!is_chosen(b)) continue;
      const Mat3 exact = all.block<3, 3>(3 * node[a], 3 * node[b]);
      EXPECT_LE((static_compliance_of_modes(*model, a, b) - exact).norm(), kSingle * all.diagonal().maxCoeff());
    }
}

TEST_P(ResidualOfBox, ResidualModesAreMassNormalisedWithTheKeptOnes) {
  BakeOptions o = options(5);
  o.residual.nodes = {NodesByIndex{{0, 35}}};
  o.volume_block = true;
  const auto model = baked_box(o);
  const ModalVolume& volume = *model->data().volume_block;
  for (Index i = 0; i < model->modes(); ++i)
    for (Index j = 0; j < model->modes(); ++j) {
      double product = 0.0;
      for (Index n = 0; n < volume.basis.vertices(); ++n)
        product += volume.basis.shape(n, i).cast<double>().dot(volume.mass_times_basis.shape(n, j).cast<double>());
      EXPECT_NEAR(product, i == j ? 1.0 : 0.0, kSingle) << i << " " << j;
    }
}

TEST(Residual, OfFixedNodesIsNothingAndTold) {
  BakeOptions o = rubber(5);
  o.fixed = {NodesByIndex{{0, 1, 2, 3}}};
  o.residual.nodes = {NodesByIndex{{2, 3}}};
  Warnings warnings;
  const BakeResult r = bake({.name = "box", .mesh = box()}, o, warnings);
  EXPECT_EQ(r.bodies[0].residual.modes, 0);
  EXPECT_THAT(warnings, ::testing::Contains(::testing::HasSubstr("2 of the 2 chosen nodes are fixed")));
}

TEST(Residual, OfABodyWithAllItsModesIsNothing) {
  BakeOptions o = rubber(1000);
  o.residual.surface = true;
  o.limits.max_modes = 250;
  const auto model = baked_box(o);
  const double largest = dense_compliance({}).diagonal().maxCoeff();
  for (const float value : model->data().residual_compliance->values()) EXPECT_LE(std::abs(value), kSingle * largest);
}

TEST(Residual, CoarserCollisionSurfaceKeepsToTheBoundary) {
  BakeOptions o = rubber(4);
  Warnings warnings;
  o.collision_triangles = 100;
  const BakeResult r = bake({.name = "box", .mesh = tet_box(8, 6, 4, kBoxSize)}, o, warnings);
  const ModalModel& model = *r.asset.bodies[0];
  ASSERT_TRUE(model.data().collision);
  EXPECT_LE(model.collision().triangles.size(), 100u);
  EXPECT_LT(model.collision().triangles.size(), model.render().triangles.size());
  EXPECT_LE(r.bodies[0].surfaces.collision_error, 1e-6);  // a box is flat: nothing moves
  for (const Vec3f& x : model.collision().rest) {
    const Vec3 beyond = x.cast<double>().cwiseAbs() - 0.5 * kBoxSize;
    EXPECT_NEAR(beyond.maxCoeff(), 0.0, 1e-7);
  }
}

}  // namespace
}  // namespace limber
