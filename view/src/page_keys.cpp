// The states of a page's world that one goes back to, shares and records.
#include <tuple>
#include <type_traits>

#include "limber/core/error.h"
#include "limber/core/state_archive.h"
#include "limber/scene/recording.h"
#include "page_tracks.h"
#include "page_world_impl.h"

namespace limber {

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, PageSettings>
auto state_fields(Self& s) {
  return std::tie(s.gravity, s.drag_frequency, s.poke_speed, s.step, s.substeps, s.modes, s.damping, s.friction,
                  s.solver, s.joint_friction, s.stiffness);
}

namespace {

constexpr std::uint32_t kSaved = 0x4c505732;  // that bytes are a saved page, in this form

}  // namespace

void PageWorld::keep() {
  Impl& m = *impl_;
  m.history.keep(*m.player, m.hands, m.dropped());
}

int PageWorld::kept() const { return impl_->history.size(); }
std::int64_t PageWorld::kept_step(int key) const { return impl_->history.at(key).step; }

void PageWorld::go_to(int key) {
  Impl& m = *impl_;
  const internal::PageHistory::Key& at = m.history.at(key);
  m.add_dropped(at.dropped);
  m.player->restore_state(at.state);
  m.forget_removed();
  m.hands = at.hands;
  m.settings.gravity = m.world().options().gravity;
}

std::vector<std::byte> PageWorld::saved() const {
  const Impl& m = *impl_;
  std::vector<std::byte> bytes, state;
  m.player->save_state(state);
  StateWriter write(bytes);
  write(kSaved, m.settings, m.dropped_models());
  internal::write_hands(m.hands, write);
  write(state);
  return bytes;
}

void PageWorld::restore(std::span<const std::byte> saved) {
  Impl& m = *impl_;
  try {
    StateReader read(saved);
    if (read.read<std::uint32_t>() != kSaved) throw InvalidArgument("PageWorld::restore: is no saved page");
    const auto settings = read.read<PageSettings>();
    const auto drops = read.read<std::vector<int>>();
    const internal::Hands hands = internal::read_hands(read);
    const auto state = read.read<std::vector<std::byte>>();
    restart(settings);
    for (const int model : drops) m.check_model(model, "restore");
    m.drops = drops;
    m.add_dropped(drops.size());
    m.player->restore_state(state);
    m.hands = hands;
  } catch (const InvalidArgument&) {
    restart(PageSettings(m.settings));
    throw;
  }
  keep();
}

std::string PageWorld::recording() {
  Impl& m = *impl_;
  std::vector<std::byte> here;
  m.player->save_state(here);
  const internal::Hands hands = m.hands;
  const Vec3 gravity = m.settings.gravity;
  const std::vector<internal::PageBody> bodies_here = m.bodies;
  const std::size_t dropped_here = m.dropped();
  Trajectory all;
  all.scene = m.scene.name;
  all.step = all.key_interval = m.scene.step;
  for (std::size_t i = 0; i < m.scene.statics.size(); ++i)
    all.statics.push_back({m.scene.statics[i].name, m.models.shape_of_static[i], m.scene.statics[i].pose});
  for (int key = kept() - 1; key >= 0; --key) {  // backwards: all bodies are there at first
    go_to(key);
    all.times.insert(all.times.begin(), static_cast<double>(kept_step(key)) * m.scene.step);
    internal::record_key(m.world(), m.bodies, m.kinds, all.bodies);
  }
  for (BodyTrack& track : all.bodies) internal::turn_round(track);
  m.add_dropped(dropped_here);
  m.player->restore_state(here);
  m.bodies = bodies_here;
  m.hands = hands;
  m.settings.gravity = gravity;
  return make_recording(all).glb;
}

}  // namespace limber
