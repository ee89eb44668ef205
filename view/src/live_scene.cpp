#include "limber/view/live_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "description.h"
#include "limber/core/error.h"
#include "limber/dynamics/reconstruct.h"
#include "limber/scene/recording.h"
#include "limber/scene/scene_player.h"
#include "live_sound.h"
#include "live_tracks.h"

namespace limber {
namespace {

constexpr std::int64_t kForever = std::int64_t{1} << 40;  // steps: what the scene does ends by its own times

/// With the first modes alone, and other damping. Residual compliance answers for those left out.
std::shared_ptr<const ModalModel> with_settings(const std::shared_ptr<const ModalModel>& model,
                                                const LiveSettings& settings, double stiffness) {
  if (settings.modes >= model->modes() && settings.damping == 1.0 && stiffness == 1.0) return model;
  if (std::isinf(stiffness)) return reduce_model(*model, {});
  std::vector<Index> kept(static_cast<std::size_t>(std::min(settings.modes, model->modes())));
  std::iota(kept.begin(), kept.end(), Index{0});
  return reduce_model(*model, kept, settings.damping, stiffness);
}

/// A rigid body sounds as it did.
std::shared_ptr<const SoundModes> as_stiff(const std::shared_ptr<const SoundModes>& sound, double stiffness) {
  if (!sound || sound->modes() == 0) return nullptr;
  if (stiffness == 1.0 || std::isinf(stiffness)) return sound;
  SoundModes out = *sound;
  for (double& eigenvalue : out.eigenvalues) eigenvalue *= stiffness;
  for (double& decay : out.decays) decay *= std::sqrt(stiffness);
  out.contact_modulus *= stiffness;
  return std::make_shared<const SoundModes>(std::move(out));
}

}  // namespace

void LiveSettings::validate() const {
  const auto number = [](double value, bool open, const char* name) {
    if (!(value >= 0.0) || (open && value == 0.0) || std::isinf(value))
      throw InvalidArgument(std::string("LiveSettings: ") + name + " is " + std::to_string(value) +
                            ", expected a finite number " + (open ? "above 0" : "of at least 0"));
  };
  if (!gravity.allFinite()) throw InvalidArgument("LiveSettings: gravity is not finite");
  number(step, true, "step");
  number(damping, false, "damping");
  number(friction, false, "friction");
  number(joint_friction, false, "joint_friction");
  for (const double factor : stiffness)
    if (!(factor > 0.0))
      throw InvalidArgument("LiveSettings: stiffness is " + std::to_string(factor) + ", expected a factor above 0");
  if (substeps < 1) throw InvalidArgument("LiveSettings: substeps is " + std::to_string(substeps) + ", expected 1");
  if (modes < 0) throw InvalidArgument("LiveSettings: modes is " + std::to_string(modes) + ", expected 0 or more");
}

struct LiveScene::Impl {
  explicit Impl(const std::filesystem::path& path)
      : told(read_scene(path)), baked(load_models(told, {.keep = {LeftOut::kVertexRows}})) {
    settings.gravity = told.gravity;
    settings.step = told.step;
    settings.substeps = told.substeps;
    settings.solver = told.contacts.solver;
    if (told.contacts.options) settings.friction = told.contacts.options->friction;
  }

  void prepare();
  World& begun() const {
    if (!player) throw InvalidArgument("LiveScene: has not begun");
    return player->world();
  }
  const Body& body(std::size_t number) const {
    if (number >= bodies.size()) throw InvalidArgument("LiveScene: there is no body " + std::to_string(number));
    return bodies[number];
  }

  const Scene told;
  const SceneModels baked;  // as they come from the assets
  LiveSettings settings{};
  Scene scene{};         // with the settings
  SceneModels models{};  // the same
  std::vector<std::shared_ptr<const ModalModel>> kinds{};
  mutable std::optional<ScenePlayer> player{};
  std::vector<Body> bodies{};
  internal::LiveSound sound{};
  Trajectory recorded{};
  std::vector<float> frame{};
  std::array<std::vector<float>, 2> bent{};
  std::vector<double> contacts{};
};

void LiveScene::Impl::prepare() {
  player.reset();  // it refers to what follows
  scene = told;
  scene.step = settings.step;
  scene.substeps = settings.substeps;
  scene.gravity = settings.gravity;
  if (scene.contacts.options) scene.contacts.options->friction = settings.friction;
  if (scene.contacts.rule.is_own()) scene.contacts.solver = settings.solver;
  for (SceneBody& body : scene.bodies) body.placement.modal_skin = false;  // bent() has none
  for (SceneJoint& joint : scene.joints)
    for (JointActuation& acts : joint.coordinates) acts.friction *= settings.joint_friction;
  models = baked;
  kinds.clear(), bodies.clear();
  std::map<const ModalModel*, std::size_t> kind_of;
  std::vector<std::shared_ptr<const SoundModes>> sounds;
  for (std::shared_ptr<const ModalModel>& model : models.of_body) {
    const auto [found, fresh] = kind_of.emplace(model.get(), kinds.size());
    if (fresh) {
      const double stiffness = kinds.size() < settings.stiffness.size() ? settings.stiffness[kinds.size()] : 1.0;
      kinds.push_back(with_settings(model, settings, stiffness));
      sounds.push_back(as_stiff(models.sound_of_body[bodies.size()], stiffness));
    }
    model = kinds[found->second];
    bodies.push_back({{}, found->second, scene.bodies[bodies.size()].name});
  }
  sound.begin(std::move(sounds), kinds);
}

LiveScene::LiveScene(const std::filesystem::path& scene) : impl_(std::make_unique<Impl>(scene)) { impl_->prepare(); }
LiveScene::~LiveScene() = default;

const LiveSettings& LiveScene::settings() const { return impl_->settings; }
void LiveScene::prepare(const LiveSettings& settings) {
  settings.validate();
  impl_->settings = settings;
  impl_->prepare();
}
WorldOptions LiveScene::world_options() const { return limber::world_options(impl_->scene); }
void LiveScene::begin(World& world) {
  Impl& m = *impl_;
  m.player.emplace(m.scene, m.models, kForever, world);
  for (std::size_t i = 0; i < m.bodies.size(); ++i) m.bodies[i].id = m.player->bodies()[i];
  m.recorded = {};
}

std::string LiveScene::description() const {
  const Impl& m = *impl_;
  return internal::describe(m.scene, m.models, m.kinds, m.sound, m.bodies, m.settings);
}
std::span<const std::shared_ptr<const ModalModel>> LiveScene::models() const { return impl_->kinds; }
std::span<const LiveScene::Body> LiveScene::bodies() const { return impl_->bodies; }
std::span<const BodyId> LiveScene::statics() const { return impl_->begun(), impl_->player->statics(); }
std::span<const BodyId> LiveScene::sensors() const { return impl_->begun(), impl_->player->sensors(); }
std::span<const JointId> LiveScene::joints() const { return impl_->begun(), impl_->player->joints(); }

BodyId LiveScene::add_body(std::size_t model, const Vec3& position, std::string name) {
  Impl& m = *impl_;
  if (model >= m.kinds.size())
    throw InvalidArgument("LiveScene: model " + std::to_string(model) + ", expected 0 to " +
                          std::to_string(m.kinds.size() - 1));
  const BodyId id = m.begun().add_body(m.kinds[model], {.pose = {{}, position}, .modal_skin = false});
  m.bodies.push_back({id, model, std::move(name), true});
  return id;
}

void LiveScene::step() {
  Impl& m = *impl_;
  m.begun();
  m.player->step();
  if (m.sound.listens()) m.sound.note_step(m.scene, *m.player, m.bodies);
}
std::int64_t LiveScene::steps_taken() const { return impl_->begun(), impl_->player->steps_taken(); }

void LiveScene::save_state(std::vector<std::byte>& state) const { impl_->begun(), impl_->player->save_state(state); }
void LiveScene::restore_state(std::span<const std::byte> state) {
  Impl& m = *impl_;
  const World& world = m.begun();
  m.player->restore_state(state);
  std::erase_if(m.bodies, [&](const Body& body) { return !world.contains(body.id); });
}

std::span<const float> LiveScene::frame() {
  Impl& m = *impl_;
  m.frame.clear();
  for (std::size_t i = 0; i < m.bodies.size(); ++i) {
    const auto& [q, p] = m.player ? m.begun().body(m.bodies[i].id).pose : start_of(m.scene.bodies[i]).pose;
    for (const double x : {p.x(), p.y(), p.z(), q.w, q.x, q.y, q.z}) m.frame.push_back(static_cast<float>(x));
    const auto modes = static_cast<std::size_t>(m.kinds[m.bodies[i].model]->modes());
    if (m.player)
      for (const double z : m.begun().body(m.bodies[i].id).amplitudes) m.frame.push_back(static_cast<float>(z));
    else
      m.frame.resize(m.frame.size() + modes);
  }
  return m.frame;
}

BentSurface LiveScene::bent(std::size_t body, double tolerance, bool touching) {
  Impl& m = *impl_;
  if (!m.player) return {};
  const BodyId id = m.body(body).id;
  const ModalModel& model = m.begun().model(id);
  const std::span<const double> z = m.begun().body(id).amplitudes;
  const Index modes = drawn_modes(touching ? model.collision_extent() : model.render_extent(), z, tolerance);
  if (modes == 0) return {};
  const ModalSurface& surface = touching ? model.collision() : model.render();
  auto& [positions, normals] = m.bent;
  positions.resize(3 * surface.rest.size());
  normals.resize(positions.size());
  const ReconstructionTarget target{
      .amplitudes = z.data(), .positions = positions.data(), .normals = normals.data(), .modes = modes};
  limber::reconstruct(surface, std::span(&target, 1));
  return {modes, positions, normals};
}

LiveSums LiveScene::sums() const {
  const World& world = impl_->begun();
  LiveSums sums;
  for (const Body& body : impl_->bodies) {
    const BodyEnergy energy = world.energy(body.id);
    sums.energy.kinetic_rigid += energy.kinetic_rigid;
    sums.energy.kinetic_modal += energy.kinetic_modal;
    sums.energy.elastic += energy.elastic;
    sums.energy.potential += energy.potential;
    if (world.is_asleep(body.id)) ++sums.asleep;
  }
  for (const ContactEvent& event : world.contact_events())
    if (event.phase != ContactPhase::kEnded) ++sums.pressing;
  return sums;
}

std::span<const double> LiveScene::contacts() {
  Impl& m = *impl_;
  m.contacts.clear();
  for (const ContactEvent& event : m.begun().contact_events()) {
    if (event.phase == ContactPhase::kEnded) continue;
    const Vec3 force = event.impulse / m.scene.step;
    for (const Vec3& v : {event.position, force}) m.contacts.insert(m.contacts.end(), v.begin(), v.end());
  }
  return m.contacts;
}

void LiveScene::record() {
  Impl& m = *impl_;
  const World& world = m.begun();
  m.recorded.times.push_back(static_cast<double>(steps_taken()) * m.scene.step);
  internal::record_key(world, m.bodies, m.kinds, m.recorded);
}

std::string LiveScene::recording() {
  Impl& m = *impl_;
  Trajectory all = std::exchange(m.recorded, {});
  all.scene = m.scene.name;
  all.step = all.key_interval = m.scene.step;
  for (std::size_t i = 0; i < m.scene.statics.size(); ++i)
    all.statics.push_back({m.scene.statics[i].name, m.models.shape_of_static[i], m.scene.statics[i].pose});
  return make_recording(all).glb;
}

// Sound ---------------------------------------------------------------------------------------------------------------

const SoundingBody* LiveScene::sounding(std::size_t model) { return impl_->sound.sounding(model); }
void LiveScene::listen(bool on) { impl_->sound.listen(on); }
void LiveScene::note_blow(std::size_t body, const Vec3& at, const Vec3& impulse, double contact_time) {
  Impl& m = *impl_;
  if (!m.sound.listens()) return;
  const RigidTransform to_body = m.begun().body(m.body(body).id).pose.inverse();
  m.sound.note({.body = body,
                .position = at,
                .point = to_body * at,
                .impulse = to_body.q * impulse,
                .contact_time = contact_time},
               0.0, m.bodies);
}
std::span<const double> LiveScene::take_blows() { return impl_->sound.take(); }

}  // namespace limber
