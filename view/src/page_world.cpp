#include "limber/view/page_world.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>

#include "description.h"
#include "limber/core/error.h"
#include "limber/core/stage_times.h"
#include "limber/core/state_archive.h"
#include "limber/dynamics/reconstruct.h"
#include "limber/scene/recording.h"
#include "limber/scene/scene_player.h"
#include "page_history.h"
#include "page_joints.h"
#include "page_model.h"
#include "page_motion.h"
#include "page_sound.h"
#include "page_tracks.h"

namespace limber {

template <class Self>
requires std::is_same_v<std::remove_const_t<Self>, PageSettings>
auto state_fields(Self& s) {
  return std::tie(s.gravity, s.drag_frequency, s.poke_speed, s.step, s.substeps, s.modes, s.damping, s.friction,
                  s.solver, s.joint_friction, s.stiffness);
}

namespace {

constexpr double kFar = 1e4;                              // m, how long rays are
constexpr std::uint32_t kSaved = 0x4c505732;              // that bytes are a saved page, in this form
constexpr std::int64_t kForever = std::int64_t{1} << 40;  // steps: what the scene does ends by its own times

void check(const PageSettings& s) {
  const auto number = [](double value, bool open, const char* name) {
    if (!(value >= 0.0) || (open && value == 0.0) || std::isinf(value))
      throw InvalidArgument(std::string("PageSettings: ") + name + " is " + std::to_string(value) +
                            ", expected a finite number " + (open ? "above 0" : "of at least 0"));
  };
  if (!s.gravity.allFinite()) throw InvalidArgument("PageSettings: gravity is not finite");
  number(s.drag_frequency, true, "drag_frequency");
  number(s.poke_speed, false, "poke_speed");
  number(s.step, true, "step");
  number(s.damping, false, "damping");
  number(s.friction, false, "friction");
  number(s.joint_friction, false, "joint_friction");
  for (const double factor : s.stiffness)
    if (!(factor > 0.0))
      throw InvalidArgument("PageSettings: stiffness is " + std::to_string(factor) + ", expected a factor above 0");
  if (s.substeps < 1) throw InvalidArgument("PageSettings: substeps is " + std::to_string(s.substeps) + ", expected 1");
  if (s.modes < 0) throw InvalidArgument("PageSettings: modes is " + std::to_string(s.modes) + ", expected 0 or more");
}

}  // namespace

struct PageWorld::Impl {
  explicit Impl(const std::filesystem::path& path)
      : told(read_scene(path)), baked(load_models(told, {.keep = {LeftOut::kVertexRows}})) {
    settings.gravity = told.gravity;
    settings.step = told.step;
    settings.substeps = told.substeps;
    settings.solver = told.contacts.solver;
    if (told.contacts.options) settings.friction = told.contacts.options->friction;
  }

  void start();
  void list_kinds();
  World& world() { return player->world(); }
  const World& world() const { return player->world(); }
  BodyId id(int body) const { return bodies[static_cast<std::size_t>(body)].id; }
  /// −1: a static body.
  int number(BodyId id) const {
    const auto body = std::find_if(bodies.begin(), bodies.end(), [&](const auto& b) { return b.id == id; });
    return body == bodies.end() ? -1 : static_cast<int>(body - bodies.begin());
  }
  std::size_t dropped() const {
    return static_cast<std::size_t>(
        std::count_if(bodies.begin(), bodies.end(), [](const internal::PageBody& b) { return b.dropped; }));
  }
  std::vector<int> dropped_models() const {
    return {drops.begin(), drops.begin() + static_cast<std::ptrdiff_t>(dropped())};
  }
  void check_model(int model, const char* function) const {
    if (model < 0 || static_cast<std::size_t>(model) >= kinds.size())
      throw InvalidArgument(std::string("PageWorld::") + function + ": model " + std::to_string(model) +
                            ", expected 0 to " + std::to_string(kinds.size() - 1));
  }
  void add_dropped(std::size_t count);
  void forget_removed();

  const Scene told;
  const SceneModels baked;  // as they come from the assets
  PageSettings settings;
  Scene scene;         // with the settings
  SceneModels models;  // the same
  std::vector<std::shared_ptr<const ModalModel>> kinds;
  std::vector<PageModel> shown;
  StageTimes times;
  std::optional<ScenePlayer> player;
  std::vector<internal::PageBody> bodies;
  std::vector<int> drops;  // model of each body dropped so far, in this history
  internal::Hands hands;
  internal::PageHistory history;
  std::optional<internal::PageJoints> joints;
  internal::PageSound sound;
  struct {
    std::vector<float> frame;
    std::array<std::vector<float>, 2> bent;
    std::vector<double> numbers, joint_frames, joint_wishes, contacts, sensor_counts, ray_places, amplitudes,
        stage_seconds = std::vector<double>(kStages, 0.0);
    std::map<int, PageModel> touching;
  } told_to_page;  // what spans of the page point into
};

void PageWorld::Impl::list_kinds() {
  scene = told;
  scene.step = settings.step;
  scene.substeps = settings.substeps;
  scene.gravity = settings.gravity;
  if (scene.contacts.options) scene.contacts.options->friction = settings.friction;
  if (scene.contacts.rule.is_own()) scene.contacts.solver = settings.solver;
  models = baked;
  std::map<const ModalModel*, int> kind_of;
  told_to_page.touching.clear();
  kinds.clear(), shown.clear(), bodies.clear(), drops.clear(), history.clear();
  for (std::shared_ptr<const ModalModel>& model : models.of_body) {
    const auto [found, fresh] = kind_of.emplace(model.get(), static_cast<int>(kinds.size()));
    if (fresh) {
      const double stiffness = kinds.size() < settings.stiffness.size() ? settings.stiffness[kinds.size()] : 1.0;
      kinds.push_back(internal::with_settings(model, settings, stiffness));
      shown.push_back(internal::page_model(*kinds.back(), kinds.back()->render(), kinds.back()->render_extent()));
      const std::shared_ptr<const SoundModes>& heard = models.sound_of_body[bodies.size()];
      if (heard && heard->modes() > 0) shown.back().sound = internal::as_stiff(heard, stiffness);
    }
    model = kinds[static_cast<std::size_t>(found->second)];
    bodies.push_back({{}, found->second, scene.bodies[bodies.size()].name});
  }
}

void PageWorld::Impl::start() {
  player.reset();  // it refers to what follows
  list_kinds();
  for (SceneJoint& joint : scene.joints)
    for (JointActuation& acts : joint.coordinates) acts.friction *= settings.joint_friction;
  for (SceneBody& body : scene.bodies) body.placement.modal_skin = false;  // as the page draws them
  player.emplace(scene, models, kForever);
  world().set_stage_times(&times);
  for (std::size_t i = 0; i < bodies.size(); ++i) bodies[i].id = player->bodies()[i];
  hands = {};
  sound.begin(shown, kinds);
  joints.emplace(scene, world(), bodies, player->joints());
}

PageWorld::PageWorld(const std::filesystem::path& scene, bool begins) : impl_(std::make_unique<Impl>(scene)) {
  if (begins)
    begin();
  else
    impl_->list_kinds();
}
void PageWorld::begin() {
  impl_->start();
  keep();
}
PageWorld::~PageWorld() = default;

std::string PageWorld::description() const {
  const Impl& m = *impl_;
  return internal::describe(m.scene, m.models, m.shown, m.bodies, m.settings);
}
const std::vector<PageModel>& PageWorld::models() const { return impl_->shown; }
const PageModel& PageWorld::touching(int model) {
  Impl& m = *impl_;
  m.check_model(model, "touching");
  const ModalModel& kind = *m.kinds[static_cast<std::size_t>(model)];
  if (!kind.data().collision) return m.shown[static_cast<std::size_t>(model)];
  const auto found = m.told_to_page.touching.find(model);
  if (found != m.told_to_page.touching.end()) return found->second;
  return m.told_to_page.touching.emplace(model, internal::page_model(kind, kind.collision(), kind.collision_extent()))
      .first->second;
}
PageSurface PageWorld::bent(int body, double tolerance, bool touching) {
  Impl& m = *impl_;
  if (!m.player) return {};
  const ModalModel& model = m.world().model(m.id(body));
  const std::span<const double> z = m.world().body(m.id(body)).amplitudes;
  const Index modes = drawn_modes(touching ? model.collision_extent() : model.render_extent(), z, tolerance);
  if (modes == 0) return {};
  const ModalSurface& surface = touching ? model.collision() : model.render();
  auto& [positions, normals] = m.told_to_page.bent;
  positions.resize(3 * surface.rest.size());
  normals.resize(positions.size());
  const ReconstructionTarget target{
      .amplitudes = z.data(), .positions = positions.data(), .normals = normals.data(), .modes = modes};
  limber::reconstruct(surface, std::span(&target, 1));
  return {modes, positions, normals};
}
const World& PageWorld::world() const { return impl_->world(); }
PageSettings PageWorld::settings() const { return impl_->settings; }

void PageWorld::set_live(const PageSettings& settings) {
  check(settings);
  PageSettings& now = impl_->settings;
  if (settings.gravity != now.gravity) impl_->world().set_gravity(settings.gravity);
  now.gravity = settings.gravity;
  now.drag_frequency = settings.drag_frequency;
  now.poke_speed = settings.poke_speed;
}

void PageWorld::restart(const PageSettings& settings) {
  check(settings);
  impl_->settings = settings;
  impl_->start();
  keep();
}

void PageWorld::set_stiffness(int model, double factor) {
  Impl& m = *impl_;
  m.check_model(model, "set_stiffness");
  PageSettings next = m.settings;
  next.stiffness.resize(m.kinds.size(), 1.0);
  next.stiffness[static_cast<std::size_t>(model)] = factor;
  check(next);
  const std::vector<internal::BodyMotion> before = internal::motions(m.world(), m.bodies);
  const std::vector<int> drops = m.dropped_models();
  const internal::JointWishes wishes = m.hands.joints;
  m.settings = next;
  m.start();
  m.drops = drops;
  m.add_dropped(drops.size());
  internal::set_motions(before, m.bodies, m.world());
  for (std::size_t joint = 0; joint < wishes.size(); ++joint)
    for (int c = 0; c < 3; ++c) {
      const internal::CoordinateWish& wish = wishes[joint][static_cast<std::size_t>(c)];
      if (!std::isnan(wish.place) || !std::isnan(wish.speed))
        m.joints->wish(m.world(), m.hands.joints, static_cast<int>(joint), c, wish);
    }
  keep();
}

void PageWorld::step() {
  Impl& m = *impl_;
  m.times = {};
  m.player->step();
  if (m.sound.listens()) m.sound.note_step(m.scene, *m.player, m.bodies);
  for (std::size_t i = 0; i < kStages; ++i) m.told_to_page.stage_seconds[i] = m.times[static_cast<Stage>(i)].seconds;
}
std::span<const double> PageWorld::stage_seconds() const { return impl_->told_to_page.stage_seconds; }
std::int64_t PageWorld::steps_taken() const { return impl_->player->steps_taken(); }
std::uint64_t PageWorld::state_hash() const { return impl_->world().state_hash(); }

std::span<const float> PageWorld::frame() {
  Impl& m = *impl_;
  m.told_to_page.frame.clear();
  for (std::size_t i = 0; i < m.bodies.size(); ++i) {
    const RigidTransform pose = m.player ? m.world().body(m.bodies[i].id).pose : m.scene.bodies[i].placement.pose;
    const auto& [q, p] = pose;
    for (const double x : {p.x(), p.y(), p.z(), q.w, q.x, q.y, q.z})
      m.told_to_page.frame.push_back(static_cast<float>(x));
    if (m.player)
      for (const double z : m.world().body(m.bodies[i].id).amplitudes)
        m.told_to_page.frame.push_back(static_cast<float>(z));
    else
      m.told_to_page.frame.resize(
          m.told_to_page.frame.size() +
          static_cast<std::size_t>(m.kinds[static_cast<std::size_t>(m.bodies[i].model)]->modes()));
  }
  return m.told_to_page.frame;
}

std::span<const double> PageWorld::numbers() {
  Impl& m = *impl_;
  BodyEnergy sum;
  double asleep = 0.0;
  for (const internal::PageBody& body : m.bodies) {
    const BodyEnergy energy = m.world().energy(body.id);
    sum.kinetic_rigid += energy.kinetic_rigid;
    sum.kinetic_modal += energy.kinetic_modal;
    sum.elastic += energy.elastic;
    sum.potential += energy.potential;
    if (m.world().is_asleep(body.id)) asleep += 1.0;
  }
  const std::span<const ContactEvent> events = m.world().contact_events();
  const auto pressing = std::count_if(events.begin(), events.end(),
                                      [](const ContactEvent& e) { return e.phase != ContactPhase::kEnded; });
  const ConstraintReport report = m.world().constraint_report();
  m.told_to_page.numbers = {m.world().time(),
                            sum.kinetic_rigid,
                            sum.kinetic_modal,
                            sum.elastic,
                            sum.potential,
                            asleep,
                            static_cast<double>(pressing),
                            static_cast<double>(report.rows),
                            static_cast<double>(report.iterations),
                            report.solved ? 1.0 : 0.0};
  return m.told_to_page.numbers;
}

std::span<const double> PageWorld::joint_frames() {
  impl_->joints->frames(impl_->world(), impl_->told_to_page.joint_frames);
  return impl_->told_to_page.joint_frames;
}

std::span<const double> PageWorld::contacts() {
  Impl& m = *impl_;
  std::vector<double>& contacts = m.told_to_page.contacts;
  contacts.clear();
  for (const ContactEvent& event : m.world().contact_events()) {
    if (event.phase == ContactPhase::kEnded) continue;
    const Vec3 force = event.impulse / m.scene.step;
    for (const Vec3& v : {event.position, force}) contacts.insert(contacts.end(), v.begin(), v.end());
  }
  return contacts;
}

std::span<const double> PageWorld::sensor_counts() {
  Impl& m = *impl_;
  std::vector<double>& counts = m.told_to_page.sensor_counts;
  counts.clear();
  std::vector<BodyId> inside;
  for (const BodyId sensor : m.player->sensors()) {
    m.world().list_inside(sensor, inside);
    counts.push_back(static_cast<double>(inside.size()));
  }
  return counts;
}

void PageWorld::reconstruct(int body, float* positions) const {
  const World& w = impl_->world();
  const auto vertices = static_cast<std::size_t>(w.model(impl_->id(body)).render().vertices());
  w.reconstruct(impl_->id(body), std::span(positions, 3 * vertices), {});
}

// Hands ---------------------------------------------------------------------------------------------------------------

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

// Sound ---------------------------------------------------------------------------------------------------------------

const SoundingBody& PageWorld::sounding(int model) { return impl_->sound.sounding(model); }
double PageWorld::loudness(int model, double contact_time) {
  return impl_->sound.sounding(model).largest_pressure(contact_time) *
         impl_->kinds[static_cast<std::size_t>(model)]->data().mass;
}
void PageWorld::listen(bool on) { impl_->sound.listen(on); }
std::span<const double> PageWorld::take_blows() { return impl_->sound.take(); }

// History -------------------------------------------------------------------------------------------------------------

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
