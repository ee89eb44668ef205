#include "game_contacts.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "../tuning.h"
#include "limber/model/vertex_rows.h"

namespace limber::internal {
namespace {

constexpr float kPushShare = kConstraintsTuning.small_steps.push_share;

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
  for (const PreparedContact& contact : contacts)
    for (const Index body : {contact.a.body, contact.b.body})
      if (bodies.of(body) >= 0 && contact.a.body != contact.b.body) bodies.keep_axes(bodies.of(body));
  bundles_.arrange(bodies, contacts);
  bundles_.fill(jobs, [&](std::size_t i) {
    if (!shares_memory(contacts[i])) put(states, bodies, i, options);
  });
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (shares_memory(contacts[i])) put(states, bodies, i, options);
  bundles_.for_all(jobs, [&](const BundleArrays& part) { make_bundle_rows(part, bodies.shapes().data()); });
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

void GameContacts::put(const BodyStates& states, const GameBodies& bodies, std::size_t i, const Options& options) {
  const PreparedContact& contact = contacts_[i];
  bundles_.put(i, make(states, bodies, contact, options));
  for (std::size_t s = 0; s < 2; ++s) put_modes(states, bodies, i, s);
  if (const double radius = rolling_radius(states, contact, options); radius > 0.0)
    bundles_.resist_rolling(i, radius, last_moment(contact));
}

/// √ρ n·R U of each mode. Where a body touches itself its modes get what both sides do.
void GameContacts::put_modes(const BodyStates& states, const GameBodies& bodies, std::size_t i, std::size_t s) {
  const PreparedSide& side = contacts_[i].side(s);
  const std::int32_t at = bodies.of(side.body);
  if (at < 0 || side.model == nullptr || bodies.body(at).modes == nullptr) return;
  const std::vector<float>& roots = bodies.body(at).modes->roots();
  const std::size_t blocks = roots.size() / 8, of = contacts_[i].a.body == contacts_[i].b.body ? 0 : s;
  const Mat3 axes = bodies.body(at).start.R.transpose() * (PreparedContact::sign(s) * contacts_[i].axes);
  if (side.skin != nullptr) {
    modal_.resize(static_cast<std::size_t>(side.model->modes()));
    skin_rows_.assign(3 * blocks, {});
    for (Index axis = 0; axis < 3; ++axis) {
      std::ranges::fill(modal_, 0.0);
      side.shape(states.amplitudes(side.body, StepTime::kStart)).add_force(side.at, axes.col(axis), modal_);
      for (std::size_t m = 0; m < modal_.size(); ++m)
        skin_rows_[3 * (m / 8) + static_cast<std::size_t>(axis)].v[m % 8] = static_cast<float>(modal_[m]) * roots[m];
    }
    return bundles_.add_modes(i, of, 0, skin_rows_);
  }
  constexpr std::size_t kAtOnce = 4;
  std::array<Block8, 3 * kAtOnce> rows;
  const VertexRows& vertices = side.model->collision_rows();
  const Triangle& corners = side.model->collision().triangles[static_cast<std::size_t>(side.at.triangle)];
  ModePoint point;
  for (int axis = 0; axis < 3; ++axis) write_axis(axes.col(axis), point.axes[axis]);
  for (std::size_t first = 0; first < blocks; first += kAtOnce) {
    point.roots = roots.data() + 8 * first, point.blocks = std::min(kAtOnce, blocks - first);
    for (std::size_t c = 0; c < 3; ++c) {
      point.weight[c] = static_cast<float>(side.at.weight[c]);
      for (int x = 0; x < 3; ++x) point.rows[c][x] = vertices.row(corners[c], x) + 8 * first;
    }
    make_mode_rows(point, rows.data());
    bundles_.add_modes(i, of, first, std::span(rows).first(3 * point.blocks));
  }
}

ContactRow GameContacts::make(const BodyStates& states, const GameBodies& bodies, const PreparedContact& contact,
                              const Options& options) const {
  ContactRow row;
  double thinnest = std::numeric_limits<double>::infinity(), yields = 0.0;
  row.axes = contact.axes;
  for (std::size_t s = 0; s < 2; ++s) {
    const PreparedSide& side = contact.side(s);
    if (const std::int32_t at = bodies.of(side.body); at >= 0) {
      row.side[s].arm = side.place(states.amplitudes(side.body, StepTime::kStart));
      row.side[s].lever = bodies.body(at).start.R * row.side[s].arm + side.rim;
    }
    const auto number = static_cast<std::size_t>(side.body);
    if (!states.is_static(side.body) && number < options.thickness.size())
      thinnest = std::min(thinnest, options.thickness[number]);
    if (options.residual_compliance && !side.corners.empty())
      yields += yield_of(
          side, side.turned_back(states.pose(side.body, StepTime::kStart).q.conjugate() * contact.axes.col(0)));
  }
  row.friction = contact.friction;
  row.slop = std::isfinite(thinnest) ? options.steps.slop * thinnest : 0.0;
  row.compliance = yields;
  row.rest = contact.axes.col(0).dot(contact.offset);
  for (int t = 0; t < 2; ++t) row.running[t] = bodies.plan().length() * contact.axes.col(1 + t).dot(contact.running);
  row.force = contact.axes.transpose() * contact.last_force;
  row.force[0] = std::max(0.0, row.force[0]);
  if (contact.restitution > 0.0) begin_rebound(bodies, contact, row);
  return row;
}

void GameContacts::begin_rebound(const GameBodies& bodies, const PreparedContact& contact, ContactRow& row) const {
  row.rebound = static_cast<float>(contact.restitution * contact.restitution);
  row.fall = static_cast<float>(
      contact.axes.col(0).dot(bodies.fall_of(bodies.of(contact.a.body)) - bodies.fall_of(bodies.of(contact.b.body))));
  row.stage = row.force[0] > 0.0 ? kParted : 0.0f;
  const Rebound* known = find(rebound_memory_, contact.id);
  if (known == nullptr) return;
  row.stage = known->stage, row.energy = known->energy;
  if (row.stage >= kTogether) row.release = row.energy;
}

/// At the end of the last step, N·m; zero where it was not there.
Vec3 GameContacts::last_moment(const PreparedContact& contact) const {
  const Rolling* known = find(rolling_memory_, contact.id);
  return known != nullptr ? known->moment : Vec3(Vec3::Zero());
}

void GameContacts::apply_last_forces(GameBodies& bodies, Jobs& jobs) {
  bundles_.in_order(jobs, false, [&](const BundleArrays& part) { apply_bundle_forces(part, bodies.answers().data()); });
}

bool GameContacts::begin_substep(const GameBodies& bodies, const SmallSteps& steps, Jobs& jobs) {
  const auto most = static_cast<float>(steps.push_speed * bodies.plan().length());
  bundles_.for_all(jobs, [&](const BundleArrays& part) {
    measure_bundles(part, bodies.shifts().data(), bodies.shapes().data(), kPushShare, most);
  });
  return bundles_.overlap();
}

// A share s of the forces f changes the energy of bodies and springs by s a + ½ s² b less what springs held,
// a = f·(c₀ + J y₀), b = f·(J E Jᵀ + C) f.
void GameContacts::limit_forces(GameBodies& bodies, std::span<const double> moved, Jobs& jobs) {
  if (size() == 0) return;
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
}

void GameContacts::scale_forces(GameBodies& bodies, std::span<const double> moved) {
  const auto share = [&](std::int32_t frame) { return works_of(frame).share; };
  bundles_.scale(share);
  for (std::size_t i = 0; i < bodies.bodies().size(); ++i)
    if (const float s = share(static_cast<std::int32_t>(i)); s < 1.0f) bodies.scale_answer(i, s, moved);
}

void GameContacts::sweep(GameBodies& bodies, bool backward, Jobs& jobs) {
  Block8* motion = bodies.motion().data();
  bundles_.in_order(jobs, backward, [&](const BundleArrays& part) { sweep_bundles(part, backward, motion); });
}

void GameContacts::push_apart(GameBodies& bodies, bool backward, Jobs& jobs) {
  Block8* pushes = bodies.pushes().data();
  bundles_.in_order(jobs, backward, [&](const BundleArrays& part) { push_bundles(part, backward, pushes); });
}

void GameContacts::end_substep(const GameBodies& bodies, Jobs& jobs) {
  const Block8* free = bodies.free_motion().data();
  const Block8* motion = bodies.motion().data();
  bundles_.for_all(jobs, [&](const BundleArrays& part) { note_bundle_rebounds(part, free, motion); });
}

void GameContacts::end_step(const SubstepPlan& plan) {
  rolling_memory_.clear();
  rebound_memory_.clear();
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    tell(contacts_[i], {bundles_.force(i), bundles_.sum(i), bundles_.compliance(i)}, plan);
    if (bundles_.resists_rolling(i)) rolling_memory_.push_back({contacts_[i].id, bundles_.moment(i)});
    if (contacts_[i].restitution > 0.0) remember_rebound({contacts_[i].id, bundles_.stage(i), bundles_.energy(i)});
  }
  std::ranges::sort(rolling_memory_, {}, &Rolling::id);
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
  return static_cast<double>(bundles_.residual());
}

bool GameContacts::meet_law() const {
  for (std::size_t i = 0; i < contacts_.size(); ++i)
    if (!meets_law(bundles_.force(i), bundles_.friction(i))) return false;
  return true;
}

}  // namespace limber::internal
