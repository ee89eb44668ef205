#include "game_bodies.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "limber/constraints/constraint.h"

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

Vec3 read_vector(const float* from) { return {from[0], from[1], from[2]}; }

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
    place_frame(body, frame);
    if (!is_free(body)) {
      body.led = static_cast<std::int32_t>(led_.size());
      led_.push_back({frame.parent(), frame.next_parent(), frame.has_next_parent(), frame});
    }
    by_number_[static_cast<std::size_t>(member)] = static_cast<std::int32_t>(bodies_.size());
    bodies_.push_back(body);
  }
  const auto count = static_cast<std::size_t>(blocks) + 1;
  for (std::vector<Block8>* all : {&motion_, &free_, &answers_, &shapes_}) all->assign(count, {});
  pushes_.assign(bodies_.size() + 1, {});
  shifts_.assign(bodies_.size() + 1, {});
  for (const GameBody& body : bodies_)
    if (body.modes != nullptr) write_modes(body, shapes_);
}

/// Its inertia is that of the step's middle, as far as can be told from how it turns now.
void GameBodies::place_frame(GameBody& body, const RigidFrame& frame) {
  const FrameConstants& c = body.group->frame_constants();
  body.start.p = frame.pose().p;
  body.q = frame.pose().q;
  body.start.R = to_matrix(body.q);
  body.v = frame.velocity();
  body.turns_locked = frame.settings().locks.rotation != AxisLocks{}.rotation;
  if (c.motion == FrameMotion::kKinematic) return;
  if (c.motion == FrameMotion::kFree) body.root_mass = std::sqrt(c.mass);
  for (std::size_t i = 0; i < 3; ++i)
    if (frame.settings().locks.translation[i]) body.goes[static_cast<Eigen::Index>(i)] = 0.0;
  body.roots = c.motion == FrameMotion::kLine ? Vec3(std::sqrt(line_inertia(c)), 0.0, 0.0)
                                              : Vec3(c.principal.moments.cwiseSqrt());
  set_axes(body, turned(body.q, 0.5 * plan_.step * frame.angular_velocity(c)));
  if (c.motion != FrameMotion::kLine) body.turn = body.turn_scale * frame.angular_momentum(c);
  if (c.motion != FrameMotion::kFree) return;
  const Mat3 axes = to_matrix(c.principal.q_BP);
  body.inverse_inertia = axes * c.principal.moments.cwiseInverse().asDiagonal() * axes.transpose();
}

void GameBodies::set_axes(GameBody& body, const Quaternion& attitude) {
  const FrameConstants& c = body.group->frame_constants();
  if (c.motion == FrameMotion::kLine) {
    body.turn_scale.row(0) = (attitude * c.line_axis).transpose() / body.roots.x();
  } else if (body.turns_locked) {
    const Mat3 R = to_matrix(attitude);
    const TurnAxes turns(R * c.inertia * R.transpose(), settings(body).locks);
    body.roots = turns.moments.cwiseSqrt();
    for (Eigen::Index i = 0; i < 3; ++i)
      if (body.roots[i] > 0.0) body.turn_scale.row(i) = turns.axes.col(i).transpose() / body.roots[i];
  } else {
    body.turn_scale = body.roots.cwiseInverse().asDiagonal() * to_matrix(attitude * c.principal.q_BP).transpose();
  }
}

void GameBodies::turn_axes() {
  for (GameBody& body : bodies_) {
    const FrameConstants& c = body.group->frame_constants();
    if (body.keeps_axes || c.motion == FrameMotion::kKinematic) continue;
    const Vec3 momentum = body.momentum();
    set_axes(body, body.q);
    const Vec3 omega = body.turn_scale.transpose() * (body.turn_scale * momentum);
    set_axes(body, turned(body.q, 0.5 * plan_.length() * omega));
    if (c.motion != FrameMotion::kLine) body.turn = body.turn_scale * momentum;
  }
}

/// Where rows are of an attitude that the body has left, its momentum no longer tells how it turns: by the inertia in
/// the middle of the substep. @param R the attitude now
Vec3 GameBodies::free_turn(const GameBody& body, const Mat3& R) const {
  if (!body.keeps_axes || body.led >= 0 || body.turns_locked) return body.turn;
  const double half = 0.5 * plan_.length();
  const Vec3 momentum = R.transpose() * body.momentum();  // body axes
  const Vec3 now = body.inverse_inertia * momentum;
  const Vec3 middle = body.inverse_inertia * (momentum + half * momentum.cross(now));
  return body.roots.cwiseProduct(body.roots.cwiseProduct(body.turn_scale * (R * (middle + half * now.cross(middle)))));
}

void GameBodies::write_frame_row(const GameBody& body, const Vec3& linear, const Vec3& moment, Block8& row) const {
  const double h = plan_.length();
  row = {};
  if (body.root_mass > 0.0) write_vector(h / body.root_mass * linear.cwiseProduct(body.goes), row.v);
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
  constexpr std::size_t kBodiesAtOnce = 32;
  const auto part = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) visit(i);
  };
  jobs.parallel_for(bodies_.size(), kBodiesAtOnce, std::ref(part));
}

void GameBodies::begin_substep(int number, Jobs& jobs) {
  for_all(jobs, [&](std::size_t i) { begin_substep_of(i, number); });
}

void GameBodies::begin_substep_of(std::size_t at, int number) {
  GameBody& body = bodies_[at];
  const Mat3 R = to_matrix(body.q);
  tell_shift(at, R);
  FrameExcitation excitation;
  if (body.led < 0)
    fall(body);
  else
    excitation = lead(body, number, shifts_[at]);
  if (body.modes != nullptr) {
    body.group->advance_modes(body.slot, body.modes->flow(), number, plan_.count, excitation);
    write_modes(body, free_);
  }
  if (body.led >= 0) swing(body);
  Block8& frame = free_[static_cast<std::size_t>(body.first)];
  write_vector(body.root_mass * body.v, frame.v);
  body.free_turn = free_turn(body, R);
  write_vector(body.free_turn, frame.v + 3);
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
void GameBodies::fall(GameBody& body) const {
  const double h = plan_.length();
  const FrameLoad load = load_of(body);
  const Decay moving(settings(body).linear_damping * h), turning(settings(body).angular_damping * h);
  const Vec3 acceleration = load.gravity + load.force / body.group->frame_constants().mass;
  body.v = moving.left * body.v + h * moving.first * acceleration.cwiseProduct(body.goes);
  body.turn *= turning.left;
  if (!load.torque.isZero(0.0)) body.turn += h * turning.first * (body.turn_scale * load.torque);
}

Vec3 GameBodies::fall_of(std::int32_t at) const {
  if (at < 0 || body(at).led >= 0) return Vec3::Zero();
  const GameBody& falls = body(at);
  const FrameLoad load = load_of(falls);
  const double h = plan_.length();
  const Vec3 acceleration = load.gravity + load.force / falls.group->frame_constants().mass;
  return h * h * Decay(settings(falls).linear_damping * h).first * acceleration.cwiseProduct(falls.goes);
}

/// A body with fixed nodes: its parent goes through the substep, and it begins to swing there as it would by itself.
FrameExcitation GameBodies::lead(GameBody& body, int number, FrameShift& shift) {
  const FrameConstants& c = body.group->frame_constants();
  const RigidFrame& now = body.group->frame(body.slot);
  LedBody& led = led_[static_cast<std::size_t>(body.led)];
  led.free = now;
  if (led.told)
    led.free.set_parent(between(led.start, led.target, static_cast<double>(number + 1) / plan_.count, plan_.step));
  const FrameExcitation excitation =
      led.free.begin_step(c, load_of(body), body.group->first_moment(body.slot), plan_.length());
  shift.is_carried = true;
  write_matrix(to_matrix(now.pose().q), shift.attitude);
  write_vector(led.free.pose().p - now.pose().p, shift.carried);
  const Vec3 turn = rotation_vector(led.free.parent().pose.q * now.parent().pose.q.conjugate());
  write_vector(c.motion == FrameMotion::kPoint ? Vec3(Vec3::Zero()) : turn, shift.carried_turn);
  return excitation;
}

/// To the end of the substep.
void GameBodies::swing(GameBody& body) {
  const FrameConstants& c = body.group->frame_constants();
  RigidFrame& free = led_[static_cast<std::size_t>(body.led)].free;
  free.end_step(c, load_of(body), body.group->first_moment(body.slot), plan_.length());
  if (c.motion == FrameMotion::kPoint) body.turn = body.turn_scale * free.angular_momentum(c);
  if (c.motion == FrameMotion::kLine)
    body.turn.x() = std::sqrt(line_inertia(c)) *
                    (free.pose().q * c.line_axis).dot(free.angular_velocity(c) - free.parent().angular_velocity);
}

void GameBodies::write_modes(const GameBody& body, std::vector<Block8>& to) const {
  const std::span<const double> z = body.group->amplitudes(body.slot);
  const std::vector<float>& inverse = body.modes->inverse_roots();
  Block8* blocks = &to[static_cast<std::size_t>(body.first + 1)];
  for (std::size_t i = 0; i < z.size(); ++i) blocks[i / 8].v[i % 8] = static_cast<float>(z[i]) * inverse[i];
}

void GameBodies::end_substep(bool pushed, Jobs& jobs) {
  for_all(jobs, [&](std::size_t i) { end_substep_of(i, pushed); });
}

void GameBodies::end_substep_of(std::size_t at, bool pushed) {
  GameBody& body = bodies_[at];
  for (auto i = static_cast<std::size_t>(body.first), end = i + static_cast<std::size_t>(body.blocks); i < end; ++i)
    for (int l = 0; l < 8; ++l) answers_[i].v[l] = motion_[i].v[l] - free_[i].v[l];
  if (body.modes != nullptr) move_modes(body);
  move_frame(at, pushed);
}

void GameBodies::move_modes(GameBody& body) {
  const std::span<double> z = body.group->amplitudes_in_parts(body.slot), rates = body.group->rates_in_parts(body.slot);
  const Block8* q = &answers_[static_cast<std::size_t>(body.first + 1)];
  const std::vector<float>&roots = body.modes->roots(), &by = body.modes->rates();
  for (std::size_t i = 0; i < z.size(); ++i) {
    const double change = static_cast<double>(q[i / 8].v[i % 8]);
    z[i] += static_cast<double>(roots[i]) * change;
    rates[i] += static_cast<double>(by[i]) * change;
  }
  write_modes(body, shapes_);
}

void GameBodies::move_frame(std::size_t at, bool pushed) {
  GameBody& body = bodies_[at];
  const double h = plan_.length();
  const Block8 &q = answers_[static_cast<std::size_t>(body.first)], &push = pushes_[at];
  const Vec3 change = read_vector(q.v + 3);
  body.turn += change;
  Vec3 turn = h * (body.turn_scale.transpose() * (body.free_turn + change));
  if (pushed) turn += h * (body.turn_scale.transpose() * read_vector(push.v + 3));
  const Quaternion turned = quaternion_from_rotation_vector(turn);
  if (body.led < 0) {
    body.v += read_vector(q.v) / body.root_mass;
    body.shift += h * body.v;
    if (pushed) body.shift += h / body.root_mass * read_vector(push.v);
    body.q = normalized(turned * body.q);
    if (plan_.seen) show(body);
  } else {
    turn_led(body, turned);
  }
}

void GameBodies::tell_shift(std::size_t at, const Mat3& R) {
  const GameBody& body = bodies_[at];
  write_vector(body.shift, shifts_[at].shift);
  write_matrix(R - body.start.R, shifts_[at].turned);
}

void GameBodies::displace(std::int32_t at, const double* speed, const double* place) {
  GameBody& body = bodies_[static_cast<std::size_t>(at)];
  const double h = plan_.length();
  const auto vector = [](const double* from) { return Vec3(from[0], from[1], from[2]); };
  body.turn += vector(speed + 3);
  body.q = turned(body.q, h * (body.turn_scale.transpose() * (vector(speed + 3) + vector(place + 3))));
  if (body.led < 0) {
    body.v += vector(speed) / body.root_mass;
    body.shift += h / body.root_mass * (vector(speed) + vector(place));
    show(body);
  } else {
    tell_led(body);
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

/// To its group.
void GameBodies::show(GameBody& body) const {
  body.group->frame_in_parts(body.slot).set_motion({body.q, body.start.p + body.shift}, body.v, body.momentum());
}

/// Where its parent has brought it, turned as constraints have it.
void GameBodies::turn_led(GameBody& body, const Quaternion& turned) {
  const FrameConstants& c = body.group->frame_constants();
  const RigidFrame& end = led_[static_cast<std::size_t>(body.led)].free;
  if (c.motion == FrameMotion::kPoint)
    body.q = normalized(turned * body.q);
  else if (c.motion == FrameMotion::kLine)
    body.q =
        normalized(end.parent().pose.q * body.group->frame(body.slot).parent().pose.q.conjugate() * turned * body.q);
  else
    body.q = end.pose().q;
  tell_led(body);
}

void GameBodies::tell_led(GameBody& body) {
  const FrameConstants& c = body.group->frame_constants();
  RigidFrame& end = led_[static_cast<std::size_t>(body.led)].free;
  if (c.motion == FrameMotion::kPoint) end.set_turn(c, body.q, body.momentum());
  if (c.motion == FrameMotion::kLine) {
    const Vec3 omega =
        end.parent().angular_velocity + body.turn.x() / std::sqrt(line_inertia(c)) * (body.q * c.line_axis);
    end.set_turn(c, body.q, body.q * (c.inertia * (body.q.conjugate() * omega)));
  }
  body.group->frame_in_parts(body.slot) = end;
  body.shift = end.pose().p - body.start.p;
  body.v = end.velocity();
}

void GameBodies::end_step() {
  for (GameBody& body : bodies_) {
    if (body.led < 0) show(body);
    body.group->end_parts(body.slot);
  }
}

double GameBodies::modal_motion(std::int32_t at) const {
  const GameBody& body = bodies_[static_cast<std::size_t>(at)];
  if (body.modes == nullptr) return 0.0;
  const Block8* q = &answers_[static_cast<std::size_t>(body.first + 1)];
  const std::span<const double> rates = body.group->rates(body.slot);
  double sum = 0.0;
  for (std::size_t i = 0; i < rates.size(); ++i) {
    const double moving =
        rates[i] - static_cast<double>(body.modes->rest_rates()[i]) * static_cast<double>(q[i / 8].v[i % 8]);
    sum += moving * moving;
  }
  return sum;
}

bool GameBodies::all_finite() const {
  return std::ranges::all_of(bodies_, [](const GameBody& body) {
    const std::span<const double> z = body.group->amplitudes(body.slot), rates = body.group->rates(body.slot);
    const auto finite = [](double x) { return std::isfinite(x); };
    return body.shift.allFinite() && body.v.allFinite() && body.turn.allFinite() && std::ranges::all_of(z, finite) &&
           std::ranges::all_of(rates, finite);
  });
}

}  // namespace limber::internal
