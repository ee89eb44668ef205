#include "finder/body_register.h"

#include <cmath>

#include "tuning.h"

namespace limber::internal {
namespace {

[[noreturn]] void refuse(const char* finder, Index body, const std::string& seen, const std::string& expected) {
  throw InvalidArgument(std::string(finder) + ": state of body " + std::to_string(body) + ": " + seen + ", expected " +
                        expected);
}

void check_finite(const char* finder, Index body, std::span<const double> numbers, const char* name) {
  for (std::size_t i = 0; i < numbers.size(); ++i)
    if (!std::isfinite(numbers[i]))
      refuse(finder, body, std::string(name) + "[" + std::to_string(i) + "] is not finite", "finite numbers");
}

bool is_unit(const Quaternion& q) { return std::abs(q.norm() - 1.0) <= collision_tuning().finder.unit_quaternion; }

}  // namespace

void check_state(const char* finder, Index body, Index modes, const BodyState& s) {
  if (!s.pose.p.allFinite()) refuse(finder, body, "pose.p is not finite", "finite coordinates");
  if (!is_unit(s.pose.q)) refuse(finder, body, "pose.q has length " + std::to_string(s.pose.q.norm()), "1");
  if (!s.displacement.allFinite() || !s.rotation.allFinite())
    refuse(finder, body, "displacement or rotation is not finite", "finite numbers");
  if (!(s.reach >= 0.0 && std::isfinite(s.reach)))
    refuse(finder, body, "reach is " + std::to_string(s.reach), "a finite number of at least 0");
  if (s.amplitudes.size() != static_cast<std::size_t>(modes))
    refuse(finder, body, std::to_string(s.amplitudes.size()) + " amplitudes", std::to_string(modes));
  check_finite(finder, body, s.amplitudes, "amplitudes");
  if (!std::isfinite(s.doubt)) return;
  if (!(s.doubt >= 0.0)) refuse(finder, body, "doubt is " + std::to_string(s.doubt), "at least 0");
  if (!s.end_pose.p.allFinite() || !is_unit(s.end_pose.q))
    refuse(finder, body, "end_pose is not a pose", "finite coordinates and a quaternion of length 1");
  if (s.end_amplitudes.size() != s.amplitudes.size())
    refuse(finder, body, std::to_string(s.end_amplitudes.size()) + " end_amplitudes", std::to_string(modes));
  check_finite(finder, body, s.end_amplitudes, "end_amplitudes");
}

void check_query(const char* finder, const ContactQuery& query) {
  if (!(query.margin >= 0.0 && std::isfinite(query.margin)))
    throw InvalidArgument(std::string(finder) + ": margin is " + std::to_string(query.margin) +
                          ", expected a finite number of at least 0");
  if (!query.origin.allFinite() || !query.fall.allFinite())
    throw InvalidArgument(std::string(finder) + ": origin or fall is not finite, expected finite coordinates");
}

void bind_state(const char* finder, Index body, DeformedSurface& root,
                const std::shared_ptr<const CollisionSurface>& surface, std::span<const double> z) {
  try {
    root.bind(surface, z);
  } catch (const InvalidArgument& e) {
    refuse(finder, body, e.what(), "smaller amplitudes");
  }
}

}  // namespace limber::internal
