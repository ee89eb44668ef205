#include "solver/secant_pairs.h"

namespace limber::internal {
namespace {

constexpr std::size_t kMost = 8;  // each costs four passes over its numbers; more are older, and tell less

}  // namespace

void SecantPairs::clear() {
  pairs_.clear();
  sy_.resize(0, 0), yz_.resize(0, 0);
}

void SecantPairs::add(const VectorX& s, const VectorX& y, const VectorX& z) {
  if (!(s.dot(y) > 0.0) || !(y.dot(z) > 0.0)) return;
  if (pairs_.size() == kMost) {
    pairs_.erase(pairs_.begin());
    const auto kept = static_cast<Eigen::Index>(pairs_.size());
    sy_ = sy_.bottomRightCorner(kept, kept).eval();
    yz_ = yz_.bottomRightCorner(kept, kept).eval();
  }
  pairs_.push_back({s, y, z});
  const auto n = static_cast<Eigen::Index>(pairs_.size());
  sy_.conservativeResize(n, n), yz_.conservativeResize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Pair& pair = pairs_[static_cast<std::size_t>(i)];
    sy_(n - 1, i) = 0.0;
    sy_(i, n - 1) = pair.s.dot(y);
    yz_(i, n - 1) = yz_(n - 1, i) = pair.y.dot(z);
  }
}

void SecantPairs::correct(const VectorX& r, VectorX& u) const {
  if (pairs_.empty()) return;
  const auto n = static_cast<Eigen::Index>(pairs_.size());
  VectorX along(n), b(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Pair& pair = pairs_[static_cast<std::size_t>(i)];
    along[i] = pair.s.dot(r), b[i] = pair.z.dot(r);
  }
  const auto R = sy_.triangularView<Eigen::Upper>();
  const VectorX q = R.solve(along);
  const VectorX p = R.transpose().solve(VectorX(sy_.diagonal().cwiseProduct(q) + yz_ * q - b));
  for (Eigen::Index i = 0; i < n; ++i) {
    const Pair& pair = pairs_[static_cast<std::size_t>(i)];
    u -= p[i] * pair.s - q[i] * pair.z;
  }
}

}  // namespace limber::internal
