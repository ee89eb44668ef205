#include "game_contacts.h"

#include <algorithm>
#include <cmath>

#include "../tuning.h"
#include "limber/model/vertex_rows.h"

namespace limber::internal {
namespace {

constexpr float kPushShare = kConstraintsTuning.small_steps.push_share;

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
  ties_.reset(bodies.bodies().size());
  touched_.assign(bodies.bodies().size(), false);
  for (const PreparedContact& contact : contacts) {
    const std::int32_t a = bodies.of(contact.a.body), b = bodies.of(contact.b.body);
    for (const std::int32_t frame : {a, b}) {
      if (frame < 0) continue;
      touched_[static_cast<std::size_t>(frame)] = true;
      if (a != b) bodies.keep_axes(frame);
    }
    if (a >= 0 && b >= 0) ties_.join(a, b);
  }
  bundles_.arrange(bodies, contacts);
  make_skin_rows(states, bodies);
  bundles_.fill(
      jobs, [&](std::size_t i) { put(states, bodies, i, options); },
      [&](std::size_t i, std::size_t side, ModePoint& point) { return find_modes(bodies, i, side, point); });
  bundles_.for_all(jobs, [&](const BundleArrays& part) { make_bundle_rows(part, bodies.shapes().data()); });
}

void GameContacts::put(const BodyStates& states, const GameBodies& bodies, std::size_t i, const Options& options) {
  const PreparedContact& contact = contacts_[i];
  bundles_.put(i, make(states, bodies, contact, options));
  if (const double radius = rolling_radius(states, contact, options); radius > 0.0)
    bundles_.resist_rolling(i, radius, last_moment(contact));
}

/// What a side's rows of modes are made of; false: it has none. A body that touches itself has those of both sides in
/// one.
bool GameContacts::find_modes(const GameBodies& bodies, std::size_t i, std::size_t s, ModePoint& point) const {
  const PreparedContact& contact = contacts_[i];
  const PreparedSide& side = contact.side(s);
  const bool self = contact.a.body == contact.b.body;
  const std::int32_t at = bodies.of(side.body);
  if (at < 0 || side.model == nullptr || bodies.body(at).modes == nullptr || (self && s == 1)) return false;
  const std::vector<float>& roots = bodies.body(at).modes->roots();
  const Mat3 axes = bodies.body(at).start.R.transpose() * (PreparedContact::sign(s) * contact.axes);
  Eigen::Map<Eigen::Matrix3f>(&point.axes[0][0]) = axes.cast<float>();
  point.roots = roots.data(), point.blocks = roots.size() / 8, point.corners = 0;
  add_corners(i, s, 1.0f, point);
  if (self) add_corners(i, 1, -1.0f, point);
  return point.corners > 0;
}

void GameContacts::add_corners(std::size_t i, std::size_t s, float sign, ModePoint& point) const {
  const PreparedSide& side = contacts_[i].side(s);
  const Triangle& corners = side.model->collision().triangles[static_cast<std::size_t>(side.at.triangle)];
  for (std::size_t c = 0; c < (side.skin != nullptr ? 1u : 3u); ++c) {
    if (side.skin == nullptr && side.at.weight[c] == 0.0) continue;
    point.weight[point.corners] = sign * (side.skin != nullptr ? 1.0f : static_cast<float>(side.at.weight[c]));
    for (int x = 0; x < 3; ++x)
      point.rows[point.corners][x] =
          side.skin != nullptr ? &skin_rows_[skin_at_[2 * i + s] + 8 * point.blocks * static_cast<std::size_t>(x)]
                               : side.model->collision_rows().row(corners[c], x);
    ++point.corners;
  }
}

/// U of points of bodies with skins: one by one, as they work on the skin's memory.
void GameContacts::make_skin_rows(const BodyStates& states, const GameBodies& bodies) {
  skin_rows_.clear();
  skin_at_.resize(2 * contacts_.size());
  for (std::size_t n = 0; n < skin_at_.size(); ++n) {
    const PreparedSide& side = contacts_[n / 2].side(n % 2);
    const std::int32_t at = bodies.of(side.body);
    if (side.skin == nullptr || at < 0 || bodies.body(at).modes == nullptr) continue;
    skin_at_[n] = skin_rows_.size();
    for (int axis = 0; axis < 3; ++axis) {
      modal_.assign(static_cast<std::size_t>(side.model->modes()), 0.0);
      side.shape(states.amplitudes(side.body, StepTime::kStart)).add_force(side.at, Vec3::Unit(axis), modal_);
      for (const double u : modal_) skin_rows_.push_back(static_cast<float>(u));
      skin_rows_.resize(skin_at_[n] + static_cast<std::size_t>(axis + 1) * bodies.body(at).modes->roots().size());
    }
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
      row.side[s].arm = side.start_point;
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

bool GameContacts::begin_substep(const GameBodies& bodies, Jobs& jobs) {
  bundles_.for_all(
      jobs, [&](const BundleArrays& part) { measure_bundles(part, bodies.shifts().data(), bodies.shapes().data()); });
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

void GameContacts::push_apart(GameBodies& bodies, double speed, bool backward, Jobs& jobs) {
  const auto most = static_cast<float>(speed * bodies.plan().length());
  Block8* pushes = bodies.pushes().data();
  bundles_.in_order(jobs, backward,
                    [&](const BundleArrays& part) { push_bundles(part, backward, kPushShare, most, pushes); });
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
    tell(i, plan);
    if (bundles_.resists_rolling(i)) rolling_memory_.push_back({contacts_[i].id, bundles_.moment(i)});
    const float stage = contacts_[i].restitution > 0.0 ? bundles_.stage(i) : 0.0f;
    if (stage > 0.0f && stage < kParted) rebound_memory_.push_back({contacts_[i].id, stage, bundles_.energy(i)});
  }
  std::ranges::sort(rolling_memory_, {}, &Rolling::id);
  std::ranges::sort(rebound_memory_, {}, &Rebound::id);
}

/// Its spring stores what the row's law does, by the normal force of the last substep: ½ c F².
void GameContacts::tell(std::size_t i, const SubstepPlan& plan) {
  PreparedContact& contact = contacts_[i];
  const Vec3 last = bundles_.force(i);
  contact.last_force = contact.axes * last;
  contact.mean_force = contact.axes * (bundles_.sum(i) / plan.count);
  contact.impulse = plan.step * contact.mean_force;
  const double square = last.squaredNorm();
  contact.compliance = square > 0.0 ? bundles_.compliance(i) * last[0] * last[0] / square : 0.0;
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
