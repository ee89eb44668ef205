#include "equality_rows.h"

#include <algorithm>

namespace limber::internal {

void EqualityRows::factor(std::span<const double> J, std::span<const double> metric,
                          std::span<const double> compliance) {
  const std::size_t m = compliance.size(), n = metric.size();
  wide_metric_.assign(metric.begin(), metric.end());
  for (std::size_t i = 0; i < m; ++i)
    if (compliance[i] > 0.0) wide_metric_.push_back(compliance[i]);
  const std::size_t width = wide_metric_.size();
  if (width == n) {
    least_squares_.factor(J, metric, static_cast<int>(m));
    return;
  }
  wide_J_.assign(m * width, 0.0);
  std::size_t soft = n;
  for (std::size_t i = 0; i < m; ++i) {
    std::copy_n(J.data() + i * n, n, wide_J_.data() + i * width);
    if (compliance[i] > 0.0) wide_J_[i * width + soft++] = 1.0;
  }
  least_squares_.factor(wide_J_, wide_metric_, static_cast<int>(m));
}

}  // namespace limber::internal
