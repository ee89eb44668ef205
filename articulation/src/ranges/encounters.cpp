#include "ranges/encounters.h"

#include <algorithm>
#include <cmath>

#include "constants.h"

namespace limber::internal {
namespace {

using Kind = MotionPath::Kind;

/// A body as a path sees it.
struct Extent {
  Index body = 0;
  OrbitBox around{};                   ///< of its orbits
  double low = 0.0, high = 0.0;        ///< along the axis
  double bearing = 0.0, sector = kPi;  ///< about it: all lies within bearing ± sector
};

/// The angles about the axis that a box in path coordinates covers.
void set_sector(const Vec3& centre, const Vec3& half, Extent& out) {
  if (std::abs(centre.y()) <= half.y() && std::abs(centre.z()) <= half.z()) return;
  out.bearing = std::atan2(centre.z(), centre.y());
  out.sector = 0.0;
  for (const double y : {-1.0, 1.0})
    for (const double z : {-1.0, 1.0}) {
      const double angle = std::atan2(centre.z() + z * half.z(), centre.y() + y * half.y());
      out.sector = std::max(out.sector, std::abs(wrapped(angle - out.bearing)));
    }
}

std::vector<Extent> extents(const PathFrame& frame, std::span<const OrbitBody> bodies, double margin) {
  std::vector<Extent> out;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b].box.isEmpty()) continue;
    Extent e{.body = static_cast<Index>(b), .around = frame.box_around(bodies[b].box)};
    e.around.grow(margin);
    const auto [centre, half] = frame.box_of(bodies[b].box);
    e.low = centre.x() - half.x() - margin, e.high = centre.x() + half.x() + margin;
    if (frame.kind() == Kind::kRotation) set_sector(centre, half + Vec3::Constant(margin), e);
    out.push_back(e);
  }
  return out;
}

/// The place along a line, or about an axis, at which one meets the other.
std::pair<double, double> first_meetings(const PathFrame& frame, const Extent& moving, const Extent& fixed) {
  if (frame.kind() == Kind::kRotation) {
    const double apart = fixed.bearing - moving.bearing, reach = fixed.sector + moving.sector;
    if (reach >= kPi || std::abs(wrapped(apart)) <= reach) return {0.0, 0.0};
    const auto around = [](double angle) { return angle - 2.0 * kPi * std::floor(angle / (2.0 * kPi)); };
    return {around(apart - reach), around(-apart - reach)};
  }
  const double per_length = frame.kind() == Kind::kScrew ? 1.0 / frame.pitch() : 1.0;
  const auto [low, high] =
      std::minmax({per_length * (fixed.low - moving.high), per_length * (fixed.high - moving.low)});
  return {high < 0.0 ? kInfinity : std::max(low, 0.0), low > 0.0 ? kInfinity : std::max(-high, 0.0)};
}

}  // namespace

Encounters::Encounters(const PathFrame& frame, std::span<const OrbitBody> moving, std::span<const OrbitBody> fixed,
                       double margin) {
  const std::vector<Extent> fixed_extents = extents(frame, fixed, margin);
  for (const Extent& m : extents(frame, moving, margin))
    for (const Extent& f : fixed_extents) {
      if (!m.around.overlaps(f.around)) continue;
      const auto [rising, falling] = first_meetings(frame, m, f);
      pairs_.push_back({m.body, f.body, rising, falling});
    }
}

Encounters::Nearest Encounters::nearest(std::size_t pairs) const {
  /// How far to go in one sense for that many pairs beyond those that meet as read.
  const auto horizon = [&](double Pair::*sense) {
    std::vector<double> starts;
    for (const Pair& p : pairs_)
      if (p.*sense > 0.0 && p.*sense < kInfinity) starts.push_back(p.*sense);
    if (starts.empty()) return 0.0;
    const auto last = starts.begin() + static_cast<std::ptrdiff_t>(std::min(pairs, starts.size())) - 1;
    std::nth_element(starts.begin(), last, starts.end());
    return *last;
  };
  const double rising = horizon(&Pair::rising), falling = horizon(&Pair::falling);
  Nearest out;
  out.low = -kInfinity, out.high = kInfinity;
  for (const Pair& p : pairs_)
    if (p.rising <= rising || p.falling <= falling) out.moving.push_back(p.moving), out.fixed.push_back(p.fixed);
  for (auto* bodies : {&out.moving, &out.fixed}) {
    std::sort(bodies->begin(), bodies->end());
    bodies->erase(std::unique(bodies->begin(), bodies->end()), bodies->end());
  }
  const auto has = [](const std::vector<Index>& bodies, Index body) {
    return std::binary_search(bodies.begin(), bodies.end(), body);
  };
  for (const Pair& p : pairs_)
    if (!has(out.moving, p.moving) || !has(out.fixed, p.fixed))
      out.high = std::min(out.high, p.rising), out.low = std::max(out.low, -p.falling);
  return out;
}

}  // namespace limber::internal
