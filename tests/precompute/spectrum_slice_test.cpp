#include "limber/precompute/spectrum_slice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/precompute/modal_analysis.h"
#include "rubber_box.h"

namespace limber {
namespace {

using ::testing::HasSubstr;
using testing::kSteel;
using testing::tet_box;

double hz_of(double eigenvalue) { return std::sqrt(eigenvalue) / (2.0 * std::numbers::pi); }

/// A bar of square section, whose bending modes come in pairs, with a spectrum of 40 modes to cut.
struct SlicedBar : ::testing::Test {
  const TetMesh mesh = tet_box(12, 3, 3, {0.5, 0.1, 0.1});
  const ModalAnalysis whole = analyse({.modes = 40});
  std::vector<SpectrumSlice> slices;

  ModalAnalysis analyse(const ModalAnalysisOptions& options) const {
    Warnings warnings;
    return analyse_modes(mesh, std::span(&kSteel, 1), {}, options, warnings);
  }
  SpectrumSlice slice(double low, double high, int of) const {
    Warnings warnings;
    SpectrumSlice made = analyse_slice(mesh, std::span(&kSteel, 1), {}, {low, high}, {}, warnings);
    made.of = of;
    return made;
  }
  /// A frequency in the widest gap among the modes from `first` on.
  double cut_after(std::size_t first, std::size_t last) const {
    const std::vector<double>& lambda = whole.eigenvalues;
    std::size_t best = first;
    for (std::size_t i = first; i < last; ++i)
      if (lambda[i + 1] / lambda[i] > lambda[best + 1] / lambda[best]) best = i;
    return hz_of(0.5 * (lambda[best] + lambda[best + 1]));
  }

  SlicedBar() {
    const double a = cut_after(8, 14), b = cut_after(22, 28), c = cut_after(34, 39);
    for (const auto& [low, high] : {std::pair{b, c}, {0.0, a}, {a, b}}) slices.push_back(slice(low, high, 3));
  }

  std::string message_of_join() const {
    try {
      analyse({.modes = 40, .slices = slices});
    } catch (const ComputationError& e) {
      return e.what();
    }
    return "";
  }
};

/// The largest sine of an angle between modes of the one and the span of those of the other.
double angle(const ModalAnalysis& a, const ModalAnalysis& b, std::size_t modes) {
  const auto rows = static_cast<Eigen::Index>(a.shapes.size() / a.eigenvalues.size());
  const auto k = static_cast<Eigen::Index>(modes);
  const Eigen::Map<const Eigen::MatrixXd> W(a.shapes.data(), rows, k), V(b.shapes.data(), rows, k),
      MV(b.mass_times_shapes.data(), rows, k), MW(a.mass_times_shapes.data(), rows, k);
  const Eigen::MatrixXd outside = W - V * (MV.transpose() * W), mass_outside = MW - MV * (V.transpose() * MW);
  return std::sqrt(outside.cwiseProduct(mass_outside).colwise().sum().maxCoeff());
}

TEST_F(SlicedBar, SlicesInAnyOrderJoinToTheModesOfOneAnalysis) {
  const ModalAnalysis joined = analyse({.modes = 100, .slices = slices});
  const auto count = joined.eigenvalues.size();
  ASSERT_GE(count, 34u);
  ASSERT_LE(count, 40u);
  EXPECT_EQ(static_cast<int>(count), slices[0].below_high - 6);  // none between 0 Hz and the last end is missing
  EXPECT_TRUE(joined.accuracy.certified);
  EXPECT_LT(joined.accuracy.orthogonality_max, 1e-12);
  EXPECT_LE(joined.accuracy.residual_max, joined.accuracy.residual_bound);
  for (std::size_t i = 0; i < count; ++i)
    EXPECT_NEAR(joined.eigenvalues[i], whole.eigenvalues[i], 1e-11 * whole.eigenvalues[i]) << i;
  EXPECT_LT(angle(joined, whole, count), 1e-8);
}

TEST_F(SlicedBar, FewerModesAreTheLowest) {
  const ModalAnalysis joined = analyse({.modes = 9, .slices = slices});
  EXPECT_GE(joined.eigenvalues.size(), 9u);
  EXPECT_LE(joined.eigenvalues.size(), 10u);  // a pair at the end is completed
  EXPECT_NEAR(joined.eigenvalues[8], whole.eigenvalues[8], 1e-11 * whole.eigenvalues[8]);
}

TEST_F(SlicedBar, AMissingSliceIsNamed) {
  const SpectrumSlice first = slices[1], middle = slices[2], last = slices[0];
  slices = {first, last};
  EXPECT_THAT(message_of_join(), HasSubstr(" Hz is missing"));
  slices = {middle, last};
  EXPECT_THAT(message_of_join(), HasSubstr("slices: 0 to "));
  slices = {first, middle};
  EXPECT_THAT(message_of_join(), HasSubstr("2 of 3 are here"));
}

TEST_F(SlicedBar, OverlapsCountsThatDifferAndOtherBodiesAreRefused) {
  const std::vector<SpectrumSlice> good = slices;
  slices.push_back(slice(0.9 * good[2].band.low, good[2].band.high, 3));
  EXPECT_THAT(message_of_join(), HasSubstr("is in two of them"));
  slices = good;
  ++slices[2].below_low;
  EXPECT_THAT(message_of_join(), HasSubstr("the next"));
  slices = good;
  for (SpectrumSlice& s : slices) s.problem[0] = s.problem[0] == '0' ? '1' : '0';
  EXPECT_THAT(message_of_join(), HasSubstr("none of 3 is of this body"));
}

TEST_F(SlicedBar, AFileGivesTheSameBitsBackAndDamageIsTold) {
  const std::string bytes = slice_bytes(slices);
  const auto path = std::filesystem::path(::testing::TempDir()) / ("limber_slices_" + std::to_string(::getpid()));
  write_file(path, bytes);
  const std::vector<SpectrumSlice> read = read_slices(path);
  ASSERT_EQ(read.size(), slices.size());
  EXPECT_EQ(slice_bytes(read), bytes);
  EXPECT_EQ(read[1].shapes, slices[1].shapes);
  const auto refused = [&](const std::string& damaged) -> std::string {
    write_file(path, damaged);
    try {
      read_slices(path);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(refused(bytes.substr(0, bytes.size() - 8)), HasSubstr("was cut off"));
  EXPECT_THAT(refused(bytes.substr(0, 30)), HasSubstr("is no file of slices"));
  std::string flipped = bytes;
  flipped[bytes.size() - 5] = static_cast<char>(flipped[bytes.size() - 5] ^ 1);
  EXPECT_THAT(refused(flipped), HasSubstr("damaged"));
  std::filesystem::remove(path);
}

TEST(SpectrumSlice, ABandWithoutModesIsEmptyAndBandsAreChecked) {
  const TetMesh mesh = tet_box(2, 1, 1, {0.5, 0.1, 0.1});
  Warnings warnings;
  const SpectrumSlice none = analyse_slice(mesh, std::span(&kSteel, 1), {}, {0.0, 1.0}, {}, warnings);
  EXPECT_EQ(none.modes(), 0);
  EXPECT_EQ(none.below_high, 6);
  EXPECT_THROW((FrequencyBand{.low = 2.0, .high = 1.0}.validate()), InvalidArgument);
  EXPECT_THROW((FrequencyBand{.low = -1.0, .high = 1.0}.validate()), InvalidArgument);
}

}  // namespace
}  // namespace limber
