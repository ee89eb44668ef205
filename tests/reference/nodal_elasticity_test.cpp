// Forces are the energy's derivative, stiffness the forces'; rigid motions cost nothing; the laws agree where strains
// are small; loads meet closed forms.
#include "nodal_elasticity.h"

#include <gtest/gtest.h>

#include <cmath>

#include "closed_forms.h"
#include "constants.h"
#include "dense_fem.h"
#include "reference_world.h"
#include "tet_box.h"

namespace limber {
namespace {

using namespace limber::testing;

const Material kRubber{.youngs_modulus = 1e6, .poisson_ratio = 0.3, .density = 1000.0};
constexpr ElasticLaw kLaws[] = {ElasticLaw::kLinear, ElasticLaw::kStVenantKirchhoff, ElasticLaw::kNeoHookean};

TetMesh small_bar() { return tet_box(3, 1, 1, {0.3, 0.1, 0.1}); }

/// Bent by so many metres and turned, the same each time.
NodeVectors bent(const NodalElasticity& body, double by, double turn) {
  NodeVectors x = body.rest();
  for (Eigen::Index v = 0; v < x.rows(); ++v)
    for (int i = 0; i < 3; ++i) x(v, i) += by * std::sin(1.0 + 7.0 * static_cast<double>(v) + 3.0 * i);
  const Mat3 R = Eigen::AngleAxisd(turn, Vec3(1.0, 2.0, -0.5).normalized()).toRotationMatrix();
  return (x * R.transpose()).rowwise() + Eigen::RowVector3d(0.4, -0.2, 0.1);
}

/// Σ over all numbers of f times a change of places.
double work(const NodeVectors& f, const NodeVectors& d) { return f.cwiseProduct(d).sum(); }

class EveryLaw : public ::testing::TestWithParam<ElasticLaw> {};
INSTANTIATE_TEST_SUITE_P(Laws, EveryLaw, ::testing::ValuesIn(kLaws));

TEST_P(EveryLaw, ForcesAreMinusTheEnergysDerivative) {
  const TetMesh mesh = small_bar();
  const NodalElasticity body(mesh, kRubber, GetParam());
  const NodeVectors x = bent(body, 0.01, 0.8), d = bent(body, 0.02, -0.3) - x;
  constexpr double kStep = 1e-5;
  const double slope = (body.energy(x + kStep * d) - body.energy(x - kStep * d)) / (2.0 * kStep);
  EXPECT_NEAR(-work(body.forces(x), d), slope, 1e-8 * std::abs(slope));
}

TEST_P(EveryLaw, RigidMotionsCostNothingAndNoBodyPushesItself) {
  const TetMesh mesh = small_bar();
  const NodalElasticity body(mesh, kRubber, GetParam());
  const double scale = body.energy(bent(body, 0.01, 0.0));
  EXPECT_NEAR(body.energy(bent(body, 0.0, 2.0)), 0.0, 1e-12 * scale);
  const NodeVectors x = bent(body, 0.01, 0.8), f = body.forces(x);
  Vec3 torque = Vec3::Zero();
  for (Eigen::Index v = 0; v < x.rows(); ++v) torque += Vec3(x.row(v)).cross(Vec3(f.row(v)));
  EXPECT_LE(f.colwise().sum().norm(), 1e-12 * f.norm());
  EXPECT_LE(torque.norm(), 1e-12 * f.norm());
}

TEST(NodalElasticity, StiffnessIsTheForcesDerivative) {
  const TetMesh mesh = small_bar();
  for (const ElasticLaw law : {ElasticLaw::kStVenantKirchhoff, ElasticLaw::kNeoHookean}) {
    const NodalElasticity body(mesh, kRubber, law);
    const NodeVectors x = bent(body, 0.01, 0.8), d = bent(body, 0.02, -0.3) - x;
    constexpr double kStep = 1e-5;
    const NodeVectors slope = (body.forces(x + kStep * d) - body.forces(x - kStep * d)) / (2.0 * kStep);
    EXPECT_LE((body.stiffness(x) * numbers_of(d) + numbers_of(slope)).norm(), 1e-7 * slope.norm());
  }
}

TEST_P(EveryLaw, AtRestItIsTheDenseModelOfLinearElasticity) {
  const TetMesh mesh = small_bar();
  const NodalElasticity body(mesh, kRubber, GetParam());
  const DenseModel dense = dense_model(mesh, std::span(&kRubber, 1), false);
  EXPECT_LE((Eigen::MatrixXd(body.stiffness(body.rest())) - dense.K).norm(), 1e-10 * dense.K.norm());
  for (Eigen::Index a = 0; a < body.nodes(); ++a)
    EXPECT_NEAR(body.mass().row(a).sum(), dense.M.row(3 * a).sum(), 1e-12 * dense.M.norm());
}

TEST(NodalElasticity, LawsDifferBySecondOrderInTheStrain) {
  const TetMesh mesh = small_bar();
  const auto energy = [&](ElasticLaw law, double by) {
    const NodalElasticity body(mesh, kRubber, law);
    return body.energy(bent(body, by, 0.5)) / (by * by);
  };
  for (const ElasticLaw law : {ElasticLaw::kStVenantKirchhoff, ElasticLaw::kNeoHookean}) {
    const double coarse = std::abs(energy(law, 1e-3) / energy(ElasticLaw::kLinear, 1e-3) - 1.0);
    const double fine = std::abs(energy(law, 1e-4) / energy(ElasticLaw::kLinear, 1e-4) - 1.0);
    EXPECT_NEAR(fine / coarse, 0.1, 0.03);
  }
}

/// A clamped beam of 10 : 1 under a load across its end.
NodeVectors tip_load(const TetMesh& mesh, double length, const Vec3& force) {
  const auto tip = nodes_where(mesh, [&](const Vec3& x) { return x.x() > length - 1e-9; });
  NodeVectors f = NodeVectors::Zero(static_cast<Eigen::Index>(mesh.nodes.size()), 3);
  for (const Index v : tip) f.row(v) = force.transpose() / static_cast<double>(tip.size());
  return f;
}

struct BentBeam {
  double across = 0.0, along = 0.0;  // displacement of the tip's mean, over the length
};
BentBeam bent_beam(int cells, ElasticLaw law, double alpha) {
  const double length = 1.0, width = 0.1, second_moment = std::pow(width, 4) / 12.0;
  const Material slim{.youngs_modulus = 1e6, .poisson_ratio = 0.0, .density = 1000.0};
  const TetMesh mesh = tet_box(10 * cells, cells, cells, {length, width, width});
  const auto fixed = nodes_where(mesh, [](const Vec3& x) { return x.x() < 1e-9; });
  const NodalElasticity body(mesh, slim, law, fixed);
  const double force = alpha * slim.youngs_modulus * second_moment / (length * length);
  NodeVectors x = body.rest();
  const int parts = law == ElasticLaw::kLinear ? 1 : 8;
  for (int i = 1; i <= parts; ++i) x = equilibrium(body, x, tip_load(mesh, length, {0.0, 0.0, force * i / parts}));
  const NodeVectors at = tip_load(mesh, length, Vec3::Ones());  // the mean over the tip
  return {at.col(2).dot((x - body.rest()).col(2)), -at.col(0).dot((x - body.rest()).col(0))};
}

TEST(NodalElasticity, TipLoadBendsABeamAsTheoryTells) {
  const double alpha = 0.01, second_moment = 1e-4 / 12.0;
  const double exact = tip_deflection(alpha * 1e6 * second_moment, 1.0, 1e6, 0.0, 0.01, second_moment);
  const double coarse = bent_beam(3, ElasticLaw::kLinear, alpha).across;
  const double fine = bent_beam(6, ElasticLaw::kLinear, alpha).across;
  EXPECT_LT(coarse, fine);
  EXPECT_LT(fine, exact);
  EXPECT_NEAR((exact / coarse - 1.0) / (exact / fine - 1.0), 4.0, 0.4);  // linear tets are too stiff by c h²
}

// A mesh's own stiffness in bending is told by its linear answer, 3 w/L = P L²/(E I): what is left is how it bends far.
TEST(NodalElasticity, LargeBendsFollowTheElastica) {
  const ElasticaTip known = elastica_tip(1.0);
  EXPECT_NEAR(known.across, 0.3017, 1e-4);  // F. Bisshopp and D. Drucker, 1945
  EXPECT_NEAR(known.along, 0.0564, 1e-4);
  const BentBeam linear = bent_beam(3, ElasticLaw::kLinear, 2.0);
  EXPECT_NEAR(linear.along, 0.0, 1e-5 * linear.across);  // a linear beam does not draw back
  const ElasticaTip exact = elastica_tip(3.0 * linear.across);
  ASSERT_GT(exact.across, 0.35);
  for (const ElasticLaw law : {ElasticLaw::kStVenantKirchhoff, ElasticLaw::kNeoHookean}) {
    const BentBeam bent = bent_beam(3, law, 2.0);
    EXPECT_NEAR(bent.across, exact.across, 0.01 * exact.across);
    EXPECT_NEAR(bent.along, exact.along, 0.02 * exact.along);
  }
}

}  // namespace
}  // namespace limber
