#include "limber/scene/scene_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>

#include "largest_shape.h"
#include "limber/core/error.h"
#include "limber/internal/strict_json.h"
#include "reading/shape_reading.h"

namespace limber {
namespace {

using internal::largest_shape;
using internal::ShapeLoader;

/// Which parts of a model there are.
struct Parts {
  bool volume = true, rows = true, residual = true, skin = true, collision = true, drawn = true;
};

std::size_t basis_bytes(Index vertices, Index modes) {
  constexpr std::size_t kBlock = 3 * ModalBasis::kTile * sizeof(float);
  return static_cast<std::size_t>((vertices + ModalBasis::kTile - 1) / ModalBasis::kTile) *
         static_cast<std::size_t>(modes) * kBlock;
}

std::size_t surface_bytes(const ModalSurface& s, Index modes) {
  return s.rest.size() * sizeof(Vec3f) + s.triangles.size() * sizeof(Triangle) + basis_bytes(s.vertices(), modes);
}

std::size_t skin_bytes(const ModalSkin& skin, Index modes) {
  const auto per_mode = [&](std::size_t numbers) {
    return numbers / static_cast<std::size_t>(std::max<Index>(skin.modes, 1)) * static_cast<std::size_t>(modes);
  };
  return skin.rest.size() * sizeof(Vec3) + skin.arms.size() * sizeof(float) +
         (per_mode(skin.rotations.size()) + per_mode(skin.shifts.size())) * sizeof(float) +
         (skin.render.size() + skin.collision.size() + skin.volume.size()) * sizeof(SkinInfluences) +
         (skin.gauge.weights.size() + skin.gauge.rest.size() + per_mode(skin.gauge.shapes.size())) * sizeof(double);
}

/// Bytes of a model with so many modes and these parts of its own.
std::size_t bytes_of(const ModalModelData& data, Index modes, const Parts& parts) {
  const ModalSurface& touched = data.collision ? *data.collision : data.render;
  const bool one_surface = !data.collision || !parts.drawn || !parts.collision;
  std::size_t bytes = surface_bytes(one_surface && !parts.drawn ? touched : data.render, modes);
  if (!one_surface) bytes += surface_bytes(touched, modes);
  if (parts.rows && data.touchable) {
    const Index stride = (modes + VertexRows::kPadding - 1) / VertexRows::kPadding * VertexRows::kPadding;
    bytes += 3 * static_cast<std::size_t>(touched.vertices()) * static_cast<std::size_t>(stride) * sizeof(float);
  }
  if (const auto& v = data.volume_block; v && parts.volume)
    bytes += v->rest.size() * sizeof(Vec3) + v->tets.size() * sizeof(Tet) +
             2 * basis_bytes(static_cast<Index>(v->rest.size()), modes);
  if (data.residual_compliance && parts.residual) bytes += data.residual_compliance->values().size_bytes();
  if (data.skin && parts.skin) bytes += skin_bytes(*data.skin, modes);
  return bytes;
}

ModalBasis pick(const ModalBasis& basis, std::span<const Index> kept) {
  ModalBasis out(basis.vertices(), static_cast<Index>(kept.size()));
  for (Index v = 0; v < basis.vertices(); ++v)
    for (std::size_t i = 0; i < kept.size(); ++i) out.set(v, static_cast<Index>(i), basis.shape(v, kept[i]));
  return out;
}

ModalSurface pick(const ModalSurface& surface, std::span<const Index> kept) {
  return {surface.rest, surface.triangles, pick(surface.basis, kept)};
}

ModalVolume pick(const ModalVolume& volume, std::span<const Index> kept) {
  return {volume.rest, volume.tets, pick(volume.basis, kept), pick(volume.mass_times_basis, kept)};
}

template <class T>
std::vector<T> pick(const std::vector<T>& all, std::span<const Index> kept) {
  std::vector<T> out;
  for (const Index i : kept) out.push_back(all[static_cast<std::size_t>(i)]);
  return out;
}

/// Rows of `all` modes, of each those kept.
std::vector<float> pick_columns(const std::vector<float>& rows, std::size_t all, std::span<const Index> kept) {
  std::vector<float> out;
  for (std::size_t first = 0; first < rows.size(); first += all)
    for (const Index i : kept) out.push_back(rows[first + static_cast<std::size_t>(i)]);
  return out;
}

/// Without what belongs to the volume block.
ModalSkin pick(const ModalSkin& skin, std::span<const Index> kept) {
  const auto all = static_cast<std::size_t>(skin.modes);
  ModalSkin out = skin;
  out.modes = static_cast<Index>(kept.size());
  out.rotations = pick_columns(skin.rotations, all, kept);
  out.shifts = pick_columns(skin.shifts, all, kept);
  out.volume.clear();
  out.gauge.shapes.clear();
  constexpr std::size_t kNumbers = 12;  // a mode's, of a handle
  for (std::size_t first = 0; first < skin.gauge.shapes.size(); first += kNumbers * all)
    for (const Index i : kept) {
      const double* numbers = skin.gauge.shapes.data() + first + kNumbers * static_cast<std::size_t>(i);
      out.gauge.shapes.insert(out.gauge.shapes.end(), numbers, numbers + kNumbers);
    }
  return out;
}

/// Loads act on the render surface, contacts on the collision surface.
std::vector<ModeStrength> strengths(const ModalModel& model) {
  std::vector<ModeStrength> out;
  for (Index i = 0; i < model.modes(); ++i) {
    const double shown = internal::largest_shape(model.render(), i);
    const double touched = model.data().collision ? internal::largest_shape(model.collision(), i) : shown;
    out.push_back({.eigenvalue = model.data().eigenvalues[static_cast<std::size_t>(i)],
                   .decay = model.data().decays[static_cast<std::size_t>(i)],
                   .max_observable = shown,
                   .max_loadable = std::max(shown, touched)});
  }
  return out;
}

std::vector<Index> all_modes(const ModalModel& model) {
  std::vector<Index> all(static_cast<std::size_t>(model.modes()));
  std::iota(all.begin(), all.end(), Index{0});
  return all;
}

std::size_t multiply_adds(const ModalModel& model) {
  return 3 * static_cast<std::size_t>(model.render().vertices()) * static_cast<std::size_t>(model.modes());
}

std::size_t find_part(const SceneBody& body, const Asset& asset) {
  const std::string count = std::to_string(asset.bodies.size());
  if (const auto* index = std::get_if<Index>(&body.part)) {
    if (static_cast<std::size_t>(*index) < asset.bodies.size()) return static_cast<std::size_t>(*index);
    throw InputError(body.where + ".part: is " + std::to_string(*index) + ", but the asset \"" + body.asset +
                     "\" has " + count + " bodies, counted from 0");
  }
  const std::string& name = std::get<std::string>(body.part);
  std::vector<std::string> known;
  for (std::size_t i = 0; i < asset.bodies.size(); ++i) {
    if (asset.bodies[i]->name() == name) return i;
    known.push_back(asset.bodies[i]->name());
  }
  throw InputError(body.where + ".part: the asset \"" + body.asset + "\" has no body \"" + name +
                   "\"; did you mean \"" + internal::nearest_word(name, known) + "\"?");
}

/// The residual compliance with what the dropped modes answered statically: G_ab + Σ u_a u_bᵀ/λ.
ResidualCompliance with_statics_of_dropped(const ModalModel& model, std::span<const Index> kept) {
  ResidualCompliance residual = *model.data().residual_compliance;
  const ModalBasis& basis = model.collision().basis;
  const bool full = residual.form() == ResidualCompliance::Form::kFull;
  for (const Index mode : all_modes(model)) {
    const double lambda = model.data().eigenvalues[static_cast<std::size_t>(mode)];
    if (lambda == 0.0 || std::binary_search(kept.begin(), kept.end(), mode)) continue;
    for (Index a = 0; a < residual.vertices(); ++a) {
      const Vec3 u_a = basis.shape(a, mode).cast<double>() / lambda;
      for (Index b = full ? 0 : a; b <= a; ++b)
        residual.set(a, b, residual.block(a, b) + u_a * basis.shape(b, mode).cast<double>().transpose());
    }
  }
  return residual;
}

/// @param parts that stay
ModalModelData lean_data(const ModalModel& model, std::span<const Index> kept, const Parts& parts) {
  const ModalModelData& all = model.data();
  ModalModelData lean;
  lean.name = all.name;
  lean.motion = all.motion;
  lean.line_axis = all.line_axis;
  lean.mass = all.mass;
  lean.volume = all.volume;
  lean.center_of_mass = all.center_of_mass;
  lean.origin_in_input = all.origin_in_input;
  lean.inertia = all.inertia;
  lean.eigenvalues = pick(all.eigenvalues, kept);
  lean.decays = pick(all.decays, kept);
  lean.participation = pick(all.participation, kept);
  lean.mode_scales = pick(all.mode_scales, kept);
  lean.moments = pick(all.moments, kept);
  lean.touchable = all.touchable && parts.rows;
  lean.render = pick(parts.drawn ? all.render : model.collision(), kept);
  const bool two_surfaces = all.collision && parts.drawn && parts.collision;
  if (two_surfaces) lean.collision = pick(*all.collision, kept);
  if (all.skin && !kept.empty() && parts.skin) {
    lean.skin = pick(*all.skin, kept);
    if (!parts.drawn && all.collision) lean.skin->render = lean.skin->collision;
    if (!two_surfaces) lean.skin->collision.clear();
    if (all.volume_block && parts.volume) lean.skin->volume = all.skin->volume;
  }
  if (all.volume_block && parts.volume) lean.volume_block = pick(*all.volume_block, kept);
  if (all.residual_compliance && parts.residual) lean.residual_compliance = with_statics_of_dropped(model, kept);
  return lean;
}

/// A scene's use of the bodies of one model.
struct ModelNeeds {
  bool meets = false;    // others, by its own surface
  bool yields = false;   // so that its residual compliance acts
  bool bends = false;    // by its modal skin
  bool couples = false;  // its turning with its modes, by the volume block
  bool meets_itself = false;
  bool is_tied = false;    // by joints, whose patches lie on the collision surface
  bool is_loaded = false;  // by strikes, forces and handles, whose places are on the render surface
};

ModelNeeds needs_of(const Scene& scene, const std::set<std::string>& bodies, const std::vector<const SceneBody*>& own) {
  ModelNeeds needs;
  for (const SceneBody* body : own) {
    const CollisionFilter& filter = body->placement.filter;
    const bool wears = std::holds_alternative<ShapeFile>(body->shape) ||
                       std::get<std::shared_ptr<const Shape>>(body->shape) != nullptr;
    const bool in_reach = filter.self || (filter.layers != 0 && filter.mask != 0);
    needs.meets = needs.meets || (scene.contacts.options && in_reach && !wears);
    needs.bends = needs.bends || body->placement.modal_skin;
    needs.couples = needs.couples || body->placement.inertial_coupling;
    needs.meets_itself = needs.meets_itself || filter.self;
  }
  needs.yields = needs.meets && scene.contacts.options->residual_compliance;
  const auto names = [&](const auto& all) {
    return std::any_of(all.begin(), all.end(), [&](const auto& acts) { return bodies.contains(acts.body); });
  };
  needs.is_loaded = names(scene.strikes) || names(scene.forces) || names(scene.handles);
  needs.is_tied = std::any_of(scene.joints.begin(), scene.joints.end(),
                              [&](const SceneJoint& j) { return bodies.contains(j.a) || bodies.contains(j.b); });
  return needs;
}

/// Takes parts away and tells why.
class Leaving {
 public:
  Leaving(const ModalModelData& data, const SceneUse& use, Index modes, ModelManifest& manifest)
      : data_(data), use_(use), modes_(modes), manifest_(manifest) {}

  void leave(bool Parts::*part, LeftOut what, bool is_there, const std::string& why) {
    if (!is_there || std::find(use_.keep.begin(), use_.keep.end(), what) != use_.keep.end()) return;
    parts_.*part = false;
    manifest_.left_out.push_back({what, why, 0});
  }
  void note_modes(const std::string& why) { manifest_.left_out.push_back({LeftOut::kModes, why, 0}); }

  /// How much more there would be with each by itself.
  void count(Index modes_in_asset) {
    const std::size_t lean = bytes_of(data_, modes_, parts_);
    for (ModelSaving& saving : manifest_.left_out) {
      Parts with = parts_;
      if (const auto part = part_of(saving.what)) with.*part.value() = true;
      // These are of the collision surface.
      if (saving.what == LeftOut::kVertexRows || saving.what == LeftOut::kResidual) with.collision = true;
      saving.bytes = bytes_of(data_, saving.what == LeftOut::kModes ? modes_in_asset : modes_, with) - lean;
    }
    std::stable_sort(manifest_.left_out.begin(), manifest_.left_out.end(),
                     [](const ModelSaving& a, const ModelSaving& b) { return a.what < b.what; });
  }
  const Parts& parts() const { return parts_; }

 private:
  static std::optional<bool Parts::*> part_of(LeftOut what) {
    switch (what) {
      case LeftOut::kVolume:
        return &Parts::volume;
      case LeftOut::kVertexRows:
        return &Parts::rows;
      case LeftOut::kResidual:
        return &Parts::residual;
      case LeftOut::kSkin:
        return &Parts::skin;
      case LeftOut::kCollisionSurface:
        return &Parts::collision;
      case LeftOut::kDrawnSurface:
        return &Parts::drawn;
      case LeftOut::kModes:
        break;
    }
    return std::nullopt;
  }
  const ModalModelData& data_;
  const SceneUse& use_;
  Index modes_;
  ModelManifest& manifest_;
  Parts parts_;
};

void leave_out_parts(Leaving& leaving, const ModalModelData& data, const ModelNeeds& needs, const SceneUse& use) {
  const bool is_private = !use.reached_into;
  leaving.leave(&Parts::volume, LeftOut::kVolume, data.volume_block && !needs.meets_itself && !needs.couples,
                "no body of it touches itself or has inertial coupling");
  leaving.leave(&Parts::rows, LeftOut::kVertexRows, data.touchable && !data.eigenvalues.empty() && !needs.meets,
                "no body of it meets another by its surface");
  leaving.leave(&Parts::residual, LeftOut::kResidual, data.residual_compliance && !needs.yields,
                needs.meets ? "the scene's contacts do not use it" : "no body of it meets another by its surface");
  leaving.leave(&Parts::skin, LeftOut::kSkin, data.skin && !needs.bends, "all bodies of it bend by their modes alone");
  const bool undrawn = data.collision && is_private && !use.drawn && !needs.is_loaded;
  leaving.leave(&Parts::drawn, LeftOut::kDrawnSurface, undrawn, "nothing is drawn and no load asks for a place on it");
  leaving.leave(&Parts::collision, LeftOut::kCollisionSurface,
                data.collision && is_private && !undrawn && !needs.is_tied && !leaving.parts().rows &&
                    !(data.residual_compliance && leaving.parts().residual),
                "no body of it meets another or has a joint");
}

/// The model as the scene needs it, with its line of the manifest.
std::shared_ptr<const ModalModel> leave_out(const std::shared_ptr<const ModalModel>& model, const Scene& scene,
                                            const ModelNeeds& needs, const SceneUse& use, ModelManifest& manifest) {
  const ModalModelData& data = model->data();
  manifest.body = model->name();
  manifest.modes_in_asset = model->modes();
  manifest.bytes_in_asset = shape_bytes(data);
  manifest.multiply_adds_in_asset = multiply_adds(*model);
  std::vector<Index> kept = all_modes(*model);
  const bool keeps_modes = std::find(use.keep.begin(), use.keep.end(), LeftOut::kModes) != use.keep.end();
  if (scene.limits && !keeps_modes) {
    const std::vector<ModeStrength> all = strengths(*model);
    ModeSelection selection = select_modes(all, *scene.limits);
    kept = std::move(selection.kept);
    manifest.dropped = std::move(selection.dropped);
    if (scene.limits->max_force > 0.0 && !manifest.dropped.empty()) {
      manifest.dropped_displacement = 0.0;
      for (const DroppedMode& d : manifest.dropped)
        *manifest.dropped_displacement += largest_displacement(all[static_cast<std::size_t>(d.mode)], *scene.limits);
    }
  }
  Leaving leaving(data, use, static_cast<Index>(kept.size()), manifest);
  if (!manifest.dropped.empty()) leaving.note_modes("the scene's limits say that nobody can see them");
  leave_out_parts(leaving, data, needs, use);
  leaving.count(model->modes());
  auto lean =
      manifest.left_out.empty() ? model : std::make_shared<const ModalModel>(lean_data(*model, kept, leaving.parts()));
  manifest.modes = lean->modes();
  manifest.bytes = shape_bytes(lean->data());
  manifest.multiply_adds = multiply_adds(*lean);
  return lean;
}

}  // namespace

std::string_view to_string(LeftOut what) {
  constexpr std::array<std::string_view, kLeftOut> kNames{
      "modes", "volume", "vertex_rows", "residual_compliance", "modal_skin", "collision_surface", "drawn_surface"};
  return kNames.at(static_cast<std::size_t>(what));
}

bool ModelManifest::leaves_out(LeftOut what) const {
  return std::any_of(left_out.begin(), left_out.end(), [&](const ModelSaving& s) { return s.what == what; });
}

std::size_t shape_bytes(const ModalModelData& data) {
  return bytes_of(data, static_cast<Index>(data.eigenvalues.size()), {});
}

std::shared_ptr<const ModalModel> reduce_model(const ModalModel& model, std::span<const Index> kept, double damping,
                                               double stiffness) {
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (kept[i] < 0 || kept[i] >= model.modes() || (i > 0 && kept[i] <= kept[i - 1]))
      throw InvalidArgument("reduce_model: kept[" + std::to_string(i) + "] is " + std::to_string(kept[i]) +
                            ", expected ascending modes below " + std::to_string(model.modes()));
  if (!(damping >= 0.0 && std::isfinite(damping)))
    throw InvalidArgument("reduce_model: damping is " + std::to_string(damping) +
                          ", expected a finite factor of at least 0");
  if (!(stiffness > 0.0 && std::isfinite(stiffness)))
    throw InvalidArgument("reduce_model: stiffness is " + std::to_string(stiffness) +
                          ", expected a finite factor above 0");
  ModalModelData lean = lean_data(model, kept, {.volume = false});
  for (double& decay : lean.decays) decay *= damping * std::sqrt(stiffness);
  for (double& eigenvalue : lean.eigenvalues) eigenvalue *= stiffness;
  if (lean.residual_compliance)
    for (float& value : lean.residual_compliance->values()) value /= static_cast<float>(stiffness);
  return std::make_shared<const ModalModel>(std::move(lean));
}

void make_rigid(Asset& asset, std::size_t body) {
  if (body >= asset.bodies.size())
    throw InvalidArgument("make_rigid: body is " + std::to_string(body) + ", expected less than " +
                          std::to_string(asset.bodies.size()));
  asset.bodies[body] = reduce_model(*asset.bodies[body], {});
  if (body < asset.frequency_errors.size()) asset.frequency_errors[body].clear();
}

SceneModels make_models(const Scene& scene, const std::map<std::string, Asset>& assets, const SceneUse& use) {
  SceneModels models;
  std::map<std::pair<std::string, std::size_t>, std::vector<const SceneBody*>> own;
  std::map<std::pair<std::string, std::size_t>, std::shared_ptr<const ModalModel>> made;
  const auto part_of = [&](const SceneBody& body) {
    const auto asset = assets.find(body.asset);
    if (asset == assets.end()) throw InvalidArgument("make_models: the asset \"" + body.asset + "\" is not given");
    return std::pair(body.asset, find_part(body, asset->second));
  };
  for (const SceneBody& body : scene.bodies) {
    const auto part = part_of(body);
    own[part].push_back(&body);
    if (body.placement.filter.self && !assets.at(body.asset).bodies[part.second]->data().volume_block)
      throw InputError(body.where + ".touches_itself: is true, but asset \"" + body.asset +
                       "\" has no volume block, bake it with limber-precompute --volume");
  }
  for (const SceneBody& body : scene.bodies) {
    const auto key = part_of(body);
    auto& model = made[key];
    if (!model) {
      ModelManifest manifest;
      manifest.asset = body.asset;
      if (const auto file = scene.assets.find(body.asset); file != scene.assets.end())
        manifest.file = file->second.filename().string();
      std::set<std::string> names;
      for (const SceneBody* one : own[key]) names.insert({one->name, one->group});
      model =
          leave_out(assets.at(body.asset).bodies[key.second], scene, needs_of(scene, names, own[key]), use, manifest);
      models.manifest.push_back(std::move(manifest));
    }
    models.of_body.push_back(model);
    const std::vector<std::shared_ptr<const SoundModes>>& sounds = assets.at(body.asset).sounds;
    models.sound_of_body.push_back(key.second < sounds.size() ? sounds[key.second] : nullptr);
  }
  ShapeLoader shapes;
  for (const SceneBody& body : scene.bodies)
    models.shape_of_body.push_back(shapes.load(body.shape, body.where, models.warnings));
  for (const SceneStatic& s : scene.statics) {
    models.shape_of_static.push_back(shapes.load(s.shape, s.where, models.warnings));
    internal::warn_of_facing(*models.shape_of_static.back(), s.pose, scene.gravity, s.where, models.warnings);
  }
  for (const SceneSensor& s : scene.sensors)
    models.shape_of_sensor.push_back(shapes.load(s.shape, s.where, models.warnings));
  return models;
}

SceneModels load_models(const Scene& scene, const SceneUse& use) {
  std::map<std::string, Asset> assets;
  for (const auto& [name, file] : scene.assets) assets.emplace(name, read_asset(file));
  return make_models(scene, assets, use);
}

}  // namespace limber
