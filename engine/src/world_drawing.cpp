#include <algorithm>
#include <cmath>
#include <string>

#include "world_impl.h"

namespace limber {
namespace {

void require_fraction(double s, const char* function) {
  if (!(s >= 0.0 && s <= 1.0))
    throw InvalidArgument(std::string("World::") + function + ": interpolation is " + std::to_string(s) +
                          ", expected 0 to 1");
}

}  // namespace

/// Amplitudes between the last two states.
template <class Real>
void World::Impl::interpolate(BodyId id, double s, Real* amplitudes) const {
  const Entry& e = entries[id.index];
  const std::span<const double> newest = group(e).amplitudes(e.slot), previous = group(e).previous_amplitudes(e.slot);
  for (std::size_t i = 0; i < newest.size(); ++i)
    amplitudes[i] = static_cast<Real>(s == 1.0 ? newest[i] : previous[i] + s * (newest[i] - previous[i]));
}

/// Checks what is to be drawn and orders it by model.
void World::Impl::prepare_drawing(std::span<const DrawTarget> targets) {
  drawn.clear();
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const Entry& e = entry(targets[i].id, "reconstruct");
    const std::size_t numbers = 3 * static_cast<std::size_t>(group(e).model().render().vertices());
    require_count(targets[i].positions.size(), numbers, "reconstruct", "positions");
    if (!targets[i].normals.empty()) require_count(targets[i].normals.size(), numbers, "reconstruct", "normals");
    drawn.push_back({e.group, i});
  }
  std::sort(drawn.begin(), drawn.end(), [](const Drawn& a, const Drawn& b) {
    return a.group != b.group ? a.group < b.group : a.target < b.target;
  });
}

void World::reconstruct(std::span<const DrawTarget> targets, double interpolation, const Vec3& origin) const {
  require_fraction(interpolation, "reconstruct");
  require_finite(origin, "reconstruct", "origin");
  impl_->prepare_drawing(targets);
  std::size_t numbers = 0;
  for (const Impl::Drawn& d : impl_->drawn)
    numbers += static_cast<std::size_t>(impl_->groups[static_cast<std::size_t>(d.group)]->model().modes());
  if (impl_->drawn_amplitudes.size() < numbers) impl_->drawn_amplitudes.resize(numbers);

  impl_->reconstruction.clear();
  double* amplitudes = impl_->drawn_amplitudes.data();
  for (const Impl::Drawn& d : impl_->drawn) {
    const DrawTarget& target = targets[d.target];
    RigidTransform X_OB = interpolated_pose(target.id, interpolation);
    X_OB.p -= origin;
    impl_->interpolate(target.id, interpolation, amplitudes);
    impl_->reconstruction.push_back(
        {X_OB, amplitudes, target.positions.data(), target.normals.empty() ? nullptr : target.normals.data()});
    amplitudes += model(target.id).modes();
  }
  const auto& drawn = impl_->drawn;
  for (std::size_t begin = 0, end = 0; begin < drawn.size(); begin = end) {
    while (end < drawn.size() && drawn[end].group == drawn[begin].group) ++end;
    limber::reconstruct(impl_->groups[static_cast<std::size_t>(drawn[begin].group)]->model().render(),
                        std::span(impl_->reconstruction).subspan(begin, end - begin), *impl_->jobs);
  }
}

void World::reconstruct(BodyId id, std::span<float> positions, std::span<float> normals, double interpolation,
                        const Vec3& origin) const {
  const DrawTarget target{id, positions, normals};
  reconstruct({&target, 1}, interpolation, origin);
}

RigidTransform World::interpolated_pose(BodyId id, double interpolation) const {
  const Impl::Entry& e = impl_->entry(id, "interpolated_pose");
  require_fraction(interpolation, "interpolated_pose");
  const RigidTransform& newest = impl_->group(e).frame(e.slot).pose();
  if (interpolation == 1.0) return newest;
  const RigidTransform& previous = impl_->group(e).previous_pose(e.slot);
  return {slerp(previous.q, newest.q, interpolation), previous.p + interpolation * (newest.p - previous.p)};
}

void World::interpolated_amplitudes(BodyId id, double interpolation, std::span<float> amplitudes) const {
  const Impl::Entry& e = impl_->entry(id, "interpolated_amplitudes");
  require_fraction(interpolation, "interpolated_amplitudes");
  require_count(amplitudes.size(), static_cast<std::size_t>(impl_->group(e).model().modes()), "interpolated_amplitudes",
                "amplitudes");
  impl_->interpolate(id, interpolation, amplitudes.data());
}

}  // namespace limber
