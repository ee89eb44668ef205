/// @file error_measures.h
/// How far one motion is from another: what `limber-benchmark error` tells.
///
/// A motion is the places of a body's nodes at times that both share; |d|² = Σ m_v |d_v|² / Σ m_v with the nodes'
/// masses. Errors are relative to the reference's peak, max_t |x_ref(t) − x_ref(0)|, and those of the shape to the
/// largest change of shape, max_t min_R |R x_ref(t) − x_ref(0)|, over rigid motions R.
#pragma once

#include <span>
#include <vector>

#include "nodal_elasticity.h"

namespace limber::testing {

/// Places of the nodes of one body, sample by sample.
using NodeMotion = std::vector<NodeVectors>;

struct MotionError {
  double mean = 0.0;          ///< root mean square over time
  double worst = 0.0;         ///< of a sample
  double worst_vertex = 0.0;  ///< of any vertex at any time, |d_v| over the peak of the worst vertex of the reference
  double shape_mean = 0.0;    ///< root mean square over time, best rigid alignment of each sample taken away
  double peak = 0.0, shape_peak = 0.0;  ///< m, of the reference
};
/// @param reference may have n times as many samples after the first, of which each n-th is compared; its peaks are
/// those of all @param masses kg, of the nodes @throws InvalidArgument if the motions do not fit so, or are empty
MotionError motion_error(const NodeMotion& seen, const NodeMotion& reference, const Eigen::VectorXd& masses);

/// The same: max_t |d_v| of one node over max_t |x_ref,v(t) − x_ref,v(0)|.
double node_error(const NodeMotion& seen, const NodeMotion& reference, Index node);

/// A mode that rings: z(t) = a cos(ωt) + b sin(ωt), fitted in the least-squares sense near a frequency that is known
/// well enough to count turns.
struct ModeFit {
  double omega = 0.0;  ///< rad/s
  double phase = 0.0;  ///< rad, of z at time 0: atan2(b, a)
  double amplitude = 0.0;
};
/// @param guess rad/s, off by less than 1/(2T), T the time from first to last @throws InvalidArgument for less than
/// four samples
ModeFit fit_mode(std::span<const double> times, std::span<const double> z, double guess);

/// Median and 99th percentile of times, s.
struct Quantiles {
  double median = 0.0, p99 = 0.0;
};
Quantiles quantiles(std::vector<double> seconds);

/// Slope of log y against log x in the least-squares sense: the order of an error.
double log_slope(std::span<const double> x, std::span<const double> y);

}  // namespace limber::testing
