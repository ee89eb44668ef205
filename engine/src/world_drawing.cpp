#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <string>

#include "world_impl.h"

namespace limber {
namespace {

using internal::require_count;
using internal::require_finite;

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

/// By how much a vertex drawn in half precision may be off between the last two states; infinite where there is none.
double World::Impl::half_precision_error(const Entry& e, double tolerance, double s) const {
  const HalfBasis* half = halves[static_cast<std::size_t>(e.group)].get();
  if (half == nullptr || tolerance == 0.0) return HUGE_VAL;
  const auto error = [&](std::span<const double> z) {
    return std::transform_reduce(z.begin(), z.end(), half->errors().begin(), 0.0, std::plus<>(),
                                 [](double amplitude, double off) { return std::abs(amplitude) * off; });
  };
  const double newest = error(group(e).amplitudes(e.slot));
  return s == 1.0 ? newest : std::max(newest, error(group(e).previous_amplitudes(e.slot)));
}

/// Between the last two states, of which either may bend more.
Index World::Impl::modes_to_draw(const Entry& e, double tolerance, double s) const {
  if (tolerance == 0.0 || group(e).skinned(e.slot)) return group(e).model().modes();  // the bound is of modes alone
  const SurfaceExtent& extent = group(e).model().render_extent();
  const Index newest = drawn_modes(extent, group(e).amplitudes(e.slot), tolerance);
  if (s == 1.0) return newest;
  return std::max(newest, drawn_modes(extent, group(e).previous_amplitudes(e.slot), tolerance));
}

/// The handles of a body's skin at amplitudes that are to be drawn; null: it has none.
const SkinPose* World::Impl::skin_at(BodyId id, const double* z) const {
  const Entry& e = entries[id.index];
  SkinMemory* skin = group(e).skin(e.slot);
  return skin == nullptr ? nullptr : &skin->at({z, static_cast<std::size_t>(group(e).model().modes())});
}

/// For drawing between this state and the next.
void World::Impl::keep_dents() {
  if (std::ranges::none_of(dented, [](const auto& surface) { return surface != nullptr; })) return;
  loads_before.resize(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const std::span<const DentLoad> loads = contacts.dent_loads(static_cast<Index>(i));
    loads_before[i].assign(loads.begin(), loads.end());
  }
}

std::span<const DentLoad> World::Impl::dents_before(BodyId id) const {
  if (id.index >= loads_before.size()) return {};
  return loads_before[id.index];
}

bool World::Impl::is_dented(BodyId id, double s) const {
  return !contacts.dent_loads(static_cast<Index>(id.index)).empty() || (s < 1.0 && !dents_before(id).empty());
}

/// Checks what is to be drawn, orders it by model, and makes room.
void World::Impl::prepare_drawing(std::span<const DrawTarget> targets, double s) {
  drawn.clear();
  std::size_t amplitudes = 0, dents = 0;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const Entry& e = entry(targets[i].id, "reconstruct");
    const std::size_t numbers = 3 * static_cast<std::size_t>(group(e).model().render().vertices());
    require_count(targets[i].positions.size(), numbers, "reconstruct", "positions");
    if (!targets[i].normals.empty()) require_count(targets[i].normals.size(), numbers, "reconstruct", "normals");
    if (!(targets[i].tolerance >= 0.0) || !std::isfinite(targets[i].tolerance))
      throw InvalidArgument("World::reconstruct: tolerance is " + std::to_string(targets[i].tolerance) +
                            " m, expected at least 0 and finite");
    const double error = half_precision_error(e, targets[i].tolerance, s);
    const bool half = error <= targets[i].tolerance;
    drawn.push_back({e.group, half, modes_to_draw(e, targets[i].tolerance - (half ? error : 0.0), s), i});
    amplitudes += static_cast<std::size_t>(group(e).model().modes());
    if (is_dented(targets[i].id, s)) dents += numbers;
  }
  if (drawn_amplitudes.size() < amplitudes) drawn_amplitudes.resize(amplitudes);
  if (drawn_dents.size() < dents) drawn_dents.resize(dents);
  std::sort(drawn.begin(), drawn.end(), [](const Drawn& a, const Drawn& b) {
    return std::tie(a.group, a.half, a.modes, a.target) < std::tie(b.group, b.half, b.modes, b.target);
  });
}

void World::reconstruct(std::span<const DrawTarget> targets, double interpolation, const Vec3& origin) const {
  require_fraction(interpolation, "reconstruct");
  require_finite(origin, "reconstruct", "origin");
  Impl& m = *impl_;
  StageClock clock(m.stage_times);
  m.prepare_drawing(targets, interpolation);
  m.reconstruction.clear();
  double* amplitudes = m.drawn_amplitudes.data();
  float* dents = m.drawn_dents.data();
  for (const Impl::Drawn& d : m.drawn) {
    const DrawTarget& target = targets[d.target];
    RigidTransform X_OB = interpolated_pose(target.id, interpolation);
    X_OB.p -= origin;
    m.interpolate(target.id, interpolation, amplitudes);
    m.reconstruction.push_back({.X_OB = X_OB,
                                .amplitudes = amplitudes,
                                .positions = target.positions.data(),
                                .normals = target.normals.empty() ? nullptr : target.normals.data(),
                                .modes = d.modes,
                                .skin = m.skin_at(target.id, amplitudes)});
    amplitudes += model(target.id).modes();
    if (!m.is_dented(target.id, interpolation)) continue;
    m.dented[static_cast<std::size_t>(d.group)]->displacements(
        m.dents_before(target.id), m.contacts.dent_loads(static_cast<Index>(target.id.index)), interpolation,
        {dents, target.positions.size()});
    m.reconstruction.back().displacement = dents;
    dents += target.positions.size();
  }
  const auto& drawn = impl_->drawn;
  for (std::size_t begin = 0, end = 0; begin < drawn.size(); begin = end) {
    const auto group = static_cast<std::size_t>(drawn[begin].group);
    while (end < drawn.size() && drawn[end].group == drawn[begin].group && drawn[end].half == drawn[begin].half) ++end;
    const ModalModel& model = m.groups[group]->model();
    const std::span<const ReconstructionTarget> of_model = std::span(m.reconstruction).subspan(begin, end - begin);
    if (model.data().skin)
      limber::reconstruct(model.render(), m.skins[group]->tiles(), of_model, *m.jobs);
    else if (drawn[begin].half)
      limber::reconstruct(model.render(), *m.halves[group], of_model, *m.jobs);
    else
      limber::reconstruct(model.render(), of_model, *m.jobs);
  }
  if (!clock.runs()) return;
  std::int64_t vertices = 0;
  for (const DrawTarget& target : targets) vertices += static_cast<std::int64_t>(target.positions.size() / 3);
  clock.lap(Stage::kReconstruct, vertices);
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

void World::interpolated_weights(BodyId id, double interpolation, std::span<float> weights) const {
  const Impl::Entry& e = impl_->entry(id, "interpolated_weights");
  require_fraction(interpolation, "interpolated_weights");
  const std::span<const double> scales = impl_->group(e).model().data().mode_scales;
  require_count(weights.size(), scales.size(), "interpolated_weights", "weights");
  impl_->interpolate(id, interpolation, weights.data());
  for (std::size_t i = 0; i < weights.size(); ++i)
    weights[i] = static_cast<float>(static_cast<double>(weights[i]) / scales[i]);
}

bool World::has_modal_skin(BodyId id) const {
  const Impl::Entry& e = impl_->entry(id, "has_modal_skin");
  return impl_->group(e).skinned(e.slot);
}

void World::interpolated_handles(BodyId id, double interpolation, std::span<float> numbers) const {
  const Impl::Entry& e = impl_->entry(id, "interpolated_handles");
  require_fraction(interpolation, "interpolated_handles");
  SkinMemory* skin = impl_->group(e).skin(e.slot);
  if (skin == nullptr)
    throw InvalidArgument("World::interpolated_handles: body " + std::to_string(id.index) + " has no modal skin");
  const ModalModel& model = impl_->group(e).model();
  require_count(numbers.size(), SkinPose::kNumbers * static_cast<std::size_t>(model.data().skin->handles),
                "interpolated_handles", "numbers");
  std::vector<double>& z = impl_->drawn_amplitudes;
  if (z.size() < static_cast<std::size_t>(model.modes())) z.resize(static_cast<std::size_t>(model.modes()));
  impl_->interpolate(id, interpolation, z.data());
  std::ranges::copy(impl_->skin_at(id, z.data())->numbers(), numbers.begin());
}

}  // namespace limber
