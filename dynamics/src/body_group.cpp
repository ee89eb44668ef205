#include "limber/dynamics/body_group.h"

#include <algorithm>
#include <cmath>

#include "limber/core/error.h"

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
      table_(model_->data().eigenvalues, model_->data().decays, positive(step)),
      amplitudes_(model_->modes()),
      rates_(model_->modes()),
      previous_amplitudes_(model_->modes()),
      forces_(model_->modes()),
      delayed_z_(model_->modes()),
      delayed_rates_(model_->modes()) {
  if (constants_.motion == FrameMotion::kFree) return;
  const ModalModelData& data = model_->data();
  for (std::size_t i = 0; i < data.eigenvalues.size(); ++i) {
    const Mat3& S = data.moments[i];
    couplings_.push_back({data.participation[i], -cross_moment(S), S.trace() * Mat3::Identity() - S});
  }
}

Index BodyGroup::add(const RigidTransform& X_WB, const Vec3& velocity, const Vec3& angular_velocity) {
  const Body body{.frame = RigidFrame(constants_, X_WB, velocity, angular_velocity), .previous_pose = X_WB};
  if (!vacant_.empty()) {
    const Index slot = vacant_.back();
    vacant_.pop_back();
    bodies_[static_cast<std::size_t>(slot)] = body;
    return slot;
  }
  bodies_.push_back(body);
  for (ModeRows* rows : {&amplitudes_, &rates_, &previous_amplitudes_, &forces_, &delayed_z_, &delayed_rates_})
    rows->resize(bodies_.size());
  vacant_.reserve(bodies_.size());  // so that remove() cannot fail
  return slots() - 1;
}

void BodyGroup::remove(Index slot) {
  body(slot).occupied = false;
  clear_modes(slot);
  vacant_.push_back(slot);
}

void BodyGroup::clear_modes(Index slot) {
  for (ModeRows* rows : {&amplitudes_, &rates_, &previous_amplitudes_, &forces_, &delayed_z_, &delayed_rates_})
    rows->clear(slot);
}

void BodyGroup::set_pose(Index slot, const RigidTransform& X_WB) {
  body(slot).frame.set_pose(X_WB);
  body(slot).previous_pose = body(slot).frame.pose();
}

void BodyGroup::set_velocity(Index slot, const Vec3& velocity, const Vec3& angular_velocity) {
  body(slot).frame.set_velocity(constants_, velocity, angular_velocity);
}

void BodyGroup::set_amplitudes(Index slot, std::span<const double> amplitudes, std::span<const double> rates) {
  std::copy(amplitudes.begin(), amplitudes.end(), amplitudes_.modes(slot).begin());
  std::copy(rates.begin(), rates.end(), rates_.modes(slot).begin());
  previous_amplitudes_.copy_from(amplitudes_, slot);
}

void BodyGroup::set_parent(Index slot, const KinematicFrame& at_step_end) { body(slot).frame.set_parent(at_step_end); }

Vec3 BodyGroup::position(Index slot, const SurfacePoint& at) const {
  return frame(slot).pose() * deformed_point(*model_, at, amplitudes(slot));
}

Vec3 BodyGroup::velocity(Index slot, const SurfacePoint& at) const {
  const RigidFrame& f = frame(slot);
  const Vec3 arm = f.pose().q * deformed_point(*model_, at, amplitudes(slot));
  return f.velocity() + f.angular_velocity(constants_).cross(arm) + f.pose().q * displacement(*model_, at, rates(slot));
}

void BodyGroup::apply_force(Index slot, const SurfacePoint& at, const Vec3& newtons) {
  Body& b = body(slot);
  const Quaternion& q_WB = b.frame.pose().q;
  b.force += newtons;
  b.torque += (q_WB * deformed_point(*model_, at, amplitudes(slot))).cross(newtons);
  add_modal_force(*model_, at, q_WB.conjugate() * newtons, forces_.modes(slot));
  b.modes_loaded = true;
}

void BodyGroup::apply_impulse(Index slot, const SurfacePoint& at, const Vec3& newton_seconds, double delay) {
  Body& b = body(slot);
  const Quaternion q_WB = b.frame.pose().q;
  b.frame.apply_impulse(constants_, newton_seconds,
                        (q_WB * deformed_point(*model_, at, amplitudes(slot))).cross(newton_seconds));
  const Vec3 impulse_B = q_WB.conjugate() * newton_seconds;
  if (delay == 0.0) return add_modal_force(*model_, at, impulse_B, rates_.modes(slot));
  const ModalModelData& data = model_->data();
  const std::span<double> z = delayed_z_.modes(slot), rates = delayed_rates_.modes(slot);
  for (std::size_t i = 0; i < z.size(); ++i) {
    const Mode mode{data.eigenvalues[i], data.decays[i]};
    const double j = shape_at(*model_, at, static_cast<Index>(i)).dot(impulse_B);
    const ModeState change = impulse_response(mode, table_.step() - delay, j);
    z[i] += change.z;
    rates[i] += change.zdot;
  }
  b.modes_delayed = true;
}

void BodyGroup::advance(Index begin, Index end, const Vec3& gravity) {
  for (Index slot = begin; slot < end; ++slot)
    if (body(slot).occupied) advance_body(slot, gravity);
}

void BodyGroup::advance_body(Index slot, const Vec3& gravity) {
  Body& b = body(slot);
  b.previous_pose = b.frame.pose();
  previous_amplitudes_.copy_from(amplitudes_, slot);

  const FrameLoad load{gravity, b.force, b.torque};
  const double h = table_.step();
  const FrameExcitation excitation = b.frame.begin_step(constants_, load, first_moment(slot), h);
  if (!couplings_.empty()) excite_modes(slot, excitation);
  advance_modes(slot, b);
  b.frame.end_step(constants_, load, first_moment(slot), h);
  b.force = b.torque = Vec3::Zero();
}

void BodyGroup::advance_modes(Index slot, Body& b) {
  if (table_.modes() == 0) return;
  if (b.modes_loaded) {
    table_.advance(amplitudes_.row(slot), rates_.row(slot), forces_.row(slot));
    forces_.clear(slot);
    b.modes_loaded = false;
  } else {
    table_.advance_free(amplitudes_.row(slot), rates_.row(slot));
  }
  if (!b.modes_delayed) return;
  for (Index i = 0; i < table_.modes(); ++i) {
    amplitudes_.row(slot)[i] += delayed_z_.row(slot)[i];
    rates_.row(slot)[i] += delayed_rates_.row(slot)[i];
  }
  delayed_z_.clear(slot);
  delayed_rates_.clear(slot);
  b.modes_delayed = false;
}

void BodyGroup::excite_modes(Index slot, const FrameExcitation& excitation) {
  const std::span<double> g = forces_.modes(slot);
  for (std::size_t i = 0; i < g.size(); ++i) {
    const Coupling& c = couplings_[i];
    g[i] += c.field.dot(excitation.field) + c.angular_acceleration.dot(excitation.angular_acceleration) +
            c.spin.cwiseProduct(excitation.spin).sum();
  }
  body(slot).modes_loaded = true;
}

Vec3 BodyGroup::first_moment(Index slot) const {
  Vec3 s = constants_.mass * constants_.center_of_mass;
  const std::span<const double> z = amplitudes(slot);
  for (std::size_t i = 0; i < couplings_.size(); ++i) s += z[i] * couplings_[i].field;
  return s;
}

}  // namespace limber
