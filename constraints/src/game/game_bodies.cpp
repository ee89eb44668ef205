#include "game_bodies.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "limber/constraints/constraint.h"
#include "limber/core/cross_matrix.h"

namespace limber::internal {
namespace {

bool is_free(const GameBody& body) { return body.group->frame_constants().motion == FrameMotion::kFree; }

/// About the axis of a body on a line, kg·m².
double line_inertia(const FrameConstants& c) { return c.line_axis.dot(c.inertia * c.line_axis); }

void write_matrix(const Mat3& m, float* to) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) to[3 * i + j] = static_cast<float>(m(i, j));
}

void write_vector(const Vec3& v, float* to) {
  for (int i = 0; i < 3; ++i) to[i] = static_cast<float>(v[i]);
}

/// q turned by a Cayley vector, which is a rotation vector to second order.
Quaternion turned(const Quaternion& q, const Vec3& cayley) {
  return normalized(Quaternion{1.0, 0.5 * cayley.x(), 0.5 * cayley.y(), 0.5 * cayley.z()} * q);
}

// Twice the energy of a frame's coordinates per square.
constexpr Block8 kOfFrames{{1.0f, 1.0f, 1.0f, 1.0f, 1.0f, 1.0f, 1.0f, 1.0f}};

double sum_of(const double (&x)[8]) { return ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7])); }

// One lane of eight.
Vec3 vector_in(const Double8* from, std::size_t lane) { return {from[0].v[lane], from[1].v[lane], from[2].v[lane]}; }

Quaternion quaternion_in(const Double8* from, std::size_t lane) {
  return {from[0].v[lane], from[1].v[lane], from[2].v[lane], from[3].v[lane]};
}

void put(const Vec3& v, Double8* to, std::size_t lane) {
  for (Eigen::Index i = 0; i < 3; ++i) to[i].v[lane] = v[i];
}

void put(const Quaternion& q, Double8* to, std::size_t lane) {
  to[0].v[lane] = q.w;
  put(q.vector(), to + 1, lane);
}

void put(const Mat3& m, Double8 (*to)[3], std::size_t lane) {
  for (Eigen::Index i = 0; i < 3; ++i) put(m.row(i), to[i], lane);
}

constexpr std::size_t kBodiesAtOnce = 32;  // of one thread

}  // namespace

SubstepModes& GameBodies::modes_of(const ModalModel& model) {
  for (const auto& known : modes_)
    if (known->model() == &model) return *known;
  return *modes_.emplace_back(std::make_unique<SubstepModes>());
}

void GameBodies::begin_step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                            const SubstepPlan& plan) {
  plan_ = plan;
  bodies_.clear();
  led_.clear();
  by_number_.assign(table.size(), -1);
  frames_.assign((members.size() + kFramesAtOnce - 1) / kFramesAtOnce, {});
  std::int32_t blocks = 0;
  for (const Index member : members) {
    const ConstrainedBody& at = table[static_cast<std::size_t>(member)];
    GameBody body{.group = at.group, .slot = at.slot, .first = blocks};
    const ModalModel& model = at.group->model();
    if (model.modes() > 0) {
      SubstepModes& modes = modes_of(model);
      modes.set(model, plan.length());
      body.modes = &modes;
      body.blocks = 1 + static_cast<std::int32_t>(modes.roots().size() / 8);
    }
    blocks += body.blocks;
    at.group->begin_parts(at.slot);
    const RigidFrame& frame = at.group->frame(at.slot);
    if (!is_free(body)) {
      body.led = static_cast<std::int32_t>(led_.size());
      led_.push_back({frame.parent(), frame.next_parent(), frame.has_next_parent(), frame});
    }
    by_number_[static_cast<std::size_t>(member)] = static_cast<std::int32_t>(bodies_.size());
    bodies_.push_back(body);
    place_frame(bodies_.size() - 1, frame);
  }
  turn_frames({.frames = frames_.data(), .count = frames_.size()}, plan_.step);
  take_axes();
  const auto count = static_cast<std::size_t>(blocks) + 1;
  for (std::vector<Block8>* all : {&motion_, &free_, &answers_, &shapes_}) all->assign(count, {});
  pushes_.assign(bodies_.size() + 1, {});
  shifts_.assign(bodies_.size() + 1, {});
  for (const GameBody& body : bodies_)
    if (body.modes != nullptr) write_modes(body, shapes_);
}

/// Its inertia is that of the step's middle, as far as can be told from how it turns now.
void GameBodies::place_frame(std::size_t at, const RigidFrame& frame) {
  GameBody& body = bodies_[at];
  EightFrames& of = frames_[at / kFramesAtOnce];
  const std::size_t lane = at % kFramesAtOnce;
  const FrameConstants& c = body.group->frame_constants();
  const Quaternion& q = frame.pose().q;
  of.first[lane] = body.first;
  body.start = {frame.pose().p, to_matrix(q)};
  put(body.start.R, of.start, lane);
  put(q, of.now.attitude, lane);
  put(frame.velocity(), of.now.v, lane);
  of.loads.left.v[lane] = of.loads.turn_left.v[lane] = 1.0;
  of.turns_axes.v[lane] = of.per_root.v[lane] = 0.0;
  body.turns_locked = frame.settings().locks.rotation != AxisLocks{}.rotation;
  if (c.motion == FrameMotion::kKinematic) return;
  for (std::size_t i = 0; i < 3; ++i)
    if (frame.settings().locks.translation[i]) body.goes[static_cast<Eigen::Index>(i)] = 0.0;
  if (c.motion == FrameMotion::kFree) {
    body.root_mass = std::sqrt(c.mass);
    body.shift = plan_.length() / body.root_mass * body.goes;
    of.root_mass.v[lane] = body.root_mass, of.per_root.v[lane] = 1.0 / body.root_mass;
    tell_loads(at);
  }
  body.roots = c.motion == FrameMotion::kLine ? Vec3(std::sqrt(line_inertia(c)), 0.0, 0.0)
                                              : Vec3(c.principal.moments.cwiseSqrt());
  const Mat3 axes = to_matrix(c.principal.q_BP);
  put(axes, of.principal, lane);
  put(body.roots, of.roots, lane);
  put(Vec3(body.roots.unaryExpr([](double root) { return root > 0.0 ? 1.0 / root : 0.0; })), of.per_turn, lane);
  if (c.motion != FrameMotion::kLine && !body.turns_locked) {
    of.turns_axes.v[lane] = 1.0;
    put(Mat3::Identity(), of.momentum, lane);
    put(frame.angular_momentum(c), of.now.turn, lane);
    return;
  }
  set_axes(at, turned(q, 0.5 * plan_.step * frame.angular_velocity(c)));
  if (c.motion != FrameMotion::kLine) put(body.turn_scale * frame.angular_momentum(c), of.now.turn, lane);
}

void GameBodies::take_axes() {
  for (std::size_t at = 0; at < bodies_.size(); ++at) {
    const EightFrames& of = frames_[at / kFramesAtOnce];
    const std::size_t lane = at % kFramesAtOnce;
    if (of.turns_axes.v[lane] > 0.0)
      for (Eigen::Index i = 0; i < 3; ++i) bodies_[at].turn_scale.row(i) = vector_in(of.turn_scale[i], lane);
  }
}

void GameBodies::keep_axes(std::int32_t at) {
  const auto i = static_cast<std::size_t>(at);
  GameBody& body = bodies_[i];
  body.keeps_axes = true;
  frames_[i / kFramesAtOnce].turns_axes.v[i % kFramesAtOnce] = 0.0;
  if (body.led < 0 && !body.turns_locked) frames_[i / kFramesAtOnce].keeps_axes.v[i % kFramesAtOnce] = 1.0;
}

/// Of bodies on a line and with locks, whose inertia that turn_frames() does not know.
void GameBodies::set_axes(std::size_t at, const Quaternion& attitude) {
  GameBody& body = bodies_[at];
  const FrameConstants& c = body.group->frame_constants();
  if (c.motion == FrameMotion::kLine) {
    body.turn_scale.row(0) = (attitude * c.line_axis).transpose() / body.roots.x();
  } else {
    const Mat3 R = to_matrix(attitude);
    const TurnAxes turns(R * c.inertia * R.transpose(), settings(body).locks);
    body.roots = turns.moments.cwiseSqrt();
    for (Eigen::Index i = 0; i < 3; ++i)
      if (body.roots[i] > 0.0) body.turn_scale.row(i) = turns.axes.col(i).transpose() / body.roots[i];
  }
  EightFrames& of = frames_[at / kFramesAtOnce];
  put(body.turn_scale, of.turn_scale, at % kFramesAtOnce);
  put(Mat3(body.roots.cwiseAbs2().asDiagonal() * body.turn_scale), of.momentum, at % kFramesAtOnce);
  put(body.turn_scale * vector_in(of.loads.torque, at % kFramesAtOnce), of.loads.turn_gain, at % kFramesAtOnce);
}

Vec3 GameBodies::momentum_of(std::size_t at) const {
  const GameBody& body = bodies_[at];
  const Vec3 turn = vector_in(frames_[at / kFramesAtOnce].now.turn, at % kFramesAtOnce);
  return body.turn_scale.transpose() * body.roots.cwiseAbs2().cwiseProduct(turn);
}

void GameBodies::turn_axes() {
  turn_frames({.frames = frames_.data(), .count = frames_.size()}, 0.0);
  take_axes();
  for (std::size_t at = 0; at < bodies_.size(); ++at) {
    const GameBody& body = bodies_[at];
    const FrameConstants& c = body.group->frame_constants();
    EightFrames& of = frames_[at / kFramesAtOnce];
    if (body.keeps_axes || c.motion == FrameMotion::kKinematic || of.turns_axes.v[at % kFramesAtOnce] > 0.0) continue;
    const Quaternion q = quaternion_in(of.now.attitude, at % kFramesAtOnce);
    const Vec3 momentum = momentum_of(at);
    set_axes(at, q);
    const Vec3 omega = body.turn_scale.transpose() * (body.turn_scale * momentum);
    set_axes(at, turned(q, 0.5 * plan_.length() * omega));
    if (c.motion != FrameMotion::kLine) put(body.turn_scale * momentum, of.now.turn, at % kFramesAtOnce);
  }
}

void GameBodies::write_frame_row(const GameBody& body, const Vec3& linear, const Vec3& moment, Block8& row) const {
  const double h = plan_.length();
  row = {};
  write_vector(linear.cwiseProduct(body.shift), row.v);
  write_vector(h * (body.turn_scale * moment), row.v + 3);
}

void GameBodies::write_energy_slopes(std::int32_t at, const std::vector<Block8>& frames, double* to) const {
  const GameBody& body = bodies_[static_cast<std::size_t>(at)];
  std::fill_n(to, 8 * body.blocks, 0.0);
  for (int l = 0; l < 6; ++l) to[l] = static_cast<double>(frames[static_cast<std::size_t>(body.first)].v[l]);
  if (body.modes == nullptr) return;
  const std::span<const double> z = body.group->amplitudes(body.slot), rates = body.group->rates(body.slot);
  const std::vector<double>& lambda = body.group->model().data().eigenvalues;
  for (std::size_t m = 0; m < z.size(); ++m)
    to[8 + m] = static_cast<double>(body.modes->roots()[m]) * lambda[m] * z[m] +
                static_cast<double>(body.modes->rates()[m]) * rates[m];
}

FrameLoad GameBodies::load_of(const GameBody& body) const {
  return {body.group->own_gravity(body.slot, plan_.gravity), body.group->held_force(body.slot),
          body.group->held_torque(body.slot)};
}

template <class Visit>
void GameBodies::for_all(Jobs& jobs, const Visit& visit) const {
  const auto part = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) visit(i);
  };
  jobs.parallel_for(bodies_.size(), kBodiesAtOnce, std::ref(part));
}

template <class Visit>
void GameBodies::for_all_frames(Jobs& jobs, const Visit& visit) {
  const FrameArrays all{frames_.data(), frames_.size(), shifts_.data(),  pushes_.data(),
                        free_.data(),   motion_.data(), answers_.data(), plan_.length()};
  const auto part = [&](std::size_t begin, std::size_t end) { visit(all.part(begin, end)); };
  jobs.parallel_for(frames_.size(), kBodiesAtOnce / kFramesAtOnce, std::ref(part));
}

void GameBodies::begin_substep(int number, Jobs& jobs) {
  for_all_frames(jobs, [](const FrameArrays& part) { begin_frames(part); });
  for_all(jobs, [&](std::size_t i) { begin_beside_frame(i, number); });
}

/// What leads it, and its modes.
void GameBodies::begin_beside_frame(std::size_t at, int number) {
  GameBody& body = bodies_[at];
  if (body.modes == nullptr && body.led < 0) return;
  FrameExcitation excitation;
  if (body.led >= 0) excitation = lead(at, number);
  if (body.modes != nullptr) {
    body.group->advance_modes(body.slot, body.modes->flow(), number, plan_.count, excitation);
    write_modes(body, free_);
  }
  if (body.led >= 0) swing(at);
  for (auto i = static_cast<std::size_t>(body.first), end = i + static_cast<std::size_t>(body.blocks); i < end; ++i)
    for (int l = 0; l < 8; ++l) motion_[i].v[l] = free_[i].v[l] + answers_[i].v[l];
}

void GameBodies::find_answers(std::span<const double> moved, Jobs& jobs) {
  for_all(jobs, [&](std::size_t at) {
    GameBody& body = bodies_[at];
    double along[8] = {}, square[8] = {};
    const auto first = static_cast<std::size_t>(body.first), end = first + static_cast<std::size_t>(body.blocks);
    for (std::size_t i = first; i < end; ++i) {
      const float* energy = i == first ? kOfFrames.v : body.modes->energies().data() + 8 * (i - first - 1);
      for (std::size_t l = 0; l < 8; ++l) {
        const double start = static_cast<double>(free_[i].v[l]) + (moved.empty() ? 0.0 : moved[8 * i + l]);
        const double q = static_cast<double>(motion_[i].v[l]) - start;
        along[l] += q * start, square[l] += static_cast<double>(energy[l]) * q * q;
      }
    }
    body.along = sum_of(along), body.square = sum_of(square);
  });
}

void GameBodies::scale_answer(std::size_t at, float share, std::span<const double> moved) {
  const auto first = static_cast<std::size_t>(bodies_[at].first), blocks = static_cast<std::size_t>(bodies_[at].blocks);
  for (std::size_t i = first; i < first + blocks; ++i)
    for (std::size_t l = 0; l < 8; ++l) {
      const float start = free_[i].v[l] + (moved.empty() ? 0.0f : static_cast<float>(moved[8 * i + l]));
      motion_[i].v[l] = start + share * (motion_[i].v[l] - start);
    }
}

/// Held forces come at the substep's start, so that what rests has no velocity. Of the substep that begins, velocities
/// are damped as they would be at its end.
void GameBodies::tell_loads(std::size_t at) {
  const GameBody& body = bodies_[at];
  EightFrames& of = frames_[at / kFramesAtOnce];
  const std::size_t lane = at % kFramesAtOnce;
  const double h = plan_.length();
  const FrameLoad load = load_of(body);
  const Decay moving(settings(body).linear_damping * h), turning(settings(body).angular_damping * h);
  const Vec3 acceleration = load.gravity + load.force / body.group->frame_constants().mass;
  of.loads.left.v[lane] = moving.left, of.loads.turn_left.v[lane] = turning.left;
  put(h * moving.first * acceleration.cwiseProduct(body.goes), of.loads.gain, lane);
  put(h * turning.first * load.torque, of.loads.torque, lane);
}

Vec3 GameBodies::fall_of(std::int32_t number) const {
  if (number < 0) return Vec3::Zero();
  const auto at = static_cast<std::size_t>(number);
  return plan_.length() * vector_in(frames_[at / kFramesAtOnce].loads.gain, at % kFramesAtOnce);
}

/// A body with fixed nodes: its parent goes through the substep, and it begins to swing there as it would by itself.
FrameExcitation GameBodies::lead(std::size_t at, int number) {
  const GameBody& body = bodies_[at];
  FrameShift& shift = shifts_[at];
  const FrameConstants& c = body.group->frame_constants();
  const RigidFrame& now = body.group->frame(body.slot);
  LedBody& led = led_[static_cast<std::size_t>(body.led)];
  led.free = now;
  if (led.told)
    led.free.set_parent(between(led.start, led.target, static_cast<double>(number + 1) / plan_.count, plan_.step));
  const FrameExcitation excitation =
      led.free.begin_step(c, load_of(body), body.group->first_moment(body.slot), plan_.length());
  write_vector(led.free.pose().p - now.pose().p, shift.carried);
  Vec3 turn = Vec3::Zero();
  if (c.motion != FrameMotion::kPoint)
    turn = rotation_vector(led.free.parent().pose.q * now.parent().pose.q.conjugate());
  write_vector(turn, shift.carried_turn);
  write_matrix(cross_matrix(turn) * to_matrix(now.pose().q), shift.swung);
  return excitation;
}

/// To the end of the substep.
void GameBodies::swing(std::size_t at) {
  const GameBody& body = bodies_[at];
  EightFrames& of = frames_[at / kFramesAtOnce];
  const std::size_t lane = at % kFramesAtOnce;
  const FrameConstants& c = body.group->frame_constants();
  RigidFrame& free = led_[static_cast<std::size_t>(body.led)].free;
  free.end_step(c, load_of(body), body.group->first_moment(body.slot), plan_.length());
  if (c.motion == FrameMotion::kPoint) put(body.turn_scale * free.angular_momentum(c), of.now.turn, lane);
  if (c.motion == FrameMotion::kLine)
    of.now.turn[0].v[lane] =
        std::sqrt(line_inertia(c)) *
        (free.pose().q * c.line_axis).dot(free.angular_velocity(c) - free.parent().angular_velocity);
  const Vec3 turn = vector_in(of.now.turn, lane);
  put(turn, of.now.free_turn, lane);
  write_vector(turn, free_[static_cast<std::size_t>(body.first)].v + 3);
}

void GameBodies::write_modes(const GameBody& body, std::vector<Block8>& to) const {
  const std::span<const double> z = body.group->amplitudes(body.slot);
  const std::vector<float>& inverse = body.modes->inverse_roots();
  Block8* blocks = &to[static_cast<std::size_t>(body.first + 1)];
  for (std::size_t i = 0; i < z.size(); ++i) blocks[i / 8].v[i % 8] = static_cast<float>(z[i]) * inverse[i];
}

void GameBodies::end_substep(bool pushed, Jobs& jobs) {
  for_all_frames(jobs, [&](const FrameArrays& part) { end_frames(part, pushed); });
  for_all(jobs, [&](std::size_t i) { end_beside_frame(i); });
}

void GameBodies::end_beside_frame(std::size_t at) {
  GameBody& body = bodies_[at];
  if (body.modes != nullptr) move_modes(body);
  if (body.led >= 0)
    turn_led(at, quaternion_in(frames_[at / kFramesAtOnce].now.turned, at % kFramesAtOnce));
  else if (plan_.seen)
    body.group->frame_in_parts(body.slot).place(pose_of(at));
}

void GameBodies::move_modes(GameBody& body) {
  const std::span<double> z = body.group->amplitudes_in_parts(body.slot), rates = body.group->rates_in_parts(body.slot);
  const auto first = static_cast<std::size_t>(body.first), end = first + static_cast<std::size_t>(body.blocks);
  for (std::size_t i = first + 1; i < end; ++i)
    for (int l = 0; l < 8; ++l) answers_[i].v[l] = motion_[i].v[l] - free_[i].v[l];
  const Block8* q = &answers_[first + 1];
  const std::vector<float>&roots = body.modes->roots(), &by = body.modes->rates();
  for (std::size_t i = 0; i < z.size(); ++i) {
    const double change = static_cast<double>(q[i / 8].v[i % 8]);
    z[i] += static_cast<double>(roots[i]) * change;
    rates[i] += static_cast<double>(by[i]) * change;
  }
  write_modes(body, shapes_);
}

void GameBodies::displace(std::int32_t number, const double* speed, const double* place) {
  const auto at = static_cast<std::size_t>(number);
  const GameBody& body = bodies_[at];
  EightFrames& of = frames_[at / kFramesAtOnce];
  const std::size_t lane = at % kFramesAtOnce;
  const double h = plan_.length();
  const auto vector = [](const double* from) { return Vec3(from[0], from[1], from[2]); };
  put(vector_in(of.now.turn, lane) + vector(speed + 3), of.now.turn, lane);
  const auto way = [&](const Vec3& by) { return Vec3(h * (body.turn_scale.transpose() * by)); };
  if (of.turns_axes.v[lane] > 0.0)
    put(way(vector(place + 3)), of.now.way, lane);
  else
    put(turned(quaternion_in(of.now.attitude, lane), way(vector(speed + 3) + vector(place + 3))), of.now.attitude,
        lane);
  if (body.led < 0) {
    put(vector_in(of.now.v, lane) + vector(speed) / body.root_mass, of.now.v, lane);
    put(vector_in(of.now.shift, lane) + h / body.root_mass * (vector(speed) + vector(place)), of.now.shift, lane);
  }
  if (body.modes == nullptr) return;
  const std::span<double> z = body.group->amplitudes_in_parts(body.slot), rates = body.group->rates_in_parts(body.slot);
  const std::vector<float>&roots = body.modes->roots(), &by = body.modes->rates();
  for (std::size_t i = 0; i < z.size(); ++i) {
    z[i] += static_cast<double>(roots[i]) * (speed[8 + i] + place[8 + i]);
    rates[i] += static_cast<double>(by[i]) * speed[8 + i];
  }
  write_modes(body, shapes_);
}

void GameBodies::end_displacing(bool again) {
  place_frames({.frames = frames_.data(), .count = frames_.size(), .length = plan_.length()}, again);
}

void GameBodies::write_motion(std::int32_t number, double* to) const {
  const auto at = static_cast<std::size_t>(number), lane = at % kFramesAtOnce;
  const GameBody& body = bodies_[at];
  const EightFrames::Now& now = frames_[at / kFramesAtOnce].now;
  for (std::size_t i = 0; i < 3; ++i) to[i] = body.root_mass * now.v[i].v[lane], to[3 + i] = now.turn[i].v[lane];
  to[6] = to[7] = 0.0;
  for (std::int32_t b = 1; b < body.blocks; ++b)
    for (std::int32_t l = 0; l < 8; ++l)
      to[8 * b + l] = static_cast<double>(shapes_[static_cast<std::size_t>(body.first + b)].v[l]);
}

void GameBodies::tell(std::int32_t number) {
  const auto at = static_cast<std::size_t>(number);
  if (bodies_[at].led >= 0) return tell_led(at);
  bodies_[at].group->frame_in_parts(bodies_[at].slot).place(pose_of(at));
}

/// All of its motion, to its group.
void GameBodies::show(std::size_t at) {
  GameBody& body = bodies_[at];
  const EightFrames& of = frames_[at / kFramesAtOnce];
  const std::size_t lane = at % kFramesAtOnce;
  body.group->frame_in_parts(body.slot).set_motion(pose_of(at), vector_in(of.now.v, lane), momentum_of(at));
}

RigidTransform GameBodies::pose_of(std::size_t at) const {
  const EightFrames& of = frames_[at / kFramesAtOnce];
  const std::size_t lane = at % kFramesAtOnce;
  return {quaternion_in(of.now.attitude, lane), bodies_[at].start.p + vector_in(of.now.shift, lane)};
}

/// Where its parent has brought it, turned as constraints have it.
void GameBodies::turn_led(std::size_t at, const Quaternion& turned) {
  const GameBody& body = bodies_[at];
  Double8* attitude = frames_[at / kFramesAtOnce].now.attitude;
  const std::size_t lane = at % kFramesAtOnce;
  const FrameConstants& c = body.group->frame_constants();
  const RigidFrame& end = led_[static_cast<std::size_t>(body.led)].free;
  const Quaternion q = turned * quaternion_in(attitude, lane);
  if (c.motion == FrameMotion::kPoint)
    put(normalized(q), attitude, lane);
  else if (c.motion == FrameMotion::kLine)
    put(normalized(end.parent().pose.q * body.group->frame(body.slot).parent().pose.q.conjugate() * q), attitude, lane);
  else
    put(end.pose().q, attitude, lane);
  tell_led(at);
}

void GameBodies::tell_led(std::size_t at) {
  const GameBody& body = bodies_[at];
  EightFrames& of = frames_[at / kFramesAtOnce];
  const std::size_t lane = at % kFramesAtOnce;
  const FrameConstants& c = body.group->frame_constants();
  const Quaternion q = quaternion_in(of.now.attitude, lane);
  RigidFrame& end = led_[static_cast<std::size_t>(body.led)].free;
  if (c.motion == FrameMotion::kPoint) end.set_turn(c, q, momentum_of(at));
  if (c.motion == FrameMotion::kLine) {
    const Vec3 omega =
        end.parent().angular_velocity + of.now.turn[0].v[lane] / std::sqrt(line_inertia(c)) * (q * c.line_axis);
    end.set_turn(c, q, q * (c.inertia * (q.conjugate() * omega)));
  }
  body.group->frame_in_parts(body.slot) = end;
  put(end.pose().p - body.start.p, of.now.shift, lane);
  put(end.velocity(), of.now.v, lane);
}

void GameBodies::end_step() {
  for (std::size_t at = 0; at < bodies_.size(); ++at) {
    const GameBody& body = bodies_[at];
    if (body.led < 0) show(at);
    if (body.modes != nullptr) leave_resting_rates(body);
    body.group->end_parts(body.slot);
  }
}

void GameBodies::leave_resting_rates(const GameBody& body) const {
  const std::span<double> rates = body.group->resting_rates_in_parts(body.slot);
  const Block8* q = &answers_[static_cast<std::size_t>(body.first + 1)];
  for (std::size_t i = 0; i < rates.size(); ++i)
    rates[i] = static_cast<double>(body.modes->rest_rates()[i]) * static_cast<double>(q[i / 8].v[i % 8]);
}

bool GameBodies::all_finite() const {
  const auto finite = [](double x) { return std::isfinite(x); };
  for (std::size_t at = 0; at < bodies_.size(); ++at) {
    const GameBody& body = bodies_[at];
    const EightFrames& of = frames_[at / kFramesAtOnce];
    for (const Double8* field : {of.now.shift, of.now.v, of.now.turn})
      if (!vector_in(field, at % kFramesAtOnce).allFinite()) return false;
    if (!std::ranges::all_of(body.group->amplitudes(body.slot), finite) ||
        !std::ranges::all_of(body.group->rates(body.slot), finite))
      return false;
  }
  return true;
}

}  // namespace limber::internal
