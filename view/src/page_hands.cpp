// What a person does to the page's bodies, and asks of them.
#include <algorithm>
#include <limits>
#include <numbers>
#include <optional>

#include "page_world_impl.h"

namespace limber {
namespace {

constexpr double kFar = 1e4;  // m, how long rays are

}  // namespace

PageHit PageWorld::cast_ray(const Vec3& from, const Vec3& direction) const {
  const World& world = impl_->world();
  const BodyFilter moving{.accepts = [&](BodyId id) { return world.body_type(id) != BodyType::kStatic; }};
  const std::optional<BodyHit> hit = world.cast_ray({.from = from, .way = kFar * direction.normalized()}, moving);
  if (!hit || !hit->at) return {};
  const int body = impl_->number(hit->body);
  return body < 0 ? PageHit{} : PageHit{body, *hit->at, hit->position, hit->distance};
}

std::span<const double> PageWorld::ray_places(const Vec3& from, const Vec3& direction) {
  std::vector<double>& places = impl_->told_to_page.ray_places;
  places.clear();
  std::vector<BodyHit> hits;
  impl_->world().cast_ray({.from = from, .way = kFar * direction.normalized()}, hits);
  for (const BodyHit& hit : hits) {
    places.push_back(impl_->number(hit.body));
    for (const Vec3& v : {hit.position, hit.normal}) places.insert(places.end(), v.begin(), v.end());
  }
  return places;
}

bool PageWorld::grab(const PageHit& hit) {
  let_go();
  if (hit.body < 0) return false;
  Impl& m = *impl_;
  m.hands.body = m.id(hit.body);
  m.hands.at = hit.at;
  const double mass = m.world().model(m.hands.body).data().mass,
               omega = 2.0 * std::numbers::pi * m.settings.drag_frequency;
  m.hands.hand =
      m.world().add_handle(m.hands.body, hit.at, {.stiffness = mass * omega * omega, .damping = 1.4 * mass * omega});
  return true;
}

void PageWorld::drag_to(const Vec3& target) {
  if (holds() && target.allFinite()) impl_->world().set_handle_target(impl_->hands.hand, {.position = target});
}

void PageWorld::let_go() {
  if (holds()) impl_->world().remove_handle(impl_->hands.hand);
  impl_->hands.hand = {};
}

bool PageWorld::holds() const { return impl_->world().contains(impl_->hands.hand); }
HandleView PageWorld::hand() const { return holds() ? impl_->world().handle(impl_->hands.hand) : HandleView{}; }
Vec3 PageWorld::held_point() const {
  return holds() ? impl_->world().position(impl_->hands.body, impl_->hands.at) : Vec3(Vec3::Zero());
}

void PageWorld::pin(const PageHit& hit) {
  if (hit.body >= 0) impl_->hands.pins.push_back(impl_->world().add_handle(impl_->id(hit.body), hit.at));
}

void PageWorld::unpin() {
  for (const HandleId pin : impl_->hands.pins)
    if (impl_->world().contains(pin)) impl_->world().remove_handle(pin);
  impl_->hands.pins.clear();
}

int PageWorld::pins() const {
  return static_cast<int>(std::count_if(impl_->hands.pins.begin(), impl_->hands.pins.end(),
                                        [&](HandleId h) { return impl_->world().contains(h); }));
}

void PageWorld::poke(const PageHit& hit, const Vec3& direction, double contact_time) {
  if (hit.body < 0) return;
  Impl& m = *impl_;
  const double mass = m.world().model(m.id(hit.body)).data().mass;
  const Vec3 impulse = mass * m.settings.poke_speed * direction.normalized();
  m.world().apply_impulse(m.id(hit.body), hit.at, impulse);
  if (!m.sound.listens()) return;
  const RigidTransform to_body = m.world().body(m.id(hit.body)).pose.inverse();
  m.sound.note({.body = static_cast<std::size_t>(hit.body),
                .position = hit.point,
                .point = to_body * hit.point,
                .impulse = to_body.q * impulse,
                .contact_time = contact_time},
               0.0, m.bodies);
}

void PageWorld::lead_joint(int joint, int coordinate, double place) {
  impl_->joints->wish(impl_->world(), impl_->hands.joints, joint, coordinate, {.place = place});
}
void PageWorld::run_joint(int joint, int coordinate, double speed) {
  impl_->joints->wish(impl_->world(), impl_->hands.joints, joint, coordinate, {.speed = speed});
}
void PageWorld::leave_joint(int joint, int coordinate) {
  impl_->joints->wish(impl_->world(), impl_->hands.joints, joint, coordinate, {});
}

std::span<const double> PageWorld::joint_wishes() {
  std::vector<double>& wishes = impl_->told_to_page.joint_wishes;
  wishes.assign(6 * impl_->scene.joints.size(), std::numeric_limits<double>::quiet_NaN());
  std::size_t at = 0;
  for (const auto& joint : impl_->hands.joints)
    for (const internal::CoordinateWish& wish : joint) {
      wishes[at++] = wish.place;
      wishes[at++] = wish.speed;
    }
  return wishes;
}

void PageWorld::drop(int model, const Vec3& position) {
  Impl& m = *impl_;
  m.check_model(model, "drop");
  m.drops.resize(m.dropped());  // those of a future that will not be
  m.drops.push_back(model);
  m.add_dropped(m.drops.size());
  m.world().set_pose(m.bodies.back().id, {{}, position});
}

/// Until there are `count` of them. Ids are given in the same order again.
void PageWorld::Impl::add_dropped(std::size_t count) {
  for (std::size_t there = dropped(); there < count; ++there) {
    const int kind = drops[there];
    bodies.push_back({world().add_body(kinds[static_cast<std::size_t>(kind)], {.modal_skin = false}), kind,
                      "dropped[" + std::to_string(there) + "]", true});
  }
}

void PageWorld::Impl::forget_removed() {
  std::erase_if(bodies, [&](const internal::PageBody& body) { return !world().contains(body.id); });
}

void PageWorld::show_mode(int body, Index mode, double amplitude) {
  Impl& m = *impl_;
  const BodyId id = m.id(body);
  m.told_to_page.amplitudes.assign(static_cast<std::size_t>(m.world().model(id).modes()), 0.0);
  const std::vector<double> rest = m.told_to_page.amplitudes;
  if (mode >= 0 && static_cast<std::size_t>(mode) < m.told_to_page.amplitudes.size())
    m.told_to_page.amplitudes[static_cast<std::size_t>(mode)] = amplitude;
  m.world().set_amplitudes(id, m.told_to_page.amplitudes, rest);
}

}  // namespace limber
