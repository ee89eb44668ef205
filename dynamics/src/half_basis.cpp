#include "limber/dynamics/half_basis.h"

#include <algorithm>
#include <cmath>

#include "reconstruct_kernels.h"

namespace limber {
namespace {

constexpr int kLargestExponent = 15;  // numbers lie below 2¹⁵; the format ends at 65,504

/// The power of two that takes a mode's largest component to just below 2¹⁵; 1 for a mode that moves nothing.
float scale_of(const ModalBasis& basis, Index mode) {
  float largest = 0.0f;
  for (Index v = 0; v < basis.vertices(); ++v) largest = std::max(largest, basis.shape(v, mode).cwiseAbs().maxCoeff());
  if (!(largest > 0.0f)) return 1.0f;
  int exponent = 0;
  std::frexp(largest, &exponent);  // largest < 2^exponent
  return std::ldexp(1.0f, exponent - kLargestExponent);
}

}  // namespace

HalfBasis::HalfBasis(const ModalBasis& basis)
    : vertices_(basis.vertices()),
      modes_(basis.modes()),
      data_(static_cast<std::size_t>(basis.tiles()) * static_cast<std::size_t>(basis.modes()) * 3 * ModalBasis::kTile),
      errors_(static_cast<std::size_t>(basis.modes()), 0.0) {
  constexpr std::size_t kBlock = 3 * ModalBasis::kTile;
  for (Index m = 0; m < modes_; ++m) scales_.push_back(scale_of(basis, m));
  for (Index t = 0; t < basis.tiles(); ++t)
    for (Index m = 0; m < modes_; ++m) {
      const auto mode = static_cast<std::size_t>(m);
      const std::size_t first = (static_cast<std::size_t>(t) * static_cast<std::size_t>(modes_) + mode) * kBlock;
      float scaled[kBlock], back[kBlock];
      const float* shapes = basis.tile(t) + mode * kBlock;
      for (std::size_t i = 0; i < kBlock; ++i) scaled[i] = shapes[i] / scales_[mode];
      internal::to_half(scaled, data_.data() + first, back, kBlock);
      for (std::size_t lane = 0; lane < ModalBasis::kTile; ++lane) {
        double squared = 0.0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const std::size_t i = axis * ModalBasis::kTile + lane;
          squared += std::pow(
              static_cast<double>(scales_[mode]) * (static_cast<double>(back[i]) - static_cast<double>(scaled[i])), 2);
        }
        errors_[mode] = std::max(errors_[mode], std::sqrt(squared));
      }
    }
}

}  // namespace limber
