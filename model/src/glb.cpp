#include "limber/model/glb.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "accessor_type.h"
#include "limber/core/error.h"
#include "limber/internal/glb_container.h"

namespace limber {
namespace {

using internal::kBinChunk;
using internal::kChunkHeaderSize;
using internal::kGlbHeaderSize;
using internal::kGlbMagic;
using internal::kGlbVersion;
using internal::kJsonChunk;
using nlohmann::json;

constexpr int kVertexBuffer = 34962, kIndexBuffer = 34963;
constexpr float kUnitTolerance = 5e-4f;  // what the Khronos validator grants unit vectors

enum class Use { kVertexVectors, kTriangles, kTimes, kTranslation, kRotation, kScale, kWeights, kScalars };

Use use_of(GlbPath path) {
  switch (path) {
    case GlbPath::kTranslation:
      return Use::kTranslation;
    case GlbPath::kRotation:
      return Use::kRotation;
    case GlbPath::kScale:
      return Use::kScale;
    case GlbPath::kWeights:
      return Use::kWeights;
  }
  throw InvalidArgument("GlbBuilder: unknown GlbPath");
}

const char* name_of(Use use) {
  switch (use) {
    case Use::kVertexVectors:
      return "vertex vectors";
    case Use::kTriangles:
      return "triangles";
    case Use::kTimes:
      return "key times";
    case Use::kTranslation:
      return "translation";
    case Use::kRotation:
      return "rotation";
    case Use::kScale:
      return "scale";
    case Use::kWeights:
      return "weights";
    case Use::kScalars:
      return "scalars";
  }
  return "";
}

[[noreturn]] void refuse(const std::string& message) { throw InvalidArgument("GlbBuilder: " + message); }

void append_u32(std::string& out, std::size_t value) {
  const auto v = static_cast<std::uint32_t>(value);
  char bytes[4];
  std::memcpy(bytes, &v, 4);
  out.append(bytes, 4);
}

json parse_object(const std::string& text, const std::string& where) {
  json value = json::parse(text, nullptr, false);
  if (!value.is_object()) refuse(where + " is not a JSON object");
  return value;
}

std::string printable(const std::string& text, const std::string& where) {
  try {
    (void)json(text).dump();
  } catch (const json::exception&) {
    refuse(where + " is not valid UTF-8");
  }
  return text;
}

void check_fraction(float value, const std::string& where) {
  if (!(value >= 0.0f && value <= 1.0f)) refuse(where + " is " + std::to_string(value) + ", expected 0 to 1");
}

}  // namespace

struct GlbBuilder::Impl {
  struct Numbers {
    Use use;
    std::size_t count;      // elements as glTF counts them
    std::uint32_t largest;  // index, of triangles
    bool unit;              // whether all are of length 1
  };

  std::string binary;
  json views = json::array(), accessors = json::array(), materials = json::array(), meshes = json::array(),
       nodes = json::array(), animations = json::array();
  json extensions = json::object(), extras = json::object();
  std::set<std::string> extensions_used;
  std::vector<Numbers> numbers;  // per accessor
  struct MeshNeeds {
    std::size_t targets;
    int joints;  // of a skin that it hangs on; -1: none
  };
  std::vector<MeshNeeds> mesh_needs;  // per mesh
  json skins = json::array();
  struct Influences {
    int joints, weights;  // accessors
    std::size_t count;
    int largest;  // joint
  };
  std::vector<Influences> influences;
  std::vector<bool> has_parent;  // per node

  int add_view(const void* data, std::size_t size, int target) {
    json view = {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", size}};
    if (target != 0) view["target"] = target;
    binary.append(static_cast<const char*>(data), size);
    views.push_back(std::move(view));
    return static_cast<int>(views.size()) - 1;
  }

  int add_floats(std::span<const float> values, std::size_t components, Use use, const char* type, int target) {
    const std::string what = name_of(use);
    if (values.empty()) refuse(what + ": there are none, expected at least one");
    if (values.size() % components != 0)
      refuse(what + ": there are " + std::to_string(values.size()) + " numbers, expected a multiple of " +
             std::to_string(components));
    std::vector<float> low(components, std::numeric_limits<float>::infinity()), high(components, -low[0]);
    bool unit = true;
    for (std::size_t i = 0; i < values.size(); i += components) {
      float square = 0.0f;
      for (std::size_t c = 0; c < components; ++c) {
        const float v = values[i + c];
        if (!std::isfinite(v)) refuse(what + ": element " + std::to_string(i / components) + " is not finite");
        low[c] = std::min(low[c], v), high[c] = std::max(high[c], v);
        square += v * v;
      }
      unit = unit && std::abs(std::sqrt(square) - 1.0f) <= kUnitTolerance;
    }
    if (use == Use::kRotation && !unit) refuse("rotation: a quaternion is not of length 1");
    const int view = add_view(values.data(), values.size_bytes(), target);
    const std::size_t count = values.size() / components;
    accessors.push_back({{"bufferView", view},
                         {"componentType", internal::kFloat},
                         {"count", count},
                         {"type", type},
                         {"min", low},
                         {"max", high}});
    numbers.push_back({use, count, 0, unit});
    return static_cast<int>(numbers.size()) - 1;
  }

  const Numbers& accessor(int index, Use use, const std::string& where) const {
    if (index < 0 || index >= static_cast<int>(numbers.size()))
      refuse(where + ": accessor " + std::to_string(index) + " does not exist");
    const Numbers& n = numbers[static_cast<std::size_t>(index)];
    if (n.use != use)
      refuse(where + ": accessor " + std::to_string(index) + " holds " + name_of(n.use) + ", expected " + name_of(use));
    return n;
  }

  void check_index(int index, const json& among, const std::string& where) const {
    if (index < 0 || index >= static_cast<int>(among.size()))
      refuse(where + " " + std::to_string(index) + " does not exist");
  }

  /// An accessor with one vector for each of `count` vertices.
  void check_vertex_vectors(int index, std::size_t count, const std::string& where) const {
    const std::size_t seen = accessor(index, Use::kVertexVectors, where).count;
    if (seen != count) refuse(where + ": has " + std::to_string(seen) + " vertices, expected " + std::to_string(count));
  }

  void put_extras(json& object, const std::string& text, const std::string& where) const {
    if (!text.empty()) object["extras"] = parse_object(text, where + ".extras");
  }

  json primitive(const GlbMesh& mesh, const std::string& where) const {
    const std::size_t vertices = accessor(mesh.position, Use::kVertexVectors, where + ".position").count;
    if (accessor(mesh.triangles, Use::kTriangles, where + ".triangles").largest >= vertices)
      refuse(where + ".triangles: name a vertex beyond the last, " + std::to_string(vertices - 1));
    json out = {{"attributes", {{"POSITION", mesh.position}}}, {"indices", mesh.triangles}};
    if (mesh.normal >= 0) {
      check_vertex_vectors(mesh.normal, vertices, where + ".normal");
      if (!numbers[static_cast<std::size_t>(mesh.normal)].unit) refuse(where + ".normal: a normal is not of length 1");
      out["attributes"]["NORMAL"] = mesh.normal;
    }
    if (mesh.influences >= 0) {
      if (static_cast<std::size_t>(mesh.influences) >= influences.size()) refuse(where + ".influences do not exist");
      const Influences& of = influences[static_cast<std::size_t>(mesh.influences)];
      if (of.count != vertices) refuse(where + ".influences: not one per vertex");
      out["attributes"]["JOINTS_0"] = of.joints;
      out["attributes"]["WEIGHTS_0"] = of.weights;
    }
    if (mesh.material >= 0) {
      check_index(mesh.material, materials, where + ".material");
      out["material"] = mesh.material;
    }
    for (const GlbMorphTarget& target : mesh.targets) {
      const std::string place = where + " target \"" + target.name + "\"";
      check_vertex_vectors(target.position, vertices, place + ".position");
      json attributes = {{"POSITION", target.position}};
      if ((target.normal >= 0) != (mesh.targets.front().normal >= 0))
        refuse(place + ".normal: either all targets of a mesh have normals or none");
      if (target.normal >= 0) {
        if (mesh.normal < 0) refuse(place + ".normal: the mesh itself has none");
        check_vertex_vectors(target.normal, vertices, place + ".normal");
        attributes["NORMAL"] = target.normal;
      }
      out["targets"].push_back(std::move(attributes));
    }
    return out;
  }

  std::size_t values_per_key(const GlbChannel& channel, const std::string& where) const {
    if (channel.path != GlbPath::kWeights) return 1;  // glTF counts vectors and quaternions as one element
    const json& node = nodes[static_cast<std::size_t>(channel.node)];
    if (!node.contains("mesh")) refuse(where + ": weights of a node without mesh");
    return mesh_needs[node["mesh"].get<std::size_t>()].targets;
  }

  json document() const;
};

GlbBuilder::GlbBuilder() : impl_(std::make_unique<Impl>()) {}
GlbBuilder::~GlbBuilder() = default;
GlbBuilder::GlbBuilder(GlbBuilder&&) noexcept = default;
GlbBuilder& GlbBuilder::operator=(GlbBuilder&&) noexcept = default;

int GlbBuilder::add_vertex_vectors(std::span<const float> xyz) {
  return impl_->add_floats(xyz, 3, Use::kVertexVectors, "VEC3", kVertexBuffer);
}

int GlbBuilder::add_influences(std::span<const SkinInfluences> influences) {
  Impl::Influences made{.joints = 0, .weights = 0, .count = influences.size(), .largest = 0};
  std::vector<std::uint8_t> joints;
  std::vector<float> weights;
  for (const SkinInfluences& of : influences)
    for (std::size_t i = 0; i < SkinInfluences::kMost; ++i) {
      weights.push_back(of.weight[i]);
      joints.push_back(of.weight[i] > 0.0f ? of.handle[i] : std::uint8_t{0});
      made.largest = std::max(made.largest, int{joints.back()});
    }
  made.weights = impl_->add_floats(weights, SkinInfluences::kMost, Use::kWeights, "VEC4", kVertexBuffer);
  const int view = impl_->add_view(joints.data(), joints.size(), kVertexBuffer);
  impl_->accessors.push_back(
      {{"bufferView", view}, {"componentType", internal::kUint8}, {"count", influences.size()}, {"type", "VEC4"}});
  impl_->numbers.push_back({Use::kWeights, influences.size(), 0, false});
  made.joints = static_cast<int>(impl_->numbers.size()) - 1;
  impl_->influences.push_back(made);
  return static_cast<int>(impl_->influences.size()) - 1;
}

int GlbBuilder::add_skin(std::span<const int> joints) {
  if (joints.empty()) refuse("skin: there are no joints, expected at least one");
  json out = {{"joints", json::array()}};
  for (const int joint : joints) {
    impl_->check_index(joint, impl_->nodes, "skin: node");
    out["joints"].push_back(joint);
  }
  impl_->skins.push_back(std::move(out));
  return static_cast<int>(impl_->skins.size()) - 1;
}

int GlbBuilder::add_triangles(std::span<const Triangle> triangles) {
  if (triangles.empty()) refuse("triangles: there are none, expected at least one");
  Index low = triangles[0][0], high = low;
  for (const Triangle& t : triangles)
    for (const Index i : t) low = std::min(low, i), high = std::max(high, i);
  if (low < 0) refuse("triangles: the vertex index " + std::to_string(low) + " is negative");
  const int view = impl_->add_view(triangles.data(), triangles.size_bytes(), kIndexBuffer);
  impl_->accessors.push_back({{"bufferView", view},
                              {"componentType", internal::kUint32},
                              {"count", 3 * triangles.size()},
                              {"type", "SCALAR"},
                              {"min", {low}},
                              {"max", {high}}});
  impl_->numbers.push_back({Use::kTriangles, 3 * triangles.size(), static_cast<std::uint32_t>(high), false});
  return static_cast<int>(impl_->numbers.size()) - 1;
}

int GlbBuilder::add_times(std::span<const float> seconds) {
  for (std::size_t i = 0; i < seconds.size(); ++i)
    if (!(i == 0 ? seconds[0] >= 0.0f : seconds[i] > seconds[i - 1]))
      refuse("key times: key " + std::to_string(i) + " is at " + std::to_string(seconds[i]) +
             " s, expected 0 or more and strictly ascending");
  return impl_->add_floats(seconds, 1, Use::kTimes, "SCALAR", 0);
}

int GlbBuilder::add_scalars(std::span<const float> numbers) {
  return impl_->add_floats(numbers, 1, Use::kScalars, "SCALAR", 0);
}

int GlbBuilder::add_key_values(std::span<const float> values, GlbPath path) {
  switch (path) {
    case GlbPath::kTranslation:
    case GlbPath::kScale:
      return impl_->add_floats(values, 3, use_of(path), "VEC3", 0);
    case GlbPath::kRotation:
      return impl_->add_floats(values, 4, use_of(path), "VEC4", 0);
    case GlbPath::kWeights:
      break;
  }
  return impl_->add_floats(values, 1, use_of(path), "SCALAR", 0);
}

int GlbBuilder::add_raw(std::span<const std::byte> bytes) {
  if (bytes.empty() || bytes.size() % 4 != 0)
    refuse("raw bytes: there are " + std::to_string(bytes.size()) + ", expected a multiple of 4 and at least 4");
  return impl_->add_view(bytes.data(), bytes.size(), 0);
}

int GlbBuilder::add_material(const GlbMaterial& material) {
  const std::string where = "material \"" + printable(material.name, "a material's name") + "\"";
  for (const float c : material.base_color) check_fraction(c, where + ".base_color");
  check_fraction(material.metallic, where + ".metallic");
  check_fraction(material.roughness, where + ".roughness");
  json out = {{"pbrMetallicRoughness",
               {{"baseColorFactor", material.base_color},
                {"metallicFactor", material.metallic},
                {"roughnessFactor", material.roughness}}}};
  if (!material.name.empty()) out["name"] = material.name;
  if (material.double_sided) out["doubleSided"] = true;
  impl_->materials.push_back(std::move(out));
  return static_cast<int>(impl_->materials.size()) - 1;
}

int GlbBuilder::add_mesh(const GlbMesh& mesh) {
  const std::string where = "mesh \"" + printable(mesh.name, "a mesh's name") + "\"";
  json out = {{"primitives", {impl_->primitive(mesh, where)}}};
  if (!mesh.name.empty()) out["name"] = mesh.name;
  impl_->put_extras(out, mesh.extras, where);
  if (!mesh.targets.empty()) {
    if (out.contains("extras") && out["extras"].contains("targetNames"))
      refuse(where + ".extras: targetNames is made from the targets' names");
    for (const GlbMorphTarget& t : mesh.targets)
      out["extras"]["targetNames"].push_back(printable(t.name, where + ": a target's name"));
    out["weights"] = mesh.weights.empty() ? std::vector<float>(mesh.targets.size()) : mesh.weights;
  }
  if (!mesh.weights.empty() && mesh.weights.size() != mesh.targets.size())
    refuse(where + ".weights: there are " + std::to_string(mesh.weights.size()) + ", expected one per target, " +
           std::to_string(mesh.targets.size()));
  for (const float w : mesh.weights)
    if (!std::isfinite(w)) refuse(where + ".weights: one is not finite");
  if (!mesh.extensions.empty()) {
    out["extensions"] = parse_object(mesh.extensions, where + ".extensions");
    for (const auto& [name, unused] : out["extensions"].items()) impl_->extensions_used.insert(name);
  }
  impl_->meshes.push_back(std::move(out));
  impl_->mesh_needs.push_back(
      {mesh.targets.size(),
       mesh.influences >= 0 ? impl_->influences[static_cast<std::size_t>(mesh.influences)].largest : -1});
  return static_cast<int>(impl_->meshes.size()) - 1;
}

int GlbBuilder::add_node(const GlbNode& node) {
  const std::string where = "node \"" + printable(node.name, "a node's name") + "\"";
  json out = json::object();
  if (!node.name.empty()) out["name"] = node.name;
  if (node.mesh >= 0) {
    impl_->check_index(node.mesh, impl_->meshes, where + ".mesh");
    out["mesh"] = node.mesh;
  }
  if (node.skin >= 0) {
    impl_->check_index(node.skin, impl_->skins, where + ".skin");
    const int most = node.mesh >= 0 ? impl_->mesh_needs[static_cast<std::size_t>(node.mesh)].joints : -1;
    if (most < 0 || most >= static_cast<int>(impl_->skins[static_cast<std::size_t>(node.skin)]["joints"].size()))
      refuse(where + ".skin: its mesh has no influences, or hangs on a joint that the skin has not");
    out["skin"] = node.skin;
  }
  for (const int child : node.children) {
    impl_->check_index(child, impl_->nodes, where + ".children: node");
    if (impl_->has_parent[static_cast<std::size_t>(child)])
      refuse(where + ".children: node " + std::to_string(child) + " has a parent already");
    impl_->has_parent[static_cast<std::size_t>(child)] = true;
    out["children"].push_back(child);
  }
  if (node.translation) {
    if (!node.translation->allFinite()) refuse(where + ".translation is not finite");
    out["translation"] = {node.translation->x(), node.translation->y(), node.translation->z()};
  }
  if (node.rotation) {
    const Quaternion& q = *node.rotation;
    if (!(std::abs(q.norm() - 1.0) <= kUnitTolerance)) refuse(where + ".rotation is not of length 1");
    out["rotation"] = {q.x, q.y, q.z, q.w};
  }
  if (node.scale) {
    if (!(std::isfinite(*node.scale) && *node.scale > 0.0)) refuse(where + ".scale is not above 0 and finite");
    out["scale"] = {*node.scale, *node.scale, *node.scale};
  }
  if (!node.extensions.empty()) {
    out["extensions"] = parse_object(node.extensions, where + ".extensions");
    for (const auto& [name, unused] : out["extensions"].items()) impl_->extensions_used.insert(name);
  }
  impl_->put_extras(out, node.extras, where);
  impl_->nodes.push_back(std::move(out));
  impl_->has_parent.push_back(false);
  return static_cast<int>(impl_->nodes.size()) - 1;
}

int GlbBuilder::add_animation(const GlbAnimation& animation) {
  static constexpr const char* kPathNames[] = {"translation", "rotation", "scale", "weights"};
  const std::string where = "animation \"" + printable(animation.name, "an animation's name") + "\"";
  if (animation.channels.empty()) refuse(where + ": has no channel");
  json channels = json::array(), samplers = json::array();
  std::set<std::pair<int, GlbPath>> moved;
  for (const GlbChannel& c : animation.channels) {
    const std::string place = where + " channel " + std::to_string(channels.size());
    impl_->check_index(c.node, impl_->nodes, place + ": node");
    if (!moved.emplace(c.node, c.path).second) refuse(place + ": moves what an earlier channel moves");
    const std::size_t keys = impl_->accessor(c.times, Use::kTimes, place + ".times").count;
    const std::size_t values = impl_->accessor(c.values, use_of(c.path), place + ".values").count;
    const std::size_t expected = keys * impl_->values_per_key(c, place);
    if (values != expected)
      refuse(place + ".values: there are " + std::to_string(values) + ", expected " + std::to_string(expected));
    channels.push_back(
        {{"sampler", samplers.size()}, {"target", {{"node", c.node}, {"path", kPathNames[static_cast<int>(c.path)]}}}});
    samplers.push_back({{"input", c.times}, {"output", c.values}, {"interpolation", c.step ? "STEP" : "LINEAR"}});
  }
  json out = {{"channels", channels}, {"samplers", samplers}};
  if (!animation.name.empty()) out["name"] = animation.name;
  impl_->animations.push_back(std::move(out));
  return static_cast<int>(impl_->animations.size()) - 1;
}

void GlbBuilder::set_extension(const std::string& name, const std::string& text) {
  impl_->extensions[printable(name, "an extension's name")] = parse_object(text, "extension \"" + name + "\"");
  impl_->extensions_used.insert(name);
}

void GlbBuilder::set_extras(const std::string& text) { impl_->extras = parse_object(text, "extras"); }

int GlbBuilder::views() const { return static_cast<int>(impl_->views.size()); }
std::string_view GlbBuilder::binary() const { return impl_->binary; }

json GlbBuilder::Impl::document() const {
  json out = {{"asset", {{"version", "2.0"}, {"generator", "limber"}}}};
  json roots = json::array();
  for (std::size_t i = 0; i < has_parent.size(); ++i)
    if (!has_parent[i]) roots.push_back(i);
  if (!roots.empty()) {
    out["scenes"] = json::array({{{"nodes", roots}}});
    out["scene"] = 0;
  }
  // glTF allows none of these arrays to be empty.
  const auto put = [&](const char* key, const json& value) {
    if (!value.empty()) out[key] = value;
  };
  put("nodes", nodes);
  put("meshes", meshes);
  put("skins", skins);
  put("materials", materials);
  put("animations", animations);
  put("accessors", accessors);
  put("bufferViews", views);
  if (!binary.empty()) out["buffers"] = json::array({{{"byteLength", binary.size()}}});
  put("extensions", extensions);
  put("extensionsUsed", json(extensions_used));
  put("extras", extras);
  return out;
}

std::string GlbBuilder::bytes() const {
  const std::string& binary = impl_->binary;
  std::string text = impl_->document().dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::size_t total =
      kGlbHeaderSize + kChunkHeaderSize + text.size() + (binary.empty() ? 0 : kChunkHeaderSize + binary.size());
  if (total > std::numeric_limits<std::uint32_t>::max())
    refuse("the file would have " + std::to_string(total) + " bytes, expected at most 4294967295 as GLB allows");
  std::string out;
  out.reserve(total);
  for (const std::size_t word :
       {std::size_t{kGlbMagic}, std::size_t{kGlbVersion}, total, text.size(), std::size_t{kJsonChunk}})
    append_u32(out, word);
  out += text;
  if (!binary.empty()) {
    append_u32(out, binary.size());
    append_u32(out, kBinChunk);
    out += binary;
  }
  return out;
}

}  // namespace limber
