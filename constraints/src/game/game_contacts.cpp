#include "game_contacts.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "../tuning.h"
#include "limber/model/vertex_rows.h"

namespace limber::internal {
namespace {

constexpr float kPushShare = kConstraintsTuning.small_steps.push_share;

float dot(const Block8& a, const Block8& b) {
  float sum = 0.0f;
  for (int i = 0; i < 8; ++i) sum += a.v[i] * b.v[i];
  return sum;
}

void write_axis(const Vec3& v, float* to) {
  for (int i = 0; i < 3; ++i) to[i] = static_cast<float>(v[i]);
}

/// nᵀG n of a side's corners: what it yields to a force along n alone, m/N.
double yield_of(const PreparedSide& side, const Vec3& n) {
  const ResidualCompliance& compliance = *side.model->data().residual_compliance;
  const bool local = compliance.form() == ResidualCompliance::Form::kLocal;
  Mat3 sum = Mat3::Zero();
  for (const VertexShare& v : side.corners)
    for (const VertexShare& w : side.corners)
      if (!local || v.vertex == w.vertex) sum += v.share * w.share * compliance.block(v.vertex, w.vertex);
  return n.dot(sum * n);
}

/// √ρ n·R U of each mode, three blocks of each eight.
/// @param axes along which the side is pushed, world. @param modal scratch, a number a mode
void write_mode_rows(const BodyStates& states, const GameBody& body, const PreparedSide& side, const Mat3& axes,
                     std::span<double> modal, Block8* rows) {
  if (body.modes == nullptr || side.model == nullptr) return;
  const std::vector<float>& roots = body.modes->roots();
  const Mat3 axes_B = body.start.R.transpose() * axes;
  if (side.skin == nullptr) {
    const VertexRows& vertices = side.model->collision_rows();
    const Triangle& corners = side.model->collision().triangles[static_cast<std::size_t>(side.at.triangle)];
    ModePoint point{.roots = roots.data(), .blocks = roots.size() / 8};
    for (std::size_t c = 0; c < 3; ++c) {
      point.weight[c] = static_cast<float>(side.at.weight[c]);
      for (int x = 0; x < 3; ++x) point.rows[c][x] = vertices.row(corners[c], x);
    }
    for (int axis = 0; axis < 3; ++axis) write_axis(axes_B.col(axis), point.axes[axis]);
    make_mode_rows(point, rows);
    return;
  }
  modal = modal.first(static_cast<std::size_t>(side.model->modes()));
  for (Index axis = 0; axis < 3; ++axis) {
    std::ranges::fill(modal, 0.0);
    side.shape(states.amplitudes(side.body, StepTime::kStart)).add_force(side.at, axes_B.col(axis), modal);
    for (std::size_t m = 0; m < modal.size(); ++m)
      rows[3 * (m / 8) + static_cast<std::size_t>(axis)].v[m % 8] = static_cast<float>(modal[m]) * roots[m];
  }
}

/// What a contact of a body with a skin is made by works on that skin's memory.
bool shares_memory(const PreparedContact& contact) { return contact.a.skin != nullptr || contact.b.skin != nullptr; }

/// m; 0: none.
double rolling_radius(const BodyStates& states, const PreparedContact& contact, const GameContacts::Options& options) {
  if (!(options.rolling_friction > 0.0) || !(is_round(contact.a) || is_round(contact.b))) return 0.0;
  return options.rolling_friction * shorter_arm(states, contact);
}

/// What a memory, ordered by id, has of a contact; null: nothing.
template <class Memory>
const Memory* find(const std::vector<Memory>& known, std::uint64_t id) {
  const auto at = std::lower_bound(known.begin(), known.end(), id,
                                   [](const Memory& memory, std::uint64_t of) { return memory.id < of; });
  return at != known.end() && at->id == id ? &*at : nullptr;
}

/// The largest s in [0, 1] with s linear + ½ s² square ≤ given. @param square, given at least 0
float share_that_gives(double linear, double square, double given) {
  if (linear + 0.5 * square <= given) return 1.0f;
  const double root = std::sqrt(linear * linear + 2.0 * square * given);
  return static_cast<float>(linear > 0.0 ? 2.0 * given / (linear + root) : (root - linear) / square);
}

/// Whether a force pushes, is in its cone, and is finite.
bool meets_law(const Vec3& f, double friction) {
  constexpr double kRounded = 1e-5;  // of a force, in single precision
  if (!f.allFinite() || f[0] < 0.0) return false;
  return f[0] == 0.0 ? f[1] == 0.0 && f[2] == 0.0 : f.tail<2>().norm() <= friction * f[0] * (1.0 + kRounded);
}

}  // namespace

void GameContacts::begin_step(const BodyStates& states, GameBodies& bodies, std::span<PreparedContact> contacts,
                              const Options& options, Jobs& jobs) {
  contacts_ = contacts;
  rows_.clear();
  numbers_.clear();
  blocks_.clear();
  rolling_.clear();
  for (const PreparedContact& contact : contacts)
    for (const Index body : {contact.a.body, contact.b.body})
      if (bodies.of(body) >= 0 && contact.a.body != contact.b.body) bodies.keep_axes(bodies.of(body));
  bundles_.arrange(bodies, contacts);
  bundles_.fill(jobs, [&](std::size_t i) {
    if (!shares_memory(contacts[i])) put_in_bundle(states, bodies, i, options);
  });
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (!bundles_.holds(i))
      add_row(states, bodies, i, options);
    else if (shares_memory(contacts[i]))
      put_in_bundle(states, bodies, i, options);
  bundles_.for_all(jobs, [&](const BundleArrays& part) { make_bundle_rows(part, bodies.shapes().data()); });
  sums_.assign(rows_.size(), Vec3::Zero());
  ties_.reset(bodies.bodies().size());
  touched_.assign(bodies.bodies().size(), false);
  for (const PreparedContact& contact : contacts) {
    const std::int32_t a = bodies.of(contact.a.body), b = bodies.of(contact.b.body);
    for (const std::int32_t frame : {a, b})
      if (frame >= 0) touched_[static_cast<std::size_t>(frame)] = true;
    if (a >= 0 && b >= 0) ties_.join(a, b);
  }
  islands_.resize(bodies.bodies().size());
  for (std::size_t i = 0; i < islands_.size(); ++i) islands_[i] = ties_.root(static_cast<Index>(i));
}

void GameContacts::put_in_bundle(const BodyStates& states, const GameBodies& bodies, std::size_t i,
                                 const Options& options) {
  const PreparedContact& contact = contacts_[i];
  const ContactRow row = make(states, bodies, contact, options);
  bundles_.put(i, row);
  for (std::size_t s = 0; s < 2; ++s) {
    if (row.side[s].blocks <= 1) continue;
    std::array<Block8, 3 * kMostBundledModes / 8> rows{};
    std::array<double, kMostBundledModes> modal;
    write_mode_rows(states, bodies.body(row.side[s].frame), contact.side(s), PreparedContact::sign(s) * contact.axes,
                    modal, rows.data());
    bundles_.put_modes(i, s, rows.data());
  }
  if (row.rebound > 0.0f) bundles_.rebound(i, row);
  if (const double radius = rolling_radius(states, contact, options); radius > 0.0)
    bundles_.resist_rolling(i, radius, last_moment(contact));
}

/// Of a contact that bundles do not hold.
void GameContacts::add_row(const BodyStates& states, GameBodies& bodies, std::size_t i, const Options& options) {
  const PreparedContact& contact = contacts_[i];
  ContactRow row = make(states, bodies, contact, options);
  for (std::size_t s = 0; s < 2; ++s) {
    ContactSideRows& at = row.side[s];
    if (at.frame < 0) continue;
    const Mat3 axes = PreparedContact::sign(s) * contact.axes;
    at.rows = static_cast<std::int32_t>(blocks_.size());
    blocks_.resize(blocks_.size() + static_cast<std::size_t>(3 * at.blocks));
    write_frame_rows(bodies, at, axes);
    modal_.resize(static_cast<std::size_t>(8 * at.blocks));
    write_mode_rows(states, bodies.body(at.frame), contact.side(s), axes, modal_,
                    &blocks_[static_cast<std::size_t>(at.rows)] + 3);
  }
  if (contact.a.body == contact.b.body) join_sides(row);
  find_masses(bodies, row);
  rows_.push_back(row);
  numbers_.push_back(i);
  if (const double radius = rolling_radius(states, contact, options); radius > 0.0)
    add_rolling(bodies, contact, radius);
}

/// All but rows of coordinates and masses; `rest` is the gap.
ContactRow GameContacts::make(const BodyStates& states, const GameBodies& bodies, const PreparedContact& contact,
                              const Options& options) const {
  ContactRow row;
  double thinnest = std::numeric_limits<double>::infinity(), yields = 0.0;
  for (int i = 0; i < 3; ++i) write_axis(contact.axes.col(i), row.axes[i]);
  for (std::size_t s = 0; s < 2; ++s) {
    const PreparedSide& side = contact.side(s);
    place_side(states, bodies, side, row.side[s]);
    const auto number = static_cast<std::size_t>(side.body);
    if (!states.is_static(side.body) && number < options.thickness.size())
      thinnest = std::min(thinnest, options.thickness[number]);
    if (options.residual_compliance && !side.corners.empty())
      yields += yield_of(
          side, side.turned_back(states.pose(side.body, StepTime::kStart).q.conjugate() * contact.axes.col(0)));
  }
  row.friction = static_cast<float>(contact.friction);
  row.slop = std::isfinite(thinnest) ? static_cast<float>(options.steps.slop * thinnest) : 0.0f;
  row.compliance = static_cast<float>(yields);
  row.rest = static_cast<float>(contact.axes.col(0).dot(contact.offset));
  for (int t = 0; t < 2; ++t)
    row.running[t] = static_cast<float>(bodies.plan().length() * contact.axes.col(1 + t).dot(contact.running));
  const Vec3 last = contact.axes.transpose() * contact.last_force;
  for (int i = 0; i < 3; ++i) row.force[i] = static_cast<float>(last[i]);
  row.force[0] = std::max(0.0f, row.force[0]);
  if (contact.restitution > 0.0) begin_rebound(bodies, contact, row);
  return row;
}

void GameContacts::begin_rebound(const GameBodies& bodies, const PreparedContact& contact, ContactRow& row) const {
  row.rebound = static_cast<float>(contact.restitution * contact.restitution);
  row.fall = static_cast<float>(
      contact.axes.col(0).dot(bodies.fall_of(row.side[0].frame) - bodies.fall_of(row.side[1].frame)));
  row.stage = row.force[0] > 0.0f ? kParted : 0.0f;
  const Rebound* known = find(rebound_memory_, contact.id);
  if (known == nullptr) return;
  row.stage = known->stage, row.energy = known->energy;
  if (row.stage >= kTogether) row.release = row.energy;
}

void GameContacts::place_side(const BodyStates& states, const GameBodies& bodies, const PreparedSide& side,
                              ContactSideRows& at) {
  at.frame = bodies.of(side.body);
  if (at.frame < 0) return;
  const GameBody& body = bodies.body(at.frame);
  at.body = body.first;
  at.blocks = body.blocks;
  const Vec3 carried_B = side.place(states.amplitudes(side.body, StepTime::kStart));
  write_axis(carried_B, at.arm);
  write_axis(body.start.R * carried_B + side.rim, at.lever);
}

void GameContacts::write_frame_rows(const GameBodies& bodies, const ContactSideRows& at, const Mat3& axes) {
  const Vec3 lever(at.lever[0], at.lever[1], at.lever[2]);
  for (Index i = 0; i < 3; ++i)
    bodies.write_frame_row(bodies.body(at.frame), axes.col(i), lever.cross(axes.col(i)),
                           blocks_[static_cast<std::size_t>(at.rows + i)]);
}

/// A body that touches itself: its frame feels nothing of that, and its modes both sides.
void GameContacts::join_sides(ContactRow& row) {
  ContactSideRows &a = row.side[0], &b = row.side[1];
  for (std::int32_t i = 0; i < 3 * a.blocks; ++i)
    for (int l = 0; l < 8; ++l)
      blocks_[static_cast<std::size_t>(a.rows + i)].v[l] += blocks_[static_cast<std::size_t>(b.rows + i)].v[l];
  for (std::int32_t i = 0; i < 3; ++i) blocks_[static_cast<std::size_t>(a.rows + i)] = {};
  a.frame = b.frame = -1;
  b.blocks = 0;
}

/// Effective masses; takes from the gap in `rest` what the modes give it.
void GameContacts::find_masses(const GameBodies& bodies, ContactRow& row) {
  float nn = 0.0f, nt[2] = {}, tt[3] = {}, frames = 0.0f, bent = 0.0f;
  for (const ContactSideRows& side : row.side)
    for (std::int32_t k = 0; k < side.blocks; ++k) {
      const Block8* rows = &blocks_[static_cast<std::size_t>(side.rows + 3 * k)];
      const float own = dot(rows[0], rows[0]);
      nn += own;
      nt[0] += dot(rows[0], rows[1]), nt[1] += dot(rows[0], rows[2]);
      tt[0] += dot(rows[1], rows[1]), tt[1] += dot(rows[1], rows[2]), tt[2] += dot(rows[2], rows[2]);
      if (k == 0)
        frames += own;
      else
        bent += dot(rows[0], bodies.shapes()[static_cast<std::size_t>(side.body + k)]);
    }
  row.rest -= bent;
  nn += row.compliance;
  // One step for both tangents, the block's largest eigenvalue: what slides is braked against its slip.
  const float largest = 0.5f * (tt[0] + tt[2]) + std::sqrt(0.25f * (tt[0] - tt[2]) * (tt[0] - tt[2]) + tt[1] * tt[1]);
  const auto inverse = [](float x) { return x > 0.0f ? 1.0f / x : 0.0f; };
  row.inverse_normal = inverse(nn);
  row.inverse_tangent = inverse(largest);
  row.inverse_push = inverse(frames);
  for (int t = 0; t < 2; ++t) row.coupling[t] = nt[t];
}

/// At the end of the last step, N·m; zero where it was not there.
Vec3 GameContacts::last_moment(const PreparedContact& contact) const {
  const Rolling* known = find(rolling_memory_, contact.id);
  return known != nullptr ? known->moment : Vec3(Vec3::Zero());
}

void GameContacts::add_rolling(const GameBodies& bodies, const PreparedContact& contact, double radius) {
  RollingRow rolling{.contact = static_cast<std::int32_t>(rows_.size() - 1), .radius = static_cast<float>(radius)};
  float trace = 0.0f;
  for (std::size_t s = 0; s < 2; ++s) {
    const std::int32_t frame = bodies.of(contact.side(s).body);
    if (frame < 0) continue;
    rolling.rows[s] = static_cast<std::int32_t>(blocks_.size());
    for (int i = 0; i < 3; ++i) {
      Block8 row;
      bodies.write_frame_row(bodies.body(frame), Vec3::Zero(), PreparedContact::sign(s) * Vec3::Unit(i), row);
      trace += dot(row, row);
      blocks_.push_back(row);
    }
  }
  if (!(trace > 0.0f)) return;
  rolling.inverse = 1.0f / trace;  // at most that of the largest eigenvalue
  write_axis(last_moment(contact), rolling.moment);
  rolling_.push_back(rolling);
}

void GameContacts::apply_last_forces(GameBodies& bodies, Jobs& jobs) {
  bundles_.in_order(jobs, false, [&](const BundleArrays& part) { apply_bundle_forces(part, bodies.answers().data()); });
  apply_forces(rows_.data(), rows_.size(), rolling_.data(), rolling_.size(), {blocks_.data(), bodies.answers().data()});
}

bool GameContacts::begin_substep(const GameBodies& bodies, const SmallSteps& steps, Jobs& jobs) {
  const auto most = static_cast<float>(steps.push_speed * bodies.plan().length());
  bundles_.for_all(jobs, [&](const BundleArrays& part) {
    measure_bundles(part, bodies.shifts().data(), bodies.shapes().data(), kPushShare, most);
  });
  const bool rows_overlap = measure_contacts(rows_.data(), rows_.size(), blocks_.data(), bodies.shapes().data(),
                                             bodies.shifts().data(), kPushShare, most);
  return bundles_.overlap() || rows_overlap;
}

// A share s of the forces f changes the energy of bodies and springs by s a + ½ s² b less what springs held,
// a = f·(c₀ + J y₀), b = f·(J E Jᵀ + C) f.
void GameContacts::limit_forces(GameBodies& bodies, std::span<const double> moved, Jobs& jobs) {
  bodies.find_answers(moved, jobs);
  works_.assign(bodies.bodies().size() + 1, {});
  add_works(bodies);
  bool any = false;
  for (Works& works : works_) {
    works.share = share_that_gives(works.linear, works.square, works.given);
    any = any || works.share < 1.0f;
  }
  if (any) scale_forces(bodies, moved);
}

void GameContacts::add_works(const GameBodies& bodies) {
  for (std::size_t i = 0; i < bodies.bodies().size(); ++i) {
    if (!touched_[i]) continue;
    const GameBody& body = bodies.bodies()[i];
    Works& works = works_of(static_cast<std::int32_t>(i));
    works.linear += body.along;
    works.square += body.square;
  }
  bundles_.for_all_works([&](std::int32_t frame, double open, double yielded, double given) {
    Works& works = works_of(frame);
    works.linear += open;
    works.square += yielded;
    works.given += given;
  });
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const ContactRow& c = rows_[i];
    Works& works = works_of(frame_of(bodies, i));
    works.linear += static_cast<double>(c.force[0] * (c.gap - std::min(c.now, 0.0f)) + c.force[1] * c.slip[0] +
                                        c.force[2] * c.slip[1]);
    works.square += static_cast<double>(c.compliance * c.force[0] * c.force[0]);
    works.given += static_cast<double>(c.release + 0.5f * c.compliance * c.before * c.before);
  }
}

void GameContacts::scale_forces(GameBodies& bodies, std::span<const double> moved) {
  const auto share = [&](std::int32_t frame) { return works_of(frame).share; };
  bundles_.scale(share);
  for (std::size_t i = 0; i < rows_.size(); ++i)
    for (float& force : rows_[i].force) force *= share(frame_of(bodies, i));
  for (RollingRow& rolling : rolling_)
    for (float& moment : rolling.moment) moment *= share(frame_of(bodies, static_cast<std::size_t>(rolling.contact)));
  for (std::size_t i = 0; i < bodies.bodies().size(); ++i)
    if (const float s = share(static_cast<std::int32_t>(i)); s < 1.0f) bodies.scale_answer(i, s, moved);
}

void GameContacts::sweep(GameBodies& bodies, bool backward, Jobs& jobs) {
  Block8* motion = bodies.motion().data();
  const auto bundles = [&] {
    bundles_.in_order(jobs, backward, [&](const BundleArrays& part) { sweep_bundles(part, backward, motion); });
  };
  if (!backward) bundles();
  sweep_contacts(rows_.data(), rows_.size(), rolling_.data(), rolling_.size(), backward, {blocks_.data(), motion});
  if (backward) bundles();
}

void GameContacts::push_apart(GameBodies& bodies, bool backward, Jobs& jobs) {
  Block8* pushes = bodies.pushes().data();
  const auto bundles = [&] {
    bundles_.in_order(jobs, backward, [&](const BundleArrays& part) { push_bundles(part, backward, pushes); });
  };
  if (!backward) bundles();
  push_contacts(rows_.data(), rows_.size(), backward, blocks_.data(), pushes);
  if (backward) bundles();
}

void GameContacts::end_substep(const GameBodies& bodies, Jobs& jobs) {
  const Block8* free = bodies.free_motion().data();
  const Block8* motion = bodies.motion().data();
  bundles_.for_all(jobs, [&](const BundleArrays& part) { note_bundle_rebounds(part, free, motion); });
  note_rebounds(rows_.data(), rows_.size(), blocks_.data(), free, motion);
  for (std::size_t i = 0; i < rows_.size(); ++i)
    for (int axis = 0; axis < 3; ++axis) sums_[i][axis] += static_cast<double>(rows_[i].force[axis]);
}

void GameContacts::end_step(const SubstepPlan& plan) {
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const float* last = rows_[i].force;
    tell(contacts_[numbers_[i]], {Vec3(last[0], last[1], last[2]), sums_[i], static_cast<double>(rows_[i].compliance)},
         plan);
  }
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (bundles_.holds(i)) tell(contacts_[i], {bundles_.force(i), bundles_.sum(i), bundles_.compliance(i)}, plan);
  rolling_memory_.clear();
  for (const RollingRow& rolling : rolling_) {
    const float* moment = rolling.moment;
    rolling_memory_.push_back(
        {contacts_[numbers_[static_cast<std::size_t>(rolling.contact)]].id, Vec3(moment[0], moment[1], moment[2])});
  }
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (bundles_.holds(i) && bundles_.resists_rolling(i))
      rolling_memory_.push_back({contacts_[i].id, bundles_.moment(i)});
  std::ranges::sort(rolling_memory_, {}, &Rolling::id);
  rebound_memory_.clear();
  for (std::size_t i = 0; i < rows_.size(); ++i)
    remember_rebound({contacts_[numbers_[i]].id, rows_[i].stage, rows_[i].energy});
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (contacts_[i].restitution > 0.0 && bundles_.holds(i))
      remember_rebound({contacts_[i].id, bundles_.stage(i), bundles_.energy(i)});
  std::ranges::sort(rebound_memory_, {}, &Rebound::id);
}

void GameContacts::remember_rebound(const Rebound& rebound) {
  if (rebound.stage > 0.0f && rebound.stage < kParted) rebound_memory_.push_back(rebound);
}

/// Its spring stores what the row's law does, by the normal force of the last substep: ½ c F².
void GameContacts::tell(PreparedContact& contact, const Told& told, const SubstepPlan& plan) const {
  contact.last_force = contact.axes * told.last;
  contact.mean_force = contact.axes * (told.sum / plan.count);
  contact.impulse = plan.step * contact.mean_force;
  const double square = told.last.squaredNorm();
  contact.compliance = square > 0.0 ? told.compliance * told.last[0] * told.last[0] / square : 0.0;
  contact.slip = 0.0;
}

double GameContacts::residual(GameBodies& bodies, Jobs& jobs) {
  Block8* motion = bodies.motion().data();
  bundles_.for_all(jobs, [&](const BundleArrays& part) { find_residuals(part, motion); });
  return static_cast<double>(
      std::max(residual_of_contacts(rows_.data(), rows_.size(), {blocks_.data(), motion}), bundles_.residual()));
}

bool GameContacts::meet_law() const {
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (bundles_.holds(i) && !meets_law(bundles_.force(i), bundles_.friction(i))) return false;
  return std::ranges::all_of(rows_, [](const ContactRow& row) {
    return meets_law(Vec3(row.force[0], row.force[1], row.force[2]), static_cast<double>(row.friction));
  });
}

}  // namespace limber::internal
