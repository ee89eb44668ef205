#include "drawing.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <string>
#include <tuple>

#include "argument_checks.h"
#include "limber/core/error.h"

namespace limber::internal {
namespace {

void require_fraction(double s, const char* function) {
  if (!(s >= 0.0 && s <= 1.0))
    throw InvalidArgument(std::string("World::") + function + ": interpolation is " + std::to_string(s) +
                          ", expected 0 to 1");
}

}  // namespace

void Drawing::keep_indentations(const StepPath& path) {
  if (!bodies_->any_indented()) return;
  indentations_before_.resize(bodies_->size());
  for (std::size_t i = 0; i < indentations_before_.size(); ++i) {
    const std::span<const IndentationLoad> loads = path.indentation_loads(static_cast<Index>(i));
    indentations_before_[i].assign(loads.begin(), loads.end());
  }
}

void Drawing::forget(Index body) {
  if (static_cast<std::size_t>(body) < indentations_before_.size())
    indentations_before_[static_cast<std::size_t>(body)].clear();
}

void Drawing::save_state(StateWriter& state) const {
  const std::vector<IndentationLoad> none;
  for (std::size_t i = 0; i < bodies_->size(); ++i)
    state(i < indentations_before_.size() ? indentations_before_[i] : none);
}

void Drawing::restore_state(StateReader& state) {
  indentations_before_.resize(bodies_->size());
  for (std::vector<IndentationLoad>& loads : indentations_before_) state(loads);
}

/// Amplitudes between the last two states.
template <class Real>
void Drawing::interpolate(const Entry& e, double s, Real* amplitudes) const {
  const BodyGroup& group = bodies_->group(e);
  const std::span<const double> newest = group.amplitudes(e.slot), previous = group.previous_amplitudes(e.slot);
  for (std::size_t i = 0; i < newest.size(); ++i)
    amplitudes[i] = static_cast<Real>(s == 1.0 ? newest[i] : previous[i] + s * (newest[i] - previous[i]));
}

RigidTransform Drawing::pose(const Entry& e, double s) const {
  const RigidTransform& newest = bodies_->group(e).frame(e.slot).pose();
  if (s == 1.0) return newest;
  const RigidTransform& previous = bodies_->group(e).previous_pose(e.slot);
  return {slerp(previous.q, newest.q, s), previous.p + s * (newest.p - previous.p)};
}

/// By how much a vertex drawn in half precision may be off between the last two states; infinite where there is none.
double Drawing::half_precision_error(const Entry& e, double tolerance, double s) const {
  const HalfBasis* half = bodies_->model_group(e).half.get();
  if (half == nullptr || tolerance == 0.0) return HUGE_VAL;
  const auto error = [&](std::span<const double> z) {
    return std::transform_reduce(z.begin(), z.end(), half->errors().begin(), 0.0, std::plus<>(),
                                 [](double amplitude, double off) { return std::abs(amplitude) * off; });
  };
  const double newest = error(bodies_->group(e).amplitudes(e.slot));
  return s == 1.0 ? newest : std::max(newest, error(bodies_->group(e).previous_amplitudes(e.slot)));
}

/// Between the last two states, of which either may bend more.
Index Drawing::modes_to_draw(const Entry& e, double tolerance, double s) const {
  const BodyGroup& group = bodies_->group(e);
  if (tolerance == 0.0 || group.skinned(e.slot)) return group.model().modes();  // the bound is of modes alone
  const SurfaceExtent& extent = group.model().render_extent();
  const Index newest = drawn_modes(extent, group.amplitudes(e.slot), tolerance);
  if (s == 1.0) return newest;
  return std::max(newest, drawn_modes(extent, group.previous_amplitudes(e.slot), tolerance));
}

/// The handles of a body's skin at amplitudes that are to be drawn; null: it has none.
const SkinPose* Drawing::skin_at(const Entry& e, const double* z) const {
  const BodyGroup& group = bodies_->group(e);
  SkinMemory* skin = group.skin(e.slot);
  return skin == nullptr ? nullptr : &skin->at({z, static_cast<std::size_t>(group.model().modes())});
}

std::span<const IndentationLoad> Drawing::indentations_before(BodyId id) const {
  if (id.index >= indentations_before_.size()) return {};
  return indentations_before_[id.index];
}

bool Drawing::is_indented(BodyId id, double s, const StepPath& path) const {
  return !path.indentation_loads(static_cast<Index>(id.index)).empty() || (s < 1.0 && !indentations_before(id).empty());
}

/// Checks what is to be drawn, orders it by model, and makes room.
void Drawing::prepare(std::span<const DrawTarget> targets, double s, const StepPath& path) {
  std::vector<Drawn>& drawn = scratch_.drawn;
  drawn.clear();
  std::size_t amplitudes = 0, indentations = 0;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const DrawTarget& target = targets[i];
    const Entry& e = bodies_->entry(target.id, "reconstruct");
    const ModalModel& model = bodies_->group(e).model();
    const std::size_t numbers = 3 * static_cast<std::size_t>(model.render().vertices());
    require_count(target.positions.size(), numbers, "reconstruct", "positions");
    if (!target.normals.empty()) require_count(target.normals.size(), numbers, "reconstruct", "normals");
    if (!(target.tolerance >= 0.0) || !std::isfinite(target.tolerance))
      throw InvalidArgument("World::reconstruct: tolerance is " + std::to_string(target.tolerance) +
                            " m, expected at least 0 and finite");
    const double error = half_precision_error(e, target.tolerance, s);
    const bool half = error <= target.tolerance;
    drawn.push_back({e.group, half, modes_to_draw(e, target.tolerance - (half ? error : 0.0), s), i});
    amplitudes += static_cast<std::size_t>(model.modes());
    if (is_indented(target.id, s, path)) indentations += numbers;
  }
  if (scratch_.amplitudes.size() < amplitudes) scratch_.amplitudes.resize(amplitudes);
  if (scratch_.indentations.size() < indentations) scratch_.indentations.resize(indentations);
  std::sort(drawn.begin(), drawn.end(), [](const Drawn& a, const Drawn& b) {
    return std::tie(a.group, a.half, a.modes, a.target) < std::tie(b.group, b.half, b.modes, b.target);
  });
}

/// Poses, amplitudes and indentations of what has been prepared.
void Drawing::list_targets(std::span<const DrawTarget> targets, double s, const Vec3& origin, const StepPath& path) {
  scratch_.targets.clear();
  double* amplitudes = scratch_.amplitudes.data();
  float* indentations = scratch_.indentations.data();
  for (const Drawn& d : scratch_.drawn) {
    const DrawTarget& target = targets[d.target];
    const Entry& e = (*bodies_)[static_cast<Index>(target.id.index)];
    RigidTransform X_OB = pose(e, s);
    X_OB.p -= origin;
    interpolate(e, s, amplitudes);
    scratch_.targets.push_back({.X_OB = X_OB,
                                .amplitudes = amplitudes,
                                .positions = target.positions.data(),
                                .normals = target.normals.empty() ? nullptr : target.normals.data(),
                                .modes = d.modes,
                                .skin = skin_at(e, amplitudes)});
    amplitudes += bodies_->group(e).model().modes();
    if (!is_indented(target.id, s, path)) continue;
    bodies_->model_group(e).indented->displacements(indentations_before(target.id),
                                                    path.indentation_loads(static_cast<Index>(target.id.index)), s,
                                                    {indentations, target.positions.size()});
    scratch_.targets.back().displacement = indentations;
    indentations += target.positions.size();
  }
}

void Drawing::draw_models(Jobs& jobs) {
  const std::vector<Drawn>& drawn = scratch_.drawn;
  for (std::size_t begin = 0, end = 0; begin < drawn.size(); begin = end) {
    const Drawn& first = drawn[begin];
    while (end < drawn.size() && drawn[end].group == first.group && drawn[end].half == first.half) ++end;
    const BodyTable::ModelGroup& group = bodies_->model_group(first.group);
    const ModalModel& model = group.bodies->model();
    const std::span<const ReconstructionTarget> of_model = std::span(scratch_.targets).subspan(begin, end - begin);
    if (model.data().skin)
      limber::reconstruct(model.render(), group.skin->tiles(), of_model, jobs);
    else if (first.half)
      limber::reconstruct(model.render(), *group.half, of_model, jobs);
    else
      limber::reconstruct(model.render(), of_model, jobs);
  }
}

void Drawing::reconstruct(std::span<const DrawTarget> targets, double s, const Vec3& origin, const StepPath& path,
                          Jobs& jobs, StageTimes* times) {
  require_fraction(s, "reconstruct");
  require_finite(origin, "reconstruct", "origin");
  StageClock clock(times);
  prepare(targets, s, path);
  list_targets(targets, s, origin, path);
  draw_models(jobs);
  if (!clock.runs()) return;
  std::int64_t vertices = 0;
  for (const DrawTarget& target : targets) vertices += static_cast<std::int64_t>(target.positions.size() / 3);
  clock.lap(Stage::kReconstruct, vertices);
}

RigidTransform Drawing::pose(BodyId id, double s) const {
  const Entry& e = bodies_->entry(id, "interpolated_pose");
  require_fraction(s, "interpolated_pose");
  return pose(e, s);
}

void Drawing::amplitudes(BodyId id, double s, std::span<float> amplitudes) const {
  const Entry& e = bodies_->entry(id, "interpolated_amplitudes");
  require_fraction(s, "interpolated_amplitudes");
  require_count(amplitudes.size(), static_cast<std::size_t>(bodies_->group(e).model().modes()),
                "interpolated_amplitudes", "amplitudes");
  interpolate(e, s, amplitudes.data());
}

void Drawing::weights(BodyId id, double s, std::span<float> weights) const {
  const Entry& e = bodies_->entry(id, "interpolated_weights");
  require_fraction(s, "interpolated_weights");
  const std::span<const double> scales = bodies_->group(e).model().data().mode_scales;
  require_count(weights.size(), scales.size(), "interpolated_weights", "weights");
  interpolate(e, s, weights.data());
  for (std::size_t i = 0; i < weights.size(); ++i)
    weights[i] = static_cast<float>(static_cast<double>(weights[i]) / scales[i]);
}

void Drawing::handles(BodyId id, double s, std::span<float> numbers) {
  const Entry& e = bodies_->entry(id, "interpolated_handles");
  require_fraction(s, "interpolated_handles");
  const BodyGroup& group = bodies_->group(e);
  if (group.skin(e.slot) == nullptr)
    throw InvalidArgument("World::interpolated_handles: body " + std::to_string(id.index) + " has no modal skin");
  const ModalModel& model = group.model();
  require_count(numbers.size(), SkinPose::kNumbers * static_cast<std::size_t>(model.data().skin->handles),
                "interpolated_handles", "numbers");
  std::vector<double>& z = scratch_.amplitudes;
  if (z.size() < static_cast<std::size_t>(model.modes())) z.resize(static_cast<std::size_t>(model.modes()));
  interpolate(e, s, z.data());
  std::ranges::copy(skin_at(e, z.data())->numbers(), numbers.begin());
}

}  // namespace limber::internal
