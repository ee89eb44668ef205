#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "accessor_type.h"
#include "asset_format.h"
#include "asset_machine.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/internal/strict_json.h"
#include "limber/model/asset.h"
#include "limber/model/glb.h"
#include "limber/model/morph_targets.h"

namespace limber {
namespace {

namespace asset_format = internal::asset_format;
using asset_format::ContentHash;
using internal::JsonObject;
using nlohmann::json;

constexpr std::size_t kMaxFileSize = 0xFFFFFFFF;             // what a GLB header can tell
constexpr std::size_t kMaxJsonSize = std::size_t{64} << 20;  // parsed JSON takes some twenty times its text
constexpr std::int64_t kMaxCount = 0x7FFFFFFF;               // an Index
const std::string kNotAnAsset =
    ": a file that another tool rewrote is a picture of the asset, no longer the asset; bake it again with "
    "limber-precompute";

/// Hands out the binary chunk piece by piece, in the order in which the writer put them: bufferViews must lie one after
/// the other without gaps, and each must be asked for once, so that nothing overlaps and nothing is left over.
class BinaryPieces {
 public:
  BinaryPieces(const JsonObject& root, std::string_view binary) : binary_(binary) {
    check_buffer(root);
    read_views(root);
    root.for_each("accessors",
                  [&](const json& value, const std::string& where) { accessors_.emplace_back(value, where); });
  }

  /// The bytes of an extension's own bufferView.
  std::string_view raw(const JsonObject& block, const std::string& key, std::size_t size) {
    const std::int64_t expected = static_cast<std::int64_t>(next_view_);
    if (block.integer(key, 0, kMaxCount) != expected)
      throw InputError(block.where(key) + ": names another bufferView than the next one, " + std::to_string(expected) +
                       kNotAnAsset);
    return next(block.where(key), size);
  }

  /// The bytes of an accessor and its bufferView.
  std::string_view accessor(const JsonObject& block, const std::string& key, int component, const std::string& type,
                            std::size_t count, std::size_t size) {
    const std::int64_t expected = static_cast<std::int64_t>(next_accessor_);
    if (block.integer(key, 0, kMaxCount) != expected)
      throw InputError(block.where(key) + ": names another accessor than the next one, " + std::to_string(expected) +
                       kNotAnAsset);
    if (next_accessor_ == accessors_.size())
      throw InputError(block.where(key) + ": names an accessor that does not exist");
    const JsonObject& a = accessors_[next_accessor_++];
    const auto must_be = [&](const std::string& field, std::int64_t value) {
      const std::int64_t seen = a.integer(field, 0, kMaxCount);
      if (seen != value)
        throw InputError(a.where(field) + ": is " + std::to_string(seen) + ", expected " + std::to_string(value) +
                         " for " + block.where(key) + kNotAnAsset);
    };
    must_be("bufferView", static_cast<std::int64_t>(next_view_));
    must_be("componentType", component);
    must_be("count", static_cast<std::int64_t>(count));
    if (a.text("type") != type) throw InputError(a.where("type") + ": expected \"" + type + "\"" + kNotAnAsset);
    for (const char* unread : {"min", "max"}) (void)a.has(unread);
    a.finish();
    return next(a.where(), size);
  }

  void finish(const std::string& name) const {
    if (next_view_ != views_.size() || next_accessor_ != accessors_.size())
      throw InputError(name + ": has " + std::to_string(views_.size()) + " bufferViews and " +
                       std::to_string(accessors_.size()) + " accessors, of which its bodies use " +
                       std::to_string(next_view_) + " and " + std::to_string(next_accessor_) + kNotAnAsset);
  }

 private:
  void check_buffer(const JsonObject& root) const {
    std::size_t buffers = 0;
    root.for_each("buffers", [&](const json& value, const std::string& where) {
      const JsonObject buffer(value, where);
      const std::int64_t length = buffer.integer("byteLength", 1, static_cast<std::int64_t>(kMaxFileSize));
      buffer.finish();
      if (static_cast<std::size_t>(length) != binary_.size())
        throw InputError(buffer.where("byteLength") + ": is " + std::to_string(length) + ", the BIN chunk has " +
                         std::to_string(binary_.size()) + " bytes");
      if (++buffers > 1) throw InputError(where + ": expected one buffer");
    });
    if (buffers == 0) throw InputError(root.where("buffers") + ": is empty, expected one buffer");
  }

  void read_views(const JsonObject& root) {
    std::size_t end = 0;
    root.for_each("bufferViews", [&](const json& value, const std::string& where) {
      const JsonObject view(value, where);
      (void)view.integer("buffer", 0, 0);
      (void)view.has("target");
      const auto offset =
          static_cast<std::size_t>(view.integer("byteOffset", 0, static_cast<std::int64_t>(kMaxFileSize)));
      const auto size =
          static_cast<std::size_t>(view.integer("byteLength", 1, static_cast<std::int64_t>(kMaxFileSize)));
      view.finish();
      if (offset != end)
        throw InputError(view.where("byteOffset") + ": is " + std::to_string(offset) + ", expected " +
                         std::to_string(end) + ", where the bufferView before it ends" + kNotAnAsset);
      if (size > binary_.size() - offset)
        throw InputError(where + ": ends at byte " + std::to_string(offset + size) + " of a BIN chunk of " +
                         std::to_string(binary_.size()));
      views_.push_back(binary_.substr(offset, size));
      end = offset + size;
    });
    if (end != binary_.size())
      throw InputError(root.where("bufferViews") + ": end at byte " + std::to_string(end) + ", the BIN chunk has " +
                       std::to_string(binary_.size()));
  }

  std::string_view next(const std::string& where, std::size_t size) {
    if (next_view_ == views_.size()) throw InputError(where + ": names a bufferView that does not exist");
    const std::string_view bytes = views_[next_view_];
    if (bytes.size() != size)
      throw InputError(where + ": its bufferView " + std::to_string(next_view_) + " has " +
                       std::to_string(bytes.size()) + " bytes, expected " + std::to_string(size));
    ++next_view_;
    return bytes;
  }

  std::string_view binary_;
  std::vector<std::string_view> views_;
  std::vector<JsonObject> accessors_;
  std::size_t next_view_ = 0, next_accessor_ = 0;
};

template <class T>
std::vector<T> items_of(std::string_view bytes) {
  std::vector<T> out(bytes.size() / sizeof(T));
  if (!out.empty()) std::memcpy(static_cast<void*>(out.data()), bytes.data(), bytes.size());
  return out;
}

std::size_t count_of(const JsonObject& block, const std::string& key) {
  return static_cast<std::size_t>(block.integer(key, 1, kMaxCount));
}

Vec3 vector_from(std::span<const double> n) { return {n[0], n[1], n[2]}; }

Mat3 matrix_from(std::span<const double> n) {
  Mat3 m;
  for (int row = 0; row < 3; ++row)
    m.row(row) = vector_from(n.subspan(3 * static_cast<std::size_t>(row), 3)).transpose();
  return m;
}

/// Data of one body in one glTF mesh.
class BodyReader {
 public:
  BodyReader(const json& value, const std::string& where, BinaryPieces& pieces)
      : mesh_(value, where), block_(extension_of(mesh_)), pieces_(pieces) {}

  const std::vector<double>& frequency_errors() const { return frequency_errors_; }
  const std::shared_ptr<const SoundModes>& sound() const { return sound_; }

  ModalModelData read() {
    data_.name = mesh_.text("name");
    read_rigid_body();
    read_modes();
    read_render_surface();
    if (block_.has("collision")) read_collision_surface();
    if (block_.has("volume_block")) read_volume();
    if (block_.has("residual_compliance")) read_residual();
    if (block_.has("frequency_errors")) read_frequency_errors();
    if (block_.has("captured")) read_captured();
    if (block_.has("skin")) read_skin();
    if (block_.has("sound")) read_sound();
    block_.finish();
    for (const char* unread : {"weights", "extras"}) (void)mesh_.has(unread);
    mesh_.finish();
    return std::move(data_);
  }

 private:
  static JsonObject extension_of(const JsonObject& mesh) {
    const JsonObject extensions(mesh.at("extensions"), mesh.where("extensions"));
    JsonObject block(extensions.at(asset_format::kExtension), extensions.where(asset_format::kExtension));
    extensions.finish();
    return block;
  }

  void read_rigid_body() {
    const std::string motion = block_.text("motion");
    bool known = false;
    for (const FrameMotion m : {FrameMotion::kFree, FrameMotion::kPoint, FrameMotion::kLine, FrameMotion::kKinematic})
      if (motion == to_string(m)) data_.motion = m, known = true;
    if (!known)
      throw InputError(block_.where("motion") + ": is " + internal::in_quotes(motion) +
                       ", expected \"free\", \"point\", \"line\" or \"kinematic\"");
    if (data_.motion == FrameMotion::kLine) data_.line_axis = block_.vec3("line_axis");
    data_.mass = block_.number("mass");
    data_.volume = block_.number("volume");
    data_.center_of_mass = block_.vec3("center_of_mass");
    data_.origin_in_input = block_.vec3("origin_in_input");
    data_.inertia = matrix_from(block_.numbers("inertia", 9));
  }

  void read_modes() {
    modes_ = static_cast<std::size_t>(block_.integer("modes", 0, kMaxMorphTargets));
    data_.eigenvalues = block_.numbers("eigenvalues", modes_);
    data_.decays = block_.numbers("decays", modes_);
    const std::vector<double> participation = block_.numbers("participation", 3 * modes_);
    const std::vector<double> moments = block_.numbers("moments", 9 * modes_);
    for (std::size_t i = 0; i < modes_; ++i) {
      data_.participation.push_back(vector_from(std::span(participation).subspan(3 * i, 3)));
      data_.moments.push_back(matrix_from(std::span(moments).subspan(9 * i, 9)));
    }
    data_.mode_scales = block_.numbers("mode_scales", modes_);
    for (std::size_t i = 0; i < modes_; ++i) {
      int exponent = 0;
      if (!(data_.mode_scales[i] > 0.0 && std::frexp(data_.mode_scales[i], &exponent) == 0.5))
        throw InputError(block_.where("mode_scales") + "[" + std::to_string(i) + "]: expected a power of two");
    }
  }

  void read_render_surface() {
    const std::size_t vertices = count_of(block_, "vertices"), triangles = count_of(block_, "triangles");
    const json& primitives = mesh_.at("primitives");
    if (!primitives.is_array() || primitives.size() != 1)
      throw InputError(mesh_.where("primitives") + ": expected an array of one primitive" + kNotAnAsset);
    const JsonObject primitive(primitives[0], mesh_.where("primitives") + "[0]");
    const JsonObject attributes(primitive.at("attributes"), primitive.where("attributes"));
    data_.render.rest = items_of<Vec3f>(vectors(attributes, "POSITION", vertices));
    const bool normals = attributes.has("NORMAL");
    if (normals) (void)vectors(attributes, "NORMAL", vertices);
    attributes.finish();
    data_.render.triangles = items_of<Triangle>(pieces_.accessor(primitive, "indices", internal::kUint32, "SCALAR",
                                                                 3 * triangles, sizeof(Triangle) * triangles));
    read_targets(primitive, vertices, normals);
    (void)primitive.has("material");
    primitive.finish();
  }

  void read_targets(const JsonObject& primitive, std::size_t vertices, bool normals) {
    std::vector<std::string_view> targets;
    if (primitive.has("targets"))
      primitive.for_each("targets", [&](const json& value, const std::string& where) {
        const JsonObject target(value, where);
        targets.push_back(vectors(target, "POSITION", vertices));
        if (normals && modes_ <= static_cast<std::size_t>(kMaxTargetsWithNormals))
          (void)vectors(target, "NORMAL", vertices);
        target.finish();
      });
    if (targets.size() != modes_)
      throw InputError(primitive.where("targets") + ": there are " + std::to_string(targets.size()) +
                       " morph targets, expected one per mode, " + std::to_string(modes_) + kNotAnAsset);
    data_.render.basis = ModalBasis(static_cast<Index>(vertices), static_cast<Index>(modes_));
    for (std::size_t i = 0; i < modes_; ++i) fill(data_.render.basis, i, targets[i], data_.mode_scales[i]);
  }

  void read_collision_surface() {
    const JsonObject block(block_.at("collision"), block_.where("collision"));
    const std::size_t vertices = count_of(block, "vertices"), triangles = count_of(block, "triangles");
    ModalSurface surface;
    surface.rest = items_of<Vec3f>(pieces_.raw(block, "rest", sizeof(Vec3f) * vertices));
    surface.triangles = items_of<Triangle>(pieces_.raw(block, "faces", sizeof(Triangle) * triangles));
    surface.basis = shapes(block, "shapes", vertices);
    block.finish();
    data_.collision = std::move(surface);
  }

  void read_volume() {
    const JsonObject block(block_.at("volume_block"), block_.where("volume_block"));
    const std::size_t nodes = count_of(block, "nodes"), tets = count_of(block, "tets");
    ModalVolume volume;
    volume.rest = items_of<Vec3>(pieces_.raw(block, "rest", sizeof(Vec3) * nodes));
    volume.tets = items_of<Tet>(pieces_.raw(block, "elements", sizeof(Tet) * tets));
    volume.basis = shapes(block, "shapes", nodes);
    volume.mass_times_basis = shapes(block, "mass_times_shapes", nodes);
    block.finish();
    data_.volume_block = std::move(volume);
  }

  void read_residual() {
    using Form = ResidualCompliance::Form;
    const JsonObject block(block_.at("residual_compliance"), block_.where("residual_compliance"));
    const std::string form = block.text("form");
    const Form kind = form == to_string(Form::kFull) ? Form::kFull : Form::kLocal;
    if (form != to_string(kind))
      throw InputError(block.where("form") + ": is \"" + form + "\", expected \"full\" or \"local\"");
    const auto vertices = static_cast<Index>(count_of(block, "vertices"));
    const std::string_view bytes =
        pieces_.raw(block, "blocks", sizeof(float) * ResidualCompliance::value_count(kind, vertices));
    ResidualCompliance residual(kind, vertices);
    std::memcpy(residual.values().data(), bytes.data(), bytes.size());
    block.finish();
    data_.residual_compliance = std::move(residual);
  }

  /// A number per mode, or null.
  void read_frequency_errors() {
    block_.for_each("frequency_errors", [&](const json& value, const std::string& where) {
      if (!value.is_null() && !value.is_number()) throw InputError(where + ": expected a number or null");
      const double error = value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
      if (error <= -1.0) throw InputError(where + ": is " + JsonObject::shown(value) + ", expected more than -1");
      frequency_errors_.push_back(error);
    });
    if (frequency_errors_.size() != modes_)
      throw InputError(block_.where("frequency_errors") + ": has " + std::to_string(frequency_errors_.size()) +
                       " entries, expected " + std::to_string(modes_) + ", one per mode");
  }

  void read_captured() {
    const JsonObject block(block_.at("captured"), block_.where("captured"));
    const std::size_t loads = count_of(block, "loads");
    const std::vector<double> places = block.numbers("places", 3 * loads), shares = block.numbers("shares", loads);
    for (std::size_t i = 0; i < loads; ++i)
      data_.captured.push_back({vector_from(std::span(places).subspan(3 * i, 3)), shares[i]});
    block.finish();
  }

  void read_sound() {
    const JsonObject block(block_.at("sound"), block_.where("sound"));
    require_version(block, asset_format::kSoundVersion);
    auto sound = std::make_shared<SoundModes>();
    const auto modes = static_cast<std::size_t>(block.integer("modes", 0, kMaxCount));
    sound->vertices = static_cast<Index>(count_of(block, "vertices"));
    sound->eigenvalues = block.numbers("eigenvalues", modes);
    sound->decays = block.numbers("decays", modes);
    if (block.has("contact_modulus")) sound->contact_modulus = block.number("contact_modulus");
    const std::size_t touched = (data_.collision ? *data_.collision : data_.render).rest.size();
    if (static_cast<std::size_t>(sound->vertices) != touched)
      throw InputError(block.where("vertices") + ": is " + std::to_string(sound->vertices) + ", expected " +
                       std::to_string(touched) + ", those of the surface that touches");
    if (modes > 0) sound->shapes = items_of<float>(pieces_.raw(block, "shapes", sizeof(Vec3f) * modes * touched));
    block.finish();
    try {
      sound->validate();
    } catch (const InvalidArgument& e) {
      throw InputError(block_.where("sound") + ": " + e.what());
    }
    sound_ = std::move(sound);
  }

  static void require_version(const JsonObject& block, int known) {
    const std::int64_t version = block.integer("version", 1, kMaxCount);
    if (version != known)
      throw InputError(block.where("version") + ": is " + std::to_string(version) + ", this limber reads version " +
                       std::to_string(known));
  }

  void read_skin() {
    const JsonObject block(block_.at("skin"), block_.where("skin"));
    require_version(block, asset_format::kSkinVersion);
    ModalSkin skin;
    skin.handles = static_cast<Index>(block.integer("handles", 1, ModalSkin::kMaxHandles));
    skin.modes = static_cast<Index>(modes_);
    const auto n = static_cast<std::size_t>(skin.handles);
    const auto read = [&]<class T>(const char* key, std::size_t count, std::vector<T>& items) {
      if (count > 0) items = items_of<T>(pieces_.raw(block, key, sizeof(T) * count));
    };
    read("rest", n, skin.rest);
    read("rotations", 3 * n * modes_, skin.rotations);
    read("arms", 3 * n * n, skin.arms);
    read("shifts", 3 * n * n * modes_, skin.shifts);
    read("render", data_.render.rest.size(), skin.render);
    read("collision", data_.collision ? data_.collision->rest.size() : 0, skin.collision);
    read("volume", data_.volume_block ? data_.volume_block->rest.size() : 0, skin.volume);
    if (data_.motion == FrameMotion::kFree) {
      read("gauge_weights", 4 * n, skin.gauge.weights);
      read("gauge_rest", 12 * n, skin.gauge.rest);
      read("gauge_shapes", 12 * n * modes_, skin.gauge.shapes);
    }
    block.finish();
    data_.skin = std::move(skin);
  }

  std::string_view vectors(const JsonObject& attributes, const std::string& key, std::size_t vertices) {
    return pieces_.accessor(attributes, key, internal::kFloat, "VEC3", vertices, sizeof(Vec3f) * vertices);
  }

  /// All modes of a basis, unscaled, mode after mode; absent if there is no mode.
  ModalBasis shapes(const JsonObject& block, const std::string& key, std::size_t vertices) {
    const std::size_t one = sizeof(Vec3f) * vertices;
    const std::string_view bytes = modes_ == 0 ? std::string_view() : pieces_.raw(block, key, one * modes_);
    ModalBasis basis(static_cast<Index>(vertices), static_cast<Index>(modes_));
    for (std::size_t i = 0; i < modes_; ++i) fill(basis, i, bytes.substr(one * i, one), 1.0);
    return basis;
  }

  static void fill(ModalBasis& basis, std::size_t mode, std::string_view bytes, double scale) {
    for (Index v = 0; v < basis.vertices(); ++v) {
      float u[3];
      std::memcpy(u, bytes.data() + sizeof u * static_cast<std::size_t>(v), sizeof u);
      for (float& x : u) x = static_cast<float>(static_cast<double>(x) / scale);
      basis.set(v, static_cast<Index>(mode), {u[0], u[1], u[2]});
    }
  }

  JsonObject mesh_, block_;
  BinaryPieces& pieces_;
  ModalModelData data_;
  std::vector<double> frequency_errors_;
  std::shared_ptr<const SoundModes> sound_;
  std::size_t modes_ = 0;
};

/// The LIMBER_modal block of the file as a whole.
struct FileBlock {
  Provenance provenance;
  std::string content_hash;
  const json* machine = nullptr;  ///< none: no joints
  std::string machine_place;
};

FileBlock read_file_block(const JsonObject& root) {
  const auto no_block = [&] {
    throw InputError(root.where() + ": has no LIMBER_modal block: it is not an asset of limber" + kNotAnAsset);
  };
  if (!root.has("extensions")) no_block();
  const JsonObject extensions(root.at("extensions"), root.where("extensions"));
  if (!extensions.has(asset_format::kExtension)) no_block();
  const JsonObject block(extensions.at(asset_format::kExtension), extensions.where(asset_format::kExtension));
  extensions.finish();
  const std::int64_t version = block.integer("version", 1, kMaxCount);
  if (version != asset_format::kFormatVersion)
    throw InputError(root.where() + ": is written in version " + std::to_string(version) +
                     " of the asset format, this limber reads version " + std::to_string(asset_format::kFormatVersion));
  const JsonObject provenance(block.at("provenance"), block.where("provenance"));
  FileBlock out{.provenance = {.tool = provenance.text("tool"),
                               .input = provenance.text("input"),
                               .input_hash = provenance.text("input_hash"),
                               .options = provenance.text("options")},
                .content_hash = block.text("content_hash"),
                .machine = block.has("machine") ? &block.at("machine") : nullptr,
                .machine_place = block.where("machine")};
  provenance.finish();
  block.finish();
  return out;
}

/// Says of a model's complaint which file it is about.
std::shared_ptr<const ModalModel> checked_model(ModalModelData data, const std::string& name) {
  try {
    return std::make_shared<const ModalModel>(std::move(data));
  } catch (const InvalidArgument& e) {
    throw InputError(name + ": " + e.what());
  }
}

Asset read_document(const json& document, std::string_view binary, const std::string& name) {
  const JsonObject root(document, name);
  const FileBlock block = read_file_block(root);
  // Drawn only, or implied by what is checked below.
  for (const char* unread : {"asset", "scene", "scenes", "nodes", "materials", "extensionsUsed"})
    (void)root.has(unread);

  Asset asset{
      .bodies = {}, .provenance = block.provenance, .joints = {}, .apart = {}, .frequency_errors = {}, .sounds = {}};
  std::vector<ModalModelData> bodies;
  std::set<std::string> names;
  BinaryPieces pieces(root, binary);
  root.for_each("meshes", [&](const json& value, const std::string& where) {
    BodyReader reader(value, where, pieces);
    bodies.push_back(reader.read());
    asset.frequency_errors.push_back(reader.frequency_errors());
    asset.sounds.push_back(reader.sound());
    if (!names.insert(bodies.back().name).second) throw InputError(where + ".name: is that of another body too");
  });
  root.finish();
  pieces.finish(name);
  if (bodies.empty()) throw InputError(name + ": holds no body");

  ContentHash hash(block.provenance, bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) hash.add_body(bodies[i], asset.frequency_errors[i], asset.sound(i));
  if (block.machine != nullptr)
    internal::read_machine(*block.machine, block.machine_place, static_cast<Index>(bodies.size()), asset);
  hash.add_machine(asset.joints, asset.apart);
  if (hash.finish(binary) != block.content_hash)
    throw InputError(name + ": its content does not match its content_hash" + kNotAnAsset);
  for (ModalModelData& body : bodies) asset.bodies.push_back(checked_model(std::move(body), name));
  return asset;
}

}  // namespace

Asset asset_from_bytes(std::string_view bytes, const std::string& name) {
  const GlbChunks chunks = glb_chunks(bytes, name);
  if (chunks.json.size() > kMaxJsonSize)
    throw InputError(name + ": its JSON chunk has " + std::to_string(chunks.json.size()) + " bytes, expected at most " +
                     std::to_string(kMaxJsonSize));
  return read_document(internal::parse_json(chunks.json, name), chunks.binary, name);
}

Asset read_asset(const std::filesystem::path& path) {
  return asset_from_bytes(read_file(path, kMaxFileSize), "\"" + path.string() + "\"");
}

}  // namespace limber
