// Newton's method with one Jacobian for all iterations, made faster and safer: the secants seen so far stand in for
// what the Jacobian misses (Anderson, J. ACM 12 (1965) 547), and a step that leads away is shortened.
#pragma once

#include <array>
#include <span>
#include <vector>

namespace limber::internal {

class SecantIteration {
 public:
  void begin(std::size_t size);

  /// @param x iterate; the next one on return. @param step Newton's step at x. @param residual what the step is to
  /// make zero, in units of its tolerance
  void advance(std::span<double> x, std::span<const double> step, std::span<const double> residual);

  /// Size of the least residual seen by advance(), and the iterate that has it.
  double best() const { return best_; }
  std::span<const double> best_iterate() const { return best_x_; }

 private:
  static constexpr std::size_t kDepth = 5;

  void remember(std::span<const double> x, std::span<const double> step, std::span<const double> residual);
  std::array<double, kDepth> secant_weights(std::span<const double> residual) const;

  std::vector<double> x_, step_, residual_, best_x_, best_step_;  // of the last iterate, and the best
  std::array<std::vector<double>, kDepth> change_, dresidual_;    // change_: of x and step together
  std::size_t known_ = 0;                                         // secants
  bool first_ = true;
  double best_ = 0.0, length_ = 1.0;
};

}  // namespace limber::internal
