#include "limber/model/audio_gltf.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numbers>
#include <numeric>
#include <utility>

#include "accessor_type.h"
#include "limber/core/error.h"
#include "limber/internal/strict_json.h"
#include "limber/model/glb.h"
#include "limber/model/morph_targets.h"

namespace limber {
namespace {

using nlohmann::json;

constexpr char kAudioExtension[] = "KHR_audio_rigid_bodies";

json mass_properties_of(const ModalModelData& body) {
  // Inertia about the centre of mass, by its principal axes.
  const Vec3& c = body.center_of_mass;
  const Mat3 about = body.inertia - body.mass * (c.squaredNorm() * Mat3::Identity() - c * c.transpose());
  const Eigen::SelfAdjointEigenSolver<Mat3> principal(about);
  Mat3 axes = principal.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(0) *= -1.0;
  const Quaternion q = quaternion_from_matrix(axes);
  const Vec3 moments = principal.eigenvalues();
  return {{"mass", body.mass},
          {"centerOfMass", {c.x(), c.y(), c.z()}},
          {"inertiaDiagonal", {moments.x(), moments.y(), moments.z()}},
          {"inertiaOrientation", {q.x, q.y, q.z, q.w}}};
}

json audio_model_block(GlbBuilder& glb, const ModalModel& body, const SoundModes& sound) {
  std::vector<float> frequencies, decays;
  for (std::size_t k = 0; k < sound.eigenvalues.size(); ++k) {
    const double xi = sound.decays[k];
    frequencies.push_back(static_cast<float>(std::sqrt(sound.eigenvalues[k] - xi * xi) / (2.0 * std::numbers::pi)));
    decays.push_back(static_cast<float>(xi));
  }
  const int frequency = glb.add_scalars(frequencies), decay = glb.add_scalars(decays);
  const int position = glb.add_vertex_vectors(rest_positions(body.collision()));
  const int shape = glb.add_vertex_vectors(sound.shapes);
  const int faces = glb.add_triangles(body.collision().triangles);
  return {{"name", body.name()},
          {"frequencies", frequency},
          {"decayRates", decay},
          {"positions", position},
          {"shapes", shape},
          {"indices", faces},
          {"massProperties", mass_properties_of(body.data())}};
}

/// Numbers of an accessor, whoever laid them out: every offset and count is checked before it is used.
class AccessorReader {
 public:
  AccessorReader(const json& document, std::string_view binary, std::string name)
      : document_(document), binary_(binary), name_(std::move(name)) {}

  std::vector<float> floats(const json& owner, const char* key, std::size_t components) const {
    const View view = elements(owner, key, components == 1 ? "SCALAR" : "VEC3");
    if (view.component != internal::kFloat) refuse_audio(key, "is not of 32-bit floats");
    std::vector<float> out(view.count * components);
    copy(view, components * sizeof(float), out.data());
    if (!std::ranges::all_of(out, [](float x) { return std::isfinite(x); })) refuse_audio(key, "is not finite");
    return out;
  }

  std::vector<Index> indices(const json& owner, const char* key, std::size_t below) const {
    constexpr int kUint16 = 5123;
    const View view = elements(owner, key, "SCALAR");
    std::vector<Index> out(view.count);
    if (view.component == internal::kUint32) {
      std::vector<std::uint32_t> read(view.count);
      copy(view, sizeof(std::uint32_t), read.data());
      std::ranges::transform(read, out.begin(),
                             [&](std::uint32_t i) { return i < below ? static_cast<Index>(i) : -1; });
    } else if (view.component == kUint16) {
      std::vector<std::uint16_t> read(view.count);
      copy(view, sizeof(std::uint16_t), read.data());
      std::ranges::transform(read, out.begin(),
                             [&](std::uint16_t i) { return i < below ? static_cast<Index>(i) : -1; });
    } else {
      refuse_audio(key, "is not of unsigned integers of 16 or 32 bits");
    }
    if (std::ranges::any_of(out, [](Index i) { return i < 0; })) refuse_audio(key, "names a point that is not there");
    return out;
  }

  [[noreturn]] void refuse_audio(const std::string& what, const std::string& why) const {
    throw InputError(name_ + " " + kAudioExtension + ": " + what + " " + why);
  }

 private:
  struct View {
    std::size_t offset = 0, end = 0;    // bytes, of the first element and of the bufferView
    std::size_t count = 0, stride = 0;  // 0: packed
    std::int64_t component = 0;
  };

  /// A whole number at a key, or `otherwise` where there is none.
  std::size_t whole(const json& object, const char* key, std::int64_t otherwise) const {
    const auto found = object.find(key);
    if (found == object.end() && otherwise >= 0) return static_cast<std::size_t>(otherwise);
    constexpr std::int64_t kMost = std::int64_t{1} << 40;
    if (found == object.end() || !found->is_number_integer() || found->get<std::int64_t>() < 0 ||
        found->get<std::int64_t>() > kMost)
      refuse_audio(key, "is missing or no whole number");
    return static_cast<std::size_t>(found->get<std::int64_t>());
  }

  const json& listed(const char* list, std::size_t index) const {
    const auto found = document_.find(list);
    if (found == document_.end() || !found->is_array() || index >= found->size() || !(*found)[index].is_object())
      refuse_audio(list, "has no number " + std::to_string(index));
    return (*found)[index];
  }

  View elements(const json& owner, const char* key, const std::string& type) const {
    const json& accessor = listed("accessors", whole(owner, key, -1));
    if (!accessor.contains("type") || accessor["type"] != type) refuse_audio(key, "is no accessor of type " + type);
    if (accessor.contains("sparse") || !accessor.contains("bufferView"))
      refuse_audio(key, "is a sparse accessor or one without a bufferView, which limber does not read");
    const json& view = listed("bufferViews", whole(accessor, "bufferView", -1));
    if (whole(view, "buffer", -1) != 0) refuse_audio(key, "is not in the file's BIN chunk");
    View out{.count = whole(accessor, "count", -1), .stride = whole(view, "byteStride", 0)};
    out.component = static_cast<std::int64_t>(whole(accessor, "componentType", -1));
    const std::size_t inside = whole(accessor, "byteOffset", 0);
    out.offset = whole(view, "byteOffset", 0) + inside;
    const std::size_t length = whole(view, "byteLength", -1);
    if (out.count == 0 || inside > length || out.offset - inside > binary_.size() ||
        length > binary_.size() - (out.offset - inside))
      refuse_audio(key, "is empty or ends beyond the BIN chunk");
    out.end = out.offset - inside + length;
    return out;
  }

  void copy(const View& view, std::size_t size, void* out) const {
    const std::size_t stride = view.stride > 0 ? view.stride : size;
    if (stride < size || view.count > view.end / stride + 1 ||
        view.offset + (view.count - 1) * stride + size > view.end)
      refuse_audio("an accessor", "ends beyond its bufferView");
    for (std::size_t i = 0; i < view.count; ++i)
      std::memcpy(static_cast<char*>(out) + i * size, binary_.data() + view.offset + i * stride, size);
  }

  const json& document_;
  std::string_view binary_;
  std::string name_;
};

std::string text_or_empty(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

AudioModel read_audio_model(const json& value, const AccessorReader& read, Warnings& warnings) {
  if (!value.is_object()) read.refuse_audio("modalModels", "holds what is no object");
  AudioModel model{.name = text_or_empty(value, "name")};
  const std::vector<float> frequencies = read.floats(value, "frequencies", 1),
                           decays = read.floats(value, "decayRates", 1), positions = read.floats(value, "positions", 3),
                           shapes = read.floats(value, "shapes", 3);
  const std::size_t modes = frequencies.size(), points = positions.size() / 3;
  if (decays.size() != modes) read.refuse_audio("decayRates", "has another count than frequencies");
  if (shapes.size() != 3 * modes * points) read.refuse_audio("shapes", "has not one vector per mode and position");
  if (value.contains("indices")) {
    const std::vector<Index> corners = read.indices(value, "indices", points);
    if (corners.size() % 3 != 0) read.refuse_audio("indices", "has a count that is no multiple of 3");
    for (std::size_t i = 0; i < corners.size(); i += 3)
      model.triangles.push_back({corners[i], corners[i + 1], corners[i + 2]});
  }
  for (std::size_t i = 0; i < points; ++i)
    model.rest.emplace_back(positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]);
  if (value.contains("massProperties") && value["massProperties"].is_object()) {
    const json& told = value["massProperties"];
    if (told.contains("mass") && told["mass"].is_number()) model.mass = told["mass"].get<double>();
  }

  std::vector<std::size_t> order(modes);
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto eigenvalue = [&](std::size_t k) {
    const double omega = 2.0 * std::numbers::pi * static_cast<double>(frequencies[k]);
    return omega * omega + static_cast<double>(decays[k]) * static_cast<double>(decays[k]);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return eigenvalue(a) < eigenvalue(b); });
  model.modes.vertices = static_cast<Index>(points);
  std::size_t left_out = 0;
  for (const std::size_t k : order) {
    if (!(frequencies[k] > 0.0f) || decays[k] < 0.0f)
      read.refuse_audio("frequencies and decayRates", "are not above 0 and at least 0 for mode " + std::to_string(k));
    if (decays[k] == 0.0f) {
      ++left_out;
      continue;
    }
    model.modes.eigenvalues.push_back(eigenvalue(k));
    model.modes.decays.push_back(static_cast<double>(decays[k]));
    const float* first = shapes.data() + 3 * k * points;
    model.modes.shapes.insert(model.modes.shapes.end(), first, first + 3 * points);
  }
  if (left_out > 0)
    warnings.push_back("modal model \"" + model.name + "\": " + std::to_string(left_out) +
                       " modes never decay and are left out");
  model.modes.validate();
  return model;
}

/// Models without a name have that of the first node that names them.
void name_by_nodes(const json& document, std::vector<AudioModel>& models) {
  const auto nodes = document.find("nodes");
  if (nodes == document.end() || !nodes->is_array()) return;
  for (const json& node : *nodes) {
    const json* block = node.is_object() && node.contains("extensions") && node["extensions"].contains(kAudioExtension)
                            ? &node["extensions"][kAudioExtension]
                            : nullptr;
    if (!block || !block->is_object() || !block->contains("modalModel") || !(*block)["modalModel"].is_number_unsigned())
      continue;
    const auto index = (*block)["modalModel"].get<std::size_t>();
    if (index < models.size() && models[index].name.empty()) models[index].name = text_or_empty(node, "name");
  }
}

}  // namespace

std::string audio_glb_bytes(const Asset& asset) {
  (void)asset_bytes(asset);  // refuses what is no asset
  GlbBuilder glb;
  const int material = glb.add_material({.name = "limber", .roughness = 0.55f, .double_sided = true});
  json models = json::array();
  for (std::size_t i = 0; i < asset.bodies.size(); ++i) {
    const ModalModel& body = *asset.bodies[i];
    GlbNode node{.name = body.name(), .translation = body.data().origin_in_input};
    const std::vector<float> rest = rest_positions(body.render());
    const int position = glb.add_vertex_vectors(rest);
    const int normal = glb.add_vertex_vectors(unit_normals(rest, body.render().triangles));
    node.mesh = glb.add_mesh({.name = body.name(),
                              .position = position,
                              .normal = normal,
                              .triangles = glb.add_triangles(body.render().triangles),
                              .material = material});
    if (const SoundModes* sound = asset.sound(i); sound && sound->modes() > 0) {
      node.extensions = json{{kAudioExtension, {{"modalModel", models.size()}}}}.dump();
      models.push_back(audio_model_block(glb, body, *sound));
    }
    glb.add_node(node);
  }
  if (models.empty()) throw InvalidArgument("audio_glb_bytes: no body has a sound, expected one (bake with --sound)");
  glb.set_extension(kAudioExtension, json{{"modalModels", models}}.dump());
  return glb.bytes();
}

std::vector<AudioModel> audio_models_from_glb(std::string_view bytes, const std::string& name, Warnings& warnings) {
  const GlbChunks chunks = glb_chunks(bytes, name);
  const json document = internal::parse_json(chunks.json, name);
  const AccessorReader read(document, chunks.binary, name);
  const json* list = nullptr;
  if (document.is_object() && document.contains("extensions") && document["extensions"].is_object() &&
      document["extensions"].contains(kAudioExtension) && document["extensions"][kAudioExtension].is_object() &&
      document["extensions"][kAudioExtension].contains("modalModels"))
    list = &document["extensions"][kAudioExtension]["modalModels"];
  if (!list || !list->is_array() || list->empty()) read.refuse_audio("modalModels", "are not there");
  std::vector<AudioModel> models;
  for (const json& value : *list) models.push_back(read_audio_model(value, read, warnings));
  name_by_nodes(document, models);
  return models;
}

}  // namespace limber
