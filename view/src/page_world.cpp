#include "limber/view/page_world.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "limber/core/error.h"
#include "limber/dynamics/reconstruct.h"
#include "page_model.h"
#include "page_motion.h"
#include "page_world_impl.h"

namespace limber {
namespace {

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

// Sound ---------------------------------------------------------------------------------------------------------------

const SoundingBody& PageWorld::sounding(int model) { return impl_->sound.sounding(model); }
double PageWorld::loudness(int model, double contact_time) {
  return impl_->sound.sounding(model).largest_pressure(contact_time) *
         impl_->kinds[static_cast<std::size_t>(model)]->data().mass;
}
void PageWorld::listen(bool on) { impl_->sound.listen(on); }
std::span<const double> PageWorld::take_blows() { return impl_->sound.take(); }

}  // namespace limber
