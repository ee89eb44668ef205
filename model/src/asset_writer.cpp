#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "asset_format.h"
#include "asset_machine.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/model/asset.h"
#include "limber/model/asset_without_normals.h"
#include "limber/model/glb.h"
#include "limber/model/morph_targets.h"

namespace limber {
namespace {

namespace asset_format = internal::asset_format;
using asset_format::ContentHash;
using nlohmann::json;

/// Text as JSON can hold it: bytes that are not UTF-8 (file names may have them) become replacement characters.
std::string utf8(const std::string& text) {
  return json::parse(json(text).dump(-1, ' ', false, json::error_handler_t::replace)).get<std::string>();
}

Provenance utf8(const Provenance& p) { return {utf8(p.tool), utf8(p.input), utf8(p.input_hash), utf8(p.options)}; }

json numbers(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

void append(json& list, const Mat3& m) {
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) list.push_back(m(row, column));
}

json list_of(const std::vector<Vec3>& vectors) {
  json list = json::array();
  for (const Vec3& v : vectors)
    for (int a = 0; a < 3; ++a) list.push_back(v[a]);
  return list;
}

json list_of(const std::vector<Mat3>& matrices) {
  json list = json::array();
  for (const Mat3& m : matrices) append(list, m);
  return list;
}

template <class T>
int add_raw(GlbBuilder& glb, const std::vector<T>& items) {
  return glb.add_raw(std::as_bytes(std::span(items)));
}

/// All shapes of a basis, mode after mode, 3 floats per vertex. @pre there is at least one mode
int add_shapes(GlbBuilder& glb, const ModalBasis& basis) {
  std::vector<float> shapes;
  shapes.reserve(3 * static_cast<std::size_t>(basis.vertices()) * static_cast<std::size_t>(basis.modes()));
  for (Index mode = 0; mode < basis.modes(); ++mode)
    for (Index v = 0; v < basis.vertices(); ++v) {
      const Vec3f u = basis.shape(v, mode);
      shapes.insert(shapes.end(), {u.x(), u.y(), u.z()});
    }
  return add_raw(glb, shapes);
}

json collision_block(GlbBuilder& glb, const ModalSurface& surface) {
  json block = {{"vertices", surface.rest.size()}, {"triangles", surface.triangles.size()}};
  block["rest"] = add_raw(glb, rest_positions(surface));
  block["faces"] = add_raw(glb, surface.triangles);
  if (surface.basis.modes() > 0) block["shapes"] = add_shapes(glb, surface.basis);
  return block;
}

json volume_block(GlbBuilder& glb, const ModalVolume& volume) {
  std::vector<double> rest;
  for (const Vec3& p : volume.rest) rest.insert(rest.end(), {p.x(), p.y(), p.z()});
  json block = {{"nodes", volume.rest.size()}, {"tets", volume.tets.size()}};
  block["rest"] = add_raw(glb, rest);
  block["elements"] = add_raw(glb, volume.tets);
  if (volume.basis.modes() > 0) {
    block["shapes"] = add_shapes(glb, volume.basis);
    block["mass_times_shapes"] = add_shapes(glb, volume.mass_times_basis);
  }
  return block;
}

json residual_block(GlbBuilder& glb, const ResidualCompliance& residual) {
  json block = {{"form", to_string(residual.form())}, {"vertices", residual.vertices()}};
  block["blocks"] = glb.add_raw(std::as_bytes(residual.values()));
  return block;
}

json captured_block(const std::vector<CapturedLoad>& captured) {
  json block = {{"loads", captured.size()}, {"places", json::array()}, {"shares", json::array()}};
  for (const CapturedLoad& load : captured) {
    for (int a = 0; a < 3; ++a) block["places"].push_back(load.at[a]);
    block["shares"].push_back(load.share);
  }
  return block;
}

json skin_block(GlbBuilder& glb, const ModalSkin& skin) {
  json block = {{"version", asset_format::kSkinVersion}, {"handles", skin.handles}};
  const auto add = [&](const char* key, const auto& items) {
    if (!items.empty()) block[key] = add_raw(glb, items);
  };
  std::vector<double> rest;
  for (const Vec3& r : skin.rest) rest.insert(rest.end(), {r.x(), r.y(), r.z()});
  add("rest", rest);
  add("rotations", skin.rotations);
  add("arms", skin.arms);
  add("shifts", skin.shifts);
  add("render", skin.render);
  add("collision", skin.collision);
  add("volume", skin.volume);
  add("gauge_weights", skin.gauge.weights);
  add("gauge_rest", skin.gauge.rest);
  add("gauge_shapes", skin.gauge.shapes);
  return block;
}

json sound_block(GlbBuilder& glb, const SoundModes& sound) {
  json block = {{"version", asset_format::kSoundVersion},
                {"modes", sound.modes()},
                {"vertices", sound.vertices},
                {"eigenvalues", sound.eigenvalues},
                {"decays", sound.decays}};
  if (std::isfinite(sound.contact_modulus)) block["contact_modulus"] = sound.contact_modulus;
  if (!sound.shapes.empty()) block["shapes"] = add_raw(glb, sound.shapes);
  return block;
}

/// The LIMBER_modal block of a mesh, but for the parts that lie in the binary chunk.
json body_block(const ModalModelData& body) {
  json block = {{"motion", to_string(body.motion)},
                {"mass", body.mass},
                {"volume", body.volume},
                {"center_of_mass", numbers(body.center_of_mass)},
                {"origin_in_input", numbers(body.origin_in_input)},
                {"inertia", json::array()},
                {"vertices", body.render.rest.size()},
                {"triangles", body.render.triangles.size()},
                {"modes", body.eigenvalues.size()},
                {"eigenvalues", body.eigenvalues},
                {"decays", body.decays},
                {"participation", list_of(body.participation)},
                {"moments", list_of(body.moments)},
                {"mode_scales", body.mode_scales}};
  append(block["inertia"], body.inertia);
  if (body.motion == FrameMotion::kLine) block["line_axis"] = numbers(body.line_axis);
  return block;
}

/// For people who open the file in a viewer; the reader does not look at it.
std::string extras_for_people(const ModalModel& model) {
  json frequencies = json::array();
  for (Index i = 0; i < model.modes(); ++i) frequencies.push_back(model.frequency_hz(i));
  return json{{"limber", {{"frequencies_hz", frequencies}, {"mass_kg", model.data().mass}}}}.dump();
}

/// The render surface with its modes as morph targets. @return the mesh, but for extras and extensions
GlbMesh surface_mesh(GlbBuilder& glb, const ModalModel& model, int material, bool normals) {
  const ModalSurface& surface = model.render();
  const std::vector<float> rest = rest_positions(surface);
  GlbMesh mesh{.name = model.name(), .material = material};
  mesh.position = glb.add_vertex_vectors(rest);
  if (normals) mesh.normal = glb.add_vertex_vectors(unit_normals(rest, surface.triangles));
  mesh.triangles = glb.add_triangles(surface.triangles);
  for (Index i = 0; i < model.modes(); ++i) {
    const std::vector<float> moved =
        mode_displacements(surface, i, model.data().mode_scales[static_cast<std::size_t>(i)]);
    GlbMorphTarget target{.name = mode_target_name(i, model.modes(), model.frequency_hz(i))};
    target.position = glb.add_vertex_vectors(moved);
    if (normals && model.modes() <= kMaxTargetsWithNormals)
      target.normal = glb.add_vertex_vectors(normal_changes(rest, moved, surface.triangles));
    mesh.targets.push_back(std::move(target));
  }
  return mesh;
}

void add_body(GlbBuilder& glb, const ModalModel& model, const std::vector<double>& frequency_errors,
              const SoundModes* sound, int material, bool normals, ContentHash& hash) {
  const ModalModelData& body = model.data();
  GlbMesh mesh = surface_mesh(glb, model, material, normals);
  json block = body_block(body);
  if (body.collision) block["collision"] = collision_block(glb, *body.collision);
  if (body.volume_block) block["volume_block"] = volume_block(glb, *body.volume_block);
  if (body.residual_compliance) block["residual_compliance"] = residual_block(glb, *body.residual_compliance);
  if (!frequency_errors.empty()) block["frequency_errors"] = frequency_errors;  // NaN becomes null
  if (!body.captured.empty()) block["captured"] = captured_block(body.captured);
  if (body.skin) block["skin"] = skin_block(glb, *body.skin);
  if (sound) block["sound"] = sound_block(glb, *sound);
  mesh.extras = extras_for_people(model);
  mesh.extensions = json{{asset_format::kExtension, std::move(block)}}.dump();
  // The body keeps the input's axes; the node puts its origin where it was, so that the bodies stand as they did there.
  glb.add_node({.name = body.name, .mesh = glb.add_mesh(mesh), .translation = body.origin_in_input});
  hash.add_body(body, frequency_errors, sound);
}

void check_frequency_errors(const Asset& asset) {
  if (asset.frequency_errors.empty()) return;
  if (asset.frequency_errors.size() != asset.bodies.size())
    throw InvalidArgument("asset_bytes: frequency_errors are told of " + std::to_string(asset.frequency_errors.size()) +
                          " bodies, expected " + std::to_string(asset.bodies.size()) + " or none");
  for (std::size_t i = 0; i < asset.bodies.size(); ++i) {
    const auto& errors = asset.frequency_errors[i];
    const auto modes = static_cast<std::size_t>(asset.bodies[i]->modes());
    const auto wrong = [](double e) { return std::isinf(e) || e <= -1.0; };
    if ((!errors.empty() && errors.size() != modes) || std::any_of(errors.begin(), errors.end(), wrong))
      throw InvalidArgument("asset_bytes: frequency_errors of body \"" + asset.bodies[i]->name() + "\" are " +
                            std::to_string(errors.size()) + " numbers, expected " + std::to_string(modes) +
                            " above -1 and finite or NaN, or none");
  }
}

void check_sounds(const Asset& asset) {
  if (!asset.sounds.empty() && asset.sounds.size() != asset.bodies.size())
    throw InvalidArgument("asset_bytes: there are sounds of " + std::to_string(asset.sounds.size()) +
                          " bodies, expected " + std::to_string(asset.bodies.size()) + " or none");
  for (std::size_t i = 0; i < asset.bodies.size(); ++i) {
    const SoundModes* sound = asset.sound(i);
    if (!sound) continue;
    sound->validate();
    if (const Index vertices = asset.bodies[i]->collision().vertices(); sound->vertices != vertices)
      throw InvalidArgument("asset_bytes: the sound of body \"" + asset.bodies[i]->name() + "\" has " +
                            std::to_string(sound->vertices) + " vertices, expected " + std::to_string(vertices) +
                            ", those of the surface that touches");
  }
}

void check(const Asset& asset) {
  if (asset.bodies.empty()) throw InvalidArgument("asset_bytes: there is no body, expected at least one");
  std::set<std::string> names;
  for (const auto& body : asset.bodies) {
    if (!body) throw InvalidArgument("asset_bytes: a body is null");
    if (!names.insert(body->name()).second)
      throw InvalidArgument("asset_bytes: two bodies are called \"" + body->name() + "\", expected different names");
    if (body->modes() > kMaxMorphTargets)
      throw InvalidArgument("asset_bytes: body \"" + body->name() + "\" has " + std::to_string(body->modes()) +
                            " modes, expected at most " + std::to_string(kMaxMorphTargets) +
                            ", as viewers take no more morph targets; keep fewer (--modes)");
  }
  check_frequency_errors(asset);
  check_sounds(asset);
  const auto bodies = static_cast<Index>(asset.bodies.size());
  const auto require_two = [&](Index a, Index b, Index least, const char* what) {
    if (a < least || a >= bodies || b < 0 || b >= bodies || a == b)
      throw InvalidArgument(std::string("asset_bytes: ") + what + " is of bodies " + std::to_string(a) + " and " +
                            std::to_string(b) + ", expected two of " + std::to_string(bodies));
  };
  for (const auto& [a, b] : asset.apart) require_two(a, b, 0, "a pair that does not collide");
  for (const AssetJoint& joint : asset.joints) {
    require_two(joint.a, joint.b, AssetJoint::kWorld, "a joint");
    joint.spec.validate();
    if (!(joint.patch_radius >= 0.0 && std::isfinite(joint.patch_radius)))
      throw InvalidArgument("asset_bytes: a joint's patch_radius is " + std::to_string(joint.patch_radius) +
                            " m, expected a finite number of at least 0");
    if (joint.coordinates.size() > static_cast<std::size_t>(freedoms(joint.spec.type).count()))
      throw InvalidArgument("asset_bytes: a " + std::string(to_string(joint.spec.type)) + " joint has " +
                            std::to_string(joint.coordinates.size()) + " coordinates, more than its type");
    for (const JointActuation& a : joint.coordinates) a.validate();
  }
}

/// The block, and what it says under the hash: frames are read orthonormal to the last digit.
json add_machine(const Asset& asset, ContentHash& hash) {
  json block = internal::machine_block(asset);
  Asset told;
  internal::read_machine(block, "asset_bytes: machine", static_cast<Index>(asset.bodies.size()), told);
  hash.add_machine(told.joints, told.apart);
  return block;
}

std::string bytes_of(const Asset& asset, bool normals) {
  check(asset);
  const Provenance provenance = utf8(asset.provenance);
  GlbBuilder glb;
  ContentHash hash(provenance, asset.bodies.size());
  // Double-sided, because a render surface may be open.
  const int material = glb.add_material(
      {.name = "limber", .base_color = {0.62f, 0.70f, 0.78f, 1.0f}, .roughness = 0.55f, .double_sided = true});
  for (std::size_t i = 0; i < asset.bodies.size(); ++i)
    add_body(glb, *asset.bodies[i], asset.frequency_errors.empty() ? std::vector<double>() : asset.frequency_errors[i],
             asset.sound(i), material, normals, hash);
  json block = {{"version", asset_format::kFormatVersion},
                {"provenance",
                 {{"tool", provenance.tool},
                  {"input", provenance.input},
                  {"input_hash", provenance.input_hash},
                  {"options", provenance.options}}}};
  if (!asset.joints.empty() || !asset.apart.empty()) block["machine"] = add_machine(asset, hash);
  block["content_hash"] = hash.finish(glb.binary());
  glb.set_extension(asset_format::kExtension, block.dump());
  return glb.bytes();
}

}  // namespace

std::string asset_bytes(const Asset& asset) { return bytes_of(asset, true); }

std::string asset_bytes_without_normals(const Asset& asset) { return bytes_of(asset, false); }

void write_asset(const std::filesystem::path& path, const Asset& asset) { write_file(path, asset_bytes(asset)); }

}  // namespace limber
