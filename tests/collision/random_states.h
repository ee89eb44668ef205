// Bodies and states for the tests of collision/, from a fixed seed.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "asked.h"
#include "limber/core/rigid_transform.h"

namespace limber::testing {

/// How many random cases a test looks at; the CTest entries of label `campaign` ask for more.
inline int trials(int usual) { return asked("LIMBER_TRIALS", all_or_tenth(usual)); }

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  /// Uniform over [low, high); the same numbers with every standard library.
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) / 4294967296.0);
  }
  Vec3 vector(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }
  /// Amplitudes that share `size` about as evenly as energy would: higher modes move less.
  std::vector<double> amplitudes(Index modes, double size) {
    std::vector<double> z;
    for (Index i = 0; i < modes; ++i) z.push_back(uniform(-size, size) / (1.0 + 0.6 * i));
    return z;
  }
  RigidTransform pose(double distance) { return {quaternion_from_rotation_vector(vector(3.0)), vector(distance)}; }
  Index index(Index count) { return static_cast<Index>(engine_() % static_cast<unsigned>(count)); }

 private:
  std::mt19937 engine_;
};

}  // namespace limber::testing
