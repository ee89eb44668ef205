#include "error_measures.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "limber/core/error.h"

namespace limber::testing {
namespace {

constexpr int kFitRounds = 50;

double mean_square(const NodeVectors& d, const Eigen::VectorXd& masses) {
  return masses.dot(d.rowwise().squaredNorm()) / masses.sum();
}

/// Distance of a from b, its best rigid motion taken away.
NodeVectors shape_difference(const NodeVectors& a, const NodeVectors& b, const Eigen::VectorXd& masses) {
  const BestRotation best = best_rotation(a, masses.asDiagonal() * a, b, masses);
  const NodeVectors aligned = (a.rowwise() - best.from.transpose()) * best.rotation.transpose();
  return (aligned.rowwise() + best.to.transpose()) - b;
}

double largest_row(const NodeVectors& d) { return d.rowwise().norm().maxCoeff(); }

double over(double error, double scale) { return scale > 0.0 ? error / scale : (error > 0.0 ? HUGE_VAL : 0.0); }

/// Samples of the reference from one of `seen` to the next.
std::size_t samples_between(const NodeMotion& seen, const NodeMotion& reference) {
  if (seen.empty() || reference.empty() || (seen.size() == 1) != (reference.size() == 1) ||
      (seen.size() > 1 && (reference.size() - 1) % (seen.size() - 1) != 0))
    throw InvalidArgument("motion_error: " + std::to_string(seen.size()) + " samples against " +
                          std::to_string(reference.size()) + ", expected as many, or n times as many after the first");
  return seen.size() == 1 ? 1 : (reference.size() - 1) / (seen.size() - 1);
}

}  // namespace

MotionError motion_error(const NodeMotion& seen, const NodeMotion& reference, const Eigen::VectorXd& masses) {
  const std::size_t each = samples_between(seen, reference);
  MotionError error;
  double vertex_peak = 0.0;
  for (const NodeVectors& x : reference) {
    if (x.rows() != masses.size()) throw InvalidArgument("motion_error: as many nodes as masses are expected");
    const NodeVectors moved = x - reference.front();
    error.peak = std::max(error.peak, std::sqrt(mean_square(moved, masses)));
    vertex_peak = std::max(vertex_peak, largest_row(moved));
    const double bent = mean_square(shape_difference(x, reference.front(), masses), masses);
    error.shape_peak = std::max(error.shape_peak, std::sqrt(bent));
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (seen[i].rows() != masses.size())
      throw InvalidArgument("motion_error: sample " + std::to_string(i) + " has another number of nodes than masses");
    const NodeVectors off = seen[i] - reference[each * i];
    const double square = mean_square(off, masses);
    error.mean += square;
    error.worst = std::max(error.worst, std::sqrt(square));
    error.worst_vertex = std::max(error.worst_vertex, largest_row(off));
    error.shape_mean += mean_square(shape_difference(seen[i], reference[each * i], masses), masses);
  }
  const auto samples = static_cast<double>(seen.size());
  error.mean = over(std::sqrt(error.mean / samples), error.peak);
  error.worst = over(error.worst, error.peak);
  error.worst_vertex = over(error.worst_vertex, vertex_peak);
  error.shape_mean = over(std::sqrt(error.shape_mean / samples), error.shape_peak);
  return error;
}

double node_error(const NodeMotion& seen, const NodeMotion& reference, Index node) {
  const std::size_t each = samples_between(seen, reference);
  double off = 0.0, peak = 0.0;
  for (std::size_t i = 0; i < seen.size(); ++i)
    off = std::max(off, (seen[i].row(node) - reference[each * i].row(node)).norm());
  for (const NodeVectors& x : reference) peak = std::max(peak, (x.row(node) - reference.front().row(node)).norm());
  return over(off, peak);
}

ModeFit fit_mode(std::span<const double> times, std::span<const double> z, double guess) {
  if (times.size() != z.size() || times.size() < 4)
    throw InvalidArgument("fit_mode: " + std::to_string(z.size()) + " values at " + std::to_string(times.size()) +
                          " times, expected as many, four or more");
  // Gauss–Newton in (a, b, ω).
  const auto rows = static_cast<Eigen::Index>(times.size());
  const Eigen::Map<const Eigen::ArrayXd> t(times.data(), rows);
  const Eigen::Map<const Eigen::VectorXd> values(z.data(), rows);
  double omega = guess, a = 0.0, b = 0.0;
  for (int round = 0; round < kFitRounds; ++round) {
    Eigen::MatrixXd J(rows, 3);
    J.col(0) = (omega * t).cos();
    J.col(1) = (omega * t).sin();
    const Eigen::Vector2d ab = J.leftCols(2).colPivHouseholderQr().solve(values);
    a = ab[0], b = ab[1];
    J.col(2) = (t * (b * (omega * t).cos() - a * (omega * t).sin())).matrix();
    const Eigen::Vector3d change = J.colPivHouseholderQr().solve(values - J.leftCols(2) * ab);
    omega += change[2];
    if (std::abs(change[2]) <= 1e-15 * omega) break;
  }
  return {.omega = omega, .phase = std::atan2(b, a), .amplitude = std::hypot(a, b)};
}

Quantiles quantiles(std::vector<double> seconds) {
  if (seconds.empty()) return {};
  std::sort(seconds.begin(), seconds.end());
  const auto at = [&](double share) {
    return seconds[static_cast<std::size_t>(share * static_cast<double>(seconds.size() - 1))];
  };
  return {.median = at(0.5), .p99 = at(0.99)};
}

double log_slope(std::span<const double> x, std::span<const double> y) {
  double sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  const auto n = static_cast<double>(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double a = std::log(x[i]), b = std::log(y[i]);
    sx += a, sy += b, sxx += a * a, sxy += a * b;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

}  // namespace limber::testing
