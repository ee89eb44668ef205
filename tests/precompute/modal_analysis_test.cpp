#include "limber/precompute/modal_analysis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dense_fem.h"
#include "limber/core/error.h"
#include "tet_box.h"

namespace limber {
namespace {

using testing::tet_box;

const Material kSteel{.youngs_modulus = 200e9, .poisson_ratio = 0.3, .density = 7850.0};

TEST(ModalAnalysis, FreeBoxAgreesWithADenseSolver) {
  const TetMesh mesh = tet_box(5, 4, 3, {0.5, 0.3, 0.2});
  for (const bool lumped : {true, false}) {
    Warnings warnings;
    const auto found =
        analyse_modes(mesh, std::span(&kSteel, 1), {},
                      {.modes = 30, .mass = lumped ? MassKind::kLumped : MassKind::kConsistent}, warnings);
    const auto reference = testing::dense_eigenvalues(testing::dense_model(mesh, std::span(&kSteel, 1), lumped));
    ASSERT_GE(found.eigenvalues.size(), 30u);
    EXPECT_TRUE(found.certified);
    EXPECT_EQ(found.rigid_modes, 6);
    EXPECT_EQ(found.mechanisms, 0);
    EXPECT_THAT(warnings, ::testing::IsEmpty());
    for (std::size_t i = 0; i < found.eigenvalues.size(); ++i)
      EXPECT_NEAR(found.eigenvalues[i], reference[6 + i], 1e-10 * reference[6 + i]) << i;
    EXPECT_LT(found.orthogonality_max, 1e-13);
    EXPECT_LT(found.residual_max, 1e-10);
    EXPECT_LT(found.backward_error_max, 1e-14);
  }
}

}  // namespace
}  // namespace limber
