#include "limber/scene/scene_model.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "largest_shape.h"
#include "limber/core/error.h"
#include "limber/internal/strict_json.h"
#include "reading/shape_reading.h"

namespace limber {
namespace {

using internal::largest_shape;
using internal::ShapeLoader;

std::size_t bytes_of(const ModalBasis& basis) {
  constexpr std::size_t kBlock = 3 * ModalBasis::kTile * sizeof(float);
  return static_cast<std::size_t>(basis.tiles()) * static_cast<std::size_t>(basis.modes()) * kBlock;
}

std::size_t bytes_of(const ModalSurface& s) {
  return s.rest.size() * sizeof(Vec3f) + s.triangles.size() * sizeof(Triangle) + bytes_of(s.basis);
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

/// The model as the scene needs it, with its line of the manifest.
std::shared_ptr<const ModalModel> leave_out(const std::shared_ptr<const ModalModel>& model, const Scene& scene,
                                            ModelManifest& manifest) {
  manifest.body = model->name();
  manifest.modes_in_asset = model->modes();
  manifest.bytes_in_asset = shape_bytes(model->data());
  manifest.multiply_adds_in_asset = multiply_adds(*model);
  std::vector<Index> kept = all_modes(*model);
  if (scene.limits) {
    ModeSelection selection = select_modes(strengths(*model), *scene.limits);
    kept = std::move(selection.kept);
    manifest.dropped = std::move(selection.dropped);
  }
  manifest.volume_block_dropped = model->data().volume_block.has_value();
  const bool as_it_is = manifest.dropped.empty() && !manifest.volume_block_dropped;
  auto lean = as_it_is ? model : reduce_model(*model, kept);
  manifest.modes = lean->modes();
  manifest.bytes = shape_bytes(lean->data());
  manifest.multiply_adds = multiply_adds(*lean);
  return lean;
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

}  // namespace

std::size_t shape_bytes(const ModalModelData& data) {
  std::size_t bytes = bytes_of(data.render);
  if (data.collision) bytes += bytes_of(*data.collision);
  if (const auto& v = data.volume_block)
    bytes += v->rest.size() * sizeof(Vec3) + v->tets.size() * sizeof(Tet) + bytes_of(v->basis) +
             bytes_of(v->mass_times_basis);
  if (data.residual_compliance) bytes += data.residual_compliance->values().size_bytes();
  return bytes;
}

std::shared_ptr<const ModalModel> reduce_model(const ModalModel& model, std::span<const Index> kept, double damping) {
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (kept[i] < 0 || kept[i] >= model.modes() || (i > 0 && kept[i] <= kept[i - 1]))
      throw InvalidArgument("reduce_model: kept[" + std::to_string(i) + "] is " + std::to_string(kept[i]) +
                            ", expected ascending modes below " + std::to_string(model.modes()));
  if (!(damping >= 0.0 && std::isfinite(damping)))
    throw InvalidArgument("reduce_model: damping is " + std::to_string(damping) +
                          ", expected a finite factor of at least 0");
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
  for (double& decay : lean.decays) decay *= damping;
  lean.participation = pick(all.participation, kept);
  lean.mode_scales = pick(all.mode_scales, kept);
  lean.moments = pick(all.moments, kept);
  lean.render = pick(all.render, kept);
  if (all.collision) lean.collision = pick(*all.collision, kept);
  if (all.skin && !kept.empty()) lean.skin = pick(*all.skin, kept);
  if (all.residual_compliance) lean.residual_compliance = with_statics_of_dropped(model, kept);
  return std::make_shared<const ModalModel>(std::move(lean));
}

SceneModels make_models(const Scene& scene, const std::map<std::string, Asset>& assets) {
  SceneModels models;
  std::map<std::pair<std::string, std::size_t>, std::shared_ptr<const ModalModel>> made;
  for (const SceneBody& body : scene.bodies) {
    const auto asset = assets.find(body.asset);
    if (asset == assets.end()) throw InvalidArgument("make_models: the asset \"" + body.asset + "\" is not given");
    const std::size_t part = find_part(body, asset->second);
    auto& model = made[{body.asset, part}];
    if (!model) {
      ModelManifest manifest;
      manifest.asset = body.asset;
      if (const auto file = scene.assets.find(body.asset); file != scene.assets.end())
        manifest.file = file->second.filename().string();
      model = leave_out(asset->second.bodies[part], scene, manifest);
      models.manifest.push_back(std::move(manifest));
    }
    models.of_body.push_back(model);
  }
  ShapeLoader shapes;
  for (const SceneBody& body : scene.bodies)
    models.shape_of_body.push_back(shapes.load(body.shape, body.where, models.warnings));
  for (const SceneStatic& s : scene.statics)
    models.shape_of_static.push_back(shapes.load(s.shape, s.where, models.warnings));
  return models;
}

SceneModels load_models(const Scene& scene) {
  std::map<std::string, Asset> assets;
  for (const auto& [name, file] : scene.assets) assets.emplace(name, read_asset(file));
  return make_models(scene, assets);
}

}  // namespace limber
