#include "limber/precompute/modal_analysis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dense_eigenvalues.h"
#include "limber/core/error.h"
#include "rubber_box.h"

namespace limber {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kSteel;
using testing::nodes_where;
using testing::tet_box;

/// With one material everywhere and no remarks.
ModalAnalysis analyse(const TetMesh& mesh, const ModalAnalysisOptions& options, std::span<const Index> fixed = {},
                      const Material& material = kSteel) {
  Warnings warnings;
  const std::vector<Material> materials(mesh.regions.size(), material);
  return analyse_modes(mesh, materials, fixed, options, warnings);
}

/// The promises that hold for every analysis.
void expect_sound(const ModalAnalysis& found) {
  EXPECT_TRUE(found.accuracy.certified);
  EXPECT_LT(found.accuracy.orthogonality_max, 1e-9);
  EXPECT_LE(found.accuracy.residual_max, found.accuracy.residual_bound);
  EXPECT_LT(found.accuracy.backward_error_max, 1e-12);
  EXPECT_TRUE(std::is_sorted(found.eigenvalues.begin(), found.eigenvalues.end()));
}

/// How far two sets of shapes are apart, relative to the largest entry.
double difference(const std::vector<double>& a, const std::vector<double>& b) {
  EXPECT_EQ(a.size(), b.size());
  double difference = 0.0, largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference = std::max(difference, std::abs(a[i] - b[i]));
    largest = std::max(largest, std::abs(a[i]));
  }
  return difference / largest;
}

// The dense solver's error is round-off of its largest eigenvalue, some 1e4 times the lowest here.
constexpr double kDenseError = 1e-10;

TEST(ModalAnalysis, FreeBoxAgreesWithADenseSolver) {
  const TetMesh mesh = tet_box(5, 4, 3, {0.5, 0.3, 0.2});
  for (const bool lumped : {true, false}) {
    Warnings warnings;
    const auto found =
        analyse_modes(mesh, std::span(&kSteel, 1), {},
                      {.modes = 30, .mass = lumped ? MassKind::kLumped : MassKind::kConsistent}, warnings);
    const auto reference = testing::dense_eigenvalues(testing::dense_model(mesh, std::span(&kSteel, 1), lumped));
    ASSERT_GE(found.eigenvalues.size(), 30u);
    expect_sound(found);
    EXPECT_EQ(found.freedom.rigid_modes, 6);
    EXPECT_EQ(found.freedom.mechanisms, 0);
    EXPECT_EQ(found.freedom.motion, FrameMotion::kFree);
    EXPECT_THAT(warnings, IsEmpty());
    for (std::size_t i = 0; i < found.eigenvalues.size(); ++i)
      EXPECT_NEAR(found.eigenvalues[i], reference[6 + i], kDenseError * reference[6 + i]) << i;
  }
}

TEST(ModalAnalysis, ShapesAreOrthonormalInADenseMassMatrixAndOrthogonalToRigidMotions) {
  const TetMesh mesh = tet_box(4, 3, 3, {0.5, 0.3, 0.2});
  const auto found = analyse(mesh, {.modes = 12, .mass = MassKind::kConsistent});
  const auto M = testing::dense_model(mesh, std::span(&kSteel, 1), false).M;
  const auto k = static_cast<Eigen::Index>(found.eigenvalues.size());
  const Eigen::Map<const Eigen::MatrixXd> W(found.shapes.data(), M.rows(), k);
  const Eigen::Map<const Eigen::MatrixXd> MW(found.mass_times_shapes.data(), M.rows(), k);
  EXPECT_LT((W.transpose() * M * W - Eigen::MatrixXd::Identity(k, k)).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((M * W - MW).norm(), 1e-12 * MW.norm());
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::VectorXd shift(M.rows()), turn(M.rows());
    for (std::size_t i = 0; i < mesh.nodes.size(); ++i) {
      shift.segment<3>(3 * i) = Vec3::Unit(axis);
      turn.segment<3>(3 * i) = Vec3::Unit(axis).cross(mesh.nodes[i]);
    }
    EXPECT_LT((MW.transpose() * shift).norm(), 1e-12 * MW.norm() * shift.norm());
    EXPECT_LT((MW.transpose() * turn).norm(), 1e-12 * MW.norm() * turn.norm());
  }
}

TEST(ModalAnalysis, HeldBodiesAgreeWithADenseSolverAndKeepTheFreedomThatTheirNodesLeave) {
  const TetMesh mesh = tet_box(4, 3, 2, {0.4, 0.3, 0.2});
  struct Case {
    std::vector<Index> fixed;
    FrameMotion motion;
    int rigid;
  };
  const auto edge = nodes_where(mesh, [](const Vec3& x) { return x.y() == 0.0 && x.z() == 0.0; });
  const auto face = nodes_where(mesh, [](const Vec3& x) { return x.x() == 0.0; });
  for (const Case& c :
       {Case{{7}, FrameMotion::kPoint, 3}, Case{{7, 41}, FrameMotion::kLine, 1}, Case{edge, FrameMotion::kLine, 1},
        Case{{0, 3, 41}, FrameMotion::kKinematic, 0}, Case{face, FrameMotion::kKinematic, 0}}) {
    const auto found = analyse(mesh, {.modes = 20}, c.fixed);
    const auto reference = testing::dense_eigenvalues(testing::dense_model(mesh, std::span(&kSteel, 1), true), c.fixed);
    expect_sound(found);
    EXPECT_EQ(found.freedom.motion, c.motion);
    EXPECT_EQ(found.freedom.rigid_modes, c.rigid);
    EXPECT_EQ(found.freedom.mechanisms, 0);
    for (std::size_t i = 0; i < 20; ++i)
      EXPECT_NEAR(found.eigenvalues[i], reference[c.rigid + i], kDenseError * reference[c.rigid + i]) << i;
    for (const Index node : c.fixed)
      for (std::size_t entry = 3 * node; entry < found.shapes.size(); entry += 3 * mesh.nodes.size())
        EXPECT_EQ(found.shapes[entry], 0.0);
  }
}

TEST(ModalAnalysis, BodyHungFromTwoNodesTurnsAboutTheLineThroughThem) {
  const TetMesh mesh = tet_box(3, 1.0);
  const std::array<Index, 2> fixed{0, 63};  // opposite corners
  const auto found = analyse(mesh, {.modes = 5}, fixed);
  EXPECT_NEAR(std::abs(found.freedom.line_axis.dot(Vec3::Ones().normalized())), 1.0, 1e-12);
  EXPECT_LT((found.freedom.pivot - mesh.nodes[0]).cross(found.freedom.line_axis).norm(), 1e-12);
}

TEST(ModalAnalysis, OneTetHasItsSixModesAndSaysThatThereAreNoMore) {
  TetMesh mesh;
  mesh.nodes = {{0, 0, 0}, {1, 0.1, 0}, {0.2, 0.9, 0}, {0.1, 0.3, 0.8}};
  mesh.tets = {{0, 1, 2, 3}};
  mesh.tet_region = {0};
  mesh.regions = {{.name = "*"}};
  Warnings warnings;
  const auto found = analyse_modes(mesh, std::span(&kSteel, 1), {}, {.modes = 64}, warnings);
  const auto reference = testing::dense_eigenvalues(testing::dense_model(mesh, std::span(&kSteel, 1), true));
  expect_sound(found);
  ASSERT_EQ(found.eigenvalues.size(), 6u);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(found.eigenvalues[i], reference[6 + i], kDenseError * reference[6 + i]) << i;
  EXPECT_THAT(warnings, ::testing::ElementsAre(HasSubstr("64 modes were asked for")));
}

TEST(ModalAnalysis, BodyWithOneFreeNodeHasThreeModesAndAFixedOneHasNone) {
  const TetMesh mesh = tet_box(1, 1.0);
  const auto all_but_one = nodes_where(mesh, [](const Vec3& x) { return x.norm() > 0.0; });
  const auto three = analyse(mesh, {.modes = 3}, all_but_one);
  expect_sound(three);
  EXPECT_EQ(three.eigenvalues.size(), 3u);
  const auto all = nodes_where(mesh, [](const Vec3&) { return true; });
  Warnings warnings;
  const auto none = analyse_modes(mesh, std::span(&kSteel, 1), all, {}, warnings);
  EXPECT_EQ(none.freedom.motion, FrameMotion::kKinematic);
  EXPECT_THAT(none.eigenvalues, IsEmpty());
  EXPECT_THAT(none.shapes, IsEmpty());
  EXPECT_THAT(warnings, ::testing::ElementsAre(HasSubstr("every node is fixed")));
}

TEST(ModalAnalysis, NoModesCanBeAskedFor) {
  const auto found = analyse(tet_box(2, 1.0), {.modes = 0});
  EXPECT_EQ(found.freedom.rigid_modes, 6);
  EXPECT_THAT(found.eigenvalues, IsEmpty());
  EXPECT_TRUE(found.accuracy.certified);
}

// Mechanisms ---------------------------------------------------------------------------------------------------------

/// A box of its own nodes, moved, added to a mesh; nodes at the same place are joined.
void add_box(TetMesh& mesh, const Vec3& corner, int cells = 1) {
  const TetMesh box = tet_box(cells, 1.0);
  std::vector<Index> number;
  for (const Vec3& local : box.nodes) {
    const Vec3 x = local + corner;
    const auto same =
        std::find_if(mesh.nodes.begin(), mesh.nodes.end(), [&](const Vec3& y) { return (x - y).norm() < 1e-9; });
    number.push_back(static_cast<Index>(same - mesh.nodes.begin()));
    if (same == mesh.nodes.end()) mesh.nodes.push_back(x);
  }
  for (const Tet& t : box.tets) {
    mesh.tets.push_back({number[t[0]], number[t[1]], number[t[2]], number[t[3]]});
    mesh.tet_region.push_back(0);
  }
  mesh.regions = {{.name = "*"}};
}

TEST(Mechanism, ZeroModesAreThoseOfADenseSolverHoweverThePartsAreJoined) {
  struct Case {
    const char* what;
    std::vector<Vec3> corners;
    std::vector<Index> fixed;
    int rigid, mechanisms;
  };
  const std::vector<Case> cases{{"one node", {{0, 0, 0}, {1, 1, 1}}, {}, 6, 3},
                                {"one edge", {{0, 0, 0}, {1, 1, 0}}, {}, 6, 1},
                                {"one face", {{0, 0, 0}, {1, 0, 0}}, {}, 6, 0},
                                {"a chain of three by nodes", {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, {}, 6, 6},
                                {"a chain by an edge and a node", {{0, 0, 0}, {1, 1, 0}, {2, 2, 1}}, {}, 6, 4},
                                {"a ring of three edges", {{0, 0, 0}, {1, 1, 0}, {0, 1, 1}}, {}, 6, 0},
                                {"a ring of four by edges", {{0, 0, 0}, {1, 1, 0}, {2, 0, 0}, {1, -1, 0}}, {}, 6, 1},
                                {"one node, fixed", {{0, 0, 0}, {1, 1, 1}}, {7}, 3, 3},
                                {"one node, one box held by a far corner", {{0, 0, 0}, {1, 1, 1}}, {0}, 3, 3},
                                {"one edge, one box clamped", {{0, 0, 0}, {1, 1, 0}}, {0, 1, 2, 3, 4, 5, 6, 7}, 0, 1}};
  for (const Case& c : cases) {
    TetMesh mesh;
    for (const Vec3& corner : c.corners) add_box(mesh, corner);
    Warnings warnings;
    const auto found = analyse_modes(mesh, std::span(&kSteel, 1), c.fixed, {.modes = 6}, warnings);
    const auto reference = testing::dense_eigenvalues(testing::dense_model(mesh, std::span(&kSteel, 1), true), c.fixed);
    const double first_elastic = 1e-6 * reference.maxCoeff();  // the ratio is below 1e4 for these few tets
    const int zeros = static_cast<int>((reference.array() < first_elastic).count());
    EXPECT_EQ(found.freedom.rigid_modes + found.freedom.mechanisms, zeros) << c.what;
    EXPECT_EQ(found.freedom.rigid_modes, c.rigid) << c.what;
    expect_sound(found);
    for (int i = 0; i < found.freedom.mechanisms; ++i) EXPECT_EQ(found.eigenvalues[i], 0.0) << c.what;
    for (int i = 0; i < 6; ++i)
      EXPECT_NEAR(found.eigenvalues[found.freedom.mechanisms + i], reference[zeros + i],
                  kDenseError * reference[zeros + i])
          << c.what;
    EXPECT_EQ(warnings.size(), found.freedom.mechanisms > 0 ? 1u : 0u) << c.what;
    EXPECT_EQ(found.freedom.mechanisms, c.mechanisms) << c.what;
  }
}

TEST(Mechanism, ShapesDeformNothingAndAreOrthogonalToTheRigidOnes) {
  TetMesh mesh;
  add_box(mesh, {0, 0, 0}, 2);
  add_box(mesh, {1, 1, 1}, 3);
  const auto found = analyse(mesh, {.modes = 4});
  ASSERT_EQ(found.freedom.mechanisms, 3);
  const auto dense = testing::dense_model(mesh, std::span(&kSteel, 1), true);
  const Eigen::Map<const Eigen::MatrixXd> W(found.shapes.data(), dense.K.rows(), 7);
  const auto hinges = W.leftCols(3);
  EXPECT_LT((dense.K * hinges).norm(), 1e-14 * dense.K.norm() * hinges.norm());
  EXPECT_LT((W.transpose() * dense.M * W - Eigen::MatrixXd::Identity(7, 7)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Mechanism, HundredsOfLoosePiecesAreRefusedWithAdvice) {
  TetMesh mesh;
  for (int i = 0; i < 320; ++i) add_box(mesh, Vec3::Constant(i));
  Warnings warnings;
  try {
    analyse_modes(mesh, std::span(&kSteel, 1), {}, {}, warnings);
    FAIL();
  } catch (const ComputationError& e) {
    EXPECT_THAT(e.what(), HasSubstr("remesh"));
  }
}

// Scales and extremes ------------------------------------------------------------------------------------------------

TEST(Scale, StiffnessAndSizeOnlyScaleTheFrequencies) {
  const auto lambda_unit = [](double E, double size) { return E / kSteel.density / (size * size); };
  const auto reference = analyse(tet_box(8, 3, 3, {1.0, 0.3, 0.25}), {.modes = 20, .mass = MassKind::kConsistent});
  for (const double E : {1e2, 1e7, 1e12})
    for (const double size : {1e-3, 1.0, 1e3}) {
      const Material m{.youngs_modulus = E, .poisson_ratio = 0.3, .density = kSteel.density};
      const auto found =
          analyse(tet_box(8, 3, 3, size * Vec3(1.0, 0.3, 0.25)), {.modes = 20, .mass = MassKind::kConsistent}, {}, m);
      expect_sound(found);
      for (std::size_t i = 0; i < 20; ++i)
        EXPECT_NEAR(found.eigenvalues[i] / lambda_unit(E, size) / (reference.eigenvalues[i] / lambda_unit(200e9, 1.0)),
                    1.0, 1e-9)
            << "E " << E << " size " << size << " mode " << i;
    }
}

TEST(Scale, SoftPartOnAStiffOneKeepsItsDigitsAtAnyRatio) {
  // In the limit the stiff half is rigid and every low frequency goes with √E of the soft half; the rest is of the
  // order of the ratio.
  TetMesh mesh = tet_box(16, 3, 3, {1.0, 0.15, 0.15});
  mesh.regions.push_back({.name = "soft"});
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    mesh.tet_region[e] = (mesh.nodes[mesh.tets[e][0]].x() + mesh.nodes[mesh.tets[e][1]].x() +
                          mesh.nodes[mesh.tets[e][2]].x() + mesh.nodes[mesh.tets[e][3]].x()) > 2.0;
  std::vector<std::vector<double>> per_stiffness;
  for (const double ratio : {1e-9, 1e-10, 1e-11}) {
    const std::array materials{kSteel,
                               Material{.youngs_modulus = ratio * 200e9, .poisson_ratio = 0.3, .density = 1000.0}};
    Warnings warnings;
    const auto found = analyse_modes(mesh, materials, {}, {.modes = 10}, warnings);
    expect_sound(found);
    EXPECT_EQ(found.freedom.rigid_modes, 6);
    per_stiffness.emplace_back();
    for (const double lambda : found.eigenvalues) per_stiffness.back().push_back(lambda / ratio);
  }
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_NEAR(per_stiffness[1][i] / per_stiffness[0][i], 1.0, 2e-8) << i;
    EXPECT_NEAR(per_stiffness[2][i] / per_stiffness[1][i], 1.0, 2e-9) << i;
  }
}

TEST(Scale, RodAThousandTimesLongerThanThickFollowsBeamTheory) {
  // Free–free Euler beam: cos β cosh β = 1, β₁ = 4.730040744862704, β₂ = 7.853204624095838, f ~ β². The elements are
  // too stiff in bending by the same factor in both modes, so the ratio is that of the beam but for its own mesh error,
  // of order (β₂/cells)².
  const int cells = 400;
  const auto found = analyse(tet_box(cells, 1, 1, {1000.0, 1.0, 0.6}), {.modes = 8, .mass = MassKind::kConsistent});
  expect_sound(found);
  EXPECT_EQ(found.freedom.rigid_modes, 6);
  // In the mode's thin plane the second bending mode is not the next in line: look for it.
  const double wanted = std::pow(7.853204624095838 / 4.730040744862704, 4);
  double nearest = 0.0;
  for (const double lambda : found.eigenvalues)
    if (std::abs(lambda / found.eigenvalues[0] - wanted) < std::abs(nearest - wanted))
      nearest = lambda / found.eigenvalues[0];
  EXPECT_NEAR(nearest / wanted, 1.0, 4.0 * std::pow(7.8532 / cells, 2));
}

// Multiple eigenvalues and repetition
// ----------------------------------------------------------------------------------

TEST(Degenerate, ShapesAreTheSameForAnyStartVectorAndBitsForTheSame) {
  const TetMesh mesh = tet_box(5, 1.0);  // the cube's threefold axis makes pairs
  const auto first = analyse(mesh, {.modes = 20});
  const auto again = analyse(mesh, {.modes = 20});
  EXPECT_EQ(first.shapes, again.shapes);
  EXPECT_EQ(first.eigenvalues, again.eigenvalues);
  int pairs = 0;
  for (std::size_t i = 1; i < first.eigenvalues.size(); ++i) pairs += first.eigenvalues[i] == first.eigenvalues[i - 1];
  EXPECT_GE(pairs, 4);
  for (const std::uint64_t seed : {1u, 2u}) {
    const auto other = analyse(mesh, {.modes = 20, .seed = seed});
    EXPECT_NE(first.shapes, other.shapes);  // the start vector did differ
    EXPECT_LT(difference(first.shapes, other.shapes), 1e-6);
  }
}

TEST(Degenerate, AClusterIsNeverCut) {
  const TetMesh mesh = tet_box(5, 1.0);
  const auto all = analyse(mesh, {.modes = 24});
  for (int modes = 1; modes < 16; ++modes) {
    const auto found = analyse(mesh, {.modes = modes});
    const std::size_t k = found.eigenvalues.size();
    EXPECT_GE(k, static_cast<std::size_t>(modes));
    EXPECT_GT(all.eigenvalues[k] / all.eigenvalues[k - 1], 1.0 + 1e-6);
    if (k > static_cast<std::size_t>(modes)) {
      EXPECT_LT(all.eigenvalues[modes] / all.eigenvalues[modes - 1], 1.0 + 1e-6);
    }
  }
}

TEST(ModalAnalysis, RefusesWhatIsNoSingleBody) {
  Warnings warnings;
  TetMesh two;
  add_box(two, {0, 0, 0});
  add_box(two, {5, 0, 0});
  const auto analyse_it = [&](const TetMesh& mesh, std::span<const Index> fixed, ModalAnalysisOptions options) {
    analyse_modes(mesh, std::span(&kSteel, 1), fixed, options, warnings);
  };
  EXPECT_THROW(analyse_it(two, {}, {}), InvalidArgument);
  TetMesh orphan = tet_box(1, 1.0);
  orphan.nodes.emplace_back(2, 2, 2);
  EXPECT_THROW(analyse_it(orphan, {}, {}), InvalidArgument);
  const std::array<Index, 1> outside{8};
  EXPECT_THROW(analyse_it(tet_box(1, 1.0), outside, {}), InvalidArgument);
  EXPECT_THROW(analyse_it(tet_box(1, 1.0), {}, {.modes = -1}), InvalidArgument);
}

}  // namespace
}  // namespace limber
