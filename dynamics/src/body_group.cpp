#include "limber/dynamics/body_group.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "limber/core/error.h"
#include "limber/dynamics/exact_motion.h"

namespace limber {
namespace {

std::shared_ptr<const ModalModel> required(std::shared_ptr<const ModalModel> model) {
  if (!model) throw InvalidArgument("BodyGroup: the model is null");
  return model;
}

double positive(double step) {
  if (!(step > 0.0)) throw InvalidArgument("BodyGroup: step is " + std::to_string(step) + " s, expected > 0");
  return step;
}

/// ∫ρ x × w from S = ∫ρ x wᵀ.
Vec3 cross_moment(const Mat3& S) { return {S(1, 2) - S(2, 1), S(2, 0) - S(0, 2), S(0, 1) - S(1, 0)}; }

}  // namespace

void BodyGroup::ModeRows::clear(Index slot) {
  std::fill_n(storage_.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(slot) * blocks_), blocks_,
              Block{});
}

void BodyGroup::ModeRows::copy_from(const ModeRows& other, Index slot) {
  const auto offset = static_cast<std::ptrdiff_t>(static_cast<std::size_t>(slot) * blocks_);
  std::copy_n(other.storage_.begin() + offset, blocks_, storage_.begin() + offset);
}

BodyGroup::BodyGroup(std::shared_ptr<const ModalModel> model, double step)
    : model_(required(std::move(model))),
      constants_(model_->data()),
      previous_amplitudes_(model_->modes()),
      resting_rates_(model_->modes()),
      now_(model_->modes()),
      predicted_(model_->modes()) {
  set_step_length(step);
  if (constants_.motion == FrameMotion::kFree) return;
  const ModalModelData& data = model_->data();
  for (std::size_t i = 0; i < data.eigenvalues.size(); ++i) {
    const Mat3& S = data.moments[i];
    couplings_.push_back({data.participation[i], -cross_moment(S), S.trace() * Mat3::Identity() - S});
  }
}

void BodyGroup::set_step_length(double step) {
  were_static_.assign(whole_.velocity_response().begin(), whole_.velocity_response().end());
  whole_.set(model_->data().eigenvalues, model_->data().decays, positive(step), std::numbers::pi / step);
  if (coupling_) coupling_->set_step(step);
  for (Index slot = 0; slot < slots(); ++slot)
    if (occupied(slot)) split_static_answer(slot);
}

/// A mode that now answers as an oscillator goes on from where it is; one that was an oscillator swings about its
/// static displacement under what held it in the last step.
void BodyGroup::split_static_answer(Index slot) {
  Body& b = body(slot);
  const std::span<double> answer = now_.answers.modes(slot);
  for (std::size_t i = 0; i < answer.size(); ++i) {
    const bool was = were_static_[i] == 0.0, is = whole_.velocity_response()[i] == 0.0;
    if (was == is) continue;
    answer[i] = is && b.held ? predicted_.forces.modes(slot)[i] / model_->data().eigenvalues[i] : 0.0;
    b.modes_static = b.modes_static || answer[i] != 0.0;
  }
}

Index BodyGroup::add(const RigidTransform& X_WB, const Vec3& velocity, const Vec3& angular_velocity, bool skinned) {
  const Body body{.frame = RigidFrame(constants_, X_WB, velocity, angular_velocity), .previous_pose = X_WB};
  std::unique_ptr<Skin> skin = skinned ? std::make_unique<Skin>(*model_->data().skin) : nullptr;
  if (!vacant_.empty()) {
    const Index slot = vacant_.back();
    vacant_.pop_back();
    bodies_[static_cast<std::size_t>(slot)] = body;
    skins_[static_cast<std::size_t>(slot)] = std::move(skin);
    coupled_[static_cast<std::size_t>(slot)] = nullptr;
    return slot;
  }
  bodies_.push_back(body);
  coupled_.emplace_back();
  skins_.push_back(std::move(skin));
  predictions_.push_back({.frame = body.frame});
  for (ModeRows* rows : mode_rows()) rows->resize(bodies_.size());
  vacant_.reserve(bodies_.size());  // so that remove() cannot fail
  return slots() - 1;
}

void BodyGroup::remove(Index slot) {
  body(slot).occupied = false;
  clear_modes(slot);
  vacant_.push_back(slot);
}

void BodyGroup::clear_modes(Index slot) {
  for (ModeRows* rows : mode_rows()) rows->clear(slot);
  body(slot).delayed.clear();
}

void BodyGroup::set_pose(Index slot, const RigidTransform& X_WB) {
  body(slot).frame.set_pose(X_WB);
  body(slot).previous_pose = body(slot).frame.pose();
  find_coupled_velocities(slot);
}

void BodyGroup::set_velocity(Index slot, const Vec3& velocity, const Vec3& angular_velocity) {
  body(slot).frame.set_velocity(constants_, velocity, angular_velocity);
  if (coupled(slot)) set_coupled_velocities(slot, angular_velocity, rates(slot));
}

void BodyGroup::set_amplitudes(Index slot, std::span<const double> amplitudes, std::span<const double> rates) {
  std::copy(amplitudes.begin(), amplitudes.end(), now_.amplitudes.modes(slot).begin());
  if (coupled(slot))
    set_coupled_velocities(slot, angular_velocity(slot), rates);
  else
    std::copy(rates.begin(), rates.end(), now_.rates.modes(slot).begin());
  previous_amplitudes_.copy_from(now_.amplitudes, slot);
  resting_rates_.clear(slot);
  forget_static_answer(slot);
}

void BodyGroup::set_parent(Index slot, const KinematicFrame& at_step_end) { body(slot).frame.set_parent(at_step_end); }

Vec3 BodyGroup::position(Index slot, const SurfacePoint& at) const {
  return frame(slot).pose() * shape(slot).position(at);
}

Vec3 BodyGroup::velocity(Index slot, const SurfacePoint& at) const {
  const RigidFrame& f = frame(slot);
  const Vec3 arm = f.pose().q * shape(slot).position(at);
  return f.velocity() + angular_velocity(slot).cross(arm) + f.pose().q * shape(slot).velocity(at, rates(slot));
}

void BodyGroup::apply_force(Index slot, const SurfacePoint& at, const Vec3& newtons) {
  Body& b = body(slot);
  const Quaternion& q_WB = b.frame.pose().q;
  b.force += newtons;
  if (coupled(slot)) {
    b.point_forces.push_back({at, newtons});
    return;
  }
  b.torque += (q_WB * shape(slot).position(at)).cross(newtons);
  shape(slot).add_force(at, q_WB.conjugate() * newtons, now_.forces.modes(slot));
  b.modes_loaded = true;
}

void BodyGroup::apply_impulse(Index slot, const SurfacePoint& at, const Vec3& newton_seconds, double delay) {
  Body& b = body(slot);
  const Quaternion q_WB = b.frame.pose().q;
  b.frame.apply_impulse(constants_, newton_seconds, (q_WB * shape(slot).position(at)).cross(newton_seconds));
  const Vec3 impulse_B = q_WB.conjugate() * newton_seconds;
  if (delay == 0.0) shape(slot).add_force(at, impulse_B, now_.rates.modes(slot));
  find_coupled_velocities(slot);
  if (delay == 0.0) return;
  if (whole_.table().modes() == 0) return;
  b.delayed.push_back({at, impulse_B, delay});
  if (!skinned(slot)) return;
  b.delayed.back().modal.assign(amplitudes(slot).size(), 0.0);
  shape(slot).add_force(at, impulse_B, b.delayed.back().modal);
}

SkinMemory* BodyGroup::skin(Index slot) const {
  const std::unique_ptr<Skin>& skin = skins_[static_cast<std::size_t>(slot)];
  return skin ? &skin->memory : nullptr;
}

std::array<ShapeBetween, kShapesBetween> BodyGroup::shapes_between(Index slot) const {
  const std::span<const double> z0 = amplitudes(slot), z1 = predicted_amplitudes(slot);
  const auto at = [&](std::size_t place) -> ShapeBetween {
    std::vector<double>& z = skins_[static_cast<std::size_t>(slot)]->between[place];
    z.resize(z0.size());
    for (std::size_t i = 0; i < z.size(); ++i) z[i] = z0[i] + kPartsBetween[place] * (z1[i] - z0[i]);
    return {shape_at(slot, z), kWeightsBetween[place]};
  };
  return {at(0), at(1), at(2)};
}

void BodyGroup::advance(Index begin, Index end, const Vec3& gravity) {
  for (Index slot = begin; slot < end; ++slot)
    if (body(slot).occupied && !body(slot).constrained && !body(slot).asleep) advance_body(slot, gravity);
}

void BodyGroup::keep_previous_state(Index slot) {
  resting_rates_.clear(slot);
  if (within_step_) return;
  body(slot).previous_pose = body(slot).frame.pose();
  previous_amplitudes_.copy_from(now_.amplitudes, slot);
}

double BodyGroup::modal_motion(Index slot) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < rates(slot).size(); ++i) {
    const double moving = rates(slot)[i] - resting_rates(slot)[i];
    sum += moving * moving;
  }
  return sum;
}

void BodyGroup::put_to_sleep(Index slot) {
  Body& b = body(slot);
  b.frame.set_velocity(constants_, Vec3::Zero(), Vec3::Zero());
  for (ModeRows* rows : {&now_.rates, &resting_rates_}) rows->clear(slot);
  find_coupled_velocities(slot);
  b.previous_pose = b.frame.pose();
  previous_amplitudes_.copy_from(now_.amplitudes, slot);
  clear_loads(slot);
  b.asleep = true;
}

void BodyGroup::advance_body(Index slot, const Vec3& gravity) {
  Body& b = body(slot);
  keep_previous_state(slot);
  if (coupled(slot)) return advance_coupled(slot, gravity);

  const FrameLoad load{own_gravity(slot, gravity), b.force, b.torque};
  const double h = step_length();
  const ModeArrays modes{now_.amplitudes.row(slot), now_.rates.row(slot), now_.forces.row(slot)};
  const FrameExcitation excitation = b.frame.begin_step(constants_, load, first_moment(slot), h);
  if (!couplings_.empty()) excite_modes(modes.forces, excitation);
  if (b.modes_static) {
    leave_static_answer(slot, modes.z);
    forget_static_answer(slot);
  }
  b.held = false;
  advance_modes(slot, modes, b.modes_loaded || !couplings_.empty(), whole_);
  b.frame.end_step(constants_, load, first_moment(slot), h);
  clear_loads(slot);
}

void BodyGroup::predict(Index slot, const Vec3& gravity, const ConstraintLoad& load, const ModalStep& step) {
  const Body& b = body(slot);
  Prediction& p = predictions_[static_cast<std::size_t>(slot)];
  p.frame = b.frame;
  predicted_.amplitudes.copy_from(now_.amplitudes, slot);
  predicted_.rates.copy_from(now_.rates, slot);
  predicted_.forces.copy_from(now_.forces, slot);

  const FrameLoad frame_load{gravity, b.force + load.force, b.torque + load.torque};
  const double h = step.length();
  const ModeArrays modes{predicted_.amplitudes.row(slot), predicted_.rates.row(slot), predicted_.forces.row(slot)};
  // An impulse of zero would still set the closed rotation up anew, and cost it its last bits.
  if (!load.impulse.isZero(0.0) || !load.moment.isZero(0.0))
    p.frame.apply_impulse(constants_, load.impulse, load.moment);
  const FrameExcitation excitation = p.frame.begin_step(constants_, frame_load, first_moment(slot), h);
  if (!couplings_.empty()) excite_modes(modes.forces, excitation);
  const bool constrained = add_modal_load(load.modal, modes.forces, step);
  if (b.modes_static) leave_static_answer(slot, modes.z);
  advance_modes(slot, modes, b.modes_loaded || constrained || !couplings_.empty(), step);
  p.held = constrained;
  p.modes_static = constrained && answer_statically(slot, load.modal, step);
  p.frame.end_step(constants_, frame_load, predicted_first_moment(slot), h);
}

void BodyGroup::predict(Index slot, const RigidFrame& end, const FrameExcitation& excitation,
                        std::span<const double> modal, const ModalStep& step) {
  Prediction& p = predictions_[static_cast<std::size_t>(slot)];
  p.frame = end;
  predicted_.amplitudes.copy_from(now_.amplitudes, slot);
  predicted_.rates.copy_from(now_.rates, slot);
  predicted_.forces.copy_from(now_.forces, slot);
  const ModeArrays modes{predicted_.amplitudes.row(slot), predicted_.rates.row(slot), predicted_.forces.row(slot)};
  if (!couplings_.empty()) excite_modes(modes.forces, excitation);
  const bool constrained = add_modal_load(modal, modes.forces, step);
  if (body(slot).modes_static) leave_static_answer(slot, modes.z);
  advance_modes(slot, modes, body(slot).modes_loaded || constrained || !couplings_.empty(), step);
  p.held = constrained;
  p.modes_static = constrained && answer_statically(slot, modal, step);
}

void BodyGroup::predict_rest(Index slot, const RigidFrame& end) {
  Prediction& p = predictions_[static_cast<std::size_t>(slot)];
  p.frame = end;
  p.held = false;
  p.modes_static = body(slot).modes_static;
  predicted_.amplitudes.copy_from(now_.amplitudes, slot);
  predicted_.rates.copy_from(now_.rates, slot);
  predicted_.answers.copy_from(now_.answers, slot);
}

void BodyGroup::commit(Index slot, bool begins, bool ends) {
  Body& b = body(slot);
  const Prediction& p = predictions_[static_cast<std::size_t>(slot)];
  if (begins) keep_previous_state(slot);
  b.frame = p.frame;
  now_.amplitudes.copy_from(predicted_.amplitudes, slot);
  now_.rates.copy_from(predicted_.rates, slot);
  if (p.modes_static) now_.answers.copy_from(predicted_.answers, slot);
  if (b.modes_static && !p.modes_static) now_.answers.clear(slot);
  b.modes_static = p.modes_static;
  b.held = p.held;
  if (ends) clear_loads(slot);
}

void BodyGroup::adjust_prediction(Index slot, const Vec3& impulse, const Vec3& moment, std::span<const double> modal) {
  predictions_[static_cast<std::size_t>(slot)].frame.apply_impulse(constants_, impulse, moment);
  const std::span<double> rates = predicted_.rates.modes(slot);
  for (std::size_t i = 0; i < modal.size(); ++i) rates[i] += modal[i];
}

void BodyGroup::apply_generalized_impulse(Index slot, const Vec3& impulse, const Vec3& moment,
                                          std::span<const double> modal) {
  body(slot).frame.apply_impulse(constants_, impulse, moment);
  const std::span<double> rates = now_.rates.modes(slot);
  for (std::size_t i = 0; i < modal.size(); ++i) rates[i] += modal[i];
  find_coupled_velocities(slot);
}

void BodyGroup::apply_generalized_force(Index slot, const Vec3& force, const Vec3& torque,
                                        std::span<const double> modal) {
  Body& b = body(slot);
  b.force += force;
  b.torque += torque;
  const std::span<double> g = now_.forces.modes(slot);
  for (std::size_t i = 0; i < modal.size(); ++i) g[i] += modal[i];
  b.modes_loaded = b.modes_loaded || !modal.empty();
}

void BodyGroup::advance_modes(Index slot, const ModeArrays& modes, bool loaded, const ModalStep& step) const {
  if (step.table().modes() == 0) return;
  if (loaded)
    step.table().advance(modes.z, modes.rates, modes.forces);
  else
    step.table().advance_free(modes.z, modes.rates);
  for (const DelayedImpulse& impulse : body(slot).delayed) add_delayed(impulse, modes, step.length() - impulse.time);
}

/// As it shows so long after.
void BodyGroup::add_delayed(const DelayedImpulse& impulse, const ModeArrays& modes, double remaining) const {
  const ModalModelData& data = model_->data();
  for (std::size_t i = 0; i < data.eigenvalues.size(); ++i) {
    const Mode mode{data.eigenvalues[i], data.decays[i]};
    const ModeState change = impulse_response(mode, remaining, modal_impulse(impulse, i));
    modes.z[i] += change.z;
    modes.rates[i] += change.zdot;
  }
}

void BodyGroup::begin_parts(Index slot) {
  keep_previous_state(slot);
  Body& b = body(slot);
  if (b.modes_static) {
    leave_static_answer(slot, now_.amplitudes.row(slot));
    forget_static_answer(slot);
  }
  b.held = false;
}

void BodyGroup::advance_modes(Index slot, const ModalStep& part, int number, int count,
                              const FrameExcitation& excitation) {
  if (part.table().modes() == 0) return;
  ModeArrays modes{now_.amplitudes.row(slot), now_.rates.row(slot), now_.forces.row(slot)};
  if (!couplings_.empty()) {
    predicted_.forces.copy_from(now_.forces, slot);
    modes.forces = predicted_.forces.row(slot);
    excite_modes(modes.forces, excitation);
  }
  if (body(slot).modes_loaded || !couplings_.empty())
    part.table().advance(modes.z, modes.rates, modes.forces);
  else
    part.table().advance_free(modes.z, modes.rates);
  for (const DelayedImpulse& impulse : body(slot).delayed)
    if (std::min(static_cast<int>(impulse.time / part.length()), count - 1) == number)
      add_delayed(impulse, modes, std::max(0.0, (number + 1) * part.length() - impulse.time));
}

double BodyGroup::modal_impulse(const DelayedImpulse& impulse, std::size_t mode) const {
  if (!impulse.modal.empty()) return impulse.modal[mode];
  return limber::shape_at(*model_, impulse.at, static_cast<Index>(mode)).dot(impulse.impulse_B);
}

/// @param answers of the modes to the load's impulse, where it has one
void BodyGroup::predict_motion(Index slot, const Vec3& gravity, double h, const ConstraintLoad& constrained,
                               std::span<const double> answers, ExactMotion& motion) const {
  const Body& b = body(slot);
  const FrameLoad load{gravity, b.force + constrained.force, b.torque + constrained.torque};
  const ModalModelData& data = model_->data();
  RigidFrame frame = b.frame;
  if (!constrained.impulse.isZero(0.0) || !constrained.moment.isZero(0.0))
    frame.apply_impulse(constants_, constrained.impulse, constrained.moment);
  const FrameExcitation excitation = frame.begin_step(constants_, load, first_moment(slot), h, &motion.path());
  motion.set_modes(data.eigenvalues, data.decays, amplitudes(slot), rates(slot));
  if (b.modes_loaded) std::ranges::copy(now_.forces.modes(slot), motion.forces().begin());
  for (std::size_t i = 0; i < constrained.modal.size(); ++i)
    motion.forces()[i] += answers[i] * constrained.modal[i] / h;
  if (!couplings_.empty()) excite_modes(motion.forces().data(), excitation);
  if (b.modes_static) motion.release(static_amplitudes(slot));
  for (const DelayedImpulse& impulse : b.delayed)
    if (const std::span<double> j = motion.add_impulse(impulse.time); impulse.modal.empty())
      add_modal_force(*model_, impulse.at, impulse.impulse_B, j);
    else
      std::ranges::copy(impulse.modal, j.begin());
  frame.end_step(constants_, load, first_moment_at_end(motion), h, &motion.path());
}

Vec3 BodyGroup::first_moment_at_end(const ExactMotion& motion) const {
  Vec3 s = constants_.mass * constants_.center_of_mass;
  for (std::size_t i = 0; i < couplings_.size(); ++i)
    s += motion.amplitude(static_cast<Index>(i), motion.step()) * couplings_[i].field;
  return s;
}

/// Modes that answered the last step's constraints statically do not vibrate when they let go.
void BodyGroup::leave_static_answer(Index slot, double* z) const {
  const std::span<const double> answer = now_.answers.modes(slot);
  for (std::size_t i = 0; i < answer.size(); ++i) z[i] -= answer[i];
}

void BodyGroup::forget_static_answer(Index slot) {
  now_.answers.clear(slot);
  body(slot).modes_static = false;
}

/// @return whether there is any
bool BodyGroup::add_modal_load(std::span<const double> modal, double* forces, const ModalStep& step) {
  bool any = false;
  for (std::size_t i = 0; i < modal.size(); ++i) {
    any = any || modal[i] != 0.0;
    forces[i] += step.velocity_response()[i] * modal[i] / step.length();
  }
  return any;
}

/// @return whether a mode did
bool BodyGroup::answer_statically(Index slot, std::span<const double> modal, const ModalStep& step) {
  const std::span<double> z = predicted_.amplitudes.modes(slot), answer = predicted_.answers.modes(slot);
  bool any = false;
  for (std::size_t i = 0; i < modal.size(); ++i) {
    answer[i] = step.velocity_response()[i] == 0.0 ? step.position_response()[i] * modal[i] : 0.0;
    z[i] += answer[i];
    any = any || answer[i] != 0.0;
  }
  return any;
}

void BodyGroup::excite_modes(double* forces, const FrameExcitation& excitation) const {
  for (std::size_t i = 0; i < couplings_.size(); ++i) {
    const Coupling& c = couplings_[i];
    forces[i] += c.field.dot(excitation.field) + c.angular_acceleration.dot(excitation.angular_acceleration) +
                 c.spin.cwiseProduct(excitation.spin).sum();
  }
}

void BodyGroup::clear_loads(Index slot) {
  Body& b = body(slot);
  b.force = b.torque = Vec3::Zero();
  if (b.modes_loaded || !couplings_.empty()) now_.forces.clear(slot);
  b.modes_loaded = false;
  b.delayed.clear();
  b.point_forces.clear();
}

void BodyGroup::save_state(Index slot, StateWriter& state) const {
  const Body& b = bodies_[static_cast<std::size_t>(slot)];
  state(b);
  for (const ModeRows* rows : {&now_.amplitudes, &now_.rates, &previous_amplitudes_, &resting_rates_})
    state.numbers(rows->modes(slot));
  if (b.modes_loaded) state.numbers(now_.forces.modes(slot));
  if (b.modes_static) state.numbers(now_.answers.modes(slot));
  if (b.held) state.numbers(predicted_.forces.modes(slot));
}

void BodyGroup::restore_state(Index slot, StateReader& state) {
  Body& b = body(slot);
  state(b);
  for (ModeRows* rows : {&now_.amplitudes, &now_.rates, &previous_amplitudes_, &resting_rates_})
    state.numbers(rows->modes(slot));
  for (ModeRows* rows : {&now_.forces, &now_.answers}) rows->clear(slot);
  if (b.modes_loaded) state.numbers(now_.forces.modes(slot));
  if (b.modes_static) state.numbers(now_.answers.modes(slot));
  if (b.held) state.numbers(predicted_.forces.modes(slot));
  find_coupled_velocities(slot);
}

Vec3 BodyGroup::first_moment(Index slot) const { return first_moment_of(amplitudes(slot)); }

Vec3 BodyGroup::predicted_first_moment(Index slot) const { return first_moment_of(predicted_amplitudes(slot)); }

Vec3 BodyGroup::first_moment_of(std::span<const double> z) const {
  Vec3 s = constants_.mass * constants_.center_of_mass;
  for (std::size_t i = 0; i < couplings_.size(); ++i) s += z[i] * couplings_[i].field;
  return s;
}

}  // namespace limber
