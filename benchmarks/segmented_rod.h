// A slender rod in a plane, by another route than parts and joints.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>

#include "limber/core/types.h"

namespace limber {

/// Stiff segments with masses at their ends and springs E I between their directions, which become an elastica that
/// does not stretch. Its start goes where it is led, with a direction that it is clamped to or free to turn; its end
/// may be kept on the x axis. By the rule of Runge and Kutta.
struct SegmentedRod {
  using Numbers = Eigen::VectorXd;
  struct Led {
    Eigen::Vector2d acceleration = Eigen::Vector2d::Zero();
    double direction = 0.0;  // rad, where it is clamped
  };

  SegmentedRod(int segments, double length, double mass_per_length, double EI)
      : count(segments), l(length / segments), spring(EI / l), masses(Numbers::Constant(count, mass_per_length * l)) {
    masses[count - 1] *= 0.5;
    angle = rate = Numbers::Zero(count);
  }

  Numbers acceleration(const Numbers& at, const Numbers& speed, const Led& led) const {
    Eigen::MatrixXd M(count, count);
    Numbers along = at.array().cos(), across = at.array().sin(), beyond(count), sides(count);
    double sum = 0.0;
    for (int i = count; i-- > 0;) beyond[i] = sum += masses[i];
    for (int i = 0; i < count; ++i) {
      sides[i] = l * beyond[i] * (across[i] * led.acceleration.x() - along[i] * led.acceleration.y());
      for (int j = 0; j < count; ++j) {
        const double both = l * l * beyond[std::max(i, j)];
        M(i, j) = both * (along[i] * along[j] + across[i] * across[j]);
        sides[i] += both * speed[j] * speed[j] * (across[j] * along[i] - along[j] * across[i]);
      }
      if (i > 0) sides[i] -= spring * (at[i] - at[i - 1]), sides[i - 1] += spring * (at[i] - at[i - 1]);
    }
    if (clamped) sides[0] -= 2.0 * spring * (at[0] - led.direction);
    const Eigen::LLT<Eigen::MatrixXd> factor(M);
    Numbers found = factor.solve(sides);
    if (!on_axis) return found;
    const Numbers moved = factor.solve(along);
    const double off = led.acceleration.y() / l + along.dot(found) - across.dot(speed.cwiseAbs2());
    return found - off / along.dot(moved) * moved;
  }
  /// @param led of a time
  template <class Leads>
  void step(double t, double h, const Leads& led) {
    const Led start = led(t), middle = led(t + 0.5 * h), end = led(t + h);
    const Numbers a1 = acceleration(angle, rate, start), v2 = rate + 0.5 * h * a1,
                  a2 = acceleration(angle + 0.5 * h * rate, v2, middle), v3 = rate + 0.5 * h * a2,
                  a3 = acceleration(angle + 0.5 * h * v2, v3, middle), v4 = rate + h * a3,
                  a4 = acceleration(angle + h * v3, v4, end);
    angle += h / 6.0 * (rate + 2.0 * (v2 + v3) + v4);
    rate += h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4);
  }
  /// From its start to the end of so many segments.
  Vec3 to(int segments) const {
    return l * Vec3(angle.head(segments).array().cos().sum(), angle.head(segments).array().sin().sum(), 0.0);
  }

  int count;
  double l, spring;
  Numbers masses, angle, rate;  // of the segments' ends; rad, rad/s
  bool clamped = false, on_axis = false;
};

}  // namespace limber
