#include "formats/gltf_file.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/internal/glb_container.h"

namespace limber::internal {
namespace {

/// Extensions that say nothing of shapes begin so.
constexpr std::string_view kOfLooks[] = {"KHR_materials_",        "KHR_texture_", "EXT_texture_",
                                         "MSFT_texture_",         "KHR_lights_",  "EXT_lights_",
                                         "KHR_animation_pointer", "KHR_xmp",      "KHR_technique"};

/// How an accessor's numbers are stored: glTF 2.0, 3.6.2.2.
enum class Stored { kInt8 = 5120, kUint8 = 5121, kInt16 = 5122, kUint16 = 5123, kUint32 = 5125, kFloat = 5126 };

std::size_t size_of(Stored stored) {
  switch (stored) {
    case Stored::kInt8:
    case Stored::kUint8:
      return 1;
    case Stored::kInt16:
    case Stored::kUint16:
      return 2;
    case Stored::kUint32:
    case Stored::kFloat:
      return 4;
  }
  return 0;
}

Stored stored_as(const JsonObject& of) {
  const std::int64_t type = of.integer("componentType", 5120, 5126);
  if (type == 5124) throw InputError(of.where("componentType") + ": is 5124, which glTF does not have");
  return static_cast<Stored>(type);
}

template <class T>
double number_at(const char* at, bool normalised) {
  T value;
  std::memcpy(&value, at, sizeof value);
  if (!normalised) return static_cast<double>(value);
  return std::max(-1.0, static_cast<double>(value) / static_cast<double>(std::numeric_limits<T>::max()));
}

double number_at(const char* at, Stored stored, bool normalised) {
  switch (stored) {
    case Stored::kInt8:
      return number_at<std::int8_t>(at, normalised);
    case Stored::kUint8:
      return number_at<std::uint8_t>(at, normalised);
    case Stored::kInt16:
      return number_at<std::int16_t>(at, normalised);
    case Stored::kUint16:
      return number_at<std::uint16_t>(at, normalised);
    case Stored::kUint32:
      return number_at<std::uint32_t>(at, normalised);
    case Stored::kFloat:
      return number_at<float>(at, false);
  }
  return 0.0;
}

std::size_t components_of(std::string_view type) {
  return type == "SCALAR" ? 1 : type == "VEC3" ? 3 : type == "VEC4" ? 4 : 16;
}

/// RFC 3986, 2.1; a per cent sign that begins no byte stands for itself.
std::string without_per_cent(std::string_view uri) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  std::string out;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const bool coded = uri[i] == '%' && i + 2 < uri.size() && digit(uri[i + 1]) >= 0 && digit(uri[i + 2]) >= 0;
    out += coded ? static_cast<char>(16 * digit(uri[i + 1]) + digit(uri[i + 2])) : uri[i];
    if (coded) i += 2;
  }
  return out;
}

/// RFC 4648, 4. @return whether it is base64
bool decode_base64(std::string_view text, std::string& out) {
  while (text.ends_with('=')) text.remove_suffix(1);
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    const int value = c >= 'A' && c <= 'Z'   ? c - 'A'
                      : c >= 'a' && c <= 'z' ? c - 'a' + 26
                      : c >= '0' && c <= '9' ? c - '0' + 52
                      : c == '+'             ? 62
                      : c == '/'             ? 63
                                             : -1;
    if (value < 0) return false;
    bits = bits << 6 | static_cast<std::uint32_t>(value);
    held += 6;
    if (held < 8) continue;
    held -= 8;
    out += static_cast<char>(bits >> held & 0xff);
  }
  return true;
}

}  // namespace

bool is_gltf_1(std::string_view bytes) {
  if (bytes.starts_with("glTF")) return bytes.size() >= 8 && u32_at(bytes, 4) == 1;
  const nlohmann::json json = nlohmann::json::parse(bytes.begin(), bytes.end(), nullptr, false);
  if (!json.is_object() || !json.contains("asset") || !json["asset"].is_object()) return false;
  const auto version = json["asset"].find("version");
  return version != json["asset"].end() &&
         (version->is_string() ? version->get_ref<const std::string&>().starts_with("1") : *version == 1);
}

GltfFile::GltfFile(const std::filesystem::path& path, const FileBytes& file) : path_(path), name_(file.name) {
  take_container(file.bytes);
  check_version();
  check_extensions();
  buffers_.resize(count("buffers"));
}

/// GLB: a head of 12 bytes, then chunks of length, kind and bytes; the first is the JSON, the second the buffer.
void GltfFile::take_container(std::string_view bytes) {
  if (!bytes.starts_with("glTF")) {
    if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);
    json_ = parse_json(bytes, name_);
    return;
  }
  if (bytes.size() < kGlbHeaderSize + kChunkHeaderSize) throw InputError(name_ + ": ends in the head of a GLB file");
  if (const std::uint32_t version = u32_at(bytes, 4); version != kGlbVersion)
    throw InputError(name_ + ": is glTF " + std::to_string(version) + ", expected 2.0");
  std::size_t at = kGlbHeaderSize;
  for (int chunk = 0; chunk < 2 && at + kChunkHeaderSize <= bytes.size(); ++chunk) {
    const std::size_t length = u32_at(bytes, at);
    const std::uint32_t kind = u32_at(bytes, at + 4);
    at += kChunkHeaderSize;
    if (length > bytes.size() - at)
      throw InputError(name_ + ": byte " + std::to_string(at) + " begins a chunk of " + std::to_string(length) +
                       " bytes, and " + std::to_string(bytes.size() - at) + " are left");
    if (chunk == 0 && kind != kJsonChunk) throw InputError(name_ + ": its first chunk is not JSON");
    if (chunk == 0) json_ = parse_json(bytes.substr(at, length), name_);
    if (chunk == 1 && kind == kBinChunk) binary_ = bytes.substr(at, length);
    at += length;
  }
}

void GltfFile::check_version() const {
  const std::string version = JsonObject(root().at("asset"), name_ + " asset").text("version");
  if (!version.starts_with("2.")) throw InputError(name_ + ": is glTF " + in_quotes(version) + ", expected 2.0");
}

void GltfFile::check_extensions() const {
  if (!root().has("extensionsRequired")) return;
  root().for_each("extensionsRequired", [&](const nlohmann::json& required, const std::string&) {
    const std::string extension = required.is_string() ? required.get<std::string>() : JsonObject::shown(required);
    const auto begins_it = [&](std::string_view start) { return extension.starts_with(start); };
    if (extension != "KHR_mesh_quantization" && std::none_of(std::begin(kOfLooks), std::end(kOfLooks), begins_it))
      throw InputError(name_ + ": requires the extension " + in_quotes(extension) +
                       ", which is not read; save it without");
  });
}

std::size_t GltfFile::count(const char* list) const {
  if (!json_.contains(list)) return 0;
  const nlohmann::json& items = json_[list];
  if (!items.is_array())
    throw InputError(name_ + ": " + list + " is " + JsonObject::shown(items) + ", expected an array [ … ]");
  return items.size();
}

JsonObject GltfFile::item(const char* list, std::size_t i) const {
  const std::size_t items = count(list);
  if (i >= items)
    throw InputError(name_ + ": names " + list + "[" + std::to_string(i) + "] of " + std::to_string(items));
  return {json_[list][i], name_ + " " + list + "[" + std::to_string(i) + "]"};
}

std::string GltfFile::read_buffer(const JsonObject& buffer, std::size_t i) const {
  if (!buffer.has("uri")) {
    if (i != 0 || binary_.empty()) throw InputError(buffer.where() + ": has no bytes");
    return std::string(binary_);
  }
  const std::string uri = buffer.text("uri");
  if (uri.starts_with("data:")) {
    const std::size_t begin = uri.find(";base64,");
    std::string bytes;
    if (begin == std::string::npos || !decode_base64(std::string_view(uri).substr(begin + 8), bytes))
      throw InputError(buffer.where("uri") + ": is not base64");
    return bytes;
  }
  if (uri.find("://") != std::string::npos)
    throw InputError(buffer.where("uri") + ": is " + in_quotes(uri) + ", expected the name of a file");
  const std::filesystem::path folder = path_.parent_path();
  std::error_code ignored;
  try {
    return read_file(std::filesystem::exists(folder / uri, ignored) ? folder / uri : folder / without_per_cent(uri));
  } catch (const InputError& e) {
    throw InputError(buffer.where("uri") + ": " + e.what());
  }
}

const std::string& GltfFile::buffer(std::size_t i) {
  const JsonObject buffer = item("buffers", i);
  if (!buffers_[i]) {
    std::string bytes = read_buffer(buffer, i);
    const auto length = static_cast<std::size_t>(buffer.integer("byteLength", 1, INT64_MAX));
    if (bytes.size() < length)
      throw InputError(buffer.where() + ": has " + std::to_string(bytes.size()) + " bytes, expected " +
                       std::to_string(length));
    bytes.resize(length);
    buffers_[i] = std::move(bytes);
  }
  return *buffers_[i];
}

/// The bytes of the buffer view that `user` names, from its own byteOffset on.
GltfFile::Stretch GltfFile::view(const JsonObject& user, const char* key) {
  const JsonObject view = item("bufferViews", static_cast<std::size_t>(user.integer(key, 0, kMostItems)));
  const std::string& bytes = buffer(static_cast<std::size_t>(view.integer("buffer", 0, kMostItems)));
  const auto offset = static_cast<std::size_t>(view.integer("byteOffset", 0, INT64_MAX, 0));
  const auto length = static_cast<std::size_t>(view.integer("byteLength", 1, INT64_MAX));
  const auto within = static_cast<std::size_t>(user.integer("byteOffset", 0, INT64_MAX, 0));
  if (offset > bytes.size() || length > bytes.size() - offset || within > length)
    throw InputError(view.where() + ": reaches beyond the " + std::to_string(bytes.size()) + " bytes of its buffer");
  return {bytes.data() + offset + within, length - within};
}

std::vector<double> GltfFile::numbers(std::size_t which, std::string_view type) {
  const JsonObject accessor = item("accessors", which);
  if (const std::string seen = accessor.text("type"); seen != type)
    throw InputError(accessor.where("type") + ": is " + in_quotes(seen) + ", expected \"" + std::string(type) + "\"");
  const Stored stored = stored_as(accessor);
  const bool normalised = accessor.boolean("normalized", false);
  const std::size_t components = components_of(type), size = size_of(stored), tight = components * size;
  const auto elements = static_cast<std::size_t>(accessor.integer("count", 1, kMostItems));
  const bool sparse = accessor.has("sparse");
  std::vector<double> numbers;
  if (accessor.has("bufferView")) {
    const Stretch bytes = view(accessor, "bufferView");
    const JsonObject of = item("bufferViews", static_cast<std::size_t>(accessor.integer("bufferView", 0, kMostItems)));
    const auto stride = static_cast<std::size_t>(of.integer("byteStride", 1, 252, static_cast<std::int64_t>(tight)));
    if (bytes.bytes < tight || (bytes.bytes - tight) / stride < elements - 1)
      throw InputError(accessor.where() + ": has " + std::to_string(elements) + " elements, its buffer view only " +
                       std::to_string(bytes.bytes) + " bytes");
    numbers.reserve(elements * components);
    for (std::size_t e = 0; e < elements; ++e)
      for (std::size_t c = 0; c < components; ++c)
        numbers.push_back(number_at(bytes.data + e * stride + c * size, stored, normalised));
  } else {
    // All are 0 but for those that are given one by one: more than these are a few bytes of file for much memory.
    constexpr std::size_t kMostZeros = 1 << 24;
    if (!sparse || elements > kMostZeros)
      throw InputError(accessor.where() + ": has no bufferView (is it compressed?)");
    numbers.assign(elements * components, 0.0);
  }
  if (sparse) overwrite_sparse(accessor, {accessor.at("sparse"), accessor.where("sparse")}, numbers, components);
  return numbers;
}

void GltfFile::overwrite_sparse(const JsonObject& accessor, const JsonObject& sparse, std::vector<double>& numbers,
                                std::size_t components) {
  const JsonObject indices(sparse.at("indices"), sparse.where("indices"));
  const JsonObject values(sparse.at("values"), sparse.where("values"));
  const Stored index_stored = stored_as(indices), stored = stored_as(accessor);
  const bool normalised = accessor.boolean("normalized", false);
  const Stretch at = view(indices, "bufferView"), with = view(values, "bufferView");
  const std::size_t index_size = size_of(index_stored), size = size_of(stored);
  const auto given = static_cast<std::size_t>(sparse.integer("count", 1, kMostItems));
  if (given > at.bytes / index_size || given > with.bytes / (size * components))
    throw InputError(sparse.where() + ": has " + std::to_string(given) + " elements, its buffer views have fewer");
  for (std::size_t i = 0; i < given; ++i) {
    const double element = number_at(at.data + i * index_size, index_stored, false);
    if (!(element >= 0.0 && element < static_cast<double>(numbers.size() / components)))
      throw InputError(indices.where() + ": names element " + std::to_string(element) + " of " +
                       std::to_string(numbers.size() / components));
    for (std::size_t c = 0; c < components; ++c)
      numbers[static_cast<std::size_t>(element) * components + c] =
          number_at(with.data + (i * components + c) * size, stored, normalised);
  }
}

}  // namespace limber::internal
